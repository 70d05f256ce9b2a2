//! What an instance changes about the lights of its tree, besides their place.

use glam::Vec3;

use crate::effects::Effects;
use crate::error::{ValueError, check_range};
use crate::light::luminance;

/// The largest factor of an instance, per channel. The flux of a cluster, which is at most 1e34 lm,
/// then stays within f32.
pub const MAX_FACTOR: f32 = 1.0e4;

/// What an instance changes about the lights of its tree, besides their place. It copies no tree. By default nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Appearance {
    /// Whether the lights shine. A disabled instance is treated as one that its placement hides: it keeps its key, slot,
    /// placement and policy, and contributes nothing.
    pub is_enabled: bool,
    /// What the emission of the lights is multiplied by: a linear colour, each channel from 0 to [`MAX_FACTOR`].
    ///
    /// Samples, probabilities and all sums over lights follow the factor; [`LightWorld::tree`](crate::LightWorld::tree)
    /// holds the lights without it. Lights are chosen by the luminance of the factor, so a factor whose colour differs
    /// from that of the lights costs some noise. An instance whose factor has no luminance in f32 is not shown, as if it
    /// were disabled. Instances with a factor other than 1 have [`Effects::FACTORS`].
    pub factor: Vec3,
    /// Which shading points the lights reach: those whose [mask](crate::ShadingPoint::mask) has a bit in common with this
    /// one. A mask of 0 meets no shading point.
    ///
    /// A light that does not reach a shading point is never chosen there: its probability is 0, it sends nothing, and
    /// those of the other lights add up as if it did not exist. Use it to link lights with rooms or with objects.
    /// Directional lights reach all shading points. Instances with another mask than that of all bits have
    /// [`Effects::MASKS`]; shaders without it ignore the masks of shading points.
    pub mask: u32,
    /// 32 bits that each sample of the lights returns: [`LightSample::user_data`](crate::LightSample::user_data) on the
    /// CPU, and `light_user_data(sample.instance)` in shaders. The library does not interpret them.
    pub user_data: u32,
}

impl Default for Appearance {
    /// The lights are as the tree has them: enabled, with a factor of 1, a mask of all bits and user data of 0.
    fn default() -> Self {
        Self { is_enabled: true, factor: Vec3::ONE, mask: u32::MAX, user_data: 0 }
    }
}

impl Appearance {
    /// Whether the factor is not 1.
    pub(crate) fn has_factor(&self) -> bool {
        self.factor != Vec3::ONE
    }

    /// What the flux of the lights is multiplied by: the luminance of the factor. 0 if they do not
    /// shine.
    pub(crate) fn brightness(&self) -> f32 {
        // The weights of the channels need not add up to 1 exactly.
        let luminance = if self.has_factor() { luminance(self.factor) } else { 1.0 };
        // GPUs may flush subnormal numbers to 0.
        let is_shown = self.is_enabled && luminance >= f32::MIN_POSITIVE;
        if is_shown { luminance } else { 0.0 }
    }

    /// Whether the lights shine at all.
    pub(crate) fn is_shown(&self) -> bool {
        self.brightness() > 0.0
    }

    /// The effects of an instance with this appearance that is shown.
    pub(crate) fn effects(&self) -> Effects {
        let factors = if self.has_factor() { Effects::FACTORS } else { Effects::empty() };
        let masks = if self.mask == u32::MAX { Effects::empty() } else { Effects::MASKS };
        factors | masks
    }

    /// What arrives from a light of the instance, where `radiance` would arrive without the factor.
    /// `None` if that rounds to 0 or exceeds f32, as it does on the light itself.
    pub(crate) fn arriving(&self, radiance: Vec3) -> Option<Vec3> {
        if !self.has_factor() {
            return Some(radiance);
        }
        let limit = f32::MAX / self.factor.max_element().max(1.0);
        let arriving = radiance * self.factor;
        (radiance.max_element() <= limit && arriving != Vec3::ZERO).then_some(arriving)
    }

    /// Whether both look the same to everything but the engine that reads the user data.
    pub(crate) fn is_alike(&self, other: &Self) -> bool {
        Self { user_data: 0, ..*self } == Self { user_data: 0, ..*other }
    }
}

/// Checks that each channel of a factor is a number from 0 to [`MAX_FACTOR`].
pub(crate) fn check_factor(factor: Vec3) -> Result<(), ValueError> {
    let what = "a channel of the factor";
    factor.to_array().into_iter().try_for_each(|channel| check_range(what, channel, 0.0, MAX_FACTOR))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_factor_of_one_has_the_brightness_one_and_changes_no_bit() {
        let appearance = Appearance::default();
        assert_eq!(appearance.brightness(), 1.0);
        assert_eq!(appearance.effects(), Effects::empty());
        let radiance = Vec3::new(1.0e38, 0.1, 1.0e-40);
        assert_eq!(appearance.arriving(radiance), Some(radiance));
    }

    #[test]
    fn the_ends_of_the_range_of_factors_stay_within_f32() {
        let mut appearance = Appearance { factor: Vec3::splat(MAX_FACTOR), ..Appearance::default() };
        assert!((appearance.brightness() / MAX_FACTOR - 1.0).abs() < 1.0e-6);
        assert_eq!(appearance.arriving(Vec3::splat(1.0e33)), Some(Vec3::splat(MAX_FACTOR) * 1.0e33));
        assert_eq!(appearance.arriving(Vec3::splat(1.0e35)), None, "beyond f32");
        for dark in [Vec3::ZERO, Vec3::splat(1.0e-39), Vec3::new(0.0, 0.0, -0.0)] {
            appearance.factor = dark;
            assert!(!appearance.is_shown() && appearance.brightness() == 0.0, "{dark}");
        }
        appearance.factor = Vec3::splat(1.0e-30);
        assert!(appearance.is_shown());
        assert_eq!(appearance.arriving(Vec3::splat(1.0e-30)), None, "it rounds to 0");
        appearance.is_enabled = false;
        assert!(!appearance.is_shown());
    }
}
