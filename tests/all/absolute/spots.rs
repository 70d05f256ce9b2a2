//! Spots: the falloff, its integral over the sphere and its mean cosine.

use std::f64::consts::PI;

use girandole::glam::{DVec3, Vec3};
use girandole::light::MAX_EMISSION;
use girandole::{Light, ShadingPoint};

use super::{exact, integral, world_of};
use testbed::testing::support::Rng;

/// Outer angles in radians. 0.0447 is where the least width of the falloff is that of the spot.
const OUTER: [f32; 19] = [
    1.0e-6,
    1.0e-5,
    1.0e-4,
    1.0e-3,
    0.01,
    0.03,
    0.0447,
    0.0448,
    0.05,
    0.06,
    0.1,
    0.3,
    0.7,
    1.2,
    1.570_796_4,
    2.0,
    2.6,
    3.1,
    std::f32::consts::PI,
];

/// The inner angles of an outer one.
fn inner_angles(outer: f32) -> [f32; 4] {
    [0.0, 0.5 * outer, 0.95 * outer, outer]
}

/// cos a − cos b, without cancellation.
fn cosine_difference(a: f64, b: f64) -> f64 {
    2.0 * (0.5 * (a + b)).sin() * (0.5 * (b - a)).sin()
}

/// The width of the falloff as a difference of cosines.
fn width(inner: f32, outer: f32) -> f64 {
    cosine_difference(inner.into(), outer.into()).max(1.0e-3)
}

/// The root of the share of the intensity at an angle from the axis, as the documentation of
/// `Shape::Spot` defines it.
fn root_share(inner: f32, outer: f32, angle: f64) -> f64 {
    (cosine_difference(angle, outer.into()) / width(inner, outer)).clamp(0.0, 1.0)
}

/// The angle within which the intensity is full: 0 if it is not even on the axis.
fn full_angle(inner: f32, outer: f32) -> f64 {
    let half_sin_sq = (0.5 * f64::from(outer)).sin().powi(2) - 0.5 * width(inner, outer);
    2.0 * half_sin_sq.max(0.0).sqrt().asin()
}

#[test]
fn the_flux_and_the_mean_cosine_of_a_spot_are_integrals_over_the_sphere() {
    for outer in OUTER {
        for inner in inner_angles(outer) {
            // The falloff has a corner at the full angle, so each part has its own integral.
            let (full, end) = (full_angle(inner, outer), f64::from(outer));
            let both = |f: &dyn Fn(f64) -> f64| integral(0.0, full, 50, f) + integral(full, end, 50, f);
            let ring = |angle: f64| 2.0 * PI * angle.sin() * root_share(inner, outer, angle).powi(2);
            let solid_angle = both(&ring);
            let shortness = both(&|angle| ring(angle) * cosine_difference(0.0, angle)) / solid_angle;

            let light = Light::spot(Vec3::ZERO, Vec3::Y, inner, outer, Vec3::splat(MAX_EMISSION));
            let cluster = light.cluster();
            let flux = solid_angle * f64::from(MAX_EMISSION);
            // The code subtracts cosines in f32, which are off by 6e-8 each.
            let tolerance = 1.0e-6 + 1.2e-7 / width(inner, outer);
            for value in [cluster.flux, light.flux()] {
                let error = f64::from(value) / flux - 1.0;
                assert!(error.abs() < tolerance, "{inner} {outer}: {value} and not {flux}, by {error:e}");
            }
            let cosine = 1.0 - shortness;
            let error = f64::from(cluster.axis.y) - cosine;
            assert!(error.abs() < 4.0e-7, "{inner} {outer}: {} and not {cosine}, by {error:e}", cluster.axis.y);
            assert_eq!((cluster.axis.x, cluster.axis.z), (0.0, 0.0));
        }
    }
}

#[test]
fn a_spot_sends_its_intensity_times_the_falloff_over_the_squared_distance() {
    let mut rng = Rng(400);
    let (mut partial, mut full, mut dark) = (0, 0, 0);
    for outer in OUTER {
        for inner in inner_angles(outer) {
            let axis = rng.direction();
            let (side, other) = axis.any_orthonormal_pair();
            let (world, id) = world_of(Light::spot(Vec3::ZERO, axis, inner, outer, Vec3::ONE));
            let sampler = world.sampler();
            for i in 0..=120 {
                let (angle, turn) = (f64::from(outer) * f64::from(i) / 100.0, f64::from(rng.between(0.0, 6.3)));
                let around = exact(side) * turn.cos() + exact(other) * turn.sin();
                let at = (exact(axis) * angle.cos() + around * angle.sin()).as_vec3() * rng.between(0.5, 20.0);
                // The angle at which the rounded position lies.
                let (to, along) = (exact(at).normalize(), exact(axis).normalize());
                let angle = 2.0 * (to - along).length().atan2((to + along).length());
                let root = root_share(inner, outer, angle);
                let found = sampler.sample_light(&ShadingPoint::volume(at), id, [0.5; 2]);
                let lux = found.map_or(0.0, |incident| f64::from(incident.radiance.x));
                let share = lux * exact(at).length_squared();
                // The difference of two cosines in f32: one is a product of two unit vectors, whose
                // lengths are off by some 1e-7, the other is rounded once.
                let tolerance = 1.0e-6 + 4.0e-7 / width(inner, outer);
                let error = share.sqrt() - root;
                assert!(error.abs() < tolerance, "{inner} {outer} at {angle}: {share} and not {root}², by {error:e}");
                full += u32::from(root == 1.0);
                dark += u32::from(root == 0.0);
                partial += u32::from(root > 0.0 && root < 1.0);
            }
        }
    }
    assert!(partial > 2000 && full > 1000 && dark > 1000, "{partial} {full} {dark}");
}

#[test]
fn a_spot_of_no_width_is_dark() {
    let cluster = Light::spot(Vec3::ONE, Vec3::Y, 0.0, 0.0, Vec3::splat(MAX_EMISSION)).cluster();
    assert_eq!(cluster.flux, 0.0);
    assert_eq!(exact(cluster.mean), DVec3::ONE);
}
