//! The adapter that is measured.

use super::scene::SceneError;
use super::timer::{Effort, Timer};
use girandole::wgpu;
use serde_json::{Value, json};

/// A device and what it is called.
pub struct Machine {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    pub info: wgpu::AdapterInfo,
}

impl Machine {
    /// The best adapter, or the first whose name or driver contains `wanted`. OpenGL is left out: it takes minutes to
    /// compile the shaders.
    pub fn open(wanted: Option<&str>) -> Result<Self, SceneError> {
        let backends = wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12;
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
            backends,
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        });
        let adapters = pollster::block_on(instance.enumerate_adapters(backends));
        let names = |info: &wgpu::AdapterInfo| format!("{} {} {}", info.name, info.driver, info.driver_info);
        let is_wanted = |adapter: &wgpu::Adapter| {
            wanted.is_none_or(|part| names(&adapter.get_info()).to_lowercase().contains(&part.to_lowercase()))
        };
        let rank = |adapter: &wgpu::Adapter| match adapter.get_info().device_type {
            wgpu::DeviceType::DiscreteGpu => 0,
            wgpu::DeviceType::IntegratedGpu => 1,
            wgpu::DeviceType::VirtualGpu => 2,
            wgpu::DeviceType::Other => 3,
            wgpu::DeviceType::Cpu => 4,
        };
        let adapter = adapters.into_iter().filter(is_wanted).min_by_key(rank).ok_or_else(|| {
            SceneError(format!(
                "no adapter{} found; install a GPU driver with Vulkan, or the software one: \
                 apt-get install mesa-vulkan-drivers libvulkan1",
                wanted.map(|part| format!(" named {part}")).unwrap_or_default()
            ))
        })?;
        let info = adapter.get_info();
        let offered = adapter.limits();
        // WebGPU's own limits, except that large scenes may take what the adapter has to give.
        let required_limits = wgpu::Limits {
            max_storage_buffer_binding_size: offered.max_storage_buffer_binding_size,
            max_buffer_size: offered.max_buffer_size,
            ..wgpu::Limits::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("gpu_timings"),
            required_features: adapter.features() & wgpu::Features::TIMESTAMP_QUERY,
            required_limits,
            ..Default::default()
        }))
        .map_err(|e| SceneError(format!("cannot use {}: {e}", info.name)))?;
        Ok(Self { device, queue, info })
    }

    /// A CPU that stands in for a GPU.
    pub fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }

    /// How times are taken.
    pub fn timing(&self) -> &'static str {
        if self.device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            "GPU timestamps of compute passes"
        } else {
            "wall time of submission and wait"
        }
    }

    pub fn timer(&self, effort: Effort) -> Timer {
        Timer::new(&self.device, &self.queue, effort)
    }

    /// An empty storage buffer.
    pub fn storage(&self, label: &str, bytes: u64) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }

    pub fn to_json(&self) -> Value {
        json!({
            "name": self.info.name,
            "driver": self.info.driver,
            "driver_info": self.info.driver_info,
            "backend": format!("{:?}", self.info.backend),
            "kind": format!("{:?}", self.info.device_type),
        })
    }
}
