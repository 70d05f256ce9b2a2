//! The order in which trees are rebuilt, the time that it takes, and how long trees wait.

use std::time::Duration;

use girandole::glam::DVec3;
use girandole::{FrameBudget, Light, LightTree, Placement, Policy, Shape, TreeKey};

use super::{TestWorld, check_trees, far_placement, rebuild_jobs};

/// Adds trees with budgeted rebuilds, and moves all their lights.
fn add_scattered(test: &mut TestWorld, count: usize, lights: usize) -> Vec<TreeKey> {
    let trees: Vec<_> = (0..count).map(|_| test.add_tree(lights, Policy::Budgeted)).collect();
    trees.iter().for_each(|tree| test.scatter(*tree));
    trees
}

#[test]
fn a_frame_rebuilds_what_fits_its_budget_and_reports_it() {
    let mut test = TestWorld::new(1);
    test.calibrate();
    test.world.set_background_builds(false);
    // Each rebuild takes 10 µs.
    let trees = add_scattered(&mut test, 10, 100);
    let none = test.frame(0);
    assert_eq!((none.refit_trees, none.refit_lights, none.rebuilt_trees, none.waiting_trees), (10, 1000, 0, 10));
    assert_eq!((none.spent, none.overrun), (Duration::ZERO, Duration::ZERO));
    let mut rebuilt = Vec::new();
    for frame in 1..=4 {
        let report = test.frame(35);
        rebuilt.push(report.rebuilt_trees);
        // A slice may take 64 units longer than it is meant to.
        assert!(report.overrun < Duration::from_micros(1), "{report:?}");
        assert_eq!((report.spent.saturating_sub(report.budget), report.deciding), (report.overrun, Duration::ZERO));
        assert_eq!(report.longest_wait, frame);
        let jobs = rebuild_jobs(&test.world);
        assert_eq!(jobs.len(), report.rebuilt_trees);
        assert!(jobs.iter().all(|job| job.work.lights == 100 && job.waited == frame));
        assert!(jobs.iter().all(|job| job.predicted.abs_diff(job.took) < job.took / 20), "{jobs:?}");
        let jobs = test.world.jobs();
        assert_eq!(jobs.iter().map(|job| job.took).sum::<Duration>(), report.spent);
        assert_eq!(jobs.iter().map(|job| job.predicted).sum::<Duration>(), report.predicted);
        let states = trees.iter().map(|tree| test.world.rebuild_state(*tree).expect("a live tree"));
        let (waiting, built): (Vec<_>, Vec<_>) = states.partition(|state| state.waited.is_some());
        // The tree whose build is cut waits, too, but is not among those that are counted.
        assert!((report.waiting_trees..=report.waiting_trees + 1).contains(&waiting.len()), "{report:?}");
        assert!(waiting.iter().all(|state| state.waited == Some(frame) && state.age >= frame), "{waiting:?}");
        // The next update installs a build whose last slice was done in this one.
        assert!(built.iter().filter(|state| state.age >= frame).count() <= 1, "{built:?}");
        assert!(report.rebuilt_trees <= built.iter().filter(|state| state.age == 0).count());
    }
    // The rest of each frame goes to slices of another tree.
    assert_eq!(rebuilt, [2, 2, 2, 0]);
    // While the lights rest, nothing is requested and nothing is done.
    for _ in 0..10 {
        let report = test.frame(1000);
        assert_eq!((report.waiting_trees, report.rebuilt_trees), (0, 0));
        assert!(test.world.jobs().is_empty());
    }
    check_trees(&test.world);
    assert!(trees.iter().all(|tree| test.is_as_new(*tree)));
    test.world.rebuild_tree(trees[0]).expect("a live tree");
    let rebuilt = test.world.rebuild_state(trees[0]).map(|state| (state.age, state.waited));
    assert_eq!(rebuilt, Some((0, None)));
    let removed = test.world.add_tree(LightTree::new(Vec::new()).expect("no lights"));
    test.world.remove_tree(removed).expect("a tree without instances");
    assert_eq!(test.world.rebuild_state(removed), None);
}

/// Runs frames until nothing is left to do, and returns the trees in the order of their first jobs.
fn rebuild_order(test: &mut TestWorld, micros: u64) -> Vec<TreeKey> {
    let mut order = Vec::new();
    for _ in 0..1000 {
        test.frame(micros);
        for job in test.world.jobs() {
            if !order.contains(&job.tree) {
                order.push(job.tree);
            }
        }
        if test.world.jobs().is_empty() {
            return order;
        }
    }
    panic!("some trees still wait after a thousand frames");
}

#[test]
fn trees_near_the_viewpoint_go_first() {
    let mut test = TestWorld::new(2);
    test.calibrate();
    let trees = add_scattered(&mut test, 40, 100);
    let (near, far) = trees.split_at(20);
    for tree in far {
        test.world.move_instance(test.instance_of(*tree), far_placement()).expect("a valid placement");
    }
    test.world.set_viewpoint(DVec3::ZERO).expect("a finite viewpoint");
    // A viewpoint that is refused changes nothing.
    test.world.set_viewpoint(DVec3::NAN).expect_err("a viewpoint that is not finite");
    let order = rebuild_order(&mut test, 28);
    assert_eq!(order.len(), 40);
    let is_near = |tree: &TreeKey| near.contains(tree);
    assert!(order[..20].iter().all(is_near), "near trees first");
}

#[test]
fn no_tree_waits_longer_than_the_documented_bound() {
    let mut test = TestWorld::new(3);
    test.calibrate();
    // A far tree has the lowest priority. A hundred near ones always request rebuilds, and a budget
    // has time for eleven.
    let far = test.add_tree(100, Policy::Budgeted);
    test.world.move_instance(test.instance_of(far), far_placement()).expect("a valid placement");
    test.world.set_viewpoint(DVec3::ZERO).expect("a finite viewpoint");
    let near: Vec<_> = (0..100).map(|_| test.add_tree(100, Policy::Budgeted)).collect();
    let mut longest = 0;
    for frame in 0..600 {
        near.iter().for_each(|tree| test.scatter(*tree));
        if frame == 200 {
            test.scatter(far);
        }
        let report = test.frame(112);
        longest = longest.max(report.longest_wait);
        assert!(report.overrun.is_zero(), "{report:?}");
    }
    // A round is the time granted in which all trees can be rebuilt. A tree waits for 9 rounds
    // until no newcomer precedes it, and for one more.
    let bound = (10.0 * 101.0 * 10.0 / 112.0_f64).ceil() as u64 + 1;
    assert!(longest <= bound, "{longest} of {bound}");
    assert!(longest > bound / 4, "trees wait for {longest} of {bound}, too short to test the bound");
    assert!(test.is_as_new(far));
}

#[test]
fn a_tree_that_gains_nothing_is_rebuilt_after_sixteen_rounds_and_once() {
    let mut test = TestWorld::new(4);
    test.calibrate();
    // The lights come together evenly, which changes no attribute.
    let tree = test.add_tree(64, Policy::Budgeted);
    let changes: Vec<_> = (0..).zip(test.lights(tree).iter().map(at_half_distance)).collect();
    test.world.set_lights(tree, &changes).expect("valid lights");
    // A frame with enough time for all trees counts as one round.
    let served: Vec<_> = (0..100)
        .map(|_| {
            let report = test.frame(1000);
            (report.rebuilt_trees, report.waiting_trees)
        })
        .collect();
    let expected = |frame| match frame {
        0..16 => (0, 1),
        16 => (1, 0),
        _ => (0, 0),
    };
    assert_eq!(served, (0..100).map(expected).collect::<Vec<_>>());
}

/// A point light at half of its distance from the origin.
fn at_half_distance(light: &Light) -> Light {
    match light.shape {
        Shape::Point { position } => light.with_shape(Shape::Point { position: 0.5 * position }),
        _ => *light,
    }
}

#[test]
fn a_hundred_thousand_trees_can_wait_at_once() {
    let mut test = TestWorld::new(6);
    test.calibrate();
    let shared = test.add_tree(9, Policy::Budgeted);
    let first = test.instance_of(shared);
    for _ in 1..100_000 {
        test.world.add_instance(shared, Placement::IDENTITY, Policy::Budgeted).expect("a valid instance");
    }
    let instances: Vec<_> = test.world.instances().filter(|instance| *instance != first).collect();
    for instance in instances {
        test.world.make_unique(instance).expect("the instance exists");
    }
    let trees: Vec<_> = test.world.trees().collect();
    assert_eq!(trees.len(), 100_000);
    trees.iter().for_each(|tree| test.scatter(*tree));
    let report = test.frame(90);
    // Every tree that has changed waits, and one may be built in slices.
    assert!((99_999..=100_000).contains(&(report.waiting_trees + report.rebuilt_trees)), "{report:?}");
    // A rebuild of nine lights takes 0.9 µs.
    assert!(report.rebuilt_trees > 90 && report.overrun.is_zero(), "{report:?}");
    // Trees that are removed do not wait any more.
    let instances: Vec<_> = test.world.instances().collect();
    instances.into_iter().for_each(|instance| test.world.remove_instance(instance).expect("the instance exists"));
    trees.into_iter().for_each(|tree| test.world.remove_tree(tree).expect("the tree has no instances"));
    let report = test.frame(90);
    assert_eq!((report.waiting_trees, report.rebuilt_trees, report.longest_wait), (0, 0, 0));
}

#[test]
fn a_long_or_unlimited_budget_rebuilds_all_trees_and_a_zero_budget_none() {
    for (budget, rebuilt) in [(Duration::from_secs(3600), 20), (Duration::MAX, 20), (Duration::ZERO, 0)] {
        let mut test = TestWorld::new(7);
        add_scattered(&mut test, 20, 100);
        let report = test.world.update(FrameBudget::new(budget));
        assert_eq!((report.rebuilt_trees, report.waiting_trees), (rebuilt, 20 - rebuilt));
        assert!(report.overrun.is_zero());
    }
}
