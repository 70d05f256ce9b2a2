//! The reflectance of surfaces at the limits of roughness, reflectance and grazing angles.

use glam::{DVec2, Vec3};

use super::{exact, size};
use crate::f64_reference::ROUNDING;
use crate::shading::gloss::{Gloss, LocalGloss};
use crate::tree::testing::Rng;
use testbed::measuring::reference::gloss::{Surface, reflected};

#[test]
fn reflectances_are_positive_and_finite_and_those_of_the_formula_in_f64() {
    let mut rng = Rng(530);
    let (mut worst, mut compared) = (0.0_f64, 0);
    for _ in 0..200_000 {
        let roughness = [0.0, 0.01, 0.0317, 0.1, 1.0, rng.unit()][rng.below(6)];
        let specular = [1.0e-30, 1.0e-17, 0.04, 1.0, rng.unit().max(1.0e-6)][rng.below(5)];
        let diffuse = [0.0, 1.0, rng.unit()][rng.below(3)];
        // Views and lights from the normal to the horizon.
        let sine = |rng: &mut Rng| [rng.unit(), 1.0 - size(rng, -7.0, -1.0), size(rng, -2.9, 0.0)][rng.below(3)];
        let view_sine = sine(&mut rng);
        let view = Vec3::new(view_sine, 0.0, (1.0 - view_sine * view_sine).sqrt());
        let gloss = Gloss { view, roughness, specular, diffuse };
        let local = LocalGloss::of(&gloss, Vec3::Z).expect("it is glossy");
        let (light_sine, turn) = (sine(&mut rng), rng.between(0.0, 6.3));
        let (x, y) = (light_sine * turn.cos(), light_sine * turn.sin());
        let z = (1.0 - light_sine * light_sine).sqrt().max(1.0e-3);
        let spread = [0.0, 1.0, rng.unit(), size(&mut rng, -8.0, 0.0)][rng.below(4)];
        let (ours, doubt) = local.reflected(x, y, z, spread);
        assert!(ours > 0.0 && ours.is_finite() && doubt >= 0.0 && doubt.is_finite(), "{gloss:?} {x} {y} {z} {spread}");

        let direction = exact(view).normalize();
        let surface = Surface {
            alpha: f64::from(roughness * roughness).max(0.001),
            diffuse: diffuse.into(),
            specular: specular.into(),
            view: DVec2::new(direction.x, direction.z.max(0.01)),
        };
        let expected = reflected(&surface, DVec2::new(x.into(), y.into()), z.into(), spread.into());
        // Views within 1e-3 of the normal count as along it. A reflectance below 1e-18 times the sixth
        // power of the least α leaves f32, and only the share that is reflected to all sides is left.
        if view_sine < 1.1e-3 || specular < 1.0e-18 {
            continue;
        }
        let error = (f64::from(ours) / expected.reflectance - 1.0).abs() / ROUNDING;
        worst = worst.max(error / expected.condition);
        compared += 1;
    }
    // Measured: 17.
    assert!(worst < 32.0 && compared > 100_000, "{worst} {compared}");
}
