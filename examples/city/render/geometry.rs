//! The geometry that rays hit: one bounding volume hierarchy a mesh, and one over the placed objects.
//!
//! obvhs builds both; [`super::geometry_nodes`] lays them out for both backends. An object that moves rebuilds the upper one
//! only, over boxes of objects; its triangles stay as they are.

use super::geometry_nodes::{MAX_REFERENCE, Node, Subtree, collect_nodes, leaf_reference};
use super::scene::{Mesh, Object, Scene, SceneError};
use bytemuck::{Pod, Zeroable};
use girandole::glam::{Affine3A, Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};
use rayon::prelude::*;
use std::ops::Range;
use std::time::Duration;

/// A leaf reference has three bits for its count.
const MAX_LEAF_TRIANGLES: u32 = 4;
/// Objects that a build of the upper hierarchy takes out and puts back better: a sixth fewer boxes to test per ray for
/// under a millisecond in a small city, and no more time than that in a large one.
const REINSERTIONS: f32 = 500.0;
/// Metres: farther than anything; `FAR` in `render.wgsl`.
const FAR: f32 = 3.0e38;
/// Set in [`PackedTriangle::flags`]: shadow rays pass.
pub const SEE_THROUGH: u32 = 1;

/// A triangle as both backends read it: a corner, two edges. `Triangle` in `render.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(16))]
pub struct PackedTriangle {
    /// First corner.
    pub corner: Vec3,
    /// Index into the scene's materials.
    pub material: u32,
    /// To the second corner.
    pub edge1: Vec3,
    /// [`SEE_THROUGH`] or 0.
    pub flags: u32,
    /// To the third corner.
    pub edge2: Vec3,
    /// Zero.
    pub padding: u32,
}

/// An object as rays see it.
#[derive(Clone, Copy, Debug)]
pub struct Placed {
    /// LightWorld space to mesh space.
    pub inverse: Affine3A,
    /// Its mesh's part of the nodes.
    pub root: u32,
    /// Copied from the object.
    pub emission_scale: f32,
    /// False where hidden, or squashed to nothing.
    pub visible: bool,
}

/// The box of all that casts shadows; inside out if nothing does.
#[derive(Clone, Copy, Debug)]
pub struct Occluders {
    /// Lower corner.
    pub min: Vec3,
    /// Upper corner.
    pub max: Vec3,
}

impl Occluders {
    /// Nothing casts shadows.
    const NONE: Self = Self { min: Vec3::MAX, max: Vec3::MIN };

    /// Whether something may stand within `limit`: no shadow ray is needed where not. The box of the ray's part is held
    /// against that of all occluders: cheap enough for every sample, and right wherever they are. Twin of
    /// `may_be_occluded` in `render.wgsl`.
    pub fn may_block(&self, origin: Vec3, direction: Vec3, limit: f32) -> bool {
        let end = origin + direction * limit.min(FAR);
        limit > 0.0 && origin.min(end).cmple(self.max).all() && origin.max(end).cmpge(self.min).all()
    }
}

/// What an [`Geometry::update`] changed.
#[derive(Clone, Debug, Default)]
pub struct GeometryChange {
    /// Ranges of [`Geometry::objects`].
    pub objects: Vec<Range<usize>>,
    /// Whether the upper nodes were built anew.
    pub top: bool,
}

/// Everything a ray can hit.
pub struct Geometry {
    /// The upper nodes, then each mesh's. The upper part has room for one node an object.
    pub nodes: Vec<Node>,
    /// Where rays begin.
    pub top: Subtree,
    /// The deepest mesh, in nodes.
    pub mesh_depth: u32,
    /// Of all meshes, in leaf order.
    pub triangles: Vec<PackedTriangle>,
    /// Parallel to the scene's objects.
    pub objects: Vec<Placed>,
    /// What shadows can come from.
    pub occluders: Occluders,
    top_count: usize,
    bounds: Vec<Aabb>,
    /// For each mesh, whether any of it is opaque.
    casts_shadows: Vec<bool>,
    roots: Vec<u32>,
    last: Vec<Object>,
    builder: PlocBuilder,
}

struct BuiltMesh {
    bvh: Option<Bvh2>,
    order: Vec<u32>,
    bounds: Aabb,
}

impl GeometryChange {
    /// Nothing changed.
    pub fn is_empty(&self) -> bool {
        self.objects.is_empty() && !self.top
    }
}

impl Geometry {
    /// Builds every mesh's hierarchy and the upper one. Refuses indices out of range, empty meshes and coordinates that
    /// are not finite.
    pub fn new(scene: &Scene) -> Result<Self, SceneError> {
        check(scene)?;
        let built: Vec<BuiltMesh> = scene.meshes.par_iter().map(build_mesh).collect();
        let mut nodes = vec![Node::zeroed(); scene.objects.len().max(1)];
        let mut triangles = Vec::with_capacity(scene.meshes.iter().map(|mesh| mesh.triangles.len()).sum());
        let mut roots = Vec::with_capacity(built.len());
        let mut mesh_depth = 0;
        for (mesh, built) in scene.meshes.iter().zip(&built) {
            let first = triangles.len() as u32;
            triangles.extend(built.order.iter().map(|&i| pack(scene, mesh, i as usize)));
            let subtree = match &built.bvh {
                Some(bvh) => {
                    collect_nodes(bvh, &mut nodes, |node| leaf_reference(first + node.first_index, node.prim_count))
                }
                None => Subtree { root: leaf_reference(first, built.order.len() as u32), depth: 1 },
            };
            roots.push(subtree.root);
            mesh_depth = mesh_depth.max(subtree.depth);
        }
        let mut geometry = Self {
            nodes,
            top_count: 0,
            top: Subtree::EMPTY,
            mesh_depth,
            triangles,
            objects: Vec::new(),
            occluders: Occluders::NONE,
            casts_shadows: scene.meshes.iter().map(|mesh| casts_shadows(scene, mesh)).collect(),
            bounds: built.iter().map(|mesh| mesh.bounds).collect(),
            roots,
            last: Vec::new(),
            builder: PlocBuilder::new(),
        };
        geometry.objects = scene.objects.iter().map(|object| geometry.place(object)).collect();
        geometry.last = scene.objects.clone();
        geometry.build_top();
        Ok(geometry)
    }

    /// Follows the objects that moved, appeared, vanished or changed their emission since the last call.
    pub fn update(&mut self, scene: &Scene) -> Result<GeometryChange, SceneError> {
        let mut change = GeometryChange::default();
        for (i, object) in scene.objects.iter().enumerate() {
            let last = self.last[i];
            let moved = object.transform != last.transform || object.visible != last.visible;
            if !moved && object.emission_scale == last.emission_scale {
                continue;
            }
            if !object.transform.is_finite() {
                return Err(SceneError(format!("object {i} has a transform that is not finite")));
            }
            self.objects[i] = self.place(object);
            self.last[i] = *object;
            // A change of brightness alone moves no box; hidden objects have none.
            change.top |= moved && (object.visible || last.visible);
            match change.objects.last_mut() {
                Some(range) if range.end == i => range.end += 1,
                _ => change.objects.push(i..i + 1),
            }
        }
        if change.top {
            self.build_top();
        }
        Ok(change)
    }

    /// The upper nodes in use.
    pub fn top_nodes(&self) -> &[Node] {
        &self.nodes[..self.top_count]
    }

    fn place(&self, object: &Object) -> Placed {
        let inverse = object.transform.inverse();
        Placed {
            inverse,
            root: self.roots[object.mesh as usize],
            emission_scale: object.emission_scale,
            visible: object.visible && inverse.is_finite(),
        }
    }

    fn build_top(&mut self) {
        let visible: Vec<u32> = (0..self.objects.len() as u32).filter(|&i| self.objects[i as usize].visible).collect();
        self.top_count = visible.len().saturating_sub(1);
        self.occluders = visible
            .iter()
            .filter(|&&i| self.casts_shadows[self.last[i as usize].mesh as usize])
            .map(|&i| self.object_bounds(i as usize))
            .fold(Occluders::NONE, |all, one| Occluders {
                min: all.min.min(one.min.into()),
                max: all.max.max(one.max.into()),
            });
        self.top = match visible[..] {
            [] => Subtree::EMPTY,
            [only] => Subtree { root: leaf_reference(only, 1), depth: 1 },
            _ => {
                let boxes: Vec<Aabb> = visible.iter().map(|&i| self.object_bounds(i as usize)).collect();
                let indices = (0..boxes.len() as u32).collect();
                let mut bvh = self.builder.build(PlocSearchDistance::Low, &boxes, indices, SortPrecision::U64, 0);
                let share = (REINSERTIONS / visible.len() as f32).min(0.15);
                ReinsertionOptimizer::default().run(&mut bvh, share, None);
                let mut top = Vec::with_capacity(visible.len());
                let subtree = collect_nodes(&bvh, &mut top, |node| {
                    leaf_reference(visible[bvh.primitive_indices[node.first_index as usize] as usize], 1)
                });
                self.nodes[..top.len()].copy_from_slice(&top);
                subtree
            }
        };
    }

    fn object_bounds(&self, object: usize) -> Aabb {
        let Object { transform, mesh, .. } = self.last[object];
        let bounds = self.bounds[mesh as usize];
        let center = transform.transform_point3a((bounds.min + bounds.max) * 0.5);
        let half = (bounds.max - bounds.min) * 0.5;
        let m = transform.matrix3;
        let extent = m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z;
        // Rounding must not shrink a box below what it holds.
        let extent = extent + (extent + center.abs()) * 1e-6;
        Aabb::new(center - extent, center + extent)
    }
}

fn check(scene: &Scene) -> Result<(), SceneError> {
    let triangles: usize = scene.meshes.iter().map(|mesh| mesh.triangles.len()).sum();
    if triangles.max(scene.objects.len()) > MAX_REFERENCE {
        let objects = scene.objects.len();
        return Err(SceneError(format!(
            "{triangles} triangles and {objects} objects: at most {MAX_REFERENCE} of each"
        )));
    }
    for (i, mesh) in scene.meshes.iter().enumerate() {
        if mesh.triangles.is_empty() {
            return Err(SceneError(format!("mesh {i} has no triangles")));
        }
        for triangle in &mesh.triangles {
            if !triangle.vertices.iter().all(|v| v.is_finite()) {
                return Err(SceneError(format!("mesh {i} has a vertex that is not finite")));
            }
            if triangle.material as usize >= scene.materials.len() {
                return Err(SceneError(format!("mesh {i} has no material {}", triangle.material)));
            }
        }
    }
    for (i, object) in scene.objects.iter().enumerate() {
        if object.mesh as usize >= scene.meshes.len() {
            return Err(SceneError(format!("object {i} has no mesh {}", object.mesh)));
        }
        if !object.transform.is_finite() {
            return Err(SceneError(format!("object {i} has a transform that is not finite")));
        }
    }
    Ok(())
}

fn build_mesh(mesh: &Mesh) -> BuiltMesh {
    let boxes: Vec<Aabb> = mesh.triangles.iter().map(|t| Aabb::from_points(&t.vertices.map(Vec3A::from))).collect();
    let bounds = boxes.iter().fold(Aabb::INVALID, |all, one| all.union(one));
    if boxes.len() <= MAX_LEAF_TRIANGLES as usize {
        return BuiltMesh { bvh: None, order: (0..boxes.len() as u32).collect(), bounds };
    }
    let params = BvhBuildParams { max_prims_per_leaf: MAX_LEAF_TRIANGLES, ..BvhBuildParams::medium_build() };
    let bvh = build_bvh2(&boxes, params, &mut Duration::default());
    let order = bvh.primitive_indices.clone();
    BuiltMesh { bvh: Some(bvh), order, bounds }
}

fn casts_shadows(scene: &Scene, mesh: &Mesh) -> bool {
    mesh.triangles.iter().any(|triangle| !scene.materials[triangle.material as usize].see_through)
}

fn pack(scene: &Scene, mesh: &Mesh, index: usize) -> PackedTriangle {
    let triangle = &mesh.triangles[index];
    let [a, b, c] = triangle.vertices;
    let flags = if scene.materials[triangle.material as usize].see_through { SEE_THROUGH } else { 0 };
    PackedTriangle { corner: a, material: triangle.material, edge1: b - a, flags, edge2: c - a, padding: 0 }
}
