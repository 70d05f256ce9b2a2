//! What the GPU side refuses, with what was given and what the limit is.

use super::stages::{MAX_WORKGROUPS, PASS_STRIDE};

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
    /// The device was created with less than WebGPU's default of a limit that we use.
    #[error("the device's {what} is {given}; {needed} is needed")]
    Limit {
        /// The field of `wgpu::Limits`.
        what: &'static str,
        /// What the device has.
        given: u64,
        /// What is needed: at least, or of an alignment at most.
        needed: u64,
    },
    /// The device was lost: destroyed, or its driver failed. Its buffers are gone: make another device and another
    /// [`GpuLights`](super::GpuLights), and upload [`FrameDelta::everything`](crate::FrameDelta::everything).
    #[error("the device was lost")]
    DeviceLost,
}

/// Bytes of the largest storage buffer that the device can create and bind whole.
pub(crate) fn largest_storage_buffer(device: &wgpu::Device) -> u64 {
    let limits = device.limits();
    limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
}

/// Bind groups of our own kernels: the lights, and what the caller gives.
const BIND_GROUPS: u32 = 2;
/// Storage buffers that one stage of ours binds, and an engine's with them: WebGPU's default.
const STORAGE_BUFFERS: u32 = 8;
/// Bindings of the largest bind group: those and one uniform.
const BINDINGS: u32 = STORAGE_BUFFERS + 1;
/// Of the kernel that takes several candidates.
const UNIFORM_BUFFERS: u32 = 2;
/// Invocations of our largest workgroup: WebGPU's default.
const INVOCATIONS: u32 = 256;
/// Bytes of workgroup memory: WebGPU's default.
const WORKGROUP_BYTES: u32 = 16 * 1024;
/// No buffer is larger before the first upload; what outgrows a device after it is [`GpuError::Full`].
const FIRST_BYTES: u64 = 128 * 1024;

/// Refuses a device that has less than WebGPU's defaults of what we use, and names the limit.
pub(crate) fn check_limits(limits: &wgpu::Limits) -> Result<(), GpuError> {
    let alignment = limits.min_uniform_buffer_offset_alignment;
    if alignment > PASS_STRIDE {
        let what = "min_uniform_buffer_offset_alignment";
        return Err(GpuError::Limit { what, given: alignment.into(), needed: PASS_STRIDE.into() });
    }
    macro_rules! at_least {
        ($($limit:ident: $needed:expr),* $(,)?) => {
            [$((stringify!($limit), u64::from(limits.$limit), u64::from($needed))),*]
        };
    }
    for (what, given, needed) in at_least![
        max_bind_groups: BIND_GROUPS,
        max_bindings_per_bind_group: BINDINGS,
        max_storage_buffers_per_shader_stage: STORAGE_BUFFERS,
        max_uniform_buffers_per_shader_stage: UNIFORM_BUFFERS,
        max_dynamic_uniform_buffers_per_pipeline_layout: 1u32,
        max_uniform_buffer_binding_size: PASS_STRIDE,
        max_storage_buffer_binding_size: FIRST_BYTES,
        max_buffer_size: FIRST_BYTES,
        max_compute_invocations_per_workgroup: INVOCATIONS,
        max_compute_workgroup_size_x: INVOCATIONS,
        max_compute_workgroup_storage_size: WORKGROUP_BYTES,
        max_compute_workgroups_per_dimension: MAX_WORKGROUPS,
    ] {
        if given < needed {
            return Err(GpuError::Limit { what, given, needed });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::counts::CandidateCount;
    use crate::gpu::GpuLights;
    use crate::gpu::testing::limited_gpu;
    use crate::light::Light;
    use crate::placement::Placement;
    use crate::policy::Policy;
    use crate::world::LightWorld;

    /// All that is asked for, and nothing more.
    fn least() -> wgpu::Limits {
        wgpu::Limits {
            max_bind_groups: BIND_GROUPS,
            max_bindings_per_bind_group: BINDINGS,
            max_storage_buffers_per_shader_stage: STORAGE_BUFFERS,
            max_uniform_buffers_per_shader_stage: UNIFORM_BUFFERS,
            max_dynamic_uniform_buffers_per_pipeline_layout: 1,
            max_dynamic_storage_buffers_per_pipeline_layout: 0,
            max_uniform_buffer_binding_size: PASS_STRIDE.into(),
            max_storage_buffer_binding_size: FIRST_BYTES,
            max_buffer_size: FIRST_BYTES,
            max_sampled_textures_per_shader_stage: 0,
            max_samplers_per_shader_stage: 0,
            max_storage_textures_per_shader_stage: 0,
            max_compute_workgroup_size_y: 1,
            max_compute_workgroup_size_z: 1,
            ..wgpu::Limits::default()
        }
    }

    /// One less, or one more, of a limit.
    type Change = fn(&mut wgpu::Limits);

    #[test]
    fn the_default_limits_are_enough_and_one_less_of_any_is_refused_by_name() {
        assert_eq!(check_limits(&wgpu::Limits::default()), Ok(()));
        assert_eq!(check_limits(&least()), Ok(()));
        let changes: [(&str, Change); 13] = [
            ("max_bind_groups", |l| l.max_bind_groups -= 1),
            ("max_bindings_per_bind_group", |l| l.max_bindings_per_bind_group -= 1),
            ("max_storage_buffers_per_shader_stage", |l| l.max_storage_buffers_per_shader_stage -= 1),
            ("max_uniform_buffers_per_shader_stage", |l| l.max_uniform_buffers_per_shader_stage -= 1),
            ("max_dynamic_uniform_buffers_per_pipeline_layout", |l| {
                l.max_dynamic_uniform_buffers_per_pipeline_layout -= 1;
            }),
            ("max_uniform_buffer_binding_size", |l| l.max_uniform_buffer_binding_size -= 1),
            ("max_storage_buffer_binding_size", |l| l.max_storage_buffer_binding_size -= 1),
            ("max_buffer_size", |l| l.max_buffer_size -= 1),
            ("max_compute_invocations_per_workgroup", |l| l.max_compute_invocations_per_workgroup -= 1),
            ("max_compute_workgroup_size_x", |l| l.max_compute_workgroup_size_x -= 1),
            ("max_compute_workgroup_storage_size", |l| l.max_compute_workgroup_storage_size -= 1),
            ("max_compute_workgroups_per_dimension", |l| l.max_compute_workgroups_per_dimension -= 1),
            ("min_uniform_buffer_offset_alignment", |l| l.min_uniform_buffer_offset_alignment *= 2),
        ];
        for (name, change) in changes {
            let mut limits = least();
            change(&mut limits);
            let refused = check_limits(&limits);
            assert!(matches!(refused, Err(GpuError::Limit { what, .. }) if what == name), "{name}: {refused:?}");
        }
    }

    #[test]
    fn what_is_asked_for_is_all_that_is_used() {
        let (device, queue) = limited_gpu(&least(), wgpu::Features::empty());
        let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
        let mut lights = GpuLights::new(&device, &queue).expect("just enough");
        lights.count_usage(1);
        let mut world = LightWorld::new();
        let lamp = world.add_tree(vec![Light::point(Vec3::Y, Vec3::ONE)]).expect("valid");
        world.add_instance(lamp, Placement::IDENTITY, Policy::Static).expect("valid");
        let delta = world.take_delta();
        lights.upload(&world, &delta).expect("room enough");
        let buffer = || {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: None,
                size: 64,
                usage: wgpu::BufferUsages::STORAGE,
                mapped_at_creation: false,
            })
        };
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        lights.build_top(&mut encoder);
        lights.sample(&mut encoder, &buffer(), &buffer(), 1);
        lights.resample(&mut encoder, &buffer(), &buffer(), 1, CandidateCount::ONE);
        lights.collect_usage(&mut encoder);
        queue.submit([encoder.finish()]);
        let error = pollster::block_on(scope.pop());
        assert!(error.is_none(), "{error:?}");
    }

    #[test]
    fn a_device_with_too_little_is_refused_at_creation() {
        let (device, queue) =
            limited_gpu(&wgpu::Limits { max_storage_buffers_per_shader_stage: 7, ..least() }, wgpu::Features::empty());
        let error = GpuLights::new(&device, &queue).err().expect("seven are too few");
        let what = "max_storage_buffers_per_shader_stage";
        assert_eq!(error, GpuError::Limit { what, given: 7, needed: 8 });
        assert_eq!(error.to_string(), "the device's max_storage_buffers_per_shader_stage is 7; 8 is needed");
    }
}
