//! Which machine renders: a GPU, a software Vulkan driver, or this program's own threads.

use super::scene::SceneError;
use clap::ValueEnum;
use girandole::wgpu;
use std::fmt;

/// What `--backend` takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum BackendChoice {
    /// A GPU or software Vulkan adapter if there is one, otherwise the CPU
    #[default]
    Auto,
    /// Through wgpu
    Gpu,
    /// Rayon and obvhs
    Cpu,
}

/// What a user does about a missing adapter.
pub const HOW_TO_GET_AN_ADAPTER: &str =
    "install a GPU driver with Vulkan, or the software one: apt-get install mesa-vulkan-drivers libvulkan1";

/// Buffers that WebGPU grants a shader, all of which the renderer binds, and the counters of picks.
pub const COUNTING_BUFFERS: u32 = 9;

/// A GPU that is ready for work.
pub struct Gpu {
    /// The example's own device; the library borrows it.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    /// Whether commands can be timed where they run.
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

/// A backend and why it was taken.
pub struct Chosen {
    /// The backend.
    pub backend: Backend,
    reason: String,
}

impl fmt::Display for Chosen {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.backend {
            Backend::Gpu(gpu) => write!(f, "backend: gpu, {} ({})", gpu.name, self.reason),
            Backend::Cpu => {
                write!(f, "backend: cpu, {} threads ({})", rayon::current_num_threads(), self.reason)
            }
        }
    }
}

/// Takes the backend that the user asked for. Refuses only `gpu` where there is no adapter.
pub fn choose(choice: BackendChoice) -> Result<Chosen, SceneError> {
    let cpu = |reason: String| Chosen { backend: Backend::Cpu, reason };
    match choice {
        BackendChoice::Cpu => Ok(cpu("as asked".into())),
        BackendChoice::Gpu => {
            let gpu = open_gpu().map_err(|e| SceneError(format!("{e}; {HOW_TO_GET_AN_ADAPTER}")))?;
            Ok(Chosen { backend: Backend::Gpu(Box::new(gpu)), reason: "as asked".into() })
        }
        BackendChoice::Auto => Ok(match open_gpu() {
            Ok(gpu) => Chosen { backend: Backend::Gpu(Box::new(gpu)), reason: "the best adapter here".into() },
            Err(e) => cpu(e.0),
        }),
    }
}

/// Opens the best adapter of a native interface. OpenGL is left out: it takes minutes to compile the shader.
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
    // WebGPU's own limits, except that large scenes may take what the adapter has to give, and counters another buffer.
    let required_limits = wgpu::Limits {
        max_storage_buffers_per_shader_stage: offered
            .max_storage_buffers_per_shader_stage
            .clamp(own.max_storage_buffers_per_shader_stage, COUNTING_BUFFERS),
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
