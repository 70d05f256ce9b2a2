//! How much light a cluster probably sends to a receiver, as seen from its moments; zero only where its bounds prove it.
//!
//! Twin of `shaders/importance.wgsl`; `tests/all/gpu.rs` runs both on the same inputs. Starts from CK18 5.1 and
//! pbrt-v4's light bounds. Differs: flux-weighted mean and variance of position in place of the box's centre, a smooth
//! cosine at the receiver, one smooth lobe about the mean direction of emission (docs/math.md).

use glam::Vec3;

use crate::light::LAMBERTIAN;
use crate::tree::{Child, FARTHEST, unpack_direction};

/// Where light arrives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Receiver {
    /// Metres, relative to the world's origin (or in a tree's own space).
    pub position: Vec3,
    /// Unit normal of the side that light arrives at; zero for a point in a volume, which light reaches from all sides.
    pub normal: Vec3,
}

impl Receiver {
    /// A point on a surface; `normal` on the side that is looked at.
    pub fn surface(position: Vec3, normal: Vec3) -> Self {
        Self { position, normal }
    }

    /// A point in a volume.
    pub fn volume(position: Vec3) -> Self {
        Self { position, normal: Vec3::ZERO }
    }
}

/// A receiver in the space of the nodes that are walked, and what that space does to bounds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View {
    pub position: Vec3,
    /// Unit, or zero.
    pub normal: Vec3,
    /// Metres of this space per metre of the world, at most: ranges are metres of the world.
    pub range_scale: f32,
    /// What rounding of positions may add up to, per metre of coordinates: more where the space is squeezed.
    pub margin: f32,
    /// False where the space is sheared or scaled unevenly, so that angles and cones mean nothing.
    pub keeps_angles: bool,
}

impl View {
    /// The view of a receiver in the nodes' own space.
    pub fn of(receiver: &Receiver) -> Self {
        Self {
            position: receiver.position,
            // A normal too short to have a direction proves nothing.
            normal: receiver.normal.normalize_or_zero(),
            range_scale: 1.0,
            margin: POSITION_MARGIN,
            keeps_angles: true,
        }
    }
}

/// Share of the variance of position that is added to the squared distance.
pub(crate) const VARIANCE_SHARE: f32 = 0.4;
/// Width of the smooth cosine at the receiver, per unit of the cluster's angular size.
pub(crate) const COSINE_WIDTH: f32 = 0.9;
/// Least cosine: what the bounds cannot exclude keeps a chance.
pub(crate) const FLOOR: f32 = 1.0e-3;
/// The most that goes along the lobe: measured in docs/decisions.md, 5.
pub(crate) const LOBE_SHARE: f32 = 0.9;
/// Clusters whose mean direction is longer than this have a lobe this narrow: exponent 2 r / (1 - r) = 1998.
pub(crate) const LONGEST_LOBE: f32 = 0.999;
/// Importances stay inside this span, so that a sum of eight is finite and positive whatever the scene's units.
pub(crate) const LEAST: f32 = 1.0e-30;
/// See [`LEAST`].
pub(crate) const MOST: f32 = 1.0e36;
/// Rounding of positions, relative to the sum of all coordinates that are added and turned: each transform, at either
/// end, loses at most 3e-7 of the largest. Not of the coordinate at hand: turns mix all three.
pub(crate) const POSITION_MARGIN: f32 = 1.0e-6;
/// Metres beyond which squares leave f32, and prove nothing: far receivers seen from small instances get there.
pub(crate) const LONGEST: f32 = 1.0e19;
/// Rounding of cosines between unpacked axes and normalised directions, and what a similarity may be off by.
pub(crate) const COSINE_MARGIN: f32 = 1.0e-4;

/// Estimated illuminance in lux that a cluster causes at a receiver; 0 only if box, cone or range prove that it is 0.
pub(crate) fn importance(child: &Child, view: &View) -> f32 {
    if child.flux <= 0.0 || provably_dark(child, view) {
        return 0.0;
    }
    let toward = Vec3::from(child.mean) - view.position;
    let dist_sq = toward.length_squared();
    let spread = child.variance / (dist_sq + child.variance).max(f32::MIN_POSITIVE);
    let direction = if dist_sq > 0.0 { toward / dist_sq.sqrt() } else { Vec3::ZERO };

    let mut cosine = 1.0;
    if view.normal != Vec3::ZERO {
        // A hyperbola that follows max(cos, 0) and is rounded off as wide as the cluster is seen.
        let cos = view.normal.dot(direction);
        let width = COSINE_WIDTH * COSINE_WIDTH * spread;
        cosine = (0.5 * (cos + (cos * cos + width).sqrt())).max(FLOOR);
    }

    // A share of the light goes along a lobe ((1 + cos) / 2)^n about the mean direction, with n = 4 (whose mean cosine
    // is that of one Lambertian emitter, n / (n + 2)) or more for beams, the rest to all sides: emitters
    // that disagree, or are seen from nearby, are no broad lobe but a mixture, whose back must not be starved.
    let length = child.lobe_length().min(LONGEST_LOBE);
    let share = LOBE_SHARE * (length / LAMBERTIAN).min(1.0) * (1.0 - spread);
    let cos = -unpack_direction(child.lobe_axis).dot(direction);
    let half = (0.5 + 0.5 * cos).clamp(1.0e-6, 1.0);
    // The usual exponent needs no power function, which took a tenth of the time.
    let peak = if length > LAMBERTIAN {
        let exponent = 2.0 * length / (1.0 - length);
        (exponent + 1.0) * half.powf(exponent)
    } else {
        5.0 * (half * half) * (half * half)
    };
    let lobe = 1.0 - share + share * peak;

    let solid_angle = 4.0 * std::f32::consts::PI;
    let lux = child.flux * lobe * cosine / (solid_angle * (dist_sq + VARIANCE_SHARE * child.variance).max(LEAST));
    clamp_lux(lux)
}

/// NaN, which only a receiver that is no place can cause, becomes the least: `clamp` would keep it.
#[allow(clippy::manual_clamp, reason = "not the same for NaN")]
fn clamp_lux(lux: f32) -> f32 {
    lux.max(LEAST).min(MOST)
}

/// Whether the bounds prove that no light below reaches the receiver.
fn provably_dark(child: &Child, view: &View) -> bool {
    let (min, max) = (Vec3::from(child.box_min), Vec3::from(child.box_max));
    let half = 0.5 * (max - min);
    let center = min + half - view.position;
    let margin = (min.abs() + max.abs() + view.position.abs()).element_sum() * view.margin;

    // Everything below the horizon.
    let highest = view.normal.dot(center) + view.normal.abs().dot(half);
    if highest + view.normal.abs().element_sum() * margin <= 0.0 && view.normal != Vec3::ZERO {
        return true;
    }

    // Everything out of range.
    let outside = (center.abs() - half - margin).max(Vec3::ZERO);
    let (gap, reach) = (outside.length(), child.range * view.range_scale * (1.0 + COSINE_MARGIN));
    if child.range < FARTHEST && gap > reach && gap <= LONGEST {
        return true;
    }

    // Everything turned away: the angle to the cone's axis, less what the box's sphere covers, beyond the cone.
    let cos_half_angle = child.cos_half_angle();
    if !view.keeps_angles || cos_half_angle <= -1.0 {
        return false;
    }
    let radius = half.length() * (1.0 + COSINE_MARGIN) + margin;
    let distance = center.length();
    if distance <= radius || distance > LONGEST {
        return false;
    }
    let cos_axis = -unpack_direction(child.cone_axis).dot(center) / distance;
    let sin_box = radius / distance;
    let cos_box = (1.0 - sin_box * sin_box).max(0.0).sqrt();
    if cos_axis >= cos_box {
        return false;
    }
    let sin_axis = (1.0 - cos_axis * cos_axis).max(0.0).sqrt();
    let cos_nearest = cos_axis * cos_box + sin_axis * sin_box;
    cos_nearest + COSINE_MARGIN < cos_half_angle
}
