//! Shading points and random numbers that are no numbers, huge or denormal.

use girandole::glam::{Mat3, Vec3};
use girandole::{FrameBudget, Light, LightWorld, Placement, Policy, ShadingPoint};

use super::{Picked, Question, Resampled, Sampled, Text, named_lights};

use crate::gpu::uploaded;
use girandole::LightTree;
use testbed::testing::support::Rng;

/// Coordinates that no caller should pass, and some that are at the limits.
const COORDINATES: [f32; 10] = [
    f32::NAN,
    f32::from_bits(0xffc0_0001),
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::MAX,
    f32::MIN,
    1.0e18,
    1.0e-45,
    0.0,
    -0.0,
];

/// Random numbers that no caller should pass.
const NUMBERS: [f32; 8] =
    [f32::NAN, f32::from_bits(0xffc0_0001), -1.0, f32::NEG_INFINITY, -0.0, 1.0, 2.0, f32::INFINITY];

/// Whether the bits are those of a finite number. A comparison might be folded.
fn is_finite(x: f32) -> bool {
    x.to_bits() & 0x7f80_0000 != 0x7f80_0000
}

/// One light of every shape, in the tree of an instance.
fn shapes(rng: &mut Rng) -> Vec<Light> {
    let (u, v, bright) = (rng.direction(), rng.direction(), Vec3::splat(10.0));
    vec![
        Light::point(Vec3::ZERO, bright),
        Light::spot(Vec3::ZERO, rng.direction(), 0.2, 2.2, bright),
        Light::rectangle(Vec3::ZERO, u, v, bright),
        Light::rectangle(Vec3::ZERO, u, v, bright).two_sided(),
        Light::triangle([Vec3::ZERO, u, v], bright),
        Light::triangle([Vec3::ZERO, u, v], bright).two_sided(),
        Light::sphere(Vec3::ZERO, 0.5, bright),
    ]
}

/// A world with all shapes, scales from 1e-9 to 1e9 with ranges, factors and directional lights.
fn varied(rng: &mut Rng) -> LightWorld {
    let mut world = rng.varied_world(5, 30, 3, 15.0);
    let tree = world.add_tree(LightTree::new(shapes(rng)).expect("valid lights"));
    for scale in [1.1e-9, 1.0e-3, 1.0, 1.0e3, 0.9e9] {
        let placement =
            Placement { linear: Mat3::from_diagonal(Vec3::new(scale, -scale, scale)), ..rng.affine(9.0).into() };
        world.add_instance(tree, placement, Policy::Static).expect("a valid placement");
    }
    world
}

fn assert_sample(text: Text, sample: &Sampled, question: &Question) {
    let numbers = [sample.dist, sample.pdf, sample.pmf].into_iter().chain(sample.direction).chain(sample.radiance);
    assert!(numbers.into_iter().all(is_finite), "{text:?} {sample:?} {question:?}");
    assert!(sample.pmf >= 0.0 && sample.pdf >= 0.0, "{text:?} {sample:?} {question:?}");
}

#[test]
fn positions_normals_and_numbers_that_are_none_give_finite_answers_on_the_gpu() {
    let mut rng = Rng(900);
    let mut world = varied(&mut rng);
    world.update(FrameBudget::NONE);
    let mut lights = uploaded(&world);
    let names = named_lights(&world);
    let coordinate = |rng: &mut Rng| match rng.bits() % 2 {
        0 => COORDINATES[rng.bits() as usize % COORDINATES.len()],
        _ => rng.between(-15.0, 15.0),
    };
    let mut questions = Vec::new();
    for i in 0..6000 {
        let mut position = rng.position(15.0);
        let mut normal = rng.direction();
        if i % 5 != 0 {
            position = Vec3::new(coordinate(&mut rng), coordinate(&mut rng), coordinate(&mut rng));
        }
        match i % 4 {
            0 => normal = Vec3::new(coordinate(&mut rng), coordinate(&mut rng), coordinate(&mut rng)),
            1 => normal *= 10.0_f32.powf(rng.between(-30.0, 30.0)),
            2 => normal = Vec3::splat(COORDINATES[i / 4 % COORDINATES.len()]),
            _ => {}
        }
        let mut number = || match rng.bits() % 2 {
            0 => NUMBERS[rng.bits() as usize % NUMBERS.len()],
            _ => rng.unit(),
        };
        let (u, choice) = ([number(), number(), number(), number()], number());
        let more = [(); 4].map(|()| coordinate(&mut rng));
        let [instance, light] = names[i % names.len()].1;
        questions.push(Question {
            instance,
            light,
            u,
            choice,
            more,
            kind: i as u32 % 3,
            ..Question::at(&ShadingPoint::surface(position, normal))
        });
    }
    let mut found = 0;
    for text in [Text::AsItIs, Text::AssumingNumbers] {
        for (question, point) in questions.iter().zip(text.ask::<[f32; 20]>(&mut lights, "point", &questions)) {
            assert!(point.into_iter().all(is_finite), "{text:?} {point:?} {question:?}");
        }
        for (question, pmf) in questions.iter().zip(text.pmfs(&mut lights, &questions)) {
            assert!(is_finite(pmf) && (0.0..=1.0).contains(&pmf), "{text:?} {pmf} {question:?}");
        }
        for (question, sample) in questions.iter().zip(text.samples(&mut lights, &questions)) {
            assert_sample(text, &sample, question);
            assert!(sample.pmf <= 1.0, "{text:?} {sample:?} {question:?}");
            found += usize::from(sample.pmf > 0.0);
        }
        if text == Text::AssumingNumbers {
            // A sample contains a pick, and another pipeline would take long to compile.
            continue;
        }
        for (question, pick) in questions.iter().zip(text.ask::<Picked>(&mut lights, "pick", &questions)) {
            assert!(is_finite(pick.pmf) && (0.0..=1.0).contains(&pick.pmf), "{text:?} {pick:?} {question:?}");
        }
        for (question, kept) in questions.iter().zip(text.ask::<Resampled>(&mut lights, "resample", &questions)) {
            assert_sample(text, &kept.chosen, question);
            assert!(is_finite(kept.weight) && kept.weight >= 0.0, "{text:?} {kept:?} {question:?}");
        }
    }
    assert!(found > 6000, "{found} of 12,000 samples find a light");
}
