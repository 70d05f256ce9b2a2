//! Sampling: one light sample per pixel of a picture of each city.

use super::machine::Machine;
use super::shading_points::requests;
use super::spread::Spread;
use super::timer::Timer;
use girandole::gpu::GpuLights;
use girandole::{FrameBudget, wgpu};
use serde_json::{Value, json};
use testbed::common::batch::{self, SampleRecord, SampleRequest};
use testbed::scene::procedural::{self, CityOptions, Size};
use testbed::scene::{SceneError, Stage};

/// How long the city has moved, in seconds.
const TIME: f64 = 1.0;
/// The numbers of candidates that are measured.
const CANDIDATES: [u32; 2] = [1, 8];
/// The bind group of the lights.
const LIGHT_GROUP: u32 = 1;
/// Invocations of a workgroup, as in `sample.wgsl`; a test compares both.
pub const LANES: u32 = 64;
/// Bytes of a pixel in `sample.wgsl`.
const PIXEL_BYTES: u64 = 16;

/// Times of one city with one number of candidates.
pub struct Row {
    pub city: String,
    pub lights: usize,
    pub instances: usize,
    /// Pixels, width and height.
    pub picture: (u32, u32),
    pub candidates: u32,
    /// The time of the whole picture.
    pub time: Spread,
}

impl Row {
    /// The rate of chosen samples; candidates do not count.
    pub fn samples_per_second(&self) -> f64 {
        f64::from(self.picture.0 * self.picture.1) / self.time.median
    }

    pub fn to_json(&self) -> Value {
        json!({
            "city": self.city,
            "lights": self.lights,
            "instances": self.instances,
            "width": self.picture.0,
            "height": self.picture.1,
            "candidates": self.candidates,
            "picture": self.time.to_json(),
            "samples_per_second": self.samples_per_second(),
        })
    }
}

/// Measures one sample per pixel of a picture of a city, for each number of candidates.
pub fn measure(machine: &Machine, timer: &Timer, size: Size, picture: (u32, u32)) -> Result<Vec<Row>, SceneError> {
    let refuse = |refusal| SceneError(format!("city {size:?}: {refusal}"));
    let Stage { mut scene, mut world, mut animation } =
        procedural::stage(&CityOptions { size, cars: None, seed: 1, lamp_profile: None })?;
    animation.advance(TIME, &mut scene, &mut world)?;
    world.update(FrameBudget::UNLIMITED);
    let requests = requests(&scene, picture)?;
    let (eye, pixel) = (scene.camera.eye.as_dvec3(), 2.0 * (0.5 * scene.camera.vertical_fov).tan() / picture.1 as f32);
    drop(scene);

    let mut lights = GpuLights::new(&machine.device, &machine.queue).map_err(refuse)?;
    lights.upload(&world).map_err(refuse)?;
    let mut encoder = machine.device.create_command_encoder(&Default::default());
    lights.build_top(&mut encoder);
    let count = requests.len() as u32;
    let input = machine.storage("requests", size_of_val(&requests[..]) as u64);
    machine.queue.write_buffer(&input, 0, bytemuck::cast_slice(&requests));
    // Samples mark the cells of their points, and these get cuts.
    lights.set_cut_view(eye, pixel);
    let samples = machine.storage("samples", u64::from(count) * size_of::<SampleRecord>() as u64);
    let shader = lights.shader(0, lights.effects());
    let pipeline = batch::pipeline(&machine.device, &shader.join(batch::STAGE), &shader.layout);
    batch::record(&machine.device, &mut encoder, &pipeline, lights.bind_group(), [&input, &samples], count);
    lights.build_cuts(&mut encoder);
    machine.queue.submit([encoder.finish()]);
    drop(samples);
    let pixels = machine.storage("pixels", u64::from(count) * PIXEL_BYTES);
    let mut rows = Vec::new();
    for candidates in CANDIDATES {
        let kernel = Kernel::new(machine, &lights, &world, [&input, &pixels], candidates);
        let time = timer.time(|encoder, queries| kernel.record(encoder, queries, &lights, count))?.total;
        rows.push(Row {
            city: format!("{size:?}"),
            lights: world.light_count(),
            instances: world.instances().len(),
            picture,
            candidates,
            time,
        });
    }
    Ok(rows)
}

/// A compute shader as in an engine, for exactly the effects of the world.
struct Kernel {
    pipeline: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
}

impl Kernel {
    fn new(
        machine: &Machine,
        lights: &GpuLights,
        world: &girandole::LightWorld,
        [requests, pixels]: [&wgpu::Buffer; 2],
        candidates: u32,
    ) -> Self {
        let device = &machine.device;
        let shader = lights.shader(LIGHT_GROUP, world.effects());
        let stage = concat!(include_str!("../../../testbed/src/common/request.wgsl"), include_str!("sample.wgsl"));
        let text = shader.join(&format!("const CANDIDATES = {candidates}u;\n{stage}"));
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("sample"),
            source: wgpu::ShaderSource::Wgsl(text.into()),
        });
        let entry = |binding, read_only, stride: usize| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Storage { read_only },
                has_dynamic_offset: false,
                min_binding_size: wgpu::BufferSize::new(stride as u64),
            },
            count: None,
        };
        let own = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("sample"),
            entries: &[entry(0, true, size_of::<SampleRequest>()), entry(1, false, PIXEL_BYTES as usize)],
        });
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("sample"),
            bind_group_layouts: &[Some(&own), Some(&shader.layout)],
            ..Default::default()
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("sample"),
            layout: Some(&layout),
            module: &module,
            entry_point: Some("sample"),
            compilation_options: Default::default(),
            cache: None,
        });
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("sample"),
            layout: &own,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: requests.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 1, resource: pixels.as_entire_binding() },
            ],
        });
        Self { pipeline, group }
    }

    /// Records one timed pass and returns the number of passes.
    fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        queries: Option<&wgpu::QuerySet>,
        lights: &GpuLights,
        count: u32,
    ) -> usize {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("sample"),
            timestamp_writes: queries.map(|query_set| wgpu::ComputePassTimestampWrites {
                query_set,
                beginning_of_pass_write_index: Some(0),
                end_of_pass_write_index: Some(1),
            }),
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.group, &[]);
        pass.set_bind_group(LIGHT_GROUP, lights.bind_group(), &[]);
        // A picture of 1920 x 1080 pixels takes half of the workgroups that one dimension may have.
        pass.dispatch_workgroups(count.div_ceil(LANES), 1, 1);
        1
    }
}
