//! Placeholders light the scene at once, are built within the budgets whatever the policies of
//! their instances, and become the trees that a build makes.

use std::time::Duration;

use girandole::effects::EFFECT_HOLD_UPDATES;
use girandole::glam::{DVec3, Mat3, Vec3};
use girandole::gpu::GpuLights;
use girandole::scheduler::WorkKind;
use girandole::{
    FrameBudget, Light, LightId, LightTree, LightWorld, Placement, Policy, ShadingPoint, TreeKey, WorldError,
};

use crate::gpu::{OTHER_PICKS, close, gpu, requests, sample};
use crate::scheduler::{TestWorld, random_light, rebuild_jobs};
use testbed::measuring::lights::{carried, illuminances};
use testbed::testing::support::{Rng, assert_frequencies};

/// Lights with a smaller share of the illuminance may be above the horizon only by rounding.
const ROUNDING_SHARE: f32 = 1.0e-6;

const UNLIMITED: FrameBudget = FrameBudget::UNLIMITED;

/// The lights of a large tree. Its build takes 0.5 ms, four budgets of [`MICROS`].
const LARGE: usize = 5_000;
const MICROS: u64 = 125;

/// Numbers of frames after which the build of a large tree has not begun, runs in the background,
/// or is partly done, and whether builds run in the background.
const BUILDS_UNDER_WAY: [(u64, bool); 4] = [(0, true), (1, true), (1, false), (3, false)];

fn lamps(rng: &mut Rng, count: usize) -> Vec<Light> {
    (0..count).map(|_| random_light(rng, 10.0)).collect()
}

/// Whether a tree of a world is, bit for bit, the one that a build makes.
fn is_built_as(world: &LightWorld, key: TreeKey, expected: &LightTree) -> bool {
    let tree = world.tree(key).expect("it lives");
    tree.check().expect("the tree is sound");
    !tree.is_placeholder()
        && (tree.nodes(), tree.leaves()) == (expected.nodes(), expected.leaves())
        && (tree.lights(), tree.attributes()) == (expected.lights(), expected.attributes())
}

fn built(lights: &[Light]) -> LightTree {
    LightTree::new(lights.to_vec()).expect("valid")
}

fn squashed() -> Placement {
    Placement { linear: Mat3::from_diagonal(Vec3::new(1.0, 1.0, 0.01)), ..Placement::IDENTITY }
}

/// Plays frames.
fn play(test: &mut TestWorld, frames: u64) {
    for _ in 0..frames {
        test.frame(MICROS);
    }
}

fn placeholders(world: &mut LightWorld) -> usize {
    world.update(FrameBudget::NONE).placeholder_trees
}

#[test]
fn every_light_of_a_placeholder_has_its_true_chance_before_the_build_and_after() {
    let mut rng = Rng(400);
    let mut world = LightWorld::new();
    let lights = rng.lights(300, 8.0);
    let key = world.add_tree(LightTree::new_placeholder(lights).expect("valid"));
    for _ in 0..3 {
        world.add_instance(key, rng.affine(20.0), Policy::Budgeted).expect("valid");
    }
    let points: Vec<_> = (0..30).map(|_| rng.shading_point(25.0)).collect();
    let mut reached = 0;
    for budget in [FrameBudget::NONE, UNLIMITED] {
        let report = world.update(budget);
        assert_eq!(report.placeholder_trees, usize::from(budget == FrameBudget::NONE));
        let sampler = world.sampler();
        for at in &points {
            let lights: Vec<LightId> = sampler.all_lights().collect();
            let pmfs: Vec<f32> = lights.iter().map(|light| sampler.pmf(at, *light)).collect();
            let lux = illuminances(&carried(&world), at);
            assert_eq!(lux.len(), pmfs.len());
            let sum: f32 = lux.iter().sum();
            for (lux, pmf) in lux.iter().zip(&pmfs).filter(|(lux, _)| **lux > ROUNDING_SHARE * sum) {
                assert!(*pmf > 0.0, "{lux} of {sum} lux");
                reached += 1;
            }
            assert_frequencies(&sampler, at, 4_000, &mut rng);
        }
    }
    assert!(reached > 1000, "{reached}");
}

#[test]
fn a_placeholder_is_built_whatever_the_policies_are_and_without_any() {
    let mut rng = Rng(401);
    let bounded = Policy::Bounded { floor: 1.0e9, ceiling: 2.0e9 };
    for policy in [Some(Policy::Static), Some(Policy::RefitOnly), Some(Policy::Budgeted), Some(bounded), None] {
        let mut world = LightWorld::new();
        let lights = lamps(&mut rng, 200);
        let key = world.add_tree(LightTree::new_placeholder(lights.clone()).expect("valid"));
        if let Some(policy) = policy {
            world.add_instance(key, Placement::IDENTITY, policy).expect("valid");
        }
        for _ in 0..3 {
            assert_eq!(placeholders(&mut world), 1, "{policy:?}");
        }
        let before = world.revision();
        let report = world.update(UNLIMITED);
        assert_eq!((report.rebuilt_trees, report.placeholder_trees, report.waiting_trees), (1, 0, 0), "{policy:?}");
        assert!(world.revision() != before, "the built tree is sent");
        assert!(is_built_as(&world, key, &built(&lights)), "{policy:?}");
        for _ in 0..20 {
            let report = world.update(UNLIMITED);
            assert_eq!((report.rebuilt_trees, report.refit_trees), (0, 0), "{policy:?}");
        }
    }
}

#[test]
fn a_gpu_that_got_a_placeholder_and_then_the_built_tree_samples_as_the_cpu_does() {
    let (device, queue) = gpu();
    let mut rng = Rng(413);
    let mut world = LightWorld::new();
    let key = world.add_tree(LightTree::new_placeholder(lamps(&mut rng, 600)).expect("valid"));
    world.add_instance(key, Placement::IDENTITY, Policy::Static).expect("valid");
    let requests = requests(&mut rng, 2048, 15.0);
    let mut lights = GpuLights::new(&device, &queue).expect("default limits are enough");
    for budget in [FrameBudget::NONE, UNLIMITED] {
        world.update(budget);
        let records = sample(&mut lights, &mut world, &requests);
        let sampler = world.sampler().from_roots();
        let mut others = 0;
        for (request, record) in requests.iter().zip(&records) {
            let at = ShadingPoint::surface(request.position.into(), request.normal.into());
            let expected = sampler.sample(&at, request.u).map_or(0.0, |sample| sample.pmf);
            others += usize::from(!close(record.pmf, expected));
        }
        // Where a random number falls on the border between two lights.
        assert!(others as f64 <= OTHER_PICKS * requests.len() as f64, "{others}");
        assert!(records.iter().filter(|record| record.pmf > 0.0).count() > 1500);
    }
}

#[test]
fn a_tree_of_one_node_is_never_a_placeholder() {
    let mut rng = Rng(402);
    let mut world = LightWorld::new();
    for count in [0, 1, 8] {
        let lights = lamps(&mut rng, count);
        let key = world.add_tree(LightTree::new_placeholder(lights.clone()).expect("valid"));
        assert!(is_built_as(&world, key, &built(&lights)));
    }
    let key = world.add_tree(LightTree::new_placeholder(lamps(&mut rng, 9)).expect("valid"));
    assert!(world.tree(key).expect("it lives").is_placeholder());
    assert_eq!(placeholders(&mut world), 1);
    let refused = LightTree::new_placeholder(vec![Light::point(Vec3::NAN, Vec3::ONE); 30]);
    assert!(matches!(refused, Err(WorldError::Light { index: 0, .. })));
    assert_eq!(world.tree_count(), 4);
}

#[cfg(feature = "parallel")]
#[test]
fn a_large_placeholder_is_built_in_slices_or_in_the_background() {
    for is_background in [true, false] {
        let mut test = TestWorld::new(403);
        test.calibrate();
        test.world.set_background_builds(is_background);
        let lights = lamps(&mut test.rng, LARGE);
        let key = test.world.add_tree(LightTree::new_placeholder(lights.clone()).expect("valid"));
        test.world.add_instance(key, Placement::IDENTITY, Policy::Static).expect("valid");
        let (mut frames, mut in_slices) = (0, 0);
        loop {
            let report = test.frame(MICROS);
            assert!(report.overrun <= Duration::from_micros(20), "{report:?}");
            assert_eq!(rebuild_jobs(&test.world).len(), 0, "it does not fit into a frame");
            frames += 1;
            if report.placeholder_trees == 0 {
                break;
            }
            in_slices += report.sliced_builds;
            assert_eq!(report.waiting_trees, 0, "its build is under way");
            assert!(frames < 40, "{frames} frames for a build of four");
        }
        // In the background, the first one copies and starts, and the second installs.
        assert_eq!(frames > 3, !is_background, "{frames}");
        // The last slice is done in the frame before the one that installs the build.
        assert_eq!(in_slices, if is_background { 0 } else { frames - 2 });
        assert!(is_built_as(&test.world, key, &built(&lights)));
        let report = test.frame(MICROS);
        assert_eq!((report.waiting_trees, report.background.running, test.world.jobs().len()), (0, 0, 0));
    }
}

#[test]
fn a_thousand_small_placeholders_are_built_in_batches_that_use_the_budgets() {
    let mut test = TestWorld::new(404);
    test.calibrate();
    let lights: Vec<_> = (0..1000).map(|_| lamps(&mut test.rng, 30)).collect();
    let keys: Vec<_> = lights
        .iter()
        .map(|lights| test.world.add_tree(LightTree::new_placeholder(lights.clone()).expect("valid")))
        .collect();
    for key in &keys {
        let place = test.rng.position(500.0).as_dvec3();
        test.world.add_instance(*key, Placement::at(place), Policy::Static).expect("valid");
    }
    // All builds take 3 ms, ten budgets.
    let mut frames = 0;
    while frames == 0 || test.world.update(FrameBudget::NONE).placeholder_trees > 0 {
        let report = test.frame(300);
        assert!(report.overrun.is_zero(), "{report:?}");
        assert!(report.rebuilt_trees >= 80 || report.placeholder_trees == 0, "{report:?}");
        assert!(test.world.jobs().iter().all(|job| job.work.kind == WorkKind::Rebuild));
        frames += 1;
        assert!(frames < 13, "{frames}");
    }
    assert!(keys.iter().zip(&lights).all(|(key, lights)| is_built_as(&test.world, *key, &built(lights))));
}

#[test]
fn a_placeholder_waits_no_longer_than_trees_that_always_ask() {
    let mut test = TestWorld::new(405);
    test.calibrate();
    let busy: Vec<_> = (0..20).map(|_| test.add_tree(300, Policy::AlwaysRebuild)).collect();
    let lights = lamps(&mut test.rng, 300);
    let key = test.world.add_tree(LightTree::new_placeholder(lights).expect("valid"));
    // Far away and without an instance, so its build gains little.
    let mut frames = 0;
    while test.world.tree(key).expect("it lives").is_placeholder() {
        busy.iter().for_each(|tree| test.scatter(*tree));
        test.frame(100);
        frames += 1;
        // A round of all trees takes 6.3 budgets, and no newcomer precedes it after nine rounds.
        assert!(frames < 80, "{frames}");
    }
}

#[test]
fn edits_before_and_during_the_build_are_in_the_built_tree() {
    for frames_before in 0..5 {
        let mut test = TestWorld::new(406 + frames_before);
        test.calibrate();
        test.world.set_background_builds(frames_before % 2 == 0);
        let mut expected = lamps(&mut test.rng, LARGE);
        let key = test.world.add_tree(LightTree::new_placeholder(expected.clone()).expect("valid"));
        test.world.add_instance(key, Placement::IDENTITY, Policy::RefitOnly).expect("valid");
        play(&mut test, frames_before);
        let new = lamps(&mut test.rng, 60);
        for (i, light) in (0..).zip(&new[..40]) {
            test.world.set_lights(key, &[(100 * i, *light)]).expect("valid");
            expected[100 * i as usize] = *light;
        }
        test.world.remove_lights(key, &[17, 450, LARGE as u32 - 1]).expect("lights");
        let added = test.world.add_lights(key, &new[40..]).expect("valid");
        assert_eq!(added, (LARGE as u32..LARGE as u32 + 20).collect::<Vec<_>>());
        expected.extend_from_slice(&new[40..]);
        let report = test.frame(0);
        assert_eq!((report.refit_trees, test.world.light_count()), (1, LARGE + 17));
        let tree = test.world.tree(key).expect("it lives");
        tree.check().expect("sound");
        play(&mut test, 60);
        let tree = test.world.tree(key).expect("it lives");
        tree.check().expect("sound");
        assert!(!tree.is_placeholder());
        let is_expected = |(index, (light, expected)): (usize, (&Light, &Light))| match index {
            17 | 450 | 4_999 => light.is_removed(),
            _ => light == expected,
        };
        assert!(tree.lights().iter().zip(&expected).enumerate().all(is_expected) && tree.lights().len() == LARGE + 20);
        if frames_before == 0 {
            // No build was under way.
            let mut rebuilt = tree.clone();
            rebuilt.rebuild();
            assert!(is_built_as(&test.world, key, &rebuilt));
        }
    }
}

#[test]
fn a_static_placeholder_refuses_edits_as_any_static_tree() {
    let mut rng = Rng(412);
    let mut world = LightWorld::new();
    let key = world.add_tree(LightTree::new_placeholder(lamps(&mut rng, 50)).expect("valid"));
    world.add_instance(key, Placement::IDENTITY, Policy::Static).expect("valid");
    assert_eq!(world.set_emission(key, 0, Vec3::ONE), Err(WorldError::StaticTree(key)));
    assert_eq!(world.add_lights(key, &[]), Err(WorldError::StaticTree(key)));
    world.update(UNLIMITED);
    assert!(!world.tree(key).expect("it lives").is_placeholder());
}

#[test]
fn replacements_rebuilds_and_removals_end_the_wait_as_they_say() {
    type Change = fn(&mut LightWorld, TreeKey, &[Light]);
    let changes: [(&str, Change, bool); 5] = [
        ("replace_lights", |world, key, lights| world.replace_lights(key, lights.to_vec()).expect("valid"), false),
        (
            "replace_tree, built",
            |world, key, lights| drop(world.replace_tree(key, built(lights)).expect("live")),
            false,
        ),
        (
            "replace_tree, placeholder",
            |world, key, lights| {
                let by = LightTree::new_placeholder(lights.to_vec()).expect("valid");
                drop(world.replace_tree(key, by).expect("it lives"));
            },
            true,
        ),
        (
            "rebuild_tree after a change of all lights",
            |world, key, lights| {
                let all: Vec<_> = (0..).zip(lights.iter().copied()).collect();
                world.set_lights(key, &all).expect("valid");
                world.update(FrameBudget::NONE);
                world.rebuild_tree(key).expect("it lives");
            },
            false,
        ),
        ("remove_tree", |world, key, _| world.remove_tree(key).expect("unused"), false),
    ];
    for (name, change, waits) in changes {
        for (frames, is_background) in BUILDS_UNDER_WAY {
            let mut test = TestWorld::new(420);
            test.calibrate();
            test.world.set_background_builds(is_background);
            let former = lamps(&mut test.rng, LARGE);
            let lights = lamps(&mut test.rng, LARGE);
            let key = test.world.add_tree(LightTree::new_placeholder(former).expect("valid"));
            play(&mut test, frames);
            assert!(test.world.tree(key).expect("it lives").is_placeholder());
            change(&mut test.world, key, &lights);
            assert_eq!(test.frame(0).placeholder_trees, usize::from(waits), "{name}");
            play(&mut test, 40);
            let report = test.frame(MICROS);
            assert_eq!((report.placeholder_trees, report.waiting_trees, report.background.running), (0, 0, 0));
            if test.world.tree(key).is_some() {
                assert!(is_built_as(&test.world, key, &built(&lights)), "{name}, {frames} frames");
            } else {
                assert_eq!(test.world.memory().trees.total(), 0);
            }
        }
    }
}

#[test]
fn a_copy_for_one_instance_is_a_placeholder_of_its_own() {
    for (frames, is_background) in BUILDS_UNDER_WAY {
        let mut test = TestWorld::new(430);
        test.calibrate();
        test.world.set_background_builds(is_background);
        let lights = lamps(&mut test.rng, LARGE);
        let key = test.world.add_tree(LightTree::new_placeholder(lights.clone()).expect("valid"));
        let instances =
            [0.0, 1.0].map(|x| test.world.add_instance(key, Placement::at(DVec3::X * x), Policy::Static).unwrap());
        play(&mut test, frames);
        let own = test.world.make_unique(instances[0]).expect("it lives");
        assert_ne!(own, key);
        assert!(test.world.tree(own).expect("it lives").is_placeholder());
        play(&mut test, 60);
        for key in [own, key] {
            assert!(is_built_as(&test.world, key, &built(&lights)), "{frames} frames");
        }
    }
}

#[test]
fn a_placeholder_is_built_for_its_stretched_first_instance_and_adding_that_builds_nothing() {
    let mut rng = Rng(440);
    let lights: Vec<Light> =
        (0..LARGE).map(|_| Light::point(rng.position(10.0) * Vec3::new(1.0, 1.0, 30.0), Vec3::ONE)).collect();
    let expected = LightTree::new_for(lights.clone(), squashed()).expect("valid");
    assert_ne!(expected.nodes(), built(&lights).nodes());
    // The instance comes before the build is opened, and while it is open.
    for (frames, is_background) in BUILDS_UNDER_WAY {
        let mut test = TestWorld::new(441);
        test.calibrate();
        test.world.set_background_builds(is_background);
        let key = test.world.add_tree(LightTree::new_placeholder(lights.clone()).expect("valid"));
        play(&mut test, frames);
        assert!(test.world.tree(key).expect("it lives").is_placeholder());
        let address = test.world.tree(key).expect("it lives").nodes().as_ptr();
        test.world.add_instance(key, squashed(), Policy::Static).expect("valid");
        test.world.add_instance(key, Placement::IDENTITY, Policy::Static).expect("valid");
        assert_eq!(test.world.tree(key).expect("it lives").nodes().as_ptr(), address, "nothing was built");
        play(&mut test, 40);
        assert!(is_built_as(&test.world, key, &expected), "{frames} frames");
    }
}

#[test]
fn a_placeholder_at_rest_is_frozen_and_still_built() {
    let mut rng = Rng(450);
    let mut world = LightWorld::new();
    let lights = lamps(&mut rng, 500);
    let key = world.add_tree(LightTree::new_placeholder(lights.clone()).expect("valid"));
    world.add_instance(key, Placement::IDENTITY, Policy::Static).expect("valid");
    for _ in 0..2 * EFFECT_HOLD_UPDATES {
        assert_eq!(placeholders(&mut world), 1);
    }
    assert!(world.tree(key).expect("it lives").is_frozen());
    world.update(UNLIMITED);
    assert!(is_built_as(&world, key, &built(&lights)));
}

#[test]
fn a_placeholder_of_lights_that_face_several_ways_is_divided_once_it_is_built() {
    let mut rng = Rng(451);
    let lamp = |i: usize| Light::spot(Vec3::X * i as f32, [Vec3::X, Vec3::NEG_X][i % 2], 0.1, 0.3, Vec3::ONE);
    let lights: Vec<_> = (0..40).map(lamp).collect();
    let mut world = LightWorld::new();
    let key = world.add_tree(LightTree::new_placeholder(lights.clone()).expect("valid"));
    for i in 0..6 {
        world.add_instance(key, Placement::at(DVec3::X * 0.1 * f64::from(i)), Policy::Static).expect("valid");
    }
    world.update(FrameBudget::NONE);
    world.update(FrameBudget::NONE);
    let sums = |world: &LightWorld, rng: &mut Rng| {
        for _ in 0..5 {
            assert_frequencies(&world.sampler(), &rng.shading_point(50.0), 4000, rng);
        }
    };
    sums(&world, &mut rng);
    assert!(world.tree(key).expect("it lives").sides().is_empty());
    world.update(UNLIMITED);
    assert_eq!(world.tree(key).expect("it lives").sides().len(), 2);
    assert!(is_built_as(&world, key, &built(&lights)));
    sums(&world, &mut rng);
}
