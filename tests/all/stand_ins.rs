//! Stand-ins in shaders, for trees that the GPU does not hold.

use std::collections::BTreeMap;

use girandole::glam::{DVec3, Vec3};
use girandole::gpu::GpuLights;
use girandole::{Effects, FrameBudget, Light, LightWorld, Placement, Policy, ShadingPoint};

use crate::gpu::{ask, gpu_lights, question_at};
use girandole::LightTree;
use testbed::testing::support::Rng;

/// The index of the first stand-in of a tree.
const STAND_IN: u32 = 1 << 30;

/// For a shading point and random numbers: a sample, its probability as `light_pmf` gives it, whether
/// its instance stands in, the probability of the first light of its tree, and its illuminance.
const TEXT: &str = "
    struct Question { position: vec3<f32>, padding: f32, u: vec4<f32> }
    struct Answer { instance: u32, light: u32, pmf: f32, asked: f32, stands_in: u32, first: f32, lux: f32, padding: u32 }
    fn answer(q: Question) -> Answer {
        let point = light_volume_point(q.position);
        let s = light_sample(point, q.u);
        var answer = Answer(s.instance, s.light, s.pmf, 0.0, 0u, 0.0, s.radiance.y, 0u);
        if s.pmf > 0.0 {
            answer.asked = light_pmf(point, s.instance, s.light);
            answer.stands_in = u32(light_stands_in(s.instance));
            answer.first = light_pmf(point, s.instance, 0u);
        }
        return answer;
    }";

#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct Answer {
    instance: u32,
    light: u32,
    pmf: f32,
    asked: f32,
    stands_in: u32,
    first: f32,
    lux: f32,
    padding: u32,
}

fn samples(lights: &mut GpuLights, rng: &mut Rng, position: Vec3, count: usize) -> Vec<Answer> {
    let questions: Vec<_> = (0..count).map(|_| question_at(position, rng)).collect();
    ask(lights, Effects::all(), TEXT, &questions)
}

#[test]
fn stand_ins_are_sampled_with_their_true_probabilities_and_are_as_bright_as_their_tree() {
    let mut rng = Rng(71);
    let mut world = LightWorld::new();
    let lamp = |rng: &mut Rng| Light::point(rng.position(3.0), Vec3::splat(rng.between(1.0, 4.0)));
    for i in 0..3 {
        // The third has too few lights to have stand-ins.
        let tree = (0..[400, 100, 5][i]).map(|_| lamp(&mut rng)).collect();
        let tree = world.add_tree(LightTree::new(tree).expect("valid"));
        let place = Placement::at(DVec3::new(20.0 * i as f64, 0.0, 0.0));
        world.add_instance(tree, place, Policy::Static).expect("valid");
    }
    world.update(FrameBudget::NONE);
    let mut lights = gpu_lights();
    lights.set_frame_bytes(Some(0));
    let report = lights.upload(&world).expect("room enough");
    assert_eq!((report.stand_ins, report.waiting_trees), (2, 2));
    for (position, far) in [(Vec3::new(10.0, 4.0, 2.0), false), (Vec3::new(20.0, 900.0, 0.0), true)] {
        let answers = samples(&mut lights, &mut rng, position, 8192);
        let mut found = BTreeMap::new();
        let mut mean = 0.0;
        for answer in &answers {
            assert!(answer.pmf > 0.0, "{answer:?}");
            assert!((answer.asked / answer.pmf - 1.0).abs() < 2.0e-3, "{answer:?}");
            let stands_in = answer.stands_in == 1;
            assert_eq!(stands_in, answer.light >= STAND_IN, "{answer:?}");
            // The buffers do not hold the light with index 0 of a tree that stands in.
            assert_eq!(answer.first == 0.0, stands_in, "{answer:?}");
            found.insert((answer.instance, answer.light), answer.pmf);
            mean += answer.lux / answer.pmf / answers.len() as f32;
        }
        let total: f32 = found.values().sum();
        // A light that no sample found has a probability of about 1/8192 at most.
        assert!((0.99..1.002).contains(&total), "{total} over {} lights", found.len());
        assert!(found.keys().filter(|(_, light)| *light >= STAND_IN).count() >= 16);
        if far {
            // From far away, stand-ins shine like their trees.
            let point = ShadingPoint::volume(position);
            let sampler = world.sampler();
            let estimate = |rng: &mut Rng| {
                let u = [rng.unit(), rng.unit(), rng.unit(), rng.unit()];
                sampler.sample(&point, u).map_or(0.0, |s| s.incident.radiance.y / s.pmf)
            };
            let expected = (0..20_000).map(|_| estimate(&mut rng)).sum::<f32>() / 20_000.0;
            assert!((mean / expected - 1.0).abs() < 0.02, "{mean} lux in place of {expected}");
        }
    }
    // All trees come once bytes are allowed.
    lights.set_frame_bytes(None);
    let report = lights.upload(&world).expect("room enough");
    assert_eq!((report.stand_ins, report.waiting_trees, report.waiting_bytes), (0, 0, 0));
    let answers = samples(&mut lights, &mut rng, Vec3::new(10.0, 4.0, 2.0), 1024);
    assert!(answers.iter().all(|answer| answer.stands_in == 0 && answer.light < 400 && answer.first > 0.0));
}
