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

/// Storage buffers that one stage of ours binds, and an engine's with them: WebGPU's default.
const STORAGE_BUFFERS: u32 = 8;
/// Invocations of our largest workgroup: WebGPU's default.
const INVOCATIONS: u32 = 256;
/// Bytes of workgroup memory: WebGPU's default.
const WORKGROUP_BYTES: u32 = 16 * 1024;

/// Refuses a device that has less than WebGPU's defaults of what we use.
pub(crate) fn check_limits(limits: &wgpu::Limits) -> Result<(), GpuError> {
    for (what, given, needed) in [
        ("max_storage_buffers_per_shader_stage", limits.max_storage_buffers_per_shader_stage, STORAGE_BUFFERS),
        ("max_compute_invocations_per_workgroup", limits.max_compute_invocations_per_workgroup, INVOCATIONS),
        ("max_compute_workgroup_size_x", limits.max_compute_workgroup_size_x, INVOCATIONS),
        ("max_compute_workgroup_storage_size", limits.max_compute_workgroup_storage_size, WORKGROUP_BYTES),
    ] {
        if given < needed {
            return Err(GpuError::Limit { what, given: given.into(), needed: needed.into() });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_limits_are_enough_and_one_less_is_refused() {
        let limits = wgpu::Limits::default();
        assert_eq!(check_limits(&limits), Ok(()));
        let less = wgpu::Limits { max_storage_buffers_per_shader_stage: 7, ..limits };
        let refusal = GpuError::Limit { what: "max_storage_buffers_per_shader_stage", given: 7, needed: 8 };
        assert_eq!(check_limits(&less), Err(refusal));
    }
}
