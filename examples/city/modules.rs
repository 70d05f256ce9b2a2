//! The example's modules, in the order data passes through them. `main.rs` and the tests both include this file.

pub mod scene;
#[cfg(test)]
pub mod small_scene;

pub mod geometry;
pub mod geometry_nodes;
pub mod shading;

pub mod backend;
pub mod render_cpu;
pub mod render_gpu;

pub mod app;
pub mod denoise;
pub mod options;
pub mod output;
pub mod tone;

pub mod run;
