//! The world takes edits whole or not at all, and a frame costs what changed.

use girandole::glam::{DVec3, Mat3, Vec3};
use girandole::{
    Attribute, DirectionalLight, FrameBudget, InstanceKey, Light, LightId, LightWorld, Placement, PlacementError,
    Policy, ShadingPoint, TreeKey, WorldError,
};

use proptest::prelude::*;

use crate::support::Rng;

fn lamp(x: f32) -> Light {
    Light::point(Vec3::new(x, 0.0, 0.0), Vec3::ONE)
}

fn at(x: f64) -> Placement {
    Placement::at(DVec3::new(x, 0.0, 0.0))
}

/// Everything about a world that a refused call must leave alone.
fn fingerprint(world: &mut LightWorld) -> String {
    let placements: Vec<_> = world.instances().map(|i| (i, world.placement(i), world.policy(i))).collect();
    let trees: Vec<_> = world.trees().map(|t| (t, world.tree(t).map(|t| t.nodes().to_vec()))).collect();
    let directionals: Vec<_> = world.directionals().map(|(k, l)| (k, *l)).collect();
    let counts = (world.light_count(), world.origin());
    format!("{placements:?} {trees:?} {directionals:?} {counts:?} {:?}", world.take_delta())
}

#[test]
fn a_refused_call_leaves_the_world_as_it_was() {
    let mut world = Rng(20).world(2, 20, 3, 10.0);
    let tree = world.trees().next().expect("a tree");
    let instance = world.instances().next().expect("an instance");
    let gone = {
        let tree = world.add_tree(vec![lamp(0.0)]).expect("valid");
        let instance = world.add_instance(tree, at(0.0), Policy::Static).expect("valid");
        world.remove_instance(instance).expect("it lives");
        world.remove_tree(tree).expect("unused");
        (tree, instance)
    };
    world.update(FrameBudget::NONE);
    world.take_delta();
    let before = fingerprint(&mut world);

    let bad_light = Light::point(Vec3::ZERO, Vec3::new(0.0, -1.0, 0.0));
    let nan = Placement { linear: Mat3::from_diagonal(Vec3::new(1.0, f32::NAN, 1.0)), ..Placement::IDENTITY };
    let flat = Placement { linear: Mat3::from_diagonal(Vec3::new(1.0, 1.0, 0.0)), ..Placement::IDENTITY };
    let bad_policy = Policy::Ratio { attribute: Attribute::Overlap, factor: f32::NAN };
    let bad_moon = DirectionalLight { direction: Vec3::ZERO, illuminance: Vec3::ONE };
    let refusals = [
        world.add_tree(vec![lamp(0.0), bad_light]).err(),
        world.add_tree(vec![lamp(0.0).with_range(f32::NAN)]).err(),
        world.replace_lights(tree, vec![bad_light]).err(),
        world.set_lights(tree, &[(0, lamp(0.0)), (1, bad_light)]).err(),
        world.set_lights(tree, &[(0, lamp(0.0)), (20, lamp(0.0))]).err(),
        world.set_lights(gone.0, &[]).err(),
        world.add_instance(tree, nan, Policy::Static).err(),
        world.add_instance(tree, flat, Policy::Static).err(),
        world.add_instance(tree, at(0.0), bad_policy).err(),
        world.add_instance(gone.0, at(0.0), Policy::Static).err(),
        world.move_instance(instance, nan).err(),
        world.move_instance(instance, at(f64::INFINITY)).err(),
        world.move_instance(gone.1, at(0.0)).err(),
        world.set_policy(instance, bad_policy).err(),
        world.remove_tree(tree).err(),
        world.remove_tree(gone.0).err(),
        world.remove_instance(gone.1).err(),
        world.make_unique(gone.1).err(),
        world.add_directional(bad_moon).err(),
        world.set_origin(DVec3::splat(1.0e12)).err(),
    ];
    for (number, refusal) in refusals.iter().enumerate() {
        let refusal = refusal.as_ref().unwrap_or_else(|| panic!("call {number} was accepted"));
        assert!(!refusal.to_string().is_empty());
    }
    assert_eq!(fingerprint(&mut world), before);
    assert!(matches!(refusals[6], Some(WorldError::Placement(PlacementError::NotFinite { .. }))));
    assert!(matches!(refusals[0], Some(WorldError::Light { index: 1, .. })));
}

#[test]
fn a_frame_in_which_nothing_moved_refits_and_hands_over_nothing() {
    let mut world = Rng(21).world(3, 20, 4, 10.0);
    world.update(FrameBudget::UNLIMITED);
    assert!(!world.take_delta().is_empty());
    let report = world.update(FrameBudget::UNLIMITED);
    assert_eq!((report.refit_trees, report.rebuilt_trees, report.moved_instances), (0, 0, 0));
    assert!(world.take_delta().is_empty());
    // What moves twice counts once; moving something to where it is already is no move.
    let mover = world.instances().nth(2).expect("twelve instances");
    world.move_instance(mover, at(1.0)).expect("valid");
    world.move_instance(mover, at(2.0)).expect("valid");
    assert_eq!(world.update(FrameBudget::UNLIMITED).moved_instances, 1);
    assert!(!world.take_delta().is_empty());
    let instance = world.instances().next().expect("an instance");
    let here = world.placement(instance).expect("it lives");
    world.move_instance(instance, here).expect("valid");
    assert!(world.take_delta().is_empty());
}

#[test]
fn edits_take_effect_at_the_update_and_moves_at_once() {
    let mut world = LightWorld::new();
    let tree = world.add_tree(vec![lamp(0.0)]).expect("valid");
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
fn a_shared_tree_follows_the_most_demanding_policy_and_can_be_split_off() {
    let mut world = LightWorld::new();
    let tree = world.add_tree((0..20).map(|i| lamp(i as f32)).collect()).expect("valid");
    let still = world.add_instance(tree, at(0.0), Policy::Static).expect("valid");
    let scatter = |seed| {
        let mut rng = Rng(seed);
        (0..20).map(|i| (i, Light::point(rng.place(50.0), Vec3::ONE))).collect::<Vec<_>>()
    };
    assert_eq!(world.set_lights(tree, &scatter(1)), Err(WorldError::StaticTree(tree)));
    let keen = world.add_instance(tree, at(5.0), Policy::AlwaysRebuild).expect("valid");
    world.set_lights(tree, &scatter(1)).expect("one instance allows it");
    let report = world.update(FrameBudget::UNLIMITED);
    assert_eq!((report.refit_trees, report.rebuilt_trees), (1, 1));

    let own = world.make_unique(keen).expect("valid");
    assert_ne!(own, tree);
    assert_eq!(world.instance_tree(still), Some(tree));
    assert_eq!(world.set_lights(tree, &scatter(2)), Err(WorldError::StaticTree(tree)));
    world.set_lights(own, &scatter(2)).expect("the copy is free");
    assert_eq!(world.update(FrameBudget::UNLIMITED).rebuilt_trees, 1);
    assert_ne!(world.tree(own).map(|t| t.lights().to_vec()), world.tree(tree).map(|t| t.lights().to_vec()));
    assert_eq!(world.make_unique(keen), Ok(own), "it has its tree for itself already");
}

#[test]
fn what_goes_comes_back_under_a_new_name_and_is_counted() {
    let mut world = LightWorld::new();
    let tree = world.add_tree(vec![lamp(0.0), lamp(1.0)]).expect("valid");
    let first = world.add_instance(tree, at(0.0), Policy::Static).expect("valid");
    let second = world.add_instance(tree, at(9.0), Policy::Static).expect("valid");
    assert_eq!(world.light_count(), 4);
    world.remove_instance(first).expect("it lives");
    assert_eq!(world.remove_instance(first), Err(WorldError::NoSuchInstance(first)));
    assert_eq!((world.light_count(), world.instance_count()), (2, 1));
    let third = world.add_instance(tree, at(1.0), Policy::Static).expect("valid");
    assert_ne!(first, third);
    assert_eq!(world.placement(first), None);
    for key in [second, third] {
        world.remove_instance(key).expect("it lives");
    }
    world.remove_tree(tree).expect("unused");
    assert_eq!((world.tree_count(), world.light_count()), (0, 0));
    assert_eq!(world.sampler().pick(&ShadingPoint::volume(Vec3::ZERO), [0.5; 2]), None);
}

#[test]
fn rebasing_the_origin_changes_coordinates_and_nothing_else() {
    let far = DVec3::new(1.0e7, 0.0, -1.0e7);
    let mut world = LightWorld::new();
    let tree = world.add_tree(vec![lamp(0.0), lamp(0.01)]).expect("valid");
    world.set_origin(far).expect("empty world");
    for i in 0..5 {
        world.add_instance(tree, Placement::at(far + DVec3::X * 0.02 * f64::from(i)), Policy::Static).expect("valid");
    }
    let shading_point = ShadingPoint::volume(Vec3::new(0.0, 0.05, 0.0));
    let sampler = world.sampler();
    let near: Vec<_> = sampler.all_lights().filter_map(|l| sampler.sample_light(&shading_point, l, [0.0; 2])).collect();
    // Centimetres are told apart 10^7 m out.
    let mut distances: Vec<_> = near.iter().map(|i| i.dist).collect();
    distances.dedup();
    assert_eq!(distances.len(), 10);
    world.set_origin(far + DVec3::Y).expect("close enough");
    let shading_point = ShadingPoint::volume(Vec3::new(0.0, -0.95, 0.0));
    let sampler = world.sampler();
    let again = sampler.all_lights().filter_map(|l| sampler.sample_light(&shading_point, l, [0.0; 2]));
    for (a, b) in near.iter().zip(again) {
        assert!((a.dist - b.dist).abs() < 1e-6);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 32, ..ProptestConfig::default() })]

    /// Random edits against a plain list of (instance, placement, lights).
    #[test]
    fn random_edits_keep_the_world_as_a_plain_list_has_it(seed in any::<u64>(), steps in 1_usize..60) {
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
                    trees.push((world.add_tree(lights.clone()).expect("valid"), lights));
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
        prop_assert_eq!(world.instance_count(), instances.len());
        for (key, tree, placement) in &instances {
            prop_assert_eq!(world.placement(*key), Some(*placement));
            prop_assert_eq!(world.instance_tree(*key), Some(trees[*tree].0));
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
        let tree = world.add_tree(lights.clone()).expect("valid");
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
    // Whoever asks for rebuilds later gets attributes of all that has happened.
    world.set_policy(plain.1, Policy::Budgeted).expect("a valid policy");
    let [unmeasured, measured] = step(&mut world);
    assert_eq!(unmeasured.attributes(), measured.attributes());
}
