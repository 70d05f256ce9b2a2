//! Rebuilds of the worst subtrees while the lights of a tree move.

use girandole::glam::{Quat, Vec3};
use girandole::tree::{Target, WIDTH};
use girandole::{Light, LightTree, ShadingPoint};

use super::{changed, checked, moved};
use testbed::testing::support::{Rng, SPLITS};

/// Limit for the splitting cost in units of that of a fresh tree. Subtrees are rebuilt once their
/// cost has risen by 5 %, and it may rise further while they wait for credit.
const MAX_COST: f32 = 1.1;

/// A tree of points in an upright cylinder of radius 20 m.
fn points(rng: &mut Rng, count: usize) -> LightTree {
    let mut light = || {
        let position = Quat::from_rotation_y(rng.between(0.0, 6.3)) * Vec3::X * 20.0 * rng.unit().sqrt();
        Light::point(position + Vec3::Y * rng.between(-5.0, 5.0), Vec3::splat(rng.between(1.0, 10.0)))
    };
    checked((0..count).map(|_| light()).collect())
}

/// Rotates every light about the cylinder's axis, faster near the axis. So neighbours drift apart
/// while the cylinder keeps its shape.
fn swirl(tree: &mut LightTree, step: f32) {
    let changes = changed(tree, |light| {
        let position = light.cluster().mean;
        moved(light, Quat::from_rotation_y(step / (1.0 + 0.1 * position.length())) * position - position)
    });
    tree.set_lights(&changes).expect("the lights are valid");
}

/// A tree that is built from the same lights.
fn fresh(tree: &LightTree) -> LightTree {
    checked(tree.lights().to_vec())
}

#[test]
fn rebuilds_of_the_worst_subtrees_stay_within_the_credit_and_keep_the_cost_low() {
    let mut tree = points(&mut Rng(40), 3000);
    let mut refitted = tree.clone();
    let (mut given, mut rebuilt) = (0, 0);
    for frame in 0..120 {
        swirl(&mut tree, 0.02);
        swirl(&mut refitted, 0.02);
        refitted.refit();
        tree.refit();
        tree.check().expect("the tree is sound after the refit");
        given += 200;
        rebuilt += tree.rebuild_worst(200);
        tree.check().expect("the tree is sound after the rebuild");
        assert!(rebuilt <= given, "frame {frame}: {rebuilt} lights for {given}");
    }
    assert_eq!(tree.lights(), refitted.lights());
    let [kept, drifted, best] = [&tree, &refitted, &fresh(&tree)].map(|tree| tree.attributes().splitting_cost);
    assert!(rebuilt > given / 2);
    assert!(drifted > 1.3 * best, "the refitted tree did not get worse: {drifted} {best}");
    assert!(kept < MAX_COST * best, "{kept} {best}");
}

#[test]
fn a_rise_in_cost_is_found_while_the_box_of_all_lights_grows() {
    // A cube rotates about its diagonal, faster near its centre. A cost relative to its box would
    // fall as the box grows.
    let mut rng = Rng(47);
    let mut tree = checked((0..3000).map(|_| Light::point(rng.position(10.0), Vec3::ONE)).collect());
    let mut refitted = tree.clone();
    for _ in 0..120 {
        let changes = changed(&tree, |light| {
            let position = light.cluster().mean;
            let rotation = Quat::from_axis_angle(Vec3::ONE.normalize(), 0.02 / (1.0 + 0.1 * position.length()));
            moved(light, rotation * position - position)
        });
        for tree in [&mut tree, &mut refitted] {
            tree.set_lights(&changes).expect("the lights are valid");
        }
        refitted.refit();
        tree.rebuild_worst(300);
    }
    let [kept, drifted, best] = [&tree, &refitted, &fresh(&tree)].map(|tree| tree.attributes().splitting_cost);
    assert!(drifted > 1.12 * best, "the refitted tree did not get worse: {drifted} {best}");
    assert!(kept < MAX_COST * best, "{kept} {best}");
}

#[test]
fn nothing_is_rebuilt_if_no_cost_has_risen_or_without_credit() {
    let mut tree = points(&mut Rng(41), 2000);
    let nodes = tree.nodes().to_vec();
    assert_eq!(tree.rebuild_worst(usize::MAX), 0);
    assert_eq!(tree.rebuild_worst(usize::MAX), 0);
    assert_eq!(tree.nodes(), nodes);

    // A fresh tree does not have the credit of those calls.
    let mut tree = fresh(&tree);
    (0..40).for_each(|_| swirl(&mut tree, 0.1));
    tree.refit();
    let nodes = tree.nodes().to_vec();
    assert_eq!(tree.rebuild_worst(0), 0);
    assert_eq!(tree.nodes(), nodes);
    assert!(tree.rebuild_worst(2000) > 0);
}

#[test]
fn a_tree_whose_lights_all_moved_is_rebuilt_whole_once_the_credit_is_enough() {
    let mut rng = Rng(42);
    let mut tree = points(&mut rng, 2000);
    tree.set_lights(&changed(&tree, |light| moved(light, rng.position(20.0) - light.cluster().mean)))
        .expect("the lights are valid");
    tree.refit();
    let mut given = 0;
    while tree.rebuild_worst(500) < 2000 {
        given += 500;
        assert!(given <= 2000, "the tree was never rebuilt whole");
    }
    assert_eq!(tree.nodes(), fresh(&tree).nodes());
}

/// Permutes the positions of the lights below one child of the root.
fn scramble_child(rng: &mut Rng, tree: &mut LightTree) {
    let child = |slot| match tree.nodes()[0].target(slot) {
        Some(Target::Node(node)) => node,
        other => panic!("the root has a node in every slot, not {other:?}"),
    };
    let below = child(3)..child(4);
    let lights: Vec<u32> =
        (0..).zip(tree.leaves()).filter(|(_, p)| below.contains(&(**p / WIDTH as u32))).map(|(i, _)| i).collect();
    let mut places = lights.clone();
    (1..places.len()).for_each(|i| places.swap(i, rng.bits() as usize % (i + 1)));
    let changes: Vec<_> = lights.iter().zip(&places).map(|(i, j)| (*i, tree.lights()[*j as usize])).collect();
    tree.set_lights(&changes).expect("the lights are valid");
}

#[test]
fn a_change_in_one_subtree_is_repaired_with_less_credit_than_a_rebuild_takes() {
    let mut rng = Rng(46);
    let mut tree = points(&mut rng, 4000);
    scramble_child(&mut rng, &mut tree);
    tree.refit();
    let drifted = tree.attributes().splitting_cost;
    let rebuilt = tree.rebuild_worst(1500);
    tree.check().expect("the tree is sound");
    let [kept, best] = [&tree, &fresh(&tree)].map(|tree| tree.attributes().splitting_cost);
    assert!((1..=1500).contains(&rebuilt));
    assert!(kept - best < 0.1 * (drifted - best), "{drifted} {kept} {best}");
}

#[test]
fn a_rebuild_refits_pending_changes_first() {
    let mut rng = Rng(43);
    for count in [500, 4000, 20_000] {
        let mut tree = points(&mut rng, count);
        scramble_child(&mut rng, &mut tree);
        assert!(tree.rebuild_worst(count) > 0);
        tree.check().expect("the tree is sound");
    }
}

#[test]
fn tiny_and_dark_trees_can_be_rebuilt() {
    let mut rng = Rng(44);
    for count in [0, 1, 8, 9, 32] {
        let mut tree = points(&mut rng, count);
        for _ in 0..20 {
            tree.set_lights(&changed(&tree, |light| moved(light, rng.position(100.0)))).expect("the lights are valid");
            tree.refit();
            assert!(tree.rebuild_worst(count) <= count);
            tree.check().expect("the tree is sound");
        }
    }
    let mut tree = points(&mut rng, 1000);
    let lit = changed(&tree, |light| *light);
    tree.set_lights(&changed(&tree, |light| Light { emission: Vec3::ZERO, ..*light })).expect("the lights are valid");
    tree.refit();
    assert_eq!(tree.rebuild_worst(1000), 0);
    tree.check().expect("the dark tree is sound");
    // A tree that is built while it is dark has no cost to compare with.
    tree.rebuild();
    tree.set_lights(&lit).expect("the lights are valid");
    tree.refit();
    assert_eq!(tree.rebuild_worst(1000), 1000);
    assert_eq!(tree.nodes(), fresh(&tree).nodes());
}

#[test]
fn a_swarm_stays_sound_and_its_pmf_sums_to_1_for_a_thousand_frames() {
    let mut rng = Rng(45);
    let mut tree = points(&mut rng, 250);
    let mut rebuilt = 0;
    for frame in 1..=1000 {
        swirl(&mut tree, 0.05);
        tree.refit();
        rebuilt += tree.rebuild_worst(10);
        if frame % 50 != 0 {
            continue;
        }
        tree.check().expect("the tree is sound");
        // No point light is proven dark in a volume, so the probability of no light is 0.
        let shading_point = ShadingPoint::volume(rng.position(20.0));
        for splits in SPLITS {
            let sum: f64 = (0..250).map(|light| f64::from(tree.pmf(&shading_point, light, splits))).sum();
            assert!((sum - 1.0).abs() < 1e-5, "frame {frame}: {sum}");
        }
    }
    assert!(rebuilt > 0 && rebuilt <= 10_000, "{rebuilt}");
}
