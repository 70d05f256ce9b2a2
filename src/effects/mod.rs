//! Effects: the features that the lights and instances of a world have. Shaders that are made without
//! an effect have no code for it. A feature is an effect if that saves at least 5 % of the
//! instructions of a sample or of the build of a cut, or lets more of them run at a time.
//!
//! A world counts what it holds in an [`EffectCounts`]. Each light that is added, changed or
//! removed changes some counts by one. A tree keeps the counts of its own lights, so no call ever
//! visits all lights. Two sets follow from the counts:
//!
//! - [`LightWorld::active_effects`](crate::LightWorld::active_effects) is the set of effects that
//!   some light, instance or tree has now.
//! - [`LightWorld::effects`](crate::LightWorld::effects) is the set that shaders should be
//!   made for. It grows at once, since shaders must handle what the buffers hold, and
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

use std::fmt;
use std::ops::{BitAnd, BitOr, BitOrAssign, Sub, SubAssign};

/// A set of effects: features that a scene may or may not have.
///
/// Shaders that are made for a set serve every world whose effects are a subset of it.
///
/// ```
/// use girandole::Effects;
/// let effects = Effects::CONES | Effects::RANGES;
/// assert!(effects.contains(Effects::CONES) && !effects.contains(Effects::AREAS));
/// assert_eq!(effects - Effects::CONES, Effects::RANGES);
/// assert_eq!(effects.names().collect::<Vec<_>>(), ["CONES", "RANGES"]);
/// ```
#[derive(Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct Effects(u32);

/// Makes the constants of the effects, which it numbers.
macro_rules! effects {
    ($($(#[$doc:meta])* $name:ident,)*) => {
        #[allow(non_camel_case_types, clippy::upper_case_acronyms, reason = "the names of the constants")]
        enum Number { $($name,)* }

        impl Effects {
            $($(#[$doc])* pub const $name: Self = Self(1 << Number::$name as u32);)*

            /// The names of all effects, by their numbers.
            pub(crate) const NAMES: &[&str] = &[$(stringify!($name),)*];
        }
    };
}

effects! {
    /// A light emits into less than all directions: a spot, or a surface with one emitting
    /// side.
    CONES,
    /// A light has a finite range.
    RANGES,
    /// A light is a surface: a rectangle, a triangle or a sphere.
    AREAS,
    /// The world has a directional light.
    DIRECTIONAL,
    /// An instance is scaled, sheared or mirrored (not only rotated and translated, to
    /// rounding). An instance that is not shown does not count.
    NON_RIGID,
    /// The lights of a tree changed within the last [`EFFECT_HOLD_UPDATES`] updates.
    ///
    /// This changes no shader. It is part of the counts and of
    /// [`LightWorld::active_effects`](crate::LightWorld::active_effects), but never of
    /// [`LightWorld::effects`](crate::LightWorld::effects).
    MOVING,
    /// The world samples large and near surfaces by solid angle: see
    /// [`LightWorld::set_solid_angle_sampling`](crate::LightWorld::set_solid_angle_sampling).
    ///
    /// This is a setting, not a feature of a light or an instance: its count is 0 or 1. It
    /// changes no shader that is made without [`Effects::AREAS`].
    SOLID_ANGLES,
    /// Shading points may be glossy: see
    /// [`LightWorld::set_glossy_sampling`](crate::LightWorld::set_glossy_sampling).
    ///
    /// This is a setting: its count is 0 or 1. Shaders without it treat
    /// all surfaces as matte.
    GLOSSY,
    /// Shading points may be segments of rays: see
    /// [`LightWorld::set_segment_sampling`](crate::LightWorld::set_segment_sampling).
    ///
    /// This is a setting: its count is 0 or 1. Shaders without it treat a
    /// segment as the point in its middle.
    SEGMENTS,
    /// An instance that is shown has a factor other than 1: see
    /// [`Appearance::factor`](crate::Appearance::factor).
    FACTORS,
    /// An instance that is shown has a mask with a bit that is not set: see
    /// [`Appearance::mask`](crate::Appearance::mask).
    MASKS,
    /// The world has a sky that is shown: see [`LightWorld::set_sky`](crate::LightWorld::set_sky). It comes with
    /// [`Effects::AREAS`].
    SKY,
    /// A light has a photometric profile. It comes with [`Effects::CONES`].
    PROFILES,
    /// The world has portals, through which the sky enters rooms: see
    /// [`LightWorld::set_portals`](crate::LightWorld::set_portals).
    ///
    /// This is a setting: its count is 0 or 1. It changes no shader that is made without [`Effects::SKY`].
    PORTALS,
}

impl Effects {
    /// The empty set: point lights in instances that are only rotated and translated.
    pub const fn empty() -> Self {
        Self(0)
    }

    /// All effects.
    pub const fn all() -> Self {
        Self((1 << Self::NAMES.len()) - 1)
    }

    /// Whether there is no effect in the set.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Whether the set has all effects of another.
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Whether two sets have an effect in common.
    pub const fn intersects(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }

    /// The effects of either set, as the operator `|`.
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// The effects that are not in the other set, as the operator `-`.
    pub const fn difference(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// The effects one by one, in the order of their declaration.
    pub fn iter(self) -> impl Iterator<Item = Self> {
        self.numbers().map(Self::of_number)
    }

    /// The names of the effects, as they are declared.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        self.numbers().map(|number| Self::NAMES[number])
    }

    /// The numbers of the effects.
    pub(crate) fn numbers(self) -> impl Iterator<Item = usize> {
        (0..Self::NAMES.len()).filter(move |number| self.0 >> number & 1 != 0)
    }

    /// The effect with a number.
    pub(crate) fn of_number(number: usize) -> Self {
        Self(1 << number)
    }

    /// The effect with a name.
    #[cfg(feature = "gpu-plan")]
    pub(crate) fn from_name(name: &str) -> Option<Self> {
        Self::NAMES.iter().position(|other| *other == name).map(Self::of_number)
    }
}

impl BitOr for Effects {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        self.union(other)
    }
}

impl BitAnd for Effects {
    type Output = Self;

    fn bitand(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }
}

impl BitOrAssign for Effects {
    fn bitor_assign(&mut self, other: Self) {
        *self = *self | other;
    }
}

impl Sub for Effects {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self.difference(other)
    }
}

impl SubAssign for Effects {
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl FromIterator<Effects> for Effects {
    fn from_iter<I: IntoIterator<Item = Self>>(effects: I) -> Self {
        effects.into_iter().fold(Self::empty(), Self::union)
    }
}

impl fmt::Debug for Effects {
    /// The names, as in `Effects(CONES | RANGES)`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Effects({})", self.names().collect::<Vec<_>>().join(" | "))
    }
}
