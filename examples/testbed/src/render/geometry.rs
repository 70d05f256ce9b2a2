//! The geometry that rays hit: one bounding volume hierarchy for each mesh, and an upper one over
//! the placed objects.
//!
//! The crate obvhs builds them. When objects move, only the upper hierarchy is rebuilt, over the
//! boxes of the objects.

use super::nodes::{MAX_REFERENCE, Node, Subtree, collect_nodes, leaf_reference};
use super::scene::{Alpha, Mesh, Object, Scene, SceneError};
use super::textures::Opacity;
use bytemuck::{Pod, Zeroable};
use girandole::glam::{Affine3A, Vec3, Vec3A, Vec4};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};
use rayon::prelude::*;
use std::ops::Range;

/// At most 8, for which a reference to a leaf has three bits.
const MAX_LEAF_TRIANGLES: u32 = 4;
/// Objects that a build of the upper hierarchy reinserts to improve it. This saves a sixth of the
/// box tests per ray, for less than a millisecond in cities of any size.
const REINSERTIONS: f32 = 500.0;
/// A distance beyond everything, in metres. `FAR` in `render.wgsl`.
const FAR: f32 = 3.0e38;
/// Largest absolute coordinate of a vertex and entry of a transform: areas of boxes in world space
/// stay within f32.
const MAX_COORDINATE: f32 = 1e8;
/// A flag of [`PackedTriangle::flags`]: shadow rays pass through.
pub const SEE_THROUGH: u32 = 1;
/// A flag of [`PackedTriangle::flags`]: rays may pass through, as the opacity states.
pub const TRANSLUCENT: u32 = 2;
/// A flag of [`PackedTriangle::flags`] and a kind of attribute: texture coordinates.
pub const TEX_COORDS: u32 = 4;
/// A flag of [`PackedTriangle::flags`] and a kind of attribute: colours.
pub const COLORS: u32 = 8;
/// A flag of [`PackedTriangle::flags`] and a kind of attribute: normals.
pub const NORMALS: u32 = 16;
/// All kinds of attributes.
const ATTRIBUTES: u32 = TEX_COORDS | COLORS | NORMALS;
/// A corner's normal is that of a flat triangle if the cosine of the angle between them exceeds this.
const FLAT_COSINE: f32 = 1.0 - 1e-5;

/// A triangle as both backends read it. `Triangle` in `render.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(16))]
pub struct PackedTriangle {
    /// First corner.
    pub corner: Vec3,
    /// Index into the scene's materials.
    pub material: u32,
    /// From the first corner to the second.
    pub edge1: Vec3,
    /// [`SEE_THROUGH`], [`TRANSLUCENT`], and the kinds of attributes that it has.
    pub flags: u32,
    /// From the first corner to the third.
    pub edge2: Vec3,
    /// Index into [`Geometry::attributes`] of the first one that it has.
    pub attributes: u32,
}

/// An attribute of a triangle: a vector for each corner. It has the size of a [`PackedTriangle`], whose
/// buffer it shares on a device.
pub type Attribute = [Vec4; 3];

/// An object as ray queries need it.
#[derive(Clone, Copy, Debug)]
pub struct PlacedObject {
    /// World space to mesh space.
    pub inverse: Affine3A,
    /// Root of its mesh's hierarchy.
    pub root: u32,
    /// Factor on the emission of its materials.
    pub emission_scale: f32,
    /// False for objects that are hidden, or whose transform has no inverse.
    pub visible: bool,
}

/// The box of everything that casts shadows; `min` exceeds `max` if nothing does.
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

    /// The radius of a sphere around the box, metres; 0 if nothing casts shadows.
    pub fn radius(&self) -> f32 {
        if self.min.cmple(self.max).all() { (self.max - self.min).length() * 0.5 } else { 0.0 }
    }

    /// Whether something may block a ray within the distance `limit`; where not, no shadow ray is
    /// needed.
    ///
    /// Compares the box of the ray's segment with the box of all occluders. Twin of
    /// `may_be_occluded` in `render.wgsl`.
    pub fn may_block(&self, origin: Vec3, direction: Vec3, limit: f32) -> bool {
        let end = origin + direction * limit.min(FAR);
        limit > 0.0 && origin.min(end).cmple(self.max).all() && origin.max(end).cmpge(self.min).all()
    }
}

/// What a call of [`Geometry::update`] changed.
#[derive(Clone, Debug, Default)]
pub struct GeometryChange {
    /// Ranges of [`Geometry::objects`].
    pub objects: Vec<Range<usize>>,
    /// Whether the upper hierarchy was rebuilt.
    pub top: bool,
}

/// Everything a ray can hit.
pub struct Geometry {
    /// The upper hierarchy, with room for one node per object, then the hierarchies of the meshes.
    pub nodes: Vec<Node>,
    /// The upper hierarchy.
    pub top: Subtree,
    /// Depth of the deepest hierarchy of a mesh, in nodes.
    pub mesh_depth: u32,
    /// The triangles of all meshes, in the order of the leaves.
    pub triangles: Vec<PackedTriangle>,
    /// The attributes of triangles, of which each has its own in the order of their flags.
    pub attributes: Vec<Attribute>,
    /// The opacity of surfaces, as of the construction.
    pub opacity: Opacity,
    /// The objects of the scene, in the same order.
    pub objects: Vec<PlacedObject>,
    /// What casts shadows.
    pub occluders: Occluders,
    /// Nodes of the upper hierarchy in use.
    top_count: usize,
    /// Box of each mesh.
    bounds: Vec<Aabb>,
    /// Whether any triangle of a mesh is opaque, by mesh.
    casts_shadows: Vec<bool>,
    /// Root of each mesh's hierarchy.
    roots: Vec<u32>,
    /// The objects as of the last update.
    last: Vec<Object>,
    builder: PlocBuilder,
}

/// The hierarchy of a mesh.
struct BuiltMesh {
    /// `None` if one leaf holds all triangles.
    bvh: Option<Bvh2>,
    /// Triangles in the order of the leaves.
    order: Vec<u32>,
    bounds: Aabb,
}

impl GeometryChange {
    /// Whether nothing changed.
    pub fn is_empty(&self) -> bool {
        self.objects.is_empty() && !self.top
    }
}

impl Geometry {
    /// Builds all hierarchies. Refuses indices out of range, empty meshes, and coordinates beyond
    /// [`MAX_COORDINATE`].
    pub fn new(scene: &Scene) -> Result<Self, SceneError> {
        check(scene)?;
        let built: Vec<BuiltMesh> = scene.meshes.par_iter().map(build_mesh).collect();
        let mut nodes = vec![Node::zeroed(); scene.objects.len().max(1)];
        let mut triangles = Vec::with_capacity(scene.meshes.iter().map(|mesh| mesh.triangles.len()).sum());
        let mut attributes = Vec::new();
        let mut roots = Vec::with_capacity(built.len());
        let mut mesh_depth = 0;
        for (mesh, built) in scene.meshes.iter().zip(&built) {
            let first = triangles.len() as u32;
            triangles.extend(built.order.iter().map(|&i| pack(scene, mesh, i as usize, &mut attributes)));
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
            attributes,
            opacity: Opacity::new(scene),
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

    /// Takes over the objects that moved, or whose visibility or emission changed, since the last
    /// call.
    pub fn update(&mut self, scene: &Scene) -> Result<GeometryChange, SceneError> {
        let mut change = GeometryChange::default();
        for (i, object) in scene.objects.iter().enumerate() {
            let last = self.last[i];
            let moved = object.transform != last.transform || object.visible != last.visible;
            if !moved && object.emission_scale == last.emission_scale {
                continue;
            }
            if !is_within_limits(object) {
                return Err(transform_error(i));
            }
            self.objects[i] = self.place(object);
            self.last[i] = *object;
            // A change of emission moves no box, and hidden objects have no box.
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

    /// The nodes of the upper hierarchy.
    pub fn top_nodes(&self) -> &[Node] {
        &self.nodes[..self.top_count]
    }

    /// The same with the room for more.
    pub fn top_nodes_and_room(&self) -> &[Node] {
        &self.nodes[..self.objects.len().max(1)]
    }

    fn place(&self, object: &Object) -> PlacedObject {
        // Some builds of glam panic on a matrix without an inverse.
        let is_flat = object.transform.matrix3.determinant() == 0.0;
        let inverse = if is_flat { Affine3A::NAN } else { object.transform.inverse() };
        PlacedObject {
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
        // The box must contain the object in spite of rounding.
        let extent = extent + (extent + center.abs()) * 1e-6;
        Aabb::new(center - extent, center + extent)
    }
}

fn check(scene: &Scene) -> Result<(), SceneError> {
    let triangles: usize = scene.meshes.iter().map(|mesh| mesh.triangles.len()).sum();
    if triangles.max(scene.objects.len()) > MAX_REFERENCE {
        let objects = scene.objects.len();
        return Err(SceneError(format!(
            "{triangles} triangles and {objects} objects: the limit is {MAX_REFERENCE} of each"
        )));
    }
    for (i, mesh) in scene.meshes.iter().enumerate() {
        if mesh.triangles.is_empty() {
            return Err(SceneError(format!("mesh {i} has no triangles")));
        }
        for triangle in &mesh.triangles {
            let is_valid = |vertex: &Vec3| vertex.abs().cmple(Vec3::splat(MAX_COORDINATE)).all();
            if !triangle.vertices.iter().all(is_valid) {
                return Err(SceneError(format!("mesh {i} has a vertex that is not within {MAX_COORDINATE} m")));
            }
            let Some(material) = scene.materials.get(triangle.material as usize) else {
                return Err(SceneError(format!("mesh {i} uses material {}, which does not exist", triangle.material)));
            };
            if let Some(texture) = material.textures().find(|&texture| texture as usize >= scene.textures.len()) {
                return Err(SceneError(format!("mesh {i} uses texture {texture}, which does not exist")));
            }
        }
        let attributes = [&mesh.tex_coords, &mesh.colors, &mesh.normals];
        if attributes.iter().any(|list| !list.is_empty() && list.len() != mesh.triangles.len()) {
            return Err(SceneError(format!("mesh {i} does not have attributes for each triangle")));
        }
    }
    for (i, object) in scene.objects.iter().enumerate() {
        if object.mesh as usize >= scene.meshes.len() {
            return Err(SceneError(format!("object {i} uses mesh {}, which does not exist", object.mesh)));
        }
        if !is_within_limits(object) {
            return Err(transform_error(i));
        }
    }
    Ok(())
}

/// Whether no entry of an object's transform exceeds [`MAX_COORDINATE`]; false for NaN.
fn is_within_limits(object: &Object) -> bool {
    object.transform.to_cols_array().into_iter().all(|entry| entry.abs() <= MAX_COORDINATE)
}

fn transform_error(object: usize) -> SceneError {
    SceneError(format!("object {object} has a transform with an entry that is not within {MAX_COORDINATE}"))
}

fn build_mesh(mesh: &Mesh) -> BuiltMesh {
    let boxes: Vec<Aabb> = mesh.triangles.iter().map(|t| Aabb::from_points(&t.vertices.map(Vec3A::from))).collect();
    let bounds = boxes.iter().fold(Aabb::INVALID, |all, one| all.union(one));
    if boxes.len() <= MAX_LEAF_TRIANGLES as usize {
        return BuiltMesh { bvh: None, order: (0..boxes.len() as u32).collect(), bounds };
    }
    let bvh = build_bvh(&boxes);
    let order = bvh.primitive_indices.clone();
    BuiltMesh { bvh: Some(bvh), order, bounds }
}

/// Builds as `build_bvh2` of obvhs does, which also reads a clock that browsers lack.
fn build_bvh(boxes: &[Aabb]) -> Bvh2 {
    let params = BvhBuildParams::medium_build();
    let indices = (0..boxes.len() as u32).collect();
    let mut builder = PlocBuilder::with_capacity(boxes.len());
    let (distance, depth) = (params.ploc_search_distance, params.search_depth_threshold);
    let mut bvh = builder.build(distance, boxes, indices, params.sort_precision, depth);
    let mut optimizer = ReinsertionOptimizer::default();
    optimizer.run(&mut bvh, params.reinsertion_batch_ratio, None);
    collapse(&mut bvh, MAX_LEAF_TRIANGLES, params.collapse_traversal_cost);
    let ratio = params.reinsertion_batch_ratio * params.post_collapse_reinsertion_batch_ratio_multiplier;
    optimizer.run(&mut bvh, ratio, None);
    bvh
}

/// Whether any triangle of a mesh is opaque.
fn casts_shadows(scene: &Scene, mesh: &Mesh) -> bool {
    mesh.triangles.iter().any(|triangle| !scene.materials[triangle.material as usize].see_through)
}

/// A triangle of a mesh as both backends read it. The attributes that it needs are appended to
/// `attributes`.
fn pack(scene: &Scene, mesh: &Mesh, index: usize, attributes: &mut Vec<Attribute>) -> PackedTriangle {
    let triangle = &mesh.triangles[index];
    let material = &scene.materials[triangle.material as usize];
    let [a, b, c] = triangle.vertices;
    let mut flags = if material.see_through { SEE_THROUGH } else { 0 };
    if material.alpha != Alpha::Opaque {
        flags |= TRANSLUCENT;
    }
    let first = attributes.len() as u32;
    let front = (b - a).cross(c - a).normalize_or_zero();
    let mut add = |kind: u32, corners: Option<Attribute>| {
        flags |= if corners.is_some() { kind } else { 0 };
        attributes.extend(corners);
    };
    add(TEX_COORDS, mesh.tex_coords.get(index).copied().filter(|_| material.textures().next().is_some()));
    add(COLORS, mesh.colors.get(index).copied().filter(|colors| *colors != [Vec4::ONE; 3]));
    add(NORMALS, mesh.normals.get(index).and_then(|normals| curved(normals, front)));
    PackedTriangle { corner: a, material: triangle.material, edge1: b - a, flags, edge2: c - a, attributes: first }
}

/// The normals of a triangle's corners on the side of its front; `None` if the triangle is flat.
fn curved(normals: &Attribute, front: Vec3) -> Option<Attribute> {
    let cosines = normals.map(|normal| normal.truncate().dot(front));
    let is_flat = *normals == [Vec4::ZERO; 3] || cosines.iter().all(|cosine| cosine.abs() > FLAT_COSINE);
    let side = if cosines.iter().sum::<f32>() < 0.0 { -1.0 } else { 1.0 };
    (!is_flat).then(|| normals.map(|normal| normal * side))
}

impl PackedTriangle {
    /// The index of an attribute among those of all triangles, if it has one of this kind. Twin of
    /// `attribute_corners` in `textures.wgsl`.
    pub fn attribute(&self, kind: u32) -> Option<usize> {
        // Those of the kinds before it come first.
        let before = (self.flags & ATTRIBUTES & (kind - 1)).count_ones();
        (self.flags & kind != 0).then(|| (self.attributes + before) as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::super::scene::{Camera, Material, Sky, Triangle};
    use super::*;

    /// Two objects with the same mesh, whose transforms have the given scales.
    fn scene(scales: [Vec3; 2]) -> Scene {
        let triangles = vec![Triangle { vertices: [Vec3::ZERO, Vec3::X, Vec3::Y], material: 0 }];
        let mesh = Mesh { triangles, ..Mesh::default() };
        let object = |scale: Vec3| Object {
            mesh: 0,
            transform: Affine3A::from_scale(scale),
            emission_scale: 1.0,
            visible: true,
        };
        Scene {
            materials: vec![Material::default()],
            textures: Vec::new(),
            meshes: vec![mesh],
            objects: scales.map(object).to_vec(),
            festival: None,
            camera: Camera { eye: Vec3::Z, target: Vec3::ZERO, vertical_fov: 1.0, up: Vec3::Y },
            sky: Sky::default(),
            lamp_clearance: 0.1,
            exposure: 1.0,
            is_metered: false,
            warnings: Vec::new(),
        }
    }

    #[test]
    fn transforms_beyond_the_limit_are_refused() {
        let at_limit = scene([Vec3::ONE, Vec3::splat(MAX_COORDINATE)]);
        let mut geometry = Geometry::new(&at_limit).unwrap();
        for scale in [MAX_COORDINATE.next_up(), f32::MAX, f32::INFINITY, f32::NAN] {
            let beyond = scene([Vec3::ONE, Vec3::splat(scale)]);
            assert!(Geometry::new(&beyond).is_err(), "{scale}");
            assert!(geometry.update(&beyond).is_err(), "{scale}");
        }
    }

    #[test]
    fn an_object_that_is_scaled_to_zero_is_hidden() {
        for scale in [Vec3::ZERO, Vec3::new(1.0, 0.0, 1.0)] {
            let geometry = Geometry::new(&scene([Vec3::ONE, scale])).unwrap();
            assert_eq!([0, 1].map(|object: usize| geometry.objects[object].visible), [true, false]);
            assert_eq!(geometry.nearest(Vec3::new(0.25, 0.25, 1.0), Vec3::NEG_Z).unwrap().object, 0);
        }
    }
}
