//! The only place that knows wgpu.

mod error;
mod layout;
mod pool;
mod sort;
#[cfg(test)]
mod testing;
mod text;

pub use error::GpuError;
pub use text::wgsl;
