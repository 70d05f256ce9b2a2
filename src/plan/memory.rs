//! The memory that the GPU side takes, and how a limit of it is divided between nodes and lights.

use super::LightPlanner;
use super::layout::LightRecord;
use super::node_record::NodeRecord;
use super::pool::Pool;
use super::residency::Form;
use crate::keys::{TreeKey, slot_of};

/// The bytes that the GPU side takes: see [`LightPlanner::memory`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct GpuMemory {
    /// Bytes of all buffers.
    pub buffers: u64,
    /// Bytes of the two buffers of nodes and lights: the part that
    /// [`LightPlanner::set_tree_memory`] limits.
    pub trees: u64,
    /// Bytes of these two that hold nodes and lights.
    pub used: u64,
    /// Bytes of gaps between nodes and lights in use: fragmentation.
    pub gaps: u64,
}

impl LightPlanner {
    /// Limits the memory that the nodes and lights of trees take, in bytes, from the next plan on;
    /// `None` lifts the limit. At first it is [`PlanLimits::tree_memory`](super::PlanLimits).
    ///
    /// Shaders see trees that do not fit as *stand-ins*, a coarse level of detail: up to 64 of
    /// their lights that shine as brightly as all of them. So no light is lost, but accuracy
    /// degrades. Trees whose stand-ins are the least wrong at
    /// [`LightWorld::set_viewpoint`](crate::LightWorld::set_viewpoint) are evicted first: far,
    /// small and dim ones. Without a viewpoint, trees of dim lights are. Without a limit the same
    /// happens to trees for which [`PlanLimits::largest_buffer`](super::PlanLimits) has no room.
    ///
    /// With a limit, a buffer grows by a factor of 16 at a time up to its share of the limit, so
    /// little is ever copied. While it grows, the old and the new buffer together exceed the share
    /// by at most a sixteenth. Without a limit, buffers double. A lower limit than before may send
    /// all trees again. A limit below 131,072 counts as 131,072. Instances and the top level do not
    /// count towards the limit: they take up to 435 bytes for each instance of a whole tree, up to 275
    /// for each part of an instance of an opened tree ([`FrameReport::parts`](crate::FrameReport)
    /// counts them), and up to twice as much because their buffers double.
    ///
    /// A plan fails with [`PlanError::Full`](super::PlanError::Full) if there is not even room for
    /// stand-ins, of up to about 7 KB for each tree, and for trees of up to 16 lights, which are always
    /// whole.
    pub fn set_tree_memory(&mut self, bytes: Option<u64>) {
        if bytes != self.held.trees.limits.tree_memory {
            self.held.trees.limits.tree_memory = bytes;
            self.held.trees.shares = None;
            self.held.trees.is_resized = true;
            self.held.trees.residency.sort();
            self.held.trees.residency.unblock_all();
        }
    }

    /// Limits the bytes of new trees and of new versions of trees that a plan sends; `None` lifts
    /// the limit. At first it is [`PlanLimits::frame_bytes`](super::PlanLimits).
    ///
    /// Until it is a tree's turn, shaders see its stand-ins or its older version:
    /// [`UploadReport::waiting_trees`](super::UploadReport::waiting_trees) counts the trees that
    /// wait. A tree of more bytes than the limit is sent in pieces. What else changed is sent at
    /// once, whatever its size: changes of trees that shaders see whole, trees of up to 16 lights,
    /// stand-ins, and the records of instances. So is a tree that is rebuilt three times while it
    /// is sent in pieces. With 0, nothing that waits is sent.
    ///
    /// With a limit other than 0, plans also defragment: once more than an eighth of a buffer is
    /// gaps that trees have left, up to a quarter of the bytes of a frame goes to trees that move
    /// to gaps.
    pub fn set_frame_bytes(&mut self, bytes: Option<u64>) {
        if bytes != self.held.trees.limits.frame_bytes {
            self.held.trees.limits.frame_bytes = bytes;
            self.held.trees.residency.unblock_all();
        }
    }

    /// Whether shaders see stand-ins of a tree after the last plan. False for a tree that was never
    /// planned.
    pub fn stands_in(&self, tree: TreeKey) -> bool {
        let state = self.held.trees.residency.get(slot_of(tree));
        state.key == Some(tree) && state.form == Form::StandIns
    }

    /// Whether shaders do not see the present version of a tree after the last plan. They see
    /// stand-ins, an older version, or nothing of a tree that was never planned.
    pub fn is_waiting(&self, tree: TreeKey) -> bool {
        let state = self.held.trees.residency.get(slot_of(tree));
        state.key != Some(tree) || state.waits
    }

    /// The memory that the buffers take after the last plan. O(gaps).
    pub fn memory(&self) -> GpuMemory {
        let pools = [
            (
                self.held.trees.nodes.bytes(),
                self.held.trees.nodes.taken(),
                self.held.trees.nodes.used(),
                Pool::<NodeRecord>::STRIDE,
            ),
            (
                self.held.trees.lights.bytes(),
                self.held.trees.lights.taken(),
                self.held.trees.lights.used(),
                Pool::<LightRecord>::STRIDE,
            ),
        ];
        let mut memory = GpuMemory { buffers: self.held.buffers.total(), ..GpuMemory::default() };
        for (bytes, taken, end, stride) in pools {
            memory.trees += bytes;
            memory.used += taken * stride;
            memory.gaps += (end - taken) * stride;
        }
        memory
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec3};

    use super::*;
    use crate::plan::PlanLimits;
    use crate::tree::LightTree;
    use crate::{FrameBudget, Light, LightWorld, Placement, Policy, TreeSource};

    #[test]
    fn parts_of_opened_trees_take_the_bytes_that_the_documents_state() {
        for count in [1 << 6, 1 << 8] {
            let mut world = LightWorld::new();
            let lights: Vec<Light> = (0..1024).map(|i| Light::point(Vec3::X * i as f32, Vec3::ONE)).collect();
            let tree = world.add_tree(LightTree::new(lights).expect("valid"));
            world.set_light_source(tree, TreeSource::GpuParticles).expect("it has instances of any kind");
            for i in 0..count {
                let placement = Placement::at(DVec3::Y * f64::from(i));
                world.add_instance(tree, placement, Policy::Static).expect("valid");
            }
            let report = world.update(FrameBudget::NONE);
            let parts = 1024 * count as usize;
            assert_eq!(report.parts, parts);
            let mut planner = LightPlanner::new(PlanLimits::default());
            let _ = planner.reserve(&world).expect("it fits").plan();
            let memory = planner.memory();
            let bytes = (memory.buffers - memory.trees) as f64 / parts as f64;
            assert!((230.0..275.0).contains(&bytes), "{bytes} bytes for each of {parts} parts");
        }
    }

    #[test]
    fn instances_take_the_bytes_that_the_documents_state() {
        // Powers of two, for which buffers that double have no room to spare.
        for count in [1 << 16, 1 << 18] {
            let mut world = LightWorld::new();
            let tree = world.add_tree(LightTree::new(vec![Light::point(Vec3::ZERO, Vec3::ONE)]).expect("valid"));
            for i in 0..count {
                let placement = Placement::at(DVec3::new(f64::from(i), 0.0, 0.0));
                world.add_instance(tree, placement, Policy::Static).expect("valid");
            }
            let mut planner = LightPlanner::new(PlanLimits::default());
            let _ = planner.reserve(&world).expect("it fits").plan();
            let memory = planner.memory();
            let bytes = (memory.buffers - memory.trees) as f64 / f64::from(count);
            assert!((390.0..436.0).contains(&bytes), "{bytes} bytes for each of {count} instances");
        }
    }
}
