//! A distance along a segment for a given light, in proportion to the light that a point sends
//! there.
//!
//! Based on Kulla and Fajardo, Importance Sampling Techniques for Path Tracing in Participating
//! Media (2012), 4: equiangular sampling. Differs: only the part of the segment that the cone and
//! the range of the light reach is sampled, the size of a surface softens the distance from the
//! line, and the distance is computed from the start of that part without a difference of angles.
//! Twin of `light_stretch` and the functions beside it in `shaders/along.wgsl`.

use std::f32::consts::FRAC_PI_2;

use glam::Vec3;

use crate::instance::transform::InstanceTransform;
use crate::light::{Light, Shape, UNLIMITED_RANGE};
use crate::shading::segment::{LocalSegment, SegmentView};
use crate::shading::shading_point::ShadingPoint;

/// The least distance from the line, as a share of that of the farther end. On the line itself the
/// integral over the segment is infinite, and the density would have no limit.
pub(crate) const MIN_LINE_SHARE: f32 = 1.0e-6;
/// By how much a cone is widened before it clips a segment, in radians.
pub(crate) const CONE_SLACK: f32 = 1.0e-3;
/// The rounding error of a position, relative to the sum of the coordinates that it comes from.
pub(crate) const CONE_MARGIN: f32 = 2.0e-6;
/// The share of a range by which it is widened before it clips a segment.
pub(crate) const RANGE_SLACK: f32 = 1.0e-4;

/// The part of a segment that a light may reach. Lengths are in metres, and places are relative to
/// the foot: the point of the line nearest to the light's centre. The start and the length are kept
/// beside the place of the start: places far from the foot of a short segment have too few digits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stretch {
    /// Where the stretch starts, from the start of the segment.
    start: f32,
    length: f32,
    /// The place where it starts.
    a: f32,
    /// The softened distance of the centre from the line. Infinite for a directional light, which
    /// reaches all points alike.
    soft: f32,
    /// The angle under which the centre sees the stretch.
    angle: f32,
}

/// A light as a segment sees it.
struct Emitter {
    /// From the middle of the segment to the centre.
    toward: Vec3,
    /// The mean squared distance of the light's points from its centre.
    variance: f32,
    /// The greatest distance of a point from the centre.
    radius: f32,
    /// The unit axis and the cosine of the half-angle of a cone that contains all emission; `None`
    /// if it is wider than a half space.
    cone: Option<(Vec3, f32)>,
}

impl Emitter {
    fn new(light: &Light, frame: &InstanceTransform, shading_point: &ShadingPoint) -> Self {
        let surface = |center: Vec3, offsets: [Vec3; 3], weight: f32, normal_area: Option<Vec3>| {
            let squares = offsets.map(Vec3::length_squared);
            Self {
                toward: frame.toward(center, shading_point),
                variance: weight * squares.iter().sum::<f32>(),
                radius: offsets.iter().map(|offset| offset.length()).sum(),
                cone: normal_area.map(|normal| (frame.normal_area(normal).normalize_or_zero(), 0.0)),
            }
        };
        match light.shape {
            // Which part of a profile is lit is not looked for.
            Shape::Point { position } | Shape::Profile { position, .. } => {
                surface(position, [Vec3::ZERO; 3], 0.0, None)
            }
            Shape::Spot { position, direction, outer_angle, .. } => {
                let cos = outer_angle.cos();
                let axis = (frame.to_world * direction).normalize_or_zero();
                Self { cone: (cos >= 0.0).then_some((axis, cos)), ..surface(position, [Vec3::ZERO; 3], 0.0, None) }
            }
            Shape::Rectangle { center, half_u, half_v, two_sided } => {
                let normal_area = (!two_sided).then(|| half_u.cross(half_v) * 4.0);
                let offsets = [frame.to_world * half_u, frame.to_world * half_v, Vec3::ZERO];
                surface(center, offsets, 1.0 / 3.0, normal_area)
            }
            Shape::Triangle { vertices: [p, q, r], two_sided } => {
                let normal_area = (!two_sided).then(|| (q - p).cross(r - p) * 0.5);
                let center = (p + q + r) * (1.0 / 3.0);
                let offsets = [p, q, r].map(|vertex| frame.to_world * (vertex - center));
                surface(center, offsets, 1.0 / 12.0, normal_area)
            }
            Shape::Sphere { center, radius } => {
                let columns = [frame.to_world.x_axis, frame.to_world.y_axis, frame.to_world.z_axis];
                surface(center, columns.map(|column| column * radius), 1.0 / 3.0, None)
            }
        }
    }
}

impl Stretch {
    /// The stretch of a light; `None` if the light reaches no point of the segment.
    pub fn of(
        light: &Light,
        frame: &InstanceTransform,
        shading_point: &ShadingPoint,
        segment: &LocalSegment,
    ) -> Option<Self> {
        let Emitter { toward, variance, radius, cone } = Emitter::new(light, frame, shading_point);
        let SegmentView { foot, line_sq, half } = SegmentView::new(toward.to_array(), segment);
        let (mut a, mut b) = (-half - foot, half - foot);
        let line = line_sq.sqrt();
        if light.range < UNLIMITED_RANGE {
            let reach = (light.range + radius) * (1.0 + RANGE_SLACK);
            let most = (reach * reach - line_sq).max(0.0).sqrt();
            (a, b) = (a.max(-most), b.min(most));
        }
        if let Some((axis, cos)) = cone {
            // At the place s = line tan(t), the cosine of the angle at the centre is that of t less
            // the turn, times the tilt. So the cone cuts one interval out of the line.
            let (across, along) = (axis.dot(segment.unit * foot - toward), axis.dot(segment.unit) * line);
            let tilt = across.hypot(along);
            let reach = shading_point.position.abs().element_sum() + segment.reach() + foot.abs();
            let slack = CONE_SLACK + CONE_MARGIN * reach / line;
            // A light on the line has no turn, and NaN fails the comparison.
            if slack < FRAC_PI_2 && tilt > 0.0 {
                let turn = along.atan2(across);
                let width = (cos * line / tilt).min(1.0).acos() + slack;
                let place = |angle: f32| match () {
                    () if angle <= -FRAC_PI_2 => f32::NEG_INFINITY,
                    () if angle >= FRAC_PI_2 => f32::INFINITY,
                    () => line * angle.tan(),
                };
                (a, b) = (a.max(place(turn - width)), b.min(place(turn + width)));
            }
        }
        // NaN fails the comparison.
        let stretch = (b > a).then(|| {
            let start = if a > -half - foot { (a + (half + foot)).clamp(0.0, 2.0 * half) } else { 0.0 };
            let end = if b < half - foot { (b + (half + foot)).clamp(start, 2.0 * half) } else { 2.0 * half };
            let soft = (line_sq + variance).sqrt().max(MIN_LINE_SHARE * a.abs().max(b.abs()));
            let length = end - start;
            Self { start, length, a, soft, angle: (length * soft).atan2(soft * soft + a * (a + length)) }
        })?;
        (stretch.length > 0.0).then_some(stretch)
    }

    /// All of a segment, for a directional light.
    pub fn uniform(segment: &LocalSegment) -> Self {
        Self { start: 0.0, length: 2.0 * segment.half, a: 0.0, soft: f32::INFINITY, angle: 0.0 }
    }

    /// A distance from the start of the segment, and its density per metre. `u` in [0, 1).
    pub fn sample(&self, u: f32) -> (f32, f32) {
        let Self { start, length, a, soft, angle } = *self;
        let from_a = if soft < f32::INFINITY {
            let (sin, cos) = (u * angle).sin_cos();
            (sin * (soft * soft + a * a) / (soft * cos - a * sin)).clamp(0.0, length)
        } else {
            u * length
        };
        (start + from_a, self.density(a + from_a))
    }

    /// The density per metre of a distance from the start of the segment; 0 outside the stretch.
    pub fn pdf(&self, along: f32) -> f32 {
        let from_a = along - self.start;
        if from_a >= 0.0 && from_a <= self.length { self.density(self.a + from_a) } else { 0.0 }
    }

    fn density(&self, place: f32) -> f32 {
        let Self { length, soft, angle, .. } = *self;
        if soft < f32::INFINITY { soft / (soft * soft + place * place) / angle } else { 1.0 / length }
    }
}
