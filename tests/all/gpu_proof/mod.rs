//! What is proven on the GPU itself, and not by comparison with the CPU: every light that sends
//! anything is chosen with some probability, probabilities add up and are those with which lights
//! are picked, and no input gives NaN or infinity.

mod assuming_numbers;
mod barriers;
mod edits;
mod inputs;
mod proof;
mod reference;
mod squashed;

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock};

use crate::gpu::{answers, gpu, name_of};
use assuming_numbers::comparisons_negated;
use bytemuck::{Pod, Zeroable};
use girandole::gpu::GpuLights;
use girandole::{Effects, LightId, LightWorld, ShadingPoint};
use testbed::common::batch;

/// A shading point and what is asked about it. Which fields count depends on the question.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
struct Question {
    position: [f32; 3],
    instance: u32,
    normal: [f32; 3],
    light: u32,
    u: [f32; 4],
    choice: f32,
    mask: u32,
    /// For points and for resampling: 0 for a matte point, 1 for a glossy one, 2 for a segment from `position` on.
    kind: u32,
    padding: u32,
    /// The view of a glossy point and its roughness; the direction and the length of a segment.
    more: [f32; 4],
}

impl Question {
    fn at(point: &ShadingPoint) -> Self {
        Self {
            position: point.position.to_array(),
            normal: point.normal.to_array(),
            mask: point.mask,
            ..Self::default()
        }
    }
}

/// Calls each of the functions that an engine calls. Answers are words, whose bits the host checks.
const STAGE: &str = "
    struct Question {
        position: vec3<f32>, instance: u32, normal: vec3<f32>, light: u32,
        u: vec4<f32>, choice: f32, mask: u32, kind: u32, padding: u32, more: vec4<f32>,
    }
    @group(1) @binding(0) var<storage, read> questions: array<Question>;
    @group(1) @binding(1) var<storage, read_write> answers: array<u32>;
    fn point_of(q: Question) -> LightShadingPoint {
        return light_masked_point(light_surface_point(q.position, q.normal), q.mask);
    }
    // Such a point of any kind. Shaders that use it take several times as long to compile.
    fn any_point_of(q: Question) -> LightShadingPoint {
        var point = light_surface_point(q.position, q.normal);
        if q.kind == 1u {
            point = light_glossy_point(q.position, q.normal, q.more.xyz, q.more.w, q.choice, q.u.w);
        }
        if q.kind == 2u {
            point = light_segment(q.position, q.more.xyz, q.more.w);
        }
        return light_masked_point(point, q.mask);
    }
    fn put_sample(at: u32, s: LightSample) {
        answers[at] = bitcast<u32>(s.direction.x);
        answers[at + 1u] = bitcast<u32>(s.direction.y);
        answers[at + 2u] = bitcast<u32>(s.direction.z);
        answers[at + 3u] = bitcast<u32>(s.dist);
        answers[at + 4u] = bitcast<u32>(s.radiance.x);
        answers[at + 5u] = bitcast<u32>(s.radiance.y);
        answers[at + 6u] = bitcast<u32>(s.radiance.z);
        answers[at + 7u] = bitcast<u32>(s.pdf);
        answers[at + 8u] = bitcast<u32>(s.pmf);
        answers[at + 9u] = s.instance;
        answers[at + 10u] = s.light;
    }
    @compute @workgroup_size(64) fn point(@builtin(global_invocation_id) id: vec3<u32>) {
        if id.x >= arrayLength(&questions) { return; }
        let p = any_point_of(questions[id.x]);
        let vectors = array(p.position, p.normal, p.segment, p.gloss.tangent, p.gloss.bitangent);
        for (var i = 0u; i < 15u; i++) {
            answers[20u * id.x + i] = bitcast<u32>(vectors[i / 3u][i % 3u]);
        }
        let rest = array(p.gloss.alpha, p.gloss.specular, p.gloss.view.x, p.gloss.view.y, p.gloss.flat_part);
        for (var i = 0u; i < 5u; i++) {
            answers[20u * id.x + 15u + i] = bitcast<u32>(rest[i]);
        }
    }
    // The reflectance of a surface with the normal +Z for a cluster in a direction: `u` without `w`,
    // with the angular size `position.x`.
    @compute @workgroup_size(64) fn reflected(@builtin(global_invocation_id) id: vec3<u32>) {
        if id.x >= arrayLength(&questions) { return; }
        let q = questions[id.x];
        let gloss = light_gloss(vec3(0.0, 0.0, 1.0), q.more.xyz, q.more.w, q.choice, q.u.w);
        let found = light_reflected(gloss, q.u.x, q.u.y, q.u.z, q.position.x);
        answers[2u * id.x] = bitcast<u32>(found.value);
        answers[2u * id.x + 1u] = bitcast<u32>(found.doubt);
    }
    @compute @workgroup_size(64) fn pmf(@builtin(global_invocation_id) id: vec3<u32>) {
        if id.x >= arrayLength(&questions) { return; }
        let q = questions[id.x];
        answers[id.x] = bitcast<u32>(light_pmf(point_of(q), q.instance, q.light));
    }
    @compute @workgroup_size(64) fn pick(@builtin(global_invocation_id) id: vec3<u32>) {
        if id.x >= arrayLength(&questions) { return; }
        let q = questions[id.x];
        let picked = light_pick(point_of(q), q.u.xy);
        answers[3u * id.x] = picked.instance;
        answers[3u * id.x + 1u] = picked.light;
        answers[3u * id.x + 2u] = bitcast<u32>(picked.pmf);
    }
    @compute @workgroup_size(64) fn sample(@builtin(global_invocation_id) id: vec3<u32>) {
        if id.x >= arrayLength(&questions) { return; }
        let q = questions[id.x];
        put_sample(11u * id.x, light_sample(point_of(q), q.u));
    }
    @compute @workgroup_size(64) fn resample(@builtin(global_invocation_id) id: vec3<u32>) {
        if id.x >= arrayLength(&questions) { return; }
        let q = questions[id.x];
        let kept = light_resample(any_point_of(q), q.u, q.choice, 4u);
        put_sample(12u * id.x, light_reservoir_sample(any_point_of(q), kept));
        answers[12u * id.x + 11u] = bitcast<u32>(kept.weight);
    }";

/// The chosen light, and its probability; 0 for none.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
struct Picked {
    instance: u32,
    light: u32,
    pmf: f32,
}

/// A sample, as words.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
struct Sampled {
    direction: [f32; 3],
    dist: f32,
    radiance: [f32; 3],
    pdf: f32,
    pmf: f32,
    instance: u32,
    light: u32,
}

/// What four candidates have left.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
struct Resampled {
    chosen: Sampled,
    weight: f32,
}

/// The text that answers questions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Text {
    AsItIs,
    /// With its comparisons negated, as by a compiler that assumes that no float is NaN.
    AssumingNumbers,
}

impl Text {
    /// Answers questions with one entry point of [`STAGE`].
    fn ask<A: Pod>(self, lights: &mut GpuLights, entry: &'static str, questions: &[Question]) -> Vec<A> {
        static PIPELINES: Mutex<BTreeMap<(Text, &str), Place>> = Mutex::new(BTreeMap::new());
        let place = PIPELINES.lock().expect("no panic before").entry((self, entry)).or_default().clone();
        let pipeline = place.get_or_init(|| {
            let shader = lights.shader(0, Effects::all());
            let written = shader.join(&STAGE.replace(&format!("fn {entry}(@"), "fn batch(@"));
            let wgsl = if self == Text::AsItIs { written } else { comparisons_negated(&written) };
            batch::pipeline(&gpu().0, &wgsl, &shader.layout)
        });
        answers(&gpu(), pipeline, lights, questions)
    }

    /// The probability of the light that each question names.
    fn pmfs(self, lights: &mut GpuLights, questions: &[Question]) -> Vec<f32> {
        self.ask(lights, "pmf", questions)
    }

    fn samples(self, lights: &mut GpuLights, questions: &[Question]) -> Vec<Sampled> {
        self.ask(lights, "sample", questions)
    }
}

/// A pipeline that is compiled by the first test that needs it.
type Place = Arc<OnceLock<wgpu::ComputePipeline>>;

/// What is asked about every light at some points, one point after the other.
fn about_all(lights: &[(LightId, [u32; 2])], points: &[ShadingPoint]) -> Vec<Question> {
    let ask = |point| {
        lights.iter().map(move |(_, [instance, light])| Question {
            instance: *instance,
            light: *light,
            ..Question::at(point)
        })
    };
    points.iter().flat_map(ask).collect()
}

/// Every light of a world with the numbers by which shaders name it: the slot of its instance and
/// its index, `u32::MAX` and its place for a directional light.
fn named_lights(world: &LightWorld) -> Vec<(LightId, [u32; 2])> {
    world.sampler().all_lights().map(|light| (light, name_of(world, light))).collect()
}
