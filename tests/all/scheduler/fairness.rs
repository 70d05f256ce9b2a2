//! The order in which trees are rebuilt, the time that it takes, and how long trees wait.

use std::time::Duration;

use girandole::glam::{DVec3, Vec3};
use girandole::scheduler::WorkKind;
use girandole::{FrameBudget, Light, Placement, Policy, Shape, TreeKey};

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
    // Each rebuild takes 10 µs.
    add_scattered(&mut test, 10, 100);
    let none = test.frame(0);
    assert_eq!((none.refit_trees, none.refit_lights, none.rebuilt_trees, none.waiting_trees), (10, 1000, 0, 10));
    assert_eq!((none.spent, none.overrun), (Duration::ZERO, Duration::ZERO));
    let mut rebuilt = 0;
    for frame in 1..=4 {
        let report = test.frame(40);
        rebuilt += report.rebuilt_trees;
        assert_eq!(report.rebuilt_trees, if frame < 4 { 3 } else { 1 });
        assert_eq!(report.spent, Duration::from_micros(10 * report.rebuilt_trees as u64));
        assert_eq!((report.overrun, report.deciding), (Duration::ZERO, Duration::ZERO));
        assert_eq!(report.waiting_trees, 10 - rebuilt);
        assert_eq!(report.longest_wait, frame);
        let jobs = rebuild_jobs(&test.world);
        assert_eq!(jobs.len(), report.rebuilt_trees);
        assert!(jobs.iter().all(|job| job.work.kind == WorkKind::Rebuild && job.work.lights == 100));
        assert_eq!(jobs.iter().map(|job| job.took).sum::<Duration>(), report.spent);
        assert!(jobs.iter().all(|job| job.predicted.abs_diff(job.took) < job.took / 20), "{jobs:?}");
        assert_eq!(test.world.jobs().iter().map(|job| job.predicted).sum::<Duration>(), report.predicted);
    }
    // While the lights rest, nothing is requested and nothing is done.
    for _ in 0..10 {
        let report = test.frame(1000);
        assert_eq!((report.waiting_trees, report.rebuilt_trees, report.rebuilt_parts), (0, 0, 0));
        assert!(test.world.jobs().is_empty());
    }
    check_trees(&test.world);
}

/// Runs frames until no tree waits, and returns the trees in the order of their rebuilds.
fn rebuild_order(test: &mut TestWorld, micros: u64) -> Vec<TreeKey> {
    let mut order = Vec::new();
    for _ in 0..1000 {
        let report = test.frame(micros);
        order.extend(rebuild_jobs(&test.world).iter().map(|job| job.tree));
        if report.waiting_trees == 0 {
            return order;
        }
    }
    panic!("some trees still wait after a thousand frames");
}

#[test]
fn trees_near_the_viewpoint_go_first_and_then_trees_with_recorded_usage() {
    let mut test = TestWorld::new(2);
    test.calibrate();
    let trees = add_scattered(&mut test, 40, 100);
    let viewpoint = DVec3::new(30.0, 0.0, 0.0);
    test.world.set_viewpoint(viewpoint).expect("a finite viewpoint");
    // A viewpoint that is refused changes nothing.
    test.world.set_viewpoint(DVec3::NAN).expect_err("a viewpoint that is not finite");
    let order = rebuild_order(&mut test, 28);
    assert_eq!(order.len(), 40);
    let distance = |tree: &TreeKey| {
        let placement = test.world.placement(test.instance_of(*tree)).expect("the instance exists");
        placement.translation.distance(viewpoint)
    };
    let mean_distance = |trees: &[TreeKey]| trees.iter().map(distance).sum::<f64>() / trees.len() as f64;
    let near_to_far = mean_distance(&order[..20]) / mean_distance(&order[20..]);
    assert!(near_to_far < 0.8, "{near_to_far}");

    // Now only the last five trees are used.
    trees.iter().for_each(|tree| test.scatter(*tree));
    let used = &trees[35..];
    let usage: Vec<_> = used.iter().map(|tree| (test.instance_of(*tree), 1000)).collect();
    test.world.record_usage(usage);
    let order = rebuild_order(&mut test, 28);
    let positions: Vec<_> = used.iter().map(|tree| order.iter().position(|other| other == tree)).collect();
    assert!(positions.iter().all(|position| position.is_some_and(|position| position < 8)), "{positions:?}");
    // Empty counts, counts of 0 and counts of instances that no longer exist are accepted.
    test.world.record_usage([]);
    let instance = test.world.instances().next().expect("an instance");
    test.world.record_usage([(instance, 0)]);
    test.world.remove_instance(instance).expect("the instance exists");
    test.world.record_usage([(instance, u32::MAX), (instance, u32::MAX)]);
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
    // A sixteenth of 112 µs pays for 0.7 rebuilds of 10 µs a frame. A hundred trees that requested
    // a rebuild earlier, and the tree itself, are served within 145 frames.
    let bound = (101.0 * 10.0 * 16.0 / 112.0_f64).ceil() as u64 + 1;
    assert!(longest <= bound, "{longest} of {bound}");
    assert!(longest > bound / 4, "trees wait for {longest} of {bound}, too short to test the bound");
    let tree = test.world.tree(far).expect("the tree exists");
    let mut rebuilt = tree.clone();
    rebuilt.rebuild();
    assert_eq!(tree.attributes(), rebuilt.attributes(), "the far tree was rebuilt");
}

#[test]
fn a_tree_that_rebuilds_do_not_improve_is_rebuilt_less_and_less() {
    let mut test = TestWorld::new(4);
    test.calibrate();
    // The lights alternate between two grids. The attributes differ, but the best shape is the
    // same.
    let tree = test.add_tree(64, Policy::Budgeted);
    let mut rebuilt = [0; 4];
    for frame in 0..1200_usize {
        let spacing = if frame % 2 == 0 { 1.0 } else { 0.93 };
        let changes: Vec<_> = (0..64)
            .map(|i| (i, Light::point(Vec3::new((i / 8) as f32, (i % 8) as f32 * spacing, 0.0), Vec3::ONE)))
            .collect();
        test.world.set_lights(tree, &changes).expect("valid lights");
        rebuilt[frame / 300] += test.frame(1000).rebuilt_trees;
    }
    assert!(rebuilt[1..].iter().all(|count| *count < 30), "{rebuilt:?} rebuilds in 300 frames each");
}

#[test]
fn only_the_part_of_a_tree_that_changed_is_rebuilt() {
    let mut test = TestWorld::new(5);
    test.calibrate();
    let tree = test.add_tree(4000, Policy::Budgeted);
    // The lights of one corner move.
    let is_in_corner = |light: &Light| match light.shape {
        Shape::Point { position } => position.min_element() > 4.0,
        _ => false,
    };
    let lights = (0..).zip(test.lights(tree));
    let corner: Vec<u32> = lights.filter(|(_, light)| is_in_corner(light)).map(|(i, _)| i).collect();
    assert!(corner.len() > 50 && corner.len() < 500, "{}", corner.len());
    let mut parts = 0;
    for _ in 0..40 {
        let changes: Vec<_> = corner
            .iter()
            .map(|i| (*i, Light::point(Vec3::splat(7.0) + 0.3 * test.rng.place(10.0), Vec3::splat(30.0))))
            .collect();
        test.world.set_lights(tree, &changes).expect("valid lights");
        let report = test.frame(100);
        assert_eq!(report.rebuilt_trees, 0, "the whole tree takes 400 µs");
        assert!(report.overrun.is_zero());
        parts += report.rebuilt_parts;
        let mut jobs = test.world.jobs().iter();
        assert!(jobs.all(|job| job.work.kind == WorkKind::Snapshot || job.work.lights < 1000));
    }
    assert!(parts > 5, "{parts}");
    check_trees(&test.world);
}

#[test]
fn an_abandoned_partial_rebuild_is_a_job_but_not_a_rebuilt_part() {
    let mut test = TestWorld::new(9);
    test.calibrate();
    // Four levels of eight cubes each fill every node. So the nodes of a subtree have no spare ones
    // among them.
    let corner = |i: usize| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2 & 1) as f32);
    let position = |i: usize| 2.0e4 * corner(i >> 9) + 1.0e3 * corner(i >> 6) + 50.0 * corner(i >> 3) + corner(i);
    // The lights of the subtree that is going to change are bright, so that it matters.
    let emission = |i: usize| Vec3::splat(if i < 64 { 1.0e4 } else { 1.0 });
    let lights = (0..4096).map(|i| Light::point(position(i) + 0.05 * test.rng.place(1.0), emission(i))).collect();
    let tree = test.world.add_tree(lights).expect("valid lights");
    let policy = Policy::Bounded { floor: 0.0, ceiling: 1.0e9 };
    test.world.add_instance(tree, Placement::IDENTITY, policy).expect("a valid instance");
    // Lights at halving distances need a deep subtree, with more nodes than the present one has.
    let changes: Vec<_> = (0..64_usize)
        .map(|i| {
            let distance = 1000.0 * 0.5_f32.powi(i as i32 % 24);
            (i as u32, Light::point(distance * Vec3::X + 1.0e-5 * test.rng.place(1.0), emission(i)))
        })
        .collect();
    test.world.set_lights(tree, &changes).expect("valid lights");
    let leaves = test.world.tree(tree).expect("the tree exists").leaves().to_vec();
    let report = test.frame(100);
    let parts: Vec<_> = rebuild_jobs(&test.world).iter().map(|job| (job.work.kind, job.work.lights)).collect();
    assert_eq!(parts, [(WorkKind::RebuildPart, 64)]);
    let after = test.world.tree(tree).expect("the tree exists");
    assert!(after.leaves() == leaves, "the rebuild was abandoned");
    after.check().expect("a sound tree");
    assert_eq!((report.rebuilt_parts, report.rebuilt_trees), (0, 0));
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
    assert!(report.waiting_trees > 20_000, "{report:?}");
    // A rebuild of nine lights takes 0.9 µs.
    assert!(report.rebuilt_trees > 50 && report.overrun.is_zero(), "{report:?}");
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

#[test]
fn frames_with_a_zero_budget_keep_the_credit_of_the_oldest_tree() {
    let mut test = TestWorld::new(8);
    test.calibrate();
    // Near trees with a high priority fill every frame. The far tree is served from the credit of
    // the oldest tree only, which has to grow although every other frame has a budget of zero.
    let far = test.add_tree(300, Policy::Budgeted);
    test.world.move_instance(test.instance_of(far), far_placement()).expect("a valid placement");
    test.world.set_viewpoint(DVec3::ZERO).expect("a finite viewpoint");
    let near: Vec<_> = (0..30).map(|_| test.add_tree(100, Policy::Budgeted)).collect();
    for frame in 0..400 {
        if frame == 41 {
            // The credit of earlier frames is spent by now.
            test.scatter(far);
        }
        near.iter().for_each(|tree| test.scatter(*tree));
        test.frame(if frame % 2 == 0 { 100 } else { 0 });
        if rebuild_jobs(&test.world).iter().any(|job| job.tree == far) {
            return;
        }
    }
    panic!("the far tree is never rebuilt");
}
