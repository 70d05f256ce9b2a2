//! Directions along the axes, where an orthonormal basis from one vector may divide by zero.

use super::*;
use girandole::glam::Vec3Swizzles;
use testbed::testing::support::place_tree;

/// The six directions along the axes, and directions that differ from them by the least that f32
/// can express, in either direction.
fn poles() -> Vec<Vec3> {
    let mut poles = Vec::new();
    for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
        for pole in [axis, -axis] {
            poles.push(pole);
            for other in [Vec3::X, Vec3::Y, Vec3::Z].into_iter().filter(|other| *other != axis) {
                for least in [f32::from_bits(1), 1.0e-30, f32::EPSILON] {
                    poles.extend([pole + least * other, pole - least * other]);
                }
            }
        }
    }
    poles
}

#[test]
fn spheres_along_the_axes_are_sampled_in_all_of_their_cone() {
    const STEPS: u32 = 16;
    let poles = poles();
    for pole in &poles {
        let mut world = alone(vec![Light::sphere(5.0 * *pole, 1.0, Vec3::ONE)]);
        let at = [ShadingPoint::volume(Vec3::ZERO), ShadingPoint::surface(Vec3::ZERO, *pole)];
        assert_eq!(prove(&world, &at, 140), 6, "{pole}");
        let instance = world.instances().next().expect("just added");
        let sampler = world.sampler();
        let mut mean = DVec3::ZERO;
        for i in 0..STEPS * STEPS {
            let u = [i % STEPS, i / STEPS].map(|k| (k as f32 + 0.5) / STEPS as f32);
            let light = LightId::Local { instance, light: 0 };
            mean += sampler.sample_light(&at[0], light, u).expect("in sight").direction.as_dvec3();
        }
        mean /= f64::from(STEPS * STEPS);
        // Uniform by solid angle within the cone: the mean of the cosine is the middle one.
        let middle = 0.5 * (1.0 + (1.0_f64 - 1.0 / 25.0).sqrt());
        assert!((mean - pole.as_dvec3() * middle).length() < 1.0e-3, "{pole}: {mean}");
        if *pole == pole.round() {
            prove_on_gpu(&mut world, &at, 140);
        }
    }
}

#[test]
fn glossy_points_with_normals_and_views_along_the_axes_keep_every_light() {
    let mut rng = Rng(141);
    let mut world = LightWorld::new();
    world.set_glossy_sampling(true);
    place_tree(&mut world, rng.lights(40, 10.0), Placement::IDENTITY, Policy::Static);
    world.update(FrameBudget::NONE);
    let mut all = Vec::new();
    for normal in poles() {
        // Along the normal, where any two tangents will do, and just beside it.
        for view in [normal, normal + 1.0e-7 * normal.yzx(), normal + normal.yzx()] {
            let gloss = Gloss { view, roughness: 0.3, specular: 0.5, diffuse: 0.1 };
            all.push(ShadingPoint::surface(rng.position(8.0), normal).with_gloss(gloss));
        }
    }
    assert!(prove(&world, &all, 141) > 1000);
}
