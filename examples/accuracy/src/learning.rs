//! `--learning`: what learnt visibility buys cells that share cuts, for the scenes of `--rivals` and two more.
//!
//! [`TAUGHT`] frames with one sample per pixel have taught. The gain is the product of relMSE and time without what is
//! learnt over that with it. Times include records, and the fold of the table and the build of cells by as
//! many samples as share them.

use super::contests::{Arena, Closeness, Contest, contests};
use super::options::Options;
use super::settings::counted;
use girandole::CandidateCount;
use girandole::glam::Vec3;
use std::fs;
use testbed::common::progress::progress;
use testbed::common::table::{Table, markdown_head, short};
use testbed::direct_light::cells::{CellSettings, TAUGHT};
use testbed::direct_light::draw::Draw;
use testbed::measuring::crops::{Crops, Window};
use testbed::render::metering::meter;
use testbed::scene::SceneError;
use testbed::tone_mapping::agx;

/// Samples per pixel.
const SAMPLES: [u32; 3] = [1, 4, 16];
/// Candidates of a sample.
const CANDIDATES: [CandidateCount; 3] = [CandidateCount::ONE, CandidateCount::of::<4>(), CandidateCount::of::<8>()];

/// The columns of `learning.csv`: relMSE and nanoseconds of a sample on one core, without and with what is
/// learnt, and the gain in equal time. `best` has on both sides the number of candidates with the least product.
const COLUMNS: [&str; 8] =
    ["scene", "candidates", "samples", "rel_mse_without", "rel_mse_with", "ns_without", "ns_with", "gain"];

/// The scenes of the film, and its frames.
const FILMED: [&str; 2] = ["ten rooms", "glossy street"];
const FRAMES: [u32; 3] = [1, 4, 16];
/// Samples per pixel of its pictures.
const FILM_SAMPLES: f64 = 4.0;

/// The error and the nanoseconds of a sample.
#[derive(Clone, Copy)]
struct Cost {
    error: f64,
    ns: f64,
}

impl Cost {
    fn product(self) -> f64 {
        self.error * self.ns
    }
}

/// Measures all scenes, prints the table, and writes it and the film.
pub fn run(options: &Options) -> Result<(), SceneError> {
    let closeness = Closeness::new(options);
    let out = &options.out;
    fs::create_dir_all(out).map_err(|error| SceneError(format!("cannot create {}: {error}", out.display())))?;
    let mut table = Table::create(&out.join("learning.csv"), &COLUMNS).map_err(SceneError)?;
    testbed::say!("{}", markdown_head(&COLUMNS));
    let mut contests = contests(options, &closeness)?;
    contests.retain(|contest| !options.quick || FILMED.contains(&contest.name.as_str()));
    let bar = progress("scenes", contests.len() as u64);
    for contest in contests {
        let Contest { name, stage, is_matte, .. } = contest;
        let mut arena = Arena::new(stage, is_matte, closeness.size)?;
        let mut row = |candidates: String, samples: u32, [without, with]: [Cost; 2]| {
            let costs =
                [short(without.error), short(with.error), format!("{:.0}", without.ns), format!("{:.0}", with.ns)];
            let gain = format!("{:.3}", without.product() / with.product());
            let head = [name.clone(), candidates, counted(samples as usize, "sample")];
            let fields: Vec<String> = head.into_iter().chain(costs).chain([gain]).collect();
            testbed::say!("| {} |", fields.join(" | "));
            table.add(fields).map_err(SceneError)
        };
        let costs = measure(&arena, is_matte, &closeness)?;
        for (index, samples) in SAMPLES.into_iter().enumerate() {
            for (costs, candidates) in costs.iter().zip(CANDIDATES) {
                row(candidates.to_string(), samples, costs[index])?;
            }
            let best = |learns: usize| {
                let all = costs.iter().map(|costs| costs[index][learns]);
                all.min_by(|a, b| a.product().total_cmp(&b.product())).unwrap_or(costs[0][index][learns])
            };
            row("best".into(), samples, [best(0), best(1)])?;
        }
        if FILMED.contains(&name.as_str()) {
            let path = out.join(format!("learning_{}.svg", name.replace(' ', "_")));
            let svg = film(&mut arena, is_matte, &closeness)?.svg();
            fs::write(&path, svg).map_err(|error| SceneError(format!("cannot write {}: {error}", path.display())))?;
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(())
}

/// For each number of candidates and each of samples, the cost without and with what is learnt.
fn measure(
    arena: &Arena,
    is_matte: bool,
    closeness: &Closeness,
) -> Result<Vec<[[Cost; 2]; SAMPLES.len()]>, SceneError> {
    let mut draws = Vec::new();
    for candidates in CANDIDATES {
        for taught in [None, Some(TAUGHT)] {
            draws.push(arena.cells(CellSettings { has_gloss: !is_matte, candidates, taught })?);
        }
    }
    let errors: Vec<[f64; SAMPLES.len()]> = draws
        .iter_mut()
        .map(|draw| SAMPLES.map(|samples| arena.error(draw, f64::from(samples), closeness.seeds).0.mean))
        .collect();
    let mut timed: Vec<&mut dyn Draw> = draws.iter_mut().map(|draw| draw as &mut dyn Draw).collect();
    let times = arena.renderer().stage_times(&mut timed, closeness.timed_pixels);
    let cost = |draw: usize, index: usize| Cost { error: errors[draw][index], ns: times[draw].total() * 1.0e9 };
    let both =
        |candidates: usize| std::array::from_fn(|index| [cost(2 * candidates, index), cost(2 * candidates + 1, index)]);
    Ok((0..CANDIDATES.len()).map(both).collect())
}

/// Pictures of the same view in several frames, first without and then with what is learnt.
fn film(arena: &mut Arena, is_matte: bool, closeness: &Closeness) -> Result<Crops, SceneError> {
    (arena.view.scene.exposure, arena.view.scene.is_metered) = (1.0, true);
    meter(&mut arena.view.scene, &arena.view.geometry, &arena.world, closeness.size);
    let (width, exposure) = (arena.view.view.width, arena.view.scene.exposure);
    let window = Window::of_most_contrast(&arena.reference, width, (width, width));
    let to_screen = |pixel: Vec3| agx((pixel * exposure).max(Vec3::ZERO));
    let mut all = Vec::new();
    for learns in [false, true] {
        for frame in FRAMES {
            let taught = learns.then_some(frame - 1);
            let settings = CellSettings { has_gloss: !is_matte, candidates: CandidateCount::ONE, taught };
            let mut draw = arena.cells(settings)?;
            let (error, picture) = arena.error(&mut draw, FILM_SAMPLES, closeness.seeds);
            let title = format!("Frame {frame}, {}", if learns { "learnt" } else { "without" });
            let caption = format!("relMSE {}", short(error.mean));
            all.push(window.cut(&picture, to_screen, title, caption).map_err(SceneError)?);
        }
    }
    Ok(Crops { all, size: window.size })
}

#[cfg(test)]
mod tests {
    use super::*;
    use testbed::scene::{Stage, Still, rooms};

    #[test]
    fn rooms_gain_from_what_is_learnt_and_the_film_shows_it() {
        let closeness = Closeness { size: (32, 18), seeds: 2, timed_pixels: 50, yard_lights: 200 };
        let (scene, world, _) = rooms::rooms(10, true).expect("a sound scene");
        let mut arena =
            Arena::new(Stage { scene, world, animation: Box::new(Still) }, true, closeness.size).expect("surfaces");
        let costs = measure(&arena, true, &closeness).expect("it is measured");
        // With 16 samples; pictures of this size with one say little.
        for [.., [without, with]] in &costs {
            assert!(with.error < without.error && with.ns > 0.0, "{} {}", without.error, with.error);
        }
        let film = film(&mut arena, true, &closeness).expect("pictures");
        assert_eq!(film.all.len(), 6);
        // The first frame has learnt nothing, so it is the same picture.
        assert_eq!(film.all[0].image, film.all[3].image);
        assert_ne!(film.all[2].image, film.all[5].image);
    }
}
