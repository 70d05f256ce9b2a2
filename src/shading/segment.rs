//! A segment of a ray as the choice of lights sees it: how a cluster of lights lies relative to it,
//! and the mean of the inverse squared distance over it.
//!
//! Based on Kulla and Fajardo, Importance Sampling Techniques for Path Tracing in Participating
//! Media (2012): the integral of the inverse squared distance of a point over a segment is the
//! angle under which the point sees the segment, over its distance from the line. Differs: the
//! distance is softened by the variance of a cluster (docs/math.md). Twin of
//! `shaders/segment.wgsl`.

use glam::{Mat3, Vec3};

use crate::shading::shading_point::{MAX_SEGMENT_SQ, MIN_SEGMENT_SQ, ShadingPoint};
use crate::tree::Unpacked;

/// The coefficients of the odd powers from the third on in a polynomial for the arc tangent of
/// numbers in [0, 1]. Its first coefficient is 1, so that short segments have the values of points.
/// The relative error is at most 5e-5.
pub(crate) const ARC_TANGENT: [f32; 4] = [-0.332_13, 0.186_81, -0.094_1, 0.024_84];

/// A segment in the space of a tree, about its middle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LocalSegment {
    /// A unit vector from the start to the end.
    pub unit: Vec3,
    /// Half the length.
    pub half: f32,
}

impl LocalSegment {
    /// The segment of a shading point in the space of its position; `None` for a point.
    pub fn of(shading_point: &ShadingPoint) -> Option<Self> {
        let length_sq = shading_point.segment.length_squared();
        // NaN fails the comparisons.
        let is_segment = (MIN_SEGMENT_SQ..=MAX_SEGMENT_SQ).contains(&length_sq);
        (is_segment && shading_point.normal.normalize_or_zero() == Vec3::ZERO).then(|| Self::new(shading_point.segment))
    }

    /// The same segment under a linear map, whose scales are those of placements.
    pub fn carried(&self, linear: &Mat3) -> Self {
        Self::new(*linear * (self.unit * (2.0 * self.half)))
    }

    fn new(segment: Vec3) -> Self {
        let length = segment.length();
        Self { unit: segment / length, half: 0.5 * length }
    }

    /// The most by which the coordinates of a point of the segment differ from those of its middle,
    /// added up over the three axes.
    pub fn reach(&self) -> f32 {
        self.unit.abs().element_sum() * self.half
    }
}

/// A point, or the mean position of a cluster, as a segment sees it. In metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SegmentView {
    /// How far the nearest point of the line lies from the segment's middle, toward its end.
    pub foot: f32,
    /// Squared distance from the line.
    pub line_sq: f32,
    /// Half the length of the segment.
    pub half: f32,
}

impl SegmentView {
    /// `toward` is the vector from the middle of the segment.
    #[inline(always)]
    pub fn new(toward: [f32; 3], segment: &LocalSegment) -> Self {
        let unit = segment.unit.to_array();
        let mut foot = 0.0;
        for k in 0..3 {
            foot += unit[k] * toward[k];
        }
        let mut line_sq = 0.0;
        for k in 0..3 {
            let across = toward[k] - foot * unit[k];
            line_sq += across * across;
        }
        Self { foot, line_sq, half: segment.half }
    }

    /// Squared distance from the segment.
    #[inline(always)]
    pub fn near_sq(&self) -> f32 {
        let beyond = self.foot - clamped(self.foot, self.half);
        self.line_sq + beyond * beyond
    }

    /// The inverse of the mean, over the segment, of the inverse squared distance of a point that
    /// lies at the foot of this one and `distance` metres from the line.
    #[inline(always)]
    pub fn mean_sq(&self, distance: f32) -> f32 {
        let length = 2.0 * self.half;
        let y = length * distance;
        let x = distance * distance + (self.foot * self.foot - self.half * self.half);
        y / angle(y, x)
    }

    /// The point that halves the angle under which the point at the foot of this one, and
    /// `distance` metres from the line, sees a part of the segment. The part lies between two
    /// points that are given, as all points here, by their places relative to the foot and their
    /// distances from the point. Source: the angle bisector theorem.
    #[inline(always)]
    pub fn halved(distance_sq: f32, a: [f32; 2], b: [f32; 2]) -> [f32; 2] {
        let place = (a[0] * b[1] + b[0] * a[1]) / (a[1] + b[1]);
        [place, (distance_sq + place * place).sqrt()]
    }
}

/// The angle of the vector (x, y) in [0, pi] for y above 0. It has no branches, so that eight are
/// computed at once.
#[inline(always)]
pub(crate) fn angle(y: f32, x: f32) -> f32 {
    let size = if x < 0.0 { -x } else { x };
    let is_steep = y > size;
    let (less, more) = if is_steep { (size, y) } else { (y, size) };
    let z = less / more;
    let z_sq = z * z;
    let [c3, c5, c7, c9] = ARC_TANGENT;
    let flat = z + z * z_sq * (c3 + z_sq * (c5 + z_sq * (c7 + z_sq * c9)));
    let acute = if is_steep { std::f32::consts::FRAC_PI_2 - flat } else { flat };
    if x < 0.0 { std::f32::consts::PI - acute } else { acute }
}

/// A lower bound of the squared distance between a segment and the box of a child, less `margin`
/// along each axis; and the squared distance of the box's centre.
///
/// The bound is the greater of two: the distance between the two boxes, and the gap along the
/// direction from the segment to the centre, along which the segment may separate from the box.
#[inline(always)]
pub(crate) fn gap_sq(child: &Unpacked, segment: &LocalSegment, margin: f32) -> (f32, f32) {
    let unit = segment.unit.to_array();
    let (mut foot, mut apart_sq) = (0.0, 0.0);
    for k in 0..3 {
        foot += unit[k] * child.center[k];
        let size = if child.center[k] < 0.0 { -child.center[k] } else { child.center[k] };
        let own = if unit[k] < 0.0 { -unit[k] } else { unit[k] } * segment.half;
        let outside = size - (child.half[k] + margin + own);
        let outside = if outside > 0.0 { outside } else { 0.0 };
        apart_sq += outside * outside;
    }
    let place = clamped(foot, segment.half);
    let (mut away_sq, mut center, mut box_reach, mut own) = (0.0, 0.0, 0.0, 0.0);
    for k in 0..3 {
        let away = child.center[k] - place * unit[k];
        away_sq += away * away;
        center += away * child.center[k];
        box_reach += if away < 0.0 { -away } else { away } * (child.half[k] + margin);
        own += away * unit[k];
    }
    let own = if own < 0.0 { -own } else { own } * segment.half;
    let gap = center - own - box_reach;
    let gap = if gap > 0.0 { gap } else { 0.0 };
    // A gap above 0 is at most `away_sq`, which is then above 0 too.
    let along_sq = gap * (gap / (if gap > 0.0 { away_sq } else { 1.0 }));
    (if along_sq > apart_sq { along_sq } else { apart_sq }, away_sq)
}

/// A number limited to [-`half`, `half`].
#[inline(always)]
pub(crate) fn clamped(x: f32, half: f32) -> f32 {
    let x = if x > -half { x } else { -half };
    if x < half { x } else { half }
}
