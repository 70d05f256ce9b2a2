//! Spheres from a billionth of the distance up to the shading point.

use std::f64::consts::PI;

use girandole::glam::Vec3;
use girandole::{Light, ShadingPoint};

use super::{exact, squares, world_of};
use testbed::testing::support::Rng;

/// Radii, as shares of the distance of the centre.
const RATIOS: [f64; 16] = [
    1.0e-9,
    1.0e-8,
    1.0e-6,
    1.0e-4,
    1.0e-3,
    0.01,
    0.1,
    0.3,
    0.7,
    0.89,
    0.91,
    0.99,
    0.999,
    0.9999,
    1.0 - 1.0e-5,
    1.0 - 1.0e-6,
];

#[test]
fn spheres_have_the_densities_and_the_illuminance_of_their_closed_forms() {
    let mut rng = Rng(440);
    for ratio in RATIOS {
        for scale in [1.0e-3, 1.0, 1.0e3] {
            let radius = (ratio * scale) as f32;
            let (world, id) = world_of(Light::sphere(Vec3::ZERO, radius, Vec3::ONE));
            let sampler = world.sampler();
            for _ in 0..10 {
                let at = (exact(rng.direction()) * scale).as_vec3();
                // The sine of the half-angle of the sphere, squared, and 1 − cosine from it.
                let sin_sq = f64::from(radius).powi(2) / exact(at).length_squared();
                let cos = (1.0 - sin_sq).sqrt();
                let solid_angle = 2.0 * PI * sin_sq / (1.0 + cos);
                // f32 rounds sin² by 1.2e-7 and three more times; 1 − cos loses 1.2e-7 / cos of it.
                let tolerance = 2.0e-6 + 1.2e-7 / cos.max(1.0e-3);
                // A point in a volume, since directions at the rim may round below a horizon.
                let volume = ShadingPoint::volume(at);
                let mut sum = 0.0;
                for u in squares(12) {
                    let incident = sampler.sample_light(&volume, id, u).expect("the sphere is seen");
                    // The distance is that of a point that is rounded to f32, and the density has its
                    // third power.
                    let tolerance = tolerance + 2.5e-6 * scale / f64::from(incident.dist).max(0.1 * scale);
                    let pdf = sampler.pdf(&volume, id, at + incident.direction * incident.dist);
                    for pdf in [incident.pdf, pdf] {
                        let error = f64::from(pdf) * solid_angle - 1.0;
                        assert!(error.abs() < tolerance, "{ratio} {scale}: {pdf} {solid_angle} {error:e}");
                    }
                    let cosine = -exact(at).normalize().dot(exact(incident.direction));
                    sum += cosine / f64::from(incident.pdf) / 144.0;
                }
                // The cosine is linear in the first number, so the middles of strata are exact.
                let (expected, error) = (PI * sin_sq, sum / (PI * sin_sq) - 1.0);
                // Densities of points at a tenth of the distance have the greatest rounding.
                let tolerance = 2.0 * tolerance + 2.5e-5;
                assert!(error.abs() < tolerance, "{ratio} {scale}: {sum} and not {expected}, {error:e}");
            }
        }
    }
}
