//! What fits into no frame is built beside them.

use std::time::Duration;

use girandole::scheduler::WorkKind;
use girandole::{FrameReport, Light, Policy, Shape, TreeKey};

use super::Theater;

/// A tree that takes 2 ms, four frames of budget and no frame's worth of it, all its lights moved.
fn large(seed: u64) -> (Theater, TreeKey) {
    let mut theater = Theater::new(seed);
    theater.calibrate();
    // A light that trembles is no reason.
    let tree = theater.tree(20_000, Policy::Bounded { floor: 0.5, ceiling: 1.0e9 });
    theater.scatter(tree);
    (theater, tree)
}

fn until(theater: &mut Theater, done: impl Fn(&FrameReport) -> bool) -> FrameReport {
    for _ in 0..100 {
        let report = theater.frame(500);
        assert!(report.overrun.is_zero(), "{report:?}");
        if done(&report) {
            return report;
        }
    }
    panic!("it never comes");
}

/// A light a hand's breadth further.
fn nudged(light: &Light) -> Light {
    match light.shape {
        Shape::Point { position } => Light { shape: Shape::Point { position: position + 0.1 }, ..*light },
        _ => *light,
    }
}

/// Whether a rebuild would bring nothing.
fn is_fresh(theater: &Theater, tree: TreeKey) -> bool {
    let tree = theater.world.tree(tree).expect("it lives");
    tree.check().expect("sound");
    let mut fresh = tree.clone();
    fresh.rebuild();
    tree.attributes().splitting_cost < 1.05 * fresh.attributes().splitting_cost
}

#[test]
fn a_large_tree_is_built_in_the_background_and_follows_what_moved_meanwhile() {
    let (mut theater, tree) = large(20);
    let started = until(&mut theater, |report| report.background.started == 1);
    assert_eq!((started.rebuilt_trees, started.waiting_trees, started.background.running), (0, 0, 1));
    assert!(theater.world.jobs().iter().any(|job| job.work.kind == WorkKind::Snapshot));
    assert!(!is_fresh(&theater, tree));
    // Some lights move on before it is done.
    let lights = theater.world.tree(tree).expect("it lives").lights();
    let moved: Vec<_> = (0..100).map(|i| (i, nudged(&lights[i as usize]))).collect();
    theater.world.set_lights(tree, &moved).expect("valid");
    let taken = until(&mut theater, |report| report.background.taken == 1);
    assert_eq!((taken.background.running, taken.background.dropped, taken.refit_trees), (0, 0, 1));
    assert!(is_fresh(&theater, tree));
    let lights = theater.world.tree(tree).expect("it lives").lights();
    assert!(moved.iter().all(|(i, light)| lights[*i as usize] == *light));
    // The GPU hears of it, and nothing asks any more.
    assert!(!theater.world.take_delta().is_empty());
    for _ in 0..20 {
        let report = theater.frame(500);
        assert_eq!((report.background.started, report.waiting_trees, report.refit_trees), (0, 0, 0));
    }
}

#[test]
fn copies_of_lights_keep_to_the_budget_too() {
    let mut theater = Theater::new(21);
    theater.calibrate();
    let tree = theater.tree(60_000, Policy::Budgeted);
    theater.scatter(tree);
    // A copy takes 600 us, a frame has 100.
    let mut copied = 0;
    for _ in 0..20 {
        let report = theater.frame(100);
        assert!(report.overrun.is_zero(), "{report:?}");
        let copies = theater.world.jobs().iter().filter(|job| job.work.kind == WorkKind::Snapshot);
        copied += copies.map(|job| job.work.lights).sum::<usize>();
        if report.background.started == 1 {
            assert_eq!(copied, 60_000);
            return;
        }
    }
    panic!("only {copied} copied");
}

#[test]
fn a_build_whose_tree_is_gone_or_another_is_dropped() {
    type Change = fn(&mut Theater, TreeKey);
    let changes: [(&str, Change, usize); 4] = [
        (
            "removed",
            |theater, tree| {
                let instance = theater.world.instances().next().expect("one");
                theater.world.remove_instance(instance).expect("it lives");
                theater.world.remove_tree(tree).expect("unused");
            },
            0,
        ),
        (
            "other lights",
            |theater, tree| {
                let lights = (0..50).map(|_| super::spark(&mut theater.rng, 5.0)).collect();
                theater.world.replace_lights(tree, lights).expect("valid");
            },
            50,
        ),
        (
            "another policy",
            |theater, _| {
                let instance = theater.world.instances().next().expect("one");
                theater.world.set_policy(instance, Policy::RefitOnly).expect("valid");
            },
            20_000,
        ),
        (
            "rebuilt at once",
            |theater, tree| {
                theater.world.rebuild_tree(tree).expect("it lives");
            },
            20_000,
        ),
    ];
    for (name, change, lights) in changes {
        // While its lights are copied, a part a frame, and while it is built.
        for is_copying in [true, false] {
            let (mut theater, tree) = large(22);
            if is_copying {
                let report = theater.frame(50);
                assert_eq!((report.background.started, report.background.running), (0, 1), "{name}");
            } else {
                until(&mut theater, |report| report.background.started == 1);
            }
            change(&mut theater, tree);
            let report = until(&mut theater, |report| report.background.running == 0);
            assert_eq!((report.background.dropped, report.background.taken), (1, 0), "{name}, copying: {is_copying}");
            let present = theater.world.tree(tree);
            assert_eq!(present.map_or(0, |tree| tree.lights().len()), lights);
            if let Some(tree) = present {
                tree.check().expect("sound");
            }
        }
    }
}

#[test]
fn a_frame_never_waits_for_a_build_on_real_time() {
    let mut world = girandole::LightWorld::new();
    let mut rng = crate::support::Rng(23);
    let mut lights = || (0..100_000).map(|_| super::spark(&mut rng, 10.0)).collect::<Vec<_>>();
    let tree = world.add_tree(lights()).expect("valid");
    world.add_instance(tree, girandole::Placement::IDENTITY, Policy::Budgeted).expect("valid");
    let changes: Vec<_> = (0..).zip(lights()).collect();
    world.set_lights(tree, &changes).expect("valid");
    // Long enough for a copy, and far too short for the build.
    let budget = girandole::FrameBudget::new(Duration::from_millis(8));
    let mut frames_beside = 0;
    // A minute of frames at the least, for machines that have much else to do.
    for _ in 0..60_000 {
        let report = world.update(budget);
        frames_beside += report.background.running;
        if report.background.taken == 1 {
            assert!(frames_beside > 1, "frames went on");
            world.tree(tree).expect("it lives").check().expect("sound");
            return;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    panic!("it is never done");
}

#[test]
fn a_large_tree_that_always_rebuilds_rests_once_its_lights_do() {
    let mut theater = Theater::new(24);
    theater.calibrate();
    let tree = theater.tree(20_000, Policy::AlwaysRebuild);
    theater.scatter(tree);
    until(&mut theater, |report| report.background.taken == 1);
    assert!(is_fresh(&theater, tree));
    for _ in 0..50 {
        let report = theater.frame(500);
        assert_eq!((report.background.started, report.background.running, report.waiting_trees), (0, 0, 0));
    }
}

#[test]
fn large_trees_that_insist_do_not_keep_small_ones_waiting() {
    let mut theater = Theater::new(25);
    theater.calibrate();
    let large: Vec<_> = (0..6).map(|_| theater.tree(20_000, Policy::AlwaysRebuild)).collect();
    let small: Vec<_> = (0..60).map(|_| theater.tree(100, Policy::Budgeted)).collect();
    large.iter().chain(&small).for_each(|tree| theater.scatter(*tree));
    // Thirty fit into a frame, less what is kept for the background and for copies.
    let rebuilt: usize = (0..4).map(|_| theater.frame(300).rebuilt_trees).sum();
    assert_eq!(rebuilt, 60);
    let mut taken = 0;
    for _ in 0..400 {
        taken += theater.frame(300).background.taken;
    }
    assert_eq!(taken, 6);
}

#[test]
fn a_tree_may_become_large_and_small_again_while_it_waits() {
    let mut theater = Theater::new(26);
    theater.calibrate();
    let trees: Vec<_> = (0..40).map(|i| theater.tree(300 + 10 * i, Policy::Budgeted)).collect();
    let mut rng = crate::support::Rng(27);
    for frame in 0..600_usize {
        if frame < 400 {
            let tree = trees[rng.bits() as usize % trees.len()];
            if theater.world.tree(tree).is_some() {
                theater.scatter(tree);
            }
        }
        if frame == 200 {
            // Some go while they wait, in whatever list.
            for tree in &trees[..10] {
                let shown = |instance: &girandole::InstanceKey| theater.world.instance_tree(*instance) == Some(*tree);
                let instance = theater.world.instances().find(shown).expect("one");
                theater.world.remove_instance(instance).expect("it lives");
                theater.world.remove_tree(*tree).expect("unused");
            }
        }
        // Now there is room for all, now for some, now for none.
        let report = theater.frame([100, 40, 0, 35, 1, 60][frame % 6]);
        assert!(report.overrun.is_zero(), "{report:?}");
    }
    assert_eq!(theater.frame(100).waiting_trees, 0);
}

#[test]
fn a_machine_that_slept_through_a_build_goes_on_as_before() {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};

    let sleeps = Arc::new(AtomicBool::new(true));
    let is_asleep = sleeps.clone();
    let clock = Arc::new(girandole::scheduler::VirtualClock::new(move |work| match work.kind {
        WorkKind::Background if is_asleep.load(Ordering::Relaxed) => Duration::from_secs(8 * 3600),
        _ => super::cost(work),
    }));
    let world = girandole::LightWorld::with_clock(clock.clone());
    let mut theater = Theater { world, clock, rng: crate::support::Rng(28) };
    let tree = theater.tree(20_000, Policy::AlwaysRebuild);
    theater.scatter(tree);
    until(&mut theater, |report| report.background.started == 1);
    theater.clock.advance(Duration::from_secs(9 * 3600));
    until(&mut theater, |report| report.background.taken == 1);
    sleeps.store(false, Ordering::Relaxed);
    theater.scatter(tree);
    until(&mut theater, |report| report.background.taken == 1);
}
