//! Placeholders: trees that are made fast and are built later.
//!
//! The lights are sorted in the order in space of the top level and grouped by eight, from
//! the bottom up, as in the linear BVH of Lauterbach et al., Fast BVH Construction on GPUs (2009).
//! Differs: all nodes but the last of each level are full.

use std::collections::BTreeSet;

use super::layout::PlacedLight;
use super::node::{EMPTY_SLOT, LEAF, NO_PARENT, WIDTH};
use super::shape::{ShapeNode, TreeShape};
use super::{LightTree, check_light_count, check_lights};
use crate::error::WorldError;
use crate::light::Light;
use crate::tree::space_order::{KEY_BITS, PLANE_BITS, SpaceOrder};

/// Bits of the digits by which keys are sorted. Three digits hold a key.
const DIGIT_BITS: u32 = 11;

/// Fewer lights than this are sorted by comparison, which needs no counts of digits.
const LEAST_DIGIT_SORTED: usize = 256;

impl LightTree {
    /// Makes a tree in about half of the time of a build, to be built later: a *placeholder*.
    /// Lights keep their indices. Call it on any thread.
    ///
    /// A placeholder is a sound tree with true fluxes, bounds and probabilities, so its lights can
    /// be sampled at once, on the CPU and the GPU, with more noise than after a build. It may be
    /// edited, refitted, frozen and cloned like any tree. A [`LightWorld`](crate::LightWorld)
    /// builds its placeholders within the budgets of its updates, whatever the policies of their
    /// instances. [`LightTree::rebuild`] builds one at once. The built tree has the same bits as
    /// [`LightTree::new`] of these lights.
    ///
    /// Up to eight lights make one node, which is built at once: the tree is no placeholder.
    ///
    /// O(lights): `docs/decisions.md`, 59, has times and the noise.
    ///
    /// # Errors
    /// As [`LightTree::new`].
    ///
    /// ```
    /// use girandole::{Light, LightTree, glam::Vec3};
    /// let lamps: Vec<_> = (0..100).map(|i| Light::point(Vec3::X * i as f32, Vec3::ONE)).collect();
    /// let mut tree = LightTree::new_placeholder(lamps.clone())?;
    /// assert!(tree.is_placeholder());
    /// tree.rebuild();
    /// assert!(!tree.is_placeholder());
    /// assert_eq!(tree.nodes(), LightTree::new(lamps)?.nodes());
    /// # Ok::<(), girandole::WorldError>(())
    /// ```
    pub fn new_placeholder(lights: Vec<Light>) -> Result<Self, WorldError> {
        check_light_count(lights.len())?;
        check_lights(lights.iter().enumerate())?;
        if lights.len() <= WIDTH {
            return Ok(Self::build_for(lights, None, BTreeSet::new()));
        }
        let placed = Self::placed_lights(&lights);
        let shape = TreeShape { nodes: grouped(&order_in_space(&placed)), sides: 0 };
        let mut tree = Self::of_shape(lights, &placed, &shape, None, BTreeSet::new());
        tree.is_placeholder = true;
        Ok(tree)
    }

    /// Whether the tree has yet to be built: it was made by [`LightTree::new_placeholder`], or its
    /// first instance in a world is that of a region, and stretched or scaled. O(1).
    pub fn is_placeholder(&self) -> bool {
        self.is_placeholder
    }

    /// Makes a tree count as a placeholder, so that the world builds it.
    pub(crate) fn mark_placeholder(&mut self) {
        self.is_placeholder = true;
    }
}

/// The places of all lights in the list, in the order of their keys in space. Lights with
/// equal keys keep their order.
fn order_in_space(lights: &[PlacedLight]) -> Vec<u32> {
    let order = SpaceOrder::new((0..).zip(lights.iter().map(|light| light.cluster.mean)), 1 << PLANE_BITS);
    let mut keys: Vec<(u32, u32)> =
        lights.iter().zip(0..).map(|(light, place)| (order.key(light.cluster.mean), place)).collect();
    if keys.len() < LEAST_DIGIT_SORTED {
        keys.sort_unstable();
    } else {
        sort_by_digits(&mut keys);
    }
    keys.into_iter().map(|(_, place)| place).collect()
}

/// Sorts pairs by their keys; equal ones keep their order.
fn sort_by_digits(keys: &mut Vec<(u32, u32)>) {
    let mut sorted = vec![(0, 0); keys.len()];
    for shift in (0..KEY_BITS).step_by(DIGIT_BITS as usize) {
        let digit = |key: u32| (key >> shift) as usize & ((1 << DIGIT_BITS) - 1);
        let mut starts = [0_u32; 1 << DIGIT_BITS];
        keys.iter().for_each(|(key, _)| starts[digit(*key)] += 1);
        let mut sum = 0;
        for start in &mut starts {
            sum += std::mem::replace(start, sum);
        }
        for pair in keys.iter() {
            let start = &mut starts[digit(pair.0)];
            sorted[*start as usize] = *pair;
            *start += 1;
        }
        std::mem::swap(keys, &mut sorted);
    }
}

/// A shape over lights in this order. All nodes but the last of each level are full.
fn grouped(order: &[u32]) -> Vec<ShapeNode> {
    let mut nodes = Vec::with_capacity(order.len() / (WIDTH - 1) + WIDTH);
    // The number of lights below each child of the root.
    let mut lights = 1;
    while lights * WIDTH < order.len() {
        lights *= WIDTH;
    }
    add_group(order, lights, NO_PARENT, &mut nodes);
    nodes
}

/// Appends a subtree over lights in this order, whose children have `lights` lights each.
fn add_group(order: &[u32], lights: usize, parent: u32, nodes: &mut Vec<ShapeNode>) {
    let own = nodes.len();
    let chunks = order.chunks(lights);
    let count = chunks.len() as u32;
    nodes.push(ShapeNode { children: [EMPTY_SLOT; WIDTH], count, parent, span: 1 });
    for (slot, chunk) in chunks.enumerate() {
        nodes[own].children[slot] = match chunk {
            [light] => LEAF | light,
            _ => {
                let child = nodes.len() as u32;
                // A child of few lights needs no levels between.
                let mut lights = lights / WIDTH;
                while chunk.len() <= lights {
                    lights /= WIDTH;
                }
                add_group(chunk, lights, (own * WIDTH + slot) as u32, nodes);
                child
            }
        };
    }
    nodes[own].span = (nodes.len() - own) as u32;
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::tree::testing::{Rng, state_of};

    fn lamp(rng: &mut Rng) -> Light {
        let place = 100.0 * Vec3::new(rng.unit(), 0.1 * rng.unit(), rng.unit());
        let emission = Vec3::splat((rng.unit() - 0.1).max(0.0));
        match rng.below(3) {
            0 => Light::point(place, emission).with_range(9.0),
            1 => Light::spot(place, Vec3::NEG_Y, 0.2, 0.9, emission),
            _ => Light::rectangle(place, Vec3::X, Vec3::Z, emission),
        }
    }

    fn lamps(count: usize) -> Vec<Light> {
        let mut rng = Rng(count as u64);
        (0..count).map(|_| lamp(&mut rng)).collect()
    }

    #[test]
    fn a_placeholder_is_sound_has_full_nodes_and_becomes_the_tree_that_a_build_makes() {
        for count in [0, 1, 8, 9, 10, 16, 17, 63, 64, 65, 66, 255, 256, 257, 511, 513, 3000, 4097] {
            let lights = lamps(count);
            let built = LightTree::new(lights.clone()).expect("valid");
            let mut tree = LightTree::new_placeholder(lights).expect("valid");
            tree.check().unwrap_or_else(|error| panic!("{count} lights: {error}"));
            assert_eq!(tree.is_placeholder(), count > WIDTH);
            assert!(!built.is_placeholder());
            if count > WIDTH {
                assert!(tree.nodes().iter().all(|node| node.count() > 1), "{count} lights");
                // The nodes of a complete tree, and at most one more on each level.
                let levels = count.ilog2() as usize / 3 + 1;
                assert!(tree.nodes().len() <= count.div_ceil(WIDTH - 1) + levels, "{count} lights");
            }
            let relative = (tree.flux().punctual / built.flux().punctual - 1.0).abs();
            assert!(relative < 1.0e-5 || built.flux().punctual == 0.0, "{relative}");
            assert_eq!((tree.effects(), tree.cluster().aabb), (built.effects(), built.cluster().aabb));
            tree.rebuild();
            assert!(state_of(&tree) == state_of(&built), "{count} lights");
            assert!(!tree.is_placeholder());
        }
    }

    #[test]
    fn a_placeholder_of_lights_at_one_point_far_away_or_all_dark_is_sound() {
        let far = |x: f32| Light::point(Vec3::new(x, 1.0e9, -1.0e9), Vec3::ONE);
        let dark = |x: f32| Light::point(Vec3::X * x, Vec3::ZERO);
        for lights in [vec![far(0.0); 300], vec![dark(3.0); 300], (0..300).map(|i| far(1.0e9 - i as f32)).collect()] {
            let tree = LightTree::new_placeholder(lights).expect("valid");
            tree.check().expect("sound");
        }
    }

    #[test]
    fn keys_are_sorted_as_a_stable_sort_sorts_them() {
        let mut rng = Rng(7);
        let mut keys: Vec<(u32, u32)> = (0..5000).map(|i| (rng.below(1 << 31) as u32 >> (i % 31), i)).collect();
        let mut expected = keys.clone();
        expected.sort_by_key(|(key, _)| *key);
        sort_by_digits(&mut keys);
        assert_eq!(keys, expected);
    }

    #[test]
    fn neighbours_in_a_placeholder_are_neighbours_in_space() {
        let lights: Vec<Light> = {
            let mut rng = Rng(11);
            (0..4096).map(|_| Light::point(Vec3::new(rng.unit(), rng.unit(), rng.unit()), Vec3::ONE)).collect()
        };
        let mut tree = LightTree::new_placeholder(lights).expect("valid");
        let by_order = tree.attributes().splitting_cost;
        tree.rebuild();
        // In the order of the list, the cost is more than ten times that of a build.
        assert!(by_order < 4.0 * tree.attributes().splitting_cost, "{by_order}");
    }

    #[test]
    fn a_placeholder_is_refused_as_a_tree_is_and_stays_one_until_it_is_built() {
        let mut wrong = lamps(20);
        wrong[13].emission.x = f32::NAN;
        let refused = LightTree::new(wrong.clone()).err();
        assert!(refused.is_some());
        assert_eq!(format!("{:?}", LightTree::new_placeholder(wrong).err()), format!("{refused:?}"));

        let mut tree = LightTree::new_placeholder(lamps(100)).expect("valid");
        let mut rng = Rng(5);
        tree.set_lights(&[(3, lamp(&mut rng)), (99, lamp(&mut rng))]).expect("valid");
        tree.refit();
        tree.add_lights(&[lamp(&mut rng)]).expect("valid");
        tree.remove_lights(&[50]).expect("a light");
        tree.freeze();
        tree.check().expect("sound");
        assert!(tree.is_placeholder() && tree.clone().is_placeholder());
        tree.rebuild();
        assert!(!tree.is_placeholder());
        // Most lights are new, so the tree was built.
        let mut tree = LightTree::new_placeholder(lamps(20)).expect("valid");
        tree.add_lights(&lamps(40)).expect("valid");
        assert!(!tree.is_placeholder());
    }

    #[cfg(feature = "bake")]
    #[test]
    fn a_baked_placeholder_is_the_built_tree() {
        let lights = lamps(300);
        let built = LightTree::new(lights.clone()).expect("valid").bake();
        let placeholder = LightTree::new_placeholder(lights).expect("valid");
        assert!(placeholder.bake() == built && placeholder.is_placeholder());
        assert!(!LightTree::from_baked(&built).expect("just written").is_placeholder());
    }
}
