//! Edits of a world: a refused call changes nothing, and the cost of a frame follows what changed.

use std::sync::mpsc;
use std::time::Duration;

use girandole::glam::{DVec3, Mat3, Vec3};
use girandole::gpu::GpuLights;
use girandole::{
    Attribute, DirectionalKey, DirectionalLight, Effects, FrameBudget, InstanceKey, Light, LightId, LightTree,
    LightWorld, MAX_FACTOR, ORIGIN_GRID, Placement, Policy, Revision, ShadingPoint, TreeKey, WorldError,
};
use proptest::prelude::*;
use rayon::prelude::*;

use crate::gpu::{OTHER_PICKS, ask, compare, gpu, requests, sample};
use testbed::testing::support::{Rng, SPLITS, all_pmfs};

fn lamp(x: f32) -> Light {
    Light::point(Vec3::new(x, 0.0, 0.0), Vec3::ONE)
}

fn at(x: f64) -> Placement {
    Placement::at(DVec3::new(x, 0.0, 0.0))
}

/// A placement that hides an instance.
fn hidden(x: f64) -> Placement {
    Placement { linear: Mat3::ZERO, ..at(x) }
}

/// A change of every one of `count` lights.
fn scattered(rng: &mut Rng, count: u32) -> Vec<(u32, Light)> {
    (0..count).map(|index| (index, Light::point(rng.position(50.0), Vec3::ONE))).collect()
}

/// Everything about a world that a refused call must not change.
fn fingerprint(world: &LightWorld) -> String {
    let appearance = |i| {
        (
            world.instance(i).map(|i| i.appearance.is_enabled),
            world.instance(i).map(|i| i.appearance.user_data),
            world.instance(i).map(|i| i.appearance.factor),
            world.instance(i).map(|i| i.appearance.mask),
        )
    };
    let placements: Vec<_> = world
        .instances()
        .map(|i| (i, world.instance(i).map(|i| i.placement), world.instance(i).map(|i| i.policy), appearance(i)))
        .collect();
    let trees: Vec<_> = world.trees().map(|t| (t, world.tree(t).map(|t| t.nodes().to_vec()))).collect();
    let directionals: Vec<_> =
        world.directionals().map(|key| (key, *world.directional(key).expect("it lives"))).collect();
    let counts = (world.light_count(), world.origin());
    format!("{placements:?} {trees:?} {directionals:?} {counts:?} {:?}", world.revision())
}

#[test]
fn a_refused_call_leaves_the_world_as_it_was() {
    let mut world = Rng(20).world(2, 20, 3, 10.0);
    let tree = world.trees().next().expect("a tree");
    let instance = world.instances().next().expect("an instance");
    let gone = {
        let tree = world.add_tree(LightTree::new(vec![lamp(0.0)]).expect("valid"));
        let instance = world.add_instance(tree, at(0.0), Policy::Static).expect("valid");
        world.remove_instance(instance).expect("it lives");
        world.remove_tree(tree).expect("unused");
        (tree, instance)
    };
    world.update(FrameBudget::NONE);
    let before = fingerprint(&world);

    let bad_light = Light::point(Vec3::ZERO, Vec3::new(0.0, -1.0, 0.0));
    let nan = Placement { linear: Mat3::from_diagonal(Vec3::new(1.0, f32::NAN, 1.0)), ..Placement::IDENTITY };
    let large = Placement { linear: Mat3::from_diagonal(Vec3::new(1.0, 1.0, 1.0e10)), ..Placement::IDENTITY };
    let bad_policy = Policy::Ratio { attribute: Attribute::Overlap, factor: f32::NAN };
    let bad_moon = DirectionalLight { direction: Vec3::ZERO, illuminance: Vec3::ONE };
    let moon = world.directionals().next().expect("two directional lights");
    let refusals = [
        LightTree::new(vec![lamp(0.0), bad_light]).err(),
        LightTree::new(vec![lamp(0.0).with_range(f32::NAN)]).err(),
        world.replace_lights(tree, vec![bad_light]).err(),
        world.replace_tree(gone.0, LightTree::default()).err(),
        world.set_lights(tree, &[(0, lamp(0.0)), (1, bad_light)]).err(),
        world.set_lights(tree, &[(0, lamp(0.0)), (20, lamp(0.0))]).err(),
        world.set_lights(gone.0, &[]).err(),
        world.add_instance(tree, nan, Policy::Static).err(),
        world.add_instance(tree, large, Policy::Static).err(),
        world.add_instance(tree, at(0.0), bad_policy).err(),
        world.add_instance(gone.0, at(0.0), Policy::Static).err(),
        world.move_instance(instance, nan).err(),
        world.move_instance(instance, at(f64::INFINITY)).err(),
        world.move_instance(gone.1, at(0.0)).err(),
        world.set_policy(instance, bad_policy).err(),
        world.set_appearance(gone.1, |a| a.is_enabled = false).err(),
        world.set_appearance(gone.1, |a| a.user_data = 7).err(),
        world.remove_tree(tree).err(),
        world.remove_tree(gone.0).err(),
        world.remove_instance(gone.1).err(),
        world.make_unique(gone.1).err(),
        world.add_directional(bad_moon).err(),
        world.set_origin_near(DVec3::splat(1.0e12)).err(),
        world.set_origin_near(DVec3::new(0.0, f64::NAN, 0.0)).err(),
        world.set_viewpoint(DVec3::new(0.0, 0.0, f64::INFINITY)).err(),
        world.set_directional(moon, DirectionalLight { direction: Vec3::X * 2.0, ..bad_moon }).err(),
        world.set_appearance(instance, |a| a.factor = Vec3::new(1.0, -1.0e-9, 1.0)).err(),
        world.set_appearance(instance, |a| a.factor = Vec3::new(1.0, 1.0, f32::NAN)).err(),
        world.set_appearance(instance, |a| a.factor = Vec3::new(f32::INFINITY, 1.0, 1.0)).err(),
        world.set_appearance(instance, |a| a.factor = Vec3::splat(MAX_FACTOR.next_up())).err(),
        world.set_appearance(gone.1, |a| a.factor = Vec3::ONE).err(),
        world.set_appearance(gone.1, |a| a.mask = 0).err(),
        world.set_light_range(tree, 18, &[lamp(0.0); 3]).err(),
        world.set_light_range(tree, u32::MAX, &[lamp(0.0); 2]).err(),
        world.set_light_range(tree, 0, &[lamp(0.0), bad_light]).err(),
        world.set_emission(tree, 20, Vec3::ONE).err(),
        world.set_emission(tree, 0, Vec3::NAN).err(),
        world.set_emission(gone.0, 0, Vec3::ONE).err(),
    ];
    for (number, refusal) in refusals.iter().enumerate() {
        let refusal = refusal.as_ref().unwrap_or_else(|| panic!("call {number} was accepted"));
        assert!(!refusal.to_string().is_empty());
    }
    assert_eq!(fingerprint(&world), before);
    let is_refused_factor = |refusal: &Option<WorldError>| matches!(refusal, Some(WorldError::Value(error)) if error.what == "a channel of the factor");
    assert!(refusals[26..30].iter().all(is_refused_factor));
    assert!(matches!(refusals[0], Some(WorldError::Entry { what: "light", index: 1, .. })));
    let value = |index: usize| match refusals[index] {
        Some(WorldError::Value(error)) => (error.what, error.value),
        ref other => panic!("call {index}: {other:?}"),
    };
    assert!(value(7).0 == "an entry of the linear part" && value(7).1.is_nan());
    assert_eq!(value(21), ("the length of direction", 0.0));
    assert!(value(23).0 == "a coordinate of the position near the origin" && value(23).1.is_nan());
    assert_eq!(value(24), ("a coordinate of the viewpoint", f64::INFINITY));
    assert_eq!(value(25), ("the length of direction", 2.0));
}

#[test]
fn a_frame_in_which_nothing_moved_refits_nothing_and_changes_nothing() {
    let mut world = Rng(21).world(3, 20, 4, 10.0);
    world.update(FrameBudget::UNLIMITED);
    assert!(!world.changes_since(Revision::default()).is_empty());
    let seen = world.revision();
    let report = world.update(FrameBudget::UNLIMITED);
    assert_eq!((report.refit_trees, report.rebuilt_trees, report.moved_instances), (0, 0, 0));
    assert!(world.changes_since(seen).is_empty());
    // An instance that moves twice counts once; a move to the present place is no move.
    let mover = world.instances().nth(2).expect("twelve instances");
    world.move_instance(mover, at(1.0)).expect("valid");
    world.move_instance(mover, at(2.0)).expect("valid");
    assert_eq!(world.update(FrameBudget::UNLIMITED).moved_instances, 1);
    assert!(world.changes_since(seen).moved_instances().eq(world.slot(mover)));
    let seen = world.revision();
    let instance = world.instances().next().expect("an instance");
    let here = world.instance(instance).expect("it lives").placement;
    world.move_instance(instance, here).expect("valid");
    assert!(world.changes_since(seen).is_empty());
}

#[test]
fn edits_take_effect_at_the_update_and_moves_at_once() {
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(vec![lamp(0.0)]).expect("valid"));
    let instance = world.add_instance(tree, at(0.0), Policy::Budgeted).expect("valid");
    let shading_point = ShadingPoint::volume(Vec3::new(0.0, 3.0, 0.0));
    let distance = |world: &LightWorld| {
        let id = LightId::Local { instance, light: 0 };
        world.sampler().sample_light(&shading_point, id, [0.0; 2]).map_or(f32::NAN, |i| i.dist)
    };
    world.set_lights(tree, &[(0, lamp(4.0))]).expect("valid");
    assert_eq!(distance(&world), 3.0);
    world.update(FrameBudget::NONE);
    assert_eq!(distance(&world), 5.0);
    world.move_instance(instance, at(-4.0)).expect("valid");
    assert_eq!(distance(&world), 3.0);
}

#[test]
fn a_shared_tree_follows_the_most_demanding_policy_and_can_be_made_unique() {
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new((0..20).map(|i| lamp(i as f32)).collect()).expect("valid"));
    let still = world.add_instance(tree, at(0.0), Policy::Static).expect("valid");
    let scatter = |seed| scattered(&mut Rng(seed), 20);
    assert_eq!(world.set_lights(tree, &scatter(1)), Err(WorldError::StaticTree(tree)));
    let demanding = world.add_instance(tree, at(5.0), Policy::AlwaysRebuild).expect("valid");
    world.set_lights(tree, &scatter(1)).expect("one instance allows it");
    let report = world.update(FrameBudget::UNLIMITED);
    assert_eq!((report.refit_trees, report.rebuilt_trees), (1, 1));

    let own = world.make_unique(demanding).expect("valid");
    assert_ne!(own, tree);
    assert_eq!(world.instance(still).map(|i| i.tree), Some(tree));
    assert_eq!(world.set_lights(tree, &scatter(2)), Err(WorldError::StaticTree(tree)));
    world.set_lights(own, &scatter(2)).expect("the copy is free");
    assert_eq!(world.update(FrameBudget::UNLIMITED).rebuilt_trees, 1);
    assert_ne!(world.tree(own).map(|t| t.lights().to_vec()), world.tree(tree).map(|t| t.lights().to_vec()));
    assert_eq!(world.make_unique(demanding), Ok(own), "it shares its tree with no other");
}

#[test]
fn keys_of_removed_instances_are_stale_and_counts_follow() {
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(vec![lamp(0.0), lamp(1.0)]).expect("valid"));
    let first = world.add_instance(tree, at(0.0), Policy::Static).expect("valid");
    let second = world.add_instance(tree, at(9.0), Policy::Static).expect("valid");
    assert_eq!(world.light_count(), 4);
    world.remove_instance(first).expect("it lives");
    assert_eq!(world.remove_instance(first), Err(WorldError::NoSuchInstance(first)));
    assert_eq!((world.light_count(), world.instances().len()), (2, 1));
    let third = world.add_instance(tree, at(1.0), Policy::Static).expect("valid");
    assert_ne!(first, third);
    assert_eq!(world.instance(first).map(|i| i.placement), None);
    for key in [second, third] {
        world.remove_instance(key).expect("it lives");
    }
    world.remove_tree(tree).expect("unused");
    assert_eq!((world.trees().len(), world.light_count()), (0, 0));
    assert_eq!(world.sampler().pick(&ShadingPoint::volume(Vec3::ZERO), [0.5; 2]), None);
}

#[test]
fn another_origin_changes_coordinates_and_nothing_else() {
    let far = DVec3::new(9_766.0, 0.0, -9_766.0) * ORIGIN_GRID;
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(vec![lamp(0.0), lamp(0.01)]).expect("valid"));
    world.set_origin_near(far).expect("empty world");
    for i in 0..5 {
        world.add_instance(tree, Placement::at(far + DVec3::X * 0.02 * f64::from(i)), Policy::Static).expect("valid");
    }
    let shading_point = ShadingPoint::volume(Vec3::new(0.0, 0.05, 0.0));
    let sampler = world.sampler();
    let near: Vec<_> = sampler.all_lights().filter_map(|l| sampler.sample_light(&shading_point, l, [0.0; 2])).collect();
    // Centimetres are kept 10^7 m from the origin of the world.
    let mut distances: Vec<_> = near.iter().map(|i| i.dist).collect();
    distances.dedup();
    assert_eq!(distances.len(), 10);
    world.set_origin_near(far + DVec3::Y * 1025.0).expect("within the limits");
    let shading_point = ShadingPoint::volume(Vec3::new(0.0, 0.05 - 1024.0, 0.0));
    let sampler = world.sampler();
    let again = sampler.all_lights().filter_map(|l| sampler.sample_light(&shading_point, l, [0.0; 2]));
    for (a, b) in near.iter().zip(again) {
        // f32 resolves 6e-5 m at a kilometre.
        assert!((a.dist - b.dist).abs() < 1.3e-4);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 32, ..ProptestConfig::default() })]

    /// Random edits against a plain list of (instance, placement, lights).
    #[test]
    fn after_random_edits_a_world_holds_what_a_plain_list_holds(seed in any::<u64>(), steps in 1_usize..60) {
        let mut rng = Rng(seed);
        let mut world = LightWorld::new();
        let mut trees: Vec<(TreeKey, Vec<Light>)> = Vec::new();
        let mut instances: Vec<(InstanceKey, usize, Placement)> = Vec::new();
        for _ in 0..steps {
            let any = |count: usize, bits: u64| bits as usize % count.max(1);
            match rng.bits() % 8 {
                0 => {
                    let count = any(30, rng.bits());
                    let lights = rng.lights(count, 5.0);
                    trees.push((world.add_tree(LightTree::new(lights.clone()).expect("valid")), lights));
                }
                1 | 2 if !trees.is_empty() => {
                    let tree = any(trees.len(), rng.bits());
                    let placement = Placement::from(rng.affine(50.0));
                    let key = world.add_instance(trees[tree].0, placement, Policy::Budgeted).expect("valid");
                    instances.push((key, tree, placement));
                }
                3 if !instances.is_empty() => {
                    let place = any(instances.len(), rng.bits());
                    instances[place].2 = rng.affine(50.0).into();
                    world.move_instance(instances[place].0, instances[place].2).expect("valid");
                }
                4 if !instances.is_empty() => {
                    let (key, ..) = instances.swap_remove(any(instances.len(), rng.bits()));
                    world.remove_instance(key).expect("it lives");
                }
                5 if !trees.is_empty() => {
                    let tree = any(trees.len(), rng.bits());
                    let (key, lights) = &mut trees[tree];
                    let changes: Vec<_> = (0..lights.len() as u32).step_by(3).map(|i| (i, rng.light(9.0))).collect();
                    changes.iter().for_each(|(i, light)| lights[*i as usize] = *light);
                    world.set_lights(*key, &changes).expect("valid");
                }
                6 if !trees.is_empty() => {
                    let tree = any(trees.len(), rng.bits());
                    let count = any(30, rng.bits());
                    trees[tree].1 = rng.lights(count, 5.0);
                    world.replace_lights(trees[tree].0, trees[tree].1.clone()).expect("valid");
                }
                _ => {
                    world.update(FrameBudget::UNLIMITED);
                }
            }
        }
        world.update(FrameBudget::UNLIMITED);
        for (key, lights) in &trees {
            let tree = world.tree(*key).expect("it lives");
            prop_assert_eq!(tree.lights(), &lights[..]);
            prop_assert!(tree.check().is_ok());
        }
        let lights: usize = instances.iter().map(|(_, tree, _)| trees[*tree].1.len()).sum();
        prop_assert_eq!(world.light_count(), lights);
        prop_assert_eq!(world.instances().len(), instances.len());
        for (key, tree, placement) in &instances {
            prop_assert_eq!(world.instance(*key).map(|i| i.placement), Some(*placement));
            prop_assert_eq!(world.instance(*key).map(|i| i.tree), Some(trees[*tree].0));
        }
        let shading_point = rng.shading_point(40.0);
        let sampler = world.sampler();
        let sum: f64 = sampler.all_lights().map(|light| f64::from(sampler.pmf(&shading_point, light))).sum();
        prop_assert!(sum <= 1.0 + 1.0e-4);
    }
}

#[test]
fn attributes_are_measured_only_for_policies_that_may_rebuild() {
    let mut rng = Rng(29);
    let lights = rng.lights(300, 20.0);
    let mut world = LightWorld::new();
    let [plain, watched] = [Policy::RefitOnly, Policy::Budgeted].map(|policy| {
        let tree = world.add_tree(LightTree::new(lights.clone()).expect("valid"));
        (tree, world.add_instance(tree, at(0.0), policy).expect("valid"))
    });
    let built = world.tree(plain.0).expect("it lives").attributes();
    let mut step = |world: &mut LightWorld| {
        let changes: Vec<_> = (0..100).map(|index| (index, rng.light(40.0))).collect();
        for (tree, _) in [plain, watched] {
            world.set_lights(tree, &changes).expect("valid");
        }
        world.update(FrameBudget::NONE);
        [plain, watched].map(|(tree, _)| world.tree(tree).expect("it lives").clone())
    };
    let [unmeasured, measured] = step(&mut world);
    assert_eq!(unmeasured.nodes(), measured.nodes());
    assert_eq!(unmeasured.attributes(), built);
    assert_ne!(measured.attributes(), built);
    // A policy that may rebuild gets the attributes of all changes so far.
    world.set_policy(plain.1, Policy::Budgeted).expect("a valid policy");
    let [unmeasured, measured] = step(&mut world);
    assert_eq!(unmeasured.attributes(), measured.attributes());
}

#[test]
fn the_first_sampler_may_be_asked_for_inside_a_thread_pool() {
    let (sender, finished) = mpsc::channel();
    // A worker that waited for itself would hang this thread; the test itself waits with a limit.
    std::thread::spawn(move || {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(16).build().expect("a pool");
        let mut world = LightWorld::new();
        let tree = world.add_tree(LightTree::new(vec![lamp(0.0)]).expect("valid"));
        let place = |i: u32| at(f64::from(i));
        let instances: Vec<_> =
            (0..6000).map(|i| world.add_instance(tree, place(i), Policy::Static).expect("valid")).collect();
        let shading_point = ShadingPoint::volume(Vec3::Y);
        // Each round makes the top level stale and has it built inside the pool. Built inside a
        // lock, it hung within 50 rounds.
        for round in 0..100 {
            world.move_instance(instances[0], place(7000 + round)).expect("valid");
            let world = &world;
            pool.install(|| {
                (0..64).into_par_iter().with_max_len(1).for_each(|_| {
                    assert!(world.sampler().pick(&shading_point, [0.5; 2]).is_some());
                });
            });
        }
        sender.send(()).expect("the test waits");
    });
    finished.recv_timeout(Duration::from_secs(180)).expect("no round hangs");
}

#[test]
fn lights_that_are_set_to_what_they_are_cause_no_refit_and_no_upload() {
    let mut rng = Rng(31);
    let lights = rng.lights(300, 20.0);
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(lights.clone()).expect("valid"));
    world.add_instance(tree, at(0.0), Policy::AlwaysRebuild).expect("valid");
    world.update(FrameBudget::UNLIMITED);
    let is_still = |world: &mut LightWorld| {
        let before = (world.active_effects(), world.revision());
        let report = world.update(FrameBudget::UNLIMITED);
        let counts = (report.refit_trees, report.refit_lights, report.rebuilt_trees, report.waiting_trees);
        counts == (0, 0, 0, 0) && (world.active_effects(), world.revision()) == before
    };
    let same: Vec<_> = (0..).zip(lights.clone()).collect();
    world.set_lights(tree, &same).expect("valid");
    assert!(is_still(&mut world), "the same values");
    // Staged values count: set to another value and back, in one call and in two.
    let other = rng.light(20.0);
    world.set_lights(tree, &[(7, other), (7, lights[7])]).expect("valid");
    assert!(is_still(&mut world), "back in the same call");
    world.set_lights(tree, &[(7, other), (8, other)]).expect("valid");
    world.set_lights(tree, &same).expect("valid");
    assert!(is_still(&mut world), "back in a later call");
    // The last value counts, and one light that differs is a change.
    let before = world.revision();
    world.set_lights(tree, &[(7, lights[7]), (8, lights[9]), (7, other), (8, lights[8])]).expect("valid");
    let report = world.update(FrameBudget::UNLIMITED);
    assert_eq!((report.refit_trees, report.refit_lights, report.rebuilt_trees), (1, 300, 1));
    assert!(world.revision() != before);
    let present = world.tree(tree).expect("it lives").lights();
    assert!(present.iter().zip(&lights).enumerate().all(|(i, (now, before))| (now == before) == (i != 7)));
    assert_eq!(present[7], other);
}

/// A tree of 300 scattered lights whose instance has this policy, after an update without rebuilds.
fn disordered(policy: Policy) -> (LightWorld, InstanceKey) {
    let mut rng = Rng(32);
    let mut world = LightWorld::new();
    let lights = scattered(&mut rng, 300).into_iter().map(|(_, light)| light).collect();
    let tree = world.add_tree(LightTree::new(lights).expect("valid"));
    let instance = world.add_instance(tree, at(0.0), policy).expect("valid");
    world.set_lights(tree, &scattered(&mut rng, 300)).expect("valid");
    assert_eq!(world.update(FrameBudget::NONE).waiting_trees, 0);
    (world, instance)
}

#[test]
fn a_new_policy_asks_for_a_rebuild_without_a_refit_or_an_upload() {
    // Without attributes so far, and with them.
    for former in [Policy::RefitOnly, Policy::Bounded { floor: 1.0e9, ceiling: 1.0e9 }] {
        let (mut world, instance) = disordered(former);
        let before = world.revision();
        world.set_policy(instance, Policy::Budgeted).expect("valid");
        let report = world.update(FrameBudget::NONE);
        assert_eq!((report.refit_trees, report.refit_lights, report.waiting_trees), (0, 0, 1), "{former:?}");
        assert_eq!(world.revision(), before, "{former:?}");
        assert_eq!(world.update(FrameBudget::UNLIMITED).rebuilt_trees, 1, "{former:?}");
    }
    // The question goes along with a copy of the tree.
    let (mut world, instance) = disordered(Policy::RefitOnly);
    let tree = world.instance(instance).expect("it lives").tree;
    world.add_instance(tree, at(1.0), Policy::RefitOnly).expect("valid");
    world.set_policy(instance, Policy::Budgeted).expect("valid");
    world.make_unique(instance).expect("it lives");
    assert_eq!(world.update(FrameBudget::UNLIMITED).rebuilt_trees, 1);
    // Another one that asks for nothing, and a tree that waits for its lights to change.
    for policy in [Policy::Bounded { floor: 1.0e9, ceiling: 2.0e9 }, Policy::Static, Policy::AlwaysRebuild] {
        let (mut world, instance) = disordered(Policy::RefitOnly);
        let before = world.revision();
        world.set_policy(instance, policy).expect("valid");
        let report = world.update(FrameBudget::UNLIMITED);
        assert_eq!((report.refit_trees, report.waiting_trees, report.rebuilt_trees), (0, 0, 0), "{policy:?}");
        assert_eq!(world.revision(), before, "{policy:?}");
    }
}

#[test]
fn a_policy_that_is_set_to_what_it_is_changes_nothing() {
    let (mut world, instance) = disordered(Policy::RefitOnly);
    let before = world.revision();
    world.set_policy(instance, Policy::RefitOnly).expect("valid");
    let report = world.update(FrameBudget::UNLIMITED);
    assert_eq!((report.refit_trees, report.waiting_trees), (0, 0));
    assert_eq!(world.revision(), before);
    // A tree that has what it asked for is not asked again.
    world.set_policy(instance, Policy::Budgeted).expect("valid");
    assert_eq!(world.update(FrameBudget::UNLIMITED).rebuilt_trees, 1);
    let before = world.revision();
    world.set_policy(instance, Policy::Budgeted).expect("valid");
    let report = world.update(FrameBudget::UNLIMITED);
    assert_eq!((report.refit_trees, report.rebuilt_trees), (0, 0));
    assert_eq!(world.revision(), before);
}

#[test]
fn edited_trees_may_be_removed_and_replaced_before_the_update() {
    let mut rng = Rng(33);
    let mut world = LightWorld::new();
    let trees: Vec<_> = (0..60).map(|_| world.add_tree(LightTree::new(vec![lamp(0.0); 3]).expect("valid"))).collect();
    let edit = |world: &mut LightWorld, tree| world.set_lights(tree, &[(1, lamp(7.0))]).expect("valid");
    trees.iter().for_each(|tree| edit(&mut world, *tree));
    let mut kept = trees.clone();
    for _ in 0..20 {
        let removed = kept.swap_remove(rng.bits() as usize % kept.len());
        world.remove_tree(removed).expect("unused");
    }
    // The staged change of a replaced tree is dropped; a later one counts.
    world.replace_lights(kept[0], vec![lamp(1.0); 2]).expect("valid");
    world.replace_lights(kept[1], vec![lamp(1.0); 2]).expect("valid");
    edit(&mut world, kept[1]);
    let report = world.update(FrameBudget::UNLIMITED);
    assert_eq!((report.refit_trees, report.refit_lights), (39, 38 * 3 + 2));
    let light = |tree| world.tree(tree).expect("it lives").lights()[1];
    assert_eq!(light(kept[0]), lamp(1.0));
    assert!(kept[1..].iter().all(|tree| light(*tree) == lamp(7.0)));
    assert_eq!(world.update(FrameBudget::UNLIMITED).refit_trees, 0);
}

#[test]
fn a_shared_tree_follows_the_most_demanding_of_many_distinct_policies() {
    let (mut world, first) = disordered(Policy::Bounded { floor: 1.0e9, ceiling: 1.0e9 });
    let tree = world.instance(first).expect("it lives").tree;
    let patient = |i: u32| Policy::Bounded { floor: 1.0e6 + i as f32, ceiling: 1.0e9 };
    let instances: Vec<_> =
        (0..500).map(|i| world.add_instance(tree, at(f64::from(i)), patient(i)).expect("valid")).collect();
    let waiting = |world: &mut LightWorld| world.update(FrameBudget::NONE).waiting_trees;
    assert_eq!(waiting(&mut world), 0);
    world.set_policy(instances[250], Policy::Budgeted).expect("valid");
    assert_eq!(waiting(&mut world), 1);
    world.set_policy(instances[250], patient(250)).expect("valid");
    assert_eq!(waiting(&mut world), 0);
    let demanding = world.add_instance(tree, at(0.0), Policy::Bounded { floor: 0.0, ceiling: 0.0 }).expect("valid");
    let mut rng = Rng(34);
    world.set_lights(tree, &scattered(&mut rng, 300)).expect("valid");
    assert_eq!(waiting(&mut world), 1);
    world.remove_instance(demanding).expect("it lives");
    assert_eq!(world.update(FrameBudget::UNLIMITED).rebuilt_trees, 0, "no policy asks any more than the patient ones");
}

#[test]
fn a_hidden_instance_contributes_nothing_until_it_is_moved_back() {
    for seed in 0..4 {
        let mut rng = Rng(35 + seed);
        let [mut world, mut without] = [0; 2].map(|_| Rng(35 + seed).world(3, 20, 4, 10.0));
        let key = world.instances().nth(5).expect("twelve instances");
        let (slot, policy, lights) = (world.slot(key), world.instance(key).map(|i| i.policy), world.light_count());
        let shown = world.instance(key).expect("it lives").placement;
        without.remove_instance(key).expect("worlds of one seed have the same keys");
        let seen = world.revision();
        world.move_instance(key, hidden(3.0)).expect("zero hides");
        assert!(world.changes_since(seen).moved_instances().eq(slot));
        let seen = world.revision();
        assert_eq!(
            (world.slot(key), world.instance(key).map(|i| i.policy), world.light_count()),
            (slot, policy, lights)
        );
        assert_eq!(world.instance_at(slot.expect("it lives")), Some(key));

        let is_of_key = |light: &LightId| matches!(light, LightId::Local { instance, .. } if *instance == key);
        let mut distribution = Vec::new();
        for _ in 0..20 {
            let shading_point = rng.shading_point(15.0);
            for splits in SPLITS {
                let sampler = world.sampler().with_splits(splits);
                let (of_hidden, of_others): (Vec<_>, Vec<_>) =
                    all_pmfs(&sampler, &shading_point).into_iter().partition(|(light, _)| is_of_key(light));
                assert!(of_hidden.len() == 20 && of_hidden.iter().all(|(_, pmf)| *pmf == 0.0));
                // To the bit as if it were removed.
                assert_eq!(of_others, all_pmfs(&without.sampler().with_splits(splits), &shading_point));
                sampler.distribution(&shading_point, &mut distribution);
                let hidden = sampler.all_lights().zip(&distribution).filter(|(light, _)| is_of_key(light));
                assert!(hidden.map(|(_, pmf)| *pmf).sum::<f32>() == 0.0);
                for _ in 0..50 {
                    let u = [rng.unit(), rng.unit(), rng.unit(), rng.unit()];
                    assert!(!sampler.sample(&shading_point, u).is_some_and(|sample| is_of_key(&sample.light)));
                }
            }
            for (light, _) in world.sampler().all_lights().filter(is_of_key).zip(0..20) {
                assert_eq!(world.sampler().sample_light(&shading_point, light, [0.5; 2]), None);
                assert_eq!(world.sampler().pdf(&shading_point, light, Vec3::new(3.0, 0.0, 0.0)), 0.0);
            }
        }

        // Moved back, it is what it was.
        let fresh = Rng(35 + seed).world(3, 20, 4, 10.0);
        world.move_instance(key, shown).expect("valid");
        assert!(world.changes_since(seen).moved_instances().eq(slot));
        let shading_point = rng.shading_point(15.0);
        assert_eq!(all_pmfs(&world.sampler(), &shading_point), all_pmfs(&fresh.sampler(), &shading_point));
        assert_eq!(world.effect_counts(), fresh.effect_counts());
    }
}

#[test]
fn a_hidden_instance_takes_part_in_edits_like_any_other() {
    let mut rng = Rng(39);
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(rng.lights(300, 5.0)).expect("valid"));
    let [first, second] =
        [1.0, 2.0].map(|x| world.add_instance(tree, hidden(x), Policy::Budgeted).expect("zero hides"));
    assert_eq!(world.effect_counts().of(Effects::NON_RIGID), 0);
    assert_eq!(world.sampler().pick(&ShadingPoint::volume(Vec3::ZERO), [0.5; 2]), None, "everything is hidden");
    // Its tree is refitted and rebuilt, though it brings nothing to the viewpoint.
    world.set_viewpoint(DVec3::X).expect("finite");
    world.set_lights(tree, &scattered(&mut rng, 300)).expect("valid");
    let report = world.update(FrameBudget::UNLIMITED);
    assert_eq!((report.refit_trees, report.rebuilt_trees, report.waiting_trees), (1, 1, 0));
    let own = world.make_unique(first).expect("it lives");
    world.set_lights(own, &[(0, lamp(0.0))]).expect("valid");
    world.set_origin_near(DVec3::splat(1100.0)).expect("near");
    world.update(FrameBudget::UNLIMITED);
    world.remove_instance(second).expect("it lives");
    world.remove_tree(tree).expect("unused");
    // Shown with a mirror, relative to the new origin.
    let mirror = Placement { linear: Mat3::from_diagonal(Vec3::new(-1.0, 1.0, 1.0)), ..at(1025.0) };
    world.move_instance(first, mirror).expect("valid");
    assert_eq!(world.effect_counts().of(Effects::NON_RIGID), 1);
    let shading_point = ShadingPoint::volume(Vec3::new(1.0, -1022.0, -1024.0));
    let lamp = LightId::Local { instance: first, light: 0 };
    let incident = world.sampler().sample_light(&shading_point, lamp, [0.0; 2]).expect("it is shown");
    assert_eq!((incident.dist, incident.direction), (2.0, Vec3::NEG_Y));
    assert!(world.sampler().pmf(&shading_point, lamp) > 0.0);
    // An animated scale passes through what has no inverse: it hides too.
    for scale in [Vec3::ZERO, Vec3::Z, Vec3::splat(1.0e-10), Vec3::new(1.0e-20, 1.0, 1.0)] {
        world.move_instance(first, mirror).expect("valid");
        let flat = Placement { linear: Mat3::from_diagonal(scale), ..at(1.0) };
        world.move_instance(first, flat).expect("it hides");
        assert_eq!(world.effect_counts().of(Effects::NON_RIGID), 0);
        assert_eq!(
            (world.instance(first).map(|i| i.placement), world.sampler().pmf(&shading_point, lamp)),
            (Some(flat), 0.0)
        );
    }
}

#[test]
fn a_hidden_instance_is_not_sampled_on_the_gpu() {
    let (device, queue) = gpu();
    let mut rng = Rng(40);
    let mut world = rng.world(3, 20, 4, 15.0);
    let keys: Vec<_> = world.instances().collect();
    let [hide, remove] = [keys[2], keys[9]];
    let shown = world.instance(hide).expect("it lives").placement;
    let slots = [hide, remove].map(|key| world.slot(key).expect("it lives"));
    let mut lights = GpuLights::new(&device, &queue).expect("default limits are enough");
    let requests = requests(&mut rng, 2048, 20.0);
    let names_slot = |world: &mut LightWorld, lights: &mut GpuLights| {
        let records = sample(lights, world, &requests);
        let others = compare(world, &requests, &records);
        assert!(others as f64 <= OTHER_PICKS * 2048.0 + 1.0, "{others} of 2048 name another light");
        slots.map(|slot| records.iter().any(|record| record.pmf > 0.0 && record.instance == slot))
    };
    assert_eq!(names_slot(&mut world, &mut lights), [true, true]);
    world.move_instance(hide, hidden(0.0)).expect("zero hides");
    world.remove_instance(remove).expect("it lives");
    assert_eq!(names_slot(&mut world, &mut lights), [false, false]);

    // Asked for its lights, the GPU answers that their probability is 0.
    let mut questions: Vec<[u32; 8]> = Vec::new();
    for request in &requests[..20] {
        let [x, y, z] = request.position.map(f32::to_bits);
        let [p, q, r] = request.normal.map(f32::to_bits);
        questions.extend((0..20).flat_map(|light| slots.map(|slot| [x, y, z, slot, p, q, r, light])));
    }
    let text = lights.shader(1, Effects::all()).join(
        "struct Question { position: vec3<f32>, instance: u32, normal: vec3<f32>, light: u32 }
        @group(0) @binding(0) var<storage, read> questions: array<Question>;
        @group(0) @binding(1) var<storage, read_write> answers: array<f32>;
        @compute @workgroup_size(64) fn ask(@builtin(global_invocation_id) id: vec3<u32>) {
            if id.x >= arrayLength(&questions) { return; }
            let q = questions[id.x];
            answers[id.x] = light_pmf(light_surface_point(q.position, q.normal), q.instance, q.light);
        }",
    );
    let answers: Vec<f32> = ask(&mut lights, text, &questions, questions.len());
    assert!(answers.len() == 800 && answers.iter().all(|pmf| *pmf == 0.0));

    world.move_instance(hide, shown).expect("valid");
    assert_eq!(names_slot(&mut world, &mut lights), [true, false]);
}

#[test]
fn keys_become_numbers_and_back_and_other_numbers_are_refused() {
    let mut world = Rng(41).world(2, 5, 3, 10.0);
    let trees: Vec<_> = world.trees().collect();
    let instances: Vec<_> = world.instances().collect();
    let moons: Vec<_> = world.directionals().collect();
    assert!(trees.iter().all(|key| TreeKey::from(u64::from(*key)) == *key));
    assert!(instances.iter().all(|key| InstanceKey::from(u64::from(*key)) == *key));
    assert!(moons.iter().all(|key| DirectionalKey::from(u64::from(*key)) == *key));
    // A stale key by its number, a slot by its bare number, and numbers of nothing.
    let gone = instances[2];
    world.remove_instance(gone).expect("it lives");
    let slot = u64::from(world.slot(instances[1]).expect("it lives"));
    for number in [u64::from(gone), slot, 0, 7 << 32 | slot, u64::MAX, u64::from(u32::MAX)] {
        let key = InstanceKey::from(number);
        assert_eq!(world.remove_instance(key), Err(WorldError::NoSuchInstance(key)), "{number:#x}");
        assert_eq!(world.move_instance(key, at(0.0)), Err(WorldError::NoSuchInstance(key)));
        assert_eq!(
            (world.slot(key), world.instance(key).map(|i| i.placement), world.instance(key).map(|i| i.policy)),
            (None, None, None)
        );
        let light = LightId::Local { instance: key, light: 0 };
        assert_eq!(world.sampler().pmf(&ShadingPoint::volume(Vec3::ZERO), light), 0.0);
        let tree = TreeKey::from(number | 1 << 40);
        assert_eq!(world.remove_tree(tree), Err(WorldError::NoSuchTree(tree)));
        let moon = DirectionalKey::from(number | 1 << 40);
        assert_eq!(world.remove_directional(moon), Err(WorldError::NoSuchDirectional(moon)));
    }
    assert_eq!((world.trees().len(), world.instances().len(), world.directionals().len()), (2, 5, 2));
}

#[test]
fn the_debug_text_of_a_world_has_counts_and_not_contents() {
    let text = |lights| format!("{:?}", Rng(42).world(2, lights, 3, 10.0));
    assert!(
        text(5).starts_with("LightWorld { trees: 2, instances: 6, regions: 0, directionals: 2, lights: 32, "),
        "{}",
        text(5)
    );
    assert!(text(500).len() < text(5).len() + 10);
}
