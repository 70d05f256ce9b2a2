//! Glossy surfaces: every light keeps its chance, the probabilities are true, and lights in the
//! highlight are probable.

use girandole::glam::{Affine3A, DVec3, Mat3, Quat, Vec3};
use girandole::light::luminance;
use girandole::{DirectionalLight, Effects, Gloss, Light, LightId, LightWorld, Placement, Policy, ShadingPoint};

use crate::gpu::{ask, name_of, uploaded};
use testbed::measuring::reflection::brdf;
use testbed::testing::support::{
    Rng, SPLITS, assert_frequencies, assert_probabilities, distribution, mean, place_tree,
};

/// A gloss of any kind: coated or metal, nearly a mirror or rough, seen from anywhere above or
/// below.
fn gloss(rng: &mut Rng) -> Gloss {
    Gloss {
        view: rng.direction() * 10.0_f32.powf(rng.between(-3.0, 3.0)),
        roughness: [0.0, 0.05, 0.3, 1.0, 7.0][rng.bits() as usize % 5],
        specular: [0.04, 0.7, 1.0][rng.bits() as usize % 3],
        diffuse: [0.0, 0.2, 1.0][rng.bits() as usize % 3],
    }
}

/// Values of a gloss that make it matte.
fn without_highlight() -> [Gloss; 7] {
    let gloss = Gloss { view: Vec3::Y, roughness: 0.2, specular: 0.04, diffuse: 0.5 };
    [
        Gloss { view: Vec3::ZERO, ..gloss },
        Gloss { view: Vec3::splat(f32::NAN), ..gloss },
        Gloss { view: Vec3::X * f32::INFINITY, ..gloss },
        Gloss { roughness: f32::NAN, ..gloss },
        Gloss { specular: 0.0, ..gloss },
        Gloss { specular: -1.0, ..gloss },
        Gloss { diffuse: f32::INFINITY, ..gloss },
    ]
}

/// A world of one tree in one instance.
fn world_of(lights: Vec<Light>, placement: Placement) -> LightWorld {
    let mut world = LightWorld::new();
    place_tree(&mut world, lights, placement, Policy::Static);
    world
}

#[test]
fn every_light_that_contributes_is_chosen_with_the_probability_that_pmf_returns() {
    let mut rng = Rng(501);
    let world = rng.world(4, 40, 4, 15.0);
    for splits in SPLITS {
        for _ in 0..25 {
            let at = rng.shading_point(20.0).with_gloss(gloss(&mut rng));
            assert_probabilities(&world.sampler().with_splits(splits), &at, 200, &mut rng);
        }
    }
}

/// Draws of [`frequencies_are_the_probabilities`] at each shading point.
const DRAWS: usize = 20_000;

#[test]
fn frequencies_are_the_probabilities() {
    let mut rng = Rng(502);
    let world = world_of(rng.lights(60, 6.0), Placement::IDENTITY);
    let sampler = world.sampler();
    for _ in 0..6 {
        let at = ShadingPoint::surface(rng.position(5.0), rng.direction()).with_gloss(gloss(&mut rng));
        assert_frequencies(&sampler, &at, DRAWS, &mut rng);
    }
}

#[test]
fn points_without_a_highlight_and_points_in_volumes_have_the_bits_of_matte_ones() {
    let mut rng = Rng(503);
    let world = rng.world(3, 30, 3, 15.0);
    let sampler = world.sampler();
    let bits = |at: &ShadingPoint| distribution(&sampler, at).into_iter().map(f32::to_bits).collect::<Vec<_>>();
    for _ in 0..10 {
        let at = ShadingPoint::surface(rng.position(15.0), rng.direction());
        let matte = bits(&at);
        for gloss in without_highlight() {
            assert_eq!(bits(&at.with_gloss(gloss)), matte, "{gloss:?}");
        }
        let volume = ShadingPoint::volume(at.position);
        assert_eq!(bits(&volume.with_gloss(gloss(&mut rng))), bits(&volume));
    }
}

#[test]
fn two_lamps_are_chosen_in_proportion_to_what_is_reflected_of_them() {
    let mut rng = Rng(504);
    let mut compared = 0;
    for _ in 0..200 {
        let lights =
            [0, 1].map(|_| Light::point(rng.position(5.0) + Vec3::Y * 6.0, Vec3::splat(rng.between(1.0, 9.0))));
        let view = (rng.direction() + Vec3::Y * 1.2).normalize();
        let gloss = Gloss { view, roughness: rng.between(0.1, 1.0), specular: 0.3, diffuse: rng.unit() };
        let at = ShadingPoint::surface(Vec3::ZERO, Vec3::Y).with_gloss(gloss);
        let world = world_of(lights.to_vec(), Placement::IDENTITY);
        let pmfs = distribution(&world.sampler(), &at);
        // The library counts a little of all reflectance as diffuse.
        let reflectance = 0.02 * (gloss.specular + gloss.diffuse) / std::f32::consts::PI;
        let light = lights.map(|light| {
            let (toward, dist_sq) = match light.shape {
                girandole::Shape::Point { position } => (position, position.length_squared()),
                _ => (Vec3::ZERO, 1.0),
            };
            let brdf = brdf(&gloss, &at, toward.as_dvec3()) as f32 + reflectance;
            luminance(light.emission) * brdf * toward.normalize().y / dist_sq
        });
        let expected = light[0] / (light[0] + light[1]);
        // The shadowing term is without square roots, which costs 3 % at grazing angles, on either
        // lamp.
        let error = pmfs[0] / expected - 1.0;
        assert!(error.abs() < 0.06 || (pmfs[1] / (1.0 - expected) - 1.0).abs() < 0.06, "{pmfs:?} {expected} {gloss:?}");
        compared += u32::from((0.02..0.98).contains(&expected));
    }
    assert!(compared > 100, "only {compared} pairs tell anything");
}

#[test]
fn a_turned_world_has_the_same_probabilities() {
    let mut rng = Rng(505);
    let lights: Vec<Light> = (0..80).map(|_| Light::point(rng.position(8.0), Vec3::splat(rng.unit()))).collect();
    let straight = world_of(lights.clone(), Placement::IDENTITY);
    let turn = Mat3::from_quat(Quat::from_axis_angle(rng.direction(), 1.7));
    let shift = DVec3::new(3.0, -5.0, 2.0);
    let turned = world_of(lights, Placement { linear: turn, translation: shift });
    for _ in 0..40 {
        let at = ShadingPoint::surface(rng.position(8.0), rng.direction());
        let gloss = Gloss { view: rng.direction(), roughness: rng.between(0.2, 0.9), specular: 0.1, diffuse: 0.2 };
        let there = ShadingPoint::surface(turn * at.position + shift.as_vec3(), turn * at.normal)
            .with_gloss(Gloss { view: turn * gloss.view, ..gloss });
        let pmfs = [(&straight, at.with_gloss(gloss)), (&turned, there)]
            .map(|(world, at)| distribution(&world.sampler(), &at));
        for (a, b) in pmfs[0].iter().zip(&pmfs[1]) {
            // Positions are rounded to 1e-6, and lobes are as narrow as 0.04.
            assert!((a - b).abs() <= 2.0e-3 * a.max(*b) + 1.0e-9, "{a} {b}");
        }
    }
}

#[test]
fn a_directional_light_competes_by_what_is_reflected_of_it() {
    let mut world = world_of(vec![Light::point(Vec3::Y, Vec3::ONE)], Placement::IDENTITY);
    let sun = |direction: Vec3| DirectionalLight { direction, illuminance: Vec3::ONE };
    let keys = [Vec3::new(-0.6, -0.8, 0.0), Vec3::new(0.6, -0.8, 0.0)]
        .map(|direction| world.add_directional(sun(direction)).expect("a valid light"));
    let at = ShadingPoint::surface(Vec3::ZERO, Vec3::Y);
    let gloss = Gloss { view: Vec3::new(-0.6, 0.8, 0.0), roughness: 0.3, specular: 0.04, diffuse: 0.0 };
    let pmf = |at: &ShadingPoint, i: usize| world.sampler().pmf(at, LightId::Directional(keys[i]));
    // The first sun is seen in the floor, the second is not.
    assert!((pmf(&at, 0) / pmf(&at, 1) - 1.0).abs() < 1.0e-5);
    let glossy = at.with_gloss(gloss);
    assert!(pmf(&glossy, 0) > 50.0 * pmf(&glossy, 1) && pmf(&glossy, 1) > 0.0);
    assert!(
        pmf(&glossy, 0) > 10.0 * world.sampler().pmf(&glossy, world.sampler().all_lights().next().expect("a lamp"))
    );
}

#[test]
fn candidates_are_kept_in_proportion_to_what_is_reflected_of_them() {
    let mut rng = Rng(506);
    let world = world_of(
        (0..500).map(|_| Light::point(rng.position(9.0) + Vec3::Y * 10.0, Vec3::ONE)).collect(),
        Placement::IDENTITY,
    );
    let view = Vec3::new(0.5, 0.8, 0.1).normalize();
    let gloss = Gloss { view, roughness: 0.2, specular: 0.7, diffuse: 0.0 };
    let at = ShadingPoint::surface(Vec3::ZERO, Vec3::Y).with_gloss(gloss);
    let reflected = |incident: &girandole::Incident| {
        brdf(&gloss, &at, incident.direction.as_dvec3()) * f64::from(incident.radiance.x * incident.direction.y)
    };
    let sampler = world.sampler();
    let exact: f64 = sampler
        .all_lights()
        .filter_map(|light| sampler.sample_light(&at, light, [0.5; 2]))
        .map(|i| reflected(&i))
        .sum();
    let [one, eight] = [1, 8].map(|candidates| {
        mean(4000, || {
            let u = std::array::from_fn(|_| rng.unit());
            let kept = sampler.reservoir_sample(&at, &sampler.resample(&at, u, candidates));
            kept.map_or(0.0, |kept| reflected(&kept.incident) / f64::from(kept.pmf * kept.incident.pdf))
        })
    });
    for [mean, error] in [one, eight] {
        // Five standard errors: a false alarm in less than one of 10^6 runs.
        assert!((mean - exact).abs() <= 5.0 * error, "{mean} {exact} {error}");
    }
    assert!(eight[1] < 0.8 * one[1], "{one:?} {eight:?}");
}

/// A stage that answers with the probability of a light. Its arguments are laid out as
/// [`questions`] writes them.
const STAGE: &str = "
    struct Question {
        position: vec3<f32>, instance: u32, normal: vec3<f32>, light: u32,
        view: vec3<f32>, roughness: f32, specular: f32, diffuse: f32, is_matte: u32, padding: u32,
    }
    fn answer(q: Question) -> f32 {
        var at = light_glossy_point(q.position, q.normal, q.view, q.roughness, q.specular, q.diffuse);
        if q.is_matte != 0u { at = light_surface_point(q.position, q.normal); }
        return light_pmf(at, q.instance, q.light);
    }";

fn question(world: &LightWorld, at: &ShadingPoint, light: LightId) -> [u32; 16] {
    let [instance, index] = name_of(world, light);
    let none = Gloss { view: Vec3::ZERO, roughness: 0.0, specular: 0.0, diffuse: 0.0 };
    let gloss = at.gloss.unwrap_or(none);
    let [x, y, z] = at.position.to_array().map(f32::to_bits);
    let [p, q, r] = at.normal.to_array().map(f32::to_bits);
    let [i, j, k] = gloss.view.to_array().map(f32::to_bits);
    let [roughness, specular, diffuse] = [gloss.roughness, gloss.specular, gloss.diffuse].map(f32::to_bits);
    let is_matte = u32::from(at.gloss.is_none());
    [x, y, z, instance, p, q, r, index, i, j, k, roughness, specular, diffuse, is_matte, 0]
}

#[test]
fn the_shader_gives_the_probabilities_of_the_cpu_and_drops_the_gloss_without_the_effect() {
    let mut rng = Rng(507);
    let world = rng.world(4, 25, 3, 15.0);
    let mut lights = uploaded(&world);
    let sampler = world.sampler().from_roots();
    let (mut questions, mut expected, mut matte) = (Vec::new(), Vec::new(), Vec::new());
    let unlit = without_highlight();
    for i in 0..40 {
        let gloss = match i {
            // WGSL implementations may assume that NaN and infinity do not occur.
            0..3 => unlit[[0, 4, 5][i]],
            _ => Gloss { roughness: rng.between(0.15, 1.0), ..gloss(&mut rng) },
        };
        let plain = rng.shading_point(20.0);
        let at = if i % 4 == 3 { plain } else { plain.with_gloss(gloss) };
        for light in sampler.all_lights() {
            questions.push(question(&world, &at, light));
            expected.push(sampler.pmf(&at, light));
            matte.push(sampler.pmf(&plain, light));
        }
    }
    let mut with = |effects: Effects| -> Vec<f32> { ask(&mut lights, effects, STAGE, &questions) };
    let (glossy, dropped) = (with(Effects::all()), with(Effects::all() - Effects::GLOSSY));
    let mut changed = 0;
    for (i, (cpu, gpu)) in expected.iter().zip(&glossy).enumerate() {
        assert!(close_lobe(*cpu, *gpu), "{cpu} {gpu}: {:?}", questions[i].map(f32::from_bits));
        assert!(close_lobe(matte[i], dropped[i]), "{} {}", matte[i], dropped[i]);
        // A matte point has the same bits in both shaders.
        assert!(questions[i][14] == 0 || glossy[i].to_bits() == dropped[i].to_bits());
        changed += u32::from((cpu / matte[i] - 1.0).abs() > 0.1);
    }
    assert!(changed > 500, "only {changed} probabilities depend on the gloss");
}

/// Whether probabilities agree to what a position that is rounded to 1e-6 of 20 m changes in lobes
/// of the width 0.02. Behind the back of a spot its lobe is a small difference, whose rounding is larger.
fn close_lobe(a: f32, b: f32) -> bool {
    (a - b).abs() <= 1.0e-2 * a.max(b).max(1.0e-6)
}

#[test]
fn placements_of_all_kinds_keep_the_highlight_where_it_is() {
    let mut rng = Rng(508);
    let view = Vec3::new(-0.6, 0.8, 0.0);
    let at = ShadingPoint::surface(Vec3::ZERO, Vec3::Y).with_gloss(Gloss {
        view,
        roughness: 0.3,
        specular: 0.7,
        diffuse: 0.0,
    });
    for _ in 0..50 {
        let placement = Placement::from(Affine3A { translation: Vec3::ZERO.into(), ..rng.affine(1.0) });
        let back = placement.linear.inverse();
        // One lamp in the mirrored direction, one elsewhere.
        let lamps = [Vec3::new(6.0, 8.0, 0.0), Vec3::new(-6.0, 8.0, 1.0)].map(|p| Light::point(back * p, Vec3::ONE));
        let world = world_of(lamps.to_vec(), placement);
        let pmfs = distribution(&world.sampler(), &at);
        assert!(pmfs[0] > 0.98, "{pmfs:?} {placement:?}");
    }
}
