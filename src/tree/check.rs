//! Proves that a tree keeps its promises; every tree test calls it after every step.

use super::node::{EMPTY_SLOT, NO_PARENT, Node, UNLIMITED_RANGE, WIDTH};
use super::{LightTree, Target};
use crate::cluster::{Cluster, MAX_FLUX};
use crate::cone::angle;
use crate::light::MIN_FLUX;

/// Sums of up to 2^31 f32 terms over a tree of depth 11 and more round: each level adds at most 3 roundings.
const FLUX_TOLERANCE: f32 = 1.0e-5;

/// A packed flux has 8 bits.
const PACKED_FLUX_TOLERANCE: f32 = 1.0 / 256.0;

/// What [`LightTree::check`] found broken, and where.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("node {node}, slot {slot}: {what}")]
pub struct CheckError {
    /// The node.
    pub node: usize,
    /// Its child.
    pub slot: usize,
    /// Which promise.
    pub what: &'static str,
}

impl LightTree {
    /// Proves containment of boxes, cover of caps, sums of flux, ranges, links up and down, and one leaf per light.
    ///
    /// # Errors
    /// The first broken promise. A correct library never returns one; this is for tests and for suspicious minds. O(n).
    pub fn check(&self) -> Result<(), CheckError> {
        if self.is_frozen() {
            let thawed = self.thawed();
            let differs = |(node, (now, then)): (usize, (&Node, &Node))| (now != then).then_some(node);
            return match self.nodes.iter().zip(&thawed.nodes).enumerate().find_map(differs) {
                Some(node) => Err(CheckError { node, slot: 0, what: "not what its lights make" }),
                None => thawed.check(),
            };
        }
        let mut seen = vec![false; self.lights.len()];
        let mut reached = usize::from(!self.nodes.is_empty());
        let mut spares = 0;
        for (node, record) in self.nodes.iter().enumerate() {
            let fail = |slot, what| Err(CheckError { node, slot, what });
            if self.spans[node] == 0 {
                // Left over by the rebuild of a subtree.
                spares += 1;
                if record.count() != 0 {
                    return fail(0, "a spare node has children");
                }
                continue;
            }
            if (node == 0) != (record.parent == NO_PARENT) {
                return fail(0, "only the root has no parent");
            }
            if record.count() == 0 || record.count() > WIDTH {
                return fail(0, "count is outside 1 to 8");
            }
            let end = node + self.spans[node] as usize;
            for slot in record.count()..WIDTH {
                if record.targets[slot] != EMPTY_SLOT || record.flux[slot] != 0 || self.wide[node].flux[slot] != 0.0 {
                    return fail(slot, "an unused slot is not empty");
                }
            }
            for slot in 0..record.count() {
                let place = (node * WIDTH + slot) as u32;
                let exact = self.wide[node].get(slot);
                match record.target(slot) {
                    None => return fail(slot, "a used slot is empty"),
                    Some(Target::Leaf(light)) => {
                        let Some(seen) = seen.get_mut(light as usize) else { return fail(slot, "no such light") };
                        if std::mem::replace(seen, true) {
                            return fail(slot, "the light has two leaves");
                        }
                        if self.leaves[light as usize] != place {
                            return fail(slot, "the light's way up leads elsewhere");
                        }
                        if exact != self.lights[light as usize].cluster() {
                            return fail(slot, "the cluster is not the light's");
                        }
                    }
                    Some(Target::Node(below)) => {
                        reached += 1;
                        let below = below as usize;
                        let Some(lower) = self.nodes.get(below) else { return fail(slot, "no such node") };
                        if below <= node || below + self.spans[below] as usize > end {
                            return fail(slot, "a subtree does not lie within its parent's");
                        }
                        if lower.parent != place {
                            return fail(slot, "the node's way up leads elsewhere");
                        }
                        let children = (0..lower.count()).map(|slot| self.wide[below].get(slot));
                        merges(&exact, children).map_or(Ok(()), |what| fail(slot, what))?;
                    }
                }
                covers(&record.cluster(slot), &exact).map_or(Ok(()), |what| fail(slot, what))?;
            }
        }
        let end = |what| Err(CheckError { node: self.nodes.len(), slot: 0, what });
        if reached + spares != self.nodes.len() {
            return end("a node cannot be reached");
        }
        if seen.contains(&false) {
            return end("a light has no leaf");
        }
        let total =
            self.lights.iter().map(|light| f64::from(light.cluster().flux)).sum::<f64>().min(f64::from(MAX_FLUX));
        let floors = f64::from(MIN_FLUX) * self.lights.len() as f64;
        if (total - f64::from(self.cluster().flux)).abs() > total * f64::from(FLUX_TOLERANCE) + floors {
            return end("the flux is not the sum of the lights'");
        }
        Ok(())
    }
}

/// Why `outer` is not what its children make, if so.
fn merges(outer: &Cluster, children: impl Iterator<Item = Cluster>) -> Option<&'static str> {
    let mut sum = 0.0;
    for child in children {
        sum += f64::from(child.flux);
        if let Some(what) = covers(outer, &child) {
            return Some(what);
        }
    }
    let sum = sum.min(f64::from(MAX_FLUX));
    ((f64::from(outer.flux) - sum).abs() > sum * f64::from(FLUX_TOLERANCE)).then_some("the flux is not the sum")
}

/// Why a cluster does not cover another, if so.
fn covers(outer: &Cluster, inner: &Cluster) -> Option<&'static str> {
    if inner.flux <= 0.0 {
        return None;
    }
    if outer.flux <= 0.0 {
        return Some("a shining light in a dark cluster");
    }
    if outer.flux < inner.flux * (1.0 - PACKED_FLUX_TOLERANCE) {
        return Some("less flux than one of its children");
    }
    if !outer.aabb.contains(&inner.aabb) {
        return Some("the box does not contain what is below");
    }
    let half_angle = |c: &Cluster| f64::from(c.cos_half_angle.clamp(-1.0, 1.0)).acos();
    let turn = || f64::from(angle(outer.axis.normalize(), inner.axis.normalize()));
    // A cap about no direction is none: the angle is NaN then and covers nothing.
    let is_within = || inner.cos_half_angle > -1.0 && turn() + half_angle(inner) <= half_angle(outer);
    if outer.cos_half_angle > -1.0 && !is_within() {
        return Some("the cap does not cover what is below");
    }
    if outer.range < inner.range.min(UNLIMITED_RANGE) {
        return Some("the range is shorter than below");
    }
    let finite = [outer.flux, outer.variance].into_iter().chain(outer.mean.to_array()).chain(outer.axis.to_array());
    if finite.into_iter().any(|v| !v.is_finite()) || outer.variance < 0.0 {
        return Some("a moment is not finite");
    }
    None
}
