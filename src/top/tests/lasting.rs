//! A partition that has lasted is about as good as a fresh one, whatever has moved.

use super::*;
use crate::keys::InstanceKey;

/// The partition of a world's parts, divided by all of them.
fn fresh(parts: &[(Part, Cluster)]) -> Partition {
    let mut partition = Partition::default();
    for of_slot in parts.chunk_by(|a, b| a.0.slot == b.0.slot) {
        partition.file(of_slot[0].0.slot, of_slot.iter().map(|(_, cluster)| Place::of(cluster, 1)));
    }
    let first = |slot: u32| parts.partition_point(|(part, _)| part.slot < slot);
    partition.renew(usize::MAX, |part| parts[first(part.slot) + part.index as usize].1);
    partition
}

/// The noise of a world relative to that of a fresh partition: the mean and the geometric mean over some points within
/// the corners.
fn over_fresh(world: &LightWorld, [min, max]: [Vec3; 2]) -> [f64; 2] {
    let (parts, slots) = (world.parts(), world.slot_count());
    let at = |i: usize| min + (max - min) * Vec3::new(random(i, 20), random(i, 21), random(i, 22));
    let points: Vec<ShadingPoint> = (0..64).map(|i| ShadingPoint::surface(at(i), Vec3::Y)).collect();
    let [ours, best] = [world.partition(), &fresh(&parts)].map(|partition| {
        let top = TopLevel::build(&parts, slots, partition);
        sigmas(&world.sampler().with_top(&top), &points)
    });
    let ratio = |value: fn(f64) -> f64, back: fn(f64) -> f64| {
        let [ours, best] = [&ours, &best].map(|all| all.iter().map(|s| value(*s)).sum::<f64>() / all.len() as f64);
        back(ours) / back(best)
    };
    [ratio(|s| s, |s| s), ratio(f64::ln, f64::exp)]
}

/// A field of lamps, each an instance, in a world that was updated.
fn field(count: usize, size: f32) -> (LightWorld, Vec<InstanceKey>) {
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(vec![Light::point(Vec3::ZERO, Vec3::splat(30.0))]).expect("valid"));
    let at = |i: usize| size * Vec3::new(random(i, 30), 0.0, random(i, 31)) + 3.0 * Vec3::Y;
    let place = |i: usize| Placement::at(at(i).as_dvec3());
    let keys = (0..count).map(|i| world.add_instance(tree, place(i), Policy::Static).expect("valid")).collect();
    world.update(FrameBudget::NONE);
    (world, keys)
}

/// Updates until no planes are under way.
fn settle(world: &mut LightWorld) {
    world.update(FrameBudget::NONE);
    for _ in 0..1000 {
        if !world.partition().is_dividing() {
            return;
        }
        world.update(FrameBudget::NONE);
    }
    panic!("planes are under way after a thousand updates");
}

fn shift(world: &mut LightWorld, key: InstanceKey, by: Vec3) {
    let mut placement = world.instance(key).expect("it lives").placement;
    placement.translation += by.as_dvec3();
    world.move_instance(key, placement).expect("valid");
}

#[track_caller]
fn assert_over_fresh(world: &LightWorld, corners: [Vec3; 2], most: f64) {
    world.partition().check();
    let [mean, typical] = over_fresh(world, corners);
    assert!(mean.max(typical) < most, "{mean} {typical}");
}

#[test]
fn the_partition_of_a_city_lasts_through_traffic_and_teleports() {
    let mut world = city(3000);
    let size = 12.0 * 3000.0_f32.sqrt();
    let corners = [Vec3::ZERO, Vec3::new(size, 0.0, size)];
    world.update(FrameBudget::NONE);
    let keys: Vec<InstanceKey> = world.instances().collect();
    // Twenty seconds of traffic, in half seconds: one of ten drives at 15 m/s, along streets and across.
    let drive = |world: &mut LightWorld, length: f32| {
        for (i, key) in keys.iter().enumerate().filter(|(i, _)| i % 10 == 0) {
            let way = if i % 20 == 0 { Vec3::X } else { Vec3::Z };
            shift(world, *key, length * way * if random(i, 40) < 0.5 { 1.0 } else { -1.0 });
        }
        world.update(FrameBudget::NONE);
    };
    (0..40).for_each(|_| drive(&mut world, 7.5));
    assert_over_fresh(&world, corners, 1.2);
    // Half of all turn up elsewhere.
    for (i, key) in keys.iter().enumerate().filter(|(i, _)| i % 2 == 0) {
        let at = size * Vec3::new(random(i, 41), 0.0, random(i, 42).powi(2));
        world.move_instance(*key, Placement::at(at.as_dvec3())).expect("valid");
    }
    settle(&mut world);
    assert_over_fresh(&world, corners, 1.2);
}

#[test]
fn the_partition_of_a_field_lasts_while_it_grows() {
    // From nothing, a hundred at a time; then half as many more at once, in one quarter.
    let (mut world, _) = field(0, 0.0);
    let tree = world.trees().next().expect("a tree");
    let add = |world: &mut LightWorld, i: usize, size: f32| {
        let at = size * Vec3::new(random(i, 30), 0.0, random(i, 31)) + 3.0 * Vec3::Y;
        world.add_instance(tree, Placement::at(at.as_dvec3()), Policy::Static).expect("valid");
    };
    for step in 0..60 {
        (0..100).for_each(|i| add(&mut world, 100 * step + i, 1000.0));
        world.update(FrameBudget::NONE);
    }
    settle(&mut world);
    assert_over_fresh(&world, [Vec3::ZERO, Vec3::new(1000.0, 0.0, 1000.0)], 1.2);
    (6000..9000).for_each(|i| add(&mut world, i, 500.0));
    settle(&mut world);
    assert_over_fresh(&world, [Vec3::ZERO, Vec3::new(1000.0, 0.0, 1000.0)], 1.2);
}

#[test]
fn the_partition_follows_a_crowd_that_crosses_a_field() {
    let (mut world, keys) = field(6000, 1000.0);
    // Those of one corner are the crowd, which walks to the other one.
    let crowd: Vec<InstanceKey> = keys[..2000].to_vec();
    for (i, key) in crowd.iter().enumerate() {
        let at = 60.0 * Vec3::new(random(i, 50), 0.0, random(i, 51)) + 2.0 * Vec3::Y;
        world.move_instance(*key, Placement::at(at.as_dvec3())).expect("valid");
    }
    settle(&mut world);
    for step in 1..=300 {
        crowd.iter().for_each(|key| shift(&mut world, *key, Vec3::new(2.0, 0.0, 2.0)));
        world.update(FrameBudget::NONE);
        if step % 60 == 0 {
            let corner = 2.0 * step as f32 * Vec3::new(1.0, 0.0, 1.0);
            // A point at the edge of the crowd may lie in a cell with both kinds of lamps.
            assert_over_fresh(&world, [corner, corner + 60.0 * Vec3::new(1.0, 0.0, 1.0)], 2.0);
            assert_over_fresh(&world, [Vec3::ZERO, Vec3::new(1000.0, 0.0, 1000.0)], 1.2);
        }
    }
}
