//! Who goes first, how long it takes, and that it ends.

use std::time::Duration;

use girandole::glam::{DVec3, Vec3};
use girandole::scheduler::WorkKind;
use girandole::{FrameBudget, Light, Placement, Policy, TreeKey};

use super::{Theater, builds, far, spark};

/// Trees of so many lights, all of them scattered.
fn scattered(theater: &mut Theater, count: usize, lights: usize) -> Vec<TreeKey> {
    let trees: Vec<_> = (0..count).map(|_| theater.tree(lights, Policy::Budgeted)).collect();
    trees.iter().for_each(|tree| theater.scatter(*tree));
    trees
}

#[test]
fn a_frame_does_what_fits_and_says_so() {
    let mut theater = Theater::new(1);
    theater.calibrate();
    scattered(&mut theater, 10, 100);
    // Ten microseconds each.
    let none = theater.frame(0);
    assert_eq!((none.refit_trees, none.refit_lights, none.rebuilt_trees, none.waiting_trees), (10, 1000, 0, 10));
    assert_eq!((none.spent, none.overrun), (Duration::ZERO, Duration::ZERO));
    let mut rebuilt = 0;
    for frame in 1..=4 {
        let report = theater.frame(40);
        rebuilt += report.rebuilt_trees;
        assert_eq!(report.rebuilt_trees, if frame < 4 { 3 } else { 1 });
        assert_eq!(report.spent, Duration::from_micros(10 * report.rebuilt_trees as u64));
        assert_eq!((report.overrun, report.deciding), (Duration::ZERO, Duration::ZERO));
        assert_eq!(report.waiting_trees, 10 - rebuilt);
        assert_eq!(report.longest_wait, frame);
        let jobs = builds(&theater.world);
        assert_eq!(jobs.len(), report.rebuilt_trees);
        assert!(jobs.iter().all(|job| job.work.kind == WorkKind::Rebuild && job.work.lights == 100));
        assert_eq!(jobs.iter().map(|job| job.took).sum::<Duration>(), report.spent);
        assert!(jobs.iter().all(|job| job.predicted.abs_diff(job.took) < job.took / 20), "{jobs:?}");
        assert_eq!(theater.world.jobs().iter().map(|job| job.predicted).sum::<Duration>(), report.predicted);
    }
    // At rest after that: nothing asks, and nothing is done.
    for _ in 0..10 {
        let report = theater.frame(1000);
        assert_eq!((report.waiting_trees, report.rebuilt_trees, report.rebuilt_parts), (0, 0, 0));
        assert!(theater.world.jobs().is_empty());
    }
    theater.world.trees().for_each(|tree| theater.world.tree(tree).expect("it lives").check().expect("sound"));
}

/// In which order trees are rebuilt, a few a frame.
fn order(theater: &mut Theater, micros: u64) -> Vec<TreeKey> {
    let mut order = Vec::new();
    for _ in 0..1000 {
        let report = theater.frame(micros);
        order.extend(builds(&theater.world).iter().map(|job| job.tree));
        if report.waiting_trees == 0 {
            return order;
        }
    }
    panic!("some starve");
}

#[test]
fn what_is_near_the_eye_or_often_picked_goes_first() {
    let mut theater = Theater::new(2);
    theater.calibrate();
    let trees = scattered(&mut theater, 40, 100);
    theater.world.set_viewpoint(DVec3::new(30.0, 0.0, 0.0)).expect("finite");
    // A viewpoint that is refused changes nothing.
    theater.world.set_viewpoint(DVec3::NAN).expect_err("not finite");
    let distance = |theater: &Theater, tree: TreeKey| {
        let of = |instance| theater.world.instance_tree(instance) == Some(tree);
        let instance = theater.world.instances().find(|instance| of(*instance)).expect("it has one");
        theater.world.placement(instance).expect("it lives").translation.distance(DVec3::new(30.0, 0.0, 0.0))
    };
    let near_to_far = |theater: &Theater, order: &[TreeKey]| {
        let half = order.len() / 2;
        let mean = |trees: &[TreeKey]| trees.iter().map(|tree| distance(theater, *tree)).sum::<f64>() / half as f64;
        mean(&order[..half]) / mean(&order[half..])
    };
    let by_eye = order(&mut theater, 28);
    assert_eq!(by_eye.len(), 40);
    assert!(near_to_far(&theater, &by_eye) < 0.8, "{}", near_to_far(&theater, &by_eye));

    // Now the last five are all that is seen.
    trees.iter().for_each(|tree| theater.scatter(*tree));
    let seen = &trees[35..];
    let instances: Vec<_> = theater.world.instances().collect();
    let picks: Vec<_> = instances
        .into_iter()
        .filter(|instance| theater.world.instance_tree(*instance).is_some_and(|tree| seen.contains(&tree)))
        .map(|instance| (instance, 1000))
        .collect();
    assert_eq!(picks.len(), 5);
    theater.world.record_usage(picks);
    let by_picks = order(&mut theater, 28);
    let places: Vec<_> = seen.iter().map(|tree| by_picks.iter().position(|other| other == tree)).collect();
    assert!(places.iter().all(|place| place.is_some_and(|place| place < 8)), "{places:?}");
    // Counts that say nothing change nothing.
    theater.world.record_usage([]);
    let instance = theater.world.instances().next().expect("one");
    theater.world.record_usage([(instance, 0)]);
    theater.world.remove_instance(instance).expect("it lives");
    theater.world.record_usage([(instance, u32::MAX), (instance, u32::MAX)]);
}

#[test]
fn nobody_waits_longer_than_the_stated_bound() {
    let mut theater = Theater::new(3);
    theater.calibrate();
    // One tree that nobody sees, among a hundred near ones that are never good enough, for a budget of ten rebuilds.
    let unseen = theater.tree(100, Policy::Budgeted);
    let instance = theater.world.instances().next().expect("its own");
    theater.world.move_instance(instance, far()).expect("valid");
    theater.world.set_viewpoint(DVec3::ZERO).expect("finite");
    let near: Vec<_> = (0..100).map(|_| theater.tree(100, Policy::Budgeted)).collect();
    let mut longest = 0;
    for frame in 0..600 {
        near.iter().for_each(|tree| theater.scatter(*tree));
        if frame == 200 {
            theater.scatter(unseen);
        }
        let report = theater.frame(112);
        longest = longest.max(report.longest_wait);
        assert!(report.overrun.is_zero(), "{report:?}");
    }
    // A sixteenth of 112 us is 0.7 rebuilds a frame: a hundred that asked before it are served after 144 frames.
    let bound = (101.0 * 10.0 * 16.0 / 112.0_f64).ceil() as u64 + 1;
    assert!(longest <= bound, "{longest} of {bound}");
    assert!(longest > bound / 4, "the bound is tested, with {longest} of {bound}");
    let attributes = theater.world.tree(unseen).expect("it lives").attributes();
    let mut fresh = theater.world.tree(unseen).expect("it lives").clone();
    fresh.rebuild();
    assert_eq!(attributes, fresh.attributes(), "it was rebuilt");
}

#[test]
fn a_tree_that_rebuilds_do_not_help_stops_being_rebuilt() {
    let mut theater = Theater::new(4);
    theater.calibrate();
    // Its lights jump between two arrangements, a ball and a line: the attributes differ, but never for its shape.
    let tree = theater.tree(64, Policy::Budgeted);
    let mut rebuilt = [0; 4];
    for frame in 0..1200_usize {
        let wide = frame % 2 == 0;
        let changes: Vec<_> = (0..64)
            .map(|i| {
                let place = Vec3::new((i / 8) as f32, (i % 8) as f32 * if wide { 1.0 } else { 0.93 }, 0.0);
                (i, Light::point(place, Vec3::ONE))
            })
            .collect();
        theater.world.set_lights(tree, &changes).expect("valid");
        rebuilt[frame / 300] += theater.frame(1000).rebuilt_trees;
    }
    assert!(rebuilt[1..].iter().all(|count| *count < 30), "{rebuilt:?} rebuilds in 300 frames each");
}

#[test]
fn a_part_that_went_bad_is_rebuilt_alone() {
    let mut theater = Theater::new(5);
    theater.calibrate();
    let tree = theater.tree(4000, Policy::Budgeted);
    // The lights of one corner trade places.
    let corner: Vec<_> = {
        let lights = theater.world.tree(tree).expect("it lives").lights();
        let inside = |light: &Light| match light.shape {
            girandole::Shape::Point { position } => position.min_element() > 4.0,
            _ => false,
        };
        (0..).zip(lights).filter(|(_, light)| inside(light)).map(|(i, _)| i).collect()
    };
    assert!(corner.len() > 50 && corner.len() < 500, "{}", corner.len());
    let mut parts = 0;
    for _ in 0..40 {
        let changes: Vec<_> = corner
            .iter()
            .map(|i| (*i, Light::point(Vec3::splat(7.0) + 0.3 * spark_place(&mut theater), Vec3::splat(30.0))))
            .collect();
        theater.world.set_lights(tree, &changes).expect("valid");
        let report = theater.frame(100);
        assert_eq!(report.rebuilt_trees, 0, "all of it takes 400 us");
        assert!(report.overrun.is_zero());
        parts += report.rebuilt_parts;
        let mut jobs = theater.world.jobs().iter();
        assert!(jobs.all(|job| job.work.kind == WorkKind::Snapshot || job.work.lights < 1000));
    }
    assert!(parts > 5, "{parts}");
    theater.world.tree(tree).expect("it lives").check().expect("sound");
}

fn spark_place(theater: &mut Theater) -> Vec3 {
    match spark(&mut theater.rng, 10.0).shape {
        girandole::Shape::Point { position } => position,
        _ => Vec3::ZERO,
    }
}

#[test]
fn a_hundred_thousand_trees_may_ask_at_once() {
    let mut theater = Theater::new(6);
    theater.calibrate();
    let seed = theater.tree(9, Policy::Budgeted);
    let first = theater.world.instances().next().expect("one");
    for _ in 1..100_000 {
        theater.world.add_instance(seed, Placement::IDENTITY, Policy::Budgeted).expect("valid");
    }
    let instances: Vec<_> = theater.world.instances().filter(|instance| *instance != first).collect();
    for instance in instances {
        theater.world.make_unique(instance).expect("it lives");
    }
    let trees: Vec<_> = theater.world.trees().collect();
    assert_eq!(trees.len(), 100_000);
    trees.iter().for_each(|tree| theater.scatter(*tree));
    let report = theater.frame(90);
    assert!(report.waiting_trees > 20_000, "{report:?}");
    // A rebuild of nine lights takes 0.9 us.
    assert!(report.rebuilt_trees > 50 && report.overrun.is_zero(), "{report:?}");
    // What goes while it waits is forgotten.
    let instances: Vec<_> = theater.world.instances().collect();
    instances.into_iter().for_each(|instance| theater.world.remove_instance(instance).expect("it lives"));
    trees.into_iter().for_each(|tree| theater.world.remove_tree(tree).expect("unused"));
    let report = theater.frame(90);
    assert_eq!((report.waiting_trees, report.rebuilt_trees, report.longest_wait), (0, 0, 0));
}

#[test]
fn an_hour_is_enough_for_all_and_no_budget_for_none() {
    for (budget, rebuilt) in [(Duration::from_secs(3600), 20), (Duration::MAX, 20), (Duration::ZERO, 0)] {
        let mut theater = Theater::new(7);
        scattered(&mut theater, 20, 100);
        let report = theater.world.update(FrameBudget::new(budget));
        assert_eq!((report.rebuilt_trees, report.waiting_trees), (rebuilt, 20 - rebuilt));
        assert!(report.overrun.is_zero());
    }
}

#[test]
fn frames_without_a_budget_between_take_no_turn_away() {
    let mut theater = Theater::new(8);
    theater.calibrate();
    // The best values fill every frame; who waits longest has but its own purse, over frames of nothing too.
    let unseen = theater.tree(300, Policy::Budgeted);
    let instance = theater.world.instances().next().expect("its own");
    theater.world.move_instance(instance, far()).expect("valid");
    theater.world.set_viewpoint(DVec3::ZERO).expect("finite");
    let near: Vec<_> = (0..30).map(|_| theater.tree(100, Policy::Budgeted)).collect();
    for frame in 0..400 {
        if frame == 41 {
            // What was saved up before is spent by now.
            theater.scatter(unseen);
        }
        near.iter().for_each(|tree| theater.scatter(*tree));
        theater.frame(if frame % 2 == 0 { 100 } else { 0 });
        if builds(&theater.world).iter().any(|job| job.tree == unseen) {
            return;
        }
    }
    panic!("it starves");
}
