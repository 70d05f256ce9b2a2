//! Edits of a world: a refused call changes nothing, and the cost of a frame follows what changed.

use std::sync::mpsc;
use std::time::Duration;

use girandole::glam::{DVec3, Mat3, Vec3};
use girandole::{
    Attribute, DirectionalLight, Effects, FrameBudget, InstanceKey, Light, LightId, LightTree, LightWorld, MAX_FACTOR,
    Placement, Policy, ShadingPoint, WorldError,
};
use rayon::prelude::*;

use testbed::testing::support::{Rng, SPLITS, all_pmfs, assert_probabilities, place_tree};

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
    let instances: Vec<_> = world.instances().map(|key| (key, world.instance(key))).collect();
    let trees: Vec<_> = world.trees().map(|t| (t, world.tree(t).map(|t| t.nodes().to_vec()))).collect();
    let directionals: Vec<_> =
        world.directionals().map(|key| (key, *world.directional(key).expect("it lives"))).collect();
    let counts = (world.light_count(), world.origin());
    format!("{instances:?} {trees:?} {directionals:?} {counts:?} {:?}", world.revision())
}

#[test]
fn a_refused_call_leaves_the_world_as_it_was() {
    let mut world = Rng(20).world(2, 20, 3, 10.0);
    let tree = world.trees().next().expect("a tree");
    let instance = world.instances().next().expect("an instance");
    let gone = {
        let (tree, instance) = place_tree(&mut world, vec![lamp(0.0)], at(0.0), Policy::Static);
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
fn edits_take_effect_at_the_update_and_moves_at_once() {
    let mut world = LightWorld::new();
    let (tree, instance) = place_tree(&mut world, vec![lamp(0.0)], at(0.0), Policy::Budgeted);
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
    let (tree, still) = place_tree(&mut world, (0..20).map(|i| lamp(i as f32)).collect(), at(0.0), Policy::Static);
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
    assert_eq!(world.replace_tree(tree, LightTree::default()).err(), Some(WorldError::StaticTree(tree)));
    world.set_lights(own, &scatter(2)).expect("the copy is free");
    assert_eq!(world.update(FrameBudget::UNLIMITED).rebuilt_trees, 1);
    assert_ne!(world.tree(own).map(|t| t.lights().to_vec()), world.tree(tree).map(|t| t.lights().to_vec()));
    assert_eq!(world.make_unique(demanding), Ok(own), "it shares its tree with no other");
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

/// A tree of 300 scattered lights whose instance has this policy, after an update without rebuilds.
fn disordered(policy: Policy) -> (LightWorld, InstanceKey) {
    let mut rng = Rng(32);
    let mut world = LightWorld::new();
    let lights = scattered(&mut rng, 300).into_iter().map(|(_, light)| light).collect();
    let (tree, instance) = place_tree(&mut world, lights, at(0.0), policy);
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
fn an_instance_that_is_hidden_disabled_or_black_contributes_nothing_until_it_is_shown_again() {
    type Edit = fn(&mut LightWorld, InstanceKey);
    let ways: [(&str, Edit); 3] = [
        ("hidden", |world, key| world.move_instance(key, hidden(3.0)).expect("zero hides")),
        ("disabled", |world, key| world.set_appearance(key, |a| a.is_enabled = false).expect("it lives")),
        ("black", |world, key| world.set_appearance(key, |a| a.factor = Vec3::ZERO).expect("valid")),
    ];
    for (name, hide) in ways {
        let mut rng = Rng(35);
        let [mut world, mut without, fresh] = [0; 3].map(|_| Rng(35).world(3, 20, 4, 10.0));
        let key = world.instances().nth(5).expect("twelve instances");
        let (shown, slot) = (world.instance(key).expect("it lives").placement, world.slot(key).expect("it lives"));
        without.remove_instance(key).expect("worlds of one seed have the same keys");
        hide(&mut world, key);
        assert_eq!((world.slot(key), world.instance_at(slot)), (Some(slot), Some(key)));
        assert_eq!(world.light_count(), fresh.light_count());
        let is_of_key = |light: &LightId| matches!(light, LightId::Local { instance, .. } if *instance == key);
        for _ in 0..20 {
            let at = rng.shading_point(15.0);
            for splits in SPLITS {
                let sampler = world.sampler().with_splits(splits);
                assert_probabilities(&sampler, &at, 50, &mut rng);
                let (of_key, of_others): (Vec<_>, Vec<_>) =
                    all_pmfs(&sampler, &at).into_iter().partition(|(light, _)| is_of_key(light));
                assert!(of_key.len() == 20 && of_key.iter().all(|(_, pmf)| *pmf == 0.0), "{name}");
                // To the bit as if it were removed.
                assert_eq!(of_others, all_pmfs(&without.sampler().with_splits(splits), &at), "{name}");
            }
            for light in world.sampler().all_lights().filter(is_of_key) {
                assert_eq!(world.sampler().sample_light(&at, light, [0.5; 2]), None, "{name}");
                assert_eq!(world.sampler().pdf(&at, light, Vec3::new(3.0, 0.0, 0.0)), 0.0, "{name}");
            }
        }
        // Shown again, it is what it was.
        world.move_instance(key, shown).expect("valid");
        world.set_appearance(key, |a| (a.is_enabled, a.factor) = (true, Vec3::ONE)).expect("valid");
        let at = rng.shading_point(15.0);
        assert_eq!(all_pmfs(&world.sampler(), &at), all_pmfs(&fresh.sampler(), &at), "{name}");
        assert_eq!(world.effect_counts(), fresh.effect_counts(), "{name}");
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
}
