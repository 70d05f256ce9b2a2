//! The triangles of a mesh that casts shadows, below a tree of boxes.

use bevy::math::Vec3;
use obvhs::BvhBuildParams;

use super::flat::{Bounds, Flat};

/// The most triangles of a leaf.
const LEAF_TRIANGLES: u32 = 4;

/// A `vec4<u32>` of the shader.
pub type Word = [u32; 4];

/// A mesh as the shader reads it: the nodes of its tree, two words each, and then its triangles, three words each.
#[derive(Clone, Debug)]
pub struct CasterMesh {
    pub words: Vec<Word>,
    pub nodes: u32,
    pub bounds: Bounds,
}

impl CasterMesh {
    /// The mesh of finite triangles; others are left out. O(n log n), about a second for a million triangles.
    pub fn new(mut triangles: Vec<[Vec3; 3]>) -> Self {
        triangles.retain(|corners| corners.iter().all(|corner| corner.is_finite()));
        let boxes: Vec<_> = triangles.iter().map(|corners| Bounds::around(*corners)).collect();
        let flat = Flat::build(&boxes, LEAF_TRIANGLES, BvhBuildParams::medium_build());
        let mut words: Vec<Word> = bytemuck::cast_slice(&flat.nodes).to_vec();
        for index in &flat.order {
            let [a, b, c] = triangles[*index as usize];
            words.extend([a, b - a, c - a].map(|vector| vector.extend(0.0).to_array().map(f32::to_bits)));
        }
        let bounds = flat.nodes.first().map_or(Bounds::NONE, |root| root.bounds());
        Self { words, nodes: flat.nodes.len() as u32, bounds }
    }
}
