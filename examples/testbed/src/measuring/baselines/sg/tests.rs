use super::*;
use crate::common::pcg::Rng;
use crate::measuring::irradiance::irradiance;
use crate::measuring::reflection::{brdf, reflection};
use girandole::glam::vec3;

/// The importance of lights as one group, and the sum of what they send to a surface, over pi.
fn of_group(lights: &[Light], at: &ShadingPoint) -> (f64, f64) {
    let moments = lights.iter().filter_map(Moments::of).reduce(|a, b| a.union(&b)).expect("lights");
    let mut group = GaussianLights::<2>::DARK;
    group.set(1, &moments);
    let [dark, importance, ..] = Surface::of(at).groups::<2, 4>(&group).importances;
    assert_eq!(dark, 0.0);
    let exact: f64 = lights.iter().map(|light| irradiance(light, at)).sum();
    (importance.into(), exact / std::f64::consts::PI)
}

fn normal_pair(rng: &mut Rng) -> (f32, f32) {
    let (s, c) = rng.range(0.0, 2.0 * PI).sin_cos();
    let length = (-2.0 * (1.0 - rng.unit()).ln()).sqrt();
    (length * s, length * c)
}

#[test]
fn a_point_has_the_importance_of_its_irradiance() {
    let lamp = [Light::point(vec3(0.4, 2.0, -1.0), Vec3::splat(700.0))];
    for normal in [Vec3::Y, vec3(0.6, 0.8, 0.0), vec3(0.0, 0.1, 0.995).normalize(), vec3(0.0, -0.8, -0.6)] {
        let at = ShadingPoint::surface(vec3(1.0, 0.2, 0.3), normal);
        let (importance, exact) = of_group(&lamp, &at);
        assert!((importance - exact).abs() < 1.0e-3 * exact + 1.0e-6, "{normal}: {importance} {exact}");
    }
    // In a volume, directions have no weight.
    let (importance, exact) = of_group(&lamp, &ShadingPoint::volume(Vec3::ZERO));
    assert!((importance / exact / std::f64::consts::PI - 1.0).abs() < 1.0e-3, "{importance} {exact}");
}

#[test]
fn lamps_in_a_gaussian_cloud_have_the_importance_of_their_sum() {
    let mut rng = Rng::new(3, 1);
    let lamps: Vec<Light> = (0..20_000)
        .map(|_| {
            let (x, y) = normal_pair(&mut rng);
            Light::point(vec3(x, 3.0, y), Vec3::ONE)
        })
        .collect();
    // A Gaussian of directions is one of places up to the second order of the angular size.
    for (distance, normal) in [
        (20.0, Vec3::Y),
        (10.0, Vec3::Y),
        (5.0, Vec3::Y),
        (5.0, vec3(0.6, 0.8, 0.0)),
        (10.0, vec3(0.98, 0.2, 0.0).normalize()),
    ] {
        let tolerance = 0.01 + 3.0 / f64::from(distance * distance);
        let at = ShadingPoint::surface(vec3(0.0, 3.0 - distance, 0.0), normal);
        let (importance, exact) = of_group(&lamps, &at);
        assert!((importance / exact - 1.0).abs() < tolerance, "{distance} {normal}: {importance} {exact}");
    }
}

#[test]
fn a_group_that_faces_away_or_is_below_the_horizon_has_less() {
    let panel = |y: f32| Light::rectangle(Vec3::Y * y, Vec3::Z, Vec3::X, Vec3::ONE);
    let at = |y: f32, normal| ShadingPoint::surface(Vec3::Y * y, normal);
    let (front, _) = of_group(&[panel(0.0)], &at(9.0, Vec3::NEG_Y));
    let (back, _) = of_group(&[panel(0.0)], &at(-9.0, Vec3::Y));
    assert!(back < 0.01 * front && back > 0.0, "{front} {back}");
    assert_eq!(of_group(&[panel(0.0)], &at(-9.0, Vec3::NEG_Y)).0, 0.0);
    // Its mean is below the horizon and its box is not.
    let (rim, exact) = of_group(&[panel(0.0), panel(9.5)], &at(9.2, Vec3::Y));
    assert!(rim > 0.0 && exact == 0.0);
}

#[test]
fn a_glossy_surface_reflects_a_lobe_as_quadrature_does() {
    let normal = Vec3::Y;
    // The last two lights are about as wide as the lobe, where the widened lobe is least exact.
    for (roughness, sharpness, tilt, tolerance) in
        [(0.3, 2_000.0, 0.0, 0.04), (0.6, 200.0, 0.9, 0.04), (0.3, 100.0, 0.6, 0.25), (0.5, 30.0, 0.6, 0.25)]
    {
        let view = vec3(f32::sin(tilt), f32::cos(tilt), 0.0);
        let gloss = Gloss { view, roughness, specular: 0.5, diffuse: 0.0 };
        let at = ShadingPoint::surface(Vec3::ZERO, normal).with_gloss(gloss);
        let glossy = Glossy::of(&gloss, normal).expect("a gloss");
        for offset in [0.0, 0.1, 0.3] {
            let axis = vec3(-f32::sin(tilt - offset), f32::cos(tilt - offset), 0.0);
            let reflected = glossy.reflected(axis.to_array(), sharpness, axis.y, normal.to_array());
            let sum = lobe_times_brdf(axis.as_dvec3(), f64::from(sharpness), |l| {
                if l.y > 0.0 { brdf(&gloss, &at, l) * l.y } else { 0.0 }
            });
            let ratio = f64::from(reflected) / sum;
            assert!((ratio - 1.0).abs() < tolerance, "{roughness} {sharpness} {tilt} {offset}: {ratio}");
        }
    }
}

/// The integral of an SG times a function of direction, by the midpoint rule about its axis.
fn lobe_times_brdf(axis: DVec3, sharpness: f64, function: impl Fn(DVec3) -> f64) -> f64 {
    let (rings, steps) = (400, 200);
    let (t, b) = axis.any_orthonormal_pair();
    let cell = |ring: i32, step: i32| {
        // Each ring has the same integral of the lobe.
        let share = (f64::from(ring) + 0.5) / f64::from(rings);
        let along = 1.0 + (1.0 - share * (1.0 - (-2.0 * sharpness).exp())).ln() / sharpness;
        let (s, c) = ((f64::from(step) + 0.5) * std::f64::consts::TAU / f64::from(steps)).sin_cos();
        function(axis * along + (t * c + b * s) * (1.0 - along * along).max(0.0).sqrt())
    };
    let sum: f64 = (0..rings).flat_map(|ring| (0..steps).map(move |step| (ring, step))).map(|(r, s)| cell(r, s)).sum();
    sum / f64::from(rings * steps) * std::f64::consts::TAU * (1.0 - (-2.0 * sharpness).exp()) / sharpness
}

fn lights(rng: &mut Rng, count: usize) -> Vec<Light> {
    let kinds = (0..count).map(|i| {
        let mut v = |half: f32| vec3(rng.range(-half, half), rng.range(-half, half), rng.range(-half, half));
        let (position, direction, u, w) = (v(12.0) + Vec3::Y * 12.0, v(1.0).normalize(), v(0.5), v(0.5));
        let emission = Vec3::splat(rng.range(0.1, 5.0));
        match i % 4 {
            0 => Light::point(position, emission),
            1 => Light::spot(position, direction, 0.3, 0.8, emission),
            2 => Light::rectangle(position, u, w, emission),
            // Dark lights have no leaf.
            _ => Light::sphere(position, 0.2, if i % 8 == 3 { Vec3::ZERO } else { emission }),
        }
    });
    kinds.collect()
}

fn shading_points() -> [ShadingPoint; 3] {
    let matte = ShadingPoint::surface(vec3(0.5, 3.0, -1.0), vec3(0.3, 0.9, 0.1).normalize());
    let gloss = Gloss { view: vec3(1.0, 0.4, 0.0), roughness: 0.4, specular: 0.3, diffuse: 0.3 };
    [matte, matte.with_gloss(gloss), ShadingPoint::volume(matte.position)]
}

/// Draws at many points, evenly over [0, 1): the sum over lights of f is the mean of f / p.
fn check<const N: usize, const LANES: usize>(tree: &GaussianTree<N, LANES>, lights: &[Light]) {
    const DRAWS: usize = 100_000;
    for at in shading_points() {
        let pmfs = tree.pmfs(&at);
        let sum: f64 = pmfs.iter().map(|pmf| f64::from(*pmf)).sum();
        // Groups whose lights are all below the horizon may still have a box above it: draws end there.
        assert!(sum > 0.9 && sum < 1.0 + 1.0e-5, "{sum}");
        let light: Vec<f64> = lights.iter().map(|light| reflection(light, &at)).collect();
        let mut hits = vec![0; lights.len()];
        let (mut mean, mut square, mut dead) = (0.0, 0.0, 0.0);
        let mut rng = Rng::new(9, 4);
        for _ in 0..DRAWS {
            let u = f64::from(rng.unit()) + f64::from(rng.unit()) * 0.5_f64.powi(24);
            let Some((index, pmf)) = tree.pick(&at, u.min(1.0 - f64::EPSILON)) else {
                dead += 1.0;
                continue;
            };
            let exact = pmfs[index as usize];
            assert!((pmf - exact).abs() <= 1.0e-5 * exact, "{pmf} {exact}");
            hits[index as usize] += 1;
            let value = light[index as usize] / f64::from(pmf);
            (mean, square) = (mean + value / DRAWS as f64, square + value * value / DRAWS as f64);
        }
        let (all, error) = (light.iter().sum::<f64>(), ((square - mean * mean).max(0.0) / DRAWS as f64).sqrt());
        assert!((mean - all).abs() < 5.0 * error, "{mean} {all} {error}");
        let expected = (1.0 - sum).max(0.0) * DRAWS as f64;
        assert!((dead - expected).abs() < 5.5 * expected.sqrt() + 5.0, "{dead} {expected}");
        for (pmf, hits) in pmfs.iter().zip(hits) {
            let expected = f64::from(*pmf) * DRAWS as f64;
            assert!((f64::from(hits) - expected).abs() < 5.5 * expected.sqrt() + 5.0, "{hits} {expected}");
        }
        // Every light that contributes may be drawn.
        assert!(light.iter().zip(&pmfs).all(|(light, pmf)| *light == 0.0 || *pmf > 0.0));
    }
}

#[test]
fn draws_have_their_probabilities_and_their_mean_is_the_sum_over_all_lights() {
    let mut rng = Rng::new(17, 2);
    for count in [1, 2, 3, 9, 200] {
        let lights = lights(&mut rng, count);
        check(&GaussianTree::binary(&lights), &lights);
        let tree = LightTree::new(lights.clone()).expect("sound lights");
        check(&GaussianTree::wide(&tree), &lights);
    }
}

#[test]
fn without_lights_nothing_is_drawn() {
    let dark = [Light::point(Vec3::ZERO, Vec3::ZERO)];
    for lights in [&[][..], &dark] {
        let binary = GaussianTree::binary(lights);
        let wide = GaussianTree::wide(&LightTree::new(lights.to_vec()).expect("sound lights"));
        for at in shading_points() {
            assert!(binary.pick(&at, 0.5).is_none() && wide.pick(&at, 0.5).is_none());
            assert!(binary.pmfs(&at).iter().chain(&wide.pmfs(&at)).all(|pmf| *pmf == 0.0));
        }
    }
}
