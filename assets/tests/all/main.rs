//! All integration tests in one binary.

mod gltf;
mod gltf_features;
mod gltf_fuzz;
mod gltf_load;
mod gltf_variants;
mod textures;

use testbed::testing::counting::Counting;

#[global_allocator]
static ALLOCATOR: Counting = Counting;
