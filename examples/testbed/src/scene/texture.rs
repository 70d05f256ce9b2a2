//! Images on surfaces.

use std::sync::Arc;

use girandole::glam::{Affine2, Vec2, Vec4, Vec4Swizzles};
pub use girandole_assets::texture::TextureWrap as Wrap;

/// Longest side of an image, pixels. The renderer packs a side into 16 bits, and larger images show
/// no more in pictures of usual sizes.
pub const MAX_IMAGE_SIDE: u32 = 2048;

/// A decoded image: rows from the top, each pixel red, green, blue and alpha.
#[derive(Debug)]
pub struct Pixels {
    /// Pixels in a row, from 1 to [`MAX_IMAGE_SIDE`].
    pub width: u32,
    /// Rows, from 1 to [`MAX_IMAGE_SIDE`].
    pub height: u32,
    /// `width` times `height` pixels.
    pub rgba: Vec<[u8; 4]>,
}

/// How a material uses an image. `texels.wgsl` has the same functions.
#[derive(Clone, Debug)]
pub struct Texture {
    /// The image, which other textures may share.
    pub pixels: Arc<Pixels>,
    /// Which of the two texture coordinates of a corner is used: 0 or 1.
    pub coordinates: u32,
    /// From texture coordinates to the unit square of the image, whose origin is the upper left
    /// corner.
    pub transform: Affine2,
    /// What lies beyond the sides, along x and along y.
    pub wrap: [Wrap; 2],
    /// Whether texels are squares of one colour. Otherwise colours are interpolated.
    pub is_nearest: bool,
    /// Whether red, green and blue are sRGB-encoded.
    pub is_srgb: bool,
}

/// The linear value of an sRGB-encoded one; both are from 0 to 1.
pub fn srgb_to_linear(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// The texel that shows at a place along an axis.
fn wrapped(place: i32, size: i32, wrap: Wrap) -> i32 {
    match wrap {
        Wrap::Repeat => place.rem_euclid(size),
        Wrap::Mirror => {
            let place = place.rem_euclid(2 * size);
            place.min(2 * size - 1 - place)
        }
        Wrap::Clamp => place.clamp(0, size - 1),
    }
}

impl Texture {
    /// The linear colour and the alpha at a point whose two texture coordinates are xy and zw.
    pub fn sample(&self, coordinates: Vec4) -> Vec4 {
        let size = Vec2::new(self.pixels.width as f32, self.pixels.height as f32);
        let coordinates = if self.coordinates == 0 { coordinates.xy() } else { coordinates.zw() };
        let place = self.transform.transform_point2(coordinates) * size;
        // Beyond this, places have no fractions and integers overflow.
        let place = place.clamp(Vec2::splat(-1e9), Vec2::splat(1e9));
        if self.is_nearest {
            return self.texel(place.x.floor() as i32, place.y.floor() as i32);
        }
        let (low, share) = ((place - 0.5).floor(), place - 0.5 - (place - 0.5).floor());
        let (x, y) = (low.x as i32, low.y as i32);
        let above = self.texel(x, y).lerp(self.texel(x + 1, y), share.x);
        let below = self.texel(x, y + 1).lerp(self.texel(x + 1, y + 1), share.x);
        above.lerp(below, share.y)
    }

    /// A texel of the image or of what lies beyond its sides.
    fn texel(&self, x: i32, y: i32) -> Vec4 {
        let Pixels { width, height, rgba } = &*self.pixels;
        let x = wrapped(x, *width as i32, self.wrap[0]) as usize;
        let y = wrapped(y, *height as i32, self.wrap[1]) as usize;
        let texel = Vec4::from(rgba[y * *width as usize + x].map(f32::from)) / 255.0;
        if self.is_srgb { texel.truncate().map(srgb_to_linear).extend(texel.w) } else { texel }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texels_are_interpolated_and_wrapped() {
        let pixels = Pixels { width: 2, height: 1, rgba: vec![[0, 0, 0, 255], [255, 255, 255, 0]] };
        let mut texture = Texture {
            pixels: Arc::new(pixels),
            coordinates: 1,
            transform: Affine2::IDENTITY,
            wrap: [Wrap::Repeat; 2],
            is_nearest: false,
            is_srgb: true,
        };
        let at = |texture: &Texture, x: f32| texture.sample(Vec4::new(f32::NAN, f32::NAN, x, 0.3));
        assert_eq!(at(&texture, 0.25), Vec4::new(0.0, 0.0, 0.0, 1.0));
        assert_eq!(at(&texture, 0.5), Vec4::new(0.5, 0.5, 0.5, 0.5));
        assert_eq!(at(&texture, 1.0).x, 0.5);
        texture.wrap[0] = Wrap::Clamp;
        assert_eq!([at(&texture, -3.0).x, at(&texture, 1.0).x], [0.0, 1.0]);
        texture.wrap[0] = Wrap::Mirror;
        assert_eq!([at(&texture, 1.25).x, at(&texture, 1.75).x], [1.0, 0.0]);
        texture.is_nearest = true;
        assert_eq!([at(&texture, 0.49).x, at(&texture, 0.51).x, at(&texture, 1e30).x], [0.0, 1.0, 0.0]);
    }
}
