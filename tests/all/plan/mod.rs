//! Plans of frames: their commands, their cost, and what happens to lost, repeated and refused
//! ones. The kernels run on GPUs in other tests, by way of `GpuLights`, which plays these plans.

mod anew;
mod full;
mod limits;
mod same_frame;

use girandole::glam::{DVec3, Vec3};
use girandole::plan::{KERNELS, LightPlanner, PlanCursor, PlanError, PlanLimits};
use girandole::{FrameBudget, InstanceKey, Light, LightTree, LightWorld, Placement, Policy, TreeKey};
use testbed::testing::plan_device::{Device, Played, slots};
use testbed::testing::plan_records::check;
use testbed::testing::support::{Rng, place_tree};

fn place(rng: &mut Rng) -> Placement {
    Placement::at(rng.position(5000.0).as_dvec3())
}

/// Instances of one lamp each.
fn lamps(count: usize) -> (LightWorld, TreeKey, Vec<InstanceKey>) {
    let (mut world, mut rng) = (LightWorld::new(), Rng(5));
    let tree = world.add_tree(LightTree::new(vec![Light::point(Vec3::Y, Vec3::ONE)]).expect("valid"));
    let mut add = |_| world.add_instance(tree, place(&mut rng), Policy::Static).expect("valid");
    let keys = (0..count).map(&mut add).collect();
    (world, tree, keys)
}

fn update(world: &mut LightWorld) {
    world.update(FrameBudget::NONE);
}

/// Moves an instance by a millimetre, so that no space is divided anew.
fn nudge(world: &mut LightWorld, key: InstanceKey) {
    let place = world.instance(key).expect("it lives").placement;
    let translation = place.translation + DVec3::splat(1.0e-3);
    world.move_instance(key, Placement { translation, ..place }).expect("valid");
}

/// The record of a rigid instance without factor and mask.
const INSTANCE_BYTES: usize = 160;

#[test]
fn ten_thousand_scattered_moves_go_up_in_one_write_and_one_pass() {
    for count in [20_000, 100_000] {
        let (mut world, _, keys) = lamps(count);
        let mut played = Played::new();
        update(&mut world);
        played.frame(&world);
        for moves in [10_000, 1_000] {
            for key in keys.iter().step_by(count / moves) {
                nudge(&mut world, *key);
            }
            update(&mut world);
            let plan = played.frame(&world);
            assert_eq!(plan.report.instances, moves);
            // The records with their places, and the uniform of the pass.
            assert_eq!(plan.report.bytes, (moves * (INSTANCE_BYTES + 4) + 16) as u64);
            assert_eq!((played.device.writes, played.device.dispatches["scatter"]), (2, 1));
            let mut fresh = Played::new();
            fresh.frame(&world);
            assert!(played.instances(&world, INSTANCE_BYTES) == fresh.instances(&world, INSTANCE_BYTES));
        }
        // Few moves take a write each, and all of them in a row one.
        for key in &keys[..50] {
            nudge(&mut world, *key);
        }
        nudge(&mut world, keys[60]);
        update(&mut world);
        let plan = played.frame(&world);
        assert_eq!((plan.report.bytes, played.device.writes), ((51 * INSTANCE_BYTES) as u64, 2));
        assert!(!played.device.dispatches.contains_key("scatter"));
    }
}

#[test]
fn many_flickering_trees_go_up_in_one_write() {
    let (mut world, mut rng) = (LightWorld::new(), Rng(7));
    let lamp = |rng: &mut Rng| Light::point(rng.position(1.0), Vec3::splat(rng.between(1.0, 2.0)));
    let mut trees = Vec::new();
    for _ in 0..1000 {
        let (tree, _) =
            place_tree(&mut world, (0..4).map(|_| lamp(&mut rng)).collect(), place(&mut rng), Policy::Budgeted);
        trees.push(tree);
    }
    let mut played = Played::new();
    update(&mut world);
    played.frame(&world);
    for _ in 0..3 {
        for tree in trees.iter().step_by(2) {
            world.set_emission(*tree, 1, Vec3::splat(rng.between(3.0, 4.0))).expect("valid");
        }
        update(&mut world);
        let plan = played.frame(&world);
        // Lights that are near one another are sent together.
        assert_eq!((plan.report.trees, plan.report.nodes, plan.report.lights), (500, 500, 2000));
        // A node, four lights and the record of the tree, each with its place.
        assert_eq!(plan.report.bytes, 500 * (224 + 4 * 64 + 80 + 6 * 4) + 3 * 16);
        assert_eq!((played.device.writes, played.device.dispatches["scatter"]), (4, 3));
        let mut fresh = Played::new();
        fresh.frame(&world);
        let content = |played: &Played| {
            let [_, _, nodes, _, lights] = played.bound();
            (played.device.content(nodes)[..1000 * 160].to_vec(), played.device.content(lights)[..4000 * 32].to_vec())
        };
        assert!(content(&played) == content(&fresh));
    }
}

#[test]
fn changed_lights_of_opened_trees_go_up_alone_beside_many_small_trees() {
    let (mut world, mut rng) = (LightWorld::new(), Rng(8));
    let lamp = |rng: &mut Rng| Light::point(rng.position(50.0), Vec3::splat(rng.between(1.0, 2.0)));
    let mut add = |world: &mut LightWorld, lights: usize| {
        let (tree, _) =
            place_tree(world, (0..lights).map(|_| lamp(&mut rng)).collect(), Placement::IDENTITY, Policy::Budgeted);
        tree
    };
    let town = add(&mut world, 5000);
    let strings = [100; 6].map(|lights| add(&mut world, lights));
    let houses = [4; 70].map(|lights| add(&mut world, lights));
    let mut played = Played::new();
    (0..4).for_each(|_| update(&mut world));
    played.frame(&world);
    let mut bytes = |world: &mut LightWorld| {
        update(world);
        played.frame(world).report.bytes
    };
    // A path of nodes with the records of the openings below them, and a few lights.
    let dim = Vec3::splat(0.5);
    world.set_emission(strings[2], 50, dim).expect("valid");
    let of_string = bytes(&mut world);
    assert!(of_string <= 2000, "{of_string}");
    world.set_emission(town, 50, dim).expect("valid");
    let of_town = bytes(&mut world);
    assert!(of_town <= 4000, "{of_town}");
    // The records of many trees are scattered, and so are short runs of openings.
    for house in houses {
        world.set_emission(house, 1, dim).expect("valid");
    }
    let of_houses = bytes(&mut world);
    for i in (0..5000).step_by(100) {
        world.set_emission(town, i, 2.0 * dim).expect("valid");
    }
    for house in houses {
        world.set_emission(house, 1, 2.0 * dim).expect("valid");
    }
    let of_all = bytes(&mut world);
    assert!(of_all <= of_houses + 50 * of_town.max(of_string), "{of_all}");
}

#[test]
fn buffers_of_an_exact_reservation_are_no_larger_than_needed() {
    let (mut world, tree, _) = lamps(100);
    let mut played = Played::new();
    update(&mut world);
    played.frame(&world);
    let add = |world: &mut LightWorld| {
        while slots(world) <= 128 {
            world.add_instance(tree, Placement::IDENTITY, Policy::Static).expect("valid");
        }
        update(world)
    };
    assert!(slots(&world) < 128);
    add(&mut world);
    let bytes = |buffers: &[girandole::plan::NewBuffer]| {
        buffers.iter().find(|b| b.what == "instances").expect("the instances have grown").bytes
    };
    assert_eq!(bytes(played.planner.reserve(&world).expect("room").new_buffers()), 256 * 160);
    let exact = played.planner.reserve_exactly(&world).expect("room");
    assert_eq!(bytes(exact.new_buffers()), 129 * 160);
}

#[test]
fn a_plan_that_is_played_twice_or_out_of_order_is_refused() {
    let (mut world, _, keys) = lamps(10);
    let mut played = Played::new();
    update(&mut world);
    let first = played.frame(&world);
    let before: Vec<u8> = played.instances(&world, INSTANCE_BYTES);
    assert_eq!(played.device.play(&first), Err(PlanError::OutOfOrder { expected: 2, given: 1 }));
    let mut next = || {
        world.move_instance(keys[0], Placement::at(DVec3::X)).expect("valid");
        world.move_instance(keys[0], Placement::at(DVec3::Y)).expect("valid");
        update(&mut world);
        played.planner.reserve(&world).expect("room enough").plan()
    };
    let (second, third) = (next(), next());
    assert_eq!(played.device.play(&third), Err(PlanError::OutOfOrder { expected: 2, given: 3 }));
    assert_eq!(played.instances(&world, INSTANCE_BYTES), before, "a refused plan does nothing");
    assert_eq!(played.device.play(&second), Ok(()));
    assert_eq!(played.device.play(&third), Ok(()));
    let mut cursor = PlanCursor::default();
    assert!(cursor.advance(&third).is_err());
    cursor.skip_to(&third);
    assert_eq!(cursor.advance(&third), Ok(()));
}

#[test]
fn instances_whose_removal_a_device_missed_are_removed_by_what_sends_everything() {
    let removed = || {
        let (mut world, _, keys) = lamps(300);
        let mut played = Played::new();
        update(&mut world);
        played.frame(&world);
        keys.iter().step_by(3).for_each(|key| world.remove_instance(*key).expect("it lives"));
        update(&mut world);
        (world, played)
    };
    // Flags have a bit for slots in use.
    let check = |world: &LightWorld, played: &Played| {
        let records = played.instances(world, INSTANCE_BYTES);
        for (slot, record) in (1..).zip(records.chunks_exact(INSTANCE_BYTES)) {
            assert_eq!(record[48] & 1 == 1, world.instance_at(slot).is_some(), "slot {slot}");
        }
    };
    // The plan with the removals is not played.
    let (world, mut played) = removed();
    drop(played.planner.reserve(&world).expect("room enough").plan());
    played.planner.lose();
    let plan = played.planner.reserve(&world).expect("room enough").plan();
    played.device.skip_to(&plan);
    played.device.play(&plan).expect("it was skipped to");
    check(&world, &played);
    // The frame with the removals is left out.
    let (world, mut played) = removed();
    played.frame(&world);
    check(&world, &played);
}

#[test]
fn a_last_frame_that_does_not_fit_into_a_buffer_has_no_lights_and_refuses_nothing() {
    // 64 bytes of parameters, 160 for each of 502 slots and 64 for each light: 131,072, the limit, and 131,136.
    for (lights, slots) in [(791, 502), (792, 0)] {
        let (mut world, ..) = lamps(500);
        let row = (0..lights).map(|i| Light::point(Vec3::X * i as f32, Vec3::ONE));
        let (_, key) = place_tree(&mut world, row.collect(), Placement::IDENTITY, Policy::Budgeted);
        let mut played = Played { planner: LightPlanner::new(PlanLimits::new(131_072)), device: Device::default() };
        played.planner.keep_previous(true);
        for frame in 0..3 {
            world.move_instance(key, Placement::at(DVec3::Y * f64::from(frame))).expect("it lives");
            update(&mut world);
            played.frame(&world);
        }
        let bytes = played.device.content(played.planner.previous().expect("it is kept"));
        assert_eq!(bytes[..4], u32::to_ne_bytes(slots), "{lights} lights");
    }
}

/// The bytes before the instances of the last frame: the parameters, and where the lights begin.
const PREVIOUS_HEAD: usize = 64;

#[test]
fn after_a_loss_the_last_frame_has_no_lights_until_the_second_plan() {
    let (mut world, _, _) = lamps(100);
    let mut played = Played::new();
    played.planner.keep_previous(true);
    update(&mut world);
    played.frame(&world);
    played.planner.lose();
    let zeros = |played: &Played| {
        let bytes = played.device.content(played.planner.previous().expect("it is kept"));
        // The numbers of slots and of directional lights, and all instances and lights.
        bytes[..12].iter().chain(&bytes[PREVIOUS_HEAD..]).all(|byte| *byte == 0)
    };
    played.frame(&world);
    assert!(zeros(&played));
    played.frame(&world);
    assert!(!zeros(&played));
    let present = played.planner.bindings().expect("a plan was made")[3];
    let previous = played.planner.previous().expect("it is kept");
    let used = slots(&world) * INSTANCE_BYTES;
    let bytes = &played.device.content(previous)[PREVIOUS_HEAD..];
    assert!(played.device.content(present)[..used] == bytes[..used]);
}

#[test]
fn sizes_are_multiples_of_4_whatever_the_limit_is() {
    let (mut world, _, keys) = lamps(5000);
    let mut played = Played { planner: LightPlanner::new(PlanLimits::new(1_440_003)), device: Device::default() };
    update(&mut world);
    played.frame(&world);
    let mut rng = Rng(9);
    // Two sets of staged records, so that the buffer of the second would be twice that of the first.
    for period in [9, 16] {
        for (_, key) in keys.iter().enumerate().filter(|(index, _)| index % period > 0) {
            world.move_instance(*key, place(&mut rng)).expect("valid");
        }
        update(&mut world);
        let plan = played.frame(&world);
        let staged = plan.new_buffers.iter().filter(|buffer| buffer.what == "staged records");
        let staged: Vec<u64> = staged.map(|buffer| buffer.bytes).collect();
        assert_eq!(staged, [if period == 9 { 4444 * (INSTANCE_BYTES as u64 + 4) } else { 1_440_000 }]);
    }
}

#[test]
fn a_world_that_does_not_fit_is_refused_and_fits_once_it_holds_less() {
    let (mut world, _, keys) = lamps(10);
    let mut played = Played { planner: LightPlanner::new(PlanLimits::new(0)), device: Device::default() };
    update(&mut world);
    played.frame(&world);
    // Trees of so few lights have no stand-ins.
    let lamp = |i: u32| Light::point(Vec3::splat(i as f32), Vec3::ONE);
    let trees: Vec<_> =
        (0..300).map(|_| world.add_tree(LightTree::new((0..16).map(lamp).collect()).expect("valid"))).collect();
    world.move_instance(keys[0], Placement::at(DVec3::X)).expect("valid");
    update(&mut world);
    for _ in 0..2 {
        let refused = played.planner.reserve(&world).map(|_| ()).expect_err("too many lights");
        let PlanError::Full { needed, limit, .. } = refused else { panic!("{refused:?}") };
        assert!(needed > limit && (131_000..=131_072).contains(&limit), "{refused:?}");
        check(&played, &world);
    }
    trees.into_iter().for_each(|tree| world.remove_tree(tree).expect("it has no instances"));
    update(&mut world);
    let plan = played.frame(&world);
    assert_eq!((plan.report.instances, plan.report.lights), (1, 0), "the move is sent too");
    check(&played, &world);
}

#[test]
fn every_kernel_is_valid_wgsl_with_the_bindings_of_its_table() {
    use girandole::plan::Binding;
    let mut entries = Vec::new();
    for kernel in KERNELS {
        let text = kernel.wgsl();
        let module = naga::front::wgsl::parse_str(&text).map_err(|e| e.emit_to_string(&text)).expect("it parses");
        naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::default())
            .validate(&module)
            .map_err(|e| e.emit_to_string(&text))
            .expect("it is valid");
        assert_eq!(module.entry_points.len(), 1);
        assert_eq!(module.entry_points[0].name, kernel.entry());
        for (_, variable) in module.global_variables.iter() {
            let Some(binding) = &variable.binding else { continue };
            assert_eq!(binding.group, 0);
            let expected = kernel.bindings()[binding.binding as usize];
            let found = match variable.space {
                naga::AddressSpace::Uniform => {
                    Binding::Uniform { bytes: module.types[variable.ty].inner.size(module.to_ctx()) }
                }
                naga::AddressSpace::Storage { access } if access.contains(naga::StorageAccess::STORE) => {
                    Binding::ReadWrite
                }
                _ => Binding::Read,
            };
            // A kernel may only read what another one with the same table writes.
            let is_read_only = found == Binding::Read && expected == Binding::ReadWrite;
            assert!(found == expected || is_read_only, "{}: {found:?}, not {expected:?}", kernel.entry());
        }
        assert!(!entries.contains(&kernel.entry()));
        entries.push(kernel.entry());
    }
}
