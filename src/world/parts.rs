//! The parts of instances that become leaves of the top level.

use super::scene::{Scene, TreeEntry};
use crate::cluster::{Cluster, MAX_FLUX};
use crate::instance::part::Part;
use crate::keys::InstanceKey;
use crate::light::MIN_FLUX;
use crate::tree::ChildRef;

impl Scene {
    /// The parts of all instances in the order of their slots, with their clusters in the world.
    pub fn parts(&self) -> Vec<(Part, Cluster)> {
        let mut parts = Vec::with_capacity(self.instances.slot_count());
        for slot in 0..self.instances.slot_count() as u32 {
            if let Some(key) = self.instances.key_at(slot) {
                parts.extend(self.parts_of(slot, key));
            }
        }
        parts
    }

    /// The cluster of all lights of an instance, in the world. Empty for a dark tree, a hidden instance and the
    /// sky.
    pub fn cluster(&self, key: InstanceKey) -> Cluster {
        self.cluster_of(key, &self.trees[self.instances[key].tree].tree.cluster())
    }

    /// The parts of an instance, with their clusters in the world.
    pub fn parts_of(&self, slot: u32, key: InstanceKey) -> impl Iterator<Item = (Part, Cluster)> {
        let TreeEntry { tree, openings, .. } = &self.trees[self.instances[key].tree];
        let whole = openings.is_empty().then(|| (ChildRef::Node(0), tree.cluster()));
        let opened = openings.iter().map(|opening| {
            (ChildRef::of(opening.child_bits).expect("an opening is a child"), tree.opening_cluster(opening))
        });
        let parts = whole.into_iter().chain(opened);
        parts.map(move |(entry, cluster)| (Part { slot, entry }, self.cluster_of(key, &cluster)))
    }

    /// A cluster of an instance's tree in the world. Empty if it is dark, or if the instance is hidden or the
    /// sky.
    pub(super) fn cluster_of(&self, key: InstanceKey, cluster: &Cluster) -> Cluster {
        let instance = &self.instances[key];
        let Some(placed) = instance.shown().filter(|_| cluster.flux > 0.0 && !instance.is_sky) else {
            return Cluster::EMPTY;
        };
        let flux = placed.linear.flux(cluster.punctual_flux, cluster.area_flux, cluster.axis);
        let brightness = instance.appearance.brightness();
        let flux = flux.min(MAX_FLUX / brightness.max(1.0)) * brightness;
        // At a small enough scale, the flux of a light that is not dark would round to 0.
        cluster.transformed(&placed.linear, placed.translation(self.origin.as_vec3()), flux.max(MIN_FLUX))
    }
}

impl TreeEntry {
    /// The parts of each instance.
    pub fn part_count(&self) -> usize {
        self.openings.len().max(1)
    }

    /// About how many lights each part has.
    pub fn lights_of_part(&self) -> u32 {
        self.tree.light_count().div_ceil(self.part_count()) as u32
    }

    /// The cluster of a part in the tree's space; `None` if there is no such part.
    pub fn part(&self, index: usize) -> Option<Cluster> {
        match self.openings.get(index) {
            Some(opening) => Some(self.tree.opening_cluster(opening)),
            None => (self.openings.is_empty() && index == 0).then(|| self.tree.cluster()),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{Mat3, Vec3};

    use crate::tree::LightTree;
    use crate::{Light, LightWorld, Placement, Policy};

    #[test]
    fn a_part_has_the_flux_of_its_lights_of_both_kinds() {
        let lights = || {
            let at = |x: f32| Vec3::new(x, 0.0, 0.0);
            vec![
                Light::point(at(0.0), Vec3::splat(3.0)),
                Light::rectangle(at(1.0), Vec3::X, Vec3::Y, Vec3::splat(5.0)),
                Light::spot(at(2.0), Vec3::NEG_Y, 0.2, 0.9, Vec3::splat(7.0)),
            ]
        };
        let [point, rectangle, spot] = lights()[..] else { panic!("three lights") };
        for (scale, area) in [(1.0, 1.0), (2.0, 4.0)] {
            let mut world = LightWorld::new();
            let tree = world.add_tree(LightTree::new(lights()).expect("valid lights"));
            let placement = Placement { linear: Mat3::IDENTITY * scale, ..Placement::IDENTITY };
            world.add_instance(tree, placement, Policy::Static).expect("a valid placement");
            let sum: f32 = world.parts().iter().map(|(_, cluster)| cluster.flux).sum();
            // Surfaces grow with the square of the scale, and lights without size do not.
            let expected = point.flux() + spot.flux() + area * rectangle.flux();
            assert!((sum / expected - 1.0).abs() < 1.0e-5, "{sum} {expected}");
        }
    }
}
