//! Textures as glTF describes them: an image, the coordinates that select its texels, and what lies
//! beyond its sides.

use ::gltf::texture::{Info, MagFilter, WrappingMode};
use glam::{Affine2, Mat2, Vec2};

use crate::error::{AssetError, invalid};
use crate::texture::TextureWrap;

/// A decoded image: rows from the top, four bytes for each pixel.
///
/// The bytes are red, green, blue and alpha as the file stores them. Emissive textures are
/// sRGB-encoded; [`load_lights`](super::load_lights) converts them to linear values when it averages emission.
#[derive(Clone, Copy, Debug)]
pub struct TextureImage<'a> {
    /// Pixels in a row, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
    /// Red, green, blue and alpha of each pixel: 4 times `width` times `height` bytes.
    pub rgba: &'a [u8],
}

impl TextureImage<'_> {
    /// Checks the number of bytes. `image` is the index that an error names.
    pub(super) fn check(&self, image: usize) -> Result<(), AssetError> {
        let expected = 4 * u128::from(self.width) * u128::from(self.height);
        if expected > 0 && self.rgba.len() as u128 == expected {
            return Ok(());
        }
        let (bytes, width, height) = (self.rgba.len(), self.width, self.height);
        Err(invalid(format!("image {image}: {bytes} bytes are not the pixels of {width} x {height} pixels")))
    }
}

impl From<WrappingMode> for TextureWrap {
    fn from(mode: WrappingMode) -> Self {
        match mode {
            WrappingMode::Repeat => Self::Repeat,
            WrappingMode::MirroredRepeat => Self::Mirror,
            WrappingMode::ClampToEdge => Self::Clamp,
        }
    }
}

/// How a material uses an image: [`TextureUse::of`] reads it from the document.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct TextureUse {
    /// Index of the image.
    pub image: usize,
    /// The set of texture coordinates: n for the attribute `TEXCOORD_n`.
    pub tex_coord: u32,
    /// From the coordinates of a vertex to those of the image, of which (0, 0) is the upper left
    /// corner and (1, 1) the lower right one: KHR_texture_transform.
    pub transform: Affine2,
    /// What lies beyond the sides, along x and along y.
    pub wrap: [TextureWrap; 2],
    /// Whether magnified texels are squares of one colour. Otherwise colours are interpolated.
    pub is_nearest: bool,
}

impl TextureUse {
    /// Reads how a material uses a texture, with KHR_texture_transform.
    ///
    /// A positive rotation turns coordinates counter-clockwise as seen on the image, whose y axis
    /// points down.
    pub fn of(info: &Info<'_>) -> Self {
        let texture = info.texture();
        let sampler = texture.sampler();
        let (mut tex_coord, mut transform) = (info.tex_coord(), Affine2::IDENTITY);
        if let Some(moved) = info.texture_transform() {
            tex_coord = moved.tex_coord().unwrap_or(tex_coord);
            let rotation = Mat2::from_angle(-moved.rotation());
            let linear = rotation * Mat2::from_diagonal(Vec2::from(moved.scale()));
            transform = Affine2::from_mat2_translation(linear, moved.offset().into());
        }
        Self {
            image: texture.source().index(),
            tex_coord,
            transform,
            wrap: [sampler.wrap_s(), sampler.wrap_t()].map(TextureWrap::from),
            is_nearest: sampler.mag_filter() == Some(MagFilter::Nearest),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::options::GltfOptions;
    use super::super::parse::parse;
    use super::*;

    fn texture_use(info: &str) -> TextureUse {
        let text = format!(
            "{{\"asset\":{{\"version\":\"2.0\"}},\"images\":[{{\"uri\":\"a.png\"}},{{\"uri\":\"b.png\"}}],\
             \"samplers\":[{{\"wrapS\":33071,\"wrapT\":33648,\"magFilter\":9728}}],\
             \"textures\":[{{\"source\":1,\"sampler\":0}},{{\"source\":0}}],\
             \"materials\":[{{\"emissiveTexture\":{info}}}]}}"
        );
        let file = parse(text.as_bytes(), &GltfOptions::default()).unwrap();
        let material = file.document.materials().next().unwrap();
        TextureUse::of(&material.emissive_texture().unwrap())
    }

    #[test]
    fn the_sampler_and_the_set_of_coordinates_are_read() {
        let textured = texture_use("{\"index\":0,\"texCoord\":2}");
        assert_eq!((textured.image, textured.tex_coord, textured.is_nearest), (1, 2, true));
        assert_eq!(textured.wrap, [TextureWrap::Clamp, TextureWrap::Mirror]);
        let plain = texture_use("{\"index\":1}");
        assert_eq!((plain.image, plain.tex_coord, plain.is_nearest), (0, 0, false));
        assert_eq!((plain.wrap, plain.transform), ([TextureWrap::Repeat; 2], Affine2::IDENTITY));
    }

    #[test]
    fn a_transform_scales_then_turns_counter_clockwise_then_moves() {
        let transform = "{\"offset\":[0.5,0.25],\"rotation\":1.5707964,\"scale\":[2,3],\"texCoord\":1}";
        let textured =
            texture_use(&format!("{{\"index\":0,\"extensions\":{{\"KHR_texture_transform\":{transform}}}}}"));
        assert_eq!(textured.tex_coord, 1);
        // The y axis points down, so a quarter turn takes +x to -y and +y to +x.
        let moved = |x, y| textured.transform.transform_point2(Vec2::new(x, y));
        assert!(moved(1.0, 0.0).abs_diff_eq(Vec2::new(0.5, -1.75), 1e-5), "{}", moved(1.0, 0.0));
        assert!(moved(0.0, 1.0).abs_diff_eq(Vec2::new(3.5, 0.25), 1e-5), "{}", moved(0.0, 1.0));
    }
}
