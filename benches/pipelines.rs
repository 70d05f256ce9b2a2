//! How long a driver takes for a pipeline that calls the library in one place, in two or in four, and in
//! a loop.
//!
//! `cargo bench --bench pipelines [-- NAME]` prints a table for the best adapter, or for one whose name or
//! driver contains NAME. Times are those of all threads of the process, from the WGSL text to the first
//! dispatch: software drivers compile no sooner. Each text has a number of its own, so that no driver has it in
//! its cache. As a test (`cargo test --benches`), it compiles the
//! smallest of them.

#![allow(clippy::print_stdout, reason = "a table is what this program is for")]

use girandole::gpu::{GpuLights, GpuOptions};
use girandole::{Effects, FrameBudget, LightWorld, wgpu};
use std::time::SystemTime;
use testbed::common::gpu;
use testbed::common::stopwatch::process_time;

/// What comes before the uses: where an engine has a surface, this has numbers of a buffer, so that no use
/// is like another.
const ENGINE: &str = "
fn place(i: u32) -> LightShadingPoint {
    return light_surface_point(values[i].xyz, values[i + 1u].xyz);
}

@group(0) @binding(0) var<storage, read_write> values: array<vec4<f32>>;

fn sampled(i: u32) -> f32 {
    let s = light_sample(place(i), values[i + 2u]);
    return s.radiance.x * s.pmf / s.pdf;
}

fn weighed(i: u32) -> f32 {
    return light_pmf(place(i), bitcast<u32>(values[i + 2u].x), bitcast<u32>(values[i + 2u].y));
}

fn resampled(i: u32) -> f32 {
    let kept = light_resample(place(i), values[i + 2u], values[i].w, 8u);
    let s = light_reservoir_sample(place(i), kept);
    return s.radiance.x / s.pmf;
}

fn hit(i: u32) -> f32 {
    let s = light_hit(place(i), values[i + 2u].xyz, values[i].w);
    return s.radiance.x * s.pmf / s.pdf;
}

fn kept(i: u32) -> f32 {
    let kept = light_reservoir_of(bitcast<u32>(values[i + 2u].x), bitcast<u32>(values[i + 2u].y), values[i + 2u].zw);
    let now = light_reservoir_sample(place(i), kept);
    let then = light_reservoir_sample_previous(place(i), kept);
    return now.pmf * now.radiance.x + then.pmf * then.radiance.x;
}

@compute @workgroup_size(1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let at = 64u * id.x;
    var sum = 0.0;
    USES
    values[at] = vec4(sum) * NUMBER;
}
";

/// The uses of each pipeline.
const CASES: [(&str, &str); 9] = [
    ("a sample", "sum += sampled(at);"),
    ("two samples", "sum += sampled(at); sum += sampled(at + 3u);"),
    ("four samples", "sum += sampled(at); sum += sampled(at + 3u); sum += sampled(at + 6u); sum += sampled(at + 9u);"),
    ("four samples in a loop", "for (var i = 0u; i < 4u; i++) { sum += sampled(at + 3u * i); }"),
    ("a probability", "sum += weighed(at);"),
    ("a sample and a probability", "sum += sampled(at); sum += weighed(at + 3u);"),
    (
        "two samples and two probabilities",
        "sum += sampled(at); sum += weighed(at + 3u); sum += sampled(at + 6u); sum += weighed(at + 9u);",
    ),
    ("a sample, and a kept one now and in the last frame", "sum += sampled(at); sum += kept(at + 3u);"),
    (
        "the same, a sample of eight candidates, a hit, and two probabilities",
        "sum += sampled(at); sum += kept(at + 3u); sum += resampled(at + 6u); sum += hit(at + 9u); \
         sum += weighed(at + 12u); sum += weighed(at + 15u);",
    ),
];

fn main() -> Result<(), String> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let is_bench = arguments.iter().any(|argument| argument == "--bench");
    let name = arguments.iter().find(|argument| !argument.starts_with("--"));
    let adapter = gpu::find_adapter(name.map(String::as_str))?;
    let (device, queue) = gpu::open_device(&adapter, wgpu::Features::empty(), wgpu::Limits::default())?;
    let options = GpuOptions::default().with_previous();
    let mut lights = GpuLights::with_options(&device, &queue, options).map_err(|error| error.to_string())?;
    let mut encoder = device.create_command_encoder(&Default::default());
    lights.sync(&mut LightWorld::new(), FrameBudget::NONE, &mut encoder).map_err(|error| error.to_string())?;
    queue.submit([encoder.finish()]);
    gpu::wait(&device)?;

    let city = Effects::CONES | Effects::AREAS | Effects::RANGES | Effects::DIRECTIONAL;
    let sets = [("none", Effects::empty()), ("city", city), ("all", Effects::all())];
    let info = adapter.get_info();
    println!("{}, {} {}", info.name, info.driver, info.driver_info);
    println!("| uses | {} |", sets.map(|(name, _)| format!("{name}, s")).join(" | "));
    println!("|---|{}", "---:|".repeat(sets.len()));
    for (uses, text) in &CASES[..if is_bench { CASES.len() } else { 1 }] {
        let mut line = format!("| {uses} |");
        for (_, effects) in &sets[..if is_bench { sets.len() } else { 1 }] {
            let seconds = compile(&device, &queue, &lights, *effects, text)?;
            line += &format!(" {seconds:.2} |");
        }
        println!("{line}");
    }
    Ok(())
}

/// Makes the pipeline and runs it once; returns the CPU time.
fn compile(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    lights: &GpuLights,
    effects: Effects,
    uses: &str,
) -> Result<f64, String> {
    let shader = lights.shader(1, effects);
    let nanoseconds = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_err(|error| error.to_string())?;
    let number = format!("{}.0", nanoseconds.subsec_nanos());
    let text = ENGINE.replace("USES", uses).replace("NUMBER", &number);
    let values = device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: 1024,
        usage: wgpu::BufferUsages::STORAGE,
        mapped_at_creation: false,
    });
    let own = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: None,
        entries: &[wgpu::BindGroupLayoutEntry {
            binding: 0,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Storage { read_only: false },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        }],
    });
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &own,
        entries: &[wgpu::BindGroupEntry { binding: 0, resource: values.as_entire_binding() }],
    });
    let start = process_time();
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(shader.join(&text).into()),
    });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        bind_group_layouts: &[Some(&own), Some(&shader.layout)],
        ..Default::default()
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: Some(&layout),
        module: &module,
        entry_point: Some("main"),
        compilation_options: Default::default(),
        cache: None,
    });
    let mut encoder = device.create_command_encoder(&Default::default());
    let mut pass = encoder.begin_compute_pass(&Default::default());
    pass.set_pipeline(&pipeline);
    pass.set_bind_group(0, &group, &[]);
    pass.set_bind_group(1, lights.bind_group(), &[]);
    pass.dispatch_workgroups(1, 1, 1);
    drop(pass);
    queue.submit([encoder.finish()]);
    gpu::wait(device)?;
    Ok((process_time() - start).as_secs_f64())
}
