//! The four attributes of SS that tell how far a refitted tree has drifted from a good one.
//!
//! SS names them and gives no formulas; ours are in `docs/math.md`. Each is a sum over nodes, weighted by the node's
//! share of the flux, of a ratio without units: moving, scaling or dimming the whole object changes none of them.

use super::cost::{orientation, size};
use super::node::WIDTH;
use super::wide::{Lanes, Merged, WideCluster, sum};
use crate::cluster::Cluster;

/// Names one of the four attributes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Attribute {
    /// How far a node's children lie apart.
    Distance,
    /// How much the boxes of a node's children coincide.
    Overlap,
    /// How widely a node's lights are spread.
    Variance,
    /// The build's own cost, summed over the tree.
    SplittingCost,
}

/// The four attributes of a tree; all 0 for a tree of at most one light and for a dark tree. Smaller is better.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
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
    /// One of the four.
    pub fn get(&self, attribute: Attribute) -> f32 {
        match attribute {
            Attribute::Distance => self.distance,
            Attribute::Overlap => self.overlap,
            Attribute::Variance => self.variance,
            Attribute::SplittingCost => self.splitting_cost,
        }
    }
}

/// A subtree's part of each sum, still in metres and lumens: in f64, since a flux times an area leaves f32.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Terms {
    /// Flux times root mean square distance of the children's means from the node's.
    distance: f64,
    /// Flux times overlapping fraction.
    overlap: f64,
    /// Flux times variance of position.
    variance: f64,
    /// Summed cost of the children.
    cost: f64,
}

impl Terms {
    /// The part of one node.
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

    /// The splitting cost of a subtree relative to its lights' flux and variance of position; 0 if there is none. These
    /// belong to the lights alone: a box would grow with what is wrong, or with lights that only turn.
    pub(super) fn cost_per_spread(&self, all: &Cluster) -> f32 {
        let spread = f64::from(all.flux) * f64::from(all.variance);
        if spread > 0.0 { (self.cost / spread) as f32 } else { 0.0 }
    }

    /// The part of the splitting cost that a rise by `loss` has added: all of it if that is infinite, from nothing.
    pub(super) fn cost_share(&self, loss: f32) -> f64 {
        self.cost * (1.0 - 1.0 / (1.0 + f64::from(loss)))
    }

    /// Free of units, by flux and size of the cluster of all.
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

/// Edge lengths of the boxes, 0 for dark lanes.
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

/// Half perimeters of the intersections of all pairs of boxes, summed.
#[inline(always)]
fn overlap(wide: &WideCluster) -> f32 {
    // Half of the lanes once more behind the last, so that the partners of all lanes lie in one piece.
    let mut again = [[[0.0; WIDTH + WIDTH / 2]; 3]; 2];
    for k in 0..3 {
        for (corner, lanes) in [&wide.min[k], &wide.max[k]].into_iter().enumerate() {
            again[corner][k][..WIDTH].copy_from_slice(lanes);
            again[corner][k][WIDTH..].copy_from_slice(&lanes[..WIDTH / 2]);
        }
    }
    let mut shared = [0.0; WIDTH];
    // Lane i with lane i + turn: all pairs once, and those half a turn apart twice.
    for turn in 1..=WIDTH / 2 {
        let weight = if turn == WIDTH / 2 { 0.5 } else { 1.0 };
        for i in 0..WIDTH {
            let mut edges = 0.0;
            let mut least = f32::INFINITY;
            for k in 0..3 {
                let (a, b) = (wide.min[k][i], again[0][k][i + turn]);
                let min = if a > b { a } else { b };
                let (a, b) = (wide.max[k][i], again[1][k][i + turn]);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cost_that_rose_from_nothing_has_been_added_whole() {
        let terms = Terms { cost: 8.0, ..Terms::default() };
        assert_eq!([0.0, 1.0, f32::INFINITY].map(|loss| terms.cost_share(loss)), [0.0, 4.0, 8.0]);
    }
}
