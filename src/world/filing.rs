//! Files the parts of a world's instances in the partition of the top level.

use std::sync::OnceLock;

use glam::Vec3;

#[cfg(feature = "gpu-plan")]
use super::kernel_parts::KernelPart;
use super::kernel_parts::KernelParts;
use super::log::{Revision, WorldLog};
#[cfg(feature = "gpu-plan")]
use super::scene::TreeVersion;
use super::scene::{Scene, TreeEntry};
use crate::cluster::Cluster;
use crate::keys::{InstanceKey, TreeKey, slot_of};
use crate::top::TopLevel;
use crate::top::partition::renewal::RENEWED_PARTS;
use crate::top::partition::{Bounds, PartId, Partition, Place};

/// The instances of a tree are filed anew once its box has moved by this share of its diagonal.
const MOVED_SHARE: f32 = 0.125;

/// An instance of more parts, of a tree that kernels write, is filed anew as its parts are read back, and not when it
/// moves.
const FEW_PARTS: usize = 64;

/// Parts that are so many times as large as an instance are not within it.
const LARGER: f64 = 2.0;

/// What is computed when the world is read, until it changes.
#[derive(Debug, Default)]
pub(super) struct TopCache {
    pub level: OnceLock<TopLevel>,
    /// The filing of a world that was read before its instances were filed.
    pub late: OnceLock<Filing>,
}

impl TopCache {
    /// Forgets all, since the world changes.
    pub fn clear(&mut self) {
        self.level.take();
        self.late.take();
    }
}

/// How the instances of a tree were filed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct FiledTree {
    center: Vec3,
    is_lit: bool,
    is_opened: bool,
    /// The number of lights, about.
    lights: Option<u32>,
}

/// The partition, and how far it has followed the world.
#[derive(Debug, Default)]
pub(super) struct Filing {
    pub partition: Partition,
    pub revision: Revision,
    /// The instances that there were.
    pub instances: usize,
    /// By the slots of trees.
    trees: Vec<FiledTree>,
    pub kernels: KernelParts,
}

impl Filing {
    /// Another filing that is like this one now.
    pub fn fork(&self) -> Self {
        Self { partition: self.partition.fork(), trees: self.trees.clone(), kernels: self.kernels.clone(), ..*self }
    }

    /// Whether the instances of a tree have to be filed anew, because its lights moved far, or because it
    /// is opened, so that each of its openings may have moved.
    fn has_moved(&mut self, slot: u32, entry: &TreeEntry) -> bool {
        if self.trees.len() <= slot as usize {
            self.trees.resize(slot as usize + 1, FiledTree::default());
        }
        let Cluster { aabb, flux, .. } = entry.tree.cluster();
        let lights = entry.tree.light_count().checked_ilog2();
        let is_opened = !entry.openings.is_empty();
        let present = FiledTree { center: aabb.center(), is_lit: flux > 0.0, is_opened, lights };
        let former = &mut self.trees[slot as usize];
        let is_near = present.center.distance(former.center) <= MOVED_SHARE * aabb.extent().length();
        if (FiledTree { center: former.center, ..present }) == *former && is_near && !present.is_opened {
            return false;
        }
        *former = present;
        true
    }

    /// Files what moved since the last call, and divides the partition anew where that is worth it.
    pub fn follow(&mut self, scene: &Scene, log: &WorldLog) {
        let changes = log.changes_since(self.revision, scene.origin);
        self.partition.set_origin(scene.origin);
        let gone = self.kernels.forget_changed(scene);
        let moved = |slot: u32| {
            let tree = scene.trees.key_at(slot)?;
            self.has_moved(slot, &scene.trees[tree]).then_some(tree)
        };
        let moved: Vec<TreeKey> = changes.trees().filter_map(moved).chain(gone).collect();
        let of_trees = moved.iter().flat_map(|tree| scene.trees[*tree].instances.iter().map(|key| slot_of(*key)));
        // In an order that does not depend on the edits: the first of several parts far away decides where the plane
        // lies that sets them apart.
        let mut slots: Vec<u32> = changes.instance_records().chain(of_trees).collect();
        slots.sort_unstable();
        slots.dedup();
        for slot in slots {
            match scene.instances.key_at(slot) {
                Some(key) => self.file(scene, slot, key),
                None => self.partition.file(slot, std::iter::empty()),
            }
        }
        let Self { partition, kernels, .. } = self;
        partition.renew(RENEWED_PARTS, |part| cluster(scene, kernels, part));
        self.revision = log.revision(scene.origin);
        self.instances = scene.instances.len();
    }

    /// Takes parts of a tree that were read back: see [`KernelParts::take`]. Files them anew for some instances.
    #[cfg(feature = "gpu-plan")]
    pub fn follow_kernel(
        &mut self,
        scene: &Scene,
        read: (TreeVersion, u32, usize),
        parts: impl Iterator<Item = KernelPart>,
    ) {
        let Some((range, instances)) = self.kernels.take(scene, read, parts) else { return };
        let Self { partition, kernels, .. } = self;
        for key in instances {
            if partition.filed(slot_of(key)) == read.2 {
                let places = range.clone().map(|part| place(scene, kernels, key, part as usize));
                partition.file_from(slot_of(key), range.start, places);
            }
        }
    }

    /// About how many lights of others lie within the box of an instance, or cross its border with a part of theirs: those
    /// of parts that are at most [`LARGER`] times as large, since a small object within a large one is well described
    /// by its cluster.
    pub fn lights_within(&self, scene: &Scene, key: InstanceKey) -> f64 {
        let around = |cluster: &Cluster| Bounds::around(&cluster.aabb, scene.origin);
        let own = scene.cluster(key);
        if own.flux <= 0.0 {
            return 0.0;
        }
        let bounds = around(&own).thick();
        self.partition.lights_within(slot_of(key), &bounds, |part, lights| {
            let other = around(&cluster(scene, &self.kernels, part)).thick();
            if other.size() > LARGER * bounds.size() { 0.0 } else { lights * bounds.share_of(&other) }
        })
    }

    /// Files the parts of an instance, unless they are many and readbacks tell where they are.
    fn file(&mut self, scene: &Scene, slot: u32, key: InstanceKey) {
        let tree = scene.instances[key].tree;
        let count = scene.trees[tree].part_count();
        if count > FEW_PARTS && self.kernels.are_known(tree) && self.partition.filed(slot) == count {
            return;
        }
        let Self { partition, kernels, .. } = self;
        partition.file(slot, (0..count).map(|part| place(scene, kernels, key, part)));
    }
}

/// A part in the world; empty if it does not shine or is gone.
fn cluster(scene: &Scene, kernels: &KernelParts, part: PartId) -> Cluster {
    let key = scene.instances.key_at(part.slot);
    key.map_or(Cluster::EMPTY, |key| kernels.cluster(scene, key, part.index as usize))
}

/// Where a part of an instance is; `None` if it does not shine.
fn place(scene: &Scene, kernels: &KernelParts, key: InstanceKey, part: usize) -> Option<Place> {
    let tree = &scene.trees[scene.instances[key].tree];
    Place::of(&kernels.cluster(scene, key, part), tree.lights_of_part())
}
