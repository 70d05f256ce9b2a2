//! Clocks that jump or stand still, and clocks that record and replay a run.

use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use girandole::glam::Vec3;
use girandole::scheduler::{Clock, RecordingClock, ReplayClock, SystemClock, VirtualClock, WorkKind};
use girandole::{FrameBudget, FrameReport, JobReport, Light, LightWorld, Placement, Policy, TreeKey};

use super::{FRAME_INTERVAL, TestWorld, check_trees, random_light, tree_contents};
use testbed::testing::support::{Rng, place_tree};

/// Adds trees of random lights, with one instance each.
fn add_trees(world: &mut LightWorld, rng: &mut Rng, sizes: &[usize]) -> Vec<TreeKey> {
    let add_tree = |lights: &usize| {
        let lights = (0..*lights).map(|_| random_light(rng, 10.0)).collect();
        let (tree, _) = place_tree(world, lights, Placement::IDENTITY, Policy::Budgeted);
        tree
    };
    sizes.iter().map(add_tree).collect()
}

#[test]
fn a_world_recovers_from_work_that_took_no_time_and_survives_work_that_took_the_longest() {
    for extreme in [Duration::ZERO, Duration::MAX] {
        let is_extreme = Arc::new(AtomicBool::new(true));
        let flag = is_extreme.clone();
        let cost = move |work| if flag.load(Ordering::Relaxed) { extreme } else { super::cost(work) };
        let mut test = TestWorld::with_cost(31, cost);
        let trees: Vec<_> = (0..10).map(|_| test.add_tree(100, Policy::Budgeted)).collect();
        for frame in 0..20 {
            trees.iter().for_each(|tree| test.scatter(*tree));
            test.frame(100);
            // A clock at the greatest time cannot advance any more, so only the other one recovers.
            is_extreme.store(frame < 5 && extreme.is_zero(), Ordering::Relaxed);
        }
        assert_eq!(test.world.trees().len(), 10);
        check_trees(&test.world);
        if extreme.is_zero() {
            let report = test.frame(100);
            assert!(report.overrun.is_zero(), "{report:?}");
        }
    }
}

/// Runs 60 frames over trees that move; one of them is too large for a frame. `advance` is called
/// before each frame.
fn run_frames(clock: Arc<dyn Clock>, advance: impl Fn()) -> (LightWorld, Vec<(FrameReport, Vec<JobReport>)>) {
    let mut world = LightWorld::with_clock(clock);
    let mut rng = Rng(32);
    let trees = add_trees(&mut world, &mut rng, &[50, 100, 400, 1000, 30_000, 20, 700]);
    let mut reports = Vec::new();
    for frame in 0..60_usize {
        for (i, tree) in trees.iter().enumerate().filter(|(i, _)| (frame + i) % 5 < 2) {
            let count = world.tree(*tree).expect("the tree exists").lights().len() as u32;
            let changes: Vec<_> = (0..count / 4)
                .map(|_| (rng.bits() as u32 % count, Light::point(rng.position(10.0), Vec3::ONE)))
                .collect();
            // The largest tree changes only once, so that its build in the background stays
            // current.
            if i != 4 || frame == 6 {
                world.set_lights(*tree, &changes).expect("valid lights");
            }
        }
        advance();
        let report = world.update(FrameBudget::new(Duration::from_micros(400)));
        reports.push((report, world.jobs().to_vec()));
    }
    (world, reports)
}

#[test]
fn a_replayed_run_equals_the_recorded_one() {
    let recording = Arc::new(RecordingClock::new(SystemClock::default()));
    let (world, reports) = run_frames(recording.clone(), || {});
    let events = recording.take_events();
    assert!(recording.take_events().is_empty() && events.len() > 120);
    let replay = Arc::new(ReplayClock::new(events.iter().copied()));
    let (replayed_world, replayed_reports) = run_frames(replay.clone(), || {});
    assert_eq!(reports, replayed_reports);
    assert!(tree_contents(&world) == tree_contents(&replayed_world));
    assert!(!replay.has_diverged());
    assert!(reports.iter().any(|(report, _)| report.rebuilt_trees > 0));

    // A record that does not fit the run is detected and does no harm.
    let truncated = Arc::new(ReplayClock::new(events.into_iter().take(40)));
    let (diverged_world, _) = run_frames(truncated.clone(), || {});
    assert!(truncated.has_diverged());
    check_trees(&diverged_world);
}

#[cfg(feature = "parallel")]
#[test]
fn a_run_on_a_virtual_clock_repeats_exactly() {
    let run = || {
        let clock = Arc::new(VirtualClock::new(super::cost));
        let (world, reports) = run_frames(clock.clone(), || clock.advance(FRAME_INTERVAL));
        (tree_contents(&world), reports, clock.now())
    };
    let (first, second) = (run(), run());
    assert!(first == second);
    let kinds: Vec<_> = first.1.iter().flat_map(|(_, jobs)| jobs.iter().map(|job| job.work.kind)).collect();
    assert!(kinds.contains(&WorkKind::Rebuild));
    assert!(kinds.iter().any(|kind| matches!(kind, WorkKind::Slice { .. })));
    assert!(first.1.iter().any(|(report, _)| report.background.taken == 1));
}

/// The lines of the library outside of its tests that take a clock from the standard library. Its
/// `Instant` and `SystemTime` panic on wasm32-unknown-unknown.
fn uses_of_std_clocks(folder: &Path) -> Vec<String> {
    let mut uses = Vec::new();
    for entry in fs::read_dir(folder).expect("a folder of the crate") {
        let path = entry.expect("a folder entry").path();
        if path.is_dir() {
            uses.extend(uses_of_std_clocks(&path));
            continue;
        }
        let text = fs::read_to_string(&path).expect("readable text");
        let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or("");
        // The statements are split at semicolons, since an import may span several lines.
        let is_std_clock = |statement: &&str| {
            let code = statement.lines().filter(|line| !line.trim_start().starts_with("//"));
            let code = code.collect::<Vec<_>>().join("\n");
            code.contains("std::time") && (code.contains("Instant") || code.contains("SystemTime"))
        };
        uses.extend(code.split(';').filter(is_std_clock).map(|statement| format!("{}: {statement}", path.display())));
    }
    uses
}

#[test]
fn the_library_takes_no_clock_from_the_standard_library() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    assert_eq!(uses_of_std_clocks(&folder), Vec::<String>::new());
    let clock = fs::read_to_string(folder.join("scheduler/clock.rs")).expect("readable text");
    assert!(clock.contains("use web_time::Instant;"), "the clock of worlds works on wasm32-unknown-unknown");
}
