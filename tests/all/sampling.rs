//! Probabilities are those of the draws, are above 0 for every light that contributes, and sum to
//! at most 1.

use std::collections::HashMap;

use girandole::glam::{DVec3, Mat3, Vec3};
use girandole::{
    DirectionalLight, FrameBudget, Light, LightId, LightTree, LightWorld, MAX_SPLITS, Placement, Policy, ShadingPoint,
};

use testbed::testing::support::{Rng, SPLITS, all_pmfs};

/// Probabilities are products of at most two dozen ratios of sums of eight; each rounds by a few
/// 6e-8.
const SUM_TOLERANCE: f64 = 1.0e-4;

#[test]
fn probabilities_sum_to_one_less_the_share_of_draws_without_a_light() {
    let mut rng = Rng(10);
    for _ in 0..10 {
        let world = rng.varied_world(4, 40, 5, 40.0);
        for round in 0..20 {
            let shading_point = rng.masked_point(60.0);
            let sampler = world.sampler().with_splits(SPLITS[round % SPLITS.len()]);
            let sum: f64 = all_pmfs(&sampler, &shading_point).iter().map(|(_, p)| f64::from(*p)).sum();
            assert!(sum <= 1.0 + SUM_TOLERANCE, "{sum}");
            // The rest to 1 is the share of draws that end without a light: at most a few per cent
            // here.
            let draws = 2000;
            let none = (0..draws).filter(|_| sampler.pick(&shading_point, [rng.unit(), rng.unit()]).is_none()).count();
            let missing = 1.0 - sum;
            // Five standard deviations of a binomial distribution and one draw: false alarms are
            // below 1e-6 each.
            let deviation = (missing.max(0.0) * sum.min(1.0) / f64::from(draws)).sqrt();
            assert!((none as f64 / f64::from(draws) - missing).abs() < 5.0 * deviation + 1.0 / f64::from(draws));
        }
    }
}

#[test]
fn picks_carry_the_probability_that_pmf_returns() {
    let mut rng = Rng(11);
    let world = rng.varied_world(5, 60, 4, 30.0);
    for round in 0..4000 {
        let shading_point = rng.masked_point(40.0);
        let sampler = world.sampler().with_splits(SPLITS[round % SPLITS.len()]);
        if let Some(pick) = sampler.pick(&shading_point, [rng.unit(), rng.unit()]) {
            let pmf = sampler.pmf(&shading_point, pick.light);
            assert!(pick.pmf > 0.0 && (pick.pmf / pmf - 1.0).abs() < 1.0e-4, "{} {pmf}", pick.pmf);
        }
    }
}

#[test]
fn frequencies_agree_with_the_probabilities() {
    let mut rng = Rng(12);
    let world = rng.varied_world(3, 15, 3, 10.0);
    for round in 0..10 {
        let shading_point = rng.masked_point(12.0);
        let sampler = world.sampler().with_splits(SPLITS[round % SPLITS.len()]);
        let draws = 100_000;
        let mut counts: HashMap<Option<LightId>, u32> = HashMap::new();
        for _ in 0..draws {
            *counts.entry(sampler.pick(&shading_point, [rng.unit(), rng.unit()]).map(|p| p.light)).or_default() += 1;
        }
        let mut chi_sq = 0.0;
        let mut cells = 0.0;
        for (light, pmf) in all_pmfs(&sampler, &shading_point) {
            let expected = f64::from(pmf) * f64::from(draws);
            if expected >= 5.0 {
                let observed = f64::from(counts.get(&Some(light)).copied().unwrap_or(0));
                chi_sq += (observed - expected).powi(2) / expected;
                cells += 1.0;
            }
        }
        // Chi squared with at most `cells` degrees of freedom exceeds mean + 5 sqrt(2 cells) + 15
        // with a probability below 1e-6.
        assert!(chi_sq < cells + 5.0 * (2.0_f64 * cells).sqrt() + 15.0, "{chi_sq} over {cells}");
    }
}

#[test]
fn each_of_several_suns_is_drawn_as_often_as_its_probability_says() {
    let mut world = LightWorld::new();
    let lamp = world.add_tree(LightTree::new(vec![Light::point(Vec3::Y, Vec3::splat(2.0))]).expect("a valid light"));
    world.add_instance(lamp, Placement::at(DVec3::ZERO), Policy::Static).expect("a valid placement");
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
fn every_light_that_reaches_a_shading_point_has_a_probability_above_zero() {
    let mut rng = Rng(13);
    let mut contributions = 0;
    for _ in 0..20 {
        let world = rng.varied_world(4, 50, 4, 20.0);
        for round in 0..40 {
            let shading_point = rng.masked_point(25.0);
            let sampler = world.sampler().with_splits(SPLITS[round % SPLITS.len()]);
            for (light, pmf) in all_pmfs(&sampler, &shading_point) {
                let u = [rng.unit(), rng.unit()];
                if let Some(incident) = sampler.sample_light(&shading_point, light, u) {
                    assert!(incident.radiance.is_finite() && incident.pdf > 0.0 && incident.pdf.is_finite());
                    assert!((incident.direction.length() - 1.0).abs() < 1e-4);
                    assert!(pmf > 0.0, "{light:?} sends {incident:?} to {shading_point:?} but is never chosen");
                    contributions += 1;
                }
            }
        }
    }
    assert!(contributions > 100_000, "only {contributions} contributions were tested");
}

#[test]
fn random_numbers_at_the_ends_of_the_unit_interval_give_valid_picks() {
    let mut rng = Rng(14);
    let world = rng.varied_world(3, 30, 3, 10.0);
    let below_one = 1.0 - f32::EPSILON / 2.0;
    for round in 0..200 {
        let shading_point = rng.masked_point(10.0);
        let sampler = world.sampler().with_splits(SPLITS[round % SPLITS.len()]);
        for u in [0.0, below_one] {
            for v in [0.0, below_one] {
                if let Some(pick) = sampler.pick(&shading_point, [u, v]) {
                    assert!(pick.pmf > 0.0 && sampler.pmf(&shading_point, pick.light) > 0.0);
                }
            }
        }
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
    let mut world = LightWorld::new();
    let key = world.add_tree(LightTree::new(tree).expect("valid"));
    world.add_instance(key, Placement::IDENTITY, Policy::Static).expect("valid");
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
