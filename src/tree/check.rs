//! Proves that a tree keeps its promises; every tree test calls it after every step.

use super::node::{EMPTY_SLOT, FARTHEST, NO_PARENT, Node, WIDTH};
use super::{Child, LightTree, Target};
use crate::cluster::{Cluster, MOST_FLUX};
use crate::cone::angle;
use crate::light::MIN_FLUX;

/// Sums of up to 2^31 f32 terms over a tree of depth 11 and more round: each level adds at most 8 roundings.
const FLUX_TOLERANCE: f32 = 1.0e-5;

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
    /// Proves containment of boxes, cover of cones, sums of flux, ranges, links up and down, and one leaf per light.
    ///
    /// # Errors
    /// The first broken promise. A correct library never returns one; this is for tests and for suspicious minds. O(n).
    pub fn check(&self) -> Result<(), CheckError> {
        let mut seen = vec![false; self.lights.len()];
        let mut reached = usize::from(!self.nodes.is_empty());
        for (node, record) in self.nodes.iter().enumerate() {
            let fail = |slot, what| Err(CheckError { node, slot, what });
            if (node == 0) != (record.parent == NO_PARENT) {
                return fail(0, "only the root has no parent");
            }
            if record.count == 0 || record.count as usize > WIDTH {
                return fail(0, "count is outside 1 to 8");
            }
            if record.children[record.count as usize..].iter().any(|c| c.target != EMPTY_SLOT || c.flux != 0.0) {
                return fail(record.count as usize, "an unused slot is not empty");
            }
            for (slot, child) in record.used().iter().enumerate() {
                let place = (node * WIDTH + slot) as u32;
                match child.target() {
                    None => return fail(slot, "a used slot is empty"),
                    Some(Target::Leaf(light)) => {
                        let Some(seen) = seen.get_mut(light as usize) else { return fail(slot, "no such light") };
                        if std::mem::replace(seen, true) {
                            return fail(slot, "the light has two leaves");
                        }
                        if self.leaves[light as usize] != place {
                            return fail(slot, "the light's way up leads elsewhere");
                        }
                        let cluster = self.lights[light as usize].cluster();
                        covers(child, &cluster).map_or(Ok(()), |what| fail(slot, what))?;
                    }
                    Some(Target::Node(below)) => {
                        reached += 1;
                        let Some(lower) = self.nodes.get(below as usize) else { return fail(slot, "no such node") };
                        if below as usize <= node || lower.parent != place {
                            return fail(slot, "the node's way up leads elsewhere");
                        }
                        covers_node(child, lower).map_or(Ok(()), |what| fail(slot, what))?;
                    }
                }
            }
        }
        let end = |what| Err(CheckError { node: self.nodes.len(), slot: 0, what });
        if reached != self.nodes.len() {
            return end("a node cannot be reached");
        }
        if seen.contains(&false) {
            return end("a light has no leaf");
        }
        let total = (f64::from(self.flux.area) + f64::from(self.flux.punctual)).min(f64::from(MOST_FLUX));
        let root = f64::from(self.nodes.first().map_or(0.0, |n| n.cluster().flux));
        let floors = f64::from(MIN_FLUX) * self.lights.len() as f64;
        if (total - root).abs() > total * f64::from(FLUX_TOLERANCE) + floors {
            return end("the root's flux is not the sum of the lights'");
        }
        Ok(())
    }
}

fn covers_node(child: &Child, node: &Node) -> Option<&'static str> {
    node.used().iter().find_map(|lower| covers(child, &lower.cluster())).or_else(|| {
        let sum = node.used().iter().map(|c| f64::from(c.flux)).sum::<f64>().min(f64::from(MOST_FLUX));
        ((f64::from(child.flux) - sum).abs() > sum * f64::from(FLUX_TOLERANCE)).then_some("the flux is not the sum")
    })
}

/// Why `child` does not cover a cluster, if so.
fn covers(child: &Child, inner: &Cluster) -> Option<&'static str> {
    let outer = child.cluster();
    if inner.flux > 0.0 && outer.flux <= 0.0 {
        return Some("a shining light in a dark cluster");
    }
    if inner.flux <= 0.0 {
        return None;
    }
    if !outer.aabb.contains(&inner.aabb) {
        return Some("the box does not contain what is below");
    }
    let cone_holds = outer.cone.is_full()
        || (!inner.cone.is_full()
            && angle(outer.cone.axis, inner.cone.axis) + inner.cone.half_angle <= outer.cone.half_angle);
    if !cone_holds {
        return Some("the cone does not cover what is below");
    }
    if outer.range < inner.range.min(FARTHEST) {
        return Some("the range is shorter than below");
    }
    let finite = [outer.flux, outer.variance].into_iter().chain(outer.mean.to_array()).chain(outer.axis.to_array());
    if finite.into_iter().any(|v| !v.is_finite()) || outer.variance < 0.0 {
        return Some("a moment is not finite");
    }
    None
}
