//! Ranges: the window of KHR_lights_punctual, as it arrives at shading points.

use girandole::glam::Vec3;
use girandole::{Light, ShadingPoint};

use super::world_of;
use testbed::testing::support::Rng;

/// The factor of KHR_lights_punctual at a distance.
fn window(dist: f64, range: f64) -> f64 {
    (1.0 - (dist / range).powi(4)).clamp(0.0, 1.0)
}

#[test]
fn what_arrives_of_each_shape_is_multiplied_by_the_window_of_its_range() {
    let mut rng = Rng(410);
    let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z];
    // Each with what arrives of it without a range, at the distance 1.
    let lights = [
        Light::point(Vec3::ZERO, Vec3::ONE),
        Light::spot(Vec3::ZERO, y, 3.0, 3.1, Vec3::ONE),
        Light::rectangle(Vec3::ZERO, x, z, Vec3::ONE).two_sided(),
        Light::triangle([x, y, z], Vec3::ONE).two_sided(),
        Light::sphere(Vec3::ZERO, 0.5, Vec3::ONE),
    ];
    let (mut inside, mut outside) = (0, 0);
    for light in lights {
        for range in [0.7, 3.0, 1.0e3, 1.0e8] {
            let (world, id) = world_of(light.with_range(range));
            let (unlimited, other) = world_of(light);
            let (sampler, unlimited) = (world.sampler(), unlimited.sampler());
            for _ in 0..300 {
                let distance =
                    range * [rng.between(0.0, 1.2), 10.0_f32.powf(rng.between(-4.0, 0.0))][rng.0 as usize % 2];
                let at = ShadingPoint::volume(Vec3::new(0.3, 0.8, 0.5).normalize() * distance);
                let u = [rng.unit(), rng.unit()];
                let Some(all) = unlimited.sample_light(&at, other, u) else { continue };
                let expected = window(f64::from(all.dist), range.into());
                let found = sampler.sample_light(&at, id, u);
                let share = found.map_or(0.0, |incident| f64::from(incident.radiance.x / all.radiance.x));
                // Five roundings in f32, of numbers up to 1.
                assert!((share - expected).abs() < 5.0e-7, "{light:?} {range}: {share} and not {expected}");
                assert!(expected > 0.0 || found.is_none());
                inside += u32::from(expected > 0.0 && expected < 0.999);
                outside += u32::from(expected == 0.0);
            }
        }
    }
    assert!(inside > 1000 && outside > 200, "{inside} {outside}");
}

#[test]
fn a_lamp_sends_nothing_from_its_range_on_and_something_just_below() {
    for range in [1.0e-6_f32, 0.1, 1.0, 1.7, 3.0, 1.0e3, 123_456.7, 1.0e8] {
        let (world, id) = world_of(Light::point(Vec3::ZERO, Vec3::ONE).with_range(range));
        let sampler = world.sampler();
        let arrives = |x: f32| sampler.sample_light(&ShadingPoint::volume(Vec3::X * x), id, [0.5; 2]);
        assert!(arrives(range).is_none() && arrives(range.next_up()).is_none(), "{range}");
        let last = arrives(range.next_down()).expect("below the range");
        let share = f64::from(last.radiance.x) * f64::from(range.next_down()).powi(2);
        let expected = window(range.next_down().into(), range.into());
        assert!((share - expected).abs() < 2.5e-7 && share > 0.0, "{range}: {share} and not {expected}");
        let half = arrives(0.5 * range).expect("below the range");
        let share = f64::from(half.radiance.x) * f64::from(0.5 * range).powi(2);
        assert!((share - 0.9375).abs() < 2.5e-7, "{range}: {share}");
    }
}
