//! All integration tests in one binary: linking wgpu once is enough.

mod allocations;
mod budget;
mod budget_strategies;
#[path = "../../examples/city/modules.rs"]
#[allow(dead_code, missing_docs, reason = "the example's main uses what the tests do not")]
mod city;
mod city_images;
mod city_refusals;
mod dependencies;
mod distribution;
mod effects;
#[path = "../../examples/engine_shader.rs"]
#[allow(dead_code, missing_docs, reason = "a program; its main is not called")]
mod engine_shader;
mod engine_shader_runs;
mod gltf;
mod gpu;
mod gpu_timings;
mod hard_cases;
mod pdf;
mod resample;
mod sampling;
mod scheduler;
mod shader_text;
mod small_scene;
mod support;
mod tree;
mod usage;
mod variance;
mod world;
