//! Worlds in which openings of large trees are leaves of the top level: probabilities are exact, no
//! light is lost, and CPU and GPU agree, also while lights and instances come, go, move and change.

use girandole::glam::{DVec3, Mat3, Vec3};
use girandole::gpu::GpuLights;
use girandole::plan::{LightPlanner, PlanLimits};
use girandole::{
    Effects, FrameBudget, InstanceKey, Light, LightTree, LightWorld, Placement, Policy, Region, RegionInstance, TreeKey,
};

use crate::gpu::{OTHER_PICKS, ask, compare, gpu_lights, question_at, requests, sample};
use testbed::testing::support::{Rng, SPLITS, assert_probabilities};

/// Lamps over a square of 40 m, some of them dark.
fn lamps(rng: &mut Rng, count: usize) -> Vec<Light> {
    let lamp = |i: usize| {
        let at = Vec3::new(rng.between(-20.0, 20.0), rng.between(4.0, 6.0), rng.between(-20.0, 20.0));
        let emission = if i % 50 == 7 { Vec3::ZERO } else { Vec3::splat(rng.between(1.0, 50.0)) };
        Light::point(at, emission).with_range(rng.between(20.0, 200.0))
    };
    (0..count).map(lamp).collect()
}

struct Town {
    world: LightWorld,
    /// Two trees of lamps above the houses; the second one is scaled.
    lamps: [TreeKey; 2],
    large: [InstanceKey; 2],
    houses: Vec<InstanceKey>,
}

/// Two large trees that overlap, and objects of all kinds between their lights.
fn town(rng: &mut Rng) -> Town {
    let mut world = rng.varied_world(3, 20, 3, 15.0);
    let houses: Vec<InstanceKey> = world.instances().collect();
    let lamps = [3000, 400].map(|count| world.add_tree(LightTree::new(lamps(rng, count)).expect("valid")));
    let placements = [Mat3::IDENTITY, Mat3::from_rotation_y(0.4) * Mat3::from_diagonal(Vec3::new(0.8, 1.1, 1.2))]
        .map(|linear| Placement { linear, translation: DVec3::Y * 2.0 });
    let large = [0, 1].map(|i| world.add_instance(lamps[i], placements[i], Policy::Budgeted).expect("valid"));
    world.update(FrameBudget::UNLIMITED);
    Town { world, lamps, large, houses }
}

/// Changes the world: each of ten rounds has its own way.
fn change(town: &mut Town, rng: &mut Rng, round: usize) {
    let Town { world, lamps: trees, large, houses } = town;
    match round {
        0 => {}
        // A light moves, one is switched off and one on.
        1 => {
            let dark = Light::point(Vec3::new(3.0, 5.0, 1.0), Vec3::ZERO);
            let lit = Light::point(Vec3::new(-9.0, 5.0, 1.0), Vec3::splat(60.0));
            world.set_lights(trees[0], &[(3, lit), (4, dark), (7, lit)]).expect("valid");
        }
        // Most of the new lights go below openings, and some removed ones are openings.
        2 => {
            world.add_lights(trees[0], &lamps(rng, 60)).expect("valid");
            world.remove_lights(trees[0], &[0, 10, 11, 2000]).expect("valid");
            world.add_lights(trees[1], &lamps(rng, 5)).expect("valid");
            world.remove_lights(trees[1], &[17, 18, 19]).expect("valid");
        }
        3 => {
            world.rebuild_tree(trees[0]).expect("it lives");
            world.rebuild_tree(trees[1]).expect("it lives");
        }
        // The objects around the large trees move away.
        4 => {
            for (key, i) in houses.iter().zip(0..) {
                // Of instances at one place, the GPU may have another order.
                let place = Placement::at(DVec3::X * (9000.0 + 20.0 * f64::from(i)));
                world.move_instance(*key, place).expect("valid");
            }
            world.move_instance(large[1], Placement::at(DVec3::X * -300.0)).expect("valid");
        }
        5 => {
            for key in houses.iter() {
                world.move_instance(*key, rng.affine(15.0)).expect("valid");
            }
        }
        // More instances of one tree, a copy, and another origin.
        6 => {
            for _ in 0..6 {
                let place = Placement::at(rng.position(10.0).as_dvec3());
                world.add_instance(trees[0], place, Policy::Budgeted).expect("valid");
            }
            world.make_unique(large[0]).expect("it lives");
            world.set_origin_near(DVec3::new(5.0, -3.0, 1040.0)).expect("near");
        }
        7 => world.replace_lights(trees[0], lamps(rng, 900)).expect("valid"),
        // Few lights.
        8 => world.replace_lights(trees[1], lamps(rng, 100)).expect("valid"),
        _ => {
            for key in large.iter() {
                world.remove_instance(*key).expect("it lives");
            }
        }
    }
    for _ in 0..4 {
        world.update(FrameBudget::UNLIMITED);
    }
}

const ROUNDS: usize = 10;

/// The rounds after which a shader is compiled that walks up from lights.
const PMF_ROUNDS: [usize; 3] = [0, 2, 6];

/// For a shading point and random numbers: the probability of a sample, as `light_sample` and as
/// `light_pmf` give it.
const TEXT: &str = "
    struct Question { position: vec3<f32>, padding: f32, u: vec4<f32> }
    fn answer(q: Question) -> vec2<f32> {
        let point = light_volume_point(q.position);
        let s = light_sample(point, q.u);
        return vec2(s.pmf, light_pmf(point, s.instance, s.light));
    }";

/// Checks that a shader that walks up from a light finds the probability of its sample.
fn check_pmfs(lights: &mut GpuLights, rng: &mut Rng) {
    let questions: Vec<_> = (0..512).map(|_| question_at(rng.position(15.0), rng)).collect();
    let answers: Vec<[f32; 2]> = ask(lights, Effects::all(), TEXT, &questions);
    let mut compared = 0;
    for [pmf, asked] in answers.into_iter().filter(|[pmf, _]| *pmf > 0.0) {
        assert!((asked / pmf - 1.0).abs() < 2.0e-3, "{asked} {pmf}");
        compared += 1;
    }
    assert!(compared > 100, "{compared}");
}

#[test]
fn probabilities_add_up_and_every_light_that_contributes_has_one() {
    let mut rng = Rng(190);
    let mut town = town(&mut rng);
    for round in 0..ROUNDS {
        change(&mut town, &mut rng, round);
        let world = &town.world;
        for splits in SPLITS {
            let sampler = world.sampler().with_splits(splits);
            for _ in 0..3 {
                assert_probabilities(&sampler, &rng.masked_point(15.0), 200, &mut rng);
            }
        }
    }
}

#[test]
fn lights_that_jump_out_of_openings_are_reached_in_their_new_places() {
    let mut rng = Rng(193);
    for round in 0..8 {
        let Town { mut world, lamps: [tree, other], .. } = town(&mut rng);
        // Few enough of the lights to get other places one by one, and enough to change openings.
        for (tree, count) in [(tree, 3000), (other, 400)] {
            let lights: Vec<(u32, Light)> = (0..count / 21)
                .map(|i| (21 * i + round, Light::point(rng.position(20.0), Vec3::splat(rng.between(1.0, 50.0)))))
                .collect();
            world.set_lights(tree, &lights).expect("valid");
        }
        world.update(FrameBudget::NONE);
        let sampler = world.sampler();
        for _ in 0..3 {
            assert_probabilities(&sampler, &rng.masked_point(15.0), 100, &mut rng);
        }
    }
}

#[test]
fn the_gpu_chooses_the_same_lights_while_openings_come_and_go() {
    let mut rng = Rng(192);
    let mut town = town(&mut rng);
    let mut lights = gpu_lights();
    for round in 0..ROUNDS {
        change(&mut town, &mut rng, round);
        let requests = requests(&mut rng, 1024, 20.0);
        let records = sample(&mut lights, &mut town.world, &requests);
        let mismatches = compare(&town.world, &requests, &records);
        assert!(mismatches as f64 <= OTHER_PICKS * 1024.0 + 1.0, "round {round}: {mismatches} of 1024 differ");
        assert!(records.iter().filter(|record| record.pmf > 0.0).count() > 200, "round {round}");
        if PMF_ROUNDS.contains(&round) {
            check_pmfs(&mut lights, &mut rng);
        }
    }
}

#[test]
fn openings_arrive_with_the_last_piece_of_a_tree_that_is_sent_over_several_frames() {
    let mut rng = Rng(194);
    let mut town = town(&mut rng);
    let mut lights = gpu_lights();
    lights.set_frame_bytes(Some(30_000));
    let (mut frames, mut checked) = (0, 0);
    for round in 0..ROUNDS - 1 {
        let mut is_due = PMF_ROUNDS.contains(&round);
        change(&mut town, &mut rng, round);
        let trees: Vec<TreeKey> = town.world.trees().collect();
        let is_waiting = |lights: &GpuLights| trees.iter().any(|tree| lights.is_waiting(*tree));
        loop {
            lights.upload(&town.world).expect("room enough");
            if !is_waiting(&lights) {
                break;
            }
            frames += 1;
            // The pools hold trees and stand-ins of different ages. Each of them is sound.
            if std::mem::take(&mut is_due) {
                check_pmfs(&mut lights, &mut rng);
                checked += 1;
            }
        }
        let requests = requests(&mut rng, 512, 20.0);
        let records = sample(&mut lights, &mut town.world, &requests);
        let mismatches = compare(&town.world, &requests, &records);
        assert!(mismatches as f64 <= OTHER_PICKS * 512.0 + 1.0, "round {round}: {mismatches} of 512 differ");
    }
    assert!(frames > 8 && checked > 1, "{frames} frames with trees that wait, {checked} checked");
}

#[test]
fn a_changed_light_sends_the_openings_near_it_and_not_all_of_them() {
    let mut rng = Rng(195);
    let Town { mut world, lamps: [tree, _], .. } = town(&mut rng);
    let mut planner = LightPlanner::new(PlanLimits::new(1 << 30));
    let mut send = |world: &mut LightWorld| {
        world.update(FrameBudget::NONE);
        planner.reserve(world).expect("room enough").plan().report.bytes
    };
    let all = send(&mut world);
    for i in 0..10 {
        world.set_emission(tree, 100 * i, Vec3::splat(70.0 + i as f32)).expect("valid");
        // Thousands of openings have 80 bytes each.
        let bytes = send(&mut world);
        assert!((500..=8192).contains(&bytes) && all > 160_000, "{bytes} of {all}");
    }
}

#[test]
fn regions_that_overlap_come_and_go_with_their_openings() {
    let mut rng = Rng(193);
    let mut world = LightWorld::new();
    let region = |rng: &mut Rng| {
        let mut region = Region::new();
        let tree = region.add_tree(LightTree::new(lamps(rng, 500)).expect("valid"));
        let place = Placement::at(rng.position(5.0).as_dvec3());
        region.add_instance(RegionInstance::new(tree, place, Policy::Static)).expect("valid");
        region
    };
    let mut keys = Vec::new();
    for round in 0..12 {
        keys.push(world.add_region(&mut region(&mut rng)).expect("valid"));
        if round >= 4 {
            drop(world.remove_region(keys.remove(0)).expect("it lives"));
        }
        world.update(FrameBudget::UNLIMITED);
        assert_eq!(world.sampler().all_lights().count(), world.light_count());
        assert_probabilities(&world.sampler(), &rng.masked_point(15.0), 200, &mut rng);
    }
}
