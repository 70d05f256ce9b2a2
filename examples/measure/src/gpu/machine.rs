//! The adapter that is measured.

use super::timer::{Effort, Timer};
use girandole::wgpu;
use serde_json::{Value, json};
use testbed::common::gpu::{HOW_TO_GET_AN_ADAPTER, find_adapter, large_buffers, open_device};
use testbed::scene::SceneError;

/// A device and the names of its adapter.
pub struct Machine {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    pub info: wgpu::AdapterInfo,
}

impl Machine {
    /// Opens the best adapter, or the best of those whose name or driver contains `name`.
    pub fn open(name: Option<&str>) -> Result<Self, SceneError> {
        let adapter = find_adapter(name).map_err(|error| SceneError(format!("{error}; {HOW_TO_GET_AN_ADAPTER}")))?;
        let features = adapter.features() & wgpu::Features::TIMESTAMP_QUERY;
        let (device, queue) = open_device(&adapter, features, large_buffers(&adapter)).map_err(SceneError)?;
        Ok(Self { device, queue, info: adapter.get_info() })
    }

    /// Whether a CPU stands in for a GPU.
    pub fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }

    /// How times are taken, for the tables.
    pub fn timing(&self) -> &'static str {
        if self.device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            "GPU timestamps of compute passes"
        } else {
            "wall time of submission and wait"
        }
    }

    /// A timer on this device.
    pub fn timer(&self, effort: Effort) -> Timer {
        Timer::new(&self.device, &self.queue, effort)
    }

    /// Creates an empty storage buffer.
    pub fn storage(&self, label: &str, bytes: u64) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }

    /// The adapter and its driver.
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
