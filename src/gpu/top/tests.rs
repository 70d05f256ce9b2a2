use glam::{Affine3A, DVec3, EulerRot, Mat3, Quat, Vec3};
use naga::TypeInner;

use super::*;
use crate::bounds::Aabb;
use crate::cluster::Cluster;
use crate::cone::angle;
use crate::gpu::testing::{gpu, read};
use crate::keys::slot_of;
use crate::placement::Placed;
use crate::top::TopLevel;
use crate::tree::{EMPTY_SLOT, LEAF, NO_PARENT, Target, WIDTH};
use crate::{InstanceKey, Light, LightWorld, Placement, Policy};

/// Relative difference of sums of up to eight products in f32, taken in different orders or with fused multiply-adds.
const SUMS: f32 = 4.0e-6;

/// Steps by which a packed share, deviation, length or coordinate of a direction may differ: its twin lies across a
/// border between two steps. Caps differ by one more, since they are about the direction that was packed.
const STEP: u8 = 1;

/// The GPU's instances, their clusters, and nodes with theirs after one build. Nodes that no other refers to are left
/// over.
struct Built {
    instances: Vec<InstanceRecord>,
    leaves: Vec<Cluster>,
    clusters: Vec<ClusterRecord>,
    nodes: Vec<Node>,
}

impl Built {
    /// What the child at a place was packed from.
    fn child(&self, place: usize) -> Cluster {
        match self.nodes[place / WIDTH].target(place % WIDTH) {
            None => Cluster::EMPTY,
            Some(Target::Leaf(slot)) => self.leaves[slot as usize],
            Some(Target::Node(node)) => cluster_of(&self.clusters[node as usize]),
        }
    }

    /// Nodes that the root leads to, the root first.
    fn reached(&self) -> Vec<usize> {
        let mut reached = vec![0];
        let mut next = 0;
        while let Some(node) = reached.get(next) {
            let children: Vec<usize> = (0..WIDTH)
                .filter_map(|slot| match self.nodes[*node].target(slot) {
                    Some(Target::Node(child)) => Some(child as usize),
                    _ => None,
                })
                .collect();
            reached.extend(children);
            next += 1;
        }
        reached
    }
}

/// A number in [0, 1) for each index and purpose.
fn random(index: u32, salt: u32) -> f32 {
    let mix = (u64::from(index) << 32 | u64::from(salt)).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mix = (mix ^ (mix >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (mix >> 40) as f32 / (1u64 << 24) as f32
}

fn random_vec(index: u32, salt: u32) -> Vec3 {
    Vec3::new(random(index, salt), random(index, salt + 1), random(index, salt + 2)) - Vec3::splat(0.5)
}

/// Trees of one to twenty lights, of all kinds.
fn trees(world: &mut LightWorld) -> Vec<crate::TreeKey> {
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
    // Narrow beams only, and one dark tree.
    let beams = (0..6).map(|n| (0..=n).map(|i| light(5 * (i + 7 * n) + 1)).collect());
    let dark = vec![Light::point(Vec3::ZERO, Vec3::ZERO)];
    of_all_kinds.chain(beams).chain([dark]).map(|lights: Vec<Light>| world.add_tree(lights).unwrap()).collect()
}

/// Rotations, mirrors, even and uneven scales, spread over a flat city.
fn placement(i: u32) -> Placement {
    let turn = Quat::from_euler(EulerRot::XYZ, 6.0 * random(i, 20), 6.0 * random(i, 21), 6.0 * random(i, 22));
    let scale = match i % 4 {
        0 => Vec3::ONE,
        1 => Vec3::splat(0.1 + 4.0 * random(i, 23)),
        2 => Vec3::new(-1.0, 1.0, 1.0),
        _ => Vec3::new(0.5, 2.0, 1.0 + random(i, 23)),
    };
    let linear = Mat3::from_quat(turn) * Mat3::from_diagonal(scale);
    let far = Vec3::new(4000.0, 50.0, 3000.0) * random_vec(i, 24);
    Placement { linear, translation: far.as_dvec3() }
}

/// A world of so many slots, every seventh of them empty again, spread by `place`.
fn world_of(slots: u32, place: impl Fn(u32) -> Placement) -> LightWorld {
    let mut world = LightWorld::new();
    let trees = trees(&mut world);
    let keys: Vec<InstanceKey> = (0..slots)
        .map(|i| world.add_instance(trees[i as usize % trees.len()], place(i), Policy::default()).unwrap())
        .collect();
    keys.iter().skip(3).step_by(7).for_each(|key| world.remove_instance(*key).unwrap());
    world
}

fn pool<T: bytemuck::NoUninit>(records: &[T]) -> Pool<T> {
    let (device, queue) = gpu();
    let mut pool = Pool::new(&device, &queue, "test records", 1).unwrap();
    pool.alloc(records.len() as u32).unwrap();
    pool.write(0, records);
    pool
}

fn build(top: &mut TopBuild, world: &LightWorld) -> Built {
    let (device, queue) = gpu();
    let slots = world.slot_count();
    let mut instances = vec![InstanceRecord::NONE; slots.max(1)];
    for key in world.instances() {
        let instance = world.instance(key).unwrap();
        let placed = instance.placed.as_ref().expect("no test hides an instance");
        instances[slot_of(key) as usize] = InstanceRecord::of(placed, slot_of(instance.tree), 0, 0);
    }
    let mut trees = vec![TreeRecord::default(); world.tree_count() + 1];
    for key in world.trees() {
        trees[slot_of(key) as usize] = TreeRecord::of(world.tree(key).unwrap());
    }
    let (instances, trees) = (pool(&instances), pool(&trees));
    top.reserve(slots as u32).unwrap();
    top.bound = None;
    top.bind(&instances, &trees);
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    top.record(&mut Recorder::together(&mut encoder, "test"), slots as u32);
    queue.submit([encoder.finish()]);
    let mut leaves: Vec<ClusterRecord> = read(&device, &queue, &top.buffers.clusters);
    let clusters = leaves.split_off(top.buffers.capacity as usize);
    Built {
        instances: read(&device, &queue, instances.buffer()),
        leaves: leaves[..slots].iter().map(cluster_of).collect(),
        clusters,
        nodes: read(&device, &queue, top.nodes()),
    }
}

fn cluster_of(record: &ClusterRecord) -> Cluster {
    if record.flux <= 0.0 {
        assert_eq!(*record, ClusterRecord::default(), "dark clusters of the top level are zeros");
        return Cluster::EMPTY;
    }
    Cluster {
        aabb: Aabb { min: record.box_min.into(), max: record.box_max.into() },
        flux: record.flux,
        area_flux: 0.0,
        mean: record.mean.into(),
        variance: record.variance,
        axis: record.axis.into(),
        cos_half_angle: record.cos_half_angle,
        range: record.range,
    }
}

fn close(a: f32, b: f32, scale: f32) -> bool {
    (a - b).abs() <= SUMS * scale
}

/// The same cluster, to float rounding.
fn assert_alike(ours: &Cluster, twin: &Cluster, what: &str) {
    assert!((ours.flux - twin.flux).abs() <= SUMS * twin.flux, "{what}: flux {} {}", ours.flux, twin.flux);
    if twin.flux <= 0.0 {
        return;
    }
    let (a, b) = (ours, twin);
    let size = b.aabb.min.abs().max(b.aabb.max.abs()).max_element();
    assert!((a.aabb.min - b.aabb.min).abs().max_element() <= SUMS * size, "{what}: {a:?} {b:?}");
    assert!((a.aabb.max - b.aabb.max).abs().max_element() <= SUMS * size, "{what}: {a:?} {b:?}");
    assert!((a.mean - b.mean).abs().max_element() <= SUMS * size, "{what}: {a:?} {b:?}");
    let spread = b.aabb.extent().length_squared();
    assert!(close(a.variance, b.variance, b.variance + spread), "{what}: variance {} {}", a.variance, b.variance);
    assert_eq!(a.range, b.range.min(tree::UNLIMITED_RANGE), "{what}");
    assert!((a.axis - b.axis).length() <= SUMS, "{what}: axis {} {}", a.axis, b.axis);
    assert_eq!(a.cos_half_angle, b.cos_half_angle, "{what}");
}

/// The same node of the same leaves. Boxes, ranges and fluxes are least, greatest and sums in one order: equal bit for
/// bit.
fn assert_same_node(ours: &Node, twin: &Node, index: usize) {
    assert_eq!(ours.steps, twin.steps, "node {index}");
    assert_eq!((ours.origin, ours.low, ours.high), (twin.origin, twin.low, twin.high), "node {index}");
    assert_eq!((ours.flux, ours.range), (twin.flux, twin.range), "node {index}");
    for slot in 0..WIDTH {
        let near =
            |a: u8, b: u8, steps: u8| assert!(a.abs_diff(b) <= steps, "node {index}, child {slot}: {ours:?} {twin:?}");
        for k in 0..3 {
            near(ours.mean[k][slot], twin.mean[k][slot], STEP);
            assert!(ours.axis[k][slot].abs_diff(twin.axis[k][slot]) <= STEP, "node {index}, child {slot}");
        }
        near(ours.deviation[slot], twin.deviation[slot], STEP);
        near(ours.shortness[slot], twin.shortness[slot], STEP);
        near(ours.cap[slot], twin.cap[slot], 2 * STEP);
    }
}

/// Why a cluster, as walks decode it, does not hold another, if so.
fn is_outside(outer: &Cluster, inner: &Cluster) -> Option<&'static str> {
    let turn = f64::from(angle(outer.axis.normalize_or_zero(), inner.axis.normalize_or_zero()));
    let half_angle = |c: &Cluster| f64::from(c.cos_half_angle).acos();
    let is_all = outer.cos_half_angle <= -1.0;
    [
        (!outer.aabb.contains(&inner.aabb), "box"),
        (outer.range < inner.range.min(tree::UNLIMITED_RANGE), "range"),
        (!is_all && (inner.cos_half_angle <= -1.0 || turn + half_angle(inner) > half_angle(outer)), "cap"),
    ]
    .into_iter()
    .find_map(|(is_broken, what)| is_broken.then_some(what))
}

/// The way up and the way down agree, and each child as it is packed, and its node's own child above, hold what it was
/// packed from.
fn assert_bounds_hold(built: &Built) {
    for node in built.reached() {
        for place in (node * WIDTH..(node + 1) * WIDTH).filter(|place| built.child(*place).flux > 0.0) {
            let inner = built.child(place);
            let mut place = place;
            loop {
                let node = &built.nodes[place / WIDTH];
                let outer = node.cluster(place % WIDTH);
                assert_eq!(is_outside(&outer, &inner), None, "place {place}: {outer:?} {inner:?}");
                if node.parent == NO_PARENT {
                    break;
                }
                let above = node.parent as usize;
                assert_eq!(built.nodes[above / WIDTH].targets[above % WIDTH] as usize, place / WIDTH);
                place = above;
            }
        }
    }
}

/// The same tree, though its nodes lie elsewhere.
fn assert_same_tree(built: &Built, twin: &TopLevel) {
    let mut pairs = vec![(0, 0)];
    let mut next = 0;
    while let Some((ours, theirs)) = pairs.get(next).copied() {
        let (node, other) = (&built.nodes[ours], &twin.nodes[theirs]);
        assert_same_node(node, other, ours);
        for slot in 0..WIDTH {
            match (node.target(slot), other.target(slot)) {
                (Some(Target::Node(a)), Some(Target::Node(b))) => pairs.push((a as usize, b as usize)),
                (a, b) => assert_eq!(a, b, "node {ours} and {theirs}, child {slot}"),
            }
        }
        next += 1;
    }
    assert_eq!(pairs.len(), twin.nodes.len());
}

fn check(top: &mut TopBuild, world: &LightWorld) -> Built {
    let built = build(top, world);
    // An instance is what the CPU makes of it.
    for key in world.instances() {
        let slot = slot_of(key) as usize;
        assert_alike(&built.leaves[slot], &world.cluster(key), &format!("instance in slot {slot}"));
    }
    // Of the GPU's own leaves the CPU makes the same tree.
    let twin = TopLevel::build(&built.leaves);
    for (slot, leaf) in built.leaves.iter().enumerate().filter(|(_, leaf)| leaf.flux > 0.0) {
        let place = built.instances[slot].top_place as usize;
        assert_eq!(built.nodes[place / WIDTH].target(place % WIDTH), Some(Target::Leaf(slot as u32)));
        assert_eq!(built.child(place), *leaf, "slot {slot}");
    }
    assert_same_tree(&built, &twin);
    assert_bounds_hold(&built);
    built
}

#[test]
fn any_number_of_slots_makes_the_same_tree_as_on_the_cpu() {
    let (device, queue) = gpu();
    let mut top = TopBuild::new(&device, &queue).unwrap();
    // Up and down again: the buffers grow, and what a larger world left behind does no harm.
    for slots in [0, 1, 2, 8, 9, 65, 256, 257, 300, 513, 600, 5000, 20_000, 1100, 7, 0] {
        check(&mut top, &world_of(slots, placement));
    }
}

#[test]
fn instances_in_one_point_and_in_a_line_make_a_tree() {
    let (device, queue) = gpu();
    let mut top = TopBuild::new(&device, &queue).unwrap();
    check(&mut top, &world_of(100, |_| Placement::IDENTITY));
    check(&mut top, &world_of(300, |i| Placement::at(DVec3::new(-5.0e6 + f64::from(i) * 0.5, 0.0, 0.0))));
}

#[test]
fn rows_and_grids_of_equal_lamps_make_the_same_tree_as_on_the_cpu() {
    let (device, queue) = gpu();
    let mut top = TopBuild::new(&device, &queue).unwrap();
    // Many cuts cost the same, and many borders of boxes lie within rounding of a step of their node's grid.
    for (side, step) in [(16, 10.0), (23, 10.0), (50, 10.0), (50, 0.1)] {
        let mut world = LightWorld::new();
        let lamp = world.add_tree(vec![Light::point(Vec3::ZERO, Vec3::ONE)]).unwrap();
        for i in 0..side * side {
            let at = DVec3::new(f64::from(i % side) * step, 5.0, f64::from(i / side) * step);
            world.add_instance(lamp, Placement::at(at), Policy::default()).unwrap();
        }
        check(&mut top, &world);
    }
}

#[test]
fn pieces_that_fall_apart_into_single_units_are_cut_into_eights() {
    let (device, queue) = gpu();
    let mut top = TopBuild::new(&device, &queue).unwrap();
    // Each site sheds its farthest instance again and again: four of sixteen stay alone.
    let place = |i: u32| {
        let (site, k) = (i / 16, i % 16);
        Placement::at(
            1000.0 * DVec3::new(f64::from(site % 8), 0.0, f64::from(site / 8)) + 100.0 * DVec3::X / f64::from(1 << k),
        )
    };
    let mut world = LightWorld::new();
    let lamp = world.add_tree(vec![Light::point(Vec3::ZERO, Vec3::ONE)]).unwrap();
    for i in 0..1024 {
        world.add_instance(lamp, place(i), Policy::default()).unwrap();
    }
    let built = check(&mut top, &world);
    let of_eight =
        |node: &usize| (0..WIDTH).all(|slot| matches!(built.nodes[*node].target(slot), Some(Target::Leaf(_))));
    assert!(built.reached().iter().filter(|node| of_eight(node)).count() >= 512 / WIDTH, "one piece at least");
}

#[test]
fn cones_of_beams_that_agree_stay_narrow_all_the_way_up() {
    let (device, queue) = gpu();
    let mut top = TopBuild::new(&device, &queue).unwrap();
    for widest in [0.0, 1.0e-4, 0.05, 0.9, 1.4] {
        let mut world = LightWorld::new();
        let beam = Light::spot(Vec3::ZERO, Vec3::NEG_Y, 0.0, 0.5 * widest + 1.0e-3, Vec3::ONE);
        let tree = world.add_tree(vec![beam]).unwrap();
        for i in 0..520 {
            let turn = Quat::from_scaled_axis(2.0 * widest * random_vec(i, 30));
            let at = Affine3A::from_rotation_translation(turn, 100.0 * random_vec(i, 33));
            world.add_instance(tree, at, Policy::default()).unwrap();
        }
        let built = check(&mut top, &world);
        for slot in (0..WIDTH).filter(|slot| built.nodes[0].flux[*slot] > 0) {
            // Turns of at most sqrt(3) * 0.05 either way, the beam, and the padding of four levels.
            let half_angle = built.child(slot).cos_half_angle.acos();
            assert!(widest > 0.05 || half_angle < 0.2, "{widest}: {half_angle}");
            // Packed: the axis turns by half a step in each coordinate, and the cosine loses at most a step of 1/127.
            let packed = built.nodes[0].cluster(slot).cos_half_angle.acos();
            let cos = (half_angle + 7.0e-3).cos() - 1.0 / tree::CAP_STEPS - 1.0e-3;
            assert!(widest > 0.05 || packed <= cos.acos(), "{widest}: {packed} of {half_angle}");
        }
    }
}

#[test]
fn a_world_without_light_is_a_tree_of_empty_slots() {
    let (device, queue) = gpu();
    let mut top = TopBuild::new(&device, &queue).unwrap();
    let mut world = LightWorld::new();
    let dark = world.add_tree(vec![Light::point(Vec3::ONE, Vec3::ZERO)]).unwrap();
    for i in 0..20 {
        world.add_instance(dark, placement(i), Policy::default()).unwrap();
    }
    let built = check(&mut top, &world);
    let root = &built.nodes[0];
    assert_eq!((root.flux, root.targets, root.parent), ([0; WIDTH], [EMPTY_SLOT; WIDTH], NO_PARENT));
}

#[test]
fn two_builds_of_one_world_are_the_same_bit_for_bit() {
    let (device, queue) = gpu();
    let mut top = TopBuild::new(&device, &queue).unwrap();
    let world = world_of(2000, placement);
    let (first, second) = (build(&mut top, &world), build(&mut top, &world));
    assert_eq!(first.nodes, second.nodes);
    assert_eq!(first.instances, second.instances);
}

#[test]
fn every_layout_stores_the_pieces_of_the_same_nodes() {
    let (device, queue) = gpu();
    let mut top = TopBuild::new(&device, &queue).unwrap();
    let world = world_of(600, placement);
    let built = build(&mut top, &world);
    let full: &[[[u32; 4]; 13]] = bytemuck::cast_slice(&built.nodes);
    for effects in [Effects::empty(), Effects::CONES, Effects::RANGES, Effects::all()] {
        // Instances stay as they are.
        let strides = Strides { instance: Strides::of(Effects::all()).instance, ..Strides::of(effects) };
        top.set_strides(strides);
        build(&mut top, &world);
        let stored: Vec<[u32; 4]> = read(&device, &queue, top.nodes());
        for node in built.reached() {
            let ours = &stored[node * strides.node as usize..][..strides.node as usize];
            let (core, rest) = full[node].split_at(10);
            assert_eq!(&ours[..10], core);
            if strides.cones > 0 {
                assert_eq!(ours[strides.cones as usize..][..2], rest[..2]);
            }
            if strides.range > 0 {
                assert_eq!(ours[strides.range as usize], rest[2]);
            }
        }
    }
}

#[test]
fn every_child_on_the_way_up_holds_every_light_of_an_instance() {
    let (device, queue) = gpu();
    let mut top = TopBuild::new(&device, &queue).unwrap();
    let world = world_of(400, placement);
    let built = build(&mut top, &world);
    let mut caps = 0;
    for key in world.instances() {
        let slot = slot_of(key) as usize;
        let instance = world.instance(key).unwrap();
        let Placed { frame, linear } = instance.placed.expect("no test hides an instance");
        for light in world.tree(instance.tree).unwrap().lights().iter().filter(|l| l.flux() > 0.0) {
            let inner = light.cluster();
            let mut place = built.instances[slot].top_place as usize;
            assert_eq!(built.nodes[place / WIDTH].targets[place % WIDTH], LEAF | slot as u32);
            while place != NO_PARENT as usize {
                let node = &built.nodes[place / WIDTH];
                let outer = node.cluster(place % WIDTH);
                for corner in [inner.aabb.min, inner.aabb.max, inner.aabb.center()] {
                    let exact = frame.to_world.as_dmat3() * corner.as_dvec3() + frame.translation.as_dvec3();
                    assert!(
                        exact.cmpge(outer.aabb.min.as_dvec3()).all() && exact.cmple(outer.aabb.max.as_dvec3()).all()
                    );
                }
                assert!(outer.range >= inner.range.min(tree::UNLIMITED_RANGE));
                assert!(outer.cos_half_angle <= -1.0 || linear.is_similarity);
                if outer.cos_half_angle > -1.0 {
                    let axis = (frame.to_world * inner.axis).normalize();
                    let reach = f64::from(angle(outer.axis.normalize(), axis)) + f64::from(inner.cos_half_angle).acos();
                    assert!(reach <= f64::from(outer.cos_half_angle).acos(), "{outer:?} {inner:?}");
                    caps += 1;
                }
                place = node.parent as usize;
            }
        }
    }
    assert!(caps > 100, "the test must see many caps, not {caps}");
}

#[test]
fn more_slots_than_the_device_binds_are_refused_and_change_nothing() {
    let (device, queue) = gpu();
    let mut top = TopBuild::new(&device, &queue).unwrap();
    top.reserve(100).unwrap();
    assert_eq!(top.generation(), 1);
    top.reserve(100).unwrap();
    let before = (top.generation(), top.buffers.capacity, top.nodes().clone());
    // The largest number of slots whose clusters and nodes fit, and one more.
    let limit = largest_storage_buffer(&device);
    let needed = |slots: u32| {
        let nodes = u64::from(Plan::new(slots, slots, Strides::of(Effects::all())).nodes);
        let clusters = (u64::from(slots) + nodes) * size_of::<ClusterRecord>() as u64;
        [("top-level clusters", clusters), ("top-level nodes", nodes * size_of::<Node>() as u64)]
    };
    let too_much = |slots: u32| needed(slots).into_iter().find(|(_, needed)| *needed > limit);
    let (mut fits, mut fails) = (0u32, 1 << 24);
    while fails - fits > 1 {
        let middle = fits.midpoint(fails);
        if too_much(middle).is_none() { fits = middle } else { fails = middle }
    }
    assert!(fits > 1_400_000, "a million instances and more have room, not {fits}");
    let (what, needed) = too_much(fails).unwrap();
    assert_eq!(top.reserve(fails), Err(GpuError::Full { what, needed, limit }));
    assert_eq!(before, (top.generation(), top.buffers.capacity, top.nodes().clone()));
    top.reserve(fits).unwrap();
    assert_eq!((top.generation(), top.buffers.capacity), (2, fits));
}

#[test]
fn the_longest_plan_fits_the_passes() {
    // Beyond that, no buffer could hold the nodes' indices.
    for slots in [0, 1, 256, 257, 512, 513, 100_000, 1 << 20, 1 << 30] {
        let plan = Plan::new(slots, slots, Strides::of(Effects::all()));
        assert!(plan.passes.len() <= MAX_ROUNDS as usize, "{slots}: {}", plan.passes.len());
        assert!(u64::from(plan.nodes) <= u64::from(slots) / 2 + 1024, "{slots}: {}", plan.nodes);
    }
}

#[test]
fn the_stages_are_valid_and_agree_with_the_host_about_sizes() {
    for stage in [&LEAVES, &KEYS, &GROUP, &NODE, &ROOT_GROUP, &ROOT] {
        let text = stage.text();
        let module = naga::front::wgsl::parse_str(&text).map_err(|e| e.emit_to_string(&text)).expect(stage.entry);
        naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::default())
            .validate(&module)
            .map_err(|e| e.emit_to_string(&text))
            .expect(stage.entry);
        assert_eq!(module.entry_points.len(), 1);
        assert_eq!(module.entry_points[0].name, stage.entry);
        let lanes = if stage.piece > 0 { SPLIT_LANES } else { LANES };
        assert_eq!(module.entry_points[0].workgroup_size, [lanes, 1, 1]);
        let (_, pass) = module.types.iter().find(|(_, t)| t.name.as_deref() == Some("TopPass")).unwrap();
        let TypeInner::Struct { members, span } = &pass.inner else { panic!("TopPass is a struct") };
        assert_eq!(*span as usize, size_of::<TopPass>());
        let names: Vec<_> = members.iter().map(|m| (m.name.as_deref().unwrap(), m.offset as usize)).collect();
        assert_eq!(
            names,
            [
                ("slots", std::mem::offset_of!(TopPass, slots)),
                ("capacity", std::mem::offset_of!(TopPass, capacity)),
                ("units_before", std::mem::offset_of!(TopPass, units_before)),
                ("pieces_before", std::mem::offset_of!(TopPass, pieces_before)),
                ("units_after", std::mem::offset_of!(TopPass, units_after)),
                ("pieces", std::mem::offset_of!(TopPass, pieces)),
                ("first_node", std::mem::offset_of!(TopPass, first_node)),
                ("node_stride", std::mem::offset_of!(TopPass, strides.node)),
                ("node_cones", std::mem::offset_of!(TopPass, strides.cones)),
                ("node_range", std::mem::offset_of!(TopPass, strides.range)),
                ("light_stride", std::mem::offset_of!(TopPass, strides.light)),
                ("instance_stride", std::mem::offset_of!(TopPass, strides.instance)),
            ]
        );
    }
}
