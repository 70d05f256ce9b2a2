//! The only place that knows wgpu.

mod error;
mod pool;
mod sort;
#[cfg(test)]
mod testing;

pub use error::GpuError;
