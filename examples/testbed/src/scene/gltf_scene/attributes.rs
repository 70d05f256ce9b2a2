//! The colours and normals of vertices.

use girandole::glam::{Vec3, Vec4};
use girandole_assets::AssetError;
use girandole_assets::gltf::gltf::accessor::Dimensions;
use girandole_assets::gltf::gltf::{Primitive, Semantic};
use girandole_assets::gltf::primitive_attribute;

use super::notes::Notes;

/// A vector for each corner of each triangle of a primitive.
type Attribute = Vec<[Vec4; 3]>;
/// The index of a mesh, a primitive of it, and the buffers of the file.
pub type Source<'a> = (usize, &'a Primitive<'a>, &'a [Vec<u8>]);

/// Reads an attribute of `N` components; `None` if the primitive does not have it.
fn read<const N: usize>(
    (mesh, primitive, buffers): Source<'_>,
    semantic: &Semantic,
    mut convert: impl FnMut([f32; N]) -> Vec4,
) -> Result<Option<Attribute>, AssetError> {
    let found = primitive_attribute::<N>(mesh, primitive, semantic, buffers)?;
    Ok(found.map(|triangles| triangles.into_iter().map(|corners| corners.map(&mut convert)).collect()))
}

/// The linear colours and alphas of `COLOR_0`, from 0 to 1.
pub fn colors(source: Source<'_>, notes: &mut Notes) -> Result<Option<Attribute>, AssetError> {
    let mut clamped = |color: Vec4| {
        let inside = color.max(Vec4::ZERO).min(Vec4::ONE);
        notes.add(inside != color, "colours of vertices outside of 0 to 1 are clamped");
        inside
    };
    let semantic = Semantic::Colors(0);
    match source.1.get(&semantic).map(|accessor| accessor.dimensions()) {
        Some(Dimensions::Vec4) => read::<4>(source, &semantic, |color| clamped(color.into())),
        _ => read::<3>(source, &semantic, |color| clamped(Vec3::from(color).extend(1.0))),
    }
}

/// The unit normals; zero for triangles with a normal that has no direction.
pub fn normals(source: Source<'_>, notes: &mut Notes) -> Result<Option<Attribute>, AssetError> {
    let unit = |normal| Vec3::from(normal).normalize_or_zero().extend(0.0);
    let mut normals = read::<3>(source, &Semantic::Normals, unit)?;
    for corners in normals.iter_mut().flatten().filter(|corners| corners.contains(&Vec4::ZERO)) {
        notes.add(true, "normals without a direction are not used");
        *corners = [Vec4::ZERO; 3];
    }
    Ok(normals)
}
