//! Trees that do not fit into a frame are built in the background.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use girandole::scheduler::WorkKind;
use girandole::{FrameReport, Light, Policy, Shape, TreeKey};

use super::{CHANGES, TestWorld};

/// A world with a tree whose lights have all moved. Its build takes 2 ms, four budgets of 0.5 ms.
fn world_with_large_tree(seed: u64) -> (TestWorld, TreeKey) {
    let mut test = TestWorld::new(seed);
    test.calibrate();
    // The floor keeps small moves from requesting a rebuild, even a doubtful one.
    let tree = test.add_tree(20_000, Policy::Bounded { floor: 1.0, ceiling: 1.0e9 });
    test.scatter(tree);
    (test, tree)
}

/// Runs frames of 0.5 ms until a report satisfies `is_last`, and returns it. No frame may overrun.
fn run_until(test: &mut TestWorld, is_last: impl Fn(&FrameReport) -> bool) -> FrameReport {
    for _ in 0..100 {
        let report = test.frame(500);
        assert!(report.overrun.is_zero(), "{report:?}");
        if is_last(&report) {
            return report;
        }
    }
    panic!("no report of a hundred frames has what the test waits for");
}

/// The light 0.1 m further along each axis.
fn moved(light: &Light) -> Light {
    match light.shape {
        Shape::Point { position } => light.with_shape(Shape::Point { position: position + 0.1 }),
        _ => *light,
    }
}

/// Whether a tree is about as good as a new tree over its lights.
fn is_as_good_as_new(test: &TestWorld, tree: TreeKey) -> bool {
    let tree = test.world.tree(tree).expect("the tree exists");
    tree.check().expect("a sound tree");
    let mut rebuilt = tree.clone();
    rebuilt.rebuild();
    tree.attributes().splitting_cost < 1.05 * rebuilt.attributes().splitting_cost
}

#[test]
fn a_tree_built_in_the_background_has_the_lights_that_moved_during_the_build() {
    let (mut test, tree) = world_with_large_tree(20);
    let started = run_until(&mut test, |report| report.background.started == 1);
    assert_eq!((started.rebuilt_trees, started.waiting_trees, started.background.running), (0, 0, 1));
    let slice = WorkKind::Slice { tree_lights: 20_000 };
    assert!(test.world.jobs().iter().any(|job| (job.tree, job.work.kind) == (tree, slice)));
    assert!(!is_as_good_as_new(&test, tree));
    let before = test.world.revision();
    let changes: Vec<_> = (0..100).map(|i| (i, moved(&test.lights(tree)[i as usize]))).collect();
    test.world.set_lights(tree, &changes).expect("valid lights");
    let taken = run_until(&mut test, |report| report.background.taken == 1);
    assert_eq!((taken.background.running, taken.background.dropped, taken.refit_trees), (0, 0, 1));
    assert!(is_as_good_as_new(&test, tree));
    assert!(changes.iter().all(|(i, light)| test.lights(tree)[*i as usize] == *light));
    // The tree is uploaded, and nothing is requested any more.
    assert!(test.world.revision() != before);
    for _ in 0..20 {
        let report = test.frame(500);
        assert_eq!((report.background.started, report.waiting_trees, report.refit_trees), (0, 0, 0));
    }
}

#[test]
fn copies_of_lights_are_spread_over_frames_to_keep_to_the_budget() {
    let mut test = TestWorld::new(21);
    test.calibrate();
    let tree = test.add_tree(60_000, Policy::Budgeted);
    test.scatter(tree);
    let mut frames_with_copies = 0;
    for _ in 0..200 {
        let report = test.frame(20);
        assert!(report.overrun.is_zero() && report.rebuilt_trees == 0, "{report:?}");
        frames_with_copies += usize::from(!test.world.jobs().is_empty());
        if report.background.started == 1 {
            assert!(frames_with_copies > 2, "{frames_with_copies}");
            return;
        }
    }
    panic!("the lights are not copied in {frames_with_copies} frames");
}

#[test]
fn a_build_is_dropped_if_its_tree_is_removed_replaced_rebuilt_or_no_longer_rebuilds() {
    for (name, change, lights) in CHANGES {
        let (mut test, tree) = world_with_large_tree(22);
        run_until(&mut test, |report| report.background.started == 1);
        change(&mut test, tree);
        let report = run_until(&mut test, |report| report.background.running == 0);
        assert_eq!((report.background.dropped, report.background.taken), (1, 0), "{name}");
        let present = test.world.tree(tree);
        assert_eq!(present.map_or(0, |tree| tree.lights().len()), lights, "{name}");
        if let Some(tree) = present {
            tree.check().expect("a sound tree");
        }
    }
}

#[test]
fn a_build_that_nothing_needs_any_more_still_occupies_the_thread_and_is_reported() {
    // A build in the background takes longer than a hundred frames.
    let mut test = TestWorld::with_cost(29, |work| match work.kind {
        WorkKind::Background => Duration::from_secs(3),
        _ => super::cost(work),
    });
    let trees = [0, 1].map(|_| test.add_tree(20_000, Policy::AlwaysRebuild));
    trees.iter().for_each(|tree| test.scatter(*tree));
    run_until(&mut test, |report| report.background.started == 1);
    let built = test.world.jobs().last().expect("a slice").tree;
    test.remove(built);
    // The predicted time is paid for within a few frames.
    for frame in 0..50 {
        let report = test.frame(500);
        assert_eq!((report.background.running, report.background.started), (1, 0), "frame {frame}");
    }
    test.clock.advance(Duration::from_secs(4));
    assert_eq!(test.frame(500).background.dropped, 1);
    run_until(&mut test, |report| report.background.started == 1);
    test.clock.advance(Duration::from_secs(4));
    run_until(&mut test, |report| report.background.taken == 1);
}

#[test]
fn a_large_tree_that_always_rebuilds_requests_nothing_while_its_lights_rest() {
    let mut test = TestWorld::new(24);
    test.calibrate();
    let tree = test.add_tree(20_000, Policy::AlwaysRebuild);
    test.scatter(tree);
    run_until(&mut test, |report| report.background.taken == 1);
    assert!(is_as_good_as_new(&test, tree));
    for _ in 0..50 {
        let report = test.frame(500);
        assert_eq!((report.background.started, report.background.running, report.waiting_trees), (0, 0, 0));
    }
}

#[test]
fn urgent_large_trees_keep_small_trees_waiting_no_longer_than_their_builds_take() {
    let mut test = TestWorld::new(25);
    test.calibrate();
    let large: Vec<_> = (0..6).map(|_| test.add_tree(20_000, Policy::AlwaysRebuild)).collect();
    let small: Vec<_> = (0..60).map(|_| test.add_tree(100, Policy::Budgeted)).collect();
    large.iter().chain(&small).for_each(|tree| test.scatter(*tree));
    // All builds take 12.6 ms, 42 budgets of 300 µs, and each installation takes another frame.
    let mut spent = Duration::ZERO;
    for _ in 0..42 + 6 {
        let report = test.frame(300);
        assert!(report.overrun.is_zero(), "{report:?}");
        spent += report.spent + report.background.spent;
    }
    assert!(large.iter().chain(&small).all(|tree| test.is_as_new(*tree)));
    assert_eq!(test.frame(300).waiting_trees, 0);
    assert!(spent > Duration::from_micros(12_600), "{spent:?}");
}

#[test]
fn background_builds_continue_after_one_that_took_hours_by_the_clock() {
    let is_suspended = Arc::new(AtomicBool::new(true));
    let flag = is_suspended.clone();
    let mut test = TestWorld::with_cost(28, move |work| match work.kind {
        WorkKind::Background if flag.load(Ordering::Relaxed) => Duration::from_secs(8 * 3600),
        _ => super::cost(work),
    });
    let tree = test.add_tree(20_000, Policy::AlwaysRebuild);
    test.scatter(tree);
    run_until(&mut test, |report| report.background.started == 1);
    test.clock.advance(Duration::from_secs(9 * 3600));
    run_until(&mut test, |report| report.background.taken == 1);
    is_suspended.store(false, Ordering::Relaxed);
    test.scatter(tree);
    run_until(&mut test, |report| report.background.taken == 1);
}
