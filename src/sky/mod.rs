//! The sky: an environment map whose light is chosen among that of all lamps.
//!
//! The map is cut into [`PATCHES`] at most, finer where it is bright, and these are the lights of an ordinary
//! tree. They stand at a distance of 1 from every shading point: an instance of such a tree is a second
//! root beside the top level (`sampling/cut.rs`). So patches are chosen as lamps are, by all that arrives. Within
//! a patch a texel is chosen by its brightness, in the sums of `levels.rs`.

mod levels;
mod octahedral;
mod patches;
mod resampled;
#[cfg(feature = "gpu-plan")]
mod stored;

use std::f32::consts::PI;
use std::fmt;

use glam::Vec3;

use crate::error::SkyError;
use crate::light::{Light, MAX_EMISSION};
use crate::math::parallel::map_chunks;
use levels::{Levels, in_order};
use patches::{Known, Patch};
use resampled::resampled;
#[cfg(feature = "gpu-plan")]
pub(crate) use stored::{SKY_LEVELS, StoredPatch};

/// Stands for the distance to the sky in metres where a number is needed: beyond all lamps.
pub(crate) const SKY_DIST: f32 = (1 << 20) as f32;

/// The largest width and height of a map.
pub(crate) const MAX_SIZE: usize = 1 << 15;

/// Pixels that a thread checks at a time.
const PIXELS_OF_A_TASK: usize = 1 << 14;

/// An environment map: the radiance that arrives from each direction of the sky.
///
/// [`LightWorld::set_sky`](crate::LightWorld::set_sky) makes it a light of a world. The map is equirectangular, as
/// most files of the kind are: rows run from the zenith (+Y) to the nadir, and columns around it. The direction of
/// column `x` and row `y`, counted from 0 and in fractions, is
///
/// ```text
/// theta = pi * y / height,  phi = 2 * pi * (x / width - 1/2)
/// direction = (sin(theta) * cos(phi), cos(theta), sin(theta) * sin(phi))
/// ```
///
/// so that the middle of the map is at +X, as in three.js. The placement of its instance turns it. Each pixel has
/// the same radiance everywhere: it is not interpolated. It is stored with nine bits for each channel,
/// relative to the brightest one, down to 2⁻³³ of the brightest pixel.
///
/// ```
/// use girandole::glam::Vec3;
/// use girandole::Sky;
///
/// // A sun of one pixel, 30 degrees above the horizon.
/// let mut pixels = vec![Vec3::splat(500.0); 64 * 32];
/// pixels[10 * 64 + 32] = Vec3::splat(1.0e6);
/// let sky = Sky::equirectangular(64, &pixels)?;
/// assert_eq!(sky.size(), [64, 32]);
/// assert!(sky.radiance(Vec3::new(3.0_f32.sqrt(), 1.0, 0.1)).x > 9.9e5);
/// # Ok::<(), girandole::SkyError>(())
/// ```
#[derive(Clone)]
pub struct Sky {
    levels: Levels,
    /// In the order of their texels in space.
    patches: Vec<Patch>,
    /// What the patches were chosen among.
    known: Known,
}

/// A point of the sky that was chosen: in the space of the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SkyPoint {
    /// A unit vector.
    pub direction: Vec3,
    /// In nits.
    pub radiance: Vec3,
    /// The density per steradian within the patch.
    pub pdf: f32,
}

impl Sky {
    /// Makes a sky of rows of `width` pixels: radiances in nits, linear Rec. 709, from the zenith down.
    ///
    /// O(pixels). It takes 4.3 bytes a pixel.
    ///
    /// # Errors
    /// [`SkyError::Size`] if there are no whole rows, none at all, or more than 32,768 rows or columns;
    /// [`SkyError::Pixel`] for a pixel that is negative, not finite or above
    /// [`MAX_EMISSION`](crate::light::MAX_EMISSION).
    pub fn equirectangular(width: usize, pixels: &[Vec3]) -> Result<Self, SkyError> {
        let height = pixels.len().checked_div(width).unwrap_or(0);
        let is_sound = (1..=MAX_SIZE).contains(&width) && (1..=MAX_SIZE).contains(&height);
        if !is_sound || width * height != pixels.len() {
            return Err(SkyError::Size { width, pixels: pixels.len(), max: MAX_SIZE });
        }
        let levels = Levels::new([width, height], pixels, greatest(pixels)?);
        let mut known = Known::new();
        Ok(Self { patches: patches::cut(&levels, &mut known), levels, known })
    }

    /// Makes a sky of `width` columns and half as many rows from a function: the radiance in nits that arrives from
    /// a unit vector, which is taken at the middle of each pixel.
    ///
    /// O(pixels).
    ///
    /// # Errors
    /// As for [`Sky::equirectangular`].
    ///
    /// ```
    /// use girandole::{Sky, glam::Vec3};
    /// let sky = Sky::from_fn(256, |direction| Vec3::new(60.0, 90.0, 160.0) * direction.y.max(0.0))?;
    /// assert_eq!(sky.size(), [256, 128]);
    /// assert!(sky.radiance(Vec3::Y).z > 159.0);
    /// # Ok::<(), girandole::SkyError>(())
    /// ```
    pub fn from_fn(width: usize, radiance: impl Fn(Vec3) -> Vec3) -> Result<Self, SkyError> {
        let height = width / 2;
        let rows = 0..if (1..=MAX_SIZE).contains(&width) { height } else { 0 };
        let middle = |x: usize, y: usize| levels::direction([width, height], [x as f32 + 0.5, y as f32 + 0.5]);
        let pixels = rows.flat_map(|y| (0..width).map(move |x| (x, y)));
        Self::equirectangular(width, &pixels.map(|(x, y)| radiance(middle(x, y))).collect::<Vec<_>>())
    }

    /// Makes a sky of a square map in the octahedral parametrisation: rows of `width` pixels, as many rows, in nits.
    ///
    /// The sphere is projected to an octahedron, which is unfolded: +Y is the middle of the map, the horizon is the
    /// square between the middles of its sides, and -Y is all four corners. +X is to the right, and +Z down. The
    /// pixel of a direction, in fractions, is
    ///
    /// ```text
    /// (x, y, z) = direction / (|direction.x| + |direction.y| + |direction.z|)
    /// (u, v) = (x, z)                                      if y >= 0
    ///          ((1 - |z|) * sign(x), (1 - |x|) * sign(z))  otherwise
    /// column = width * (u + 1) / 2,  row = width * (v + 1) / 2
    /// ```
    ///
    /// Other files differ in which axis is in the middle, which a placement mends. The equal-area map of pbrt is
    /// another one, for which [`Sky::from_fn`] is there.
    ///
    /// The sky stores an equirectangular map of `2 * width` columns and `width` rows. Each of its texels is the mean of
    /// 8 x 8 points, weighed by solid angle. That keeps the light of the map to within a hundredth, and that of a
    /// single pixel to within 7 % in 95 of 100 places. Borders of pixels are softened.
    ///
    /// O(pixels), of which each takes 128 points.
    ///
    /// # Errors
    /// [`SkyError::Size`] if there are not as many rows as columns, none, or more than 16,384; [`SkyError::Pixel`] as
    /// for [`Sky::equirectangular`].
    ///
    /// ```
    /// use girandole::{Sky, glam::Vec3};
    /// // Blue above, and brown in the corners, which are below the horizon.
    /// let is_above = |x: i32, y: i32| (2 * x - 63).abs() + (2 * y - 63).abs() < 64;
    /// let pixel = |i: i32| if is_above(i % 64, i / 64) { Vec3::Z * 90.0 } else { Vec3::new(9.0, 6.0, 3.0) };
    /// let sky = Sky::octahedral(64, &(0..64 * 64).map(pixel).collect::<Vec<_>>())?;
    /// assert_eq!(sky.size(), [128, 64]);
    /// assert!(sky.radiance(Vec3::new(0.3, 0.5, 0.1)).z > 89.0 && sky.radiance(Vec3::NEG_Y).z < 4.0);
    /// # Ok::<(), girandole::SkyError>(())
    /// ```
    pub fn octahedral(width: usize, pixels: &[Vec3]) -> Result<Self, SkyError> {
        let max = MAX_SIZE / 2;
        if !(1..=max).contains(&width) || width * width != pixels.len() {
            return Err(SkyError::Size { width, pixels: pixels.len(), max });
        }
        // Of the given pixels, which an error names.
        let most = Vec3::splat(greatest(pixels)?);
        let radiance = |direction: Vec3| pixels[octahedral::pixel_at(width, direction)];
        let texels = resampled(2 * width, radiance);
        // A mean is rounded.
        Self::equirectangular(2 * width, &texels.into_iter().map(|texel| texel.min(most)).collect::<Vec<_>>())
    }

    /// Makes a sky as [`Sky::from_fn`] does, of which each pixel is the mean over 8 x 8 points, weighed by solid angle: for
    /// maps in another parametrisation, whose light it keeps as [`Sky::octahedral`] does.
    ///
    /// O(pixels), of which each takes 64 points.
    ///
    /// # Errors
    /// As for [`Sky::equirectangular`].
    pub fn averaged(width: usize, radiance: impl Fn(Vec3) -> Vec3 + Sync) -> Result<Self, SkyError> {
        if !(1..=MAX_SIZE).contains(&width) {
            return Err(SkyError::Size { width, pixels: width.saturating_mul(width / 2), max: MAX_SIZE });
        }
        Self::equirectangular(width, &resampled(width, radiance))
    }

    /// Makes the map new to those who have read it, or another one.
    pub(crate) fn renew(&mut self) {
        self.levels.renew();
    }

    /// Stores other pixels in a part of the map: see [`LightWorld::set_sky_part`](crate::LightWorld::set_sky_part).
    pub(crate) fn set_part(&mut self, corner: [usize; 2], size: [usize; 2], pixels: &[Vec3]) -> Result<(), SkyError> {
        let map = self.size();
        let fits = |k: usize| corner[k].checked_add(size[k]).is_some_and(|end| end <= map[k]);
        if !(fits(0) && fits(1)) || size[0].checked_mul(size[1]) != Some(pixels.len()) {
            return Err(SkyError::Part { corner, size, pixels: pixels.len(), map });
        }
        let [first, end] = self.levels.set(corner, size, pixels, greatest(pixels)?);
        self.known.retain(|square, _| !square.meets(first, end));
        self.patches = patches::cut(&self.levels, &mut self.known);
        Ok(())
    }

    /// The columns and rows of the map.
    pub fn size(&self) -> [usize; 2] {
        self.levels.size()
    }

    /// The radiance from a direction in the space of the map, in nits. The direction need not have unit length.
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        self.levels.texel(self.levels.texel_at(direction))
    }

    /// The memory of the map, in bytes. O(1).
    pub fn memory_bytes(&self) -> usize {
        size_of_val(self)
            + self.levels.memory_bytes()
            + size_of::<Patch>() * (self.patches.capacity() + 2 * self.known.len())
    }

    /// The patches as lights at a distance of 1: spheres that hold them, and bring as much light.
    pub(crate) fn lights(&self) -> Vec<Light> {
        let sphere = |patch: &Patch| {
            let radiance = patch.lux / (PI * patch.radius * patch.radius);
            Light::sphere(patch.mean, patch.radius, Vec3::splat(radiance.min(MAX_EMISSION)))
        };
        self.patches.iter().map(sphere).collect()
    }

    /// Chooses a point of a patch, in proportion to its luminance. `None` for a patch that there is not.
    pub(crate) fn sample(&self, patch: u32, u: [f32; 2]) -> Option<SkyPoint> {
        let Patch { place, lux, .. } = *self.patches.get(patch as usize)?;
        let (direction, texel) = self.levels.sample(place, u);
        Some(SkyPoint { direction, radiance: self.levels.texel(texel), pdf: self.levels.luminance(texel) / lux })
    }

    /// The point of the sky in a direction of unit length, and its patch; `None` where the sky is dark.
    pub(crate) fn point(&self, direction: Vec3) -> Option<(u32, SkyPoint)> {
        let texel = self.levels.texel_at(direction);
        let after = self.patches.partition_point(|patch| patch.place.first_in_order() <= in_order(texel));
        let patch = after.checked_sub(1).filter(|patch| self.patches[*patch].place.contains(texel))?;
        let pdf = self.levels.luminance(texel) / self.patches[patch].lux;
        (pdf > 0.0).then_some(())?;
        Some((patch as u32, SkyPoint { direction, radiance: self.levels.texel(texel), pdf }))
    }
}

impl fmt::Debug for Sky {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (size, patches) = (self.size(), self.patches.len());
        f.debug_struct("Sky").field("size", &size).field("patches", &patches).finish_non_exhaustive()
    }
}

/// The greatest channel of pixels that are sound.
fn greatest(pixels: &[Vec3]) -> Result<f32, SkyError> {
    // Numbers above 0 are in the order of their bits, below those of infinity, NaN and negative numbers. A sum turns
    // -0 into 0.
    let bits = |pixel: &Vec3| pixel.to_array().map(|channel| (channel + 0.0).to_bits());
    let of_part = |pixels: &[Vec3]| {
        let most = pixels.iter().fold([0; 3], |most: [u32; 3], pixel| {
            let bits = bits(pixel);
            [0, 1, 2].map(|k| most[k].max(bits[k]))
        });
        most[0].max(most[1]).max(most[2])
    };
    let greatest = map_chunks(pixels, PIXELS_OF_A_TASK, of_part).into_iter().max().unwrap_or(0);
    if greatest <= MAX_EMISSION.to_bits() {
        return Ok(f32::from_bits(greatest));
    }
    let is_unsound = |pixel: &Vec3| bits(pixel).iter().any(|bits| *bits > MAX_EMISSION.to_bits());
    let pixel = pixels.iter().position(is_unsound).unwrap_or(0);
    Err(SkyError::Pixel { pixel, value: pixels[pixel], max: MAX_EMISSION })
}

#[cfg(test)]
pub(crate) mod tests;
