//! The weight of each tree: how much it matters to the picture. It is the tree's share of the
//! illuminance at the viewpoint.
//!
//! Counts of how often lights were sampled, read back from the GPU, were tried as weights. They
//! recovered no more of the gap than the illuminance alone (docs/decisions.md, 27).

use glam::DVec3;

use super::scene::{Scene, TreeEntry};
use crate::cluster::Cluster;
use crate::keys::TreeKey;

/// The illuminance of a tree that requests a rebuild is recomputed after this many updates.
const ILLUMINANCE_LIFETIME: u64 = 8;

/// The instances of a tree that its illuminance is computed from, evenly chosen if it has more.
const MAX_SAMPLED_INSTANCES: usize = 16;

/// The illuminance of a tree counts as at most this, in lux.
const MAX_ILLUMINANCE: f32 = 1.0e12;

/// A lux in the units of sums. A running sum of floats would keep the rounding of values that have
/// long gone.
const LUX: f64 = (1_u64 << 60) as f64;

/// What the weights of all trees have in common.
#[derive(Debug, Default)]
pub(super) struct ViewWeights {
    /// In metres, in world coordinates, not relative to the origin.
    pub viewpoint: Option<DVec3>,
    /// The sum of the illuminance of all trees, in units of [`LUX`] and therefore exact.
    total_illuminance: u128,
}

impl ViewWeights {
    /// The weight of a tree: its share of the illuminance of all trees.
    pub fn of(&mut self, key: TreeKey, frame: u64, scene: &mut Scene) -> f32 {
        let weight = scene.trees[key].requests.weight;
        if weight.computed_at.is_none_or(|computed_at| frame - computed_at >= ILLUMINANCE_LIFETIME) {
            let illuminance = self.illuminance_of(key, scene);
            let total = &mut self.total_illuminance;
            *total = *total + in_units(illuminance) - in_units(weight.illuminance);
            let weight = &mut scene.trees[key].requests.weight;
            weight.illuminance = illuminance;
            weight.computed_at = Some(frame);
        }
        let total = self.total_illuminance as f64 / LUX;
        let illuminance = f64::from(scene.trees[key].requests.weight.illuminance);
        if total > 0.0 { (illuminance / total) as f32 } else { 0.0 }
    }

    /// Takes a tree that is to be removed out of the sum over all trees.
    pub fn remove(&mut self, entry: &TreeEntry) {
        self.total_illuminance -= in_units(entry.requests.weight.illuminance);
    }

    /// The illuminance of a tree at the viewpoint; see [`TreeWeight`](super::scene::TreeWeight).
    fn illuminance_of(&self, key: TreeKey, scene: &Scene) -> f32 {
        self.sum_over_instances(key, scene, |cluster, dist_sq| cluster.flux / dist_sq)
    }

    /// About how wrong the illuminance at the viewpoint may be, in lux, if a few lights stand in for
    /// those of a tree: its illuminance times its squared angular size, at most 1. Without a
    /// viewpoint its flux. Not negative.
    #[cfg(feature = "gpu-plan")]
    pub fn error_of_stand_ins(&self, key: TreeKey, scene: &Scene) -> f32 {
        let has_viewpoint = self.viewpoint.is_some();
        self.sum_over_instances(key, scene, |cluster, dist_sq| {
            let angular_size = if has_viewpoint { (cluster.variance / dist_sq).min(1.0) } else { 1.0 };
            cluster.flux / dist_sq * angular_size
        })
    }

    /// The sum of a function of the clusters of a tree's instances and of their mean squared
    /// distances from the viewpoint, 1 without a viewpoint. Many instances are estimated from some.
    fn sum_over_instances(&self, key: TreeKey, scene: &Scene, f: impl Fn(&Cluster, f32) -> f32) -> f32 {
        let instances = &scene.trees[key].instances;
        let step = instances.len().div_ceil(MAX_SAMPLED_INSTANCES).max(1);
        let viewpoint = self.viewpoint.map(|viewpoint| (viewpoint - scene.origin).as_vec3());
        let values = instances.iter().step_by(step).map(|instance| {
            let cluster = scene.cluster(*instance);
            let dist_sq =
                viewpoint.map_or(1.0, |viewpoint| viewpoint.distance_squared(cluster.mean) + cluster.variance);
            f(&cluster, dist_sq.max(f32::MIN_POSITIVE))
        });
        let sum = values.sum::<f32>() * step as f32;
        // At a viewpoint inside the only lamp of a tree the illuminance has no bound. A greater
        // value would swallow those of all other trees in the sum.
        if sum.is_nan() { 0.0 } else { sum.min(MAX_ILLUMINANCE) }
    }
}

/// An illuminance in units of [`LUX`].
fn in_units(illuminance: f32) -> u128 {
    (f64::from(illuminance) * LUX) as u128
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::LightTree;
    use crate::{FrameBudget, Light, LightWorld, Placement, Policy};
    use glam::Vec3;

    fn weight_of(world: &mut LightWorld, tree: TreeKey) -> f32 {
        let frame = world.rebuilds.scheduler.frame();
        world.rebuilds.weights.of(tree, frame, &mut world.scene)
    }

    #[test]
    fn shares_add_up_to_one_after_the_viewpoint_was_inside_bright_lamps() {
        let mut world = LightWorld::new();
        let trees: Vec<TreeKey> = (0..10)
            .map(|i| {
                let candela = if i % 2 == 0 { 1.0e15 } else { 1.0 };
                let tree = world.add_tree(
                    LightTree::new(vec![Light::point(Vec3::ZERO, Vec3::splat(candela))]).expect("a valid light"),
                );
                let place = Placement::at(DVec3::new(f64::from(i), 0.0, 0.0));
                world.add_instance(tree, place, Policy::Budgeted).expect("a valid placement");
                tree
            })
            .collect();
        let shares = |world: &mut LightWorld, x: f64| {
            world.set_viewpoint(DVec3::new(x, 0.0, 0.0)).expect("a valid viewpoint");
            for _ in 0..ILLUMINANCE_LIFETIME {
                world.update(FrameBudget::NONE);
            }
            // The sum is up to date once all weights have been asked for.
            for tree in &trees {
                weight_of(world, *tree);
            }
            trees.iter().map(|tree| f64::from(weight_of(world, *tree))).sum::<f64>()
        };
        for i in 0..1000 {
            let sum = shares(&mut world, f64::from(i % 10));
            assert!((sum - 1.0).abs() < 1.0e-6, "inside of lamp {}: {sum}", i % 10);
        }
        // 1e8 m away the lamps bring some lux. A sum of floats would have kept the rounding of 1e12 lux.
        let sum = shares(&mut world, 1.0e8);
        assert!((sum - 1.0).abs() < 1.0e-6, "{sum}");
        for tree in trees {
            let instance = world.instances().next().expect("one for each tree");
            world.remove_instance(instance).expect("a live key");
            world.remove_tree(tree).expect("no instances");
        }
        assert_eq!(world.rebuilds.weights.total_illuminance, 0);
    }
}
