//! The uniform and the records that `render.wgsl` reads.

use super::geometry::PlacedObject;
use super::scene::Material;
use bytemuck::{Pod, Zeroable};
use girandole::glam::{Vec3, Vec4};

/// What a dispatch needs to know. `Frame` in `render.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub struct FrameUniform {
    pub eye: Vec3,
    pub width: u32,
    pub right: Vec3,
    pub height: u32,
    pub up: Vec3,
    pub seed: u32,
    pub forward: Vec3,
    pub lamp_clearance: f32,
    pub zenith: Vec3,
    pub top_root: u32,
    pub horizon: Vec3,
    pub first_object: u32,
    pub ambient: Vec3,
    pub candidates: u32,
    pub occluder_min: Vec3,
    pub block_bits: u32,
    pub occluder_max: Vec3,
    pub tile_bits: u32,
    pub sample_begin: u32,
    pub sample_end: u32,
    pub row_begin: u32,
    pub row_end: u32,
    pub haze: f32,
    pub padding_a: u32,
    pub padding_b: u32,
    pub padding_c: u32,
}

/// A material or an object. `Record` in `render.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub struct Record {
    pub rows: [Vec4; 3],
    pub words: [u32; 4],
}

impl Record {
    /// The record of a material.
    pub fn of_material(material: &Material) -> Self {
        Self {
            rows: [
                material.base_color.extend(material.roughness),
                material.emission.extend(material.metallic),
                Vec4::ZERO,
            ],
            words: [u32::from(material.two_sided_emission), 0, 0, 0],
        }
    }

    /// The record of an object.
    pub fn of_object(object: &PlacedObject) -> Self {
        let matrix = object.inverse.matrix3.transpose();
        let translation = object.inverse.translation;
        let row = |axis: Vec3, w: f32| axis.extend(w);
        Self {
            rows: [
                row(matrix.x_axis.into(), translation.x),
                row(matrix.y_axis.into(), translation.y),
                row(matrix.z_axis.into(), translation.z),
            ],
            words: [object.root, object.emission_scale.to_bits(), 0, 0],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::nodes::Node;
    use super::super::geometry::PackedTriangle;
    use super::super::pipeline::{LIGHT_GROUP, TARGET, TARGET_ARGUMENT, shader_source};
    use super::*;
    use girandole::Effects;
    use girandole::plan::{TargetHook, wgsl_with_target};
    use std::mem::offset_of;

    /// The members of a struct with their offsets, and its size.
    fn layout(module: &naga::Module, name: &str) -> (Vec<(String, usize)>, usize) {
        let ty = module.types.iter().map(|(_, ty)| ty).find(|ty| ty.name.as_deref() == Some(name));
        let Some(naga::TypeInner::Struct { members, span }) = ty.map(|ty| &ty.inner) else {
            panic!("no struct {name}")
        };
        let named = members.iter().map(|m| (m.name.clone().unwrap_or_default(), m.offset as usize));
        (named.collect(), *span as usize)
    }

    #[test]
    fn structs_have_the_same_layout_in_rust_and_wgsl() {
        let target = TargetHook::new(TARGET, TARGET_ARGUMENT).expect("identifiers");
        let source = shader_source(&wgsl_with_target(LIGHT_GROUP, Effects::all(), &target), false, 32);
        let module = naga::front::wgsl::parse_str(&source).unwrap_or_else(|e| panic!("{e:?}"));
        macro_rules! same {
            ($name:literal, $ty:ty, $($field:ident),+) => {
                let expected = vec![$((stringify!($field).to_owned(), offset_of!($ty, $field))),+];
                assert_eq!(layout(&module, $name), (expected, size_of::<$ty>()), $name);
            };
        }
        same!(
            "Frame",
            FrameUniform,
            eye,
            width,
            right,
            height,
            up,
            seed,
            forward,
            lamp_clearance,
            zenith,
            top_root,
            horizon,
            first_object,
            ambient,
            candidates,
            occluder_min,
            block_bits,
            occluder_max,
            tile_bits,
            sample_begin,
            sample_end,
            row_begin,
            row_end,
            haze,
            padding_a,
            padding_b,
            padding_c
        );
        same!("Node", Node, min0, child0, max0, padding0, min1, child1, max1, padding1);
        same!("Triangle", PackedTriangle, corner, material, edge1, flags, edge2, padding);
        // The three rows of a record are one array in Rust.
        let (members, size) = layout(&module, "Record");
        assert_eq!((members[1].1, members[3].1, size), (16, offset_of!(Record, words), size_of::<Record>()));
    }
}
