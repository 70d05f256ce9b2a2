//! What an engine reads back of trees whose lights its kernels write, some frames later.

use bytemuck::pod_read_unaligned;

use super::super::buffers::BufferId;
use super::super::layout::{LightRecord, TreeRecord};
use super::records::MeasureRecord;
use crate::keys::TreeKey;
use crate::light::{Light, Shape};
use crate::tree::Attributes;
use crate::world::{KernelPart, LightWorld, SourceMeasure, TreeVersion};

/// A range of a buffer with what the last refit has found out. Copy it after the refit, read the copy whenever it is
/// there, and pass its bytes to [`Readback::apply`].
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Readback {
    /// The buffer.
    pub buffer: BufferId,
    /// The first byte.
    pub offset: u64,
    /// How many bytes, more than 0.
    pub bytes: u64,
    pub(in crate::plan) what: ReadbackOf,
}

/// What a range holds.
#[derive(Clone, Debug)]
pub(in crate::plan) enum ReadbackOf {
    /// The measures of trees, 32 bytes each.
    Measures(Vec<Option<TreeVersion>>),
    /// The clusters of parts of a tree, 80 bytes each: the first one, and the parts that the tree has.
    Parts(TreeVersion, u32, usize),
    /// The lights of a tree.
    Lights(TreeVersion),
}

impl Readback {
    /// Tells the world what the bytes say, before its next update. What was removed or rebuilt meanwhile is left out.
    ///
    /// - Of measures, returns the trees whose policies request a rebuild: read their lights back with
    ///   [`LightPlanner::source_lights`](super::super::LightPlanner::source_lights).
    /// - Of parts, the top level has nodes where they are.
    /// - Of lights, the tree has these, so that a rebuild is of them.
    ///
    /// O(bytes).
    pub fn apply(&self, world: &mut LightWorld, bytes: &[u8]) -> Vec<TreeKey> {
        match &self.what {
            ReadbackOf::Measures(versions) => return measured(world, versions, bytes),
            ReadbackOf::Parts(version, first, count) => {
                let records = bytes.chunks_exact(size_of::<TreeRecord>()).map(pod_read_unaligned::<TreeRecord>);
                let part = |TreeRecord { cluster, .. }| KernelPart { mean: cluster.mean.into(), flux: cluster.flux };
                world.follow_kernel((*version, *first, *count), records.map(part));
            }
            ReadbackOf::Lights(version) => set_lights(world, *version, bytes),
        }
        Vec::new()
    }

    /// The most trees that [`Readback::apply`] returns.
    pub fn most_trees(&self) -> usize {
        if let ReadbackOf::Measures(versions) = &self.what { versions.len() } else { 0 }
    }

    /// The tree whose lights these are.
    #[cfg(feature = "gpu")]
    pub(crate) fn tree_of_lights(&self) -> Option<TreeKey> {
        if let ReadbackOf::Lights(version) = &self.what { Some(version.tree) } else { None }
    }
}

fn measured(world: &mut LightWorld, versions: &[Option<TreeVersion>], bytes: &[u8]) -> Vec<TreeKey> {
    let records = bytes.chunks_exact(size_of::<MeasureRecord>()).map(pod_read_unaligned::<MeasureRecord>);
    let wants = |(version, record): (&Option<TreeVersion>, MeasureRecord)| {
        let [distance, overlap, variance, splitting_cost] = record.attributes;
        let measure = SourceMeasure {
            attributes: Attributes { distance, overlap, variance, splitting_cost },
            spread: record.spread,
            axis_length: record.axis_length,
            refused: record.refused,
        };
        version.filter(|version| world.measure(*version, &measure)).map(|version| version.tree)
    };
    versions.iter().zip(records).filter_map(wants).collect()
}

fn set_lights(world: &mut LightWorld, version: TreeVersion, bytes: &[u8]) {
    if world.version(version.tree) != Some(version) {
        return;
    }
    let Some(tree) = world.tree(version.tree) else { return };
    let records = bytes.chunks_exact(size_of::<LightRecord>()).map(pod_read_unaligned::<LightRecord>);
    let lights = (0..).zip(tree.lights()).zip(records).filter(|((_, light), _)| !light.is_removed());
    let changes: Vec<_> = lights.map(|((index, light), record)| (index, light_of(light, &record))).collect();
    // What shaders accept, the world accepts too, but for trees that have become static.
    let _ = world.set_lights(version.tree, &changes);
}

/// The light of a record, whose kind, range, sides and opening angles are those of `light`.
fn light_of(light: &Light, record: &LightRecord) -> Light {
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
