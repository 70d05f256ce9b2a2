//! Everything that is measured, a module for each question. `main.rs` names the modules on the command line.

pub mod noise;
pub mod pictures;
pub mod rebuilds;
pub mod paper;
pub mod scale;
pub mod stability;
pub mod gpu_lights;
pub mod kernels;
pub mod gpu;
pub mod documents;
