//! Chooses where frames are rendered: on a GPU, a software Vulkan driver, or the threads of this
//! program.

use super::scene::SceneError;
use crate::common::gpu::{HOW_TO_GET_AN_ADAPTER, find_adapter, large_buffers, open_device};
use clap::ValueEnum;
use girandole::wgpu;
use std::fmt;

/// The values of `--backend`. These comments are part of the help text.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum BackendChoice {
    /// A GPU if there is one, else the CPU, which is faster than a software Vulkan adapter
    #[default]
    Auto,
    /// A GPU or a software Vulkan adapter, through wgpu
    Gpu,
    /// Threads of this program
    Cpu,
}

/// An open device.
pub struct Gpu {
    /// The example's own device, which the library uses too.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    name: String,
    /// A CPU stands in for a GPU.
    is_software: bool,
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

/// The CPU backend, for a reason that is shown to the user.
pub fn cpu(reason: impl Into<String>) -> ChosenBackend {
    ChosenBackend { backend: Backend::Cpu, reason: reason.into() }
}

/// Opens the backend that the user chose. Fails only for `gpu` without an adapter.
pub fn choose(choice: BackendChoice) -> Result<ChosenBackend, SceneError> {
    match choice {
        BackendChoice::Cpu => Ok(cpu("chosen by --backend")),
        BackendChoice::Gpu => {
            let gpu = open_gpu().map_err(|e| SceneError(format!("{e}; {HOW_TO_GET_AN_ADAPTER}")))?;
            Ok(ChosenBackend { backend: Backend::Gpu(Box::new(gpu)), reason: "chosen by --backend".into() })
        }
        BackendChoice::Auto => Ok(match open_gpu() {
            Ok(gpu) if gpu.is_software => {
                cpu(format!("the only adapter is {}, which is slower; --backend gpu uses it", gpu.name))
            }
            Ok(gpu) => ChosenBackend { backend: Backend::Gpu(Box::new(gpu)), reason: "the best adapter found".into() },
            Err(e) => cpu(e.0),
        }),
    }
}

/// Opens the best adapter. The limits are WebGPU's defaults, except for larger buffers.
fn open_gpu() -> Result<Gpu, SceneError> {
    let adapter = find_adapter(None).map_err(SceneError)?;
    let opened = open_device(&adapter, wgpu::Features::empty(), large_buffers(&adapter));
    let (device, queue) = opened.map_err(SceneError)?;
    let info = adapter.get_info();
    let is_software = info.device_type == wgpu::DeviceType::Cpu;
    let kind = if is_software { "software, " } else { "" };
    let name = format!("{} ({kind}{:?})", info.name, info.backend);
    Ok(Gpu { device, queue, name, is_software })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_software_adapter_is_taken_only_on_request() {
        let Backend::Gpu(gpu) = choose(BackendChoice::Gpu).expect("tests have an adapter").backend else {
            panic!("an adapter was asked for");
        };
        let auto = choose(BackendChoice::Auto).expect("it never fails");
        assert_eq!(matches!(auto.backend, Backend::Cpu), gpu.is_software, "{auto}");
        assert_eq!(auto.to_string().contains("--backend gpu"), gpu.is_software, "{auto}");
    }
}
