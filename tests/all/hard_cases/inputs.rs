//! Numbers that callers give with each question.

use super::*;

/// The point on a light is chosen by numbers outside [0, 1) as by the nearest ones inside, and by
/// NaN as by 0, whichever way the light is sampled.
#[test]
fn random_numbers_for_points_on_lights_are_clamped() {
    let mut rng = Rng(130);
    let lights = one_of_each(&mut rng, Vec3::ZERO, 1.0);
    let count = lights.len() as u32;
    let mut world = alone(lights);
    let instance = world.instances().next().expect("just added");
    let outside = [
        (1.0, ONE_MINUS_EPSILON),
        (2.0, ONE_MINUS_EPSILON),
        (f32::INFINITY, ONE_MINUS_EPSILON),
        (-0.5, 0.0),
        (f32::NEG_INFINITY, 0.0),
        (f32::NAN, 0.0),
    ];
    let mut seen = 0;
    for by_solid_angle in [false, true] {
        world.set_solid_angle_sampling(by_solid_angle);
        world.update(FrameBudget::NONE);
        let sampler = world.sampler();
        for light in (0..count).map(|light| LightId::Local { instance, light }) {
            for _ in 0..20 {
                let at = ShadingPoint::volume(rng.direction() * 3.0);
                for (bad, good) in outside {
                    let other = rng.unit();
                    for [bad, good] in [[[bad, other], [good, other]], [[other, bad], [other, good]]] {
                        let found = sampler.sample_light(&at, light, bad);
                        assert_eq!(found, sampler.sample_light(&at, light, good), "{light:?} {bad:?}");
                        seen += usize::from(found.is_some());
                    }
                }
            }
        }
    }
    assert!(seen > 2000, "{seen}");
}

#[test]
fn a_choice_by_zero_is_as_probable_as_its_neighbours() {
    // The first light of the tree is chosen by 0 only as often as it is probable.
    let mut lights = vec![Light::point(Vec3::new(-900.0, 0.0, 0.0), Vec3::splat(1.0e-6))];
    lights.extend((0..7).map(|i| Light::point(Vec3::new(i as f32, 1.0, 0.0), Vec3::ONE)));
    let world = alone(lights);
    let (sampler, at) = (world.sampler(), ShadingPoint::volume(Vec3::ZERO));
    for i in 0..1000 {
        let pick = sampler.pick(&at, [0.0, i as f32 / 1000.0]).expect("a light");
        assert!(pick.pmf > 1.0e-8, "{pick:?}");
    }
}

#[test]
fn faint_and_denormal_reflectances_give_valid_probabilities() {
    let mut rng = Rng(131);
    let mut world = rng.world(3, 40, 3, 10.0);
    world.set_glossy_sampling(true);
    world.update(FrameBudget::NONE);
    let mut all = Vec::new();
    for specular in [f32::from_bits(1), 1.0e-44, f32::MIN_POSITIVE, 1.0e-31, 1.0e-30, 1.0e-20, 1.0e-6] {
        for roughness in [0.0, 0.1, 1.0] {
            let (position, normal) = (rng.position(12.0), rng.direction());
            let view = normal + 0.5 * rng.direction();
            let gloss = Gloss { view, roughness, specular, diffuse: 0.0 };
            all.push(ShadingPoint::surface(position, normal).with_gloss(gloss));
        }
    }
    assert!(prove(&world, &all, 18) > 500);
}
