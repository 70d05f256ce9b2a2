//! The effects of a world, which follow from counts that every edit keeps up to date.

use std::collections::HashMap;

use girandole::effects::EFFECT_HOLD_UPDATES;
use girandole::glam::{DVec3, Mat3, Vec3};
use girandole::{
    DirectionalKey, DirectionalLight, EffectCounts, Effects, FrameBudget, Instance, InstanceKey, Light, LightTree,
    LightWorld, Placement, Policy,
};
use proptest::prelude::*;

use testbed::testing::support::{Rng, place_tree, world_of};

fn moon() -> DirectionalLight {
    DirectionalLight { direction: Vec3::NEG_Y, illuminance: Vec3::ONE }
}

/// The counts of all effects but [`Effects::MOVING`], from a visit of everything.
fn counted(world: &LightWorld) -> HashMap<Effects, u64> {
    let all = Effects::all() - Effects::MOVING;
    let mut counts: HashMap<Effects, u64> = all.iter().map(|effect| (effect, 0)).collect();
    let mut add = |effects: Effects| effects.iter().for_each(|effect| *counts.entry(effect).or_default() += 1);
    for tree in world.trees() {
        let tree = world.tree(tree).expect("it lives");
        tree.lights().iter().for_each(|light| add(light.effects()));
    }
    for instance in world.instances() {
        let Instance { placement, appearance, .. } = world.instance(instance).expect("it lives");
        let linear = placement.linear;
        let gram = linear.transpose() * linear;
        let is_rigid = gram.abs_diff_eq(Mat3::IDENTITY, 4.0e-6) && linear.determinant() > 0.0;
        if !appearance.is_enabled || appearance.factor == Vec3::ZERO || linear == Mat3::ZERO {
            continue;
        }
        if appearance.factor != Vec3::ONE {
            add(Effects::FACTORS);
        }
        if appearance.mask != u32::MAX {
            add(Effects::MASKS);
        }
        if !is_rigid {
            add(Effects::NON_RIGID);
        }
    }
    world.directionals().for_each(|_| add(Effects::DIRECTIONAL));
    counts
}

/// The same as the world keeps them.
fn kept(counts: &EffectCounts) -> HashMap<Effects, u64> {
    (Effects::all() - Effects::MOVING).iter().map(|effect| (effect, counts.of(effect))).collect()
}

#[test]
fn each_kind_of_light_has_its_effects_even_if_it_is_dark() {
    let [x, y, one] = [Vec3::X, Vec3::Y, Vec3::ONE];
    for emission in [one, Vec3::ZERO] {
        for (light, effects) in [
            (Light::point(one, emission), Effects::empty()),
            (Light::spot(one, x, 0.1, 0.2, emission), Effects::CONES),
            (Light::sphere(one, 0.1, emission), Effects::AREAS),
            (Light::rectangle(one, x, y, emission), Effects::AREAS | Effects::CONES),
            (Light::rectangle(one, x, y, emission).two_sided(), Effects::AREAS),
            (Light::triangle([one, x, y], emission), Effects::AREAS | Effects::CONES),
            (Light::triangle([one, x, y], emission).two_sided(), Effects::AREAS),
        ] {
            assert_eq!(light.effects(), effects, "{light:?}");
            assert_eq!(light.with_range(5.0).effects(), effects | Effects::RANGES, "{light:?}");
        }
    }
}

#[test]
fn each_setting_adds_its_effect_and_nothing_else() {
    type Set = fn(&mut LightWorld, bool);
    let settings: [(Effects, Set); 3] = [
        (Effects::SEGMENTS, LightWorld::set_segment_sampling),
        (Effects::GLOSSY, LightWorld::set_glossy_sampling),
        (Effects::SOLID_ANGLES, LightWorld::set_solid_angle_sampling),
    ];
    for (effect, set) in settings {
        let (mut world, ..) = world_of(vec![Light::point(Vec3::Y, Vec3::ONE)], Policy::Static);
        assert!(world.active_effects().is_empty() && world.effects().is_empty());
        for _ in 0..2 {
            set(&mut world, true);
            assert_eq!((world.effects(), world.effect_counts().of(effect)), (effect, 1));
        }
        set(&mut world, false);
        assert_eq!(world.effect_counts().of(effect), 0);
    }
}

#[test]
fn an_effect_is_held_for_a_while_after_the_last_thing_that_had_it() {
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(vec![Light::sphere(Vec3::ZERO, 1.0, Vec3::ONE)]).expect("valid"));
    let squashed = Placement { linear: Mat3::from_diagonal(Vec3::new(1.0, 2.0, 1.0)), ..Placement::IDENTITY };
    let instance = world.add_instance(tree, squashed, Policy::Static).expect("valid");
    let key = world.add_directional(moon()).expect("valid");
    let all = Effects::AREAS | Effects::NON_RIGID | Effects::DIRECTIONAL;
    assert_eq!((world.active_effects(), world.effects()), (all, all));
    world.move_instance(instance, Placement::at(DVec3::ONE)).expect("valid");
    world.remove_directional(key).expect("it lives");
    assert_eq!((world.active_effects(), world.effects()), (Effects::AREAS, all));
    for frame in 0..EFFECT_HOLD_UPDATES {
        assert_eq!(world.effects(), all, "frame {frame}");
        world.update(FrameBudget::NONE);
    }
    assert_eq!(world.effects(), Effects::AREAS);
    // A light that exists for a part of each frame only.
    for _ in 0..3 {
        let key = world.add_directional(moon()).expect("valid");
        world.remove_directional(key).expect("it lives");
        world.update(FrameBudget::NONE);
        assert_eq!(world.effects(), Effects::AREAS | Effects::DIRECTIONAL);
    }
}

#[test]
fn trees_at_rest_are_frozen_once_and_thaw_when_they_are_edited() {
    let mut rng = Rng(90);
    let lights = rng.lights(200, 10.0);
    let mut world = LightWorld::new();
    let [resting, flickering] = [0, 1].map(|_| {
        let (tree, _) = place_tree(&mut world, lights.clone(), Placement::IDENTITY, Policy::Budgeted);
        tree
    });
    let is_frozen = |world: &LightWorld, tree| world.tree(tree).expect("it lives").is_frozen();
    for frame in 0..=EFFECT_HOLD_UPDATES {
        assert!(!is_frozen(&world, resting), "frame {frame}");
        assert!(!world.active_effects().contains(Effects::MOVING));
        world.update(FrameBudget::UNLIMITED);
    }
    assert!(is_frozen(&world, resting) && is_frozen(&world, flickering));
    // After each edit of a frozen tree, the delay before the next freeze is twice as long, up to a limit.
    for delay in [2, 4, 8, 16, 32, 64, 64].map(|factor| factor * EFFECT_HOLD_UPDATES) {
        world.set_lights(flickering, &[(3, rng.light(10.0))]).expect("valid");
        for frame in 0..delay {
            world.update(FrameBudget::UNLIMITED);
            assert!(!is_frozen(&world, flickering));
            assert_eq!(world.active_effects().contains(Effects::MOVING), frame < EFFECT_HOLD_UPDATES, "frame {frame}");
        }
        world.update(FrameBudget::UNLIMITED);
        assert!(is_frozen(&world, flickering) && is_frozen(&world, resting));
        world.tree(flickering).expect("it lives").check().expect("sound");
    }
}

#[test]
fn trees_freeze_again_after_a_late_rebuild_and_at_most_64_in_one_update() {
    let mut rng = Rng(92);
    let (mut world, tree, _) = world_of(rng.lights(100, 10.0), Policy::AlwaysRebuild);
    world.set_lights(tree, &[(3, rng.light(10.0))]).expect("valid");
    let is_frozen = |world: &LightWorld| world.tree(tree).expect("it lives").is_frozen();
    let updates = |world: &mut LightWorld, count: u32, budget| {
        for _ in 0..count {
            world.update(budget);
        }
    };
    updates(&mut world, 2 * EFFECT_HOLD_UPDATES, FrameBudget::NONE);
    assert!(is_frozen(&world));
    assert_eq!(world.update(FrameBudget::UNLIMITED).rebuilt_trees, 1);
    assert!(!is_frozen(&world));
    assert_eq!(world.active_effects() & Effects::MOVING, Effects::empty(), "a rebuild is no change of lights");
    updates(&mut world, EFFECT_HOLD_UPDATES, FrameBudget::NONE);
    assert!(is_frozen(&world));

    let frozen =
        |world: &LightWorld| world.trees().filter(|tree| world.tree(*tree).is_some_and(|t| t.is_frozen())).count();
    for _ in 0..999 {
        world.add_tree(LightTree::new(rng.lights(2, 1.0)).expect("valid"));
    }
    updates(&mut world, EFFECT_HOLD_UPDATES, FrameBudget::NONE);
    let mut former = frozen(&world);
    assert_eq!(former, 1);
    while former < 1000 {
        world.update(FrameBudget::NONE);
        let now = frozen(&world);
        assert!(now > former && now <= former + 64, "from {former} to {now} at once");
        former = now;
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    /// Random edits, some of them refused, against counts from scratch.
    #[test]
    fn counts_are_those_of_a_visit_of_everything(seed in any::<u64>(), steps in 1_usize..80) {
        let mut rng = Rng(seed);
        let mut world = LightWorld::new();
        let mut instances: Vec<InstanceKey> = Vec::new();
        let mut directionals: Vec<DirectionalKey> = Vec::new();
        let mut any = |count: usize| (rng.bits() % count.max(1) as u64) as usize;
        let mut numbers = Rng(!seed);
        for _ in 0..steps {
            let trees: Vec<_> = world.trees().collect();
            let tree = trees.get(any(trees.len())).copied();
            let instance = instances.get(any(instances.len())).copied();
            let bad = Light::point(Vec3::NAN, Vec3::ONE).with_range(2.0);
            match (any(17), tree, instance) {
                (0, ..) => drop(world.add_tree(LightTree::new(numbers.lights(any(30), 5.0)).expect("valid"))),
                (1, Some(tree), _) => {
                    let _ = world.remove_tree(tree);
                }
                (2 | 3, Some(tree), _) => {
                    let policy = [Policy::Static, Policy::RefitOnly, Policy::Budgeted][any(3)];
                    instances.push(world.add_instance(tree, numbers.affine(50.0), policy).expect("valid"));
                }
                (4, _, Some(instance)) if any(4) == 0 => {
                    let hidden = Placement { linear: Mat3::ZERO, ..Placement::IDENTITY };
                    world.move_instance(instance, hidden).expect("zero hides");
                }
                (4, _, Some(instance)) => world.move_instance(instance, numbers.affine(50.0)).expect("valid"),
                (5, _, Some(instance)) => {
                    instances.retain(|key| *key != instance);
                    world.remove_instance(instance).expect("it lives");
                }
                (6, Some(tree), _) => {
                    let count = world.tree(tree).expect("it lives").lights().len() as u32;
                    let changes: Vec<_> = (0..count).step_by(3).map(|i| (i, numbers.light(9.0))).collect();
                    let _ = world.set_lights(tree, &changes);
                    prop_assert!(world.set_lights(tree, &[(0, numbers.light(9.0)), (0, bad)]).is_err());
                }
                (7, Some(tree), _) => {
                    let _ = world.replace_lights(tree, numbers.lights(any(30), 5.0));
                    prop_assert!(world.replace_lights(tree, vec![numbers.light(9.0), bad]).is_err());
                }
                (8, _, Some(instance)) => drop(world.make_unique(instance)),
                (9, ..) => directionals.push(world.add_directional(moon()).expect("valid")),
                (10, ..) if !directionals.is_empty() => {
                    let key = directionals.swap_remove(any(directionals.len()));
                    world.remove_directional(key).expect("it lives");
                    prop_assert!(world.remove_directional(key).is_err());
                }
                (15, _, Some(instance)) => world.set_appearance(instance, |a| a.mask = [0, 7, u32::MAX][any(3)]).expect("it lives"),
                (13 | 14, _, Some(instance)) => {
                    let factor = [Vec3::ZERO, Vec3::ONE, Vec3::new(0.0, 0.5, 2.0)][any(3)];
                    world.set_appearance(instance, |a| a.factor = factor).expect("valid");
                }
                (11 | 12, _, Some(instance)) => world.set_appearance(instance, |a| a.is_enabled = any(2) == 0).expect("it lives"),
                _ => {
                    // Often enough for some trees to freeze.
                    for _ in 0..[1, EFFECT_HOLD_UPDATES][any(2)] {
                        world.update(FrameBudget::NONE);
                    }
                }
            }
            let counts = world.effect_counts();
            prop_assert_eq!(kept(counts), counted(&world));
            prop_assert!(counts.of(Effects::MOVING) <= world.trees().len() as u64);
            prop_assert!(world.effects().contains(world.active_effects() - Effects::MOVING));
            prop_assert!(!world.effects().contains(Effects::MOVING));
            prop_assert_eq!(world.active_effects(), counts.effects());
        }
        for instance in instances {
            world.remove_instance(instance).expect("it lives");
        }
        for tree in world.trees().collect::<Vec<_>>() {
            world.remove_tree(tree).expect("unused");
        }
        for key in directionals {
            world.remove_directional(key).expect("it lives");
        }
        prop_assert_eq!(world.effect_counts(), &EffectCounts::default());
    }
}
