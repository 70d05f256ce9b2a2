//! What tests and benches share.

pub mod counting;
pub mod effect_sets;
pub mod gltf_documents;
pub mod plan_device;
pub mod plan_records;
pub mod small_scene;
pub mod support;
