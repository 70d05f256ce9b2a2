//! Opens a GPU and reads buffers back. An engine has its own device; examples, tests and benches
//! take one from here.
//!
//! Errors are one line for the user.

use bytemuck::Pod;

/// Native interfaces. OpenGL is left out because its drivers take minutes to compile the shaders.
const BACKENDS: wgpu::Backends = wgpu::Backends::VULKAN.union(wgpu::Backends::METAL).union(wgpu::Backends::DX12);

/// What a user can do where no adapter is found.
pub const HOW_TO_GET_AN_ADAPTER: &str =
    "install a GPU driver with Vulkan, or the software one: apt-get install mesa-vulkan-drivers libvulkan1";

/// Finds the best adapter: discrete GPUs first, then integrated ones, virtual ones and software.
///
/// `name`, if given, keeps the adapters whose name or driver contains it, in upper or lower case.
pub fn find_adapter(name: Option<&str>) -> Result<wgpu::Adapter, String> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends: BACKENDS,
        // Positions in the text, for debuggers of shaders, take a tenth of the time of software drivers.
        flags: wgpu::InstanceFlags::default() - wgpu::InstanceFlags::DEBUG,
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    });
    let adapters = pollster::block_on(instance.enumerate_adapters(BACKENDS));
    let has_name = |adapter: &wgpu::Adapter| {
        let info = adapter.get_info();
        let names = format!("{} {} {}", info.name, info.driver, info.driver_info).to_lowercase();
        name.is_none_or(|name| names.contains(&name.to_lowercase()))
    };
    let rank = |adapter: &wgpu::Adapter| match adapter.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    };
    adapters.into_iter().filter(has_name).min_by_key(rank).ok_or_else(|| match name {
        Some(name) => format!("no adapter named {name} found"),
        None => "no GPU or software adapter found".into(),
    })
}

/// Opens a device with exactly these features and limits.
pub fn open_device(
    adapter: &wgpu::Adapter,
    required_features: wgpu::Features,
    required_limits: wgpu::Limits,
) -> Result<(wgpu::Device, wgpu::Queue), String> {
    let descriptor = wgpu::DeviceDescriptor { required_features, required_limits, ..Default::default() };
    pollster::block_on(adapter.request_device(&descriptor))
        .map_err(|error| format!("cannot use {}: {error}", adapter.get_info().name))
}

/// Opens the best adapter with WebGPU's default limits and no optional features.
pub fn open_default() -> Result<(wgpu::Device, wgpu::Queue), String> {
    let adapter = find_adapter(None).map_err(|error| format!("{error}; {HOW_TO_GET_AN_ADAPTER}"))?;
    open_device(&adapter, wgpu::Features::empty(), wgpu::Limits::default())
}

/// WebGPU's default limits, with buffers as large as the adapter offers, which large scenes need, and with as
/// many storage buffers.
pub fn large_buffers(adapter: &wgpu::Adapter) -> wgpu::Limits {
    let offered = adapter.limits();
    wgpu::Limits {
        max_storage_buffer_binding_size: offered.max_storage_buffer_binding_size,
        max_buffer_size: offered.max_buffer_size,
        max_storage_buffers_per_shader_stage: offered.max_storage_buffers_per_shader_stage,
        ..wgpu::Limits::default()
    }
}

/// Waits until all submitted work is done.
pub fn wait(device: &wgpu::Device) -> Result<(), String> {
    let waited = device.poll(wgpu::PollType::wait_indefinitely());
    waited.map(|_| ()).map_err(|error| format!("the adapter does not answer: {error}"))
}

/// Maps the first `bytes` bytes of a buffer with `MAP_READ`, copies them and unmaps the buffer
/// again.
pub fn map<T: Pod>(device: &wgpu::Device, buffer: &wgpu::Buffer, bytes: u64) -> Result<Vec<T>, String> {
    buffer.map_async(wgpu::MapMode::Read, 0..bytes, |_| {});
    wait(device)?;
    // This call also reports a mapping that failed.
    let view = buffer.get_mapped_range(0..bytes).map_err(|error| format!("cannot read back: {error}"))?;
    let content = bytemuck::pod_collect_to_vec(&view);
    drop(view);
    buffer.unmap();
    Ok(content)
}

/// Reads a whole buffer with `COPY_SRC` once all submitted work is done.
pub fn read<T: Pod>(device: &wgpu::Device, queue: &wgpu::Queue, buffer: &wgpu::Buffer) -> Result<Vec<T>, String> {
    let copy = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("read-back"),
        size: buffer.size(),
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_buffer_to_buffer(buffer, 0, &copy, 0, buffer.size());
    queue.submit([encoder.finish()]);
    map(device, &copy, buffer.size())
}
