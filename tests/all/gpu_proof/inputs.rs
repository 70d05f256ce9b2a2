//! Shading points and random numbers that are no numbers, huge or denormal.

use girandole::glam::{Mat3, Vec3};
use girandole::gpu::GpuLights;
use girandole::{DirectionalLight, FrameBudget, Light, LightWorld, Placement, Policy, ShadingPoint};

use super::{Question, Sampled, Text, named_lights};
use crate::gpu::gpu;
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

/// Random numbers that no caller should pass, with the nearest ones in [0, 1). NaN counts as 0.
const NUMBERS: [[f32; 2]; 8] = [
    [f32::NAN, 0.0],
    [f32::from_bits(0xffc0_0001), 0.0],
    [-1.0, 0.0],
    [f32::NEG_INFINITY, 0.0],
    [-0.0, 0.0],
    [1.0, ONE_MINUS_EPSILON],
    [2.0, ONE_MINUS_EPSILON],
    [f32::INFINITY, ONE_MINUS_EPSILON],
];

const ONE_MINUS_EPSILON: f32 = 1.0 - f32::EPSILON / 2.0;

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

fn upload(world: &mut LightWorld) -> GpuLights {
    let (device, queue) = gpu();
    world.update(FrameBudget::NONE);
    let mut lights = GpuLights::new(&device, &queue).expect("default limits are enough");
    lights.upload(world).expect("room enough");
    lights
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
    let mut lights = upload(&mut world);
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
            0 => NUMBERS[rng.bits() as usize % NUMBERS.len()][0],
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
        for (question, point) in questions.iter().zip(text.points(&mut lights, &questions)) {
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
        for (question, pick) in questions.iter().zip(text.picks(&mut lights, &questions)) {
            assert!(is_finite(pick.pmf) && (0.0..=1.0).contains(&pick.pmf), "{text:?} {pick:?} {question:?}");
        }
        for (question, kept) in questions.iter().zip(text.resamples(&mut lights, &questions)) {
            assert_sample(text, &kept.chosen, question);
            assert!(is_finite(kept.weight) && kept.weight >= 0.0, "{text:?} {kept:?} {question:?}");
        }
    }
    assert!(found > 6000, "{found} of 12,000 samples find a light");
}

/// In a world of one light all numbers pick it, so a number outside [0, 1) gives the sample of the
/// nearest number inside, bit for bit, whichever of the four it is.
#[test]
fn numbers_outside_the_unit_interval_give_the_samples_of_clamped_ones_on_the_gpu() {
    let mut rng = Rng(901);
    let shapes = shapes(&mut rng);
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(vec![shapes[0]]).expect("a valid light"));
    world.add_instance(tree, rng.affine(0.0), Policy::Budgeted).expect("a valid placement");
    let mut lights = upload(&mut world);
    let mut seen = 0;
    for light in shapes {
        for by_solid_angle in [false, true] {
            world.replace_lights(tree, vec![light]).expect("a valid light");
            world.set_solid_angle_sampling(by_solid_angle);
            world.update(FrameBudget::NONE);
            lights.upload(&world).expect("room enough");
            let mut questions = Vec::new();
            for _ in 0..4 {
                let at = ShadingPoint::volume(rng.direction() * 8.0);
                for [outside, inside] in NUMBERS {
                    for place in 0..4 {
                        let mut u = [rng.unit(), rng.unit(), rng.unit(), rng.unit()];
                        for number in [outside, inside] {
                            u[place] = number;
                            questions.push(Question { u, choice: 0.5, ..Question::at(&at) });
                        }
                    }
                }
            }
            for text in [Text::AsItIs, Text::AssumingNumbers] {
                let answers = text.samples(&mut lights, &questions);
                for (both, asked) in answers.chunks_exact(2).zip(questions.chunks_exact(2)) {
                    let [bad, good] = [0, 1].map(|i| bytemuck::cast::<_, [u32; 11]>(both[i]));
                    assert_eq!(bad, good, "{text:?} {both:?} {asked:?}");
                    assert_sample(text, &both[0], &asked[0]);
                    seen += usize::from(both[0].pmf > 0.0);
                }
            }
        }
    }
    assert!(seen > 500, "{seen} samples of lights");
}

#[test]
fn directional_lights_alone_give_finite_answers_to_any_normal_on_the_gpu() {
    let mut rng = Rng(902);
    let mut world = LightWorld::new();
    for illuminance in [1.0e-30, 1.0, 1.0e10] {
        let light = DirectionalLight { direction: rng.direction(), illuminance: Vec3::splat(illuminance) };
        world.add_directional(light).expect("a valid light");
    }
    let mut lights = upload(&mut world);
    let mut questions = Vec::new();
    for x in COORDINATES {
        for y in COORDINATES {
            let at = ShadingPoint::surface(Vec3::new(y, x, 0.0), Vec3::new(x, y, rng.unit()));
            let u = [rng.unit(), rng.unit(), rng.unit(), rng.unit()];
            questions.push(Question { instance: u32::MAX, light: rng.bits() as u32 % 3, u, ..Question::at(&at) });
        }
    }
    for text in [Text::AsItIs, Text::AssumingNumbers] {
        for (question, pmf) in questions.iter().zip(text.pmfs(&mut lights, &questions)) {
            assert!(is_finite(pmf) && (0.0..=1.0).contains(&pmf), "{text:?} {pmf} {question:?}");
        }
        let mut found = 0;
        for (question, sample) in questions.iter().zip(text.samples(&mut lights, &questions)) {
            assert_sample(text, &sample, question);
            assert!(sample.pmf <= 1.0, "{text:?} {sample:?} {question:?}");
            found += usize::from(sample.pmf > 0.0);
        }
        assert!(found > 20, "{text:?}: {found} samples");
    }
}
