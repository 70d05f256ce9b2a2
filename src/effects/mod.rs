//! Effects: the features that the lights and instances of a world have. Data of an absent effect
//! is neither stored nor uploaded, and shaders do not test for it.
//!
//! A world counts what it holds in an [`EffectCounts`]. Each light that is added, changed or
//! removed changes some counts by one. A tree keeps the counts of its own lights, so no call ever
//! visits all lights. Two sets follow from the counts:
//!
//! - [`LightWorld::active_effects`](crate::LightWorld::active_effects) is the set of effects that
//!   some light, instance or tree has now.
//! - [`LightWorld::effects`](crate::LightWorld::effects) is the set that shaders and buffer layouts
//!   should be made for. It grows at once, since shaders must handle what the buffers hold, and
//!   shrinks [`EFFECT_HOLD_UPDATES`] updates late, so that a lamp that flickers does not cause a
//!   new pipeline each time.
//!
//! An engine keeps a pipeline for each set (`docs/shaders.md`).
//!
//! A light that is off has the effects of its kind: its record is in the buffers, and it may be on
//! in the next frame.

mod counts;

pub(crate) use counts::HeldEffects;
pub use counts::{EFFECT_HOLD_UPDATES, EffectCounts};

bitflags::bitflags! {
    /// A set of effects: features that a scene may or may not have.
    ///
    /// Shaders that are made for a set serve every world whose effects are a subset of it.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
    pub struct Effects: u16 {
        /// A light emits into less than all directions: a spot, or a surface with one emitting
        /// side.
        const CONES = 1;
        /// A light has a finite range.
        const RANGES = 1 << 1;
        /// A light is a surface: a rectangle, a triangle or a sphere.
        const AREAS = 1 << 2;
        /// A surface emits from both sides.
        const TWO_SIDED = 1 << 3;
        /// The world has a directional light.
        const DIRECTIONAL = 1 << 4;
        /// An instance is scaled, sheared or mirrored (not only rotated and translated, to
        /// rounding). An instance that is not shown does not count.
        const NON_RIGID = 1 << 5;
        /// The lights of a tree changed within the last [`EFFECT_HOLD_UPDATES`] updates.
        ///
        /// This changes no shader and no layout. It is part of the counts and of
        /// [`LightWorld::active_effects`](crate::LightWorld::active_effects), but never of
        /// [`LightWorld::effects`](crate::LightWorld::effects).
        const MOVING = 1 << 6;
        /// The world samples large and near surfaces by solid angle: see
        /// [`LightWorld::set_solid_angle_sampling`](crate::LightWorld::set_solid_angle_sampling).
        ///
        /// This is a setting, not a feature of a light or an instance: its count is 0 or 1. It
        /// changes no layout, and no shader that is made without [`Effects::AREAS`].
        const SOLID_ANGLES = 1 << 7;
        /// Shading points may be glossy: see
        /// [`LightWorld::set_glossy_sampling`](crate::LightWorld::set_glossy_sampling).
        ///
        /// This is a setting: its count is 0 or 1. It changes no layout. Shaders without it treat
        /// all surfaces as matte.
        const GLOSSY = 1 << 8;
        /// Shading points may be segments of rays: see
        /// [`LightWorld::set_segment_sampling`](crate::LightWorld::set_segment_sampling).
        ///
        /// This is a setting: its count is 0 or 1. It changes no layout. Shaders without it treat a
        /// segment as the point in its middle.
        const SEGMENTS = 1 << 9;
        /// An instance that is shown has a factor other than 1: see
        /// [`LightWorld::set_factor`](crate::LightWorld::set_factor).
        const FACTORS = 1 << 10;
        /// An instance that is shown has a mask with a bit that is not set: see
        /// [`LightWorld::set_mask`](crate::LightWorld::set_mask).
        const MASKS = 1 << 11;
        /// Placements are stored by sector, so that the origin moves without them: see
        /// [`OriginMode`](crate::OriginMode).
        ///
        /// This is a setting: its count is 0 or 1.
        const SECTORS = 1 << 12;
    }
}

impl Default for Effects {
    /// The empty set: point lights in instances that are only rotated and translated.
    fn default() -> Self {
        Self::empty()
    }
}
