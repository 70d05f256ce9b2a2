//! The tests of the program in one binary, so that wgpu is linked only once.

mod dumps;
mod films;
mod filter;
mod gltf;
mod images;
mod inputs;
mod refusals;
