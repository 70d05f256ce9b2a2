//! Probabilities are those of the draws, are above 0 for every light that contributes, and sum to
//! at most 1.

use std::collections::HashMap;

use girandole::glam::{DVec3, Mat3, Vec3};
use girandole::{
    DirectionalLight, FrameBudget, Light, LightId, LightTree, LightWorld, MAX_SPLITS, Placement, Policy, ShadingPoint,
};

use testbed::testing::support::{Rng, SPLITS, assert_frequencies, assert_probabilities, place_tree, world_of};

#[test]
fn probabilities_are_those_of_draws_and_every_light_that_contributes_has_one() {
    let mut rng = Rng(10);
    for _ in 0..20 {
        let world = rng.varied_world(4, 50, 4, 30.0);
        for splits in 0..=MAX_SPLITS {
            let sampler = world.sampler().with_splits(splits);
            assert_probabilities(&sampler, &rng.masked_point(40.0), 2000, &mut rng);
        }
    }
}

#[test]
fn frequencies_agree_with_the_probabilities() {
    let mut rng = Rng(12);
    let world = rng.varied_world(3, 15, 3, 10.0);
    for round in 0..10 {
        let sampler = world.sampler().with_splits(SPLITS[round % SPLITS.len()]);
        assert_frequencies(&sampler, &rng.masked_point(12.0), 100_000, &mut rng);
    }
}

#[test]
fn each_of_several_suns_is_drawn_as_often_as_its_probability_says() {
    let mut world = LightWorld::new();
    place_tree(&mut world, vec![Light::point(Vec3::Y, Vec3::splat(2.0))], Placement::at(DVec3::ZERO), Policy::Static);
    for lux in [1.0, 4.0, 2.0] {
        let sun = DirectionalLight { direction: Vec3::NEG_Y, illuminance: Vec3::splat(lux) };
        world.add_directional(sun).expect("a valid light");
    }
    let (sampler, ground) = (world.sampler(), ShadingPoint::surface(Vec3::ZERO, Vec3::Y));
    // Evenly spaced numbers, so a share is exact to one draw at each of its ends.
    let draws = 9000;
    let mut counts: HashMap<LightId, u32> = HashMap::new();
    for i in 0..draws {
        let u = (i as f32 + 0.5) / draws as f32;
        *counts.entry(sampler.pick(&ground, [u, 0.5]).expect("all of them shine").light).or_default() += 1;
    }
    assert_eq!(counts.len(), 4);
    for (light, count) in counts {
        let expected = sampler.pmf(&ground, light) * draws as f32;
        assert!((count as f32 - expected).abs() <= 2.0, "{light:?}: {count} of {expected}");
    }
}

#[test]
fn area_lights_integrate_to_their_irradiance() {
    // A one-sided unit square lies 2 m above the shading point. The corner formula gives the form
    // factor F; E = L * F * pi.
    let tree = vec![Light::rectangle(Vec3::new(0.0, 2.0, 0.0), Vec3::X * 0.5, Vec3::Z * 0.5, Vec3::ONE)];
    // X x Z points down, towards the shading point.
    let corner = |a: f64, b: f64| {
        let (p, q) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
        (a / p * (b / p).atan() + b / q * (a / q).atan()) / 2.0
    };
    let expected = 4.0 * corner(0.25, 0.25);
    let (world, ..) = world_of(tree, Policy::Static);
    let estimate = irradiance(&world, &ShadingPoint::surface(Vec3::ZERO, Vec3::Y), 20_000);
    assert!((estimate / expected - 1.0).abs() < 0.01, "{estimate} {expected}");
}

#[test]
fn a_sphere_and_its_stretched_instance_integrate_to_their_irradiance() {
    // A sphere of radius r lies at the distance d straight above: E = pi L (r / d)^2.
    let mut world = LightWorld::new();
    let key = world.add_tree(LightTree::new(vec![Light::sphere(Vec3::ZERO, 0.5, Vec3::ONE)]).expect("valid"));
    let at = DVec3::new(0.0, 2.0, 0.0);
    let instance = world.add_instance(key, Placement::at(at), Policy::Static).expect("valid");
    let shading_point = ShadingPoint::surface(Vec3::ZERO, Vec3::Y);
    let expected = std::f64::consts::PI * 0.25_f64.powi(2);
    assert!((irradiance(&world, &shading_point, 20_000) / expected - 1.0).abs() < 0.01);
    // Stretched to an ellipsoid, it is compared with a plain sum over its surface.
    let linear = Mat3::from_diagonal(Vec3::new(2.0, 0.5, 1.0));
    world.move_instance(instance, Placement { linear, translation: at }).expect("valid");
    let mut rng = Rng(15);
    let mut sum = 0.0;
    let draws = 400_000;
    for _ in 0..draws {
        let n = rng.direction().as_dvec3();
        let (m, r) = (linear.as_dmat3(), 0.5);
        let normal_area = m.inverse().transpose() * n * m.determinant() * (4.0 * std::f64::consts::PI * r * r);
        let toward = m * (n * r) + at;
        let dist_sq = toward.length_squared();
        let direction = toward / dist_sq.sqrt();
        sum += (-normal_area.dot(direction)).max(0.0) * direction.y.max(0.0) / dist_sq;
    }
    let expected = sum / f64::from(draws);
    let estimate = irradiance(&world, &shading_point, 40_000);
    assert!((estimate / expected - 1.0).abs() < 0.015, "{estimate} {expected}");
}

/// Estimates the irradiance from stratified points on the lights.
fn irradiance(world: &LightWorld, shading_point: &ShadingPoint, draws: u32) -> f64 {
    let sampler = world.sampler();
    let side = (f64::from(draws)).sqrt() as u32;
    let mut sum = 0.0;
    for i in 0..side {
        for j in 0..side {
            let u = [(i as f32 + 0.5) / side as f32, (j as f32 + 0.5) / side as f32];
            if let Some(s) = sampler.sample(shading_point, [0.5, 0.5, u[0], u[1]]) {
                let cosine = s.incident.direction.dot(shading_point.normal).max(0.0);
                sum += f64::from(s.incident.radiance.x * cosine / (s.pmf * s.incident.pdf));
            }
        }
    }
    sum / f64::from(side * side)
}

#[test]
fn the_split_of_the_only_instance_is_not_counted_except_without_splits_and_at_the_most() {
    let mut rng = Rng(1207);
    let lamps: Vec<Light> = (0..300).map(|_| Light::point(rng.position(20.0), Vec3::ONE)).collect();
    let tree = LightTree::new(lamps).expect("valid");
    let mut world = LightWorld::new();
    let key = world.add_tree(tree.clone());
    let instance = world.add_instance(key, Placement::at(DVec3::ZERO), Policy::Static).expect("valid");
    world.update(FrameBudget::UNLIMITED);
    let mut differences = 0;
    for _ in 0..20 {
        let at = ShadingPoint::volume(rng.position(20.0));
        for splits in 0..=MAX_SPLITS {
            // The split of the instance is one of seven, and then the tree has the other six.
            let in_tree = if splits == MAX_SPLITS { MAX_SPLITS - 1 } else { splits };
            let sampler = world.sampler().with_splits(splits);
            for light in 0..300 {
                let pmf = sampler.pmf(&at, LightId::Local { instance, light });
                let alone = tree.pmf(&at, light, in_tree);
                // Instances widen boxes by the error of a rotation, which changes doubts a little.
                assert!((pmf - alone).abs() <= 1.0e-3 * alone, "{splits} splits: {pmf}, alone {alone}");
                let counted = tree.pmf(&at, light, in_tree.saturating_sub(1));
                differences += u32::from((1..MAX_SPLITS).contains(&splits) && (pmf - counted).abs() > 0.01 * pmf);
            }
        }
    }
    assert!(differences > 1000, "splits change {differences} probabilities");
}
