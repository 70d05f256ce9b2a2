//! Worlds in which sides of objects and single lights are leaves of the top level: probabilities
//! are exact, no light is lost, and both sides agree, also while objects move, turn and change.

use girandole::glam::{DVec3, Mat3, Vec3};
use girandole::{FrameBudget, InstanceKey, Light, LightId, LightTree, LightWorld, Placement, Policy, TreeKey};

use crate::gpu::{OTHER_PICKS, compare, gpu_lights, requests, sample};
use testbed::testing::support::{Rng, SPLITS, assert_probabilities};

/// A string of lamps along x, one of them dark.
fn string(rng: &mut Rng, lamps: usize) -> Vec<Light> {
    let lamp = |i: usize| {
        let emission = if i == 3 { Vec3::ZERO } else { Vec3::splat(rng.between(1.0, 50.0)) };
        Light::point(Vec3::X * (i as f32 - 0.5 * lamps as f32), emission).with_range(rng.between(20.0, 200.0))
    };
    (0..lamps).map(lamp).collect()
}

/// A train of five cars. Each has two beams to the front, one lamp at the back and one that shines
/// to all sides.
fn train(turn: f32) -> Vec<Light> {
    let front = Mat3::from_rotation_y(turn) * Vec3::Z;
    let car = |i: usize| {
        let at = Vec3::NEG_Z * i as f32;
        let back = Light::rectangle(at + Vec3::Y * 0.8, Vec3::X * 0.1, Vec3::NEG_Y * 0.1, Vec3::splat(900.0));
        let beam = |x| Light::spot(at + Vec3::new(x, 0.6, 2.0), front, 0.2, 0.5, Vec3::splat(900.0));
        [beam(-0.7), back, beam(0.7), Light::point(at + Vec3::Y * 1.5, Vec3::splat(5.0))]
    };
    (0..5).flat_map(car).collect()
}

struct Street {
    world: LightWorld,
    strings: Vec<InstanceKey>,
    string_trees: Vec<TreeKey>,
    trains: Vec<InstanceKey>,
    train: TreeKey,
}

/// Eight strings that cross each other, twenty trains that share a tree, and objects of all kinds.
fn street(rng: &mut Rng) -> Street {
    let mut world = rng.varied_world(3, 20, 3, 15.0);
    let (mut strings, mut string_trees) = (Vec::new(), Vec::new());
    for i in 0..8 {
        let tree = world.add_tree(LightTree::new(string(rng, 30 + i)).expect("valid"));
        string_trees.push(tree);
        strings.push(world.add_instance(tree, crossing(rng), Policy::Budgeted).expect("valid"));
    }
    let train = world.add_tree(LightTree::new(train(0.0)).expect("valid"));
    let trains =
        (0..20).map(|_| world.add_instance(train, rng.affine(15.0), Policy::Budgeted).expect("valid")).collect();
    world.update(FrameBudget::UNLIMITED);
    Street { world, strings, string_trees, trains, train }
}

/// Somewhere near the origin, at any angle and some size.
fn crossing(rng: &mut Rng) -> Placement {
    let linear = Mat3::from_rotation_y(rng.between(0.0, 6.3)) * rng.between(0.8, 1.2);
    Placement { linear, translation: rng.position(2.0).as_dvec3() + DVec3::Y * 5.0 }
}

/// Changes the world in the way of one of eight rounds.
fn change(street: &mut Street, rng: &mut Rng, round: usize) {
    let Street { world, strings, string_trees, trains, train: tree } = street;
    match round {
        0 => {}
        // Beams turn away from each other, and a lamp of an open string is switched on.
        1 => {
            let lights = train(1.8);
            world.set_lights(*tree, &[(0, lights[0]), (3, lights[3])]).expect("valid");
            world.set_lights(string_trees[0], &[(3, Light::point(Vec3::Y, Vec3::ONE))]).expect("valid");
            // No light shines to the back any more.
            world.remove_lights(*tree, &[1, 5, 9, 13, 17]).expect("it has the lights");
        }
        2 => drop(world.rebuild_tree(*tree).expect("it lives")),
        // The strings go apart, so that they become whole. The lamps at the back return.
        3 => {
            let back: Vec<_> = (0..5).map(|i| train(0.0)[4 * i + 1]).collect();
            world.add_lights(*tree, &back).expect("valid");
            for (i, key) in strings.iter().enumerate() {
                world.move_instance(*key, Placement::at(DVec3::Z * 60.0 * i as f64)).expect("valid");
            }
            for _ in 0..40 {
                world.update(FrameBudget::UNLIMITED);
            }
        }
        // And meet again, but for one that is hidden and one that is gone.
        4 => {
            for key in &strings[2..] {
                world.move_instance(*key, crossing(rng)).expect("valid");
            }
            let hidden = Placement { linear: Mat3::ZERO, ..Placement::IDENTITY };
            world.move_instance(strings[0], hidden).expect("valid");
            world.remove_instance(strings[1]).expect("it lives");
            for _ in 0..40 {
                world.update(FrameBudget::UNLIMITED);
            }
        }
        // Another number of sides, and of lights.
        5 => {
            world.replace_lights(*tree, train(0.0)[..18].to_vec()).expect("valid");
            world.replace_lights(string_trees[5], string(rng, 7)).expect("valid");
        }
        6 => {
            trains.drain(..5).for_each(|key| world.remove_instance(key).expect("it lives"));
            world.make_unique(trains[0]).expect("it lives");
            world.set_origin_near(DVec3::new(5.0, -3.0, 1040.0)).expect("near");
        }
        _ => world.replace_lights(*tree, rng.lights(300, 3.0)).expect("valid"),
    }
    world.update(FrameBudget::UNLIMITED);
}

#[test]
fn probabilities_add_up_and_every_light_that_contributes_has_one() {
    let mut rng = Rng(90);
    let mut street = street(&mut rng);
    for round in 0..8 {
        change(&mut street, &mut rng, round);
        let world = &street.world;
        for splits in SPLITS {
            let sampler = world.sampler().with_splits(splits);
            for _ in 0..12 {
                assert_probabilities(&sampler, &rng.masked_point(15.0), 400, &mut rng);
            }
        }
    }
}

#[test]
fn dark_lights_of_divided_and_open_trees_are_never_chosen() {
    let mut rng = Rng(91);
    let Street { mut world, strings, trains, train: tree, .. } = street(&mut rng);
    let lamps = (1..20).step_by(4);
    let dark = lamps.clone().map(|i| (i as u32, train(0.0)[i].with_emission(Vec3::ZERO)));
    world.set_lights(tree, &dark.collect::<Vec<_>>()).expect("valid");
    world.update(FrameBudget::NONE);
    let sampler = world.sampler();
    for _ in 0..50 {
        let shading_point = rng.masked_point(15.0);
        let dark = strings.iter().map(|key| (key, 3)).chain(trains.iter().map(|key| (key, 1)));
        for (key, light) in dark {
            assert_eq!(sampler.pmf(&shading_point, LightId::Local { instance: *key, light }), 0.0);
        }
    }
}

#[test]
fn the_gpu_chooses_the_same_lights_while_parts_come_and_go() {
    let mut rng = Rng(92);
    let mut street = street(&mut rng);
    let mut lights = gpu_lights();
    for round in 0..8 {
        change(&mut street, &mut rng, round);
        let requests = requests(&mut rng, 2048, 20.0);
        let records = sample(&mut lights, &mut street.world, &requests);
        let mismatches = compare(&street.world, &requests, &records);
        assert!(mismatches as f64 <= OTHER_PICKS * 2048.0 + 1.0, "round {round}: {mismatches} of 2048 differ");
        assert!(records.iter().filter(|record| record.pmf > 0.0).count() > 500, "round {round}");
    }
}

#[test]
fn overlapping_strings_are_told_apart_light_by_light() {
    let mut rng = Rng(93);
    let Street { world, strings, .. } = street(&mut rng);
    let sampler = world.sampler();
    // One centimetre below a lamp of one string, among eight strings: nearly all light is its.
    let placement = world.instance(strings[4]).expect("it lives").placement;
    let lamp = Vec3::X * (10.0 - 0.5 * 34.0);
    let position = (placement.linear * lamp).as_dvec3() + placement.translation - DVec3::Y * 0.01;
    let shading_point = girandole::ShadingPoint::surface(position.as_vec3(), Vec3::Y);
    let pmf = sampler.pmf(&shading_point, LightId::Local { instance: strings[4], light: 10 });
    assert!(pmf > 0.99, "{pmf}");
}
