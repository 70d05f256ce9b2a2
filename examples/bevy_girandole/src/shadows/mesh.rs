//! The triangles of a mesh that casts shadows.

use bevy::math::{Affine3A, Vec3};
use bevy::render::render_resource::WgpuFeatures;
use bevy::render::renderer::RenderDevice;
use obvhs::BvhBuildParams;

use super::flat::{Bounds, Flat};

/// The most triangles of a leaf.
const LEAF_TRIANGLES: u32 = 4;

/// How shadow rays are traced.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ShadowRays {
    /// By a walk of trees that the plugin builds, on any device.
    #[default]
    Software,
    /// By ray queries of the device.
    RayQuery,
}

impl ShadowRays {
    /// Ray queries, if the device has them.
    pub(crate) fn of(device: &RenderDevice) -> Self {
        let limits = device.limits();
        let has_room = [
            limits.max_blas_primitive_count,
            limits.max_blas_geometry_count,
            limits.max_tlas_instance_count,
            limits.max_acceleration_structures_per_shader_stage,
        ];
        match device.features().contains(WgpuFeatures::EXPERIMENTAL_RAY_QUERY) && has_room.iter().all(|of| *of > 0) {
            true => Self::RayQuery,
            false => Self::Software,
        }
    }
}

/// A `vec4<u32>` of the shader.
pub type Word = [u32; 4];

/// A mesh that casts shadows, as one kind of tracer needs it.
#[derive(Clone, Debug)]
pub struct CasterMesh {
    pub bounds: Bounds,
    /// For software: the nodes of a tree, two words each, and then the triangles, three words each. The shader reads this.
    pub words: Vec<Word>,
    pub nodes: u32,
    /// For ray queries: the corners of the triangles, from which the device builds a structure.
    pub corners: Vec<[[f32; 3]; 3]>,
}

impl CasterMesh {
    /// The mesh of finite triangles; others are left out. With trees O(n log n), about a second for a million triangles.
    pub fn new(rays: ShadowRays, mut triangles: Vec<[Vec3; 3]>) -> Self {
        triangles.retain(|corners| corners.iter().all(|corner| corner.is_finite()));
        match rays {
            ShadowRays::Software => Self::below_tree(&triangles),
            ShadowRays::RayQuery => Self {
                bounds: Bounds::around(triangles.iter().flatten().copied()),
                words: Vec::new(),
                nodes: 0,
                corners: triangles.iter().map(|corners| corners.map(Vec3::into)).collect(),
            },
        }
    }

    fn below_tree(triangles: &[[Vec3; 3]]) -> Self {
        let boxes: Vec<_> = triangles.iter().map(|corners| Bounds::around(*corners)).collect();
        let flat = Flat::build(&boxes, LEAF_TRIANGLES, BvhBuildParams::medium_build());
        let mut words: Vec<Word> = bytemuck::cast_slice(&flat.nodes).to_vec();
        for index in &flat.order {
            let [a, b, c] = triangles[*index as usize];
            words.extend([a, b - a, c - a].map(|vector| vector.extend(0.0).to_array().map(f32::to_bits)));
        }
        let bounds = flat.nodes.first().map_or(Bounds::NONE, |root| root.bounds());
        Self { bounds, words, nodes: flat.nodes.len() as u32, corners: Vec::new() }
    }
}

/// The inverse of the transform of an entity, and the box of its mesh in the world; `None` if no ray can hit it.
pub fn placed(bounds: Bounds, transform: &Affine3A) -> Option<(Affine3A, Bounds)> {
    let corner = |i: usize| {
        let pick = |axis: usize| if i >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] };
        transform.transform_point3(Vec3::new(pick(0), pick(1), pick(2)))
    };
    let (inverse, moved) = (transform.inverse(), Bounds::around((0..8).map(corner)));
    let is_sound = bounds != Bounds::NONE && inverse.is_finite() && moved.min.is_finite() && moved.max.is_finite();
    is_sound.then_some((inverse, moved))
}
