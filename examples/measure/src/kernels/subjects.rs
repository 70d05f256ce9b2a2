//! The kernels that are compiled.

use girandole::Effects;
use girandole::plan::{self, KERNELS, ShaderParts, cut_kernels, visibility_kernels};

/// A kernel of the library, or one that only calls a function of it.
pub struct Subject {
    pub kernel: &'static str,
    /// The name of the effects of the world; empty for kernels that do not read lights.
    pub effects: &'static str,
    pub entry: &'static str,
    pub wgsl: String,
}

/// The effects of the worlds, by name. Those of the city are what `examples/city` needs.
fn worlds() -> [(&'static str, Effects); 3] {
    let city = Effects::CONES | Effects::AREAS | Effects::RANGES | Effects::DIRECTIONAL;
    [("none", Effects::empty()), ("city", city), ("all", Effects::all())]
}

/// The functions that engines call, with the call of each. `q` is the question, `point` the shading
/// point.
const FUNCTIONS: [(&str, &str); 9] = [
    ("light_mark", "light_mark(point);"),
    ("light_sample", "let s = light_sample(point, q.u); answers[id.x] = vec4(s.radiance, s.pdf) * s.pmf;"),
    // What a second call costs, and what a loop saves.
    (
        "light_sample_twice",
        "let s = light_sample(point, q.u); let t = light_sample(light_volume_point(q.normal), q.u.wzyx);
        answers[id.x] = vec4(s.radiance, s.pdf) * s.pmf + vec4(t.radiance, t.pdf) * t.pmf;",
    ),
    (
        "light_sample_loop",
        "for (var i = 0u; i < 4u; i++) {
            let s = light_sample(light_surface_point(q.position, q.normal + f32(i)), q.u);
            answers[id.x] += vec4(s.radiance, s.pdf) * s.pmf;
        }",
    ),
    (
        "light_resample",
        "let s = light_reservoir_sample(point, light_resample(point, q.u, q.choice, 8u));
        answers[id.x] = vec4(s.radiance, s.pdf) * s.pmf;",
    ),
    (
        // A stored reservoir is merged with another one of the last frame.
        "light_reservoir_merge",
        "let at_then = light_surface_point(q.u.xyz, q.normal);
        var own = light_reservoir_of(q.instance, q.light, q.u.xy);
        var then = light_reservoir_of(q.light, q.instance, q.u.zw);
        own.reflected = q.u.y;
        then.reflected = q.u.x;
        let there = light_reservoir_sample_previous(at_then, own).radiance.y;
        let here = light_reservoir_sample(point, then).radiance.y;
        let kept = light_reservoir_merge(own, there, then, here, q.choice);
        answers[id.x] = vec4(kept.weight, kept.count, kept.reflected, f32(kept.light));",
    ),
    ("light_pmf", "answers[id.x] = vec4(light_pmf(point, q.instance, q.light));"),
    ("light_pdf", "answers[id.x] = vec4(light_pdf(point, q.instance, q.light, q.u.xyz));"),
    ("light_hit", "let s = light_hit(point, q.u.xyz, q.u.w); answers[id.x] = vec4(s.radiance, s.pdf * s.pmf);"),
];

/// The text with the functions that a call names.
fn functions(call: &str, effects: Effects) -> String {
    match call.contains("_previous(") {
        true => plan::wgsl_with(0, effects, &ShaderParts::default().with_previous()),
        false => plan::wgsl(0, effects),
    }
}

/// A kernel that calls a function for each question. `functions` is the text with the function.
fn caller(functions: &str, call: &str) -> String {
    functions.to_owned()
        + "
struct Question {
    position: vec3<f32>, instance: u32,
    normal: vec3<f32>, light: u32,
    u: vec4<f32>,
    choice: f32,
}
@group(1) @binding(0) var<storage, read> questions: array<Question>;
@group(1) @binding(1) var<storage, read_write> answers: array<vec4<f32>>;
@compute @workgroup_size(64)
fn call(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= arrayLength(&questions) {
        return;
    }
    let q = questions[id.x];
    let point = light_surface_point(q.position, q.normal);
    " + call
        + "\n}\n"
}

/// All kernels: those of uploads and of the top level, and the functions that engines call.
pub fn all() -> Vec<Subject> {
    let own = KERNELS.iter().copied().chain(visibility_kernels()).map(|kernel| Subject {
        kernel: kernel.entry(),
        effects: "",
        entry: kernel.entry(),
        wgsl: kernel.wgsl(),
    });
    let functions = FUNCTIONS.iter().flat_map(|(kernel, call)| {
        worlds().map(|(effects, set)| Subject {
            kernel,
            effects,
            entry: "call",
            wgsl: caller(&functions(call, set), call),
        })
    });
    own.chain([put()]).chain(functions).chain(cuts()).collect()
}

/// A kernel of an engine that writes triangles.
fn put() -> Subject {
    let call = "
@group(1) @binding(0) var<storage, read> vertices: array<vec4<f32>>;
@compute @workgroup_size(64)
fn call(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < light_source_count(0u) {
        let at = 3u * id.x;
        light_put_triangle(0u, id.x, vertices[at].xyz, vertices[at + 1u].xyz, vertices[at + 2u].xyz, vec3(1.0));
    }
}
";
    Subject { kernel: "light_put_triangle", effects: "", entry: "call", wgsl: plan::wgsl_of_sources(0) + call }
}

/// What builds cuts.
fn cuts() -> impl Iterator<Item = Subject> {
    worlds().into_iter().flat_map(|(effects, set)| {
        let own = cut_kernels(set).into_iter().filter(move |kernel| kernel.effects().is_some() || set.is_empty());
        own.map(move |kernel| Subject { kernel: kernel.entry(), effects, entry: kernel.entry(), wgsl: kernel.wgsl() })
    })
}
