//! What happens to a tree while it waits, moves within the pools, or is lost: it arrives as the world
//! has it, and waits no longer than it must.

use girandole::glam::{DVec3, Vec3};
use girandole::plan::PlanLimits;
use girandole::{LightTree, LightWorld, Placement, Policy, TreeKey};

use super::limits::{bytes, lamps, played, row};
use super::update;
use testbed::testing::plan_device::Played;
use testbed::testing::plan_records::{check, check_as_new};
use testbed::testing::support::{Rng, place_tree};

/// Plays frames in which nothing changes. The last of them send nothing.
fn rest(played: &mut Played, world: &LightWorld) {
    let is_empty: Vec<bool> = (0..200).map(|_| played.frame(world).is_empty()).collect();
    assert!(is_empty[150..].iter().all(|is_empty| *is_empty), "{is_empty:?}");
}

/// A world in little memory with gaps between its trees, and a large tree that waits: there is room
/// for it once trees have moved to gaps.
fn with_gaps(rng: &mut Rng, lights: usize) -> (LightWorld, Played, Vec<TreeKey>, TreeKey) {
    let trees = 12_000 / lights;
    let (mut world, mut keys) = row(rng, trees, lights);
    let total: u64 = keys.iter().map(|key| bytes(&world, *key)).sum();
    let mut played = played(PlanLimits::default().with_tree_memory(total * 6 / 5));
    update(&mut world);
    played.frame(&world);
    rest(&mut played, &world);
    let instances: Vec<_> = world.instances().collect();
    for (instance, tree) in instances.into_iter().zip(&keys).step_by(2) {
        world.remove_instance(instance).expect("it lives");
        world.remove_tree(*tree).expect("no instances");
    }
    keys = keys.into_iter().skip(1).step_by(2).collect();
    let (large, _) = place_tree(&mut world, lamps(rng, 3300), Placement::IDENTITY, Policy::Static);
    update(&mut world);
    played.frame(&world);
    assert!(played.planner.stands_in(large), "no gap is long enough");
    (world, played, keys, large)
}

#[test]
fn a_tree_that_is_edited_in_the_frame_in_which_it_would_move_to_a_gap_has_its_edit() {
    let mut rng = Rng(41);
    let (mut world, mut played, keys, large) = with_gaps(&mut rng, 300);
    for key in &keys {
        // A light that keeps its place, so that the nodes above it are all that changes besides.
        world.set_emission(*key, 7, Vec3::splat(rng.between(1.0, 100.0))).expect("valid");
    }
    update(&mut world);
    played.frame(&world);
    check(&played, &world);
    let moved = played.frame(&world);
    assert!(moved.report.nodes > 0 && played.planner.stands_in(large), "trees move: {:?}", moved.report);
    check(&played, &world);
    rest(&mut played, &world);
    check(&played, &world);
}

#[test]
fn a_tree_that_gets_light_parts_in_the_frame_in_which_it_would_move_to_a_gap_has_its_new_parts() {
    let mut rng = Rng(42);
    let (mut world, mut played, keys, large) = with_gaps(&mut rng, 100);
    // Instances that lie within one another give their trees light parts.
    for key in &keys {
        for _ in 0..4 {
            world.add_instance(*key, Placement::at(DVec3::Y * 500.0), Policy::Budgeted).expect("valid");
        }
    }
    update(&mut world);
    played.frame(&world);
    check_as_new(&played, &world);
    assert!(played.planner.stands_in(large));
    rest(&mut played, &world);
    check(&played, &world);
}

#[test]
fn a_device_that_has_lost_its_content_gets_everything_in_one_plan_whatever_a_frame_may_send() {
    for frame_bytes in [0, 3_000, 40_000] {
        let mut rng = Rng(43);
        let (mut world, keys) = row(&mut rng, 12, 300);
        let mut played = played(PlanLimits::default());
        update(&mut world);
        played.frame(&world);
        played.planner.set_frame_bytes(Some(frame_bytes));
        // Shaders see an older version of some, and one has grown beyond its room.
        for key in &keys[..4] {
            world.rebuild_tree(*key).expect("it lives");
        }
        world.replace_lights(keys[4], lamps(&mut rng, 1000)).expect("valid");
        update(&mut world);
        played.frame(&world);
        assert!(keys[..5].iter().any(|key| played.planner.is_waiting(*key)));
        played.planner.lose();
        played.device.forget();
        played.frame(&world);
        check(&played, &world);
        for (i, key) in keys.iter().enumerate() {
            assert!(!played.planner.is_waiting(*key) || i == 4, "{i} with {frame_bytes} bytes");
        }
    }
}

#[test]
fn a_tree_that_becomes_small_while_it_is_sent_in_pieces_is_sent_at_once() {
    let mut rng = Rng(44);
    let (mut world, keys) = row(&mut rng, 1, 3000);
    let mut played = played(PlanLimits::default().with_frame_bytes(20_000));
    update(&mut world);
    played.frame(&world);
    played.frame(&world);
    played.planner.set_frame_bytes(Some(0));
    world.replace_lights(keys[0], lamps(&mut rng, 10)).expect("valid");
    update(&mut world);
    played.frame(&world);
    assert_eq!(check(&played, &world).lights, 10);
    assert!(!played.planner.is_waiting(keys[0]));
    played.planner.set_frame_bytes(None);
    rest(&mut played, &world);
    assert_eq!(played.planner.memory().used, bytes(&world, keys[0]), "the pieces are freed");
}

#[test]
fn an_older_version_makes_room_for_the_present_one_if_there_is_no_other() {
    let mut rng = Rng(45);
    let (mut world, keys) = row(&mut rng, 1, 3000);
    let memory = bytes(&world, keys[0]) * 8 / 5;
    let mut played = played(PlanLimits::default().with_tree_memory(memory).with_frame_bytes(20_000));
    update(&mut world);
    played.frame(&world);
    rest(&mut played, &world);
    assert!(!played.planner.is_waiting(keys[0]));
    world.rebuild_tree(keys[0]).expect("it lives");
    update(&mut world);
    played.frame(&world);
    assert!(played.planner.is_waiting(keys[0]), "there is no room beside the older version");
    rest(&mut played, &world);
    assert!(!played.planner.is_waiting(keys[0]));
    check(&played, &world);
}

#[test]
fn trees_that_do_not_fit_do_not_keep_others_coming_and_going() {
    for seed in 0..12 {
        let mut rng = Rng(500 + seed);
        let mut world = LightWorld::new();
        let mut total = 0;
        for i in 0..40 {
            let count = [20, 60, 130, 300, 900, 2500][rng.bits() as usize % 6];
            let tree = world.add_tree(LightTree::new(lamps(&mut rng, count)).expect("valid"));
            let place = Placement::at(DVec3::X * 100.0 * f64::from(i));
            world.add_instance(tree, place, Policy::Budgeted).expect("valid");
            total += bytes(&world, tree);
        }
        let mut played = played(PlanLimits::default().with_tree_memory(total / 3));
        update(&mut world);
        played.frame(&world);
        for _ in 0..4 {
            world.set_viewpoint(DVec3::X * f64::from(rng.between(0.0, 4000.0))).expect("finite");
            rest(&mut played, &world);
            check(&played, &world);
        }
        // A limit that stays the same changes nothing.
        played.planner.set_tree_memory(Some(total / 3));
        played.planner.set_frame_bytes(None);
        assert!(played.frame(&world).is_empty());
    }
}
