//! The point at which light arrives.

use glam::Vec3;

use crate::shading::gloss::Gloss;

/// The squared length of the shortest segment, in square metres. With the limits of placements, the
/// squared length stays a normal number in the space of any tree.
pub(crate) const MIN_SEGMENT_SQ: f32 = 1.0e-18;
/// The squared length of the longest segment.
pub(crate) const MAX_SEGMENT_SQ: f32 = 1.0e18;

/// What a light is chosen for: a point on a surface, a point in a volume such as fog, or a segment
/// of a ray through a volume.
///
/// Make one with [`ShadingPoint::surface`], [`ShadingPoint::volume`] or [`ShadingPoint::segment`];
/// later versions may add fields.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ShadingPoint {
    /// Position in metres, relative to the world's origin; for a segment, its middle. Methods of
    /// [`LightTree`](crate::LightTree) take it in the tree's own space.
    pub position: Vec3,
    /// Unit normal of the side that light arrives at. Zero for a point in a volume, where light
    /// arrives from all sides.
    pub normal: Vec3,
    /// How a glossy surface reflects; `None` for a matte one. Points in volumes ignore it.
    pub gloss: Option<Gloss>,
    /// The vector from the start of a segment to its end, in metres; zero for a point. A shading
    /// point with a normal counts as a point, whatever its segment is. So does a vector that is
    /// shorter than 1e-9 m, longer than 1e9 m or not finite.
    pub segment: Vec3,
    /// Only lights of instances whose mask has a bit in common with this one reach the point: see
    /// [`Appearance::mask`](crate::Appearance::mask). All bits are set unless
    /// [`ShadingPoint::with_mask`] sets others. With 0 only directional lights reach it. Methods of
    /// [`LightTree`](crate::LightTree) ignore it.
    pub mask: u32,
}

impl ShadingPoint {
    /// A point on a surface. `normal` is a unit vector that points to the side that is shaded;
    /// lights behind the surface have the probability 0.
    pub fn surface(position: Vec3, normal: Vec3) -> Self {
        Self { position, normal, gloss: None, segment: Vec3::ZERO, mask: u32::MAX }
    }

    /// A point in a volume, or any other point that light may reach from all sides.
    pub fn volume(position: Vec3) -> Self {
        Self { position, normal: Vec3::ZERO, gloss: None, segment: Vec3::ZERO, mask: u32::MAX }
    }

    /// The segment `origin + t * direction` of a ray through a volume, for t from 0 to `length`.
    ///
    /// Lights are chosen by the mean of their illuminance over the segment, where each point of it
    /// faces each light. The mean times the length is the integral that is in-scattered by a medium
    /// that scatters alike to all sides. `direction` is a unit vector, and `length` is in metres.
    ///
    /// A segment that is shorter than 1e-9 m, longer than 1e9 m or not finite becomes the point
    /// `origin`: clip rays that hit nothing to the extent of the medium.
    ///
    /// ```
    /// use girandole::glam::Vec3;
    /// use girandole::{Light, LightTree, LightWorld, Placement, Policy, ShadingPoint};
    ///
    /// let mut world = LightWorld::new();
    /// let lamp = world.add_tree(LightTree::new(vec![Light::point(Vec3::new(4.0, 3.0, 0.0), Vec3::ONE)])?);
    /// world.add_instance(lamp, Placement::IDENTITY, Policy::Static)?;
    ///
    /// // The lamp is 3 m from the ray, and sees it under a right angle.
    /// let ray = ShadingPoint::segment(Vec3::new(1.0, 0.0, 0.0), Vec3::X, 6.0);
    /// let sample = world.sampler().sample(&ray, [0.1, 0.2, 0.3, 0.4]).expect("the lamp is in sight");
    /// let integral = sample.incident.radiance.x / (sample.pmf * sample.incident.pdf);
    /// assert!((integral - std::f32::consts::FRAC_PI_2 / 3.0).abs() < 1.0e-3);
    /// assert!((0.0..=6.0).contains(&sample.incident.along));
    /// # Ok::<(), girandole::WorldError>(())
    /// ```
    pub fn segment(origin: Vec3, direction: Vec3, length: f32) -> Self {
        let segment = direction * length;
        // NaN fails the comparisons.
        match (MIN_SEGMENT_SQ..=MAX_SEGMENT_SQ).contains(&segment.length_squared()) {
            true => Self { segment, ..Self::volume(origin + 0.5 * segment) },
            false => Self::volume(origin),
        }
    }

    /// The same point with a glossy surface. Lights that the surface reflects toward the viewer
    /// become more probable.
    #[must_use]
    pub fn with_gloss(self, gloss: Gloss) -> Self {
        Self { gloss: Some(gloss), ..self }
    }

    /// The same point with another [mask](ShadingPoint::mask).
    #[must_use]
    pub fn with_mask(self, mask: u32) -> Self {
        Self { mask, ..self }
    }
}
