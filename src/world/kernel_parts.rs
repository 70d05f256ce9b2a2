//! Where the parts of trees are whose lights kernels write, as far as the engine has read that back.

use std::collections::HashMap;
use std::ops::Range;

use glam::Vec3;

use super::scene::{Scene, TreeEntry, TreeVersion};
use crate::cluster::{Aabb, Cluster};
use crate::keys::{InstanceKey, TreeKey};
use crate::light::{Light, MAX_COORDINATE};

/// The parts of instances that are filed anew for one readback, unless one instance has more.
const FILED_PARTS: usize = 2048;

/// A part of a tree, in the tree's space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct KernelPart {
    pub mean: Vec3,
    /// 0 if it is dark.
    pub flux: f32,
}

/// The parts of one tree.
#[derive(Clone, Debug)]
struct OfTree {
    version: TreeVersion,
    parts: Vec<KernelPart>,
    /// The instance whose parts are filed anew next.
    next: usize,
}

/// What was read back of all trees. Empty in a world without them.
#[derive(Clone, Debug, Default)]
pub(super) struct KernelParts(HashMap<TreeKey, OfTree>);

impl KernelParts {
    /// Whether parts of a tree were read back.
    pub fn are_known(&self, tree: TreeKey) -> bool {
        !self.0.is_empty() && self.0.contains_key(&tree)
    }

    /// Forgets trees that kernels do not write any more or that have other parts by now. Returns those of them that
    /// there are.
    pub fn forget_changed(&mut self, scene: &Scene) -> Vec<TreeKey> {
        let mut gone = Vec::new();
        self.0.retain(|tree, of_tree| {
            let is_kept = is_present(scene, of_tree.version, of_tree.parts.len());
            if !is_kept && scene.trees.contains_key(*tree) {
                gone.push(*tree);
            }
            is_kept
        });
        gone.sort_unstable();
        gone
    }

    /// Takes parts of a version of a tree that were read back, from `first` on, when it had `count`. Returns them and the
    /// instances whose parts are to be filed anew, which are others each time. O(parts).
    #[cfg_attr(not(feature = "gpu-plan"), expect(dead_code, reason = "only plans read parts back"))]
    pub fn take(
        &mut self,
        scene: &Scene,
        (version, first, count): (TreeVersion, u32, usize),
        parts: impl Iterator<Item = KernelPart>,
    ) -> Option<(Range<u32>, Vec<InstanceKey>)> {
        if !is_present(scene, version, count) {
            return None;
        }
        let entry = &scene.trees[version.tree];
        let read = self.0.entry(version.tree).or_insert_with(|| {
            let known = (0..count).filter_map(|index| entry.part(index));
            let parts = known.map(|cluster| KernelPart { mean: cluster.mean, flux: cluster.flux }).collect();
            OfTree { version, parts, next: 0 }
        });
        if (read.version, read.parts.len()) != (version, count) {
            return None;
        }
        let mut end = first;
        for (part, present) in parts.zip(read.parts.iter_mut().skip(first as usize)) {
            // Bytes may be anything.
            let is_sound = part.mean.abs().cmple(Vec3::splat(MAX_COORDINATE)).all();
            *present = if is_sound { part } else { KernelPart { mean: Vec3::ZERO, flux: 0.0 } };
            end += 1;
        }
        let instances = entry.instances.len();
        let filed = (FILED_PARTS / (end - first).max(1) as usize).max(1).min(instances);
        let from = read.next;
        read.next = (from + filed) % instances.max(1);
        Some((first..end, (from..from + filed).map(|index| entry.instances[index % instances]).collect()))
    }

    /// A part of an instance in the world, where it was when it was read back last. Empty for one that does not shine
    /// or that there is not.
    pub fn cluster(&self, scene: &Scene, key: InstanceKey, index: usize) -> Cluster {
        let tree = scene.instances[key].tree;
        let Some(known) = scene.trees[tree].part(index) else { return Cluster::EMPTY };
        let read =
            if self.0.is_empty() { None } else { self.0.get(&tree).and_then(|of_tree| of_tree.parts.get(index)) };
        let cluster = match read {
            None => known,
            Some(KernelPart { flux, .. }) if *flux <= 0.0 => Cluster::EMPTY,
            Some(KernelPart { mean, .. }) if known.flux <= 0.0 => Light::point(*mean, Vec3::ONE).cluster(),
            Some(KernelPart { mean, .. }) => {
                let Aabb { min, max } = known.aabb;
                let shift = *mean - known.mean;
                Cluster { mean: *mean, aabb: Aabb { min: min + shift, max: max + shift }, ..known }
            }
        };
        scene.cluster_of(key, &cluster)
    }
}

/// Whether kernels still write a tree, and it has so many parts.
fn is_present(scene: &Scene, version: TreeVersion, count: usize) -> bool {
    let tree = version.tree;
    let is_written = |entry: &TreeEntry| entry.source.is_some() && entry.part_count() == count;
    scene.version(tree) == Some(version) && is_written(&scene.trees[tree])
}
