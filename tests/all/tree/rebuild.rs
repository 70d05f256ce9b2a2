//! Rebuilds of a tree whose lights move.

use girandole::glam::{Quat, Vec3};
use girandole::{Light, LightTree};

use super::{changed, checked, moved};
use testbed::testing::support::Rng;

/// A tree of points in an upright cylinder of radius 20 m.
fn points(rng: &mut Rng, count: usize) -> LightTree {
    let mut light = || {
        let position = Quat::from_rotation_y(rng.between(0.0, 6.3)) * Vec3::X * 20.0 * rng.unit().sqrt();
        Light::point(position + Vec3::Y * rng.between(-5.0, 5.0), Vec3::splat(rng.between(1.0, 10.0)))
    };
    checked((0..count).map(|_| light()).collect())
}

/// A tree that is built from the same lights.
fn fresh(tree: &LightTree) -> LightTree {
    checked(tree.lights().to_vec())
}

#[test]
fn a_rise_in_cost_is_found_while_the_box_of_all_lights_grows() {
    // A cube rotates about its diagonal, faster near its centre. A cost relative to its box would
    // fall as the box grows.
    let mut rng = Rng(47);
    let mut tree = checked((0..3000).map(|_| Light::point(rng.position(10.0), Vec3::ONE)).collect());
    for _ in 0..120 {
        let changes = changed(&tree, |light| {
            let position = light.cluster().mean;
            let rotation = Quat::from_axis_angle(Vec3::ONE.normalize(), 0.02 / (1.0 + 0.1 * position.length()));
            moved(light, rotation * position - position)
        });
        tree.set_lights(&changes).expect("the lights are valid");
        tree.refit();
    }
    let [drifted, best] = [&tree, &fresh(&tree)].map(|tree| tree.attributes().splitting_cost);
    assert!(drifted > 1.12 * best, "the refitted tree did not get worse: {drifted} {best}");
    assert!(tree.cost_rise() > 0.12, "{}", tree.cost_rise());
}

#[test]
fn tiny_and_dark_trees_can_be_rebuilt() {
    let mut rng = Rng(44);
    for count in [0, 1, 8, 9, 32] {
        let mut tree = points(&mut rng, count);
        for _ in 0..20 {
            tree.set_lights(&changed(&tree, |light| moved(light, rng.position(100.0)))).expect("the lights are valid");
            tree.refit();
            tree.check().expect("the tree is sound");
            tree.rebuild();
            tree.check().expect("the tree is sound");
            assert_eq!(tree.nodes(), fresh(&tree).nodes());
        }
    }
    let mut tree = points(&mut rng, 1000);
    let lit = changed(&tree, |light| *light);
    tree.set_lights(&changed(&tree, |light| light.with_emission(Vec3::ZERO))).expect("the lights are valid");
    tree.refit();
    tree.check().expect("the dark tree is sound");
    // A tree that is built while it is dark has no cost to compare with.
    tree.rebuild();
    tree.set_lights(&lit).expect("the lights are valid");
    tree.refit();
    tree.check().expect("the tree is sound");
    assert_eq!(tree.cost_rise(), 0.0);
    tree.rebuild();
    assert_eq!(tree.nodes(), fresh(&tree).nodes());
}
