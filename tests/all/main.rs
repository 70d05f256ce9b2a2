//! All integration tests in one binary: linking wgpu once is enough.

mod dependencies;
mod sampling;
mod support;
mod tree;
mod world;
