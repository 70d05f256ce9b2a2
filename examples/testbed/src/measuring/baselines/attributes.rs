//! The four attributes of [SS] on a binary tree: the formulas of docs/math.md with two children a
//! node.
//!
//! [SS] is Sosnowski and Szajerman, BVH Trees of Many Dynamic Lights for Real-Time Ray Tracing. The
//! splitting cost is that of the build of these trees (`saoh`). Differs from docs/math.md: a light
//! counts as a point at the centre of its box, so a leaf has no variance.

use super::bounds::LightBounds;
use super::saoh::{LEAF, measure};
use girandole::Attributes;
use girandole::cluster::Aabb;
use girandole::glam::DVec3;

/// The power of a group of lights, and where it is.
#[derive(Clone, Copy)]
struct Moments {
    power: f64,
    mean: DVec3,
    /// The variance of position, weighted by power, in square metres.
    variance: f64,
}

/// The sums over all inner nodes, in the units of the power and in metres.
#[derive(Clone, Copy, Default)]
struct Sums {
    distance: f64,
    overlap: f64,
    variance: f64,
    cost: f64,
}

/// The attributes of a tree, from the target and the bounds of each node, parents before children.
/// All are 0 for a tree of one light and for a dark tree.
pub fn attributes(
    targets: impl DoubleEndedIterator<Item = u32> + ExactSizeIterator,
    bounds: &[LightBounds],
) -> Attributes {
    let mut moments = vec![Moments { power: 0.0, mean: DVec3::ZERO, variance: 0.0 }; bounds.len()];
    let mut sums = Sums::default();
    for (node, target) in targets.enumerate().rev() {
        let own = &bounds[node];
        if target & LEAF != 0 {
            let mean = own.aabb.center().as_dvec3();
            moments[node] = Moments { power: f64::from(own.power), mean, variance: 0.0 };
            continue;
        }
        let [a, b] = [node + 1, target as usize];
        let between;
        (moments[node], between) = merge(moments[a], moments[b]);
        let power = moments[node].power;
        let length = Aabb::from(own.aabb).half_perimeter();
        sums.distance += power * between.sqrt();
        sums.variance += power * moments[node].variance;
        sums.cost += f64::from(measure(bounds[a])) + f64::from(measure(bounds[b]));
        if length > 0.0 {
            let shared = Aabb::from(bounds[a].aabb).intersection(&bounds[b].aabb.into());
            let shared = if shared.is_empty() { 0.0 } else { shared.half_perimeter() };
            sums.overlap += power * f64::from(shared / length);
        }
    }
    let Some((root, power)) = bounds.first().zip(moments.first().map(|moments| moments.power)) else {
        return Attributes::default();
    };
    let diagonal = root.aabb.extent().as_dvec3().length();
    let ratio = |sum: f64, unit: f64| if unit > 0.0 { (sum / unit) as f32 } else { 0.0 };
    Attributes {
        distance: ratio(sums.distance, power * diagonal),
        overlap: ratio(sums.overlap, power),
        variance: ratio(sums.variance, power * diagonal * diagonal),
        splitting_cost: ratio(sums.cost, f64::from(measure(*root))),
    }
}

/// The moments of both groups together, and the mean squared distance of the groups' means from the
/// common mean.
fn merge(a: Moments, b: Moments) -> (Moments, f64) {
    let power = a.power + b.power;
    if power <= 0.0 {
        return (Moments { power: 0.0, mean: 0.5 * (a.mean + b.mean), variance: 0.0 }, 0.0);
    }
    let [share_a, share_b] = [a.power / power, b.power / power];
    let mean = a.mean * share_a + b.mean * share_b;
    let between = share_a * a.mean.distance_squared(mean) + share_b * b.mean.distance_squared(mean);
    let variance = share_a * a.variance + share_b * b.variance + between;
    (Moments { power, mean, variance }, between)
}
