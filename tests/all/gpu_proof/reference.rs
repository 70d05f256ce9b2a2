//! The probabilities and the reflectances that shaders compute are those of the formulas in f64.

use girandole::glam::{DVec2, DVec3};

use super::{Question, Text, about_all, named_lights};
use crate::gpu::{gpu_lights, uploaded};
use testbed::measuring::reference::gloss::{Surface, reflected};
use testbed::measuring::street::Street;
use testbed::measuring::street_samplers::TwoLevel;
use testbed::testing::support::Rng;

/// Half of the sum over all lights of the absolute differences at a shading point, at most.
const MOST_DISTANCE: f64 = 1.0e-5;

/// The most by which a probability above [`COMPARED`] may differ, relative to itself. Measured: 4e-3, for lights that turn
/// away: in the lobe of a narrow spot that is a difference of two numbers near 1, over the square of its width.
const MOST_ERROR: f64 = 1.0e-2;
/// See [`MOST_ERROR`].
const COMPARED: f64 = 1.0e-9;

/// A street with 3,000 lights of all shapes in 60 instances. The reference was written from
/// docs/math.md, and takes the street as it was before rounding.
#[test]
fn probabilities_on_the_gpu_are_those_of_the_walk_in_f64() {
    let street = Street::new(7, 40);
    for shift in [DVec3::ZERO, DVec3::new(3.0e6, -2.0e6, 1.0e6)] {
        let two_level = TwoLevel::new(&street, shift).expect("a valid scene");
        let world = two_level.world();
        let mut lights = uploaded(world);
        let names = named_lights(world);
        let points: Vec<_> = street.receivers.iter().map(|receiver| receiver.rounded(two_level.origin())).collect();
        let questions = about_all(&names, &points);
        let answers = Text::AsItIs.pmfs(&mut lights, &questions);
        let (mut worst_distance, mut worst, mut compared, mut close_calls) = (0.0_f64, 0.0_f64, 0, 0);
        for (receiver, gpu) in street.receivers.iter().zip(answers.chunks_exact(names.len())) {
            let (exact, is_close) = two_level.exact_walk(receiver);
            if is_close {
                close_calls += 1;
                continue;
            }
            let exact = exact.expect("all lights are in the street");
            let mut distance = 0.0;
            for (pmf, exact) in two_level.in_street_order(gpu).into_iter().zip(exact) {
                assert_eq!(pmf == 0.0, exact == 0.0, "{pmf} {exact} at {receiver:?}");
                let difference = (f64::from(pmf) - exact).abs();
                distance += 0.5 * difference;
                if exact > COMPARED {
                    worst = worst.max(difference / exact);
                    compared += 1;
                }
            }
            worst_distance = worst_distance.max(distance);
        }
        assert!(worst_distance < MOST_DISTANCE && worst < MOST_ERROR, "{worst_distance} {worst} at {shift}");
        assert!(compared > 20_000 && 4 * close_calls < street.receivers.len(), "{compared} {close_calls}");
    }
}

/// Roundings of the reflectance, relative to the terms whose differences it is made of. The CPU has
/// 17 of them; a shader divides and takes roots with more.
const MOST_ROUNDINGS: f64 = 64.0;

/// Views and lights from near the normal to the horizon, and all reflectances that are not below
/// what f32 can hold.
#[test]
fn reflectances_on_the_gpu_are_those_of_the_formula_in_f64() {
    let mut rng = Rng(531);
    let mut lights = gpu_lights();
    let mut questions = Vec::new();
    for _ in 0..100_000 {
        let below = |rng: &mut Rng, count: u64| (rng.bits() % count) as usize;
        let power = |rng: &mut Rng, least: f32, most: f32| 10.0_f32.powf(rng.between(least, most));
        let roughness = [0.0, 0.0317, 0.1, 1.0, rng.unit()][below(&mut rng, 5)];
        let specular = [1.0e-17, 0.04, 1.0, rng.unit().max(1.0e-6)][below(&mut rng, 4)];
        let diffuse = [0.0, 1.0, rng.unit()][below(&mut rng, 3)];
        let sine = |rng: &mut Rng| [rng.unit(), 1.0 - power(rng, -7.0, -1.0), power(rng, -2.9, 0.0)][below(rng, 3)];
        let view_sine = sine(&mut rng).max(1.1e-3);
        let (light_sine, turn) = (sine(&mut rng), rng.between(0.0, 6.3));
        let z = (1.0 - light_sine * light_sine).sqrt().max(1.0e-3);
        let spread = [0.0, 1.0, rng.unit(), power(&mut rng, -8.0, 0.0)][below(&mut rng, 4)];
        questions.push(Question {
            position: [spread, 0.0, 0.0],
            u: [light_sine * turn.cos(), light_sine * turn.sin(), z, diffuse],
            choice: specular,
            more: [view_sine, 0.0, (1.0 - view_sine * view_sine).sqrt(), roughness],
            ..Question::default()
        });
    }
    let answers = Text::AsItIs.ask::<[f32; 2]>(&mut lights, "reflected", &questions);
    let mut worst = 0.0_f64;
    for (question, [reflectance, doubt]) in questions.iter().zip(answers) {
        let [x, y, z, diffuse] = question.u.map(f64::from);
        let [view_x, _, view_z, roughness] = question.more.map(f64::from);
        let length = view_x.hypot(view_z);
        let surface = Surface {
            alpha: (roughness * roughness).max(0.001),
            diffuse,
            specular: question.choice.into(),
            view: DVec2::new(view_x / length, (view_z / length).max(0.01)),
        };
        let expected = reflected(&surface, DVec2::new(x, y), z, question.position[0].into());
        assert!(reflectance > 0.0 && reflectance.is_finite() && doubt >= 0.0 && doubt.is_finite(), "{question:?}");
        let error = (f64::from(reflectance) / expected.reflectance - 1.0).abs() / (0.5 * f64::from(f32::EPSILON));
        worst = worst.max(error / expected.condition);
    }
    assert!(worst < MOST_ROUNDINGS, "{worst}");
}
