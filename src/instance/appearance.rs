//! What an instance changes about the lights of its tree, besides their place.

use glam::Vec3;

use crate::effects::Effects;
use crate::error::WorldError;
use crate::light::luminance;

/// The largest factor of an instance, per channel. The flux of a cluster, which is at most 1e34 lm,
/// then stays within f32.
pub const MAX_FACTOR: f32 = 1.0e4;

/// Properties of an instance that scale, hide or mark its lights. Setting them copies no tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Appearance {
    is_enabled: bool,
    factor: Vec3,
    /// The factor is not 1.
    has_factor: bool,
    /// The luminance of the factor; 0 if the lights do not shine.
    brightness: f32,
    /// A shading point sees the lights if its mask and this one have a bit in common.
    pub mask: u32,
    /// What every sample of the instance's lights returns to the engine.
    pub user_data: u32,
}

impl Default for Appearance {
    /// The lights are as the tree has them.
    fn default() -> Self {
        Self { is_enabled: true, factor: Vec3::ONE, has_factor: false, brightness: 1.0, mask: u32::MAX, user_data: 0 }
    }
}

impl Appearance {
    /// Whether the engine lets the lights shine.
    pub fn is_enabled(&self) -> bool {
        self.is_enabled
    }

    /// What the emission of the lights is multiplied by, as a linear colour.
    pub fn factor(&self) -> Vec3 {
        self.factor
    }

    /// Whether the factor is not 1.
    pub fn has_factor(&self) -> bool {
        self.has_factor
    }

    /// What the flux of the lights is multiplied by: the luminance of the factor. 0 if they do not
    /// shine.
    pub fn brightness(&self) -> f32 {
        self.brightness
    }

    /// Whether the lights shine at all.
    pub fn is_shown(&self) -> bool {
        self.brightness > 0.0
    }

    /// Enables or disables the lights.
    pub fn set_enabled(&mut self, is_enabled: bool) {
        self.is_enabled = is_enabled;
        self.find_brightness();
    }

    /// Sets the factor, which [`check_factor`] has accepted.
    pub fn set_factor(&mut self, factor: Vec3) {
        self.factor = factor;
        self.has_factor = factor != Vec3::ONE;
        self.find_brightness();
    }

    fn find_brightness(&mut self) {
        // The weights of the channels need not add up to 1 exactly.
        let luminance = if self.has_factor { luminance(self.factor) } else { 1.0 };
        // GPUs may flush subnormal numbers to 0.
        let is_shown = self.is_enabled && luminance >= f32::MIN_POSITIVE;
        self.brightness = if is_shown { luminance } else { 0.0 };
    }

    /// The effects of an instance with this appearance that is shown.
    pub fn effects(&self) -> Effects {
        let factors = if self.has_factor { Effects::FACTORS } else { Effects::empty() };
        let masks = if self.mask == u32::MAX { Effects::empty() } else { Effects::MASKS };
        factors | masks
    }

    /// What arrives from a light of the instance, where `radiance` would arrive without the factor.
    /// `None` if that rounds to 0 or exceeds f32, as it does on the light itself.
    pub fn arriving(&self, radiance: Vec3) -> Option<Vec3> {
        if !self.has_factor {
            return Some(radiance);
        }
        let limit = f32::MAX / self.factor.max_element().max(1.0);
        let arriving = radiance * self.factor;
        (radiance.max_element() <= limit && arriving != Vec3::ZERO).then_some(arriving)
    }

    /// Whether both look the same to everything but the engine that reads the user data.
    pub fn is_alike(&self, other: &Self) -> bool {
        Self { user_data: 0, ..*self } == Self { user_data: 0, ..*other }
    }
}

/// Checks that each channel of a factor is a number from 0 to [`MAX_FACTOR`].
pub(crate) fn check_factor(factor: Vec3) -> Result<(), WorldError> {
    // NaN is in no range.
    match factor.to_array().into_iter().find(|channel| !(0.0..=MAX_FACTOR).contains(channel)) {
        Some(value) => Err(WorldError::Factor { value, limit: MAX_FACTOR }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_factor_of_one_has_the_brightness_one_and_changes_no_bit() {
        let mut appearance = Appearance::default();
        appearance.set_factor(Vec3::ONE);
        assert_eq!((appearance, appearance.brightness()), (Appearance::default(), 1.0));
        assert_eq!(appearance.effects(), Effects::empty());
        let radiance = Vec3::new(1.0e38, 0.1, 1.0e-40);
        assert_eq!(appearance.arriving(radiance), Some(radiance));
    }

    #[test]
    fn the_ends_of_the_range_of_factors_stay_within_f32() {
        let mut appearance = Appearance::default();
        appearance.set_factor(Vec3::splat(MAX_FACTOR));
        assert!((appearance.brightness() / MAX_FACTOR - 1.0).abs() < 1.0e-6);
        assert_eq!(appearance.arriving(Vec3::splat(1.0e33)), Some(Vec3::splat(MAX_FACTOR) * 1.0e33));
        assert_eq!(appearance.arriving(Vec3::splat(1.0e35)), None, "beyond f32");
        for dark in [Vec3::ZERO, Vec3::splat(1.0e-39), Vec3::new(0.0, 0.0, -0.0)] {
            appearance.set_factor(dark);
            assert!(!appearance.is_shown() && appearance.brightness() == 0.0, "{dark}");
        }
        appearance.set_factor(Vec3::splat(1.0e-30));
        assert!(appearance.is_shown());
        assert_eq!(appearance.arriving(Vec3::splat(1.0e-30)), None, "it rounds to 0");
        appearance.set_enabled(false);
        assert!(!appearance.is_shown());
    }
}
