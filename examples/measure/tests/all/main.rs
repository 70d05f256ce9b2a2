//! Each question, answered by a small run.

mod documents;
mod gpu;
mod gpu_lights;
mod kernels;
mod paper;
mod pictures;
mod rebuilds;
mod scale;
mod stability;
