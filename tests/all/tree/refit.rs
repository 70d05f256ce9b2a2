//! Changes of lights, and the refits and rebuilds after them.

use girandole::cluster::Cluster;
use girandole::glam::Vec3;
use girandole::tree::Node;
use girandole::{Attributes, Light, LightTree};
use proptest::prelude::*;

use super::{changed, checked, moved};
use testbed::testing::support::Rng;

#[test]
fn a_refused_change_changes_nothing() {
    let mut tree = checked(Rng(4).lights(50, 5.0));
    let before = tree.lights().to_vec();
    let good = Light::point(Vec3::ONE, Vec3::ONE);
    assert!(tree.set_lights(&[(0, good), (1, Light::point(Vec3::NAN, Vec3::ONE))]).is_err());
    assert!(tree.set_lights(&[(0, good), (50, good)]).is_err());
    assert_eq!(tree.lights(), before);
}

/// Everything that a refit changes, for comparisons to the last bit.
fn state(tree: &LightTree) -> (Vec<Node>, Attributes, Cluster) {
    (tree.nodes().to_vec(), tree.attributes(), tree.cluster())
}

/// The state of a tree after all of its lights are set again, so that its refit visits every node.
fn all_set_again(tree: &LightTree) -> (Vec<Node>, Attributes, Cluster) {
    let mut tree = tree.clone();
    tree.set_lights(&changed(&tree, |light| *light)).expect("the lights are valid");
    tree.refit();
    state(&tree)
}

/// Changes that move random lights of a tree. A light may occur more than once.
fn some_moved(rng: &mut Rng, tree: &LightTree, count: usize) -> Vec<(u32, Light)> {
    let mut change = |_| {
        let index = (rng.bits() % tree.lights().len() as u64) as usize;
        (index as u32, moved(&tree.lights()[index], rng.position(3.0)))
    };
    (0..count).map(&mut change).collect()
}

#[test]
fn a_refit_of_some_nodes_gives_the_same_bits_as_a_refit_of_all() {
    let mut rng = Rng(30);
    // One node; one subtree; several subtrees, which threads share.
    for count in [1, 9, 300, 20_000] {
        let mut tree = checked(rng.lights(count, 50.0));
        // A list of nodes, a sweep that skips most nodes, and one that skips few.
        for share in [usize::MAX, 100, 4, 1] {
            let changes = some_moved(&mut rng, &tree, count / share + 1);
            tree.set_lights(&changes).expect("the lights are valid");
            tree.refit();
            assert_eq!(state(&tree), all_set_again(&tree), "{count} lights, one in {share} changed");
        }
        tree.check().expect("the tree is sound");
        let before = state(&tree);
        tree.refit();
        assert_eq!(state(&tree), before);
    }
}

#[test]
fn a_refit_without_attributes_gives_the_same_nodes_and_the_next_refit_computes_the_attributes() {
    let mut rng = Rng(31);
    for count in [1, 300, 20_000] {
        let mut measured = checked(rng.lights(count, 50.0));
        let mut unmeasured = measured.clone();
        for share in [usize::MAX, 100, 2, 1] {
            let built = unmeasured.attributes();
            for _ in 0..2 {
                let changes = some_moved(&mut rng, &measured, count / share + 1);
                measured.set_lights(&changes).expect("the lights are valid");
                measured.refit();
                unmeasured.set_lights(&changes).expect("the lights are valid");
                unmeasured.refit_without_attributes();
                unmeasured.check().expect("the tree is sound");
                assert_eq!(unmeasured.nodes(), measured.nodes());
                assert_eq!(unmeasured.attributes(), built);
            }
            unmeasured.refit();
            assert_eq!(state(&unmeasured), state(&measured), "{count} lights, one in {share} changed");
        }
    }
}

#[test]
fn builds_refits_and_rebuilds_do_not_depend_on_the_number_of_threads() {
    let lights = Rng(2).lights(60_000, 100.0);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("the pool starts");
        pool.install(|| {
            let mut rng = Rng(32);
            let mut tree = checked(lights.clone());
            let mut states = vec![state(&tree)];
            for share in [100, 5, 1] {
                tree.set_lights(&some_moved(&mut rng, &tree, lights.len() / share)).expect("the lights are valid");
                tree.refit();
                states.push(state(&tree));
                tree.rebuild();
                states.push(state(&tree));
            }
            tree.check().expect("the tree is sound");
            states
        })
    };
    // `assert_eq` would print megabytes.
    assert!(run(1) == run(4));
}

/// A random light: of any kind, dark, or at a point that many lights share.
fn any_light(rng: &mut Rng) -> Light {
    let light = rng.light(60.0);
    match rng.bits() % 4 {
        0 => light.with_emission(Vec3::ZERO),
        1 => Light::point(Vec3::splat(7.0), light.emission),
        _ => light,
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn edits_refits_and_rebuilds_in_any_order_keep_a_tree_sound(
        seed in any::<u64>(),
        count in 0_usize..400,
        steps in proptest::collection::vec(0_usize..6, 1..16),
    ) {
        let mut rng = Rng(seed);
        let mut tree = checked((0..count).map(|_| any_light(&mut rng)).collect());
        for step in steps {
            match step {
                0 => tree.refit(),
                1 => tree.refit_without_attributes(),
                2 => tree.rebuild(),
                _ => {
                    let edits = (rng.bits() as usize % 400).min(count);
                    let mut change = || ((rng.bits() % count as u64) as u32, any_light(&mut rng));
                    let changes: Vec<_> = (0..edits).map(|_| change()).collect();
                    tree.set_lights(&changes).expect("the lights are valid");
                    // One of the other steps brings the nodes up to date.
                    continue;
                }
            }
            prop_assert!(tree.check().is_ok(), "{:?}", tree.check());
        }
        tree.refit();
        prop_assert!(state(&tree) == all_set_again(&tree));
    }
}
