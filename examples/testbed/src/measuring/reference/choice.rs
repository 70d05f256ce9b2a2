//! The cut and the choice below it (docs/math.md, Choosing a light): the probability of every
//! light, from the root down.

use super::child::Child;
use super::importance::importance;
use super::place::View;
use girandole::MAX_SPLITS;
use girandole::tree::{ChildRef, Node, WIDTH};

/// The nodes of a tree and the shading point in their space.
#[derive(Clone, Copy)]
pub struct Tree<'a> {
    pub nodes: &'a [Node],
    pub view: View,
    /// The number of the instance; `None` in a top level.
    pub instance: Option<u32>,
}

/// Where a leaf of the top level leads: a tree, and a node or a light of it.
pub type Below<'a> = Option<(Tree<'a>, ChildRef)>;

/// The probabilities at a shading point.
#[derive(Default)]
pub struct Distribution {
    /// Pairs of an instance with a light, and the probability.
    pub lights: Vec<((Option<u32>, u32), f64)>,
    /// The greatest product of conditions along a path, per light the sum of them.
    pub conditions: Vec<f64>,
    /// Whether rounding may turn one of the decisions.
    pub is_close: bool,
}

/// A candidate.
#[derive(Clone, Copy)]
struct Member<'a> {
    tree: Tree<'a>,
    target: ChildRef,
    lux: f64,
    /// Importance times doubt.
    product: f64,
    is_unresolved: bool,
    condition: f64,
}

struct Chooser<'a, 'f> {
    below: &'f dyn Fn(u32) -> Below<'a>,
    is_close: bool,
}

/// Limits what unresolved members weigh, all together, to the weight of the others.
fn limit(members: &mut [Member], directional: f64) {
    let sum = |of: bool| members.iter().filter(|m| m.is_unresolved == of).map(|m| m.lux).sum::<f64>();
    let (others, unresolved) = (sum(false) + directional, sum(true));
    if others > 0.0 && unresolved > others {
        members.iter_mut().filter(|m| m.is_unresolved).for_each(|m| m.lux *= others / unresolved);
    }
}

impl<'a> Chooser<'a, '_> {
    /// Whether a target is one light.
    fn is_light(&self, tree: &Tree<'a>, target: ChildRef) -> bool {
        match target {
            ChildRef::Node(_) => false,
            ChildRef::Leaf(_) if tree.instance.is_some() => true,
            ChildRef::Leaf(leaf) => matches!((self.below)(leaf), Some((_, ChildRef::Leaf(_)))),
            _ => unreachable!("this version has no others"),
        }
    }

    /// The children of a node that are not proved dark.
    fn children(&mut self, tree: &Tree<'a>, node: u32) -> Vec<Member<'a>> {
        let record = &tree.nodes[node as usize];
        let mut members = Vec::new();
        for child in (0..WIDTH).filter_map(|slot| Child::of(record, slot)) {
            let is_light = self.is_light(tree, child.target);
            let found = importance(&child, record, &tree.view, is_light);
            self.is_close |= found.is_close;
            if found.lux > 0.0 {
                // What cannot be resolved is split first, unless it cannot be split.
                let doubt = if found.is_unresolved && !is_light { 100.0 } else { found.doubt };
                members.push(Member {
                    tree: *tree,
                    target: child.target,
                    lux: found.lux,
                    product: found.lux * doubt,
                    is_unresolved: found.is_unresolved,
                    condition: found.condition,
                });
            }
        }
        members
    }

    /// The node that a member stands for, in its tree.
    fn node_of(&self, member: &Member<'a>) -> Option<(Tree<'a>, u32)> {
        match member.target {
            ChildRef::Node(node) => Some((member.tree, node)),
            ChildRef::Leaf(_) if member.tree.instance.is_some() => None,
            ChildRef::Leaf(leaf) => match (self.below)(leaf)? {
                (tree, ChildRef::Node(node)) => Some((tree, node)),
                _ => None,
            },
            _ => unreachable!("this version has no others"),
        }
    }

    fn cut(&mut self, root: &Tree<'a>, splits: usize, directional: f64) -> Vec<Member<'a>> {
        let mut members = self.children(root, 0);
        let mut left = splits;
        let mut is_first = true;
        while left > 0 {
            let total: f64 = members.iter().filter(|m| !m.is_unresolved).map(|m| m.lux).sum();
            let mut order: Vec<usize> = (0..members.len()).collect();
            order.sort_by(|a, b| members[*b].product.total_cmp(&members[*a].product));
            let Some(first) = order.first().copied() else { break };
            let product = members[first].product;
            let next = order.get(1).map_or(0.0, |second| members[*second].product);
            self.is_close |= (product / (0.002 * total) - 1.0).abs() < 1.0e-3;
            if product <= 0.002 * total {
                break;
            }
            self.is_close |= next > product * (1.0 - 1.0e-3);
            // The first split is not counted if it is the only one that is worth it.
            self.is_close |= is_first && (next / (0.002 * total) - 1.0).abs() < 1.0e-3;
            let is_free = is_first && next <= 0.002 * total && splits < MAX_SPLITS;
            left -= usize::from(!is_free);
            is_first = false;
            let Some((tree, node)) = self.node_of(&members[first]) else { break };
            members.remove(first);
            members.extend(self.children(&tree, node));
        }
        limit(&mut members, directional);
        members
    }

    /// Adds the lights of a member that was chosen with a probability.
    fn descend(&mut self, member: &Member<'a>, pmf: f64, condition: f64, found: &mut Distribution) {
        let Some((tree, node)) = self.node_of(member) else {
            let (instance, light) = match member.target {
                ChildRef::Leaf(leaf) if member.tree.instance.is_none() => match (self.below)(leaf) {
                    Some((tree, ChildRef::Leaf(light))) => (tree.instance, light),
                    _ => return,
                },
                ChildRef::Leaf(light) => (member.tree.instance, light),
                ChildRef::Node(_) => return,
                _ => unreachable!("this version has no others"),
            };
            found.lights.push(((instance, light), pmf));
            found.conditions.push(condition);
            return;
        };
        let mut children = self.children(&tree, node);
        limit(&mut children, 0.0);
        let total: f64 = children.iter().map(|child| child.lux).sum();
        let worst = children.iter().map(|child| child.condition * child.lux).sum::<f64>() / total;
        for child in &children {
            self.descend(child, pmf * child.lux / total, condition + child.condition + worst, found);
        }
    }
}

/// The probability of every light that has one. `below` leads from a leaf of the top level into the
/// tree of an instance.
pub fn distribution<'a>(
    root: &Tree<'a>,
    splits: usize,
    directional: f64,
    below: &dyn Fn(u32) -> Below<'a>,
) -> Distribution {
    let mut chooser = Chooser { below, is_close: false };
    let mut found = Distribution::default();
    let members = chooser.cut(root, splits, directional);
    let total: f64 = members.iter().map(|member| member.lux).sum::<f64>() + directional;
    let worst = members.iter().map(|member| member.condition * member.lux).sum::<f64>() / total;
    for member in &members {
        chooser.descend(member, member.lux / total, member.condition + worst, &mut found);
    }
    found.is_close = chooser.is_close;
    found
}
