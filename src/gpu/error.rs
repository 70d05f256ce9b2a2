//! What the GPU side refuses, with what was given and what the limit is.

/// Why the GPU side refused a call. Its buffers are as they were before the call.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum GpuError {
    /// A buffer would outgrow what the device can bind.
    #[error("{what} need a buffer of {needed} bytes; the limit is {limit}")]
    Full {
        /// What the buffer holds, in the plural.
        what: &'static str,
        /// Bytes that the buffer would have to have.
        needed: u64,
        /// Bytes that one bound buffer can have.
        limit: u64,
    },
    /// The device was created with less than WebGPU's default limits.
    #[error("the device's {what} is {given}; {needed} is needed")]
    Limit {
        /// The field of `wgpu::Limits`.
        what: &'static str,
        /// What the device has.
        given: u64,
        /// What is needed.
        needed: u64,
    },
}

/// Bytes of the largest storage buffer that the device can create and bind whole.
pub(crate) fn largest_storage_buffer(device: &wgpu::Device) -> u64 {
    let limits = device.limits();
    limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
}
