//! All integration tests in one binary: linking wgpu once is enough.

mod dependencies;
mod gpu;
mod sampling;
mod support;
mod tree;
mod world;
