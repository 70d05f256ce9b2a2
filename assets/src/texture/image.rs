//! Images that surfaces emit, and copies of them that are reduced on demand.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::LazyLock;

use girandole::Light;
use girandole::light::{MAX_EMISSION, luminance};
use glam::{DVec2, DVec4, Vec2, Vec3, Vec4};

use super::cells::{Axis, TextureWrap, average_over, average_within};
use super::surface::TexturedSurface;
use crate::error::{AssetError, invalid};

/// The largest width and height of an image.
pub(crate) const MAX_SIZE: usize = 1 << 15;
/// Most texels that a surface is averaged over along each axis.
const MAX_CELLS: f64 = 128.0;
/// Texels of reduced images that are kept for later surfaces, 16 bytes each.
const MAX_HELD: usize = 1 << 25;

/// The linear value of each byte that is sRGB-encoded.
pub(crate) static LINEAR: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|byte| srgb_to_linear(byte as f32 / 255.0)));

/// An image that surfaces emit: the texture of a sign, or a frame of a film on a screen.
///
/// Each texel is a square of one colour. A [`TexturedSurface`] says where on an image its corners are;
/// [`Texture::light`] makes a light of it, which emits the average of its texels, and [`Texture::split`] cuts surfaces
/// into parts so that little is lost by that.
///
/// ```
/// use girandole::glam::Vec3;
/// use girandole::LightTree;
/// use girandole_assets::texture::{Texture, TexturedSurface};
///
/// // A sign of 64 x 64 texels with a bright bar, which is a tenth of it.
/// let is_bar = |texel: usize| (20..26).contains(&(texel / 64));
/// let texels: Vec<Vec3> = (0..64 * 64).map(|texel| Vec3::splat(f32::from(u8::from(is_bar(texel))))).collect();
/// let mut texture = Texture::linear(64, &texels)?;
///
/// let sign = TexturedSurface::rectangle(Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::splat(800.0));
/// assert!((texture.light(&sign).emission.x - 75.0).abs() < 1e-3);
/// let parts = texture.split(&[sign], 0.1, 64);
/// let tree = LightTree::new(parts.iter().map(|part| texture.light(part)).collect())?;
/// assert!((tree.cluster().flux / texture.light(&sign).flux() - 1.0).abs() < 1e-5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Texture<'a> {
    texels: Texels<'a>,
    size: [usize; 2],
    wrap: [TextureWrap; 2],
    /// Reduced images, by the exponents of their reductions along both axes.
    reduced: BTreeMap<[u32; 2], Reduced>,
    /// Texels of all reduced images.
    held: usize,
}

enum Texels<'a> {
    /// Red, green and blue that are sRGB-encoded, and alpha.
    Srgb(Cow<'a, [u8]>),
    Linear(Cow<'a, [Vec3]>),
}

/// A reduced image: mean colours, and the mean square of their luminance.
struct Reduced {
    size: [usize; 2],
    texels: Vec<Vec4>,
}

/// The linear value of an sRGB-encoded one; both are from 0 to 1.
fn srgb_to_linear(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

impl<'a> Texture<'a> {
    /// Makes a texture of linear colours, Rec. 709, in rows of `width` from the top. It repeats beyond its sides.
    ///
    /// O(texels).
    ///
    /// # Errors
    /// [`AssetError::Invalid`] if there are no whole rows, none at all, or more than 32,768 rows or columns, and for a
    /// texel that is negative, not finite or above [`MAX_EMISSION`].
    pub fn linear(width: usize, texels: impl Into<Cow<'a, [Vec3]>>) -> Result<Self, AssetError> {
        let texels = texels.into();
        let is_sound = |texel: &Vec3| texel.to_array().iter().all(|value| (0.0..=MAX_EMISSION).contains(value));
        if let Some(texel) = texels.iter().position(|texel| !is_sound(texel)) {
            let value = texels[texel];
            return Err(invalid(format!("texel {texel} is {value}; each channel must be from 0 to {MAX_EMISSION}")));
        }
        Self::new(width, texels.len(), Texels::Linear(texels))
    }

    /// Makes a texture of four bytes a texel, in rows of `width` from the top: red, green and blue, which are
    /// sRGB-encoded, and alpha, which is not regarded. What is cut out has to be black. It repeats beyond its sides.
    ///
    /// # Errors
    /// [`AssetError::Invalid`] for such rows as [`Texture::linear`] refuses.
    pub fn srgb(width: usize, rgba: impl Into<Cow<'a, [u8]>>) -> Result<Self, AssetError> {
        let rgba = rgba.into();
        let texels = if rgba.len() % 4 == 0 { rgba.len() / 4 } else { 0 };
        Self::new(width, texels, Texels::Srgb(rgba))
    }

    fn new(width: usize, count: usize, texels: Texels<'a>) -> Result<Self, AssetError> {
        let size = [width, count.checked_div(width).unwrap_or(0)];
        if !size.iter().all(|side| (1..=MAX_SIZE).contains(side)) || size[0] * size[1] != count {
            return Err(invalid(format!(
                "{count} texels are not 1 to {MAX_SIZE} whole rows of {width}, which must be 1 to {MAX_SIZE}"
            )));
        }
        Ok(Self { texels, size, wrap: [TextureWrap::Repeat; 2], reduced: BTreeMap::new(), held: 0 })
    }

    /// The same texture with what it shows beyond its sides, along rows and along columns.
    #[must_use]
    pub fn with_wrap(self, wrap: [TextureWrap; 2]) -> Self {
        Self { wrap, ..self }
    }

    /// Columns and rows.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// The colour at texture coordinates, of which (0, 0) is the upper left corner of the image and (1, 1) the lower
    /// right one.
    pub fn color(&self, at: Vec2) -> Vec3 {
        let axes = [0, 1].map(|k| self.axis(k, self.size[k]));
        let texel = |k: usize| axes[k].texel(axes[k].cell(f64::from(at[k]) * self.size[k] as f64));
        let [x, y] = [0, 1].map(texel);
        self.texel(x, y).truncate()
    }

    /// A light that emits the average of the texels of a surface.
    ///
    /// The average is exact for surfaces of up to 128 texels along each axis. Longer ones are averaged over a copy of
    /// the image that is reduced along that axis, so that the average over the whole image stays exact.
    ///
    /// # Cost
    /// O(texels) of the surface: a few nanoseconds each for rectangles along the axes of the image, and some tens of
    /// them for triangles. Reduced copies take a pass over the image each, up to 24 bytes for each of its texels while they are
    /// made, and up to 0.5 GB together.
    pub fn light(&mut self, surface: &TexturedSurface) -> Light {
        surface.light(self.average(surface).truncate().as_vec3())
    }

    /// The mean of the colours over a surface, and of the squares of their luminance.
    pub(super) fn average(&mut self, surface: &TexturedSurface) -> DVec4 {
        let [a, b, c] = surface.tex_coords;
        let d = b + c - a;
        let is_parallelogram = surface.is_parallelogram();
        let levels = [0, 1].map(|k| {
            let ends = [a, b, c, if is_parallelogram { d } else { a }].map(|corner| corner[k] * self.size[k] as f64);
            reduction(ends, self.size[k], self.wrap[k])
        });
        if levels != [0, 0] && !self.reduced.contains_key(&levels) {
            self.reduce(levels);
        }
        let reduced = self.reduced.get(&levels);
        let size = reduced.map_or(self.size, |reduced| reduced.size);
        let axes = [0, 1].map(|k| self.axis(k, size[k]));
        let texel = |x: usize, y: usize| match reduced {
            None => self.texel(x, y),
            Some(reduced) => reduced.texels[y * size[0] + x],
        };
        let [a, b, c, d] = [a, b, c, d].map(|corner| corner * DVec2::new(size[0] as f64, size[1] as f64));
        let is_along_axes = (a.x == b.x && a.y == c.y) || (a.y == b.y && a.x == c.x);
        if !is_parallelogram {
            average_over([a, b, c], &axes, texel)
        } else if is_along_axes {
            average_within([a, d], &axes, texel)
        } else {
            0.5 * (average_over([a, b, c], &axes, texel) + average_over([d, b, c], &axes, texel))
        }
    }

    fn axis(&self, axis: usize, size: usize) -> Axis {
        Axis { size, wrap: self.wrap[axis] }
    }

    /// A colour and the square of its luminance.
    fn texel(&self, x: usize, y: usize) -> Vec4 {
        let texel = y * self.size[0] + x;
        let color = match &self.texels {
            Texels::Srgb(rgba) => {
                let bytes = &rgba[4 * texel..4 * texel + 3];
                Vec3::new(LINEAR[bytes[0] as usize], LINEAR[bytes[1] as usize], LINEAR[bytes[2] as usize])
            }
            Texels::Linear(texels) => texels[texel],
        };
        color.extend(luminance(color).powi(2))
    }

    /// Makes the image that is reduced by powers of two along its axes.
    fn reduce(&mut self, levels: [u32; 2]) {
        let size = [0, 1].map(|axis| self.size[axis].div_ceil(1 << levels[axis]));
        let texels = shrink(self.size, size, |x, y| self.texel(x, y));
        if self.held + texels.len() > MAX_HELD {
            self.reduced.clear();
            self.held = 0;
        }
        self.held += texels.len();
        self.reduced.insert(levels, Reduced { size, texels });
    }
}

impl fmt::Debug for Texture<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Texture").field("size", &self.size).field("wrap", &self.wrap).finish_non_exhaustive()
    }
}

/// The texels of an image that is reduced to a size.
fn shrink(full: [usize; 2], size: [usize; 2], texel: impl Fn(usize, usize) -> Vec4) -> Vec<Vec4> {
    let [columns, rows] = [0, 1].map(|axis| shares(full[axis], size[axis]));
    let mut sums = vec![DVec4::ZERO; size[0] * size[1]];
    for (y, rows) in rows.iter().enumerate() {
        for (x, columns) in columns.iter().enumerate() {
            let color = texel(x, y).as_dvec4();
            for (row, share) in rows.iter().filter(|(_, share)| *share > 0.0) {
                let color = color * *share;
                columns.iter().for_each(|(column, share)| sums[row * size[0] + column] += color * *share);
            }
        }
    }
    sums.into_iter().map(|sum| sum.as_vec4()).collect()
}

/// For each texel along an axis, the one or two reduced texels that it overlaps, and its share of
/// each.
fn shares(full: usize, size: usize) -> Vec<[(usize, f64); 2]> {
    let scale = size as f64 / full as f64;
    let share = |texel: usize| {
        let (begin, end) = (texel as f64 * scale, (texel + 1) as f64 * scale);
        let first = (begin as usize).min(size - 1);
        let cut = (first + 1) as f64;
        if end <= cut || first + 1 == size {
            return [(first, scale), (first, 0.0)];
        }
        [(first, cut - begin), (first + 1, end - cut)]
    };
    (0..full).map(share).collect()
}

/// The exponent of the power of two by which an image is reduced along an axis. `ends` holds the
/// coordinates of a surface's corners along this axis, in texels.
fn reduction(ends: [f64; 4], size: usize, wrap: TextureWrap) -> u32 {
    let limit = size as f64;
    let ends = if wrap == TextureWrap::Clamp { ends.map(|end| end.clamp(0.0, limit)) } else { ends };
    let extent = ends.into_iter().fold(f64::MIN, f64::max) - ends.into_iter().fold(f64::MAX, f64::min);
    let last = usize::BITS - (size - 1).leading_zeros();
    let cells = |level: u32| extent * (size.div_ceil(1 << level)) as f64 / limit;
    (0..last).find(|level| cells(*level) <= MAX_CELLS).unwrap_or(last)
}

#[cfg(test)]
mod tests;
