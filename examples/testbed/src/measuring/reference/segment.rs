//! The importance of a child for a segment of a ray, and the proofs that it is dark (docs/math.md,
//! Segments of rays).

use super::child::Child;
use super::place::View;
use super::terms::{Importance, estimated_doubt, limited, lobe, margin};
use girandole::glam::DVec3;
use girandole::tree::Node;
use std::f64::consts::{FRAC_PI_2, PI};

/// The relative error of the library's arc tangent, in roundings.
pub const ARC_TANGENT: f64 = 5.0e-5 / (0.5 * f32::EPSILON as f64);

/// A point as a segment from -`half` to `half` sees it.
#[derive(Clone, Copy, Debug)]
struct Seen {
    toward: DVec3,
    unit: DVec3,
    /// Half the length.
    half: f64,
    /// How far the nearest point of the line lies from the middle of the segment.
    foot: f64,
    /// The distance from the line.
    line: f64,
}

impl Seen {
    fn new(toward: DVec3, half: DVec3) -> Self {
        let unit = half.normalize();
        Self { toward, unit, half: half.length(), foot: unit.dot(toward), line: unit.cross(toward).length() }
    }

    /// The distance from the segment.
    fn near(&self) -> f64 {
        self.line.hypot((self.foot.abs() - self.half).max(0.0))
    }

    /// How many times larger the coordinates are than the distance from the segment.
    fn magnification(&self, softened: f64) -> f64 {
        let size = self.toward.abs().element_sum() + self.half;
        size / self.near().max(softened.sqrt())
    }
}

/// The importance of a child of a node for a view with a segment.
pub fn importance(child: &Child, node: &Node, view: &View, is_light: bool) -> Importance {
    let reach = view.position.abs().element_sum() + view.segment.abs().element_sum();
    let margin = margin(node, view) + view.margin * view.segment.abs().element_sum();
    // Rounding takes more of the margins than for points, because an end of the segment may be far
    // away.
    let verdicts = [0.8, 1.0, 1.2].map(|share| is_dark(child, view, share * margin, share));
    let seen = Seen::new(child.mean - view.position, view.segment);
    let error = 3.0e-7 * reach + 2.0e-11;
    let nearness = (seen.near().powi(2) + child.variance)
        / (2.0 * child.half().length_squared() / 255.0_f64.powi(2) + 6.0 * error * error);

    let (gap, variance) = (gap(child, view, margin), child.variance);
    let near_sq = seen.near().powi(2).max(1.0e-30);
    let doubt = if is_light { 0.0 } else { estimated_doubt(near_sq, variance, gap) };
    let length = 2.0 * seen.half;
    let nearness_gain = 1.0 + doubt / 5.0 * (near_sq + variance) / (near_sq + variance + length * length);

    let softened = (seen.line.powi(2) + 0.5 * variance).max(1.0e-30);
    let soft = softened.sqrt();
    let (a, b) = (-seen.half - seen.foot, seen.half - seen.foot);
    // The angles of the ends, from the foot.
    let (start, end) = ((a / soft).atan(), (b / soft).atan());
    let angle = (soft * length).atan2(softened + a * b);
    let toward = |part: f64| {
        let place = soft * (start + part * (end - start)).tan();
        let from = seen.toward - (place + seen.foot) * seen.unit;
        let dist_sq = from.length_squared().max(1.0e-30);
        let (value, condition) =
            lobe(child.length, -child.axis.dot(from) / dist_sq.sqrt(), variance / (dist_sq + variance));
        (value, value * condition)
    };
    let parts = [toward(0.25), toward(0.75)];
    let emitted = 0.5 * (parts[0].0 + parts[1].0);
    let lobe_condition = 0.5 * (parts[0].1 + parts[1].1) / emitted;
    let lux = view.brightness * child.flux / (4.0 * PI) * nearness_gain * emitted * angle / (soft * length);

    // The differences of squares below the arc tangent, relative to its arguments.
    let terms = (seen.foot.powi(2) + seen.half.powi(2) + softened) / (a.hypot(soft) * b.hypot(soft));
    let magnified = 1.0 + seen.magnification(softened);
    Importance {
        lux: if verdicts[1] { 0.0 } else { limited(lux) },
        doubt,
        is_unresolved: nearness <= 1.0,
        condition: (lobe_condition.max(1.0) + terms) * magnified * magnified + ARC_TANGENT,
        gap: (gap.powi(2) + child.variance / 50.0).sqrt(),
        is_close: verdicts[0] != verdicts[2] || (nearness - 1.0).abs() < 1.0e-3 * magnified,
    }
}

/// A lower bound of the distance between the segment and the child's box, which is wider by a margin.
fn gap(child: &Child, view: &View, margin: f64) -> f64 {
    let (center, half, segment) = (child.center() - view.position, child.half() + margin, view.segment);
    let boxes = (center.abs() - half - segment.abs()).max(DVec3::ZERO).length();
    let away = nearest(center, segment);
    let along = away.dot(center) - away.dot(segment).abs() - away.abs().dot(half);
    if along > 0.0 { boxes.max(along / away.length()) } else { boxes }
}

/// The vector to a point from the nearest point of the segment from -`half` to `half`.
fn nearest(point: DVec3, half: DVec3) -> DVec3 {
    point - (point.dot(half) / half.length_squared()).clamp(-1.0, 1.0) * half
}

/// Whether the range or the cap proves that no light arrives at any point of the segment.
fn is_dark(child: &Child, view: &View, margin: f64, share: f64) -> bool {
    let gap = gap(child, view, margin);
    let is_out_of_range = child.range.is_some_and(|range| gap > range * (1.0 + 1.0e-4 * share));
    let is_turned_away = child.half_angle.is_some_and(|half_angle| {
        // From the box's centre: the middle, its part along the axis, and the parts across it.
        let middle = view.position - child.center();
        let along = child.axis.dot(middle);
        let (across, turn) = (middle - along * child.axis, view.segment - child.axis.dot(view.segment) * child.axis);
        let most_along = along + child.axis.dot(view.segment).abs();
        let least = if turn == DVec3::ZERO { across.length() } else { nearest(across, turn).length() };
        let most = (across + turn).length().max((across - turn).length());
        let slack = 1.0e-3 * share * (along.abs() + across.length() + 2.0 * view.segment.length()) + margin;
        let radius = child.half().length() + slack;
        let (sin, cos) = half_angle.sin_cos();
        let is_narrow = half_angle <= FRAC_PI_2;
        let beyond = (if is_narrow { least } else { most }) * cos - most_along * sin;
        // All of it is more than a right angle beyond the cap.
        let is_behind = is_narrow
            && beyond > 0.0
            && most_along * cos + most * sin < -slack
            && nearest(-middle, view.segment).length() > radius;
        beyond > radius || is_behind
    });
    is_out_of_range || is_turned_away
}
