//! The parts of instances that become leaves of the top level.

use super::LightWorld;
use crate::cluster::{Cluster, MAX_FLUX};
use crate::keys::InstanceKey;
use crate::light::MIN_FLUX;
use crate::part::{Division, Part};
use crate::tree::Target;

impl LightWorld {
    /// The parts of all instances in the order of their slots, with their clusters in the world.
    pub(crate) fn parts(&self) -> Vec<(Part, Cluster)> {
        let mut parts = Vec::with_capacity(self.slot_count());
        for slot in 0..self.slot_count() as u32 {
            if let Some(key) = self.instance_at(slot) {
                self.add_parts(slot, key, &mut parts);
            }
        }
        parts
    }

    /// The cluster of all lights of an instance, in the world. Empty for a dark tree and for a
    /// hidden instance.
    pub(crate) fn cluster(&self, key: InstanceKey) -> Cluster {
        self.cluster_of(key, &self.trees[self.instances[key].tree].tree.cluster())
    }

    fn add_parts(&self, slot: u32, key: InstanceKey, parts: &mut Vec<(Part, Cluster)>) {
        let tree_key = self.instances[key].tree;
        let tree = &self.trees[tree_key].tree;
        match self.division(tree_key) {
            Division::Whole => {
                parts.push((Part { slot, target: Target::Node(0) }, self.cluster_of(key, &tree.cluster())));
            }
            Division::Sides => {
                for (index, side) in tree.sides().iter().enumerate() {
                    let target = tree.nodes()[0].target(index).expect("each side has a target");
                    parts.push((Part { slot, target }, self.cluster_of(key, side)));
                }
            }
            Division::Lights => {
                for (index, light) in (0..).zip(tree.lights()) {
                    let part = Part { slot, target: Target::Leaf(index) };
                    parts.push((part, self.cluster_of(key, &light.cluster())));
                }
            }
        }
    }

    /// A cluster of an instance's tree in the world. Empty if it is dark or if the instance is
    /// hidden.
    fn cluster_of(&self, key: InstanceKey, cluster: &Cluster) -> Cluster {
        let instance = &self.instances[key];
        let Some(placed) = instance.shown().filter(|_| cluster.flux > 0.0) else {
            return Cluster::EMPTY;
        };
        let flux = placed.linear.flux(cluster.punctual_flux(), cluster.area_flux, cluster.axis);
        let brightness = instance.appearance.brightness();
        let flux = flux.min(MAX_FLUX / brightness.max(1.0)) * brightness;
        // At a small enough scale, the flux of a light that is not dark would round to 0.
        cluster.transformed(&placed.linear, placed.translation(self.home()), flux.max(MIN_FLUX))
    }
}
