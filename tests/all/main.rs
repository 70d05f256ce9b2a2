//! All integration tests in one binary: linking wgpu once is enough.

mod sampling;
mod support;
mod tree;
