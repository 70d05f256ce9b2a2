//! The point of a segment at which the light of a chosen light is gathered.
//!
//! Twin of `light_sample_along` and `light_along_pdf` in `shaders/along.wgsl`.

use crate::keys::LightId;
use crate::math::dice::clamp_unit;
use crate::sampling::equiangular::Stretch;
use crate::sampling::sample::LightSampler;
use crate::shading::segment::LocalSegment;
use crate::shading::shading_point::ShadingPoint;

/// A point of a segment, which [`LightSampler::sample_along`] chose for a light.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct SegmentPoint {
    /// Distance from the start of the segment in metres.
    pub along: f32,
    /// Density of the distance per metre; 1 for the only point of a segment without length.
    pub pdf: f32,
    /// The point in the volume.
    pub shading_point: ShadingPoint,
}

impl LightSampler<'_> {
    /// Chooses the distance along a segment at which the light of a given light is gathered:
    /// equiangular about the centre of the light, on the part of the segment that its cone and its
    /// range can reach.
    ///
    /// `u` is uniform in [0, 1); numbers outside are clamped, and NaN counts as 0. For a
    /// directional light the distance is uniform. `None` if the light reaches no point of the
    /// segment, or does not exist. A shading point without a segment returns itself at 0 with the
    /// density 1.
    ///
    /// The density is at most that of a light whose distance from the line is a millionth of that
    /// from the farther end of the segment: on the line itself the integral is infinite. O(1).
    ///
    /// [`LightSampler::sample`] calls this itself.
    pub fn sample_along(&self, segment: &ShadingPoint, light: LightId, u: f32) -> Option<SegmentPoint> {
        let Some(local) = LocalSegment::of(segment) else {
            return Some(SegmentPoint { along: 0.0, pdf: 1.0, shading_point: *segment });
        };
        let (along, pdf) = self.stretch(segment, &local, light)?.sample(clamp_unit(u));
        let position = segment.position + local.unit * (along - local.half);
        Some(SegmentPoint { along, pdf, shading_point: ShadingPoint::volume(position).with_mask(segment.mask) })
    }

    /// Returns the density per metre with which [`LightSampler::sample_along`] chooses a distance
    /// from the start of a segment. 0 for distances that it never chooses; 1 for a shading point
    /// without a segment.
    pub fn along_pdf(&self, segment: &ShadingPoint, light: LightId, along: f32) -> f32 {
        let Some(local) = LocalSegment::of(segment) else { return 1.0 };
        self.stretch(segment, &local, light).map_or(0.0, |stretch| stretch.pdf(along))
    }

    /// The part of a segment that a light may reach; `None` if there is none.
    fn stretch(&self, shading_point: &ShadingPoint, segment: &LocalSegment, light: LightId) -> Option<Stretch> {
        match light {
            LightId::Directional(key) => self.world.directional(key).map(|_| Stretch::uniform(segment)),
            LightId::Local { instance, light } => {
                let placed = self.world.instance(instance)?;
                if placed.is_sky {
                    return Some(Stretch::uniform(segment));
                }
                let light = self.world.tree(placed.tree)?.lights().get(light as usize)?;
                Stretch::of(light, &placed.shown()?.frame(self.world.home()), shading_point, segment)
            }
        }
    }
}
