//! Trees that were built on another thread, baked, or taken from another world behave as trees that
//! the world has built itself.

use girandole::glam::{DVec3, Mat3, Vec3};
use girandole::{Effects, FrameBudget, Light, LightTree, LightWorld, Placement, Policy, TreeKey, WorldError};

use testbed::testing::support::{Rng, place_tree};

fn placements(rng: &mut Rng) -> Vec<Placement> {
    (0..6).map(|_| Placement::from(rng.affine(30.0))).collect()
}

/// Adds an instance for each placement.
fn place(world: &mut LightWorld, tree: TreeKey, placements: &[Placement], policy: Policy) {
    for placement in placements {
        world.add_instance(tree, *placement, policy).expect("valid");
    }
}

/// What 200 shading points see of a world: samples with the bits of their probabilities.
fn samples(world: &LightWorld, seed: u64) -> Vec<String> {
    let mut rng = Rng(seed);
    let sampler = world.sampler();
    let mut sample = || {
        let at = rng.shading_point(40.0);
        format!("{:?}", sampler.sample(&at, [rng.unit(), rng.unit(), rng.unit(), rng.unit()]))
    };
    (0..200).map(|_| sample()).collect()
}

fn loaded(tree: &LightTree) -> LightTree {
    LightTree::from_baked(&tree.bake()).expect("bytes that were just written")
}

/// A stretched placement.
fn squashed() -> Placement {
    Placement { linear: Mat3::from_diagonal(Vec3::new(1.0, 1.0, 0.01)), ..Placement::IDENTITY }
}

#[test]
fn a_tree_with_changes_that_wait_for_a_refit_is_refitted_as_it_is_taken_in() {
    let mut rng = Rng(303);
    let lights = rng.lights(60, 5.0);
    for is_frozen in [false, true] {
        let changed = || {
            let mut tree = LightTree::new(lights.clone()).expect("valid");
            if is_frozen {
                tree.freeze();
            }
            tree.set_lights(&[(7, Light::point(Vec3::splat(90.0), Vec3::splat(1.0e6)))]).expect("valid");
            tree
        };
        let mut refitted = changed();
        refitted.refit();
        let mut world = LightWorld::new();
        let inserted = world.add_tree(changed());
        let replaced = world.add_tree(LightTree::new(Vec::new()).expect("valid"));
        drop(world.replace_tree(replaced, changed()).expect("it lives"));
        for key in [inserted, replaced] {
            let tree = world.tree(key).expect("it lives");
            tree.check().expect("the tree is sound");
            assert_eq!((tree.nodes(), tree.attributes()), (refitted.nodes(), refitted.attributes()));
        }
    }
}

#[test]
fn a_tree_takes_the_place_of_another_with_its_instances_and_effects() {
    let mut rng = Rng(304);
    for count in [0, 5, 60, 900] {
        let (former, next) = (rng.lights(80, 5.0), rng.lights(count, 5.0));
        let placements = placements(&mut rng);
        let mut world = LightWorld::new();
        let key = world.add_tree(LightTree::new(former.clone()).expect("valid"));
        place(&mut world, key, &placements, Policy::Budgeted);
        // A change that waits for the update is dropped.
        world.set_lights(key, &[(79, Light::point(Vec3::ONE, Vec3::ONE))]).expect("valid");
        let tree = loaded(&LightTree::new(next.clone()).expect("valid"));
        let returned = world.replace_tree(key, tree).expect("it lives");
        assert_eq!(returned.lights(), former);
        let report = world.update(FrameBudget::NONE);
        assert_eq!((report.refit_trees, world.light_count()), (0, 6 * count));
        let mut other = LightWorld::new();
        let key = other.add_tree(LightTree::new(former).expect("valid"));
        place(&mut other, key, &placements, Policy::Budgeted);
        other.replace_lights(key, next).expect("valid");
        other.update(FrameBudget::NONE);
        assert_eq!(samples(&world, 1), samples(&other, 1));
        assert_eq!(world.effect_counts(), other.effect_counts());
        assert_eq!(world.effect_counts().of(Effects::MOVING), 1);
    }
}

#[test]
fn a_tree_for_a_stretched_instance_keeps_its_division_through_a_file() {
    let light = |i: usize| Light::point(Vec3::new((i / 2) as f32, 0.0, 40.0 * (i % 2) as f32), Vec3::ONE);
    let lights: Vec<_> = (0..80).map(light).collect();
    let mut world = LightWorld::new();
    let (expected, _) = place_tree(&mut world, lights.clone(), squashed(), Policy::Budgeted);
    let expected = world.tree(expected).expect("it lives").clone();
    let plain = LightTree::new(lights.clone()).expect("valid");
    assert_ne!(expected.nodes(), plain.nodes());

    // Made for the instance, it is not built again: its nodes stay where they are in memory.
    let made = LightTree::new_for(lights.clone(), Placement { translation: DVec3::X, ..squashed() }).expect("valid");
    for tree in [made.clone(), loaded(&made), loaded(&expected)] {
        let address = tree.nodes().as_ptr();
        let key = world.add_tree(tree);
        world.add_instance(key, squashed(), Policy::Budgeted).expect("valid");
        let tree = world.tree(key).expect("it lives");
        assert_eq!((tree.nodes(), tree.nodes().as_ptr()), (expected.nodes(), address));
    }
    // In the place of a tree that was made for an instance, a plain tree stays as it is until it is
    // built again.
    let key = world.add_tree(made);
    world.add_instance(key, squashed(), Policy::Budgeted).expect("valid");
    drop(world.replace_tree(key, plain.clone()).expect("it lives"));
    assert_eq!(world.tree(key).expect("it lives").nodes(), plain.nodes());
    world.rebuild_tree(key).expect("it lives");
    assert_eq!(world.tree(key).expect("it lives").nodes(), expected.nodes());

    let same = LightTree::new_for(lights.clone(), Placement::IDENTITY).expect("valid");
    assert_eq!(same.nodes(), plain.nodes());
    let with_z = |z| Placement { linear: Mat3::from_diagonal(Vec3::new(1.0, 1.0, z)), ..Placement::IDENTITY };
    let hidden = LightTree::new_for(lights.clone(), with_z(0.0)).expect("it hides");
    assert_eq!(hidden.nodes(), plain.nodes());
    assert!(matches!(LightTree::new_for(lights, with_z(f32::NAN)), Err(WorldError::Value(_))));
}
