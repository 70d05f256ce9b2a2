//! Chooses where frames are rendered: on a GPU, a software Vulkan driver, or the threads of this
//! program.

use super::scene::SceneError;
use clap::ValueEnum;
use girandole::wgpu;
use std::fmt;

/// The values of `--backend`. These comments are part of the help text.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum BackendChoice {
    /// A GPU or a software Vulkan adapter if there is one, else the CPU
    #[default]
    Auto,
    /// A GPU or a software Vulkan adapter, through wgpu
    Gpu,
    /// Threads of this program
    Cpu,
}

/// What a user can do about a missing adapter.
const ADAPTER_HINT: &str =
    "install a Vulkan driver for the GPU, or a software driver: apt-get install mesa-vulkan-drivers libvulkan1";

/// Storage buffers of a shader that counts the lights that it samples: one more than WebGPU
/// guarantees.
pub const USAGE_STORAGE_BUFFERS: u32 = 9;

/// An open device.
pub struct Gpu {
    /// The example's own device, which the library uses too.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// Whether the device has timestamps within encoders.
    pub timestamps: bool,
    name: String,
}

/// Where frames are rendered.
pub enum Backend {
    /// Compute shaders.
    Gpu(Box<Gpu>),
    /// Threads.
    Cpu,
}

/// A backend and the reason for it.
pub struct ChosenBackend {
    /// The backend.
    pub backend: Backend,
    reason: String,
}

impl fmt::Display for ChosenBackend {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.backend {
            Backend::Gpu(gpu) => write!(f, "backend: gpu, {} ({})", gpu.name, self.reason),
            Backend::Cpu => {
                write!(f, "backend: cpu, {} threads ({})", rayon::current_num_threads(), self.reason)
            }
        }
    }
}

/// Opens the backend that the user chose. Fails only for `gpu` without an adapter.
pub fn choose(choice: BackendChoice) -> Result<ChosenBackend, SceneError> {
    let cpu = |reason: String| ChosenBackend { backend: Backend::Cpu, reason };
    match choice {
        BackendChoice::Cpu => Ok(cpu("chosen by --backend".into())),
        BackendChoice::Gpu => {
            let gpu = open_gpu().map_err(|e| SceneError(format!("{e}; {ADAPTER_HINT}")))?;
            Ok(ChosenBackend { backend: Backend::Gpu(Box::new(gpu)), reason: "chosen by --backend".into() })
        }
        BackendChoice::Auto => Ok(match open_gpu() {
            Ok(gpu) => ChosenBackend { backend: Backend::Gpu(Box::new(gpu)), reason: "the best adapter found".into() },
            Err(e) => cpu(e.0),
        }),
    }
}

/// Opens the best adapter of a native interface. OpenGL is left out, since it takes minutes to
/// compile the shader.
fn open_gpu() -> Result<Gpu, SceneError> {
    let backends = wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12;
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends,
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    });
    let adapters = pollster::block_on(instance.enumerate_adapters(backends));
    let rank = |adapter: &wgpu::Adapter| match adapter.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    };
    let adapter =
        adapters.into_iter().min_by_key(rank).ok_or_else(|| SceneError("no GPU or software adapter found".into()))?;
    let info = adapter.get_info();
    let timing = wgpu::Features::TIMESTAMP_QUERY | wgpu::Features::TIMESTAMP_QUERY_INSIDE_ENCODERS;
    let timestamps = adapter.features().contains(timing);
    let offered = adapter.limits();
    let own = wgpu::Limits::default();
    // WebGPU's default limits, except for the size of buffers and, where the adapter has it, one
    // storage buffer more.
    let required_limits = wgpu::Limits {
        max_storage_buffers_per_shader_stage: offered
            .max_storage_buffers_per_shader_stage
            .clamp(own.max_storage_buffers_per_shader_stage, USAGE_STORAGE_BUFFERS),
        max_storage_buffer_binding_size: offered.max_storage_buffer_binding_size,
        max_buffer_size: offered.max_buffer_size,
        ..own
    };
    let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
        label: Some("city"),
        required_features: if timestamps { timing } else { wgpu::Features::empty() },
        required_limits,
        ..Default::default()
    }))
    .map_err(|e| SceneError(format!("cannot use {}: {e}", info.name)))?;
    let kind = if info.device_type == wgpu::DeviceType::Cpu { "software, " } else { "" };
    Ok(Gpu { device, queue, timestamps, name: format!("{} ({kind}{:?})", info.name, info.backend) })
}
