//! Shapes are sound for any lights, their nodes are full, they do not depend on the number of
//! threads, and they are as good as those of an exhaustive search.

use std::cmp::Reverse;

use glam::{DVec3, Vec3};

use super::children::TINY_SHARE;
use super::counts::{FULL, fills_nodes};
use super::shaping::MAX_COST_DEPTH;
use super::*;
use crate::cluster::bounds::Aabb;
use crate::cluster::{Cluster, MAX_FLUX};
use crate::tree::node::{EMPTY_SLOT, LEAF, NO_PARENT, WIDTH};
use crate::tree::testing::Rng;

fn light(at: Vec3, flux: f32) -> Cluster {
    Cluster { aabb: Aabb::point(at), flux, mean: at, ..Cluster::EMPTY }
}

fn dark(at: Vec3) -> Cluster {
    Cluster { mean: at, ..Cluster::EMPTY }
}

/// A flat city: lights of all kinds over three decades of flux. The share `clumped` of them lie in
/// clumps, and a few are dark.
fn city(count: usize, clumped: f32) -> Vec<Cluster> {
    let mut rng = Rng(count as u64);
    let mut clump = Vec3::ZERO;
    let mut next = |i| {
        if i % 40 == 0 {
            clump = rng.position(500.0) * Vec3::new(1.0, 0.1, 1.0);
        }
        let is_clumped = rng.between(0.0, 1.0) < clumped;
        let at = if is_clumped { clump + rng.position(2.0) } else { rng.position(500.0) * Vec3::new(1.0, 0.1, 1.0) };
        let half = rng.position(1.0).abs();
        let axis = rng.position(1.0).normalize_or_zero() * [0.0, 0.9, 2.0 / 3.0][i % 3];
        let aabb = if i % 3 == 2 { Aabb { min: at - half, max: at + half } } else { Aabb::point(at) };
        let flux = 10.0_f32.powf(rng.between(1.0, 4.0));
        if i % 50 == 49 { dark(at) } else { Cluster { aabb, flux, mean: at, axis, ..Cluster::EMPTY } }
    };
    (0..count).map(&mut next).collect()
}

fn items(clusters: &[Cluster]) -> Vec<BuildItem> {
    clusters.iter().zip(0..).map(|(cluster, index)| BuildItem::new(cluster, index)).collect()
}

/// The shape over some lights, after a check that it is sound.
fn sound_shape(clusters: &[Cluster]) -> Vec<ShapeNode> {
    let nodes = shape(&mut items(clusters));
    check(&nodes, clusters, true);
    nodes
}

/// The same for lights that have no gaps between them.
fn full_shape(clusters: &[Cluster]) -> Vec<ShapeNode> {
    let nodes = shape(&mut items(clusters));
    check(&nodes, clusters, false);
    nodes
}

/// The boxes around what `of` returns for the lights below each node.
fn boxes(nodes: &[ShapeNode], clusters: &[Cluster], of: impl Fn(&Cluster) -> Aabb) -> Vec<Aabb> {
    let mut boxes = vec![Aabb::EMPTY; nodes.len()];
    for (index, node) in nodes.iter().enumerate().rev() {
        boxes[index] = node.children[..node.count as usize].iter().fold(Aabb::EMPTY, |all, child| {
            all.union(&match child & LEAF {
                0 => boxes[*child as usize],
                _ => of(&clusters[(child ^ LEAF) as usize]),
            })
        });
    }
    boxes
}

/// Checks that each light has one leaf, that links agree, that subtrees lie in one piece, and that
/// no node has fewer children than it must. Where lights have gaps between them, nodes beside or above
/// one may have fewer. Returns the depth.
fn check(nodes: &[ShapeNode], clusters: &[Cluster], may_have_gaps: bool) -> u32 {
    let mut has_leaf = vec![false; clusters.len()];
    let means = boxes(nodes, clusters, |light| Aabb::point(light.mean));
    let boxes = boxes(nodes, clusters, |light| light.aabb);
    let diagonals_sq: Vec<f32> = boxes.iter().map(|aabb| aabb.extent().length_squared()).collect();
    let mut depths = vec![0; nodes.len()];
    let spans = spans(nodes);
    for (index, node) in nodes.iter().enumerate() {
        let count = node.count as usize;
        assert!((1..=WIDTH).contains(&count));
        assert!(node.children[count..].iter().all(|child| *child == EMPTY_SLOT));
        assert_eq!(index == 0, node.parent == NO_PARENT);
        let mut next = index + 1;
        let mut smallest_child = None;
        for (slot, child) in node.children[..count].iter().enumerate() {
            if child & LEAF != 0 {
                let light = (child ^ LEAF) as usize;
                assert!(!std::mem::replace(&mut has_leaf[light], true), "light {light} has two leaves");
                continue;
            }
            assert_eq!(*child as usize, next, "the child follows its parent or the subtree of its sibling");
            let child = nodes[next];
            assert_eq!(child.parent as usize, index * WIDTH + slot);
            depths[next] = depths[index] + 1;
            let span = spans[next];
            next += span;
            smallest_child = smallest_child.into_iter().chain([(child.count, span)]).min();
        }
        assert_eq!(next - index, spans[index]);
        // A sparse node is the root, or its children are full of lights and none fits into its
        // room, or it has a tiny child that stayed whole.
        let has_tiny_child = node.children[..count].iter().any(|child| {
            child & LEAF == 0 && diagonals_sq[*child as usize] < TINY_SHARE * TINY_SHARE * diagonals_sq[index]
        });
        let is_beside_gap = |child: usize, parent: usize| {
            let (child, parent) = (means[child].extent(), means[parent].extent());
            child.cmplt(0.26 * parent).any()
        };
        let is_at_gap = node.parent != NO_PARENT && is_beside_gap(index, node.parent as usize / WIDTH)
            || node.children[..count].iter().any(|child| child & LEAF == 0 && is_beside_gap(*child as usize, index));
        let is_full = node.count as usize >= FULL || has_tiny_child || may_have_gaps && is_at_gap;
        if let (false, Some((count, span))) = (is_full, smallest_child) {
            assert!(index == 0 || span == 1 && count - 1 > WIDTH as u32 - node.count, "node {index}: {node:?}");
        } else {
            assert!(index == 0 || is_full, "node {index}: {node:?}");
        }
    }
    assert!(has_leaf.iter().all(|has| *has));
    assert_eq!(spans.first().map_or(0, |span| *span), nodes.len());
    let depth = depths.into_iter().max().unwrap_or(0);
    assert!(depth <= MAX_COST_DEPTH + u32::BITS);
    depth
}

/// The number of nodes in each subtree, the root of it included.
fn spans(nodes: &[ShapeNode]) -> Vec<usize> {
    let mut spans = vec![1; nodes.len()];
    for (index, node) in nodes.iter().enumerate().rev() {
        let inner = node.children.iter().filter(|child| **child & LEAF == 0);
        spans[index] += inner.map(|child| spans[*child as usize]).sum::<usize>();
    }
    spans
}

/// The mean number of children.
fn fill(nodes: &[ShapeNode]) -> f64 {
    nodes.iter().map(|node| f64::from(node.count)).sum::<f64>() / nodes.len() as f64
}

#[test]
fn every_number_of_lights_has_a_sound_shape() {
    assert!(shape(&mut []).is_empty());
    for count in 1..200 {
        let nodes = sound_shape(&city(count, 0.5));
        assert_eq!(nodes.len() == 1, count <= WIDTH, "{count}");
    }
}

#[test]
fn nodes_hold_at_least_5_6_children_on_average() {
    for clumped in [0.0, 0.9] {
        let nodes = if clumped > 0.0 { sound_shape } else { full_shape }(&city(20_000, clumped));
        assert!(fill(&nodes) >= 5.6, "{}", fill(&nodes));
    }
}

/// Counts that do not fill nodes, beside a town of any size.
#[test]
fn lights_across_a_gap_share_no_node_below_the_root() {
    let mut rng = Rng(67);
    for town in [2, 4, 9, 12, 16, 17, 40, 127, 128, 500] {
        for far in [1, 2, 3, 4, 5, 6, 9, 11, 17, 30] {
            for gap in [160.0, 500.0, 1.0e4, 1.0e9] {
                for axis in Vec3::AXES {
                    let mut lights: Vec<Cluster> = (0..town).map(|_| light(rng.position(10.0), 1.0)).collect();
                    lights.extend((0..far).map(|_| light(rng.position(10.0) + axis * gap, 1.0)));
                    let nodes = sound_shape(&lights);
                    for aabb in &boxes(&nodes, &lights, |light| light.aabb)[1..] {
                        assert!(aabb.extent().max_element() < 50.0, "{town} beside {far} at {gap}: {aabb:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn a_shape_does_not_depend_on_the_number_of_threads() {
    let lights = city(200_000, 0.7);
    let shape_with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| sound_shape(&lights))
    };
    let alone = shape_with(1);
    assert!([2, 3, 8].into_iter().all(|threads| shape_with(threads) == alone));
}

#[test]
fn a_million_lights_at_one_point_have_a_sound_shape_and_so_have_dark_ones() {
    let nodes = full_shape(&vec![light(Vec3::splat(7.0), 1.0); 1_000_000]);
    assert!(fill(&nodes) > 6.0, "{}", fill(&nodes));
    full_shape(&vec![dark(Vec3::splat(7.0)); 100_000]);
}

#[test]
fn a_million_lights_at_geometric_distances_stay_within_the_depth_limit() {
    for both_sides in [false, true] {
        let at = |i: usize| {
            let distance = 10.0_f32.powf(-9.0 + 18.0 * (i as f32 / 1_000_000.0));
            Vec3::new(if both_sides && i.is_multiple_of(2) { -distance } else { distance }, 0.0, distance)
        };
        sound_shape(&(0..1_000_000).map(|i| light(at(i), 1.0)).collect::<Vec<_>>());
        // Every step of distance has the same flux.
        let flux = |i: usize| (1.0e-8 / at(i).z.powi(2)).min(MAX_FLUX);
        sound_shape(&(0..50_000).map(|i| light(at(20 * i), flux(20 * i))).collect::<Vec<_>>());
    }
}

#[test]
fn lights_that_are_brighter_towards_a_point_stay_within_the_depth_limit() {
    let at = |i: i32| Vec3::X * 1.0e9 * 0.5_f32.powf(i as f32 / 500.0);
    let lights: Vec<_> = (0..60_000).map(|i| light(at(i), 1.0e-18 * 4.0_f32.powf(i as f32 / 1000.0))).collect();
    sound_shape(&lights);
}

#[test]
fn nodes_below_the_depth_of_cost_splits_are_split_into_halves() {
    let lights = city(50_000, 0.9);
    let mut items = items(&lights);
    let mut shaping = Shaping::default();
    shaping.sum(&items, usize::MAX);
    shaping.start_at(MAX_COST_DEPTH);
    shaping.finish(&mut items);
    assert!(check(&shaping.nodes, &lights, true) < 16, "the number 50,000 has 16 bits");
}

#[test]
fn dark_lights_get_leaves_with_and_without_bright_ones() {
    let mut rng = Rng(5);
    let mut lights: Vec<_> = (0..50_000).map(|_| dark(rng.position(100.0))).collect();
    let nodes = sound_shape(&lights);
    assert!(fill(&nodes) > 5.6, "{}", fill(&nodes));
    lights[777] = light(Vec3::ONE, 1.0);
    sound_shape(&lights);
    lights[778] = light(-Vec3::ONE, 1.0);
    sound_shape(&lights);
}

#[test]
fn lights_at_the_limits_of_flux_and_distance_in_space_planes_and_lines_have_sound_shapes() {
    let mut rng = Rng(6);
    let fluxes = [0.0, 1.0e-18, 1.0, MAX_FLUX];
    let sizes = [1.0e9, 1.0, 1.0e-9, 1.0e-30, 1.0e-38, 1.0e-45];
    for mask in [Vec3::ONE, Vec3::new(1.0, 0.0, 1.0), Vec3::Y] {
        for size in sizes {
            for beam in [Vec3::ZERO, Vec3::Y] {
                let mut next = || {
                    let flux = fluxes[(rng.bits() % 4) as usize];
                    let size = if rng.bits().is_multiple_of(4) { sizes[(rng.bits() % 6) as usize] } else { size };
                    let at = rng.position(size) * mask;
                    if flux == 0.0 { dark(at) } else { Cluster { axis: beam, ..light(at, flux) } }
                };
                sound_shape(&(0..3000).map(|_| next()).collect::<Vec<_>>());
            }
        }
    }
    // All lights have the largest flux, so sums of fluxes and axes reach 1e40 lm.
    let lights: Vec<_> =
        (0..100_000).map(|_| Cluster { axis: Vec3::Y, ..light(rng.position(1.0e9), MAX_FLUX) }).collect();
    assert!(fill(&sound_shape(&lights)) > 6.0);
}

#[test]
fn a_shape_costs_at_most_3_percent_more_than_that_of_an_exhaustive_search() {
    for clumped in [0.0, 0.5, 0.9] {
        // With a few hundred lights, single choices change the cost by 4 % either way.
        for count in [3000, 20_000] {
            let lights = city(count, clumped);
            let mut order: Vec<u32> = (0..count as u32).collect();
            let mut sweep = Vec::new();
            sweep_below(&lights, &mut order, NO_PARENT, &mut sweep);
            check(&sweep, &lights, false);
            let (ours, least) = (summed_cost(&sound_shape(&lights), &lights), summed_cost(&sweep, &lights));
            assert!(ours < 1.03 * least, "{count} lights, {clumped} of them in clumps: {ours} instead of {least}");
        }
    }
}

/// The sums of a group's cost, in f64.
#[derive(Clone, Copy)]
struct Exact {
    aabb: Aabb,
    flux: f64,
    axis: DVec3,
}

impl Exact {
    const EMPTY: Self = Self { aabb: Aabb::EMPTY, flux: 0.0, axis: DVec3::ZERO };

    fn of(light: &Cluster) -> Self {
        let flux = f64::from(light.flux);
        Self { aabb: light.aabb, flux, axis: light.axis.as_dvec3() * flux }
    }

    fn union(&self, other: &Self) -> Self {
        Self { aabb: self.aabb.union(&other.aabb), flux: self.flux + other.flux, axis: self.axis + other.axis }
    }

    fn cost(&self) -> f64 {
        let e = self.aabb.extent().as_dvec3();
        let size = e.x * e.y + e.y * e.z + e.z * e.x + 0.05 * e.length_squared();
        let axis = self.axis.length();
        size * (4.0 * self.flux - 4.5 * axis).max(3.0 * (self.flux - axis)).max(0.0)
    }
}

/// The summed cost of all nodes but the root, in units of the root's cost.
fn summed_cost(nodes: &[ShapeNode], lights: &[Cluster]) -> f64 {
    let mut sums = vec![Exact::EMPTY; nodes.len()];
    let mut cost = 0.0;
    for (index, node) in nodes.iter().enumerate().rev() {
        for child in &node.children[..node.count as usize] {
            let child = match child & LEAF {
                0 => sums[*child as usize],
                _ => Exact::of(&lights[(child ^ LEAF) as usize]),
            };
            cost += child.cost();
            sums[index] = sums[index].union(&child);
        }
    }
    cost / sums[0].cost()
}

/// The exhaustive counterpart of [`shape()`]: tries every cut of every axis, in f64.
fn sweep_below(lights: &[Cluster], order: &mut [u32], parent: u32, nodes: &mut Vec<ShapeNode>) {
    let own = nodes.len();
    nodes.push(ShapeNode { parent, ..ShapeNode::EMPTY });
    let sum = |group: &[u32]| group.iter().fold(Exact::EMPTY, |all, l| all.union(&Exact::of(&lights[*l as usize])));
    let mut groups = vec![order];
    while groups.len() < WIDTH {
        let big = groups.iter().enumerate().filter(|(_, group)| group.len() > WIDTH);
        let costliest = big.max_by(|(_, a), (_, b)| sum(a).cost().total_cmp(&sum(b).cost()));
        let Some((place, _)) = costliest else { break };
        let group = groups.remove(place);
        let cut = sweep(lights, group);
        let (left, right) = group.split_at_mut(cut);
        groups.extend([left, right]);
    }
    groups.sort_by_key(|group| Reverse(group.len()));
    while let Some(place) = groups.iter().rposition(|group| group.len() > 1)
        && groups[place].len() - 1 <= WIDTH - groups.len()
    {
        let group = groups.remove(place);
        groups.extend(group.chunks_mut(1));
    }
    for (group, slot) in groups.into_iter().zip(0..) {
        let child = if let [light] = group { LEAF | *light } else { nodes.len() as u32 };
        nodes[own].push(child);
        if child & LEAF == 0 {
            sweep_below(lights, group, (own * WIDTH) as u32 + slot, nodes);
        }
    }
}

/// Sorts the lights for the best cut and returns the number of lights on its left.
fn sweep(lights: &[Cluster], order: &mut [u32]) -> usize {
    let count = order.len();
    let extent = Aabb::around(order.iter().map(|l| lights[*l as usize].mean)).extent();
    let mut best = (f64::INFINITY, Vec::new(), 0);
    for axis in (0..3).filter(|axis| extent[*axis] > 0.0) {
        order.sort_by(|a, b| lights[*a as usize].mean[axis].total_cmp(&lights[*b as usize].mean[axis]));
        let step = |all: &mut Exact, light: &u32| {
            *all = all.union(&Exact::of(&lights[*light as usize]));
            Some(all.cost())
        };
        let lefts: Vec<f64> = order.iter().scan(Exact::EMPTY, step).collect();
        let rights: Vec<f64> = order.iter().rev().scan(Exact::EMPTY, step).collect();
        let stretch = f64::from(extent.max_element() / extent[axis]);
        for cut in (1..count).filter(|cut| fills_nodes(*cut) && fills_nodes(count - cut)) {
            let cost = stretch * (lefts[cut - 1] + rights[count - cut - 1]);
            if cost < best.0 {
                best = (cost, order.to_vec(), cut);
            }
        }
    }
    assert!(best.2 > 0, "no cut of {count} lights");
    order.copy_from_slice(&best.1);
    best.2
}
