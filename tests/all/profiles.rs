//! Lamps with photometric profiles: what arrives, and that each is chosen where it does.

use girandole::glam::{DMat3, DVec3, Mat3, Quat, Vec3};
use girandole::{Light, LightId, LightTree, LightWorld, Placement, Policy, Profile, ShadingPoint};

use testbed::testing::support::{Rng, assert_probabilities, mean};

/// Beams of random shape and width, dark in most directions.
fn profile(rng: &mut Rng) -> Profile {
    let vertical: Vec<f32> = (0..=18).map(|i| 10.0 * i as f32).collect();
    let horizontal: Vec<f32> = (0..=8).map(|i| 45.0 * i as f32).collect();
    let mut candela = (0..19 * 8).map(|_| (rng.between(-2000.0, 1000.0)).max(0.0)).collect::<Vec<f32>>();
    candela.extend_from_within(..19);
    let [vertical, horizontal] =
        [vertical, horizontal].map(|angles| angles.into_iter().map(f32::to_radians).collect::<Vec<_>>());
    let axes = Mat3::from_cols(Vec3::X, Vec3::Y, Vec3::NEG_Z);
    Profile::new(&vertical, &horizontal, &candela, axes).expect("a sound table")
}

/// Instances of trees of such lamps, and the lamps of each; some instances are sheared, mirrored or nearly flat.
fn world(rng: &mut Rng) -> LightWorld {
    let mut world = LightWorld::new();
    let profiles: Vec<Profile> = (0..5).map(|_| profile(rng)).collect();
    for tree in 0..4 {
        let lamp = |rng: &mut Rng| {
            let turn = Quat::from_axis_angle(rng.direction(), rng.between(0.0, 6.0));
            let lamp = Light::profile(rng.position(3.0), turn, profiles[rng.below(5)], Vec3::new(1.0, 0.5, 0.2));
            if rng.below(3) == 0 { lamp.with_range(rng.between(5.0, 30.0)) } else { lamp }
        };
        let lamps = (0..30).map(|_| lamp(rng)).collect();
        let key = world.add_tree(LightTree::new(lamps).expect("valid lamps"));
        for i in 0..3 {
            let turn = || Mat3::from_quat(Quat::from_axis_angle(Vec3::new(0.6, 0.8, 0.0), (tree + i) as f32));
            let scale = match (tree + i) % 4 {
                0 => Vec3::ONE,
                1 => Vec3::new(-1.5, 1.5, 1.5),
                2 => Vec3::new(0.4, 2.0, 1.0),
                _ => Vec3::new(1.0, 0.02, 1.0),
            };
            let translation = rng.position(15.0).as_dvec3() + DVec3::splat(1024.0);
            let placement = Placement { linear: turn() * Mat3::from_diagonal(scale) * turn(), translation };
            world.add_instance(key, placement, Policy::Static).expect("a placement");
        }
    }
    world.set_origin_near(DVec3::splat(1025.0)).expect("an origin");
    world
}

/// The light of a lamp at a point, computed in f64 from its definition.
fn arriving(light: &Light, placement: &Placement, at: DVec3) -> DVec3 {
    let girandole::Shape::Profile { position, rotation, profile } = light.shape else { panic!("not a profile") };
    let linear: DMat3 = placement.linear.as_dmat3();
    let toward = at - (placement.translation + linear * position.as_dvec3());
    let in_lamp = Quat::from_array(rotation).as_dquat().inverse() * (linear.inverse() * toward);
    let ratio = toward.length_squared() / f64::from(light.range).powi(2);
    let candela = f64::from(profile.candela(in_lamp.normalize().as_vec3()));
    light.emission.as_dvec3() * candela * (1.0 - ratio * ratio).max(0.0) / toward.length_squared()
}

#[test]
fn what_arrives_is_the_intensity_of_the_file_in_that_direction() {
    let mut rng = Rng(61);
    let world = world(&mut rng);
    let (mut lit, mut dark) = (0, 0);
    for _ in 0..200 {
        let at = ShadingPoint::surface(rng.position(20.0), Vec3::ZERO);
        for light in world.sampler().all_lights() {
            let LightId::Local { instance, light: index } = light else { panic!("there is no sun") };
            let (tree, placement) =
                (world.instance(instance).unwrap().tree, world.instance(instance).unwrap().placement);
            let lamp = &world.tree(tree).unwrap().lights()[index as usize];
            let expected = arriving(lamp, &placement, at.position.as_dvec3() + world.origin());
            let found = world.sampler().sample_light(&at, light, [0.5; 2]).map_or(Vec3::ZERO, |found| found.radiance);
            // A nearly flat instance magnifies the rounding of positions, so much of a cell of 10 degrees.
            let most = 1.0e-2 * (1000.0 / 100.0) + 2.0e-3 * expected.length();
            let error = (found.as_dvec3() - expected).length();
            assert!(error <= most.max(5.0e-3 * expected.length()), "{found} {expected} {placement:?}");
            *(if expected == DVec3::ZERO { &mut dark } else { &mut lit }) += 1;
        }
    }
    assert!(lit > 10_000 && dark > 10_000, "{lit} {dark}");
}

#[test]
fn each_lamp_that_contributes_can_be_chosen() {
    let mut rng = Rng(62);
    let world = world(&mut rng);
    for _ in 0..100 {
        assert_probabilities(&world.sampler(), &rng.shading_point(20.0), 200, &mut rng);
    }
}

#[test]
fn means_over_samples_are_the_sum_over_all_lamps() {
    let mut rng = Rng(63);
    let world = world(&mut rng);
    for _ in 0..4 {
        let at = rng.shading_point(15.0);
        let cosine = |direction: Vec3| if at.normal == Vec3::ZERO { 1.0 } else { at.normal.dot(direction).max(0.0) };
        let sum: f64 = world
            .sampler()
            .all_lights()
            .filter_map(|light| world.sampler().sample_light(&at, light, [0.5; 2]))
            .map(|incident| f64::from(incident.radiance.y * cosine(incident.direction)))
            .sum();
        let [mean, error] = mean(100_000, || {
            world.sampler().sample(&at, [(); 4].map(|()| rng.unit())).map_or(0.0, |sample| {
                f64::from(sample.incident.radiance.y * cosine(sample.incident.direction) / sample.pmf)
            })
        });
        // Four standard errors: a false alarm in 16,000 for each point.
        assert!((mean - sum).abs() < 4.0 * error, "{mean} {sum} {error}");
        assert!(error < 0.02 * sum, "{error} of {sum}");
    }
}
