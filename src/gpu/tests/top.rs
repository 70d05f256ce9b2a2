//! The worlds that the tests build, and how they read a build back.

mod bounds;
mod changes;
mod twin;

use std::collections::HashMap;

use glam::{EulerRot, Mat3, Quat, Vec3};

use super::Rig;
use super::pool::TestPool;
use crate::cluster::Cluster;
use crate::cluster::bounds::Aabb;
use crate::effects::Effects;
use crate::gpu::testing::{random, random_vec};
use crate::instance::part::{PART, PART_BITS, Part};
use crate::keys::slot_of;
use crate::plan::draft::Growth;
use crate::plan::layout::{Bases, ClusterRecord, InstanceRecord, LeafRecord, ParamsRecord, PartRecord, TreeRecord};
use crate::plan::node_record::NodeRecord;
use crate::plan::top::{MapQuads, TopBuild};
use crate::scheduler::FrameBudget;
use crate::top::masks::NodeMasks;
use crate::tree::LightTree;
use crate::tree::{ChildRef, Node, WIDTH};
use crate::{InstanceKey, Light, LightWorld, Placement, Policy, TreeKey};

/// What a build on the GPU has written. Some nodes may be left over: no other node refers to them.
struct Built {
    /// The parts of the world, as the twin numbers them.
    parts: Vec<Part>,
    /// What the build has written about each part.
    records: Vec<LeafRecord>,
    /// The clusters of the parts.
    leaves: Vec<Cluster>,
    /// The clusters of the nodes.
    clusters: Vec<ClusterRecord>,
    nodes: Vec<Node>,
    /// For each node its name.
    names: Vec<u32>,
    /// The masks of the nodes; empty if they are not stored.
    masks: Vec<NodeMasks>,
}

impl Built {
    /// The number of the part that is a leaf.
    fn part_of(&self, leaf: u32) -> usize {
        match leaf & PART {
            0 => self.parts.partition_point(|part| part.slot < leaf),
            _ => (leaf & PART_BITS) as usize,
        }
    }

    /// The cluster from which the child at a place was packed.
    fn child(&self, place: usize) -> Cluster {
        match self.nodes[place / WIDTH].child(place % WIDTH) {
            None => Cluster::EMPTY,
            Some(ChildRef::Leaf(leaf)) => self.leaves[self.part_of(leaf)],
            Some(ChildRef::Node(node)) => cluster_of(&self.clusters[node as usize]),
        }
    }

    /// The nodes that can be reached from the root, the root first.
    fn reached(&self) -> Vec<usize> {
        let mut reached = vec![0];
        let mut next = 0;
        while let Some(node) = reached.get(next) {
            let children: Vec<usize> = (0..WIDTH)
                .filter_map(|slot| match self.nodes[*node].child(slot) {
                    Some(ChildRef::Node(child)) => Some(child as usize),
                    _ => None,
                })
                .collect();
            reached.extend(children);
            next += 1;
        }
        reached
    }
}

/// Trees of 1 to 20 lights of all kinds, trees of narrow beams, and a dark tree.
fn trees(world: &mut LightWorld) -> Vec<TreeKey> {
    let light = |i: u32| {
        let at = 20.0 * random_vec(i, 0);
        let direction = random_vec(i, 3).normalize_or(Vec3::Y);
        let emission = Vec3::splat(1.0 + 100.0 * random(i, 6));
        match i % 5 {
            0 => Light::point(at, emission).with_range(1.0 + 50.0 * random(i, 7)),
            1 => Light::spot(at, direction, 0.01, 0.02 + 1.2 * random(i, 7), emission),
            2 => Light::rectangle(at, direction, direction.any_orthonormal_vector() * 0.3, emission),
            3 => Light::triangle([at, at + direction, at + random_vec(i, 8)], emission),
            _ => Light::sphere(at, 0.1 + random(i, 7), emission),
        }
    };
    let of_all_kinds = (1..=20).map(|n| (100 * n..101 * n).map(light).collect());
    let beams = (0..6).map(|n| (0..=n).map(|i| light(5 * (i + 7 * n) + 1)).collect());
    let dark = vec![Light::point(Vec3::ZERO, Vec3::ZERO)];
    of_all_kinds
        .chain(beams)
        .chain([dark])
        .map(|lights: Vec<Light>| world.add_tree(LightTree::new(lights).unwrap()))
        .collect()
}

/// Rotations, mirrors, uniform and non-uniform scales, spread over a flat city.
fn placement(i: u32) -> Placement {
    let rotation = Quat::from_euler(EulerRot::XYZ, 6.0 * random(i, 20), 6.0 * random(i, 21), 6.0 * random(i, 22));
    let scale = match i % 8 {
        0 | 4 => Vec3::ONE,
        1 | 5 => Vec3::splat(0.1 + 4.0 * random(i, 23)),
        2 | 6 => Vec3::new(-1.0, 1.0, 1.0),
        3 => Vec3::new(0.5, 2.0, 1.0 + random(i, 23)),
        _ => Vec3::new(0.98, 1.03, 1.0),
    };
    let linear = Mat3::from_quat(rotation) * Mat3::from_diagonal(scale);
    let translation = Vec3::new(4000.0, 50.0, 3000.0) * random_vec(i, 24);
    Placement { linear, translation: translation.as_dvec3() }
}

/// A world of `slots` instance slots with placements by `place`; every seventh slot is empty again.
fn world_of(slots: u32, place: impl Fn(u32) -> Placement) -> LightWorld {
    let mut world = LightWorld::new();
    let trees = trees(&mut world);
    let keys: Vec<InstanceKey> = (0..slots)
        .map(|i| world.add_instance(trees[i as usize % trees.len()], place(i), Policy::default()).unwrap())
        .collect();
    keys.iter().skip(3).step_by(7).for_each(|key| world.remove_instance(*key).unwrap());
    for (i, key) in (0..).zip(&keys).skip(1).step_by(7) {
        world.set_appearance(*key, |a| a.factor = Vec3::new(0.5, 100.0 * random(i, 25), 2.0)).unwrap();
        world.set_appearance(*key, |a| a.mask = 1 << (i % 32)).unwrap();
    }
    world.update(FrameBudget::NONE);
    world
}

/// Builds top levels on the shared device.
struct TopRig {
    rig: Rig,
    top: TopBuild,
}

impl TopRig {
    fn new() -> Self {
        Self { rig: Rig::new(), top: TopBuild::new(128 << 20) }
    }

    /// A pool that holds these records.
    fn pool<T: bytemuck::NoUninit>(&mut self, records: &[T]) -> TestPool<T> {
        let mut pool = TestPool::new(&mut self.rig, 1, 128 << 20);
        pool.alloc(&mut self.rig, records.len() as u32).unwrap();
        pool.write(&mut self.rig, 0, records);
        pool
    }
}

/// Builds the top level of a world.
fn build(top: &mut TopRig, world: &LightWorld) -> Built {
    let (mut trees, mut bases) = (vec![TreeRecord::default()], HashMap::new());
    for key in world.trees() {
        bases.insert(key, trees.len() as u32);
        let (tree, openings) = (world.tree(key).unwrap(), world.openings(key));
        trees.extend((0..TreeRecord::count(openings.len())).map(|i| TreeRecord::of(tree, openings, i)));
    }
    let mut instances = vec![InstanceRecord::NONE; world.slot_count().max(1)];
    for key in world.instances() {
        let instance = world.instance(key).unwrap();
        let placed = instance.shown().expect("no test hides an instance");
        let bases = Bases { tree: bases[&instance.tree], ..Bases::default() };
        instances[slot_of(key) as usize] = InstanceRecord::of(placed, &instance.appearance, bases);
    }
    let parts: Vec<Part> = world.parts().iter().map(|(part, _)| *part).collect();
    let index = |i: usize| i - parts.partition_point(|part| part.slot < parts[i].slot);
    let record = |i: usize| PartRecord { slot: parts[i].slot, index: index(i) as u32 };
    let mut part_records: Vec<PartRecord> = (0..parts.len()).map(record).collect();
    part_records.resize(parts.len().max(1), PartRecord::NONE);
    let (part_records, instances, trees) = (top.pool(&part_records), top.pool(&instances), top.pool(&trees));
    let pools = [part_records.pool.buffer(), instances.pool.buffer(), trees.pool.buffer()];
    let count = parts.len() as u32;
    let has_masks = world.effects().contains(Effects::MASKS);
    let nodes = world.partition().len() as u32;
    let build = &mut top.top;
    top.rig.draft(Growth::Double, |draft| {
        let maps = MapQuads { has_masks, ..MapQuads::default() };
        build.reserve(count, nodes, maps, draft).unwrap();
        let masks = if has_masks { build.masks() } else { 0 };
        let home = crate::instance::sector::number(world.home());
        let params = ParamsRecord { masks, home, ..ParamsRecord::default() };
        build.prepare(&mut draft.plan.upload, count, world.partition(), params);
        build.build(&mut draft.plan.upload, pools);
    });
    let (top, rig) = (&top.top, &top.rig);
    let mut leaves: Vec<ClusterRecord> = rig.read(top.clusters());
    let clusters = leaves.split_off(top.capacity() as usize);
    let words: Vec<[u32; 4]> = rig.read(top.nodes());
    let (nodes, records) = words.split_at(top.parts() as usize);
    let stored: &[NodeRecord] = bytemuck::cast_slice(nodes);
    let masks: &[[u32; 4]] = if has_masks { &words[top.masks() as usize..] } else { &[] };
    Built {
        records: bytemuck::cast_slice(&records[..parts.len()]).to_vec(),
        leaves: leaves[..parts.len()].iter().map(cluster_of).collect(),
        parts,
        clusters,
        nodes: stored.iter().map(NodeRecord::node).collect(),
        names: stored.iter().map(|node| node.lights[0]).collect(),
        masks: bytemuck::cast_slice(masks).to_vec(),
    }
}

/// The cluster of a record.
fn cluster_of(record: &ClusterRecord) -> Cluster {
    if record.flux <= 0.0 {
        assert_eq!(*record, ClusterRecord::default(), "all fields of a dark cluster of the top level are 0");
        return Cluster::EMPTY;
    }
    Cluster {
        aabb: Aabb { min: record.box_min.into(), max: record.box_max.into() },
        flux: record.flux,
        area_flux: 0.0,
        punctual_flux: 0.0,
        mean: record.mean.into(),
        variance: record.variance,
        axis: record.axis.into(),
        cos_half_angle: record.cos_half_angle,
        range: record.range,
    }
}

#[test]
fn two_builds_of_one_world_are_equal_bit_for_bit() {
    let mut top = TopRig::new();
    let world = world_of(2000, placement);
    let (first, second) = (build(&mut top, &world), build(&mut top, &world));
    assert_eq!(first.nodes, second.nodes);
    assert_eq!(first.records, second.records);
}
