//! The tree, and the choice of a light in it.
//!
//! The authors' tree is binary, with one light per leaf here. The same importance also chooses on
//! the eight-wide topology of this library, with a cut as that of its own sampler: up to a number
//! of splits, the group that may be wrong by most is replaced by its children.

use super::super::pbrt::Pbrt;
use super::super::saoh::{self, LEAF};
use super::super::tree::Formula;
use super::light::{GaussianLights, Moments};
use super::surface::{Groups, Surface};
use super::vectors::with_vectors;
use girandole::tree::{ChildRef, WIDTH};
use girandole::{Light, LightTree, ShadingPoint};

/// The greatest number of splits of a cut.
const MAX_SPLITS: usize = 6;
/// The nodes whose children may be chosen.
const MAX_NODES: usize = MAX_SPLITS + 1;
/// The mark of a lane without a child.
const NO_CHILD: u32 = u32::MAX;

/// Up to `N` children.
#[derive(Clone, Copy)]
struct Node<const N: usize> {
    lights: GaussianLights<N>,
    /// For each child the index of its node, or [`LEAF`] and the index of a light, or [`NO_CHILD`].
    children: [u32; N],
}

/// A tree of nodes with up to `N` children, which are computed in `LANES`. The root is the first
/// node.
pub struct GaussianTree<const N: usize, const LANES: usize> {
    nodes: Vec<Node<N>>,
    light_count: usize,
    splits: usize,
}

impl GaussianTree<2, 4> {
    /// The binary tree of pbrt-v4's build, without splits. Lights without power are left out.
    pub fn binary(lights: &[Light]) -> Self {
        let mut bounds: Vec<_> =
            lights.iter().zip(0..).map(|(light, index)| (index, <Pbrt as Formula>::bounds(&light.into()))).collect();
        bounds.retain(|(_, bounds)| bounds.power > 0.0);
        let built = saoh::build(&mut bounds);
        let inner: Vec<usize> = (0..built.len()).filter(|node| built[*node].target & LEAF == 0).collect();
        let child = |node: usize| match built[node].target {
            leaf if leaf & LEAF != 0 => leaf,
            _ => inner.partition_point(|other| *other < node) as u32,
        };
        let mut children: Vec<[u32; 2]> =
            inner.iter().map(|node| [child(node + 1), child(built[*node].target as usize)]).collect();
        if let [only] = built.as_slice() {
            children.push([only.target, NO_CHILD]);
        }
        Self::over(lights, &children, 0)
    }
}

impl GaussianTree<WIDTH, WIDTH> {
    /// The shape of a tree over the same lights, with six splits.
    pub fn wide(tree: &LightTree) -> Self {
        let child = |child| match child {
            Some(ChildRef::Node(node)) => node,
            Some(ChildRef::Leaf(light)) => LEAF | light,
            _ => NO_CHILD,
        };
        let children: Vec<[u32; WIDTH]> =
            tree.nodes().iter().map(|node| std::array::from_fn(|slot| child(node.child(slot)))).collect();
        Self::over(tree.lights(), &children, MAX_SPLITS)
    }
}

impl<const N: usize, const LANES: usize> GaussianTree<N, LANES> {
    fn over(lights: &[Light], children: &[[u32; N]], splits: usize) -> Self {
        let dark = Node { lights: GaussianLights::DARK, children: [NO_CHILD; N] };
        let mut nodes = vec![dark; children.len()];
        if !nodes.is_empty() {
            sum_up(lights, children, &mut nodes, 0);
        }
        Self { nodes, light_count: lights.len(), splits }
    }

    /// The size of all nodes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
    }

    /// Chooses a light and returns its index and probability; `None` if no group has importance.
    /// `u` in [0, 1) is an f64, so that choices deep in the tree are still random.
    pub fn pick(&self, at: &ShadingPoint, u: f64) -> Option<(u32, f32)> {
        with_vectors(
            #[inline(always)]
            || self.walk(at, u),
        )
    }

    #[inline(always)]
    fn walk(&self, at: &ShadingPoint, u: f64) -> Option<(u32, f32)> {
        let surface = Surface::of(at);
        let cut = self.cut(&surface)?;
        let weights = cut.weights[..cut.count].as_flattened();
        let (place, mut pmf, mut u) = choose(weights, u)?;
        let mut child = self.nodes[cut.nodes[place / N] as usize].children[place % N];
        while child & LEAF == 0 {
            let node = &self.nodes[child as usize];
            let (lane, share, rest) = choose(&self.groups(&surface, node).importances, u)?;
            (child, pmf, u) = (node.children[lane], pmf * share, rest);
        }
        Some((child & !LEAF, pmf))
    }

    /// The probability of each light.
    pub fn pmfs(&self, at: &ShadingPoint) -> Vec<f32> {
        let mut pmfs = vec![0.0; self.light_count];
        let surface = Surface::of(at);
        let Some(cut) = self.cut(&surface) else { return pmfs };
        let mut open = Vec::new();
        let mut visit = |open: &mut Vec<(u32, f32)>, children: &[u32], weights: &[f32], (pmf, total): (f32, f32)| {
            for (child, weight) in children.iter().zip(weights).filter(|(_, weight)| **weight > 0.0) {
                let pmf = pmf * (weight / total);
                match child & LEAF {
                    0 => open.push((*child, pmf)),
                    _ => pmfs[(child & !LEAF) as usize] = pmf,
                }
            }
        };
        let total = cut.weights[..cut.count].as_flattened().iter().sum();
        for (node, weights) in cut.nodes.iter().zip(&cut.weights[..cut.count]) {
            visit(&mut open, &self.nodes[*node as usize].children, weights, (1.0, total));
        }
        while let Some((node, pmf)) = open.pop() {
            let node = &self.nodes[node as usize];
            let weights = self.groups(&surface, node).importances;
            visit(&mut open, &node.children, &weights, (pmf, weights.iter().sum()));
        }
        pmfs
    }

    #[inline(always)]
    fn groups(&self, surface: &Surface, node: &Node<N>) -> Groups<N> {
        let Groups { importances, doubts } = surface.groups::<N, LANES>(&node.lights);
        Groups { importances: std::array::from_fn(|i| importances[i]), doubts: std::array::from_fn(|i| doubts[i]) }
    }

    /// Splits the root and then the groups that may be wrong by most. `None` without lights.
    #[inline(always)]
    fn cut(&self, surface: &Surface) -> Option<Cut<N>> {
        let mut cut = Cut { nodes: [0; MAX_NODES], weights: [[0.0; N]; MAX_NODES], count: 0 };
        let mut doubts = [[0.0; N]; MAX_NODES];
        let mut next = (!self.nodes.is_empty()).then_some(0)?;
        loop {
            let node = &self.nodes[next as usize];
            let Groups { importances, doubts: own } = self.groups(surface, node);
            for lane in 0..N {
                doubts[cut.count][lane] = if node.children[lane] & LEAF == 0 { own[lane] } else { 0.0 };
            }
            (cut.nodes[cut.count], cut.weights[cut.count]) = (next, importances);
            cut.count += 1;
            if cut.count > self.splits {
                return Some(cut);
            }
            let (mut most, mut place) = (0.0, 0);
            for (other, doubt) in doubts[..cut.count].as_flattened().iter().enumerate() {
                (most, place) = if *doubt > most { (*doubt, other) } else { (most, place) };
            }
            if most <= 0.0 {
                return Some(cut);
            }
            next = self.nodes[cut.nodes[place / N] as usize].children[place % N];
            (cut.weights[place / N][place % N], doubts[place / N][place % N]) = (0.0, 0.0);
        }
    }
}

/// Sets a node and all below it. `None` if no light there has power.
fn sum_up<const N: usize>(
    lights: &[Light],
    children: &[[u32; N]],
    nodes: &mut [Node<N>],
    index: usize,
) -> Option<Moments> {
    let mut all: Option<Moments> = None;
    for (lane, child) in children[index].into_iter().enumerate().filter(|(_, child)| *child != NO_CHILD) {
        let group = match child & LEAF {
            0 => sum_up(lights, children, nodes, child as usize),
            _ => Moments::of(&lights[(child & !LEAF) as usize]),
        };
        nodes[index].children[lane] = child;
        let Some(group) = group else { continue };
        nodes[index].lights.set(lane, &group);
        all = Some(all.map_or(group, |all| all.union(&group)));
    }
    all
}

/// The nodes whose children one light is chosen among.
struct Cut<const N: usize> {
    nodes: [u32; MAX_NODES],
    /// The importance of each child; 0 where its own children take its place.
    weights: [[f32; N]; MAX_NODES],
    count: usize,
}

/// Chooses one of some weights by a number in [0, 1). Returns its place, its probability, and a new
/// number in [0, 1); `None` if all weights are 0.
#[inline(always)]
fn choose(weights: &[f32], u: f64) -> Option<(usize, f32, f64)> {
    let total: f32 = weights.iter().sum();
    let point = u * f64::from(total);
    let (mut before, mut chosen) = (0.0, None);
    for (place, weight) in weights.iter().enumerate() {
        // If rounding lets the point pass all of them, the last with a weight is chosen.
        if *weight > 0.0 && point >= before {
            chosen = Some((place, *weight, before));
        }
        before += f64::from(*weight);
    }
    let (place, weight, before) = chosen?;
    let rest = (point - before) / f64::from(weight);
    Some((place, weight / total, rest.clamp(0.0, 1.0 - f64::EPSILON)))
}

#[cfg(test)]
mod tests;
