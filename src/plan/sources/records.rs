//! The records of trees whose lights the engine writes on the GPU.

use bytemuck::{Pod, Zeroable};

use super::super::layout::ClusterRecord;
use crate::cluster::Linear;

/// What kernels know of such a tree; `LightSourceRecord` in WGSL. 96 bytes. All counts are 0 while the GPU does
/// not hold the tree whole.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(in crate::plan) struct SourceRecord {
    pub light_base: u32,
    pub light_count: u32,
    pub node_base: u32,
    /// The cluster of all lights.
    pub root: u32,
    /// 1 if clusters are weighed for a map.
    pub flags: u32,
    pub record_base: u32,
    pub record_count: u32,
    /// Counted by shaders.
    pub refused: u32,
    pub padding: [u32; 4],
    /// The columns of the matrix of cofactors of the map.
    pub weights: [[f32; 4]; 3],
}

impl SourceRecord {
    /// The same record for the map that a tree is weighed for.
    pub fn weighed_for(self, map: Option<&Linear>) -> Self {
        let Some(map) = map else { return self };
        let cofactor = map.cofactor;
        let weights = [cofactor.x_axis, cofactor.y_axis, cofactor.z_axis].map(|column| column.extend(0.0).to_array());
        Self { flags: 1, weights, ..self }
    }
}

/// A cluster and what a refit knows of it besides; `RefitCluster` in WGSL. 96 bytes, which only shaders
/// write.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(in crate::plan) struct RefitCluster {
    pub cluster: ClusterRecord,
    pub punctual_flux: f32,
    pub area_flux: f32,
    /// The sums of `AttributeSums`, per lumen.
    pub sums: [f32; 4],
    pub padding: [u32; 2],
}

/// What is known of a tree after a refit on the GPU; `LightMeasure` in WGSL. 32 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct MeasureRecord {
    /// The four attributes, in the order of [`Attributes`](crate::Attributes).
    pub attributes: [f32; 4],
    /// The squared diagonal of the box by the variance of position.
    pub spread: f32,
    /// The length of the mean direction of emission.
    pub axis_length: f32,
    /// In lumens.
    pub flux: f32,
    /// How many writes of lights were refused since the record of the source was written.
    pub refused: u32,
}

/// A dispatch of a refit; `RefitPass` in WGSL.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub(super) struct RefitPass {
    /// The first word of the lists that it reads.
    pub first: u32,
    /// The number of its workgroups.
    pub count: u32,
}
