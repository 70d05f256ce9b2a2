//! Builds a tree top down: each node's lights are split in two again and again until there are eight groups.
//!
//! Based on CK18 4.2-4.4 (surface area orientation heuristic, binned). Differs: splits in two are collected into wide
//! nodes by always splitting the costliest group; orientation is measured by the mean direction, which adds up over bins,
//! instead of by cones, which need trigonometry (docs/decisions.md); a group's size is measured so that a street of collinear lamps, whose
//! box has no area, still has a cost; nodes are laid out level by level, which makes the tree the same for any number of
//! threads and a refit a plain sweep from the last node to the first.

use glam::{DVec3, Vec3};

use super::attributes::{Attributes, Terms};
use super::node::{LEAF, NO_PARENT, Node, WIDTH};
use super::{FluxByKind, LightTree};
use crate::bounds::Aabb;
use crate::cluster::Cluster;
use crate::light::{LAMBERTIAN, Light};

/// Bins along each axis. 12 is pbrt-v4's number; 16 costs little more and fills two 8-wide registers.
const BINS: usize = 16;

/// Weight of the squared diagonal beside the half area in a group's size. Small, so that it decides only where the
/// areas vanish.
const DIAGONAL_WEIGHT: f64 = 0.05;

/// Below this many lights a level is built on one thread.
#[cfg(feature = "parallel")]
const PARALLEL_LIGHTS: usize = 4096;

/// What a split looks at for each light.
#[derive(Clone, Copy)]
struct Item {
    cluster: Cluster,
    light: u32,
}

/// A node that waits for its children.
struct Open<'a> {
    items: &'a mut [Item],
    parent: u32,
}

impl LightTree {
    /// Builds from valid lights.
    pub(super) fn build(lights: Vec<Light>) -> Self {
        let mut items: Vec<Item> =
            lights.iter().zip(0..).map(|(light, index)| Item { cluster: light.cluster(), light: index }).collect();
        let mut leaves = vec![0; lights.len()];
        let mut nodes = Vec::new();
        let mut levels = vec![0];
        let mut open = if items.is_empty() { vec![] } else { vec![Open { items: &mut items, parent: NO_PARENT }] };
        while !open.is_empty() {
            let first = nodes.len() as u32;
            let next_level = first + open.len() as u32;
            let mut next = Vec::new();
            for (node_index, (groups, parent)) in (first..).zip(split_all(open)) {
                let mut node = Node { parent, ..Node::EMPTY };
                for (group, slot) in groups.into_iter().zip(0..) {
                    let place = node_index * WIDTH as u32 + slot;
                    node.children[slot as usize].target = match group {
                        [item] => {
                            leaves[item.light as usize] = place;
                            item.light | LEAF
                        }
                        items => {
                            next.push(Open { items, parent: place });
                            next_level + next.len() as u32 - 1
                        }
                    };
                    node.count = slot + 1;
                }
                nodes.push(node);
            }
            levels.push(nodes.len() as u32);
            open = next;
        }
        let terms = vec![Terms::default(); nodes.len()];
        let (attributes, flux) = (Attributes::default(), FluxByKind::default());
        let mut tree = Self { lights, nodes, levels, leaves, terms, attributes, flux };
        tree.refit();
        tree
    }
}

type Groups<'a> = (Vec<&'a mut [Item]>, u32);

/// The children of all nodes of a level, in the order of the nodes.
fn split_all(open: Vec<Open<'_>>) -> Vec<Groups<'_>> {
    fn split(open: Open<'_>) -> Groups<'_> {
        (split_wide(open.items), open.parent)
    }
    #[cfg(feature = "parallel")]
    if open.iter().map(|o| o.items.len()).sum::<usize>() >= PARALLEL_LIGHTS {
        use rayon::prelude::*;
        return open.into_par_iter().map(split).collect();
    }
    open.into_iter().map(split).collect()
}

/// Splits the lights of a node into at most [`WIDTH`] groups.
fn split_wide(items: &mut [Item]) -> Vec<&mut [Item]> {
    if items.len() <= WIDTH {
        return items.chunks_mut(1).collect();
    }
    let cost = Group::around(items).cost();
    let mut groups = vec![(items, cost)];
    while groups.len() < WIDTH {
        // The costliest group that can be split; the first of equals.
        let costliest = groups
            .iter()
            .enumerate()
            .filter(|(_, (items, _))| items.len() > 1)
            .max_by(|(i, a), (j, b)| a.1.total_cmp(&b.1).then(j.cmp(i)));
        let Some((place, _)) = costliest else { break };
        let (items, _) = groups.remove(place);
        let (left, right) = split_in_two(items);
        let costs = [Group::around(left).cost(), Group::around(right).cost()];
        groups.insert(place, (right, costs[1]));
        groups.insert(place, (left, costs[0]));
    }
    groups.into_iter().map(|(items, _)| items).collect()
}

/// Splits two or more lights into two groups that are not empty, where the summed cost is least.
fn split_in_two(items: &mut [Item]) -> (&mut [Item], &mut [Item]) {
    let means = Aabb::around(items.iter().map(|item| item.cluster.mean));
    let extent = means.extent();
    let longest = extent.max_element();
    let mut best: Option<(f64, Binning, usize)> = None;
    for axis in 0..3 {
        // An axis too short to tell bins apart in f32 cannot split.
        let Some(binning) = Binning::new(&means, axis) else { continue };
        // Thin slices are worse than their area says; [CK18] equation 3.
        let regularity = f64::from(longest) / f64::from(extent[axis]);
        let mut bins = [Group::EMPTY; BINS];
        for item in items.iter() {
            bins[binning.bin(item.cluster.mean)].add(&Group::of(&item.cluster));
        }
        let mut right_costs = [0.0; BINS];
        let mut right = Group::EMPTY;
        for cut in (1..BINS).rev() {
            right.add(&bins[cut]);
            right_costs[cut] = right.cost();
        }
        let mut left = Group::EMPTY;
        for cut in 1..BINS {
            left.add(&bins[cut - 1]);
            if left.lights == 0 || left.lights == items.len() {
                continue;
            }
            let cost = regularity * (left.cost() + right_costs[cut]);
            if best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, binning, cut));
            }
        }
    }
    let middle = match best {
        Some((_, binning, cut)) => partition(items, |item| binning.bin(item.cluster.mean) < cut),
        // All at one place: any halves will do, and the order of the lights decides.
        None => items.len() / 2,
    };
    items.split_at_mut(middle)
}

/// Maps positions along an axis to bins.
#[derive(Clone, Copy)]
struct Binning {
    axis: usize,
    min: f32,
    scale: f32,
}

impl Binning {
    fn new(means: &Aabb, axis: usize) -> Option<Self> {
        let (min, extent) = (means.min[axis], means.extent()[axis]);
        let scale = BINS as f32 / extent;
        (extent > 0.0 && scale.is_finite()).then_some(Self { axis, min, scale })
    }

    fn bin(&self, mean: Vec3) -> usize {
        (((mean[self.axis] - self.min) * self.scale) as usize).min(BINS - 1)
    }
}

/// Moves what `is_left` accepts to the front, keeping the order on both sides, and counts it.
fn partition(items: &mut [Item], is_left: impl Fn(&Item) -> bool) -> usize {
    let right: Vec<Item> = items.iter().filter(|item| !is_left(item)).copied().collect();
    let left = items.len() - right.len();
    let mut front = 0;
    for place in 0..items.len() {
        if is_left(&items[place]) {
            items[front] = items[place];
            front += 1;
        }
    }
    items[left..].copy_from_slice(&right);
    left
}

/// What a split needs to know of a group: sums and a box, cheaper to collect than clusters with their cones.
#[derive(Clone, Copy)]
struct Group {
    aabb: Aabb,
    flux: f64,
    /// Sum of flux times mean direction; in f64, as its length squares fluxes.
    axis: DVec3,
    lights: usize,
}

impl Group {
    const EMPTY: Self = Self { aabb: Aabb::EMPTY, flux: 0.0, axis: DVec3::ZERO, lights: 0 };

    fn of(light: &Cluster) -> Self {
        let flux = f64::from(light.flux);
        Self { aabb: light.aabb, flux, axis: light.axis.as_dvec3() * flux, lights: 1 }
    }

    fn around(items: &[Item]) -> Self {
        let mut all = Self::EMPTY;
        items.iter().for_each(|item| all.add(&Self::of(&item.cluster)));
        all
    }

    fn add(&mut self, other: &Self) {
        self.aabb = self.aabb.union(&other.aabb);
        self.flux += other.flux;
        self.axis += other.axis;
        self.lights += other.lights;
    }

    fn cost(&self) -> f64 {
        if self.flux > 0.0 { cost(self.flux, &self.aabb, self.axis.length() / self.flux) } else { 0.0 }
    }
}

/// The build's cost of a cluster.
pub(super) fn cluster_cost(cluster: &Cluster) -> f64 {
    cost(cluster.flux.into(), &cluster.aabb, cluster.axis.length().into())
}

/// Flux, size and orientation of a group, as in CK18 equation 2. In f64: costs of large bright groups would all be
/// infinite in f32, those of small dim ones all zero.
fn cost(flux: f64, aabb: &Aabb, axis_length: f64) -> f64 {
    flux * size(aabb) * orientation(axis_length)
}

/// How widely a group emits, from the length of its mean direction: 4 pi to all sides, pi for flat emitters that agree
/// (length 2/3), 0 for a beam. Meets the orientation measure of CK18 equation 1 at these three; needs no cone.
fn orientation(axis_length: f64) -> f64 {
    let flat = f64::from(LAMBERTIAN);
    let spread = if axis_length <= flat { 4.0 - 3.0 * axis_length / flat } else { 3.0 * (1.0 - axis_length) };
    std::f64::consts::PI * spread.max(0.0)
}

fn size(aabb: &Aabb) -> f64 {
    let e = aabb.extent().as_dvec3();
    e.x * e.y + e.y * e.z + e.z * e.x + DIAGONAL_WEIGHT * e.length_squared()
}
