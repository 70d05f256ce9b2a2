//! All integration tests in one binary, so that wgpu is linked only once.

mod absolute;
mod accuracy;
mod added_lights;
mod allocations;
mod appearance;
mod bake;
mod budget;
mod budget_cases;
mod budget_strategies;
mod catalogue;
#[path = "../../examples/city/modules.rs"]
#[allow(dead_code, missing_docs, reason = "the example's main uses what the tests do not")]
mod city;
mod city_compare;
mod city_films;
mod city_gltf;
mod city_images;
mod city_refusals;
#[path = "../../examples/common/mod.rs"]
#[allow(dead_code, missing_docs, clippy::duplicate_mod, reason = "engine_shader.rs, a program, includes it too")]
mod common;
mod concurrency;
mod decisions;
mod dependencies;
#[path = "../../examples/direct_light/mod.rs"]
#[allow(dead_code, missing_docs, reason = "the programs use what the tests do not")]
mod direct_light;
mod direct_light_pictures;
mod distribution;
#[allow(missing_docs, reason = "the library's own tests include it too")]
mod effect_sets;
mod edits;
mod effects;
#[path = "../../examples/engine_shader.rs"]
#[allow(dead_code, missing_docs, reason = "a program; its main is not called")]
mod engine_shader;
mod engine_shader_runs;
#[allow(dead_code, reason = "the program uses what the tests do not")]
mod flight;
mod gloss;
mod gltf;
mod gltf_documents;
mod gltf_features;
mod gltf_fuzz;
mod gltf_load;
mod gpu;
mod gpu_proof;
mod gpu_timings;
mod hard_cases;
mod invariance;
#[path = "../../examples/measuring/mod.rs"]
#[allow(dead_code, missing_docs, reason = "the programs use what the tests do not")]
mod measuring;
mod moves;
mod origin;
mod paper;
mod parts;
mod pdf;
mod placeholders;
mod plan;
mod previous;
mod references;
mod region_model;
mod regions;
mod resample;
mod sampling;
mod scheduler;
mod sections;
mod segments;
mod shader_stats;
mod shader_text;
mod shadow_oracle;
mod small_scene;
mod solid_angle;
mod stability;
mod stand_ins;
mod support;
mod torture;
mod tree;
mod translations;
mod trees_made_elsewhere;
mod usage;
mod variance;
mod visibility;
#[path = "../../examples/city/window/mod.rs"]
#[allow(dead_code, missing_docs, reason = "the example's main opens the window, the tests do not")]
mod window;
mod world;
