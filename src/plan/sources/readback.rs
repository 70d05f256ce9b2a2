//! What an engine reads back of trees whose lights its kernels write, some frames later.

use bytemuck::pod_read_unaligned;

use super::super::buffers::BufferId;
use super::super::layout::{LightRecord, TreeRecord};
use super::records::MeasureRecord;
use crate::keys::TreeKey;
use crate::light::{Light, Shape};
use crate::tree::Attributes;
use crate::world::{KernelPart, LightWorld, SourceMeasure, TreeVersion};

/// A range of a buffer with what the last refit found out about some trees, 32 bytes each. Copy it after
/// the refit, read the copy whenever it is there, and pass its bytes to [`MeasureReadback::apply`].
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct MeasureReadback {
    /// The buffer.
    pub buffer: BufferId,
    /// The first byte.
    pub offset: u64,
    /// How many bytes, more than 0.
    pub bytes: u64,
    pub(super) versions: Vec<Option<TreeVersion>>,
}

/// A range of a buffer with the lights of a tree. Copy it after the refit, read the copy whenever it is
/// there, and pass its bytes to [`LightReadback::apply`].
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct LightReadback {
    /// The buffer.
    pub buffer: BufferId,
    /// The first byte.
    pub offset: u64,
    /// How many bytes, more than 0.
    pub bytes: u64,
    /// The tree.
    pub tree: TreeKey,
    pub(in crate::plan) version: TreeVersion,
    /// From one light to the next.
    pub(in crate::plan) stride: u64,
}

/// A range of a buffer with the clusters of some parts of a tree, 80 bytes each. Copy it after the refit, read the copy
/// whenever it is there, and pass its bytes to [`PartReadback::apply`].
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct PartReadback {
    /// The buffer.
    pub buffer: BufferId,
    /// The first byte.
    pub offset: u64,
    /// How many bytes, more than 0.
    pub bytes: u64,
    pub(super) version: TreeVersion,
    pub(super) first: u32,
    /// The parts of the tree.
    pub(super) count: usize,
}

impl MeasureReadback {
    /// Tells the world what the bytes say. Returns the trees whose policies request a rebuild: read their
    /// lights back with [`LightPlanner::source_lights`](super::super::LightPlanner::source_lights). What was
    /// removed or rebuilt meanwhile is left out. O(trees).
    pub fn apply(&self, world: &mut LightWorld, bytes: &[u8]) -> Vec<TreeKey> {
        let records = bytes.chunks_exact(size_of::<MeasureRecord>()).map(pod_read_unaligned::<MeasureRecord>);
        let wants = |(version, record): (&Option<TreeVersion>, MeasureRecord)| {
            let [distance, overlap, variance, splitting_cost] = record.attributes;
            let measure = SourceMeasure {
                attributes: Attributes { distance, overlap, variance, splitting_cost },
                spread: record.spread,
                refused: record.refused,
            };
            version.filter(|version| world.measure(*version, &measure)).map(|version| version.tree)
        };
        self.versions.iter().zip(records).filter_map(wants).collect()
    }
}

impl LightReadback {
    /// Sets the lights of the tree as the bytes say, at the next update, so that a rebuild is of these. Does
    /// nothing for a tree that was removed or rebuilt meanwhile. O(lights).
    pub fn apply(&self, world: &mut LightWorld, bytes: &[u8]) {
        if world.version(self.version.tree) != Some(self.version) {
            return;
        }
        let Some(tree) = world.tree(self.version.tree) else { return };
        let records = bytes.chunks_exact(self.stride as usize);
        let lights = (0..).zip(tree.lights()).zip(records).filter(|((_, light), _)| !light.is_removed());
        let changes: Vec<_> = lights.map(|((index, light), bytes)| (index, light_of(light, bytes))).collect();
        // What shaders accept, the world accepts too, but for trees that have become static.
        let _ = world.set_lights(self.version.tree, &changes);
    }
}

impl PartReadback {
    /// The number of parts.
    #[cfg(feature = "gpu")]
    pub(crate) fn len(&self) -> u32 {
        (self.bytes / size_of::<TreeRecord>() as u64) as u32
    }

    /// Tells the world where the parts are, so that the top level has nodes of their size there from the next update on.
    /// Does nothing for a tree that was removed, rebuilt or opened otherwise meanwhile. O(parts).
    pub fn apply(&self, world: &mut LightWorld, bytes: &[u8]) {
        let records = bytes.chunks_exact(size_of::<TreeRecord>()).map(pod_read_unaligned::<TreeRecord>);
        let parts = records.map(|record| KernelPart { mean: record.cluster.mean.into(), flux: record.cluster.flux });
        world.follow_kernel((self.version, self.first, self.count), parts);
    }
}

/// The light of a record, whose kind, range, sides and opening angles are those of `light`.
fn light_of(light: &Light, bytes: &[u8]) -> Light {
    let mut record = LightRecord::DARK;
    bytemuck::bytes_of_mut(&mut record)[..bytes.len()].copy_from_slice(bytes);
    let [a, b, c] = [record.a, record.b, record.c].map(glam::Vec3::from);
    let shape = match light.shape {
        Shape::Point { .. } => Shape::Point { position: a },
        Shape::Spot { inner_angle, outer_angle, .. } => {
            Shape::Spot { position: a, direction: b, inner_angle, outer_angle }
        }
        Shape::Rectangle { two_sided, .. } => Shape::Rectangle { center: a, half_u: b, half_v: c, two_sided },
        Shape::Triangle { two_sided, .. } => Shape::Triangle { vertices: [a, b, c], two_sided },
        Shape::Sphere { .. } => Shape::Sphere { center: a, radius: c.x },
        profile @ Shape::Profile { .. } => profile,
    };
    light.with_shape(shape).with_emission(record.emission.into())
}
