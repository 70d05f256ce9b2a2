//! The page's device, and what went wrong with it.

use std::sync::{Arc, Mutex, PoisonError};

use bytemuck::Pod;
use girandole::wgpu;
use web_sys::HtmlCanvasElement;

use crate::signal::Signal;

/// The first thing that went wrong after the device was opened: one sentence for the user.
#[derive(Clone, Default)]
pub struct Trouble(Arc<Mutex<Option<String>>>);

impl Trouble {
    fn report(&self, sentence: String) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(sentence);
    }

    /// Fails if anything went wrong.
    pub fn check(&self) -> Result<(), String> {
        match &*self.0.lock().unwrap_or_else(PoisonError::into_inner) {
            Some(sentence) => Err(sentence.clone()),
            None => Ok(()),
        }
    }
}

/// An open device, and the canvas that it draws to.
pub struct Gpu {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    pub surface: wgpu::Surface<'static>,
    /// The format of the canvas; values are stored as they are, without an sRGB encoding.
    pub format: wgpu::TextureFormat,
    /// What the browser tells of the adapter, which may be nothing.
    pub name: String,
    /// A CPU stands in for a GPU.
    pub is_software: bool,
    pub trouble: Trouble,
}

/// The storage buffers of a pipeline that renders: four of the scene and six of the lights. WebGPU promises eight.
const STORAGE_BUFFERS: u32 = 10;

/// Opens the best adapter. The limits are WebGPU's defaults, except for larger buffers, and for two more of them.
pub async fn open(canvas: HtmlCanvasElement) -> Result<Gpu, String> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends: wgpu::Backends::BROWSER_WEBGPU,
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    });
    let surface = instance
        .create_surface(wgpu::SurfaceTarget::Canvas(canvas))
        .map_err(|error| format!("The browser does not let WebGPU draw to the page: {error}."))?;
    let adapter = instance
        .request_adapter(&wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            compatible_surface: Some(&surface),
            ..Default::default()
        })
        .await
        .map_err(|_| {
            "This browser has WebGPU, but it offers no adapter: it found no GPU that it supports.".to_owned()
        })?;
    let (default, offered) = (wgpu::Limits::default(), adapter.limits());
    let buffers = offered.max_storage_buffers_per_shader_stage;
    if buffers < STORAGE_BUFFERS {
        return Err(format!(
            "This page needs {STORAGE_BUFFERS} storage buffers in a shader; this GPU offers {buffers}."
        ));
    }
    let required_limits = wgpu::Limits {
        max_storage_buffer_binding_size: offered.max_storage_buffer_binding_size,
        max_buffer_size: offered.max_buffer_size,
        max_storage_buffers_per_shader_stage: STORAGE_BUFFERS,
        ..default
    };
    let (device, queue) = adapter
        .request_device(&wgpu::DeviceDescriptor { required_limits, ..Default::default() })
        .await
        .map_err(|error| format!("The browser has an adapter for WebGPU, but does not open it: {error}."))?;
    let trouble = Trouble::default();
    let (lost, refused) = (trouble.clone(), trouble.clone());
    device.set_device_lost_callback(move |_, message| {
        let detail = if message.is_empty() { String::new() } else { format!(" ({})", message.trim_end_matches('.')) };
        lost.report(format!("The browser took the GPU away from this page{detail}. Reload the page to go on."));
    });
    device.on_uncaptured_error(Arc::new(move |error| {
        refused.report(format!("WebGPU refused a command of this page: {error}"));
    }));
    let formats = surface.get_capabilities(&adapter).formats;
    let format = formats.iter().copied().find(|format| !format.is_srgb());
    let format = format.ok_or("The browser offers no format for a canvas that WebGPU draws to.")?;
    let info = adapter.get_info();
    Ok(Gpu {
        device,
        queue,
        surface,
        format,
        name: info.name,
        is_software: info.device_type == wgpu::DeviceType::Cpu,
        trouble,
    })
}

impl Gpu {
    /// Makes the canvas ready for pictures of a size.
    pub fn configure(&self, [width, height]: [u32; 2]) {
        self.surface.configure(
            &self.device,
            &wgpu::SurfaceConfiguration {
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
                format: self.format,
                color_space: Default::default(),
                width,
                height,
                present_mode: wgpu::PresentMode::Fifo,
                desired_maximum_frame_latency: 2,
                alpha_mode: wgpu::CompositeAlphaMode::Opaque,
                view_formats: Vec::new(),
            },
        );
    }

    /// An empty buffer.
    pub fn buffer(&self, label: &str, size: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
        let descriptor = wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
        self.device.create_buffer(&descriptor)
    }

    /// Is ready once all submitted work is done.
    pub fn done(&self) -> Signal {
        let done = Signal::default();
        let signal = done.clone();
        self.queue.on_submitted_work_done(move || signal.set());
        done
    }

    /// Reads the first values of a buffer with `COPY_SRC`.
    pub async fn read<T: Pod>(&self, buffer: &wgpu::Buffer, count: u64) -> Result<Vec<T>, String> {
        let size = count * size_of::<T>() as u64;
        let copy = self.buffer("read-back", size, wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST);
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(buffer, 0, &copy, 0, size);
        self.queue.submit([encoder.finish()]);
        let mapped = Signal::default();
        let signal = mapped.clone();
        copy.map_async(wgpu::MapMode::Read, .., move |_| signal.set());
        mapped.await;
        self.trouble.check()?;
        let view = copy.get_mapped_range(..).map_err(|error| format!("A buffer cannot be read back: {error}."))?;
        Ok(bytemuck::pod_collect_to_vec(&view))
    }
}
