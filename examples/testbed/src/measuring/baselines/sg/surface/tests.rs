use super::super::light::Moments;
use super::*;
use crate::common::pcg::Rng;
use crate::measuring::irradiance::irradiance;
use crate::measuring::reflection::brdf;
use girandole::Light;
use girandole::glam::{DVec3, vec3};

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
