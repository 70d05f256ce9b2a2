//! The origin of large worlds: sampling far from zero, and across moves of the origin.

use girandole::glam::{DVec3, Mat3, Vec3};
use girandole::plan::{FramePlan, LightPlanner, PlanLimits};
use girandole::{
    Changes, FrameBudget, InstanceKey, Light, LightId, LightSampler, LightWorld, MAX_DISTANCE, ORIGIN_GRID, Placement,
    Policy, ShadingPoint, WorldError,
};

use crate::gpu::{OTHER_PICKS, compare, gpu_lights, requests, sample};
use girandole::LightTree;
use testbed::testing::support::{Rng, all_pmfs};

/// 10,000 km from zero, on the grid.
const FAR: DVec3 = DVec3::new(9_766.0 * ORIGIN_GRID, -8_000.0 * ORIGIN_GRID, 9_766.0 * ORIGIN_GRID);

/// Translations and shading points are multiples of this, in metres: f32 then holds them exactly up
/// to 4 km from the origin, and f64 everywhere.
const STEP: f64 = 1.0 / 4096.0;

fn stepped(position: DVec3) -> DVec3 {
    (position / STEP).round() * STEP
}

/// A world of all kinds of lights and instances within `size` of `around`, which is on the grid.
fn world_at(around: DVec3, size: f32) -> LightWorld {
    let mut rng = Rng(90);
    let mut world = LightWorld::new();
    world.set_origin_near(around).expect("within the limits");
    for _ in 0..12 {
        let tree = world.add_tree(LightTree::new(rng.lights(25, 8.0)).expect("valid"));
        for i in 0..6 {
            let here = Placement::from(rng.affine(size));
            let translation = around + stepped(here.translation);
            // A third is only translated and turned.
            let linear = if i % 3 == 0 { Mat3::from_rotation_y(rng.between(0.0, 6.0)) } else { here.linear };
            world.add_instance(tree, Placement { linear, translation }, Policy::Budgeted).expect("valid");
        }
    }
    let keys: Vec<InstanceKey> = world.instances().collect();
    keys.iter()
        .step_by(4)
        .for_each(|key| world.set_appearance(*key, |a| a.factor = Vec3::new(0.5, 2.0, 1.0)).expect("valid"));
    keys.iter().step_by(5).for_each(|key| world.set_appearance(*key, |a| a.mask = 0b110).expect("it lives"));
    world.update(FrameBudget::NONE);
    world
}

/// Points of the world near its instances, with their normals.
fn points_at(around: DVec3, size: f32, count: usize) -> Vec<(DVec3, Vec3)> {
    let mut rng = Rng(91);
    (0..count).map(|_| (around + stepped(rng.position(size).as_dvec3()), rng.direction())).collect()
}

fn seen(world: &LightWorld, (position, normal): (DVec3, Vec3)) -> ShadingPoint {
    ShadingPoint::surface((position - world.origin()).as_vec3(), normal)
}

/// All that sampling returns at a point: probabilities, and samples with given random numbers.
fn outcome(sampler: &LightSampler, at: &ShadingPoint) -> (Vec<(LightId, f32)>, Vec<String>) {
    let draw = |i: u16| {
        let u = [0.618, 0.317, 0.755, 0.569].map(|step| (step * f32::from(i)).fract());
        let sample = sampler.sample(at, u)?;
        let hit = at.position + sample.incident.direction * sample.incident.dist;
        Some((sample, sampler.pdf(at, sample.light, hit)))
    };
    (all_pmfs(sampler, at), (0..24).map(|i| format!("{:?}", draw(i))).collect())
}

#[test]
fn ten_thousand_kilometres_from_zero_sampling_is_bit_for_bit_that_at_zero() {
    // Within one sector, and over twenty-five of them.
    for size in [60.0, 2500.0] {
        let plain = world_at(DVec3::ZERO, size);
        let far = world_at(FAR, size);
        let near = points_at(DVec3::ZERO, size, 60);
        let mut lit = 0;
        for ((position, normal), at_zero) in points_at(FAR, size, 60).into_iter().zip(near) {
            let expected = outcome(&plain.sampler(), &seen(&plain, at_zero));
            assert_eq!(outcome(&far.sampler(), &seen(&far, (position, normal))), expected, "{position}");
            lit += expected.0.iter().filter(|(_, pmf)| *pmf > 0.0).count();
        }
        assert!(lit > 60 * 100, "{lit}");
    }
}

/// What the lights of a world are at some points: their probabilities, and a place on each.
fn lights_at(world: &LightWorld, points: &[(DVec3, Vec3)]) -> (Vec<f32>, Vec<DVec3>) {
    let sampler = world.sampler();
    let (mut pmfs, mut places) = (Vec::new(), Vec::new());
    for point in points {
        let at = seen(world, *point);
        for (light, pmf) in all_pmfs(&sampler, &at) {
            pmfs.push(pmf);
            if let Some(incident) = sampler.sample_light(&at, light, [0.3, 0.6]) {
                places.push(point.0 + incident.direction.as_dvec3() * f64::from(incident.dist));
            }
        }
    }
    (pmfs, places)
}

#[test]
fn nothing_jumps_when_the_origin_moves() {
    let mut world = world_at(FAR, 300.0);
    // f32 holds these exactly, so only the world's own rounding is left.
    let points = points_at(FAR, 300.0, 40);
    let (pmfs, places) = lights_at(&world, &points);
    let children = |world: &LightWorld| {
        let nodes = world.sampler().top_nodes();
        nodes.iter().map(|node| std::array::from_fn::<_, 8, _>(|slot| node.child(slot))).collect::<Vec<_>>()
    };
    let tree = children(&world);
    for step in [DVec3::X, DVec3::new(-1.0, 0.0, 1.0), DVec3::new(2.0, 1.0, -2.0)] {
        world.set_origin_near(FAR + 1.25 * step * ORIGIN_GRID).expect("within the limits");
        let (new_pmfs, new_places) = lights_at(&world, &points);
        assert!(places.len() > 1000 && places.len() == new_places.len());
        let apart = places.iter().zip(&new_places).map(|(a, b)| (a - b).length()).fold(0.0, f64::max);
        let ratios: Vec<f64> = pmfs
            .iter()
            .zip(&new_pmfs)
            .filter(|(a, b)| **a > 0.0 || **b > 0.0)
            .map(|(a, b)| f64::from((a - b).abs() / a.max(*b)))
            .collect();
        let (largest, mean) =
            (ratios.iter().copied().fold(0.0, f64::max), ratios.iter().sum::<f64>() / ratios.len() as f64);
        assert_eq!(apart, 0.0);
        assert_eq!(children(&world), tree, "the top level is the same tree");
        // The nodes of the top level hold boxes in 255 steps, and a coordinate that rounds
        // differently may take another step: a hundredth of a probability, for few lights. Origins
        // differ by 1e-4 m of rounding, and a node of 60 m has steps of 0.24 m. So one in 2,400 of
        // the nine coordinates of a child takes another step there, and fewer in larger nodes: on the
        // way to a light one in 200 at most, for a mean of 0.01 / 200. The smallest nodes are a
        // quarter of that size, which makes it four times as much.
        assert!(largest < 0.03 && mean < 2.0e-4, "{largest} {mean}");
    }
}

#[test]
fn lamps_with_all_digits_are_where_they_are_to_an_ulp_of_their_coordinates() {
    // The rounding of a coordinate of 1 to 2 km in f32, and of a distance of up to 90 m.
    const BOUND: f64 = 1.25e-4 + 2.0e-5;
    let mut rng = Rng(93);
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(vec![Light::point(Vec3::ZERO, Vec3::ONE)]).expect("valid"));
    let mut largest: f64 = 0.0;
    for i in 0..2000 {
        let metres = f64::from(rng.unit()) * 1.0e7;
        let camera = on_flight(metres / 1000.0);
        world.set_origin_near(camera).expect("within the limits");
        let away = |rng: &mut Rng| rng.position(25.0).as_dvec3() / 3.0;
        let (lamp, point) = (camera + away(&mut rng), camera + 3.0 * away(&mut rng));
        let key = world.add_instance(tree, Placement::at(lamp), Policy::Static).expect("within the limits");
        let at = ShadingPoint::volume((point - world.origin()).as_vec3());
        let light = LightId::Local { instance: key, light: 0 };
        let incident = world.sampler().sample_light(&at, light, [0.5; 2]).expect("it shines");
        let seen = world.origin() + at.position.as_dvec3() + incident.direction.as_dvec3() * f64::from(incident.dist);
        largest = largest.max((seen - lamp).abs().max_element());
        assert!(largest <= BOUND, "{largest} m, lamp {i}");
        world.remove_instance(key).expect("it lives");
    }
    assert!(largest > 2.0e-5, "{largest}: as good as exact, so the bound is not tested");
}

/// Where a camera is, in kilometres along a line from [`FAR`].
fn on_flight(kilometres: f64) -> DVec3 {
    FAR + DVec3::new(1000.0 * kilometres, 0.3, -400.0 * kilometres)
}

/// What changes in a frame with the origin near a camera.
fn frame(world: &mut LightWorld, camera: DVec3) -> Changes<'_> {
    let seen = world.revision();
    world.set_origin_near(camera).expect("within the limits");
    world.update(FrameBudget::NONE);
    world.changes_since(seen)
}

#[test]
fn a_flight_of_ten_thousand_kilometres_and_back_leaves_every_bit_as_it_was() {
    let mut world = world_at(FAR, 60.0);
    let start = points_at(FAR, 60.0, 12);
    let outcomes = |world: &LightWorld| {
        let sampler = world.sampler();
        start.iter().map(|point| outcome(&sampler, &seen(world, *point))).collect::<Vec<_>>()
    };
    let before = outcomes(&world);
    let (mut origin, mut shifts) = (world.origin(), 0);
    let steps = 0..=30_000;
    for step in steps.clone().chain(steps.rev()) {
        let viewpoint = on_flight(f64::from(step) / 3.0);
        let changes = frame(&mut world, viewpoint);
        assert!(changes.moved_instances().next().is_none() && changes.removed_instances().next().is_none());
        assert_eq!(changes.is_empty(), changes.origin_shift().is_none());
        let shift = changes.origin_shift();
        assert_eq!(world.update(FrameBudget::NONE).moved_instances, 0);
        if let Some(shift) = shift {
            assert_eq!(origin + shift, world.origin(), "exact");
            assert!((viewpoint - world.origin()).abs().max_element() <= 0.5 * ORIGIN_GRID);
            (origin, shifts) = (world.origin(), shifts + 1);
        }
        assert_eq!(origin, world.origin());
        assert!(origin.to_array().iter().all(|v| v % ORIGIN_GRID == 0.0));
        assert!((viewpoint - origin).abs().max_element() <= ORIGIN_GRID);
    }
    // One for each step of the grid, in both directions.
    assert!((19_000..20_000).contains(&shifts), "{shifts}");
    // The way back ends with the camera exactly one step from the origin, which stays until it is more.
    frame(&mut world, FAR - DVec3::X);
    assert_eq!(world.origin(), FAR);
    assert!(outcomes(&world) == before);
}

#[test]
fn a_camera_that_turns_around_moves_the_origin_only_after_half_a_step() {
    let mut world = LightWorld::new();
    let mut at = |x: f64| frame(&mut world, DVec3::new(x, 0.0, -x)).origin_shift();
    let shift = DVec3::new(ORIGIN_GRID, 0.0, -ORIGIN_GRID);
    assert_eq!(at(ORIGIN_GRID), None, "the border itself is still near");
    assert_eq!(at(ORIGIN_GRID + 0.5), Some(shift));
    for back in [0.0, ORIGIN_GRID, 1.0, ORIGIN_GRID, 0.0] {
        assert_eq!(at(back), None);
    }
    assert_eq!(at(-0.5), Some(-shift));
    // A teleport moves it once, and a return within one frame not at all.
    let far = 488_281.0 * ORIGIN_GRID;
    assert_eq!(at(far + 511.0), Some(DVec3::new(far, 0.0, -far)));
    let seen = world.revision();
    world.set_origin_near(DVec3::ZERO).expect("near");
    assert_eq!(world.origin(), DVec3::ZERO);
    frame(&mut world, DVec3::new(far, 0.0, -far));
    assert!(world.changes_since(seen).is_empty());
}

#[test]
fn a_position_that_is_refused_leaves_the_origin_where_it_is() {
    let mut world = world_at(FAR, 60.0);
    let before = (world.origin(), world.revision());
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, MAX_DISTANCE.next_up(), -10.0 * MAX_DISTANCE] {
        assert!(matches!(world.set_origin_near(DVec3::new(0.0, bad, 0.0)), Err(WorldError::Value(_))));
    }
    assert_eq!((world.origin(), world.revision()), before);
}

#[test]
fn instances_at_the_limit_never_keep_the_origin_from_moving() {
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(vec![Light::point(Vec3::ZERO, Vec3::ONE)]).expect("valid"));
    let mut add = |x: f64| world.add_instance(tree, Placement::at(DVec3::splat(x)), Policy::Static);
    let ends = [add(-MAX_DISTANCE), add(MAX_DISTANCE)].map(|key| key.expect("at the limit"));
    let refused = |result: Result<(), WorldError>| match result.expect_err("beyond the limit") {
        WorldError::Value(error) => (error.value, error.max),
        other => panic!("{other}"),
    };
    let beyond = (MAX_DISTANCE.next_up(), MAX_DISTANCE);
    assert_eq!(refused(add(MAX_DISTANCE.next_up()).map(drop)), beyond);
    assert_eq!(refused(world.move_instance(ends[0], Placement::at(DVec3::X * MAX_DISTANCE.next_up()))), beyond);
    for x in [MAX_DISTANCE, 0.0, -MAX_DISTANCE] {
        frame(&mut world, DVec3::splat(x));
        assert!((world.origin() - x).abs().max_element() <= 0.5 * ORIGIN_GRID);
        // Seen from one end, the other is 3.5 million kilometres away.
        let pmfs = all_pmfs(&world.sampler(), &ShadingPoint::volume(Vec3::ZERO));
        assert!(pmfs.iter().all(|(_, pmf)| *pmf > 0.0));
        assert!((pmfs.iter().map(|(_, pmf)| pmf).sum::<f32>() - 1.0).abs() < 1.0e-5, "{pmfs:?}");
    }
}

/// A world of lamps in rows, and a planner that has sent it.
fn rows(instances: u32) -> (LightWorld, LightPlanner) {
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(vec![Light::point(Vec3::ZERO, Vec3::ONE); 3]).expect("valid"));
    for i in 0..instances {
        let at = DVec3::new(f64::from(i % 100) * 300.0, f64::from(i / 100) * 500.0, 3.0);
        world.add_instance(tree, Placement::at(at), Policy::Static).expect("valid");
    }
    let mut planner = LightPlanner::new(PlanLimits::default());
    frame(&mut world, DVec3::ZERO);
    plan(&mut planner, &world);
    (world, planner)
}

fn plan(planner: &mut LightPlanner, world: &LightWorld) -> FramePlan {
    planner.reserve(world).expect("room enough").plan()
}

#[test]
fn a_move_of_the_origin_sends_two_uniforms_whatever_the_size_of_the_world() {
    // Those of sampling, and those of the first stage of the top level.
    const BYTES: u64 = 48 + 64;
    for instances in [1, 1_000, 20_000] {
        let (mut world, mut planner) = rows(instances);
        for kilometres in [0.5, 1.5, 2.2, 10_000.0, 3.0] {
            let shift = frame(&mut world, on_flight(kilometres)).origin_shift();
            assert!(shift.is_some() || kilometres == 2.2);
            let plan = plan(&mut planner, &world);
            assert_eq!((plan.report.instances, plan.report.trees, plan.new_buffers.len()), (0, 0, 0));
            if shift.is_none() {
                assert!(plan.is_empty() && kilometres == 2.2);
                continue;
            }
            assert_eq!(plan.report.bytes, BYTES, "{instances} instances, {kilometres} km");
            assert_eq!(plan.upload.iter().count(), 2);
            assert!(!plan.top.is_empty());
        }
        // An instance that moves in the same frame is sent as in any other.
        let key = world.instances().next().expect("an instance");
        world.move_instance(key, Placement::at(FAR)).expect("within the limits");
        world.set_origin_near(FAR).expect("within the limits");
        world.update(FrameBudget::NONE);
        assert!(world.changes_since(planner.revision()).origin_shift().is_some());
        let plan = plan(&mut planner, &world);
        // Space is divided anew for an instance so far away, below a node of at most 4,096 parts: 112 bytes for each
        // divided node that changes.
        let nodes = instances.min(4096) as u64 / 6;
        let sent = BYTES + 96..BYTES + 96 + 112 * nodes + 200;
        assert!(plan.report.instances == 1 && sent.contains(&plan.report.bytes), "{} bytes", plan.report.bytes);
    }
}

#[test]
fn the_gpu_follows_every_move_of_the_origin() {
    let size = 60.0;
    let mut world = world_at(FAR, size);
    let mut lights = gpu_lights();
    // At zero all bits are the same.
    let mut plain = world_at(DVec3::ZERO, size);
    let mut plain_lights = gpu_lights();
    let mut requests = requests(&mut Rng(92), 1024, size);
    for request in &mut requests {
        request.position = stepped(Vec3::from(request.position).as_dvec3()).as_vec3().to_array();
    }
    let at_zero = sample(&mut plain_lights, &mut plain, &requests);
    assert_eq!(sample(&mut lights, &mut world, &requests), at_zero);
    assert!(at_zero.iter().filter(|record| record.pmf > 0.0).count() > 300);
    for kilometres in [0.7, 1.7, 9_000.0, -2.1, 0.0] {
        world.set_origin_near(on_flight(kilometres)).expect("within the limits");
        let records = sample(&mut lights, &mut world, &requests);
        let mismatches = compare(&world, &requests, &records);
        // 9,000 km away, numbers are 1 m apart, and probabilities on both sides differ by up to 5e-5. Of
        // 16,384 draws 34 chose the neighbour of the light. Six standard deviations above that mean: a
        // false alarm in less than one of 10^4 runs. Elsewhere none of them did.
        let mean: f64 = 1024.0 * 34.0 / 16_384.0;
        let limit = if kilometres == 9_000.0 { mean + 6.0 * mean.sqrt() } else { OTHER_PICKS * 1024.0 };
        assert!(mismatches as f64 <= limit, "{kilometres} km: {mismatches} of {limit}");
    }
    assert_eq!(world.origin(), FAR);
    assert_eq!(sample(&mut lights, &mut world, &requests), at_zero);
}
