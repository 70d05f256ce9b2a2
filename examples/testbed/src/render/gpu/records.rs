//! The uniform and the records that `render.wgsl` reads.

use super::geometry::{Geometry, PlacedObject};
use super::image::first_half;
use super::scene::texture::{Texture, Wrap};
use super::scene::{Alpha, Material, Scene};
use super::sequence::{block_bits, tile_bits};
use super::shading::View;
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
    pub first_attribute: u32,
    pub first_half: u32,
    /// 1 if samples are spread over the pixel and over lights, 0 if all pass through its middle and take
    /// the same points on lights.
    pub is_spread: u32,
    /// The radiance that shows as white, in nits.
    pub white: f32,
    /// The draws that a kept light stands for, at most; 0 if the last frame has kept none.
    pub kept_draws: f32,
    /// The first of the records of pixels that this frame keeps, and of those of the last one.
    pub kept_first: u32,
    pub kept_first_then: u32,
    pub glow: Vec3,
    pub padding_after_glow: u32,
    pub sun: Vec3,
    pub padding_after_sun: u32,
    pub eye_then: Vec3,
    pub padding_after_eye: u32,
    pub right_then: Vec3,
    pub padding_after_right: u32,
    pub up_then: Vec3,
    pub padding_after_up: u32,
    pub forward_then: Vec3,
    /// The scene of the last frame.
    pub top_root_then: u32,
    pub occluder_min_then: Vec3,
    pub top_first_then: u32,
    pub occluder_max_then: Vec3,
    pub first_object_then: u32,
}

/// What a picture is made with.
#[derive(Clone, Copy, Debug)]
pub struct PictureOptions {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Samples per pixel, for which random numbers are evenly distributed.
    pub spp: u32,
    /// Candidates of which each sample keeps one.
    pub candidates: u32,
    /// Of the random numbers.
    pub seed: u32,
}

impl FrameUniform {
    /// The uniform of a picture, without samples and rows, and without a frame before. `first_object` is the number of records that
    /// precede those of the objects.
    pub fn new(scene: &Scene, geometry: &Geometry, first_object: u32, options: &PictureOptions) -> Self {
        let PictureOptions { size: [width, height], spp, candidates, seed } = *options;
        let view = View::new(&scene.camera, width, height);
        let block_bits = block_bits(spp);
        Self {
            eye: view.eye,
            width,
            right: view.right,
            height,
            up: view.up,
            seed,
            forward: view.forward,
            lamp_clearance: scene.lamp_clearance,
            zenith: scene.sky.zenith,
            top_root: geometry.top.root,
            horizon: scene.sky.horizon,
            first_object,
            ambient: scene.sky.ambient,
            candidates,
            occluder_min: geometry.occluders.min,
            block_bits,
            occluder_max: geometry.occluders.max,
            tile_bits: tile_bits(block_bits),
            haze: scene.sky.haze,
            first_attribute: geometry.triangles.len() as u32,
            first_half: first_half(spp),
            is_spread: 1,
            white: 1.0 / scene.exposure,
            glow: scene.sky.glow,
            sun: scene.sky.sun,
            ..Self::zeroed()
        }
    }
}

/// A material, a texture or an object. `Record` in `render.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub struct Record {
    pub rows: [Vec4; 3],
    pub words: [u32; 4],
}

// Flags of materials and textures. The constants of `textures.wgsl`.
const TWO_SIDED: u32 = 1;
const MASK: u32 = 2;
const BLEND: u32 = 4;
const NEAREST: u32 = 16;
const SRGB: u32 = 32;
const SECOND_COORDINATES: u32 = 64;

impl Record {
    /// The record of a material. The record of texture n is `first_texture` + n.
    pub fn of_material(material: &Material, first_texture: u32) -> Self {
        let (alpha, cutoff) = match material.alpha {
            Alpha::Opaque => (0, 0.0),
            Alpha::Mask(cutoff) => (MASK, cutoff),
            Alpha::Blend => (BLEND, 0.0),
        };
        let texture = |index: Option<u32>| index.map_or(0, |index| first_texture + index);
        Self {
            rows: [
                material.base_color.extend(material.roughness),
                material.emission.extend(material.metallic),
                Vec4::new(material.opacity, cutoff, if material.is_unlit { 1.0 } else { 0.0 }, 0.0),
            ],
            words: [
                if material.two_sided_emission { TWO_SIDED } else { 0 } | alpha,
                texture(material.base_color_texture),
                texture(material.emission_texture),
                texture(material.roughness_texture),
            ],
        }
    }

    /// The record of a texture, whose image begins at a texel.
    pub fn of_texture(texture: &Texture, first_texel: u32) -> Self {
        let Texture { pixels, coordinates, transform, wrap, is_nearest, is_srgb } = texture;
        let [wrap_x, wrap_y] = wrap.map(|wrap| match wrap {
            Wrap::Repeat => 0,
            Wrap::Mirror => 1,
            Wrap::Clamp => 2,
        });
        let flag = |is_set: bool, flag: u32| if is_set { flag } else { 0 };
        let flags = flag(*is_nearest, NEAREST) | flag(*is_srgb, SRGB) | flag(*coordinates != 0, SECOND_COORDINATES);
        let (linear, moved) = (transform.matrix2, transform.translation);
        Self {
            rows: [
                Vec4::new(linear.x_axis.x, linear.y_axis.x, moved.x, 0.0),
                Vec4::new(linear.x_axis.y, linear.y_axis.y, moved.y, 0.0),
                Vec4::ZERO,
            ],
            words: [first_texel, pixels.width | pixels.height << 16, flags | wrap_x | wrap_y << 2, 0],
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
    use super::super::pipeline::{LIGHT_GROUP, Needs, Work, shader_source};
    use super::*;
    use girandole::Effects;
    use girandole::plan::{ShaderParts, wgsl_with};
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
        let parts = ShaderParts::default().with_previous();
        let light = wgsl_with(LIGHT_GROUP, Effects::all(), &parts);
        let parse = |textures| {
            let source = shader_source(&light, Needs { stack_size: 32, textures, reuse: textures }, Work::Render);
            naga::front::wgsl::parse_str(&source).unwrap_or_else(|e| panic!("{e:?}"))
        };
        // A scene without textures has a shader of its own.
        parse(false);
        let module = parse(true);
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
            first_attribute,
            first_half,
            is_spread,
            white,
            kept_draws,
            kept_first,
            kept_first_then,
            glow,
            sun,
            eye_then,
            right_then,
            up_then,
            forward_then,
            top_root_then,
            occluder_min_then,
            top_first_then,
            occluder_max_then,
            first_object_then
        );
        same!("Node", Node, min0, child0, max0, padding0, min1, child1, max1, padding1);
        same!("Triangle", PackedTriangle, corner, material, edge1, flags, edge2, attributes);
        // The three rows of a record are one array in Rust.
        let (members, size) = layout(&module, "Record");
        assert_eq!((members[1].1, members[3].1, size), (16, offset_of!(Record, words), size_of::<Record>()));
    }
}
