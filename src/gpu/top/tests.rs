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
use crate::tree::{self, EMPTY_SLOT, LEAF, NO_PARENT};
use crate::{InstanceKey, Light, Placement, Policy, World};

/// Relative difference of sums of up to eight products in f32, taken in different orders or with fused multiply-adds.
const SUMS: f32 = 4.0e-6;

/// Steps by which a packed share, deviation, length or coordinate of a direction may differ: its twin lies across a border
/// between two steps. Caps differ by one more, since they are about the direction that was packed.
const STEP: u8 = 1;

/// The GPU's instances, nodes and their children's clusters after one build, of the slots in use.
struct Built {
    instances: Vec<InstanceRecord>,
    leaves: Vec<Cluster>,
    clusters: Vec<Cluster>,
    nodes: Vec<Node>,
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
fn trees(world: &mut World) -> Vec<crate::TreeKey> {
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
fn world_of(slots: u32, place: impl Fn(u32) -> Placement) -> World {
    let mut world = World::new();
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

fn build(top: &mut TopBuild, world: &World) -> Built {
    let (device, queue) = gpu();
    let slots = world.slot_count();
    let mut instances = vec![InstanceRecord::NONE; slots.max(1)];
    for key in world.instances() {
        let instance = world.instance(key).unwrap();
        instances[slot_of(key) as usize] = InstanceRecord::of(&instance.placed, slot_of(instance.tree), 0, 0);
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
    let starts = level_starts(slots);
    let mut nodes: Vec<Node> = read(&device, &queue, top.nodes());
    nodes.truncate(starts[starts.len() - 1] as usize);
    let clusters = |buffer, count| {
        let records: Vec<ClusterRecord> = read(&device, &queue, buffer);
        records[..count].iter().map(cluster_of).collect()
    };
    Built {
        instances: read(&device, &queue, instances.buffer()),
        leaves: clusters(&top.buffers.leaves, slots),
        clusters: clusters(&top.buffers.clusters, nodes.len() * WIDTH),
        nodes,
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
    assert_eq!(a.range, b.range.min(tree::FARTHEST), "{what}");
    assert!((a.axis - b.axis).length() <= SUMS, "{what}: axis {} {}", a.axis, b.axis);
    assert_eq!(a.cos_half_angle, b.cos_half_angle, "{what}");
}

/// The same node of the same leaves. Boxes, ranges and fluxes are least, greatest and sums in one order: equal bit for bit.
fn assert_same_node(ours: &Node, twin: &Node, index: usize) {
    assert_eq!((ours.parent, ours.steps, ours.targets), (twin.parent, twin.steps, twin.targets), "node {index}");
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
        (outer.range < inner.range.min(tree::FARTHEST), "range"),
        (!is_all && (inner.cos_half_angle <= -1.0 || turn + half_angle(inner) > half_angle(outer)), "cap"),
    ]
    .into_iter()
    .find_map(|(is_broken, what)| is_broken.then_some(what))
}

/// The way up and the way down agree, and each child as it is packed, and its node's own child above, hold what it was
/// packed from.
fn assert_bounds_hold(built: &Built) {
    for (place, inner) in built.clusters.iter().enumerate().filter(|(_, cluster)| cluster.flux > 0.0) {
        let mut place = place;
        loop {
            let node = &built.nodes[place / WIDTH];
            let outer = node.cluster(place % WIDTH);
            assert_eq!(is_outside(&outer, inner), None, "place {place}: {outer:?} {inner:?}");
            if node.parent == NO_PARENT {
                break;
            }
            let above = node.parent as usize;
            assert_eq!(built.nodes[above / WIDTH].targets[above % WIDTH] as usize, place / WIDTH);
            place = above;
        }
    }
}

fn check(top: &mut TopBuild, world: &World) -> Built {
    let built = build(top, world);
    // An instance is what the CPU makes of it.
    for key in world.instances() {
        let slot = slot_of(key) as usize;
        assert_alike(&built.leaves[slot], &world.cluster(key), &format!("instance in slot {slot}"));
    }
    // Of the GPU's own leaves the CPU makes the same tree, place by place.
    let twin = TopLevel::build(&built.leaves);
    assert_eq!(built.nodes.len(), twin.nodes.len());
    for (slot, place) in twin.places.iter().enumerate() {
        assert_eq!(built.instances[slot].top_place, *place, "slot {slot}");
        assert_eq!(built.clusters[*place as usize], built.leaves[slot], "slot {slot}");
    }
    for (index, (ours, other)) in built.nodes.iter().zip(&twin.nodes).enumerate() {
        assert_same_node(ours, other, index);
    }
    assert_bounds_hold(&built);
    built
}

#[test]
fn any_number_of_slots_makes_the_same_tree_as_on_the_cpu() {
    let (device, queue) = gpu();
    let mut top = TopBuild::new(&device, &queue).unwrap();
    // Up and down again: the buffers grow, and what a larger world left behind does no harm.
    for slots in [0, 1, 2, 8, 9, 64, 65, 600, 5000, 513, 7, 0] {
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
fn cones_of_beams_that_agree_stay_narrow_all_the_way_up() {
    let (device, queue) = gpu();
    let mut top = TopBuild::new(&device, &queue).unwrap();
    for widest in [0.0, 1.0e-4, 0.05, 0.9, 1.4] {
        let mut world = World::new();
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
            let half_angle = built.clusters[slot].cos_half_angle.acos();
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
    let mut world = World::new();
    let dark = world.add_tree(vec![Light::point(Vec3::ONE, Vec3::ZERO)]).unwrap();
    for i in 0..20 {
        world.add_instance(dark, placement(i), Policy::default()).unwrap();
    }
    let built = check(&mut top, &world);
    assert!(built.nodes.iter().all(|n| n.flux == [0; WIDTH] && n.targets == [EMPTY_SLOT; WIDTH]));
    assert_eq!(built.nodes[0].parent, NO_PARENT);
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
    let nodes = build(&mut top, &world).nodes;
    for effects in [Effects::empty(), Effects::CONES, Effects::RANGES, Effects::all()] {
        // Instances stay as they are.
        let strides = Strides { instance: Strides::of(Effects::all()).instance, ..Strides::of(effects) };
        top.set_strides(strides);
        build(&mut top, &world);
        let stored: Vec<[u32; 4]> = read(&device, &queue, top.nodes());
        let full: &[[[u32; 4]; 13]] = bytemuck::cast_slice(&nodes);
        for (ours, full) in stored.chunks(strides.node as usize).zip(full) {
            let (core, rest) = full.split_at(10);
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
        let Placed { frame, linear } = instance.placed;
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
                assert!(outer.range >= inner.range.min(tree::FARTHEST));
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
    // Clusters take the most: the largest number of slots whose nodes' fit, and one whole node more.
    let limit = largest_storage_buffer(&device);
    let bytes = (WIDTH * size_of::<ClusterRecord>()) as u64;
    let clusters = |slots: u32| u64::from(*level_starts(slots as usize).last().unwrap_or(&0)) * bytes;
    let (mut fits, mut fails) = (0u32, 1 << 24);
    while fails - fits > 1 {
        let middle = fits.midpoint(fails);
        if clusters(middle) <= limit { fits = middle } else { fails = middle }
    }
    assert_eq!(top.reserve(fails), Err(GpuError::Full { what: "top-level clusters", needed: clusters(fails), limit }));
    assert_eq!(before, (top.generation(), top.buffers.capacity, top.nodes().clone()));
    top.reserve(fits).unwrap();
    assert_eq!((top.generation(), top.buffers.capacity), (2, fits));
}

#[test]
fn the_highest_tree_fits_the_passes() {
    assert_eq!(level_starts(LEAF as usize).len() - 1, MOST_LEVELS as usize);
}

#[test]
fn the_stages_are_valid_and_agree_with_the_host_about_sizes() {
    for stage in [&LEAVES, &KEYS, &PLACE, &LEVEL] {
        let text = stage.text();
        let module = naga::front::wgsl::parse_str(&text).map_err(|e| e.emit_to_string(&text)).expect(stage.entry);
        naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::default())
            .validate(&module)
            .map_err(|e| e.emit_to_string(&text))
            .expect(stage.entry);
        assert_eq!(module.entry_points.len(), 1);
        assert_eq!(module.entry_points[0].name, stage.entry);
        assert_eq!(module.entry_points[0].workgroup_size, [LANES, 1, 1]);
        let (_, pass) = module.types.iter().find(|(_, t)| t.name.as_deref() == Some("TopPass")).unwrap();
        let TypeInner::Struct { members, span } = &pass.inner else { panic!("TopPass is a struct") };
        assert_eq!(*span as usize, size_of::<TopPass>());
        let names: Vec<_> = members.iter().map(|m| (m.name.as_deref().unwrap(), m.offset as usize)).collect();
        assert_eq!(
            names[..10],
            [
                ("slots", std::mem::offset_of!(TopPass, slots)),
                ("first", std::mem::offset_of!(TopPass, first)),
                ("count", std::mem::offset_of!(TopPass, count)),
                ("first_above", std::mem::offset_of!(TopPass, first_above)),
                ("count_above", std::mem::offset_of!(TopPass, count_above)),
                ("node_stride", std::mem::offset_of!(TopPass, strides.node)),
                ("node_cones", std::mem::offset_of!(TopPass, strides.cones)),
                ("node_range", std::mem::offset_of!(TopPass, strides.range)),
                ("light_stride", std::mem::offset_of!(TopPass, strides.light)),
                ("instance_stride", std::mem::offset_of!(TopPass, strides.instance)),
            ]
        );
    }
}
