//! Instances that are flattened between two rotations, and lights on the horizon of far shading
//! points.

use girandole::glam::{DVec3, Mat3, Vec3};
use girandole::{FrameBudget, Light, LightWorld, Placement, Policy, ShadingPoint};

use super::{Question, Text, about_all, named_lights};
use crate::gpu::uploaded;
use girandole::LightTree;
use std::collections::BTreeMap;
use testbed::measuring::reference::choice::{Tree, distribution};
use testbed::measuring::reference::place::{Map, View};
use testbed::testing::support::{Rng, SPLITS};

fn turn(rng: &mut Rng) -> Mat3 {
    Mat3::from_axis_angle(rng.direction(), rng.between(0.0, 6.0))
}

/// The most by which a probability on one processor, on the other and in f64 may differ, relative to
/// itself. Measured: 5e-5. Positions round by some 1e-7 of their distance from the instance's
/// origin, and the least cosine at a surface, a thousandth, may magnify that.
const MOST_ERROR: f64 = 1.0e-3;

/// Probabilities below this are not compared with those in f64.
const COMPARED: f64 = 1.0e-6;

/// Instances that are `thin` along one and along two axes, of panels and beams, without and with a
/// rotation before they are flattened.
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
        for i in 0..4 {
            let inside = if i % 2 == 0 { Mat3::IDENTITY } else { turn(rng) };
            let linear = turn(rng) * Mat3::from_diagonal(scale) * inside;
            let placement = Placement { linear, translation: rng.position(8.0).as_dvec3() };
            world.add_instance(tree, placement, Policy::Static).expect("a valid placement");
        }
    }
    world
}

/// The probabilities of all lights in f64, by slot and light; `None` where rounding may turn a
/// decision.
fn in_f64(world: &LightWorld, point: &ShadingPoint, splits: usize) -> Option<BTreeMap<[u32; 2], f64>> {
    let sampler = world.sampler();
    let view = View::of(point.position.as_dvec3(), point.normal.as_dvec3());
    let below = |leaf| {
        let (instance, target) = sampler.top_leaf(leaf)?;
        let placement = world.instance(instance)?.placement;
        let tree = world.tree(world.instance(instance)?.tree)?;
        let view = view.in_tree(&Map::new(placement.linear.as_dmat3()), placement.translation, 1.0);
        Some((Tree { nodes: tree.nodes(), view, instance: world.slot(instance) }, target))
    };
    let top = Tree { nodes: sampler.top_nodes(), view, instance: None };
    let found = distribution(&top, splits, 0.0, &below);
    let by_slot = |((slot, light), pmf): ((Option<u32>, u32), f64)| Some(([slot?, light], pmf));
    (!found.is_close).then(|| found.lights.into_iter().filter_map(by_slot).collect())
}

/// The greatest difference of numbers above [`COMPARED`], relative to themselves.
fn difference(a: f64, b: f64) -> Option<f64> {
    let most = a.max(b);
    (most > COMPARED).then(|| (a - b).abs() / most)
}

/// One-sided panels and beams in instances of a thickness from 1e-1 to 1.5e-9; the least scale that is
/// accepted is 1e-9. Every light that sends anything has a probability on the GPU, probabilities add up
/// to 1 at most, and they are those of the CPU; and those of cuts on the CPU are those of the formulas in f64. Entries of
/// a matrix round by 6e-8, so thinner instances with a rotation inside are about that thick.
#[test]
fn squashed_instances_are_covered_and_have_the_probabilities_of_the_cpu_and_of_f64_on_the_gpu() {
    let mut rng = Rng(910);
    let (mut sent, mut compared, mut close_calls, mut asked, mut worst) = (0, [0; 2], 0, 0, [0.0_f64; 10]);
    for power in 1..=9 {
        // A little more than the limit, below which rounding would hide some.
        let thin = if power == 9 { 1.5e-9 } else { 10.0_f32.powi(-power) };
        let mut world = squashed(&mut rng, thin);
        world.update(FrameBudget::NONE);
        let mut lights = uploaded(&world);
        let names = named_lights(&world);
        let points: Vec<ShadingPoint> = (0..20).map(|_| rng.shading_point(10.0)).collect();
        let questions = about_all(&names, &points);
        let answers = Text::AsItIs.pmfs(&mut lights, &questions);
        let worst = &mut worst[power as usize];
        for (point, gpu) in points.iter().zip(answers.chunks_exact(names.len())) {
            let sum: f64 = gpu.iter().map(|pmf| f64::from(*pmf)).sum();
            assert!(sum <= 1.0 + 1.0e-4, "1e-{power}: probabilities add up to {sum}");
            let sampler = world.sampler().from_roots();
            for ((light, _), gpu) in names.iter().zip(gpu) {
                let sends = sampler.sample_light(point, *light, [rng.unit(), rng.unit()]).is_some();
                assert!(*gpu > 0.0 || !sends, "1e-{power}: {light:?} sends something to {point:?}");
                sent += usize::from(sends);
                if let Some(error) = difference(f64::from(*gpu), f64::from(sampler.pmf(point, *light))) {
                    *worst = worst.max(error);
                    compared[0] += 1;
                }
            }
            for splits in SPLITS {
                let sampler = world.sampler().with_splits(splits);
                asked += 1;
                let Some(exact) = in_f64(&world, point, splits) else {
                    close_calls += 1;
                    continue;
                };
                for (light, place) in &names {
                    let exact = exact.get(place).copied().unwrap_or(0.0);
                    if let Some(error) = difference(exact, f64::from(sampler.pmf(point, *light))) {
                        *worst = worst.max(error);
                        compared[1] += 1;
                    }
                }
            }
        }
    }
    assert!(worst.iter().all(|error| *error < MOST_ERROR), "{worst:?}, by powers of a tenth");
    assert!(sent > 250 && compared.iter().all(|count| *count > 4000), "{sent} {compared:?}");
    assert!(20 * close_calls < asked, "{close_calls} {asked}");
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
    world.update(FrameBudget::NONE);
    let mut lights = uploaded(&world);
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
