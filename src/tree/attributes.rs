//! The four attributes of SS, which measure how much a tree has degraded over refits.
//!
//! SS names them without formulas; ours are in `docs/math.md`. Each is a sum over nodes of a ratio
//! without units, weighted by the node's share of the flux. So moving, scaling or dimming the whole
//! object changes none of them.

use bytemuck::{Pod, Zeroable};

use super::cost::{orientation, size};
use super::node::WIDTH;
use super::wide::{Lanes, Merged, WideCluster, sum};
use crate::cluster::Cluster;

/// Names one of the four attributes of SS. `docs/math.md` has the formulas.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Attribute {
    /// How far apart the children of a node are.
    Distance,
    /// How much the boxes of a node's children overlap.
    Overlap,
    /// How widely the lights of a node are spread.
    Variance,
    /// The cost that builds minimise, summed over the tree.
    SplittingCost,
}

/// The four attributes of a tree after SS. They have no unit, and smaller is better. All are 0 for
/// a tree of at most one light and for a dark tree.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Attributes {
    /// See [`Attribute::Distance`].
    pub distance: f32,
    /// See [`Attribute::Overlap`].
    pub overlap: f32,
    /// See [`Attribute::Variance`].
    pub variance: f32,
    /// See [`Attribute::SplittingCost`].
    pub splitting_cost: f32,
}

impl Attributes {
    /// The value of one attribute.
    pub fn get(&self, attribute: Attribute) -> f32 {
        match attribute {
            Attribute::Distance => self.distance,
            Attribute::Overlap => self.overlap,
            Attribute::Variance => self.variance,
            Attribute::SplittingCost => self.splitting_cost,
        }
    }
}

/// How well a tree groups its lights, now and when it was built.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Quality {
    pub attributes: Attributes,
    /// The splitting cost relative to the spread of the lights, when the tree was built.
    pub built_cost: f32,
    /// The same as of the last refit with attributes; `built_cost` in a frozen tree.
    pub cost: f32,
    /// The attributes, and some of the sums for them, are older than the nodes.
    pub is_stale: bool,
}

/// A subtree's part of the sum of each attribute, in metres and lumens. In f64, because a flux
/// times an area can exceed f32.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct AttributeSums {
    /// Flux times the root mean square distance of the children's mean positions from the node's.
    distance: f64,
    /// Flux times the fraction of the box that overlaps.
    overlap: f64,
    /// Flux times the variance of position.
    variance: f64,
    /// The costs of the children.
    cost: f64,
}

impl AttributeSums {
    /// The part of one node, with the lanes merged as `all`.
    #[inline(always)]
    pub(super) fn of(wide: &WideCluster, all: &Merged) -> Self {
        let flux = all.cluster.flux;
        if flux <= 0.0 {
            return Self::default();
        }
        let per_flux = 1.0 / flux;
        let edges = edges(wide);
        let mut costs = [0.0; WIDTH];
        for i in 0..WIDTH {
            let [x, y, z] = [wide.axis[0][i], wide.axis[1][i], wide.axis[2][i]];
            let length = (x * x + y * y + z * z).sqrt();
            costs[i] = wide.flux[i] * per_flux * size([edges[0][i], edges[1][i], edges[2][i]]) * orientation(length);
        }
        let perimeter = all.cluster.aabb.half_perimeter();
        let overlap = if perimeter > 0.0 { overlap(wide) / perimeter } else { 0.0 };
        let flux = f64::from(flux);
        Self {
            distance: flux * f64::from(all.between.sqrt()),
            overlap: flux * f64::from(overlap),
            variance: flux * f64::from(all.cluster.variance),
            cost: flux * f64::from(sum(&costs)),
        }
    }

    #[inline(always)]
    pub(super) fn add(&mut self, other: &Self) {
        self.distance += other.distance;
        self.overlap += other.overlap;
        self.variance += other.variance;
        self.cost += other.cost;
    }

    /// The splitting cost of a tree relative to its flux times its variance of position. 0 for a
    /// dark tree and for lights at one point.
    ///
    /// Flux and variance depend on the lights alone. A box would also grow as the tree degrades,
    /// or as lights only rotate.
    pub(super) fn cost_per_spread(&self, all: &Cluster) -> f32 {
        let spread = f64::from(all.flux) * f64::from(all.variance);
        if spread > 0.0 { (self.cost / spread) as f32 } else { 0.0 }
    }

    /// The attributes: the sums divided by the flux and size of the whole tree's cluster.
    pub(super) fn relative_to(&self, all: &Cluster) -> Attributes {
        let diagonal = all.aabb.extent().as_dvec3().length();
        let flux = f64::from(all.flux);
        let cost = flux * f64::from(size(all.aabb.extent().to_array()) * orientation(all.axis.length()));
        let ratio = |sum: f64, unit: f64| if unit > 0.0 { (sum / unit) as f32 } else { 0.0 };
        Attributes {
            distance: ratio(self.distance, flux * diagonal),
            overlap: ratio(self.overlap, flux),
            variance: ratio(self.variance, flux * diagonal * diagonal),
            splitting_cost: ratio(self.cost, cost),
        }
    }
}

/// The edge lengths of all lanes' boxes. 0 for dark lanes.
#[inline(always)]
fn edges(wide: &WideCluster) -> [Lanes; 3] {
    let mut edges = [[0.0; WIDTH]; 3];
    for k in 0..3 {
        for i in 0..WIDTH {
            let edge = wide.max[k][i] - wide.min[k][i];
            edges[k][i] = if edge > 0.0 { edge } else { 0.0 };
        }
    }
    edges
}

/// The half perimeters of the intersections of all pairs of boxes, summed.
#[inline(always)]
fn overlap(wide: &WideCluster) -> f32 {
    // Repeat half of the lanes after the last, so that the partners of all lanes are contiguous.
    let mut repeated = [[[0.0; WIDTH + WIDTH / 2]; 3]; 2];
    for k in 0..3 {
        for (corner, lanes) in [&wide.min[k], &wide.max[k]].into_iter().enumerate() {
            repeated[corner][k][..WIDTH].copy_from_slice(lanes);
            repeated[corner][k][WIDTH..].copy_from_slice(&lanes[..WIDTH / 2]);
        }
    }
    let mut shared = [0.0; WIDTH];
    // Pair lane i with lane i + offset. Pairs that are half the lanes apart occur twice.
    for offset in 1..=WIDTH / 2 {
        let weight = if offset == WIDTH / 2 { 0.5 } else { 1.0 };
        for i in 0..WIDTH {
            let mut edges = 0.0;
            let mut least = f32::INFINITY;
            for k in 0..3 {
                let (a, b) = (wide.min[k][i], repeated[0][k][i + offset]);
                let min = if a > b { a } else { b };
                let (a, b) = (wide.max[k][i], repeated[1][k][i + offset]);
                let max = if a < b { a } else { b };
                let edge = max - min;
                edges += edge;
                least = if edge < least { edge } else { least };
            }
            shared[i] += if least >= 0.0 { weight * edges } else { 0.0 };
        }
    }
    sum(&shared)
}
