//! Shapes are sound for any lights, full, the same for any number of threads, and as good as an exhaustive search.

use std::cmp::Reverse;

use glam::{DVec3, Vec3};

use super::*;
use crate::bounds::Aabb;
use crate::cluster::{Cluster, MAX_FLUX};

/// Fewest children of a node that is not sparse.
const FULL: u32 = 6;

/// SplitMix64.
struct Rng(u64);

impl Rng {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * ((self.bits() >> 40) as f32 / 16_777_216.0)
    }

    fn place(&mut self, size: f32) -> Vec3 {
        Vec3::new(self.between(-size, size), self.between(-size, size), self.between(-size, size))
    }
}

fn light(at: Vec3, flux: f32) -> Cluster {
    Cluster { aabb: Aabb::point(at), flux, mean: at, ..Cluster::EMPTY }
}

fn dark(at: Vec3) -> Cluster {
    Cluster { mean: at, ..Cluster::EMPTY }
}

/// A flat city: lights of all kinds over three decades of flux, a part of them in clumps, a few of them dark.
fn city(count: usize, clumped: f32) -> Vec<Cluster> {
    let mut rng = Rng(count as u64);
    let mut clump = Vec3::ZERO;
    let mut next = |i| {
        if i % 40 == 0 {
            clump = rng.place(500.0) * Vec3::new(1.0, 0.1, 1.0);
        }
        let is_clumped = rng.between(0.0, 1.0) < clumped;
        let at = if is_clumped { clump + rng.place(2.0) } else { rng.place(500.0) * Vec3::new(1.0, 0.1, 1.0) };
        let half = rng.place(1.0).abs();
        let axis = rng.place(1.0).normalize_or_zero() * [0.0, 0.9, 2.0 / 3.0][i % 3];
        let aabb = if i % 3 == 2 { Aabb { min: at - half, max: at + half } } else { Aabb::point(at) };
        let flux = 10.0_f32.powf(rng.between(1.0, 4.0));
        if i % 50 == 49 { dark(at) } else { Cluster { aabb, flux, mean: at, axis, ..Cluster::EMPTY } }
    };
    (0..count).map(&mut next).collect()
}

fn items(clusters: &[Cluster]) -> Vec<Item> {
    clusters.iter().zip(0..).map(|(cluster, index)| Item::new(cluster, index)).collect()
}

/// The shape over some lights, proven sound.
fn sound_shape(clusters: &[Cluster]) -> Vec<ShapeNode> {
    let nodes = shape(&mut items(clusters));
    check(&nodes, clusters.len());
    nodes
}

/// One leaf a light, links up and down, subtrees contiguous, no node emptier than it must be. Returns the depth.
fn check(nodes: &[ShapeNode], lights: usize) -> u32 {
    let mut has_leaf = vec![false; lights];
    let mut depths = vec![0; nodes.len()];
    for (index, node) in nodes.iter().enumerate() {
        let count = node.count as usize;
        assert!((1..=WIDTH).contains(&count));
        assert!(node.targets[count..].iter().all(|target| *target == EMPTY_SLOT));
        assert_eq!(index == 0, node.parent == NO_PARENT);
        let mut next = index + 1;
        let mut smallest_child = None;
        for (slot, target) in node.targets[..count].iter().enumerate() {
            if target & LEAF != 0 {
                let light = (target ^ LEAF) as usize;
                assert!(!std::mem::replace(&mut has_leaf[light], true), "light {light} has two leaves");
                continue;
            }
            assert_eq!(*target as usize, next, "children follow their parent and each other's subtrees");
            let child = nodes[next];
            assert_eq!(child.parent as usize, index * WIDTH + slot);
            depths[next] = depths[index] + 1;
            next += child.span as usize;
            smallest_child = smallest_child.into_iter().chain([(child.count, child.span)]).min();
        }
        assert_eq!(next - index, node.span as usize);
        // Sparse nodes are the root, or have children that are all full of lights and too many to be opened.
        if let (1..FULL, Some((count, span))) = (node.count, smallest_child) {
            assert!(index == 0 || span == 1 && count - 1 > WIDTH as u32 - node.count, "node {index}: {node:?}");
        } else {
            assert!(index == 0 || node.count >= FULL, "node {index}: {node:?}");
        }
    }
    assert!(has_leaf.iter().all(|has| *has));
    assert_eq!(nodes.first().map_or(0, |root| root.span as usize), nodes.len());
    let depth = depths.into_iter().max().unwrap_or(0);
    assert!(depth <= DEEPEST + u32::BITS);
    depth
}

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
fn nodes_are_full() {
    for clumped in [0.0, 0.9] {
        let nodes = sound_shape(&city(20_000, clumped));
        assert!(fill(&nodes) >= 5.6, "{}", fill(&nodes));
    }
}

#[test]
fn the_number_of_threads_does_not_change_a_shape() {
    let lights = city(200_000, 0.7);
    let shape_with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| sound_shape(&lights))
    };
    let alone = shape_with(1);
    assert!([2, 3, 8].into_iter().all(|threads| shape_with(threads) == alone));
}

#[test]
fn a_million_lights_at_one_place_bright_or_dark_are_halved() {
    let nodes = sound_shape(&vec![light(Vec3::splat(7.0), 1.0); 1_000_000]);
    assert!(fill(&nodes) > 6.0, "{}", fill(&nodes));
    sound_shape(&vec![dark(Vec3::splat(7.0)); 100_000]);
}

#[test]
fn a_million_lights_at_geometric_distances_stay_within_the_depth() {
    for both_sides in [false, true] {
        let at = |i: usize| {
            let distance = 10.0_f32.powf(-9.0 + 18.0 * (i as f32 / 1_000_000.0));
            Vec3::new(if both_sides && i.is_multiple_of(2) { -distance } else { distance }, 0.0, distance)
        };
        sound_shape(&(0..1_000_000).map(|i| light(at(i), 1.0)).collect::<Vec<_>>());
        // As much of the flux in each step.
        let flux = |i: usize| (1.0e-8 / at(i).z.powi(2)).min(MAX_FLUX);
        sound_shape(&(0..50_000).map(|i| light(at(20 * i), flux(20 * i))).collect::<Vec<_>>());
    }
}

#[test]
fn lights_that_grow_brighter_inward_stay_within_the_depth() {
    let at = |i: i32| Vec3::X * 1.0e9 * 0.5_f32.powf(i as f32 / 500.0);
    let lights: Vec<_> = (0..60_000).map(|i| light(at(i), 1.0e-18 * 4.0_f32.powf(i as f32 / 1000.0))).collect();
    sound_shape(&lights);
}

#[test]
fn below_the_deepest_level_lights_are_halved() {
    let lights = city(50_000, 0.9);
    let mut items = items(&lights);
    let whole = Group::around(&items);
    let mut nodes = Vec::new();
    shape_below(&mut items, &whole, DEEPEST, &mut nodes);
    link(&mut nodes);
    assert!(check(&nodes, lights.len()) < 16, "50,000 lights have 16 bits");
}

#[test]
fn dark_lights_get_leaves_alone_and_among_others() {
    let mut rng = Rng(5);
    let mut lights: Vec<_> = (0..50_000).map(|_| dark(rng.place(100.0))).collect();
    let nodes = sound_shape(&lights);
    assert!(fill(&nodes) > 5.6, "{}", fill(&nodes));
    lights[777] = light(Vec3::ONE, 1.0);
    sound_shape(&lights);
    lights[778] = light(-Vec3::ONE, 1.0);
    sound_shape(&lights);
}

#[test]
fn the_ends_of_all_ranges_and_lines_and_planes_have_sound_shapes() {
    let mut rng = Rng(6);
    let fluxes = [0.0, 1.0e-18, 1.0, MAX_FLUX];
    let sizes = [1.0e9, 1.0, 1.0e-9, 1.0e-30, 1.0e-38, 1.0e-45];
    for mask in [Vec3::ONE, Vec3::new(1.0, 0.0, 1.0), Vec3::Y] {
        for size in sizes {
            for beam in [Vec3::ZERO, Vec3::Y] {
                let mut next = || {
                    let flux = fluxes[(rng.bits() % 4) as usize];
                    let size = if rng.bits().is_multiple_of(4) { sizes[(rng.bits() % 6) as usize] } else { size };
                    let at = rng.place(size) * mask;
                    if flux == 0.0 { dark(at) } else { Cluster { axis: beam, ..light(at, flux) } }
                };
                sound_shape(&(0..3000).map(|_| next()).collect::<Vec<_>>());
            }
        }
    }
    // All at the most flux: sums of axes and fluxes reach 1e40 lm.
    let lights: Vec<_> = (0..100_000).map(|_| Cluster { axis: Vec3::Y, ..light(rng.place(1.0e9), MAX_FLUX) }).collect();
    assert!(fill(&sound_shape(&lights)) > 6.0);
}

#[test]
fn shapes_cost_at_most_3_percent_more_than_those_of_all_cuts() {
    for clumped in [0.0, 0.5, 0.9] {
        // Of a few hundred lights, single choices move it by 4 % either way.
        for count in [3000, 20_000] {
            let lights = city(count, clumped);
            let mut order: Vec<u32> = (0..count as u32).collect();
            let mut sweep = Vec::new();
            sweep_below(&lights, &mut order, NO_PARENT, &mut sweep);
            check(&sweep, count);
            let (ours, least) = (summed_cost(&sound_shape(&lights), &lights), summed_cost(&sweep, &lights));
            assert!(ours < 1.03 * least, "{count} lights, {clumped} of them in clumps: {ours} instead of {least}");
        }
    }
}

/// Sums as a cost needs them, in f64.
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

/// Over all nodes but the root, in units of the root's cost.
fn summed_cost(nodes: &[ShapeNode], lights: &[Cluster]) -> f64 {
    let mut sums = vec![Exact::EMPTY; nodes.len()];
    let mut cost = 0.0;
    for (index, node) in nodes.iter().enumerate().rev() {
        for target in &node.targets[..node.count as usize] {
            let child = match target & LEAF {
                0 => sums[*target as usize],
                _ => Exact::of(&lights[(target ^ LEAF) as usize]),
            };
            cost += child.cost();
            sums[index] = sums[index].union(&child);
        }
    }
    cost / sums[0].cost()
}

/// The slow twin of [`shape_below`]: tries every cut of every axis, in f64.
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
        let target = if let [light] = group { LEAF | *light } else { nodes.len() as u32 };
        nodes[own].push(target);
        if target & LEAF == 0 {
            sweep_below(lights, group, (own * WIDTH) as u32 + slot, nodes);
        }
    }
    nodes[own].span = (nodes.len() - own) as u32;
}

/// Sorts for the best cut, and returns it.
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
    assert!(best.2 > 0, "no cut of {count}");
    order.copy_from_slice(&best.1);
    best.2
}
