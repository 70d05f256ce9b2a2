//! Conversions of records to another layout.

use glam::{DVec3, Mat3, Quat, Vec3};

use super::Rig;
use super::pool::TestPool;
use crate::effects::Effects;
use crate::instance::appearance::Appearance;
use crate::instance::placement::{Anchor, Placed, Placement};
use crate::light::Light;
use crate::plan::layout::{Bases, InstanceRecord, LightRecord};
use crate::plan::node_record::NodeRecord;
use crate::plan::stored::{Missing, Stored, missing_of_instance, missing_of_light, missing_of_node};
use crate::tree::LightTree;

/// Effects that between them use every layout of every record.
const LAYOUTS: [Effects; 14] = [
    Effects::empty(),
    Effects::CONES,
    Effects::RANGES,
    Effects::CONES.union(Effects::RANGES),
    Effects::AREAS,
    Effects::DIRECTIONAL,
    Effects::NON_RIGID,
    Effects::NON_RIGID.union(Effects::CONES),
    Effects::FACTORS,
    Effects::NON_RIGID.union(Effects::MASKS),
    Effects::SECTORS,
    Effects::SECTORS.union(Effects::NON_RIGID),
    Effects::SECTORS.union(Effects::FACTORS),
    Effects::all(),
];

/// A tree of lights that need no more than these effects; some of the lights are dark.
fn tree(effects: Effects) -> LightTree {
    let light = |i: u32| {
        let at = Vec3::new((i * 7 % 50) as f32, (i * 13 % 31) as f32, (i * 3 % 17) as f32);
        let emission = if i.is_multiple_of(11) { Vec3::ZERO } else { Vec3::splat(1.0 + i as f32) };
        let light = match i % 3 {
            1 if effects.contains(Effects::CONES) => Light::spot(at, Vec3::NEG_Y, 0.2, 0.9, emission),
            2 if effects.contains(Effects::AREAS) => Light::sphere(at, 0.1, emission),
            _ => Light::point(at, emission),
        };
        if effects.contains(Effects::RANGES) && i.is_multiple_of(2) { light.with_range(5.0) } else { light }
    };
    LightTree::new((0..100).map(light).collect()).expect("valid lights")
}

/// Instances that need no more than these effects; some of the slots are empty.
fn instances(effects: Effects) -> Vec<InstanceRecord> {
    let instance = |i: u32| {
        if i.is_multiple_of(5) {
            return InstanceRecord::NONE;
        }
        let rotation = Mat3::from_quat(Quat::from_axis_angle(Vec3::new(1.0, 2.0, 3.0).normalize(), 0.1 * i as f32));
        let scale = if effects.contains(Effects::NON_RIGID) { 0.5 + i as f32 } else { 1.0 };
        let placement = Placement { linear: rotation * scale, translation: DVec3::new(f64::from(i), 2.0, -30_000.0) };
        let has_sectors = effects.contains(Effects::SECTORS);
        let anchor = if has_sectors { Anchor::Sector } else { Anchor::Point(DVec3::ZERO) };
        let placed = Placed::new(&placement, anchor).expect("a valid placement").expect("not hidden");
        assert_eq!(placed.linear.is_rigid(), scale == 1.0);
        let mut appearance = Appearance::default();
        if effects.contains(Effects::FACTORS) && i.is_multiple_of(3) {
            appearance.set_factor(Vec3::new(0.5, 2.0, i as f32));
        }
        if effects.contains(Effects::MASKS) {
            appearance.mask = i;
        }
        InstanceRecord::of(&placed, &appearance, Bases { tree: i, node: 10 * i, light: 20 * i, ..Bases::default() })
    };
    (0..40).map(instance).collect()
}

/// Compares a pool that was filled in one layout and then copied to another with a pool that
/// was filled in the other layout.
fn check<T: bytemuck::NoUninit>(rig: &mut Rig, records: &[T], stored: [&Stored; 2], missing: fn(usize) -> Missing) {
    let [before, after] = stored;
    let mut moved = TestPool::new(rig, 1, 128 << 20, missing);
    moved.set_layout(rig, before);
    let mut fresh = TestPool::new(rig, 1, 128 << 20, missing);
    fresh.set_layout(rig, after);
    for (pool, stored) in [(&mut moved, before), (&mut fresh, after)] {
        pool.alloc(rig, records.len() as u32).expect("room enough");
        assert_eq!(pool.write(rig, 0, records), (records.len() * stored.bytes()) as u64);
    }
    moved.set_layout(rig, after);
    let bytes = |pool: &TestPool<T>| rig.read::<u32>(pool.pool.buffer());
    assert_eq!(bytes(&moved), bytes(&fresh), "{before:?} to {after:?}");
    let buffers = [moved.pool.buffer(), fresh.pool.buffer()];
    rig.player.free(&buffers);
}

#[test]
fn a_copy_to_a_new_layout_equals_an_upload_in_that_layout_byte_for_byte() {
    let mut rig = Rig::new();
    for before in LAYOUTS {
        for after in LAYOUTS {
            let tree = tree(before & after);
            let nodes: Vec<NodeRecord> = tree.nodes().iter().map(NodeRecord::of).collect();
            check(&mut rig, &nodes, [before, after].map(Stored::nodes).each_ref(), missing_of_node);
            let lights: Vec<_> =
                tree.lights().iter().zip(tree.leaves()).map(|(l, place)| LightRecord::of(l, *place)).collect();
            check(&mut rig, &lights, [before, after].map(Stored::lights).each_ref(), missing_of_light);
            let instances = instances(before & after);
            check(&mut rig, &instances, [before, after].map(Stored::instances).each_ref(), missing_of_instance);
        }
    }
}

#[test]
fn more_workgroups_than_fit_into_one_dimension_copy_all_records() {
    let mut rig = Rig::new();
    // A record has 160 bytes, which 10 invocations of 64 in a workgroup copy.
    let count = 65_540 * 64 / 10;
    let mut pool = TestPool::<InstanceRecord>::new(&mut rig, 1, 128 << 20, missing_of_instance);
    pool.set_layout(&mut rig, &Stored::instances(Effects::empty()));
    pool.alloc(&mut rig, count).expect("room enough");
    let last = InstanceRecord { flags: 7, first_part: 9, ..InstanceRecord::NONE };
    pool.write(&mut rig, count - 1, &[last]);
    pool.set_layout(&mut rig, &Stored::instances(Effects::all()));
    let words: Vec<u32> = rig.read(pool.pool.buffer());
    assert_eq!((words.len() / 40, words[words.len() - 28], words[words.len() - 24]), (count as usize, 7, 9));
}
