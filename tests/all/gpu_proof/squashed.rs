//! Instances that are flattened between two rotations, and lights on the horizon of far shading
//! points.

use girandole::glam::{DVec3, Mat3, Vec3};
use girandole::gpu::GpuLights;
use girandole::{FrameBudget, Light, LightWorld, Placement, Policy, ShadingPoint};

use super::{Question, Text, named_lights, with_splits};
use crate::gpu::{close, gpu};
use girandole::LightTree;
use testbed::testing::support::{Rng, SPLITS};

pub(super) fn upload(world: &mut LightWorld) -> GpuLights {
    let (device, queue) = gpu();
    world.update(FrameBudget::NONE);
    let mut lights = GpuLights::new(&device, &queue).expect("default limits are enough");
    lights.upload(world).expect("room enough");
    lights
}

fn turn(rng: &mut Rng) -> Mat3 {
    Mat3::from_axis_angle(rng.direction(), rng.between(0.0, 6.0))
}

/// Probabilities are compared in instances of a thickness of 1e-2 to 10 to the minus this power.
const COMPARED_POWER: i32 = 3;

/// Instances that are `thin` along one and along two axes, of panels and beams.
fn squashed(rng: &mut Rng, thin: f32) -> LightWorld {
    let mut world = LightWorld::new();
    let lights = (0..12).map(|i| {
        let (at, direction) = (rng.position(2.0), rng.direction());
        match i % 2 {
            0 => Light::rectangle(at, direction, direction.any_orthonormal_vector(), Vec3::ONE),
            _ => Light::spot(at, direction, 0.2, 1.0 + 0.1 * i as f32, Vec3::splat(30.0)),
        }
    });
    let tree = world.add_tree(LightTree::new(lights.collect()).expect("valid lights"));
    for scale in [Vec3::new(1.0, 1.0, thin), Vec3::new(1.0, thin, thin)] {
        for _ in 0..4 {
            let linear = turn(rng) * Mat3::from_diagonal(scale) * turn(rng);
            let placement = Placement { linear, translation: rng.position(8.0).as_dvec3() };
            world.add_instance(tree, placement, Policy::Static).expect("a valid placement");
        }
    }
    world
}

/// One-sided panels and beams in instances that are thin between two rotations. Every light that
/// sends anything has a probability on the GPU, probabilities add up to 1 at most, and down to a
/// thickness of 1e-3 they are those of the CPU. The position of a light in the world, seen from a
/// shading point, loses as many digits as the instance is thin, so beyond that the two processors
/// estimate differently.
#[test]
fn squashed_instances_are_covered_and_have_the_probabilities_of_the_cpu_on_the_gpu() {
    let mut rng = Rng(910);
    let (mut sent, mut compared) = (0, 0);
    for power in 2..=8 {
        let mut world = squashed(&mut rng, 10.0_f32.powi(-power));
        let mut lights = upload(&mut world);
        let names = named_lights(&world);
        let points: Vec<ShadingPoint> = (0..20).map(|_| rng.shading_point(10.0)).collect();
        let mut questions = Vec::new();
        for point in &points {
            let ask = |(_, [instance, light]): &(_, [u32; 2])| Question {
                instance: *instance,
                light: *light,
                ..Question::at(point)
            };
            questions.extend(names.iter().map(ask));
        }
        for splits in SPLITS {
            let questions = with_splits(&questions, splits);
            let sampler = world.sampler().with_splits(splits);
            let answers = Text::AsItIs.pmfs(&mut lights, &questions);
            for (point, gpu) in points.iter().zip(answers.chunks_exact(names.len())) {
                let sum: f64 = gpu.iter().map(|pmf| f64::from(*pmf)).sum();
                assert!(sum <= 1.0 + 1.0e-4, "1e-{power}: probabilities add up to {sum}");
                for ((light, _), gpu) in names.iter().zip(gpu) {
                    let cpu = sampler.pmf(point, *light);
                    if power <= COMPARED_POWER {
                        assert!(close(cpu, *gpu), "1e-{power}: {cpu} {gpu} of {light:?} at {point:?}");
                        compared += usize::from(cpu > 0.0);
                    }
                    let sends = sampler.sample_light(point, *light, [rng.unit(), rng.unit()]).is_some();
                    assert!(*gpu > 0.0 || !sends, "1e-{power}: {light:?} sends something to {point:?}");
                    sent += usize::from(sends);
                }
            }
        }
    }
    assert!(sent > 500 && compared > 500, "{sent} {compared}");
}

/// Lamps of turned instances far from the origin, on the horizon of shading points to the last bit.
/// What bounds prove dark there is rounding, unless they leave a margin for it.
#[test]
fn lamps_on_the_horizon_far_from_the_origin_are_covered_on_the_gpu() {
    let mut rng = Rng(911);
    let mut world = LightWorld::new();
    // Two lamps at one point have a box without extent, which is not rounded outward.
    let places: Vec<Vec3> = (0..9).map(|_| rng.position(30.0)).collect();
    let lamps = |at: &Vec3| vec![Light::point(*at, Vec3::splat(1.0e4)); 2];
    let trees: Vec<_> =
        places.iter().map(|at| world.add_tree(LightTree::new(lamps(at)).expect("valid lights"))).collect();
    let mut placed = Vec::new();
    for distance in [0.0, 1.0e4, 1.0e6] {
        for (tree, place) in trees.iter().zip(&places) {
            let translation: DVec3 = (rng.direction() * distance).as_dvec3();
            let linear = turn(&mut rng);
            let key = world.add_instance(*tree, Placement { linear, translation }, Policy::Static).expect("valid");
            placed.push((key, linear, translation, *place));
        }
    }
    let mut lights = upload(&mut world);
    let sampler = world.sampler();
    let (mut questions, mut asked) = (Vec::new(), Vec::new());
    for (key, linear, translation, place) in placed {
        let instance = world.slot(key).expect("a live instance");
        for i in 0..1000_u32 {
            let light = i % 2;
            let at = (linear * rng.position(40.0)).as_dvec3() + translation;
            let toward = ((linear * place).as_dvec3() + translation - at).as_vec3();
            let across = toward.cross(rng.direction()).normalize();
            let tilt = toward.normalize() * [0.0, 1.0e-8, 1.0e-7][i as usize % 3];
            let point = ShadingPoint::surface(at.as_vec3(), (across + tilt).normalize());
            let id = girandole::LightId::Local { instance: key, light };
            if sampler.sample_light(&point, id, [0.5; 2]).is_some() {
                questions.push(Question { instance, light, ..Question::at(&point) });
                asked.push(point);
            }
        }
    }
    assert!(questions.len() > 5000, "{} lamps are above the horizon", questions.len());
    let answers = Text::AsItIs.pmfs(&mut lights, &questions);
    for ((question, point), pmf) in questions.iter().zip(&asked).zip(answers) {
        assert!(pmf > 0.0, "light {} of slot {} sends something to {point:?}", question.light, question.instance);
    }
}
