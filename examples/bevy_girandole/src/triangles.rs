//! The triangles of a mesh, with texture coordinates.

use bevy::math::{Vec2, Vec3};
use bevy::mesh::morph::MorphAttributes;
use bevy::mesh::{Mesh, PrimitiveTopology, VertexAttributeValues};

/// The vertices of each triangle of a mesh that the main world can read. Triangles with vertices that there are not
/// are left out.
fn vertices(mesh: &Mesh) -> Option<Vec<[usize; 3]>> {
    let count = mesh.try_attribute(Mesh::ATTRIBUTE_POSITION).ok()?.len();
    let vertices: Vec<usize> = match mesh.try_indices_option().ok()? {
        Some(indices) => indices.iter().collect(),
        None => (0..count).collect(),
    };
    let mut triangles: Vec<[usize; 3]> = match mesh.primitive_topology() {
        PrimitiveTopology::TriangleList => vertices.chunks_exact(3).map(|of| [of[0], of[1], of[2]]).collect(),
        PrimitiveTopology::TriangleStrip => {
            let turned =
                |(i, of): (usize, &[usize])| if i % 2 == 0 { [of[0], of[1], of[2]] } else { [of[1], of[0], of[2]] };
            vertices.windows(3).enumerate().map(turned).collect()
        }
        _ => return None,
    };
    triangles.retain(|triangle| triangle.iter().all(|vertex| *vertex < count));
    Some(triangles)
}

/// The corners of each triangle of a mesh; `None` for a mesh without triangles that the main world can read.
pub fn corners(mesh: &Mesh) -> Option<Vec<[Vec3; 3]>> {
    let positions = mesh.try_attribute(Mesh::ATTRIBUTE_POSITION).ok()?.as_float3()?;
    let triangles = vertices(mesh)?;
    Some(triangles.into_iter().map(|triangle| triangle.map(|vertex| positions[vertex].into())).collect())
}

/// The first or the second texture coordinates. As in Bevy, the first ones stand in for the second ones.
fn values(mesh: &Mesh, is_second: bool) -> Option<&VertexAttributeValues> {
    let of = |attribute| mesh.try_attribute_option(attribute).ok().flatten();
    let second = if is_second { of(Mesh::ATTRIBUTE_UV_1) } else { None };
    second.or_else(|| of(Mesh::ATTRIBUTE_UV_0))
}

/// Whether a mesh has texture coordinates. Bevy shows no textures on others.
pub fn has_tex_coords(mesh: &Mesh, is_second: bool) -> bool {
    values(mesh, is_second).is_some()
}

/// The texture coordinates of the corners of each triangle, in the order of [`corners`]; `None` if they are not stored
/// as two floats.
pub fn tex_coords(mesh: &Mesh, is_second: bool) -> Option<Vec<[Vec2; 3]>> {
    let Some(VertexAttributeValues::Float32x2(values)) = values(mesh, is_second) else { return None };
    let corner = |vertex: usize| values.get(vertex).copied().map_or(Vec2::NAN, Vec2::from);
    Some(vertices(mesh)?.into_iter().map(|triangle| triangle.map(corner)).collect())
}

/// Four joints of a vertex, and their weights.
pub type Influences = ([u16; 4], [f32; 4]);

/// The joints of the vertices, and their weights.
fn joints(mesh: &Mesh) -> Option<(&[[u16; 4]], &[[f32; 4]])> {
    let of = |attribute| mesh.try_attribute_option(attribute).ok().flatten();
    let Some(VertexAttributeValues::Uint16x4(joints)) = of(Mesh::ATTRIBUTE_JOINT_INDEX) else { return None };
    let Some(VertexAttributeValues::Float32x4(weights)) = of(Mesh::ATTRIBUTE_JOINT_WEIGHT) else { return None };
    Some((joints, weights))
}

/// Whether vertices of a mesh have joints.
pub fn has_joints(mesh: &Mesh) -> bool {
    joints(mesh).is_some()
}

/// The joints of the corners of each triangle, in the order of [`corners`]; `None` for a mesh without joints.
pub fn influences(mesh: &Mesh) -> Option<Vec<[Influences; 3]>> {
    let (joints, weights) = joints(mesh)?;
    let corner = |vertex: usize| Some((*joints.get(vertex)?, *weights.get(vertex)?));
    let corner = |vertex| corner(vertex).unwrap_or_default();
    Some(vertices(mesh)?.into_iter().map(|triangle| triangle.map(corner)).collect())
}

/// The morph targets of a mesh: what each moves each vertex by, target after target.
fn targets(mesh: &Mesh) -> Option<&[MorphAttributes]> {
    mesh.try_morph_targets().ok().map(Vec::as_slice).filter(|targets| !targets.is_empty())
}

/// Whether a mesh has morph targets.
pub fn has_targets(mesh: &Mesh) -> bool {
    targets(mesh).is_some()
}

/// How far each morph target moves each corner, in the order of [`corners`], target after target; `None` for a mesh
/// without morph targets.
pub fn morph_offsets(mesh: &Mesh) -> Option<Vec<[f32; 3]>> {
    let (triangles, targets) = (vertices(mesh)?, targets(mesh)?);
    // As in Bevy, attributes of different lengths have as many vertices as the shortest one.
    let offset = |of: &[MorphAttributes], vertex: usize| of.get(vertex).map_or([0.0; 3], |at| at.position.to_array());
    let corners = || triangles.iter().flatten();
    let targets = targets.chunks_exact(mesh.count_vertices().max(1));
    Some(targets.flat_map(|of| corners().map(|&vertex| offset(of, vertex))).collect())
}

#[cfg(test)]
mod tests {
    use bevy::asset::RenderAssetUsages;
    use bevy::mesh::Indices;
    use bevy::prelude::{Cuboid, Meshable};

    use super::*;

    #[test]
    fn a_mesh_has_the_same_triangles_with_and_without_indices() {
        let indexed = Mesh::from(Cuboid::new(1.0, 2.0, 3.0).mesh());
        let plain = indexed.clone().with_duplicated_vertices();
        assert!(plain.indices().is_none());
        let triangles = corners(&plain).expect("a cuboid has triangles");
        assert_eq!(triangles.len(), 12);
        assert_eq!(Some(triangles), corners(&indexed));
        assert_eq!(tex_coords(&plain, false), tex_coords(&indexed, false));
        let bevys: Vec<_> = indexed.triangles().expect("it has indices").map(|triangle| triangle.vertices).collect();
        assert_eq!(corners(&indexed), Some(bevys));
        assert_eq!(corners(&Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::all())), None);
    }

    #[test]
    fn a_strip_has_the_triangles_of_bevy() {
        let places: Vec<[f32; 3]> = (0..6).map(|i| [i as f32, (i * i) as f32, 1.0]).collect();
        let strip = Mesh::new(PrimitiveTopology::TriangleStrip, RenderAssetUsages::all())
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, places)
            .with_inserted_indices(Indices::U16(vec![0, 1, 2, 3, u16::MAX, 3, 4, 5]));
        let bevys: Vec<_> = strip.triangles().expect("it has indices").map(|triangle| triangle.vertices).collect();
        assert_eq!(corners(&strip), Some(bevys));
    }

    #[test]
    fn first_texture_coordinates_stand_in_for_second_ones() {
        let mesh = Mesh::from(Cuboid::new(1.0, 1.0, 1.0));
        assert_eq!(tex_coords(&mesh, true), tex_coords(&mesh, false));
        let mesh = mesh.with_inserted_attribute(Mesh::ATTRIBUTE_UV_1, vec![[0.5, 0.25]; 24]);
        assert_eq!(tex_coords(&mesh, true), Some(vec![[Vec2::new(0.5, 0.25); 3]; 12]));
        let mesh = mesh.with_removed_attribute(Mesh::ATTRIBUTE_UV_0).with_removed_attribute(Mesh::ATTRIBUTE_UV_1);
        assert!(!has_tex_coords(&mesh, true));
    }
}
