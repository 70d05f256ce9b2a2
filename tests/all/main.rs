//! All integration tests in one binary: linking wgpu once is enough.

mod allocations;
#[path = "../../examples/city/modules.rs"]
#[allow(dead_code, missing_docs, reason = "the example's main uses what the tests do not")]
mod city;
mod city_images;
mod city_refusals;
mod dependencies;
mod effects;
mod gltf;
mod gpu;
mod hard_cases;
mod sampling;
mod support;
mod tree;
mod variance;
mod world;
