//! Which effects a world calls for: what no light has is neither stored, nor tested, nor uploaded.
//!
//! A world counts what it holds ([`EffectCounts`]): each light that comes, changes or goes moves some counts by one, a
//! tree keeps those of its own lights, and nobody ever looks through all of them. What the counts call for is
//! [`LightWorld::active_effects`](crate::LightWorld::active_effects). [`LightWorld::effects`](crate::LightWorld::effects) is what shaders should be
//! made for: it grows at once, since shaders must know what lies in the buffers, and shrinks [`EFFECT_HOLD_UPDATES`] updates late.
//! [`PipelineVariants`] keeps the shaders.
//!
//! A light that is off counts as what it is: its record lies in the buffers, and it may be on again in the next frame.

mod counts;

pub(crate) use counts::Damped;
pub use counts::{EFFECT_HOLD_UPDATES, EffectCounts};

bitflags::bitflags! {
    /// A set of effects. Shaders made for a set serve every world that calls for no other.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
    pub struct Effects: u8 {
        /// Some light shines into less than all directions: a spot, or a surface with one side.
        const CONES = 1;
        /// Some light has a range.
        const RANGES = 1 << 1;
        /// Some light is a surface: a rectangle, a triangle or a sphere.
        const AREAS = 1 << 2;
        /// Some surface emits from both sides.
        const TWO_SIDED = 1 << 3;
        /// There is a light at infinity.
        const DIRECTIONAL = 1 << 4;
        /// Some instance is scaled, sheared or mirrored, not only turned and moved (to rounding).
        const NON_RIGID = 1 << 5;
        /// The lights of some tree changed within the last [`EFFECT_HOLD_UPDATES`] updates.
        const MOVING = 1 << 6;
    }
}

impl Default for Effects {
    /// Nothing but points in instances that are turned and moved.
    fn default() -> Self {
        Self::empty()
    }
}
