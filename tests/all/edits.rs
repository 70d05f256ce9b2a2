//! What an edit costs: nodes that are refitted and bytes that are sent. And that a GPU which got
//! only these bytes samples as one that got the whole world.

use std::collections::BTreeSet;

use girandole::effects::EFFECT_HOLD_UPDATES;
use girandole::glam::{DVec3, Vec3};
use girandole::gpu::{GpuLights, UploadReport};
use girandole::tree::{NO_PARENT, WIDTH};
use girandole::{FrameBudget, FrameReport, Light, LightWorld, Placement, Policy, TreeKey};

use crate::gpu::{gpu_lights, requests, sample, uploaded};

use testbed::testing::support::{Rng, place_tree, world_of};

/// Lamps that are spread over a square of 100 m.
fn lamps(rng: &mut Rng, count: usize) -> Vec<Light> {
    (0..count).map(|_| Light::point(rng.position(50.0), Vec3::splat(rng.between(1.0, 9.0)))).collect()
}

fn frame(world: &mut LightWorld, lights: &mut GpuLights) -> (FrameReport, UploadReport) {
    let report = world.update(FrameBudget::NONE);
    (report, lights.upload(world).expect("room enough"))
}

/// The nodes from a leaf of a tree to the root.
fn depth(world: &LightWorld, tree: TreeKey, light: u32) -> usize {
    let tree = world.tree(tree).expect("it lives");
    let parent = |place: &u32| Some(tree.nodes()[*place as usize / WIDTH].parent).filter(|place| *place != NO_PARENT);
    std::iter::successors(Some(tree.leaves()[light as usize]), parent).count()
}

#[test]
fn one_changed_light_sends_itself_and_the_nodes_above_it() {
    let mut rng = Rng(300);
    let mut greatest = 0;
    for count in [1_000, 30_000, 1_000_000] {
        let (mut world, tree, _) = world_of(lamps(&mut rng, count), Policy::Budgeted);
        let mut lights = gpu_lights();
        frame(&mut world, &mut lights);
        for _ in 0..4 {
            let light = rng.below(count) as u32;
            world.set_emission(tree, light, Vec3::splat(rng.between(10.0, 20.0))).expect("valid");
            let (refit, sent) = frame(&mut world, &mut lights);
            let nodes = depth(&world, tree, light);
            assert_eq!((refit.refit_trees, refit.refit_nodes), (1, nodes));
            // Nodes between two that changed may be sent along.
            assert!((nodes..=3 * nodes).contains(&sent.nodes), "{sent:?}");
            assert_eq!((sent.trees, sent.lights, sent.instances), (1, 1, 0));
            // A light has 64 bytes, a node 224, and the record of the tree 80.
            assert_eq!(sent.bytes, 64 + 224 * sent.nodes as u64 + 80);
            greatest = greatest.max(sent.bytes);
        }
    }
    assert!((1_000..8_192).contains(&greatest), "{greatest} bytes");
}

#[test]
fn a_tree_that_was_at_rest_sends_no_more_for_its_first_change() {
    let (mut world, tree, _) = world_of(lamps(&mut Rng(301), 2_000), Policy::Budgeted);
    let mut lights = gpu_lights();
    for _ in 0..=EFFECT_HOLD_UPDATES {
        frame(&mut world, &mut lights);
    }
    assert!(world.tree(tree).expect("it lives").is_frozen());
    world.set_lights(tree, &[(77, Light::point(Vec3::X, Vec3::ONE))]).expect("valid");
    let (refit, sent) = frame(&mut world, &mut lights);
    let nodes = depth(&world, tree, 77);
    assert_eq!(refit.refit_nodes, nodes);
    assert!(sent.nodes <= 3 * nodes && sent.lights == 1, "{sent:?}");
}

#[test]
fn an_edit_that_changes_nothing_or_is_taken_back_costs_nothing() {
    let (mut world, tree, _) = world_of(lamps(&mut Rng(302), 500), Policy::Budgeted);
    let mut lights = gpu_lights();
    frame(&mut world, &mut lights);
    let present = world.tree(tree).expect("it lives").lights()[3];
    for edits in [vec![(3, present)], vec![(3, Light::point(Vec3::X, Vec3::ONE)), (3, present)]] {
        world.set_lights(tree, &edits).expect("valid");
        let (refit, sent) = frame(&mut world, &mut lights);
        assert_eq!((refit.refit_trees, refit.refit_nodes, sent), (0, 0, UploadReport::default()));
    }
}

/// Changes some lights, or all, or the shape of a tree, and now and then lets it rest.
fn change(world: &mut LightWorld, tree: TreeKey, rng: &mut Rng) {
    let count = world.tree(tree).expect("it lives").lights().len();
    match rng.below(9) {
        0 => drop(world.rebuild_tree(tree).expect("it lives")),
        1 => world.replace_lights(tree, lamps(rng, count)).expect("valid"),
        2 => {
            let all: Vec<_> = (0..).zip(lamps(rng, count)).collect();
            world.set_lights(tree, &all).expect("valid");
        }
        3 => {
            for _ in 0..2 * EFFECT_HOLD_UPDATES {
                world.update(FrameBudget::NONE);
            }
        }
        // The vacant indices are used again.
        4 => {
            let gone: BTreeSet<u32> = (0..700).map(|_| rng.below(count) as u32).collect();
            let gone: Vec<u32> = gone.into_iter().collect();
            world.remove_lights(tree, &gone).expect("it has the lights");
            world.update(FrameBudget::NONE);
            world.add_lights(tree, &lamps(rng, gone.len() + 9)).expect("valid");
        }
        5 => {
            let few = lamps(rng, 9);
            world.set_light_range(tree, rng.below(count - 9) as u32, &few).expect("valid");
        }
        _ => {
            let few = 1 + rng.below(20);
            let some: Vec<_> = lamps(rng, few).into_iter().map(|lamp| (rng.below(count) as u32, lamp)).collect();
            world.set_lights(tree, &some).expect("valid");
        }
    }
    world.update(FrameBudget::NONE);
}

#[test]
fn a_gpu_that_got_only_changes_samples_as_one_that_got_everything() {
    let mut rng = Rng(303);
    let (mut world, first, _) = world_of(lamps(&mut rng, 3_000), Policy::Budgeted);
    let (second, _) = place_tree(&mut world, lamps(&mut rng, 400), Placement::at(DVec3::X * 30.0), Policy::Budgeted);
    let requests = requests(&mut rng, 512, 40.0);
    let mut lights = gpu_lights();
    let mut behind = uploaded(&world);
    for round in 0..24 {
        for tree in [first, second] {
            change(&mut world, tree, &mut rng);
            if rng.below(4) == 0 {
                change(&mut world, tree, &mut rng);
                lights.upload(&world).expect("room enough");
            }
        }
        let records = sample(&mut lights, &mut world, &requests);
        let mut fresh = uploaded(&world);
        let expected = sample(&mut fresh, &mut world, &requests);
        assert!(expected.iter().filter(|record| record.pmf > 0.0).count() > 400);
        assert!(records == expected, "round {round}");
        // A second reader that takes part in few frames gets what it has missed.
        if round % 8 == 7 {
            behind.upload(&world).expect("room enough");
            let late = sample(&mut behind, &mut world, &requests);
            assert!(late == expected, "round {round}");
        }
    }
}
