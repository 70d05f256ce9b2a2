//! The only place that knows wgpu.

mod error;
mod pool;
#[cfg(test)]
mod testing;

pub use error::GpuError;
