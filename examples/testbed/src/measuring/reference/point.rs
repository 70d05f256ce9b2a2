//! The importance of a child for a point, and the proofs that it is dark (docs/math.md,
//! Importance).

use super::child::Child;
use super::place::View;
use super::terms::{Importance, estimated_doubt, limited, lobe, margin};
use girandole::glam::DVec3;
use girandole::tree::Node;
use std::f64::consts::PI;

/// A child as the shading point sees it.
struct Seen {
    /// To the mean position.
    dist: f64,
    /// The part of it along the normal, and the greatest height of the box over the horizon.
    along: f64,
    highest: f64,
    /// The cosine between the axis of emission and the direction to the shading point.
    facing: f64,
    gap: f64,
    normal_variance: f64,
}

/// The distance to a box that is wider by a margin.
fn gap(child: &Child, view: &View, margin: f64) -> f64 {
    let center = child.center() - view.position;
    (center.abs() - child.half() - margin).max(DVec3::ZERO).length()
}

/// The importance of a child of a node for a view without a segment.
pub fn importance(child: &Child, node: &Node, view: &View, is_light: bool) -> Importance {
    let margin = margin(node, view);
    // The margins cover rounding; a decision within a tenth of them may go either way.
    let verdicts = [0.9, 1.0, 1.1].map(|share| is_dark(child, view, share * margin, share));
    let toward = child.mean - view.position;
    let radius_sq = child.half().length_squared();
    let error = 3.0e-7 * view.position.abs().element_sum() + 2.0e-11;
    let nearness =
        (toward.length_squared() + child.variance) / (2.0 * radius_sq / 255.0_f64.powi(2) + 6.0 * error * error);
    let seen = seen(child, view, margin);
    let (lux, doubt, condition) = estimate(&seen, view, child, is_light);
    Importance {
        lux: if verdicts[1] { 0.0 } else { lux },
        doubt,
        is_unresolved: nearness <= 1.0,
        condition,
        gap: (gap(child, view, margin).powi(2) + child.variance / 50.0).sqrt(),
        is_close: verdicts[0] != verdicts[2] || (nearness - 1.0).abs() < 1.0e-3,
    }
}

/// Whether one of the three tests proves that no light arrives. `share` multiplies the margins that
/// are not the one for positions.
fn is_dark(child: &Child, view: &View, margin: f64, share: f64) -> bool {
    let (normal, half) = (view.normal, child.half());
    let to_center = child.center() - view.position;
    let is_below = normal != DVec3::ZERO
        && normal.dot(to_center) + normal.abs().dot(half) + margin * normal.abs().element_sum() <= 0.0;
    let is_out_of_range = child.range.is_some_and(|range| gap(child, view, margin) > range * (1.0 + 1.0e-4 * share));
    let is_turned_away = child.half_angle.is_some_and(|half_angle| {
        let dist = to_center.length();
        // The angle at the box's centre between the axis and the direction to the shading point.
        let cos = -child.axis.dot(to_center) / dist;
        let sin = child.axis.cross(to_center).length() / dist;
        let beyond = sin.atan2(cos) - half_angle;
        let radius = half.length() + margin + 1.0e-3 * share * dist * (cos.abs() + sin);
        let slack = radius - half.length();
        let is_behind = dist * beyond.cos() < -slack && dist > radius;
        beyond > 0.0 && (dist * beyond.sin() > radius || is_behind)
    });
    is_below || is_out_of_range || is_turned_away
}

fn seen(child: &Child, view: &View, margin: f64) -> Seen {
    let (toward, half) = (child.mean - view.position, child.half());
    let across = (view.normal * view.normal).dot(half * half);
    let dist = toward.length().max(1.0e-15);
    Seen {
        dist,
        along: view.normal.dot(toward),
        highest: view.normal.dot(child.center() - view.position) + view.normal.abs().dot(half),
        facing: -child.axis.dot(toward) / dist,
        gap: gap(child, view, margin),
        normal_variance: (3.0 * child.deviation.powi(2) * across).min(child.variance),
    }
}

/// The importance in lux, the doubt, and how the importance magnifies rounding.
fn estimate(seen: &Seen, view: &View, child: &Child, is_light: bool) -> (f64, f64, f64) {
    let (dist_sq, v) = (seen.dist * seen.dist, child.variance);
    let spread = v / (dist_sq + v);
    let softened = dist_sq + 0.5 * v;
    let doubt = if is_light { 0.0 } else { estimated_doubt(dist_sq, v, seen.gap) };

    let c = seen.along / seen.dist;
    let root = (c * c + 0.5 * seen.normal_variance / (dist_sq + v)).sqrt();
    let limit = c.max(0.0) + seen.highest / (4.0 * seen.dist);
    let cosine = (0.5 * (c + root)).min(limit).max(1.0e-3);
    // Products of components that are up to 1 make c.
    let height = (1.0 + root + (limit - c.max(0.0)).abs()) / cosine;
    let (cosine, cosine_condition) = if view.normal == DVec3::ZERO { (1.0, 1.0) } else { (cosine, height) };

    let (lobe, lobe_condition) = lobe(child.length, seen.facing, spread);
    let lux = view.brightness * child.flux / (4.0 * PI) * lobe * cosine / softened * (1.0 + doubt / 5.0);
    (limited(lux), doubt, cosine_condition.max(1.0) + lobe_condition.max(1.0))
}
