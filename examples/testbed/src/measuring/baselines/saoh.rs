//! The binary build that both published trees share: the surface area orientation heuristic with 12
//! buckets.
//!
//! Source: Pharr, Jakob and Humphreys, Physically Based Rendering (4th edition), 12.6.3, after
//! Conty Estevez and Kulla (2018), 4.4. Differs: where no split has a cost above 0 (a street of
//! lamps in one line has boxes without area), the lights are halved along their longest axis
//! instead of in their order, which can only help the baseline.

use super::bounds::LightBounds;
use girandole::cluster::Aabb;
use girandole::glam::Vec3;
use std::f32::consts::PI;

const BUCKETS: usize = 12;

/// Set in [`BuiltNode::target`] of a leaf, together with the index of its light.
pub const LEAF: u32 = 1 << 31;

/// A node. The first child of an inner node is the next node.
pub struct BuiltNode {
    pub bounds: LightBounds,
    /// The index of the second child, or [`LEAF`] and the index of a light.
    pub target: u32,
}

/// Builds a tree over lights whose power is above 0.
pub fn build(lights: &mut [(u32, LightBounds)]) -> Vec<BuiltNode> {
    let mut nodes = Vec::with_capacity(2 * lights.len());
    if !lights.is_empty() {
        build_below(lights, &mut nodes);
    }
    nodes
}

fn build_below(lights: &mut [(u32, LightBounds)], nodes: &mut Vec<BuiltNode>) {
    let own = nodes.len();
    if let [(light, bounds)] = lights {
        nodes.push(BuiltNode { bounds: *bounds, target: LEAF | *light });
        return;
    }
    let bounds = lights[1..].iter().fold(lights[0].1, |all, (_, light)| all.union(light));
    let middle = split(lights, &bounds.aabb.into());
    nodes.push(BuiltNode { bounds, target: 0 });
    let (first, second) = lights.split_at_mut(middle);
    build_below(first, nodes);
    nodes[own].target = nodes.len() as u32;
    build_below(second, nodes);
}

/// Sorts the lights into two groups and returns the start of the second.
fn split(lights: &mut [(u32, LightBounds)], aabb: &Aabb) -> usize {
    let centers = Aabb::around(lights.iter().map(|(_, light)| light.aabb.center()));
    let bucket = |light: &LightBounds, axis: usize| {
        let along = (light.aabb.center()[axis] - centers.min[axis]) / centers.extent()[axis];
        ((along * BUCKETS as f32) as usize).min(BUCKETS - 1)
    };
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in (0..3).filter(|axis| centers.extent()[*axis] > 0.0) {
        let mut buckets = [None; BUCKETS];
        for (_, light) in lights.iter() {
            let bucket = &mut buckets[bucket(light, axis)];
            *bucket = join(*bucket, Some(*light));
        }
        let stretch = aabb.extent().max_element() / aabb.extent()[axis];
        for last in 0..BUCKETS - 1 {
            let below = buckets[..=last].iter().copied().fold(None, join);
            let above = buckets[last + 1..].iter().copied().fold(None, join);
            let cost = stretch * (below.map_or(0.0, measure) + above.map_or(0.0, measure));
            if cost > 0.0 && best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, axis, last));
            }
        }
    }
    if let Some((_, axis, last)) = best {
        lights.sort_by_key(|(_, light)| bucket(light, axis) > last);
        let middle = lights.partition_point(|(_, light)| bucket(light, axis) <= last);
        if middle > 0 && middle < lights.len() {
            return middle;
        }
    }
    let extent = centers.extent();
    let axis = (0..3).max_by(|a, b| extent[*a].total_cmp(&extent[*b])).unwrap_or(0);
    let middle = lights.len() / 2;
    lights.select_nth_unstable_by(middle, |(i, a), (j, b)| {
        a.aabb.center()[axis].total_cmp(&b.aabb.center()[axis]).then(i.cmp(j))
    });
    middle
}

fn join(a: Option<LightBounds>, b: Option<LightBounds>) -> Option<LightBounds> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.union(&b)),
        (a, b) => a.or(b),
    }
}

/// The power times the orientation measure times the surface area.
pub(super) fn measure(bounds: LightBounds) -> f32 {
    let LightBounds { theta_o, theta_e, .. } = bounds;
    let theta_w = (theta_o + theta_e).min(PI);
    let (sin_o, cos_o) = theta_o.sin_cos();
    let ring = 2.0 * theta_w * sin_o - (theta_o - 2.0 * theta_w).cos() - 2.0 * theta_o * sin_o + cos_o;
    let orientation = 2.0 * PI * (1.0 - cos_o) + 0.5 * PI * ring;
    let Vec3 { x, y, z } = bounds.aabb.extent();
    bounds.power * orientation * 2.0 * (x * y + y * z + z * x)
}
