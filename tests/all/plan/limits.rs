//! Trees in little memory and with few bytes in each frame: what shaders see is always sound, bounds
//! hold, and in the end everything that fits is there.

use girandole::glam::{DVec3, Vec3};
use girandole::plan::{LightPlanner, PlanLimits};
use girandole::{Light, LightWorld, Placement, Policy, TreeKey};

use super::update;
use girandole::LightTree;
use testbed::testing::plan_device::{Device, Played};
use testbed::testing::plan_records::{Found, check};
use testbed::testing::support::{Rng, place_tree};

/// The most bytes of stand-ins of one tree, with the record of the tree.
const STAND_IN_BYTES: u64 = 64 * 64 + 10 * 224 + 80;

pub fn lamp(rng: &mut Rng) -> Light {
    Light::point(rng.position(20.0), Vec3::splat(rng.between(1.0, 100.0)))
}

pub fn lamps(rng: &mut Rng, count: usize) -> Vec<Light> {
    (0..count).map(|_| lamp(rng)).collect()
}

/// Trees of so many lights, 100 m from one another in a row along x.
pub fn row(rng: &mut Rng, trees: usize, lights: usize) -> (LightWorld, Vec<TreeKey>) {
    let mut world = LightWorld::new();
    let mut add = |i: usize| {
        let tree = world.add_tree(LightTree::new(lamps(rng, lights)).expect("valid"));
        let place = Placement::at(DVec3::X * 100.0 * i as f64);
        world.add_instance(tree, place, Policy::Budgeted).expect("valid");
        tree
    };
    let keys = (0..trees).map(&mut add).collect();
    (world, keys)
}

pub fn played(limits: PlanLimits) -> Played {
    Played { planner: LightPlanner::new(limits), device: Device::default() }
}

/// Bytes of the nodes and lights of a tree of point lights.
pub fn bytes(world: &LightWorld, tree: TreeKey) -> u64 {
    let tree = world.tree(tree).expect("it lives");
    tree.nodes().len() as u64 * 224 + tree.lights().len() as u64 * 64
}

#[test]
fn trees_come_within_the_bytes_of_each_frame_the_most_useful_first() {
    let mut rng = Rng(21);
    let (mut world, keys) = row(&mut rng, 40, 300);
    world.set_viewpoint(DVec3::new(50.0, 10.0, 0.0)).expect("finite");
    let budget = 40_000;
    let mut played = played(PlanLimits::default().with_frame_bytes(budget));
    update(&mut world);
    let first = played.frame(&world);
    // As many trees as fit come at once, and stand-ins of all others.
    let mut whole = (40 - first.report.stand_ins) as u64;
    assert_eq!(whole, budget / bytes(&world, keys[0]), "all trees have about the same size");
    let total: u64 = keys.iter().map(|key| bytes(&world, *key)).sum();
    assert!(first.report.waiting_bytes > total / 2 && first.report.waiting_trees == first.report.stand_ins);
    let found = check(&played, &world);
    assert!(found.stand_ins >= 8 * first.report.stand_ins && found.lights == 300 * whole as usize, "{found:?}");
    let mut frames = 1;
    let mut last = first.report;
    while last.waiting_trees > 0 {
        let plan = played.frame(&world);
        // Records of trees and instances come on top.
        let arrived = last.stand_ins - plan.report.stand_ins;
        assert!(plan.report.bytes <= budget + 200 * arrived as u64 + 400, "{:?}", plan.report);
        assert!(plan.report.bytes >= budget / 2 || plan.report.waiting_trees == 0);
        check(&played, &world);
        // The row is sent from the viewpoint on.
        let waits: Vec<bool> = keys.iter().map(|key| played.planner.stands_in(*key)).collect();
        let far = waits.iter().rposition(|waits| !waits).expect("some are there");
        let near = waits.iter().position(|waits| *waits).unwrap_or(40);
        let first_frame = (40 - first.report.stand_ins).max(near);
        assert!(far <= first_frame + 4 || near >= 40, "{waits:?}");
        whole += arrived as u64;
        frames += 1;
        last = plan.report;
    }
    assert_eq!((whole, last.waiting_bytes, last.stand_ins), (40, 0, 0));
    assert!(frames as u64 <= 2 * total / budget + 2, "{frames} frames");
    assert_eq!(check(&played, &world), Found { lights: 40 * 300, stand_ins: 0 });
    assert!(played.frame(&world).is_empty());
}

/// The bytes of each frame for a tree that comes in pieces.
const PIECE_BYTES: u64 = 64_000;

/// A tree of 20,000 lights whose first piece has come, and the number of frames that all of it takes.
fn in_pieces(rng: &mut Rng) -> (LightWorld, Vec<TreeKey>, Played, u64) {
    let (mut world, keys) = row(rng, 1, 20_000);
    let mut played = played(PlanLimits::default().with_frame_bytes(PIECE_BYTES));
    update(&mut world);
    played.frame(&world);
    let expected = bytes(&world, keys[0]).div_ceil(PIECE_BYTES);
    (world, keys, played, expected)
}

#[test]
fn a_large_tree_comes_in_pieces_and_what_changes_meanwhile_comes_with_the_last() {
    let mut rng = Rng(22);
    let (mut world, keys, mut played, expected) = in_pieces(&mut rng);
    let mut frames = 0;
    while played.planner.stands_in(keys[0]) {
        world.set_emission(keys[0], frames * 7, Vec3::splat(rng.between(1.0, 100.0))).expect("valid");
        update(&mut world);
        let plan = played.frame(&world);
        assert!(plan.report.bytes <= PIECE_BYTES + STAND_IN_BYTES + 20_000, "{:?}", plan.report);
        check(&played, &world);
        frames += 1;
    }
    assert!((expected - 1..=expected + 1).contains(&u64::from(frames)), "{frames} frames of {expected}");
    assert_eq!(check(&played, &world), Found { lights: 20_000, stand_ins: 0 });
    // The next version is sent beside the present one, which shaders see meanwhile.
    world.rebuild_tree(keys[0]).expect("it lives");
    update(&mut world);
    let plan = played.frame(&world);
    assert_eq!((plan.report.waiting_trees, plan.report.stand_ins), (1, 0));
    let mut frames = 0;
    while played.planner.is_waiting(keys[0]) {
        assert_eq!(check(&played, &world), Found { lights: 20_000, stand_ins: 0 });
        played.frame(&world);
        frames += 1;
    }
    assert!((expected - 1..=expected + 1).contains(&frames), "{frames} frames of {expected}");
    check(&played, &world);
    // A tree that is built again in every frame is sent at once after the third time.
    for frame in 0..5 {
        world.rebuild_tree(keys[0]).expect("it lives");
        update(&mut world);
        let plan = played.frame(&world);
        assert_eq!(plan.report.bytes > bytes(&world, keys[0]), frame == 3, "frame {frame}: {:?}", plan.report);
        check(&played, &world);
    }
}

#[test]
fn a_tree_that_grows_while_it_comes_in_pieces_gets_room_and_starts_again_once() {
    let mut rng = Rng(28);
    let (mut world, keys, mut played, expected) = in_pieces(&mut rng);
    let mut frames = 0;
    while played.planner.stands_in(keys[0]) {
        world.add_lights(keys[0], &lamps(&mut rng, 3)).expect("valid");
        update(&mut world);
        played.frame(&world);
        check(&played, &world);
        frames += 1;
    }
    assert!((expected - 1..=expected + 3).contains(&frames), "{frames} frames of {expected}");
    assert_eq!(check(&played, &world).stand_ins, 0);
}

#[test]
fn in_little_memory_the_least_useful_trees_stand_in_and_the_others_are_whole() {
    let mut rng = Rng(23);
    let (mut world, keys) = row(&mut rng, 100, 300);
    let total: u64 = keys.iter().map(|key| bytes(&world, *key)).sum();
    let memory = total / 2;
    world.set_viewpoint(DVec3::ZERO).expect("finite");
    let mut played = played(PlanLimits::default().with_tree_memory(memory));
    update(&mut world);
    played.frame(&world);
    for end in [0.0, 9900.0, 5000.0] {
        world.set_viewpoint(DVec3::X * end).expect("finite");
        let mut rested = false;
        for _ in 0..200 {
            let plan = played.frame(&world);
            let found = check(&played, &world);
            assert_eq!(found.lights / 300 + plan.report.stand_ins, 100);
            let now = played.planner.memory();
            assert!(now.trees <= memory && now.used <= now.trees, "{now:?} of {memory}");
            rested = plan.is_empty();
        }
        assert!(rested, "trees that take turns");
        let whole: Vec<usize> = (0..100).filter(|i| !played.planner.stands_in(keys[*i])).collect();
        assert!((25..50).contains(&whole.len()), "{}", whole.len());
        // The nearest ones are whole, but for those that are hardly more useful than others.
        let distance = |i: &usize| (*i as f64 * 100.0 - end).abs();
        let nearest = (0..100).filter(|i| distance(i) < 40.0 * whole.len() as f64 / 2.0);
        let missing = nearest.filter(|i| !whole.contains(i)).count();
        assert_eq!(missing, 0, "at {end}: {whole:?}");
    }
}

#[test]
fn limits_of_zero_have_an_outcome() {
    let mut rng = Rng(24);
    // No bytes: stand-ins of everything, and never more.
    let (mut world, keys) = row(&mut rng, 10, 100);
    let mut none = played(PlanLimits::default().with_frame_bytes(0));
    update(&mut world);
    let plan = none.frame(&world);
    assert_eq!((plan.report.stand_ins, plan.report.waiting_trees), (10, 10));
    assert!(plan.report.bytes < 10 * (STAND_IN_BYTES + 200));
    assert!(none.frame(&world).is_empty());
    assert!(check(&none, &world).lights == 0);
    none.planner.set_frame_bytes(None);
    none.frame(&world);
    assert_eq!(check(&none, &world), Found { lights: 1000, stand_ins: 0 });
    // Almost no memory: 128 KiB, whatever was asked for.
    none.planner.set_tree_memory(Some(0));
    for _ in 0..20 {
        none.frame(&world);
        check(&none, &world);
    }
    assert!(none.planner.memory().trees <= 128 << 10);
    for _ in 0..400 {
        place_tree(&mut world, lamps(&mut rng, 16), Placement::IDENTITY, Policy::Static);
    }
    update(&mut world);
    assert!(none.planner.reserve(&world).is_err(), "small trees are always whole");
    none.planner.set_tree_memory(Some(4 << 20));
    none.frame(&world);
    none.frame(&world);
    assert_eq!(check(&none, &world), Found { lights: 1000 + 6400, stand_ins: 0 });
    assert_eq!(keys.iter().filter(|key| none.planner.is_waiting(**key)).count(), 0);
}

#[test]
fn gaps_are_joined_within_the_bytes_of_each_frame_and_then_nothing_is_sent() {
    let mut rng = Rng(26);
    let budget = 80_000;
    let (mut world, keys) = row(&mut rng, 60, 200);
    let mut played = played(PlanLimits::default().with_frame_bytes(budget));
    update(&mut world);
    played.frame(&world);
    while !played.frame(&world).is_empty() {}
    let full = played.planner.memory();
    // Every other tree goes.
    let instances: Vec<_> = world.instances().collect();
    for (key, tree) in instances.into_iter().zip(&keys).step_by(2) {
        assert_eq!(world.instance(key).map(|i| i.tree), Some(*tree));
        world.remove_instance(key).expect("it lives");
        world.remove_tree(*tree).expect("no instances");
    }
    update(&mut world);
    played.frame(&world);
    let holed = played.planner.memory();
    assert!(holed.gaps > full.used / 3, "{holed:?} of {full:?}");
    let mut frames = 0;
    loop {
        let plan = played.frame(&world);
        assert_eq!(check(&played, &world), Found { lights: 30 * 200, stand_ins: 0 });
        if plan.is_empty() {
            break;
        }
        // Records of instances, and of trees, come on top.
        assert!(plan.report.bytes <= budget / 4 + 2_000, "{:?}", plan.report);
        frames += 1;
    }
    let joined = played.planner.memory();
    assert!(joined.gaps * 8 <= joined.used + joined.gaps && joined.used == holed.used, "{joined:?}");
    assert!((10..200).contains(&frames), "{frames} frames");
}

#[test]
fn a_world_larger_than_the_largest_buffer_is_seen_whole_or_by_stand_ins() {
    let mut rng = Rng(25);
    // The lights of one tree fill a third of the largest buffer.
    let (mut world, _) = row(&mut rng, 12, 1400);
    let mut played = played(PlanLimits::new(0));
    update(&mut world);
    let plan = played.frame(&world);
    let found = check(&played, &world);
    assert!(plan.report.stand_ins >= 9 && found.lights >= 1400, "{found:?}");
    assert!(plan.new_buffers.iter().all(|buffer| buffer.bytes <= 131_072));
}

/// Every edit, region, limit, refusal and loss in random orders.
#[test]
fn what_shaders_see_is_sound_after_any_sequence_of_edits_and_limits() {
    for seed in 0..12 {
        let mut rng = Rng(100 + seed);
        let mut world = LightWorld::new();
        let mut played = played(PlanLimits::default().with_tree_memory(200_000 << (seed % 3)));
        let mut trees: Vec<TreeKey> = Vec::new();
        for frame in 0..120 {
            for _ in 0..rng.bits() % 8 {
                let pick = rng.bits() as usize % trees.len().max(1);
                match rng.bits() % 16 {
                    0..4 => {
                        let count = [3, 16, 17, 60, 300, 2000][rng.bits() as usize % 6];
                        let tree = world.add_tree(LightTree::new(lamps(&mut rng, count)).expect("valid"));
                        for _ in 0..rng.bits() % 4 {
                            let place = Placement::at(rng.position(1000.0).as_dvec3());
                            world.add_instance(tree, place, Policy::Budgeted).expect("valid");
                        }
                        trees.push(tree);
                    }
                    4 | 5 | 13 if !trees.is_empty() => {
                        let tree = trees.swap_remove(pick);
                        let of = |key: &girandole::InstanceKey| world.instance(*key).map(|i| i.tree) == Some(tree);
                        let instances: Vec<_> = world.instances().filter(of).collect();
                        instances.into_iter().for_each(|key| world.remove_instance(key).expect("it lives"));
                        world.remove_tree(tree).expect("no instances");
                    }
                    6 if !trees.is_empty() => world.rebuild_tree(trees[pick]).map(drop).expect("it lives"),
                    7 if !trees.is_empty() => {
                        let added = world.add_lights(trees[pick], &lamps(&mut rng, 9)).expect("valid");
                        world.remove_lights(trees[pick], &added[3..5]).expect("valid");
                    }
                    8..12 if !trees.is_empty() => {
                        world.set_lights(trees[pick], &[(0, lamp(&mut rng)), (1, lamp(&mut rng))]).expect("valid");
                    }
                    12 if !trees.is_empty() => {
                        let count = rng.bits() as usize % 500;
                        world.replace_lights(trees[pick], lamps(&mut rng, count + 2)).expect("valid");
                    }
                    _ => world.set_viewpoint(rng.position(1000.0).as_dvec3()).expect("finite"),
                }
            }
            match rng.bits() % 40 {
                0 => {
                    let bytes = [Some(0), Some(1), Some(3_000), Some(50_000), None][rng.bits() as usize % 5];
                    played.planner.set_frame_bytes(bytes);
                }
                1 => {
                    let bytes = [Some(0), Some(200_000), Some(600_000), Some(4 << 20), None];
                    let bytes = bytes[rng.bits() as usize % 5];
                    played.planner.set_tree_memory(bytes);
                }
                2 => {
                    played.planner.lose();
                    played.device.forget();
                }
                3 => played.planner.keep_previous(frame % 2 == 0),
                _ => {}
            }
            update(&mut world);
            if rng.bits().is_multiple_of(4) {
                // Refused or dropped: nothing changes, and the next reservation has the changes.
                let before = (played.planner.memory(), played.planner.bindings());
                let _ = played.planner.reserve(&world).map(drop);
                assert_eq!((played.planner.memory(), played.planner.bindings()), before);
            }
            let result = played.planner.reserve(&world).map(|reservation| reservation.plan());
            let plan = result.unwrap_or_else(|_| {
                // Too little memory, even for stand-ins.
                played.planner.set_tree_memory(None);
                played.planner.reserve(&world).expect("room").plan()
            });
            played.device.play(&plan).expect("in order");
            check(&played, &world);
            assert_eq!(played.planner.memory().buffers, played.device.bytes_of_all());
        }
        let all: Vec<_> = world.instances().collect();
        all.into_iter().for_each(|key| world.remove_instance(key).expect("it lives"));
        trees.into_iter().for_each(|tree| world.remove_tree(tree).expect("no instances"));
        update(&mut world);
        let plan = played.frame(&world);
        assert_eq!((plan.report.waiting_trees, plan.report.waiting_bytes, plan.report.stand_ins), (0, 0, 0));
        assert_eq!((played.planner.memory().used, played.planner.memory().gaps), (0, 0), "seed {seed}");
    }
}

#[test]
fn instances_take_memory_in_proportion() {
    let count = 66_000;
    let (world, _, _) = super::lamps(count);
    let mut played = played(PlanLimits::default());
    played.frame(&world);
    let memory = played.planner.memory();
    let each = (memory.buffers - memory.trees) / count as u64;
    // As `LightPlanner::set_tree_memory` says.
    assert!((420..470).contains(&each), "{each} bytes for each of {count} instances");
}
