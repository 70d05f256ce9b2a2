//! The rims of spots on the GPU, where f32 leaves few digits of the falloff.

use super::*;
use crate::gpu::{ask, uploaded};

/// What a shader finds: the probability of the light, and the illuminance that it sends.
const ASK: &str = "
    struct Question { position: vec3<f32>, instance: u32, light: u32, a: u32, b: u32, c: u32 }
    fn answer(q: Question) -> vec2<f32> {
        let at = light_surface_point(q.position, vec3(0.0));
        let found = light_reservoir_sample(at, light_reservoir_of(q.instance, q.light, vec2(0.5)));
        return vec2(light_pmf(at, q.instance, q.light), found.radiance.y);
    }";

/// The root of the share of the intensity at an angle, in f64, and the width of the falloff as a
/// difference of cosines.
fn root_share(inner: f32, outer: f32, angle: f64) -> [f64; 2] {
    let difference = |a: f64, b: f64| 2.0 * (0.5 * (a + b)).sin() * (0.5 * (b - a)).sin();
    let width = difference(inner.into(), outer.into()).max(1.0e-3);
    [(difference(angle, outer.into()) / width).clamp(0.0, 1.0), width]
}

#[test]
fn lights_whose_rim_is_at_the_shading_point_have_a_probability_on_the_gpu() {
    let mut rng = Rng(170);
    let widths = [1.0e-4, 1.0e-3, 2.0e-3, 0.03, 0.2, 0.9, 0.5 * PI, 2.2, 3.1, PI - 1.0e-6, PI];
    let (mut lit, mut rims, mut dark) = (0, 0, 0);
    for _ in 0..3 {
        let axis = rng.direction();
        let spots = || widths.into_iter().flat_map(|outer| [0.0, 0.5 * outer, outer].map(|inner| (inner, outer)));
        let lights: Vec<_> = spots().map(|(i, o)| Light::spot(Vec3::ZERO, axis, i, o, Vec3::splat(1000.0))).collect();
        let turn = Mat3::from_quat(Quat::from_axis_angle(rng.direction(), rng.between(0.0, 6.0)));
        let world = placed(lights, [Placement::IDENTITY, linear(turn), linear(turn * 3.0)]);
        let instances: Vec<_> = world.instances().zip([Mat3::IDENTITY, turn, turn]).collect();
        let (mut questions, mut expected) = (Vec::new(), Vec::new());
        for (instance, tree) in instances {
            let axis = tree * axis;
            let side = axis.any_orthonormal_vector();
            for (light, (inner, outer)) in (0..).zip(spots()) {
                for beyond in [-1.0e-2, -1.0e-3, -3.0e-4, -1.0e-5, 0.0, 1.0e-5, 3.0e-4, 9.0e-4, 2.0e-3] {
                    let angle = outer + beyond;
                    let at = (axis * angle.cos() + side * angle.sin()) * rng.between(1.0, 100.0);
                    let (to, along) = (at.as_dvec3().normalize(), axis.as_dvec3().normalize());
                    let angle = 2.0 * (to - along).length().atan2((to + along).length());
                    let slot = world.slot(instance).expect("it lives");
                    let [x, y, z] = at.to_array().map(f32::to_bits);
                    questions.push([x, y, z, slot, light, 0, 0, 0]);
                    expected.push((root_share(inner, outer, angle), at.as_dvec3().length_squared(), (inner, outer)));
                }
            }
        }
        let mut lights = uploaded(&world);
        let answers: Vec<[f32; 2]> = ask(&mut lights, Effects::all(), ASK, &questions);
        for (([root, width], dist_sq, spot), [pmf, lux]) in expected.into_iter().zip(answers) {
            assert!((0.0..=1.0).contains(&pmf) && lux >= 0.0, "{spot:?}: {pmf} {lux}");
            assert!(lux == 0.0 || pmf > 0.0, "{spot:?} sends {lux} lux but is never chosen");
            // Two cosines in f32, one of which is a product with an axis that was turned in f32.
            let rounding = 2.0e-6 + 8.0e-7 / width;
            assert!(root <= rounding || pmf > 0.0, "{spot:?} has the share {root}² but is never chosen");
            let share = (f64::from(lux) * dist_sq / 1000.0).sqrt();
            assert!((share - root).abs() < rounding, "{spot:?}: {share} and not {root}");
            lit += u32::from(root > rounding);
            rims += u32::from(root > 0.0 && root <= rounding);
            dark += u32::from(root == 0.0);
        }
    }
    assert!(lit > 400 && rims > 200 && dark > 500, "{lit} {rims} {dark}");
}
