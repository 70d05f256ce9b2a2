//! `--rivals`: the product of error and time of published samplers over that of the library, for several
//! scenes.
//!
//! All samplers render the same pictures with shadows, with Sobol' numbers and one light per sample. The
//! product of relMSE and time is the error in equal time, as far as errors fall with the number of
//! samples. The time is everything that a sample takes on one core, with its share of what a sampler
//! prepares for a frame. Rounds go in turn, and the fastest counts. Building trees is free for all.

use super::contests::{Arena, Closeness, Contest, GOALS, contests};
use super::front::Ratio;
use super::options::Options;
use super::samplers::Samplers;
use super::settings::{self, Sampler, counted};
use std::fs;
use testbed::common::progress::progress;
use testbed::common::table::{Table, markdown_head, short};
use testbed::direct_light::cells::CellSettings;
use testbed::direct_light::draw::{Draw, Resampled};
use testbed::direct_light::times::StageTimes;
use testbed::measuring::score::Estimate;
use testbed::scene::SceneError;

/// Samples per pixel.
const SAMPLES: f64 = 16.0;
/// The columns of `rivals.csv`: errors with their 95 % confidence intervals, nanoseconds of one sample on
/// one core, and the product of relMSE and time over that of the library's one tree and of its two levels.
const COLUMNS: [&str; 11] = [
    "scene",
    "sampler",
    "rel_mse",
    "rel_mse_low",
    "rel_mse_high",
    "choosing_ns",
    "shadow_ray_ns",
    "shading_ns",
    "sample_ns",
    "over_one_tree",
    "over_two_levels",
];

/// The library's rows; the first two are what the others are compared with.
const OWN: [&str; 5] = [
    "Girandole, one tree",
    "Girandole",
    "Girandole, 8 candidates",
    "Girandole, shared cuts",
    "Girandole, shared cuts, 8 candidates",
];

/// A sampler in a scene.
struct Entry {
    sampler: String,
    error: Estimate,
    times: StageTimes,
}

impl Entry {
    /// The product of error and time over that of another.
    fn over(&self, other: &Self) -> Ratio {
        let times = |estimate: &Estimate, time: f64| Estimate {
            mean: estimate.mean * time,
            half_width: estimate.half_width * time,
        };
        Ratio::of(&times(&self.error, self.times.total()), &times(&other.error, other.times.total()))
    }
}

/// Measures all scenes, prints the tables and writes `rivals.csv`.
pub fn run(options: &Options) -> Result<(), SceneError> {
    let closeness = Closeness::new(options);
    let out = &options.out;
    fs::create_dir_all(out).map_err(|error| SceneError(format!("cannot create {}: {error}", out.display())))?;
    let mut table = Table::create(&out.join("rivals.csv"), &COLUMNS).map_err(SceneError)?;
    let contests = contests(options, &closeness)?;
    let goals: Vec<f64> = contests.iter().map(|contest| contest.goal).collect();
    let bar = progress("scenes", contests.len() as u64);
    let mut columns: Vec<(String, Vec<Entry>)> = Vec::new();
    for contest in contests {
        let name = contest.name.clone();
        let entries = measure(contest, &closeness)?;
        for entry in &entries {
            table.add(fields(&name, entry, &entries)).map_err(SceneError)?;
        }
        columns.push((name, entries));
        bar.inc(1);
    }
    bar.finish_and_clear();
    for (place, own) in OWN.iter().enumerate().take(2) {
        testbed::say!(
            "relMSE times time over that of {own}, with 95 % confidence intervals:\n\n{}",
            over(&columns, place)
        );
    }
    let losses = losses(&columns, &goals);
    testbed::say!("Below the goal of {} times, or {} for a file:\n\n{losses}", GOALS[0], GOALS[1]);
    testbed::say!(
        "{}, {} samples per pixel, {} x {} pixels; {}",
        counted(closeness.seeds as usize, "picture"),
        SAMPLES,
        closeness.size.0,
        closeness.size.1,
        out.join("rivals.csv").display()
    );
    Ok(())
}

/// All samplers in one scene; the library's first.
fn measure(contest: Contest, closeness: &Closeness) -> Result<Vec<Entry>, SceneError> {
    let arena = Arena::new(contest.stage, contest.is_matte, closeness.size)?;
    let Arena { view, world, prepared, .. } = &arena;
    let samplers = Samplers::new(world, prepared, view)?;
    let own = |lights, candidates| -> Box<dyn Draw + '_> {
        Box::new(Resampled { lights, candidates, has_gloss: !contest.is_matte })
    };
    let one_tree = prepared.one_level().sampler();
    let mut draws = vec![own(one_tree, 1), own(world.sampler(), 1), own(world.sampler(), 8)];
    for candidates in [1, 8] {
        let settings = CellSettings { has_gloss: !contest.is_matte, candidates, taught: None };
        draws.push(Box::new(arena.cells(settings)?));
    }
    let mut names: Vec<String> = OWN.map(Into::into).into();
    for sampler in settings::others() {
        let with_gloss = if contest.is_matte { None } else { samplers.draw_with_gloss(sampler) };
        let Some(draw) = with_gloss.or_else(|| samplers.draw(sampler)) else { continue };
        draws.push(draw);
        names.push(Sampler::name(sampler));
    }
    let errors: Vec<Estimate> =
        draws.iter_mut().map(|draw| arena.error(draw.as_mut(), SAMPLES, closeness.seeds).0).collect();
    let mut timed: Vec<&mut dyn Draw> = draws.iter_mut().map(|draw| &mut **draw as &mut dyn Draw).collect();
    let times = arena.renderer().stage_times(&mut timed, closeness.timed_pixels);
    let entries = names.into_iter().zip(errors).zip(times);
    Ok(entries.map(|((sampler, error), times)| Entry { sampler, error, times }).collect())
}

/// The line of the CSV file.
fn fields(scene: &str, entry: &Entry, entries: &[Entry]) -> Vec<String> {
    let [low, high] = entry.error.positive_interval();
    let StageTimes { choosing, shadow_rays, shading } = entry.times;
    let times = [choosing, shadow_rays, shading, entry.times.total()].map(|time| format!("{:.1}", time * 1.0e9));
    let over = [0, 1].map(|own: usize| format!("{:.3}", entry.over(&entries[own]).value));
    let errors = [entry.error.mean, low, high].map(|error| format!("{error:.6}"));
    [scene.to_owned(), entry.sampler.clone()].into_iter().chain(errors).chain(times).chain(over).collect()
}

/// The table over one of the library's rows.
fn over(columns: &[(String, Vec<Entry>)], own: usize) -> String {
    let names: Vec<&str> = std::iter::once("sampler").chain(columns.iter().map(|(name, _)| name.as_str())).collect();
    let mut lines = markdown_head(&names) + "\n";
    let count = columns.first().map_or(0, |(_, entries)| entries.len());
    for row in (0..count).filter(|row| *row != own) {
        let cells: Vec<String> = columns
            .iter()
            .map(|(_, entries)| {
                let Ratio { value, low, high } = entries[row].over(&entries[own]);
                format!("{} ({} to {})", short(value), short(low), short(high))
            })
            .collect();
        lines += &format!("| {} | {} |\n", columns[0].1[row].sampler, cells.join(" | "));
    }
    lines
}

/// The rivals whose product is below the goal, over the better of the library's first two rows.
fn losses(columns: &[(String, Vec<Entry>)], goals: &[f64]) -> String {
    let mut lines = markdown_head(&["scene", "sampler", "over the library's better level", "relMSE", "ns"]) + "\n";
    for ((scene, entries), goal) in columns.iter().zip(goals) {
        for entry in &entries[OWN.len()..] {
            let [one, two] = [0, 1].map(|own: usize| entry.over(&entries[own]).value);
            let value = one.max(two);
            if value < *goal {
                let (error, ns) = (short(entry.error.mean), entry.times.total() * 1.0e9);
                lines += &format!("| {scene} | {} | {} | {error} | {ns:.0} |\n", entry.sampler, short(value));
            }
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::super::rival_scenes::{Lamps, street, tunnel, yard};
    use super::super::scene_view::SceneView;
    use super::*;

    #[test]
    fn all_samplers_are_measured_and_the_library_beats_uniform_choices() {
        let closeness = Closeness { size: (16, 9), seeds: 2, timed_pixels: 50, yard_lights: 200 };
        let stage = yard(Lamps::Points, closeness.yard_lights).expect("a sound scene");
        let contest = Contest { name: "points".into(), stage, is_matte: true, goal: 3.0 };
        let entries = measure(contest, &closeness).expect("it is measured");
        assert_eq!(entries.len(), OWN.len() + settings::others().count());
        let of = |name: &str| entries.iter().find(|entry| entry.sampler == name).expect("a row");
        assert!(of("Girandole").error.mean < 0.2 * of("uniform").error.mean);
        for entry in &entries {
            assert!(entry.error.mean > 0.0 && entry.error.mean < f64::INFINITY, "{}", entry.sampler);
            assert!(entry.times.total() > 0.0 && entry.times.total() < 1.0e-3, "{}", entry.sampler);
        }
        assert_eq!(entries[1].over(&entries[1]).value, 1.0);
        // Where every product is below the goal, every other sampler is a loss.
        let columns = vec![("points".to_owned(), entries)];
        assert_eq!(losses(&columns, &[f64::INFINITY]).lines().count(), 2 + settings::others().count());
        assert_eq!(losses(&columns, &[0.0]).lines().count(), 2);
        assert_eq!(over(&columns, 0).lines().count(), 2 + columns[0].1.len() - 1);
    }

    #[test]
    fn scenes_have_the_lights_that_their_names_promise() {
        for (stage, lights) in [
            (yard(Lamps::Panels, 1_000), 1_000..1_001),
            (yard(Lamps::Points, 1_000), 1_000..1_001),
            (tunnel(), 2_300..2_301),
            (street(), 1_500..4_000),
        ] {
            let stage = stage.expect("a sound scene");
            assert!(lights.contains(&stage.world.light_count()), "{}", stage.world.light_count());
            let view = SceneView::new(&stage.scene, true, (16, 9)).expect("surfaces in view");
            assert!(view.shaded_pixels() > 40.0, "{}", view.shaded_pixels());
        }
    }
}
