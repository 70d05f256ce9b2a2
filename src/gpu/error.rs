//! Errors of the GPU side: each states what was given and what is allowed.

use crate::plan::kernel::MAX_WORKGROUPS;
use crate::plan::{MIN_LARGEST_BUFFER, PlanError, UNIFORM_ALIGNMENT};

/// Why the GPU side refused a call. What shaders read is as it was before the call, except where
/// [`GpuError::OutOfMemory`] says otherwise. Codes 600 to 603.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum GpuError {
    /// A buffer would outgrow what the device can bind.
    #[error("{what} need a buffer of {needed} bytes; the limit is {limit}")]
    Full {
        /// What the buffer holds, in the plural.
        what: &'static str,
        /// Bytes that the buffer needs.
        needed: u64,
        /// Bytes of the largest buffer that the device can bind.
        limit: u64,
    },
    /// A limit of the device is not sufficient. WebGPU's default limits are.
    #[error("the device's {what} is {given}; {needed} is needed")]
    Limit {
        /// The field of `wgpu::Limits`.
        what: &'static str,
        /// The limit of the device.
        given: u64,
        /// The limit that is needed: the minimum, or for an alignment the maximum.
        needed: u64,
    },
    /// The device was lost: it was destroyed, or its driver failed. Its buffers are gone. Make
    /// another device and another [`GpuLights`](super::GpuLights), whose first upload sends
    /// everything.
    #[error("the device was lost")]
    DeviceLost,
    /// The device has no memory left for a buffer, for the data of an upload, or for a pipeline.
    ///
    /// If a buffer is refused, shaders keep reading the buffers of the last upload. If the data of
    /// an upload (`"uploaded records"`) is refused, the buffers are incomplete, and shaders sample
    /// no light until an upload succeeds. In both cases the next upload sends what is missing.
    ///
    /// Native backends only: browsers report a refusal after the call, to the engine's own
    /// error scope or its handler for uncaptured errors.
    #[error("the device has no memory for {what} ({bytes} bytes)")]
    OutOfMemory {
        /// What was refused.
        what: &'static str,
        /// Bytes that were requested; 0 for pipelines, whose size only the driver knows.
        bytes: u64,
    },
}

impl GpuError {
    /// The stable code, see [`error`](crate::error).
    pub fn code(&self) -> u32 {
        match self {
            Self::Full { .. } => 600,
            Self::Limit { .. } => 601,
            Self::DeviceLost => 602,
            Self::OutOfMemory { .. } => 603,
        }
    }
}

impl From<PlanError> for GpuError {
    fn from(error: PlanError) -> Self {
        match error {
            PlanError::Full { what, needed, limit } => Self::Full { what, needed, limit },
            PlanError::OutOfOrder { .. } => unreachable!("plans are played when they are made"),
        }
    }
}

/// Bytes of the largest storage buffer that the device can create and bind whole.
pub(crate) fn largest_storage_buffer(device: &wgpu::Device) -> u64 {
    let limits = device.limits();
    limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
}

/// Bind groups of our own kernels: the lights, and the buffers of the caller.
const BIND_GROUPS: u32 = 2;
/// Storage buffers in one of our stages, and in a stage of an engine that binds the lights:
/// WebGPU's default.
const STORAGE_BUFFERS: u32 = 8;
/// Bindings in the largest bind group: the storage buffers and one uniform.
const BINDINGS: u32 = STORAGE_BUFFERS + 1;
/// Uniform buffers in one of our stages.
const UNIFORM_BUFFERS: u32 = 1;
/// Invocations in our largest workgroup: WebGPU's default.
const INVOCATIONS: u32 = 256;
/// Bytes of workgroup memory in the stage that uses most: WebGPU's default.
const WORKGROUP_BYTES: u32 = 16 * 1024;

/// No uniform that we bind has more bytes.
const LARGEST_UNIFORM: u32 = 512;

/// Refuses a device with a limit below the WebGPU default that we depend on, and names that limit.
pub(crate) fn check_limits(limits: &wgpu::Limits) -> Result<(), GpuError> {
    let alignment = limits.min_uniform_buffer_offset_alignment;
    if alignment > UNIFORM_ALIGNMENT {
        let what = "min_uniform_buffer_offset_alignment";
        return Err(GpuError::Limit { what, given: alignment.into(), needed: UNIFORM_ALIGNMENT.into() });
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
        max_uniform_buffer_binding_size: LARGEST_UNIFORM,
        max_storage_buffer_binding_size: MIN_LARGEST_BUFFER,
        max_buffer_size: MIN_LARGEST_BUFFER,
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
    use crate::gpu::GpuLights;
    use crate::gpu::testing::limited_gpu;
    use crate::instance::placement::Placement;
    use crate::light::Light;
    use crate::policy::Policy;
    use crate::tree::LightTree;
    use crate::world::LightWorld;

    /// The limits that `check_limits` requires, and the minimum of all others.
    fn required() -> wgpu::Limits {
        wgpu::Limits {
            max_bind_groups: BIND_GROUPS,
            max_bindings_per_bind_group: BINDINGS,
            max_storage_buffers_per_shader_stage: STORAGE_BUFFERS,
            max_uniform_buffers_per_shader_stage: UNIFORM_BUFFERS,
            max_dynamic_uniform_buffers_per_pipeline_layout: 1,
            max_dynamic_storage_buffers_per_pipeline_layout: 0,
            max_uniform_buffer_binding_size: LARGEST_UNIFORM.into(),
            max_storage_buffer_binding_size: MIN_LARGEST_BUFFER,
            max_buffer_size: MIN_LARGEST_BUFFER,
            max_sampled_textures_per_shader_stage: 0,
            max_samplers_per_shader_stage: 0,
            max_storage_textures_per_shader_stage: 0,
            max_compute_workgroup_size_y: 1,
            max_compute_workgroup_size_z: 1,
            ..wgpu::Limits::default()
        }
    }

    /// Takes one from a limit, or doubles an alignment.
    type Change = fn(&mut wgpu::Limits);

    #[test]
    fn the_default_limits_are_enough_and_one_less_of_any_is_refused_with_its_name() {
        assert_eq!(check_limits(&wgpu::Limits::default()), Ok(()));
        assert_eq!(check_limits(&required()), Ok(()));
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
            let mut limits = required();
            change(&mut limits);
            let refused = check_limits(&limits);
            assert!(matches!(refused, Err(GpuError::Limit { what, .. }) if what == name), "{name}: {refused:?}");
        }
    }

    #[test]
    fn a_device_with_only_the_required_limits_runs_everything() {
        let (device, queue) = limited_gpu(&required(), wgpu::Features::empty());
        let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
        let mut lights = GpuLights::new(&device, &queue).expect("the required limits");
        let mut world = LightWorld::new();
        let lamp = world.add_tree(LightTree::new(vec![Light::point(Vec3::Y, Vec3::ONE)]).expect("valid"));
        world.add_instance(lamp, Placement::IDENTITY, Policy::Static).expect("valid");
        lights.upload(&world).expect("room enough");
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        lights.build_top(&mut encoder);
        lights.build_cuts(&mut encoder);
        queue.submit([encoder.finish()]);
        let error = pollster::block_on(scope.pop());
        assert!(error.is_none(), "{error:?}");
    }

    #[test]
    fn a_device_with_too_few_storage_buffers_is_refused_at_creation() {
        let (device, queue) = limited_gpu(
            &wgpu::Limits { max_storage_buffers_per_shader_stage: 7, ..required() },
            wgpu::Features::empty(),
        );
        let error = GpuLights::new(&device, &queue).expect_err("seven are too few");
        let what = "max_storage_buffers_per_shader_stage";
        assert_eq!(error, GpuError::Limit { what, given: 7, needed: 8 });
        assert_eq!(error.to_string(), "the device's max_storage_buffers_per_shader_stage is 7; 8 is needed");
    }

    #[test]
    fn every_error_has_a_code_of_its_own() {
        let errors = [
            GpuError::Full { what: "nodes", needed: 2, limit: 1 },
            GpuError::Limit { what: "max_bind_groups", given: 1, needed: 2 },
            GpuError::DeviceLost,
            GpuError::OutOfMemory { what: "lights", bytes: 64 },
        ];
        assert_eq!(errors.map(|error| error.code()), [600, 601, 602, 603]);
        assert_eq!(errors[2].to_string(), "the device was lost");
        assert_eq!(errors[3].to_string(), "the device has no memory for lights (64 bytes)");
    }
}
