//! `--reuse`: reservoirs that are kept over frames and neighbours, with new samples by several samplers.
//!
//! All samplers go through the pass of docs/reuse.md: one new sample for each pixel, the reservoir of the last frame and
//! that of one neighbour there, multiple importance sampling by targets with shadows, five shadow rays. Squares of a
//! picture of 1920 x 1080 pixels are drawn, and their middles compared with sums over all lights. Times are those of one
//! core and have everything but the building of trees and of tables of lights. For each part of the pixels the fastest
//! of all pictures counts.

use super::front::Ratio;
use super::options::Options;
use super::reuse_scenes::{Change, Place, Playing};
use super::settings::counted;
use girandole::glam::{IVec2, Vec3};
use girandole::{Light, LightId, Reservoir};
use std::fs;
use std::time::Instant;
use testbed::common::progress::progress;
use testbed::common::table::{Table, markdown_head, short};
use testbed::direct_light::cells::{CellSettings, Cells};
use testbed::direct_light::converged;
use testbed::direct_light::draw::Frame;
use testbed::direct_light::renderer::Renderer;
use testbed::direct_light::reuse::{Before, Drawing, Limits, Moment, Seconds, frame, pixels_before};
use testbed::direct_light::rivals::{FULL_HD, by_name};
use testbed::direct_light::sobol::sobol;
use testbed::direct_light::view::{Square, View};
use testbed::measuring::lights::carried;
use testbed::measuring::score::{Estimate, Score};
use testbed::scene::SceneError;

/// The columns of `reuse.csv`. Errors are those of a frame, with 95 % intervals; times are nanoseconds of a pixel, as
/// means over all frames but the first. `over` is the product of error and time over that of the library.
const COLUMNS: [&str; 17] = [
    "scene",
    "change",
    "sampler",
    "frame",
    "rel_mse",
    "rel_mse_low",
    "rel_mse_high",
    "rel_mse_of_all",
    "mean",
    "mean_low",
    "mean_high",
    "choosing_ns",
    "shadow_rays_ns",
    "merging_ns",
    "over",
    "over_low",
    "over_high",
];
const LIMITS: Limits = Limits { draws: 20.0, neighbours: 1 };
/// The frames in which cells are marked and learn before a picture begins.
const WARM_UP: u32 = 32;
/// The frames whose errors are measured. The first one reuses nothing.
const MEASURED: [u32; 3] = [1, 4, 16];
const PICTURE: (u32, u32) = (1_920, 1_080);
/// The middles of squares in the picture.
const SQUARES: [(f32, f32); 2] = [(0.25, 0.7), (0.5, 0.55)];
/// The size of the picture by which a grid chooses its cells.
const WHOLE: (u32, u32) = (240, 135);
const REFERENCE_SEED: u32 = 1_000_000;

/// A way to draw new samples.
#[derive(Clone, Copy, PartialEq)]
enum Sampler {
    /// The library's cells, and whether they learn.
    Cells {
        learns: bool,
        reuses: bool,
    },
    Published(&'static str),
}

const SAMPLERS: [(&str, Sampler); 6] = [
    ("Girandole", Sampler::Cells { learns: false, reuses: true }),
    ("Girandole, learnt", Sampler::Cells { learns: true, reuses: true }),
    ("Girandole, no reuse", Sampler::Cells { learns: false, reuses: false }),
    ("presampled 32", Sampler::Published("presampled 32")),
    ("presampled 8", Sampler::Published("presampled 8")),
    ("ReGIR", Sampler::Published("regir")),
];

/// How closely a run measures.
struct Closeness {
    pictures: u32,
    /// The edges of a square and of its middle, whose errors count.
    edges: (u32, u32),
    squares: usize,
    warm_up: u32,
    places: usize,
}

impl Closeness {
    fn new(options: &Options) -> Self {
        match options.quick {
            true => {
                Self { pictures: options.pictures.unwrap_or(2), edges: (24, 12), squares: 1, warm_up: 2, places: 1 }
            }
            false => Self {
                pictures: options.pictures.unwrap_or(4),
                edges: (72, 32),
                squares: SQUARES.len(),
                warm_up: WARM_UP,
                places: Place::ALL.len(),
            },
        }
    }
}

/// What was measured of a sampler.
#[derive(Clone)]
struct Entry {
    /// For each measured frame, the scores of all pictures.
    scores: [Vec<Score>; MEASURED.len()],
    /// The stages of a pixel.
    seconds: Seconds,
}

/// Measures all scenes, prints the table and writes `reuse.csv`.
pub fn run(options: &Options) -> Result<(), SceneError> {
    let closeness = Closeness::new(options);
    let out = &options.out;
    fs::create_dir_all(out).map_err(|error| SceneError(format!("cannot create {}: {error}", out.display())))?;
    let mut table = Table::create(&out.join("reuse.csv"), &COLUMNS).map_err(SceneError)?;
    testbed::say!("{}", markdown_head(&COLUMNS));
    let all = Place::ALL[..closeness.places].iter();
    let all: Vec<(Place, Change)> =
        all.flat_map(|(place, changes)| changes.iter().map(move |change| (*place, *change))).collect();
    let bar = progress("scenes", all.len() as u64);
    for (place, change) in all {
        let entries = measure(place, change, &closeness)?;
        for (index, (name, _)) in SAMPLERS.iter().enumerate() {
            for (which, number) in MEASURED.iter().enumerate() {
                let head = [place.name(), change.name().into(), (*name).into(), counted(*number as usize, "frame")];
                let fields: Vec<String> = head.into_iter().chain(fields(&entries, index, which)).collect();
                testbed::say!("| {} |", fields.join(" | "));
                table.add(fields).map_err(SceneError)?;
            }
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(())
}

impl Entry {
    fn estimate(&self, frame: usize, value: impl Fn(&Score) -> f64) -> Estimate {
        Estimate::new(&self.scores[frame].iter().map(value).collect::<Vec<_>>())
    }

    /// The product of error and time in a frame.
    fn product(&self, frame: usize) -> Estimate {
        let time: f64 = self.seconds.iter().sum();
        self.estimate(frame, |score| score.rel_mse * time)
    }
}

fn fields(entries: &[Entry], index: usize, frame: usize) -> Vec<String> {
    let entry = &entries[index];
    let error = entry.estimate(frame, |score| score.rel_mse);
    let mean = entry.estimate(frame, |score| score.mean);
    let [low, high] = error.positive_interval();
    let over = Ratio::of(&entry.product(frame), &entries[0].product(frame));
    let times = entry.seconds.map(|time| format!("{:.0}", time * 1.0e9));
    let of_all = entry.estimate(frame, |score| score.rel_mse_of_all);
    [error.mean, low, high, of_all.mean]
        .map(short)
        .into_iter()
        .chain([mean.mean, mean.low(), mean.high()].map(|mean| format!("{mean:.4}")))
        .chain(times)
        .chain([over.value, over.low, over.high].map(short))
        .collect()
}

/// All samplers in a scene, over several squares.
fn measure(place: Place, change: Change, closeness: &Closeness) -> Result<Vec<Entry>, SceneError> {
    let mut squares = Vec::new();
    for middle in &SQUARES[..closeness.squares] {
        squares.push(measure_square(place, change, closeness, *middle)?);
    }
    let count = squares.len() as f64;
    let mean = |index: usize| {
        let of = |frame: usize, picture: usize| {
            let sum = |value: fn(&Score) -> f64| {
                squares.iter().map(|square: &Vec<Entry>| value(&square[index].scores[frame][picture])).sum::<f64>()
                    / count
            };
            Score {
                mape: sum(|score| score.mape),
                rel_mse: sum(|score| score.rel_mse),
                rel_mse_of_all: sum(|score| score.rel_mse_of_all),
                mean: sum(|score| score.mean),
            }
        };
        let scores =
            std::array::from_fn(|frame| (0..closeness.pictures as usize).map(|picture| of(frame, picture)).collect());
        let seconds =
            std::array::from_fn(|stage| squares.iter().map(|square| square[index].seconds[stage]).sum::<f64>() / count);
        Entry { scores, seconds }
    };
    Ok((0..SAMPLERS.len()).map(mean).collect())
}

/// What a picture keeps from frame to frame.
struct Kept {
    cells: Option<Cells>,
    reservoirs: Vec<Reservoir>,
}

fn measure_square(
    place: Place,
    change: Change,
    closeness: &Closeness,
    place_in_picture: (f32, f32),
) -> Result<Vec<Entry>, SceneError> {
    let (edge, inner) = closeness.edges;
    let [x, y] = [(place_in_picture.0, PICTURE.0), (place_in_picture.1, PICTURE.1)]
        .map(|(share, size)| (share * size as f32) as u32);
    let around = |edge: u32| Square { picture: PICTURE, corner: (x - edge / 2, y - edge / 2), edge };
    let [square, middle] = [edge, inner].map(around);
    let [mut now, mut then] =
        [Playing::new(place, change, closeness.warm_up)?, Playing::new(place, change, closeness.warm_up)?];
    let mut view = square.view(&now.stage.scene, &now.geometry);
    let mut kept = Vec::new();
    for (_, sampler) in SAMPLERS {
        for _ in 0..closeness.pictures {
            let cells = match sampler {
                Sampler::Cells { learns, .. } => Some(cells(place, learns)?),
                _ => None,
            };
            kept.push(Kept { cells, reservoirs: Vec::new() });
        }
    }
    let mut seconds: Vec<Vec<Seconds>> = vec![Vec::new(); SAMPLERS.len()];
    let mut entries = vec![Entry { scores: Default::default(), seconds: [0.0; 3] }; SAMPLERS.len()];
    let last = *MEASURED.last().unwrap_or(&1);
    for step in 0..closeness.warm_up + last {
        let view_then = view;
        if step > 0 {
            now.advance()?;
        }
        if step > 1 {
            then.advance()?;
        }
        view = square.view(&now.stage.scene, &now.geometry);
        let [shown, shown_then] = [(&now, &view), (&then, &view_then)].map(|(playing, view)| renderer(playing, view));
        let lights = Lights {
            ids: now.stage.world.sampler().all_lights().collect(),
            carried: carried(&now.stage.world),
            whole: View::new(&now.stage.scene, &now.geometry, WHOLE),
        };
        let moment = Moment { renderer: shown, lights: now.stage.world.sampler() };
        let moment_then = Moment { renderer: shown_then, lights: then.stage.world.sampler() };
        let pixels = pixels_before(&shown, &shown_then, &square);
        let number = (step + 1).saturating_sub(closeness.warm_up);
        let which = MEASURED.iter().position(|frame| *frame == number);
        let reference = which.map(|_| {
            let view = middle.view(&now.stage.scene, &now.geometry);
            converged::picture(&renderer(&now, &view), &moment.lights, &lights.ids, REFERENCE_SEED)
        });
        for (index, (_, sampler)) in SAMPLERS.iter().enumerate() {
            if number == 0 && !matches!(sampler, Sampler::Cells { .. }) {
                continue;
            }
            let mut fastest: Vec<Seconds> = Vec::new();
            for seed in 0..closeness.pictures {
                let kept = &mut kept[index * closeness.pictures as usize + seed as usize];
                let before = (number > 1).then(|| Before {
                    moment: moment_then,
                    pixels: pixels.clone(),
                    kept: &kept.reservoirs,
                });
                let drawing = drawn(*sampler, (&now, &moment, &lights), &mut kept.cells, before.as_ref(), (seed, step));
                fastest.resize(drawing.seconds.len(), [f64::INFINITY; 3]);
                for (fastest, seconds) in fastest.iter_mut().zip(&drawing.seconds) {
                    for (fastest, seconds) in fastest.iter_mut().zip(seconds) {
                        *fastest = fastest.min(*seconds);
                    }
                }
                if let (Some(which), Some(reference)) = (which, &reference) {
                    entries[index].scores[which].push(Score::new(&cut(&drawing.picture, edge, inner), reference));
                }
                kept.reservoirs = drawing.kept;
            }
            if number > 1 {
                seconds[index].push(sums(&fastest));
            }
        }
    }
    let count = f64::from(edge * edge);
    for (entry, seconds) in entries.iter_mut().zip(&seconds) {
        entry.seconds = sums(seconds).map(|sum| sum / (seconds.len() as f64 * count));
    }
    Ok(entries)
}

/// The lights of a frame as lists, and the whole picture.
struct Lights {
    ids: Vec<LightId>,
    carried: Vec<Light>,
    whole: View,
}

fn cells(place: Place, learns: bool) -> Result<Cells, SceneError> {
    let settings = CellSettings { has_gloss: !place.is_matte(), candidates: 1, taught: learns.then_some(WARM_UP) };
    Cells::new(settings).map_err(|error| SceneError(error.to_string()))
}

fn renderer<'a>(playing: &'a Playing, view: &'a View) -> Renderer<'a> {
    Renderer { scene: &playing.stage.scene, geometry: &playing.geometry, view, numbers: sobol }
}

fn sums(all: &[Seconds]) -> Seconds {
    std::array::from_fn(|stage| all.iter().map(|seconds| seconds[stage]).sum())
}

/// The middle of a square.
fn cut(picture: &[Vec3], edge: u32, inner: u32) -> Vec<Vec3> {
    let margin = IVec2::splat(((edge - inner) / 2) as i32);
    let place = |i: u32| margin + IVec2::new((i % inner) as i32, (i / inner) as i32);
    (0..inner * inner).map(place).map(|place| picture[(place.y * edge as i32 + place.x) as usize]).collect()
}

/// Draws a frame by a sampler. What it prepares counts to the time of choosing, as the share of these pixels.
fn drawn(
    sampler: Sampler,
    (playing, now, lights): (&Playing, &Moment<'_>, &Lights),
    cells: &mut Option<Cells>,
    before: Option<&Before<'_>>,
    place: (u32, u32),
) -> Drawing {
    let world = &playing.stage.world;
    let pixels = now.renderer.view.pixels.len() as f64;
    let number = Frame { seed: place.0, number: place.1, found: &[] };
    let list = (world.sampler(), lights.ids.as_slice(), lights.carried.as_slice());
    let single = rayon::ThreadPoolBuilder::new().num_threads(1).build().ok();
    let timed = |work: &mut (dyn FnMut() + Send)| {
        let start = Instant::now();
        match &single {
            Some(pool) => pool.install(work),
            None => work(),
        }
        start.elapsed().as_secs_f64()
    };
    let (mut drawing, preparing) = match (sampler, cells) {
        (Sampler::Cells { reuses, .. }, Some(cells)) => {
            cells.set_view(world, &playing.stage.scene.camera, PICTURE.1 as f32, 1.0);
            let folding = timed(&mut || cells.end_frame());
            let building = timed(&mut || cells.build(world));
            let limits = if reuses { LIMITS } else { Limits { draws: 0.0, neighbours: 0 } };
            (frame(&cells.draws(world), now, before, limits, place), folding / FULL_HD + building / pixels)
        }
        (Sampler::Published(name), _) => match by_name(name, list, (now.renderer.view, &lights.whole)) {
            Some(mut draw) => {
                let preparing = timed(&mut || draw.prepare(&number));
                (frame(draw.as_ref(), now, before, LIMITS, place), preparing / draw.samples_per_preparation(pixels))
            }
            None => unreachable!("{name} is in the list of published samplers"),
        },
        (Sampler::Cells { .. }, None) => unreachable!("cells were made for each picture"),
    };
    let parts = drawing.seconds.len() as f64;
    for seconds in &mut drawing.seconds {
        seconds[0] += preparing * pixels / parts;
    }
    drawing
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reuse_lowers_the_noise_of_all_samplers_and_the_library_has_least() {
        let closeness = Closeness { pictures: 2, edges: (24, 12), squares: 1, warm_up: 2, places: 1 };
        let entries = measure(Place::Points(100), Change::Lights, &closeness).expect("it is measured");
        let error = |index: usize, frame: usize| entries[index].estimate(frame, |score| score.rel_mse).mean;
        for (index, (name, sampler)) in SAMPLERS.iter().enumerate() {
            let reuses = !matches!(sampler, Sampler::Cells { reuses: false, .. });
            let [first, last] = [0, 2].map(|frame| error(index, frame));
            assert!(last > 0.0 && (last < 0.3 * first) == reuses, "{name}: {first}, then {last}");
            assert!(reuses || error(0, 1) < 0.5 * error(index, 1), "{name}");
            assert!(entries[index].seconds.iter().all(|seconds| (0.0..1.0e-3).contains(seconds)), "{name}");
        }
        assert_eq!(error(0, 0), error(2, 0), "the first frame reuses nothing");
        assert!(error(0, 1) < 0.5 * error(3, 1), "{} and {}", error(0, 1), error(3, 1));
    }
}
