//! What the importance for a point and that for a segment share (docs/math.md, Importance).

use super::place::View;
use girandole::tree::Node;

/// What a choice needs to know about a child.
#[derive(Clone, Copy, Debug)]
pub struct Importance {
    /// In lux. 0 if the child is proved dark.
    pub lux: f64,
    pub doubt: f64,
    pub is_unresolved: bool,
    /// How much the result magnifies the rounding of its terms: sums of positive terms over
    /// differences of them. At least 1.
    pub condition: f64,
    /// The distance of the box, softened as in the doubt.
    pub gap: f64,
    /// Whether a decision, such as that the child is dark, is so close that rounding may turn it.
    pub is_close: bool,
}

/// The margin for positions in a node.
pub fn margin(node: &Node, view: &View) -> f64 {
    let reach = |k: usize| {
        let exponent = (node.steps >> (8 * k) & 0xff) as i32 - 127;
        let step = if exponent > -127 { 2.0_f64.powi(exponent) } else { 0.0 };
        f64::from(node.origin[k]).abs() + 255.0 * step
    };
    let scale = view.map.map_or(1.0, |map| map.mean_square().sqrt());
    (scale * (reach(0) + reach(1) + reach(2)) + view.position.abs().element_sum()) * view.margin
}

/// The doubt about a cluster at a squared distance, with a variance and the distance of its box.
pub fn estimated_doubt(dist_sq: f64, variance: f64, gap: f64) -> f64 {
    let softened = dist_sq + 0.5 * variance;
    variance / (dist_sq + variance) * softened / (gap * gap + variance / 50.0).max(1.0e-6 * softened)
}

/// An importance within its limits.
pub fn limited(lux: f64) -> f64 {
    lux.clamp(1.0e-30, 1.0e36)
}

/// The lobe of emission for a length of the mean direction, a cosine between the axis and the
/// direction to a place, and an angular size; and how it magnifies rounding.
pub fn lobe(length: f64, facing: f64, spread: f64) -> (f64, f64) {
    let length = length.min(0.999);
    let m = 0.9 * (1.5 * length).min(1.0) * (1.0 - spread);
    let c0 = (3.0 * length - 2.0).max(0.0);
    let w = 1.0 - c0;
    let h = facing - c0;
    let root = (h * h + 0.06 * spread + 0.002 * w * w).sqrt();
    let lobe = (1.0 - m) + 2.0 * m * (h + root) / (w * w);
    // The start and the width of the lobe are differences as well.
    (lobe, (1.0 + 2.0 * m * (1.0 + c0 + root) / (w * w)) / lobe + 2.0 / w)
}
