//! The four attributes of SS that tell how far a refitted tree has drifted from a good one.
//!
//! SS names them and gives no formulas; ours are in `docs/math.md`. Each is a sum over nodes, weighted by the node's
//! share of the flux, of a ratio without units: moving, scaling or dimming the whole object changes none of them.

use super::build::cluster_cost;
use super::node::Node;
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

/// One node's part of each sum, still in metres and lumens: in f64, since a flux squared times an area leaves f32.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Terms {
    /// Flux times root mean square distance of the children's means from the node's.
    distance: f64,
    /// Flux times overlapping fraction; without units already.
    overlap: f64,
    /// Flux times variance of position.
    variance: f64,
    /// Summed cost of the children.
    cost: f64,
}

impl Terms {
    /// The part of one node whose children are up to date; `all` is the node's own cluster.
    pub(super) fn of(node: &Node, all: &Cluster) -> Self {
        if all.flux <= 0.0 {
            return Self::default();
        }
        let mut spread = 0.0;
        let mut within = 0.0;
        let mut cost = 0.0;
        let mut shared = 0.0;
        for (i, child) in node.used().iter().enumerate().filter(|(_, c)| c.flux > 0.0) {
            let cluster = child.cluster();
            spread += f64::from(child.flux) * (cluster.mean - all.mean).as_dvec3().length_squared();
            within += f64::from(child.flux) * f64::from(child.variance);
            cost += cluster_cost(&cluster);
            for other in node.used()[..i].iter().filter(|c| c.flux > 0.0) {
                shared += f64::from(cluster.aabb.intersection(&other.cluster().aabb).half_perimeter());
            }
        }
        let size = f64::from(all.aabb.half_perimeter());
        let flux = f64::from(all.flux);
        Self {
            distance: (spread * flux).sqrt(),
            overlap: if size > 0.0 { flux * shared / size } else { 0.0 },
            variance: spread + within,
            cost,
        }
    }
}

/// Sums the nodes' parts, in their order, and makes them free of units by the root's flux and size.
pub(super) fn sum(terms: &[Terms], root: &Cluster) -> Attributes {
    let diagonal = root.aabb.extent().as_dvec3().length();
    let flux = f64::from(root.flux);
    let root_cost = cluster_cost(root);
    let total = |part: fn(&Terms) -> f64| terms.iter().map(part).sum::<f64>();
    let ratio = |sum: f64, unit: f64| if unit > 0.0 { (sum / unit) as f32 } else { 0.0 };
    Attributes {
        distance: ratio(total(|t| t.distance), flux * diagonal),
        overlap: ratio(total(|t| t.overlap), flux),
        variance: ratio(total(|t| t.variance), flux * diagonal * diagonal),
        splitting_cost: ratio(total(|t| t.cost), root_cost),
    }
}
