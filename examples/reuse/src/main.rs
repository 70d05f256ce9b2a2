//! Temporal reuse of samples while lights come, go, move and change, without bias.
//!
//! ```text
//! cargo run --release -p reuse [-- 8]
//! ```
//!
//! Each pixel of a ground with walls keeps one sample from frame to frame, as in ReSTIR (`docs/reuse.md`;
//! `reuse.wgsl`). There are 150 lights. One scene stands still. In two others all lights move, one or five of
//! them are replaced in each frame and as many are switched, and an instance with ten lights comes and goes.
//! The program draws each scene with several caps on the number of frames that a kept sample stands for, and
//! prints the noise of a pixel in a frame, and the mean illuminance over all frames in proportion to sums over
//! all lights. It fails if a mean differs by four standard errors, or if reuse of one frame does not lower
//! the noise. An argument is the number of new samples in each frame, 1 by default.
//!
//! It needs a GPU adapter that binds eleven storage buffers in a stage; software Vulkan will do.

use std::error::Error;
use std::process::ExitCode;

use girandole::glam::{DVec3, Mat3, Vec3};
use girandole::gpu::GpuLights;
use girandole::{
    Effects, FrameBudget, InstanceKey, Light, LightTree, LightWorld, Placement, Policy, ShadingPoint, TreeKey, wgpu,
};
use testbed::common::gpu;
use testbed::testing::support::Rng;

/// Pixels along an edge of the ground. A pixel is a metre wide.
const EDGE: u32 = 16;
/// Pictures with other random numbers that are drawn at once.
const PICTURES: u32 = 8;
const FRAMES: u32 = 30;
/// The first frame whose error counts: by then, samples stand for as many frames as they may.
const FIRST: u32 = 20;
const LIGHTS: usize = 150;
/// The lights that are replaced in each frame, or `None` for a scene that stands still.
const SCENES: [(&str, Option<usize>); 3] = [("still", None), ("1 of 150", Some(1)), ("5 of 150", Some(5))];
/// The caps on the frames that a kept sample stands for. 0 frames are no reuse.
const CAPS: [f32; 4] = [0.0, 1.0, 4.0, 20.0];

/// `Kept` in reuse.wgsl.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Kept {
    light: [u32; 3],
    weight: f32,
    u: [f32; 2],
    frames: f32,
    lux: f32,
}

struct Scene {
    world: LightWorld,
    rng: Rng,
    tree: TreeKey,
    /// The indices of the lights that there are.
    indices: Vec<u32>,
    moving: InstanceKey,
    /// Ten lights that are there in every other six frames.
    few: TreeKey,
    fleeting: Option<InstanceKey>,
}

impl Scene {
    fn new() -> Result<Self, Box<dyn Error>> {
        let mut rng = Rng(7);
        let mut world = LightWorld::new();
        let tree = world.add_tree(LightTree::new((0..LIGHTS).map(|_| lamp(&mut rng)).collect())?);
        let few = world.add_tree(LightTree::new((0..10).map(|_| lamp(&mut rng)).collect())?);
        let moving = world.add_instance(tree, Placement::IDENTITY, Policy::Budgeted)?;
        Ok(Self { world, rng, tree, indices: (0..LIGHTS as u32).collect(), moving, few, fleeting: None })
    }

    /// What a game does between two frames. Replaces `count` lights, and switches as many.
    fn change(&mut self, frame: u32, count: usize) -> Result<(), Box<dyn Error>> {
        let Self { world, rng, tree, indices, moving, few, fleeting } = self;
        let mut taken = |rng: &mut Rng| indices.swap_remove((rng.unit() * indices.len() as f32) as usize);
        let gone: Vec<u32> = (0..count).map(|_| taken(rng)).collect();
        let switched: Vec<u32> = (0..count).map(|_| taken(rng)).collect();
        world.remove_lights(*tree, &gone)?;
        let added: Vec<Light> = (0..count).map(|_| lamp(rng)).collect();
        indices.extend(world.add_lights(*tree, &added)?);
        indices.extend(&switched);
        for light in switched {
            let is_dark = rng.unit() < 0.3;
            world.set_emission(*tree, light, if is_dark { Vec3::ZERO } else { Vec3::splat(rng.between(2.0, 8.0)) })?;
        }
        let turn = Mat3::from_rotation_y(0.01 * frame as f32);
        world.move_instance(*moving, Placement { linear: turn, ..Placement::IDENTITY })?;
        match fleeting.take() {
            instance if frame % 6 != 5 => *fleeting = instance,
            Some(instance) => world.remove_instance(instance)?,
            None => {
                let at = Placement::at(DVec3::new(0.0, 1.0, f64::from(frame % 5)));
                *fleeting = Some(world.add_instance(*few, at, Policy::Budgeted)?);
            }
        }
        Ok(())
    }
}

/// A point or a small panel within eight metres, one to four metres above the ground.
fn lamp(rng: &mut Rng) -> Light {
    let at = Vec3::new(rng.between(-8.0, 8.0), rng.between(1.0, 4.0), rng.between(-8.0, 8.0));
    match rng.unit() < 0.5 {
        true => Light::point(at, Vec3::splat(rng.between(2.0, 8.0))),
        // X x Z points down.
        false => Light::rectangle(at, Vec3::X * 0.2, Vec3::Z * 0.2, Vec3::splat(rng.between(20.0, 80.0))),
    }
}

/// The illuminance of each pixel in a frame as a sum over all lights, in lux.
fn summed(world: &LightWorld, frame: u32) -> Vec<f32> {
    let sampler = world.sampler();
    let edge = EDGE as f32;
    let pixel = |i: u32| {
        let at = Vec3::new((i % EDGE) as f32 + 0.5 - 0.5 * edge, 0.0, (i / EDGE) as f32 + 0.5 - 0.5 * edge);
        let ground = ShadingPoint::surface(at, Vec3::Y);
        // Sixteen points of each panel, others in each frame: the shadows of walls cross panels.
        let [x, y] = [0.618_034, 0.754_878].map(|step| (step * frame as f32).fract());
        let numbers = (0..16).map(|k| [((k % 4) as f32 + x) / 4.0, ((k / 4) as f32 + y) / 4.0]);
        let of_light = |light| {
            let lux = |u| match sampler.sample_light(&ground, light, u) {
                Some(s) if !is_occluded(at, s.direction, 0.999 * s.dist) => s.radiance.y * s.direction.y / s.pdf,
                _ => 0.0,
            };
            numbers.clone().map(lux).sum::<f32>() / 16.0
        };
        sampler.all_lights().map(of_light).sum()
    };
    (0..EDGE * EDGE).map(pixel).collect()
}

/// Twin of `is_occluded` in reuse.wgsl: whether one of four walls is in the way.
fn is_occluded(origin: Vec3, direction: Vec3, max_dist: f32) -> bool {
    (0..4).map(|i| 4.0 * i as f32 - 6.0).any(|z| {
        let to_low = (Vec3::new(-9.0, 0.0, z - 0.1) - origin) / direction;
        let to_high = (Vec3::new(9.0, 4.0, z + 0.1) - origin) / direction;
        to_low.min(to_high).max_element().max(0.0) <= to_low.max(to_high).min_element().min(max_dist)
    })
}

struct Renderer {
    device: wgpu::Device,
    queue: wgpu::Queue,
    lights: GpuLights,
    pipeline: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
    frame: wgpu::Buffer,
    kept: wgpu::Buffer,
    candidates: u32,
}

impl Renderer {
    fn new(candidates: u32) -> Result<Self, Box<dyn Error>> {
        // Ten of the lights of two frames, and one of this program.
        let limits = wgpu::Limits { max_storage_buffers_per_shader_stage: 11, ..wgpu::Limits::default() };
        let (device, queue) = gpu::open_device(&gpu::find_adapter(None)?, wgpu::Features::empty(), limits)?;
        let mut lights = GpuLights::new(&device, &queue)?;
        lights.keep_previous(true);
        let shader = lights.shader(1, Effects::all()).with_previous(2);
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("reuse"),
            source: wgpu::ShaderSource::Wgsl(shader.join(include_str!("reuse.wgsl")).into()),
        });
        let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
            count: None,
        };
        let own = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: None,
            entries: &[
                entry(0, wgpu::BufferBindingType::Storage { read_only: false }),
                entry(1, wgpu::BufferBindingType::Uniform),
            ],
        });
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            bind_group_layouts: &[Some(&own), Some(&shader.layout), Some(lights.previous_bind_group_layout())],
            ..Default::default()
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("reuse"),
            layout: Some(&layout),
            module: &module,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        let buffer = |size, usage| {
            device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
        };
        let bytes = u64::from(EDGE * EDGE * PICTURES) * CAPS.len() as u64 * size_of::<Kept>() as u64;
        let kept = buffer(bytes, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC);
        let frame = buffer(32, wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST);
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &own,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: kept.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 1, resource: frame.as_entire_binding() },
            ],
        });
        Ok(Self { device, queue, lights, pipeline, group, frame, kept, candidates })
    }

    /// Draws a frame with all caps.
    fn draw(&mut self, world: &mut LightWorld, number: u32) -> Result<Vec<Kept>, Box<dyn Error>> {
        let [none, one, some, most] = CAPS.map(f32::to_bits);
        let frame = [number, EDGE, self.candidates, 0, none, one, some, most];
        self.queue.write_buffer(&self.frame, 0, bytemuck::cast_slice(&frame));
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.lights.sync(world, FrameBudget::default(), &mut encoder)?;
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.group, &[]);
        pass.set_bind_group(1, self.lights.bind_group(), &[]);
        pass.set_bind_group(2, self.lights.previous_bind_group(), &[]);
        pass.dispatch_workgroups(EDGE * EDGE * PICTURES / 64, CAPS.len() as u32, 1);
        drop(pass);
        self.queue.submit([encoder.finish()]);
        Ok(gpu::read(&self.device, &self.queue, &self.kept)?)
    }
}

/// What was drawn with one cap.
#[derive(Default)]
struct Drawn {
    /// The sum of the squared relative errors of pixels.
    squares: f64,
    /// The sum of each pixel of each picture over all frames.
    sums: Vec<f64>,
}

impl Drawn {
    /// The sum over a picture, as a mean over pictures, and its standard error. Pixels and pictures are
    /// independent, frames are not.
    fn sum(&self) -> (f64, f64) {
        let pictures = f64::from(PICTURES);
        let pixels = (EDGE * EDGE) as usize;
        let (mut sum, mut variance) = (0.0, 0.0);
        for pixel in 0..pixels {
            let values = || self.sums.iter().skip(pixel).step_by(pixels);
            let mean = values().sum::<f64>() / pictures;
            sum += mean;
            variance += values().map(|value| (value - mean).powi(2)).sum::<f64>() / (pictures * (pictures - 1.0));
        }
        (sum, variance.sqrt())
    }
}

/// Draws a scene with all caps. Also returns the sum of a picture's pixels and frames as sums over all lights.
fn draw(candidates: u32, changes: Option<usize>) -> Result<([Drawn; 4], f64), Box<dyn Error>> {
    let mut renderer = Renderer::new(candidates)?;
    let mut scene = Scene::new()?;
    let mut drawn: [Drawn; 4] = std::array::from_fn(|_| Drawn::default());
    let mut exact = 0.0;
    for frame in 0..FRAMES {
        if let Some(count) = changes {
            scene.change(frame, count)?;
        }
        let kept = renderer.draw(&mut scene.world, frame)?;
        let truth = summed(&scene.world, frame);
        exact += truth.iter().map(|lux| f64::from(*lux)).sum::<f64>();
        for (drawn, kept) in drawn.iter_mut().zip(kept.chunks(truth.len() * PICTURES as usize)) {
            drawn.sums.resize(kept.len(), 0.0);
            for (i, kept) in kept.iter().enumerate() {
                drawn.sums[i] += f64::from(kept.lux);
                if frame >= FIRST {
                    drawn.squares += f64::from(kept.lux / truth[i % truth.len()] - 1.0).powi(2);
                }
            }
        }
    }
    Ok((drawn, exact))
}

fn run() -> Result<(), Box<dyn Error>> {
    let candidates = std::env::args().nth(1).map_or(Ok(1), |text| text.parse())?;
    let mut failures = Vec::new();
    testbed::say!("| lights replaced in a frame | cap | relMSE of a pixel | mean | its standard error |");
    testbed::say!("|---|---:|---:|---:|---:|");
    for (name, changes) in SCENES {
        let (all, exact) = draw(candidates, changes)?;
        for (drawn, cap) in all.iter().zip(CAPS) {
            let squares = drawn.squares / f64::from((FRAMES - FIRST) * EDGE * EDGE * PICTURES);
            let (mean, error) = drawn.sum();
            let (mean, error) = (mean / exact, error / exact);
            let line = format!("| {name} | {cap} | {squares:.3} | {mean:.4} | {error:.4} |");
            testbed::say!("{line}");
            if (mean - 1.0).abs() > 4.0 * error {
                failures.push(format!("biased: {line}"));
            }
        }
        if all[1].squares >= all[0].squares {
            failures.push(format!("reuse does not lower the noise: {name}"));
        }
    }
    match failures.is_empty() {
        true => Ok(()),
        false => Err(failures.join("\n").into()),
    }
}

fn main() -> ExitCode {
    testbed::common::exit::exit_code(run())
}
