//! Lights that kernels write on the GPU: what the refit of their trees costs, and the noise of samples of
//! them while they move.
//!
//! ```text
//! measure gpu-lights --out FILE.csv [--cost] [--quick] [--adapter NAME]
//! ```
//!
//! The program moves lights for 300 frames, which a kernel writes, while the world rebuilds trees from what it
//! reads back three frames late, within 0.3 ms a frame of a clock that counts lights. Every 30th frame it
//! computes the exact noise of one sample, also as a multiple of the noise of trees that were built for that
//! frame.
//!
//! `--cost` refits 1,000 trees of 1,000 triangles instead: the dispatches, the bytes that are read and written
//! as a multiple of those of a copy of the lights, the time of both on the GPU, and the time that a frame takes
//! on the CPU.
//! `docs/gpu-lights.md` has the tables.

pub mod kernel;
pub mod motion;

pub mod cost;
pub mod noise;

pub mod run;
