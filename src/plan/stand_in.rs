//! Stand-ins, a coarse level of detail: a few lights of a tree that shine as brightly as all of
//! them, while the GPU does not hold the tree.
//!
//! The tree is divided into clusters; the brightest and largest are split first. One light of each
//! cluster is drawn with a probability proportional to its flux, and gets the flux of the whole
//! cluster. So the expected illuminance of the stand-ins is that of the tree's lights at every
//! point (as in Yuksel, Stochastic Lightcuts, 2019). The draw depends on the tree alone, so it
//! stays the same from frame to frame.

use crate::light::{Light, MAX_EMISSION};
use crate::math::dice::hash;
use crate::tree::{ChildRef, LightTree, WIDTH};

/// A tree of up to this many lights is never replaced by stand-ins: they would take half as much
/// memory.
const MAX_SENT_WHOLE: usize = 2 * WIDTH;

/// One stand-in for this many lights, but at least eight and at most [`MOST`].
const LIGHTS_PER_STAND_IN: usize = 32;

/// The largest number of stand-ins of a tree.
const MOST: usize = 64;

/// Whether stand-ins of a tree take less memory than the tree.
pub(super) fn may_stand_in(tree: &LightTree) -> bool {
    tree.lights().len() > MAX_SENT_WHOLE
}

/// The stand-ins of a tree, as a tree of their own; without lights if the tree is dark.
///
/// O(stand-ins · depth).
pub(super) fn stand_ins(tree: &LightTree) -> LightTree {
    let wanted = (tree.light_count() / LIGHTS_PER_STAND_IN).clamp(WIDTH, MOST);
    let parts = divide(tree, wanted);
    let lights = (0..).zip(&parts).filter_map(|(index, part)| stand_in(tree, part, hash(index))).collect();
    // Values that a tree has accepted are accepted again.
    LightTree::new(lights).unwrap_or_default()
}

/// A cluster that gets a stand-in.
#[derive(Clone, Copy, Debug)]
struct Represented {
    child: ChildRef,
    flux: f32,
    /// Flux times the diagonal of the box, in metres: the cluster with the largest is split next. 0
    /// for a single light.
    spread: f32,
}

impl Represented {
    fn of(tree: &LightTree, node: u32, slot: usize) -> Option<Self> {
        let node = &tree.nodes()[node as usize];
        let (child, cluster) = (node.child(slot)?, node.cluster(slot));
        let extent = cluster.aabb.extent().length();
        let spread = if matches!(child, ChildRef::Node(_)) { cluster.flux * extent } else { 0.0 };
        (cluster.flux > 0.0).then_some(Self { child, flux: cluster.flux, spread })
    }
}

/// The children of a node that are not dark.
fn children(tree: &LightTree, node: u32) -> impl Iterator<Item = Represented> + '_ {
    (0..WIDTH).filter_map(move |slot| Represented::of(tree, node, slot))
}

/// At most `wanted` clusters that hold all lights but dark ones; all children of the root if these
/// are more.
fn divide(tree: &LightTree, wanted: usize) -> Vec<Represented> {
    if tree.nodes().is_empty() {
        return Vec::new();
    }
    let mut parts: Vec<Represented> = children(tree, 0).collect();
    loop {
        let largest = (0..parts.len()).max_by(|a, b| parts[*a].spread.total_cmp(&parts[*b].spread));
        let Some((index, ChildRef::Node(node))) = largest.map(|index| (index, parts[index].child)) else { break };
        if parts.len() - 1 + tree.nodes()[node as usize].count() > wanted {
            break;
        }
        parts.swap_remove(index);
        parts.extend(children(tree, node));
    }
    parts
}

/// A light of a cluster, with the flux of the cluster; `random` decides which. `None` if all of
/// them are dark.
fn stand_in(tree: &LightTree, part: &Represented, random: u32) -> Option<Light> {
    let (mut child, mut random) = (part.child, random);
    let index = loop {
        match child {
            ChildRef::Leaf(light) => break light,
            ChildRef::Node(node) => {
                random = hash(random);
                child = draw(tree, node, random)?;
            }
        }
    };
    let light = tree.lights()[index as usize];
    // At most the largest emission, which only lights of a trillion candela reach.
    let most = MAX_EMISSION / light.emission.max_element();
    let emission = light.emission * (part.flux / light.flux()).min(most);
    emission.is_finite().then_some(Light { emission, ..light })
}

/// A child of a node, drawn by flux.
fn draw(tree: &LightTree, node: u32, random: u32) -> Option<ChildRef> {
    let node = &tree.nodes()[node as usize];
    // Unused slots have no flux.
    let flux = node.flux.map(|half| f32::from_bits(u32::from(half) << 16));
    let mut left = random as f32 / u32::MAX as f32 * flux.iter().sum::<f32>();
    let mut chosen = None;
    for (slot, flux) in flux.into_iter().enumerate().filter(|(_, flux)| *flux > 0.0) {
        chosen = node.child(slot);
        left -= flux;
        if left < 0.0 {
            break;
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn random(i: u32) -> f32 {
        (hash(i) >> 8) as f32 / (1 << 24) as f32
    }

    fn tree(lights: u32) -> LightTree {
        let light = |i: u32| {
            let place = Vec3::new(random(4 * i), random(4 * i + 1), random(4 * i + 2)) * 100.0;
            Light::point(place, Vec3::splat(random(4 * i + 3).powi(4) * 100.0 + 0.01))
        };
        LightTree::new((0..lights).map(light).collect()).expect("valid")
    }

    #[test]
    fn stand_ins_are_few_and_as_bright_as_all_lights_together() {
        for (lights, most) in [(17, 8), (255, 8), (1000, 31), (5000, 64), (100_000, 64)] {
            let tree = tree(lights);
            let few = stand_ins(&tree);
            let count = few.light_count();
            assert!((2..=most).contains(&count), "{count} of {lights}");
            let (ours, theirs) = (few.cluster(), tree.cluster());
            // Nodes hold flux with a relative error of at most 1/256.
            assert!((ours.flux / theirs.flux - 1.0).abs() < 1.0 / 256.0, "{lights}");
            for light in few.lights() {
                let position = light.cluster().mean;
                assert!(tree.lights().iter().any(|other| other.cluster().mean == position), "{lights}");
            }
        }
    }

    #[test]
    fn each_light_is_drawn_in_proportion_to_its_flux() {
        let tree = tree(40);
        let mut counts = [0_u32; 40];
        let parts = divide(&tree, 8);
        let draws = 20_000;
        for part in &parts {
            for i in 0..draws {
                let light = stand_in(&tree, part, hash(i ^ 0x5bd1)).expect("not dark");
                let index = tree.lights().iter().position(|other| other.cluster().mean == light.cluster().mean);
                counts[index.expect("a light of the tree")] += 1;
            }
        }
        for part in &parts {
            // Five standard deviations, and the rounding of flux in nodes.
            let mut below = vec![part.child];
            while let Some(child) = below.pop() {
                match child {
                    ChildRef::Node(node) => below.extend(children(&tree, node).map(|child| child.child)),
                    ChildRef::Leaf(light) => {
                        let share = tree.lights()[light as usize].flux() / part.flux;
                        let expected = share * draws as f32;
                        let difference = (counts[light as usize] as f32 - expected).abs();
                        assert!(difference < 5.0 * expected.sqrt() + 0.01 * expected + 1.0, "{light}: {difference}");
                    }
                }
            }
        }
    }

    /// The root mean square, over directions and trees, of the relative error of the illuminance of
    /// stand-ins at this distance, in units of the standard deviation of the lights' positions.
    fn error_at(distance: f32) -> f32 {
        let illuminance = |tree: &LightTree, point: Vec3| -> f32 {
            tree.lights().iter().map(|light| light.flux() / light.cluster().mean.distance_squared(point)).sum()
        };
        let (trees, directions) = (8, 100);
        let squares = (0..trees).flat_map(|salt| {
            let lights = (0..1000).map(|i| {
                let r = |j| random(4 * (i + 1000 * salt) + j);
                Light::point(Vec3::new(r(0), r(1), r(2)) * 100.0, Vec3::splat(r(3) + 0.1))
            });
            let tree = LightTree::new(lights.collect()).expect("valid");
            let few = stand_ins(&tree);
            let cluster = tree.cluster();
            (0..directions).map(move |i| {
                let direction = Vec3::new(random(3 * i) - 0.5, random(3 * i + 1) - 0.5, random(3 * i + 2) - 0.5);
                let point = cluster.mean + direction.normalize() * cluster.variance.sqrt() * distance;
                (illuminance(&few, point) / illuminance(&tree, point) - 1.0).powi(2)
            })
        });
        (squares.sum::<f32>() / (trees * directions) as f32).sqrt()
    }

    #[test]
    fn the_error_of_stand_ins_falls_with_the_distance() {
        let errors = [2.0, 4.0, 8.0, 16.0, 64.0].map(error_at);
        // About 0.13, 0.04, 0.02, 0.009 and 0.002.
        assert!(errors.windows(2).all(|pair| pair[1] < 0.7 * pair[0]), "{errors:?}");
        assert!(errors[0] < 0.3 && errors[4] < 0.01, "{errors:?}");
    }

    #[test]
    fn a_dark_tree_has_no_stand_ins() {
        let dark = vec![Light::point(Vec3::ONE, Vec3::ZERO); 100];
        assert_eq!(stand_ins(&LightTree::new(dark).expect("valid")).light_count(), 0);
        assert_eq!(stand_ins(&LightTree::default()).light_count(), 0);
    }

    #[test]
    fn emission_stays_within_its_limit() {
        let lights = (0..100).map(|i| Light::point(Vec3::X * i as f32, Vec3::splat(MAX_EMISSION))).collect();
        let few = stand_ins(&LightTree::new(lights).expect("valid"));
        assert!(few.light_count() == 8 && few.lights().iter().all(|light| light.validate().is_ok()));
    }
}
