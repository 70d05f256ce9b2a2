//! Trees that do not fit into a frame are built in slices over several frames where builds in the
//! background are not allowed.

use std::time::Duration;

use girandole::glam::Vec3;
use girandole::scheduler::WorkKind;
use girandole::{Light, Policy, TreeKey};

use super::{CHANGES, TestWorld};

/// The number of lights of the large tree. Its build takes 2 ms.
const LIGHTS: usize = 20_000;
/// The build time of the large tree, in microseconds.
const BUILD_MICROS: u64 = 2_000;
/// The longest slice.
const SLICE: Duration = Duration::from_micros(20);

/// A calibrated world without builds in the background, with a large tree whose lights have all
/// moved.
fn world_with_large_tree(seed: u64) -> (TestWorld, TreeKey) {
    let mut test = TestWorld::new(seed);
    test.calibrate();
    test.world.set_background_builds(false);
    // The floor keeps small moves from requesting a rebuild, even a doubtful one.
    let tree = test.add_tree(LIGHTS, Policy::Bounded { floor: 1.0, ceiling: 1.0e9 });
    test.scatter(tree);
    (test, tree)
}

/// Plays frames until no job is done, and checks that each keeps its budget. Returns the number of
/// frames with jobs.
fn frames_until_done(test: &mut TestWorld, micros: u64, mut before_frame: impl FnMut(&mut TestWorld)) -> u64 {
    for frame in 0..10_000 {
        before_frame(test);
        let report = test.frame(micros);
        assert!(report.overrun <= SLICE, "frame {frame}: {report:?}");
        assert_eq!((report.background.started, report.background.running), (0, 0));
        assert!(test.world.jobs().iter().all(|job| job.took <= SLICE), "frame {frame}: {:?}", test.world.jobs());
        if test.world.jobs().is_empty() {
            return frame;
        }
    }
    panic!("the build is never done");
}

#[test]
fn a_large_tree_becomes_as_new_within_its_build_time_divided_by_the_budget() {
    for micros in [500, 100, 7] {
        let (mut test, tree) = world_with_large_tree(40);
        test.frame(0);
        assert!(!test.is_as_new(tree));
        let before = test.world.revision();
        let mut lights = 0;
        let mut is_slice = true;
        let frames = frames_until_done(&mut test, micros, |test| {
            lights += test.world.jobs().iter().map(|job| job.work.lights).sum::<usize>();
            let kind = WorkKind::Slice { tree_lights: LIGHTS };
            is_slice &= test.world.jobs().iter().all(|job| job.work.kind == kind);
        });
        assert!(is_slice);
        // The slices stand for about all lights of the tree.
        assert!(lights.abs_diff(LIGHTS) < LIGHTS / 10, "{lights}");
        let ideal = BUILD_MICROS.div_ceil(micros);
        assert!(frames <= ideal + ideal / 10 + 3, "{frames} frames of {micros} µs instead of {ideal}");
        // The update after the last slice has installed the tree.
        assert!(test.is_as_new(tree));
        assert!(test.world.revision() != before);
        for _ in 0..20 {
            let report = test.frame(micros);
            assert_eq!((report.waiting_trees, report.refit_trees, test.world.jobs().len()), (0, 0, 0));
        }
    }
}

#[test]
fn lights_that_change_during_a_build_in_frames_keep_their_changes() {
    let (mut test, tree) = world_with_large_tree(41);
    // Lights of which some are copied already and others are not, in every frame.
    let mut step = 0.0;
    let mut last_changes = Vec::new();
    let frames = frames_until_done(&mut test, 100, |test| {
        step += 0.001;
        last_changes = (0..LIGHTS as u32)
            .step_by(10)
            .map(|i| (i, moved(&test.lights(tree)[i as usize], step)))
            .collect::<Vec<_>>();
        test.world.set_lights(tree, &last_changes).expect("valid lights");
    });
    assert!(frames > 10, "{frames}");
    assert!(last_changes.iter().all(|(i, light)| test.lights(tree)[*i as usize] == *light));
    let tree = test.world.tree(tree).expect("the tree exists");
    tree.check().expect("a sound tree");
    let mut rebuilt = tree.clone();
    rebuilt.rebuild();
    assert!(tree.attributes().splitting_cost < 1.05 * rebuilt.attributes().splitting_cost);
}

/// A point light, moved by `distance` along x.
fn moved(light: &Light, distance: f32) -> Light {
    let mean = light.cluster().mean;
    Light::point(mean + distance * Vec3::X, Vec3::ONE)
}

#[test]
fn a_build_in_frames_is_dropped_if_its_tree_is_removed_replaced_rebuilt_or_no_longer_rebuilds() {
    // Runs on a virtual clock are equal.
    let frames_of_build = frames_until_done(&mut world_with_large_tree(42).0, 20, |_| {});
    for (name, change, _) in CHANGES {
        // The change comes while the lights are copied, during the build, and between the last
        // slice and the installation.
        for frames in [1, 10, frames_of_build] {
            let (mut test, tree) = world_with_large_tree(42);
            for _ in 0..frames {
                test.frame(20);
                assert!(!test.world.jobs().is_empty());
            }
            change(&mut test, tree);
            let before = test.world.tree(tree).map(|tree| tree.leaves().to_vec());
            let report = test.frame(20);
            assert_eq!((report.waiting_trees, report.longest_wait), (0, 0), "{name} after {frames} frames");
            assert!(test.world.jobs().is_empty(), "{name} after {frames} frames");
            assert!(test.world.tree(tree).map(|tree| tree.leaves().to_vec()) == before);
            if test.world.tree(tree).is_some() && name != "policy changed" {
                assert!(test.is_as_new(tree), "{name} after {frames} frames");
            }
            // Another tree can be built.
            let other = test.add_tree(LIGHTS, Policy::AlwaysRebuild);
            test.scatter(other);
            frames_until_done(&mut test, 500, |_| {});
            assert!(test.is_as_new(other), "{name} after {frames} frames");
        }
    }
}
