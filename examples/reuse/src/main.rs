//! Reuse of samples over frames and pixels, without bias, while lights, walls and the camera move.
//!
//! ```text
//! cargo run --release -p reuse [-- 8]
//! ```
//!
//! Each pixel of a ground with walls keeps a reservoir from frame to frame, as in ReSTIR (`docs/reuse.md`;
//! `reuse.wgsl`). There are 150 lights. One scene stands still. In two others all lights move, one or five of
//! them are replaced in each frame and as many are switched, and an instance with ten lights comes and goes. In the
//! last two the camera moves, and the walls rise and fall.
//! The program draws each scene in several ways: with other caps on the count of a reservoir, and with a neighbour. It
//! prints the noise of a pixel in a frame, and the mean illuminance over all frames in proportion to sums over
//! all lights. It fails if a mean differs by four standard errors, or if reuse does not lower
//! the noise. An argument is the number of new samples in each frame, 1 by default.
//!
//! It needs a GPU adapter; software Vulkan will do.

use std::error::Error;
use std::process::ExitCode;

use girandole::glam::{DVec3, Mat3, Vec3};
use girandole::gpu::{GpuLights, GpuOptions};
use girandole::{
    Effects, FrameBudget, InstanceKey, Light, LightTree, LightWorld, Placement, Policy, ShadingPoint, TreeKey, wgpu,
};
use testbed::common::gpu;
use testbed::testing::support::Rng;

/// Pixels along an edge of the ground. A pixel is a quarter of a metre wide.
const EDGE: u32 = 16;
/// Pictures with other random numbers that are drawn at once.
const PICTURES: u32 = 32;
/// Pixels of all pictures that are drawn at once.
const KEPT: usize = (EDGE * EDGE * PICTURES) as usize * VARIANTS.len();
const FRAMES: u32 = 30;
/// The first frame whose error counts: by then, samples stand for as many frames as they may.
const FIRST: u32 = 20;
const LIGHTS: usize = 150;
/// What happens in a scene.
const SCENES: [(&str, Change); 5] = [
    ("nothing", Change::Nothing),
    ("1 of 150 lights is replaced", Change::Lights(1)),
    ("5 of 150 lights are replaced", Change::Lights(5)),
    ("the camera moves", Change::Camera),
    ("walls rise and fall", Change::Walls),
];

#[derive(Clone, Copy, PartialEq)]
enum Change {
    Nothing,
    /// So many are replaced in each frame.
    Lights(usize),
    Camera,
    Walls,
}

/// A way to reuse: `Variant` in reuse.wgsl.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Variant {
    cap: f32,
    neighbours: u32,
    rays_then: u32,
    padding: u32,
}

const VARIANTS: [Variant; 7] = [
    Variant { cap: 0.0, neighbours: 0, rays_then: 0, padding: 0 },
    Variant { cap: 4.0, neighbours: 0, rays_then: 0, padding: 0 },
    Variant { cap: 20.0, neighbours: 0, rays_then: 0, padding: 0 },
    Variant { cap: 4.0, neighbours: 1, rays_then: 0, padding: 0 },
    Variant { cap: 20.0, neighbours: 1, rays_then: 0, padding: 0 },
    Variant { cap: 4.0, neighbours: 1, rays_then: 1, padding: 0 },
    Variant { cap: 4.0, neighbours: 1, rays_then: 2, padding: 0 },
];
/// [`Variant::rays_then`].
const RAYS: [&str; 3] = ["its own scene", "the present scene", "none"];

/// `LightReservoir` in the library's text.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Kept {
    light: [u32; 4],
    weight: f32,
    count: f32,
    reflected: f32,
}

/// `Frame` in reuse.wgsl.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Frame {
    number: u32,
    pixels_per_edge: u32,
    candidates: u32,
    first_then: u32,
    camera: [i32; 2],
    walls: [f32; 2],
    variants: [Variant; VARIANTS.len()],
}

impl Change {
    /// What the camera has moved by in a frame, in pixels: to and fro.
    fn camera(self, frame: u32) -> i32 {
        if self == Self::Camera { [0, 1, 2, 3, 4, 3, 2, 1][frame as usize % 8] } else { 0 }
    }

    /// How high the walls hang in a frame.
    fn walls(self, frame: u32) -> f32 {
        if self == Self::Walls { [0.0, 0.2, 0.6, 1.2, 1.8, 1.2, 0.6, 0.2][frame as usize % 8] } else { 0.0 }
    }
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
fn summed(world: &LightWorld, change: Change, frame: u32) -> Vec<f32> {
    let sampler = world.sampler();
    let edge = EDGE as f32;
    let (camera, walls) = (change.camera(frame) as f32, change.walls(frame));
    let pixel = |i: u32| {
        let place = [(i % EDGE) as f32 + camera, (i / EDGE) as f32].map(|place| 0.25 * (place + 0.5 - 0.5 * edge));
        let at = Vec3::new(place[0], 0.0, place[1]);
        let ground = ShadingPoint::surface(at, Vec3::Y);
        // Sixteen points of each panel, others in each frame: the shadows of walls cross panels.
        let [x, y] = [0.618_034, 0.754_878].map(|step| (step * frame as f32).fract());
        let numbers = (0..16).map(|k| [((k % 4) as f32 + x) / 4.0, ((k / 4) as f32 + y) / 4.0]);
        let of_light = |light| {
            let lux = |u| match sampler.sample_light(&ground, light, u) {
                Some(s) if !is_occluded(at, s.direction, 0.999 * s.dist, walls) => s.radiance.y * s.direction.y / s.pdf,
                _ => 0.0,
            };
            numbers.clone().map(lux).sum::<f32>() / 16.0
        };
        sampler.all_lights().map(of_light).sum()
    };
    (0..EDGE * EDGE).map(pixel).collect()
}

/// Twin of `is_occluded` in reuse.wgsl: whether one of four walls is in the way.
fn is_occluded(origin: Vec3, direction: Vec3, max_dist: f32, walls: f32) -> bool {
    (0..4).map(|i| 4.0 * i as f32 - 6.0).any(|z| {
        let to_low = (Vec3::new(-9.0, walls, z - 0.1) - origin) / direction;
        let to_high = (Vec3::new(9.0, walls + 4.0, z + 0.1) - origin) / direction;
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
        let adapter = gpu::find_adapter(None)?;
        let (device, queue) = gpu::open_device(&adapter, wgpu::Features::empty(), wgpu::Limits::default())?;
        let lights = GpuLights::with_options(&device, &queue, GpuOptions::default().with_previous())?;
        let shader = lights.shader(1, Effects::all());
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
            bind_group_layouts: &[Some(&own), Some(&shader.layout)],
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
        let kept =
            buffer((2 * KEPT * size_of::<Kept>()) as u64, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC);
        let frame = buffer(size_of::<Frame>() as u64, wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST);
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

    /// Draws a frame in all ways.
    fn draw(&mut self, world: &mut LightWorld, change: Change, number: u32) -> Result<Vec<Kept>, Box<dyn Error>> {
        let frames = [number, number.saturating_sub(1)];
        let is_even = number.is_multiple_of(2);
        let frame = Frame {
            number,
            pixels_per_edge: EDGE,
            candidates: self.candidates,
            first_then: if is_even { KEPT as u32 } else { 0 },
            camera: frames.map(|frame| change.camera(frame)),
            walls: frames.map(|frame| change.walls(frame)),
            variants: VARIANTS,
        };
        self.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&frame));
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.lights.sync(world, FrameBudget::default(), &mut encoder)?;
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.group, &[]);
        pass.set_bind_group(1, self.lights.bind_group(), &[]);
        pass.dispatch_workgroups(EDGE * EDGE * PICTURES / 64, VARIANTS.len() as u32, 1);
        drop(pass);
        self.queue.submit([encoder.finish()]);
        let mut kept = gpu::read(&self.device, &self.queue, &self.kept)?;
        Ok(if is_even { kept[..KEPT].to_vec() } else { kept.split_off(KEPT) })
    }
}

/// What was drawn in one way.
#[derive(Default)]
struct Drawn {
    /// The sum of the squared relative errors of pixels.
    squares: f64,
    /// The sum of each pixel of each picture over all frames.
    sums: Vec<f64>,
}

impl Drawn {
    /// The sum over a picture, as a mean over pictures, and its standard error. Pictures are independent; frames and
    /// neighbours are not.
    fn sum(&self) -> (f64, f64) {
        let pictures = f64::from(PICTURES);
        let sums: Vec<f64> = self.sums.chunks((EDGE * EDGE) as usize).map(|picture| picture.iter().sum()).collect();
        let mean = sums.iter().sum::<f64>() / pictures;
        let variance = sums.iter().map(|sum| (sum - mean).powi(2)).sum::<f64>() / (pictures * (pictures - 1.0));
        (mean, variance.sqrt())
    }
}

/// Draws a scene in all ways. Also returns the sum of a picture's pixels and frames as sums over all lights.
fn draw(candidates: u32, change: Change) -> Result<([Drawn; VARIANTS.len()], f64), Box<dyn Error>> {
    let mut renderer = Renderer::new(candidates)?;
    let mut scene = Scene::new()?;
    let mut drawn: [Drawn; VARIANTS.len()] = std::array::from_fn(|_| Drawn::default());
    let mut exact = 0.0;
    for frame in 0..FRAMES {
        if let Change::Lights(count) = change {
            scene.change(frame, count)?;
        }
        let kept = renderer.draw(&mut scene.world, change, frame)?;
        let truth = summed(&scene.world, change, frame);
        exact += truth.iter().map(|lux| f64::from(*lux)).sum::<f64>();
        for (drawn, kept) in drawn.iter_mut().zip(kept.chunks(truth.len() * PICTURES as usize)) {
            drawn.sums.resize(kept.len(), 0.0);
            for (i, kept) in kept.iter().enumerate() {
                let lux = kept.reflected * kept.weight;
                drawn.sums[i] += f64::from(lux);
                if frame >= FIRST {
                    drawn.squares += f64::from(lux / truth[i % truth.len()] - 1.0).powi(2);
                }
            }
        }
    }
    Ok((drawn, exact))
}

fn run() -> Result<(), Box<dyn Error>> {
    let candidates = std::env::args().nth(1).map_or(Ok(1), |text| text.parse())?;
    let mut failures = Vec::new();
    testbed::say!(
        "| what changes | cap | neighbours | rays of the last frame | relMSE of a pixel | mean | its error |"
    );
    testbed::say!("|---|---:|---:|---|---:|---:|---:|");
    for (name, change) in SCENES {
        let (all, exact) = draw(candidates, change)?;
        for (drawn, Variant { cap, neighbours, rays_then, .. }) in all.iter().zip(VARIANTS) {
            let squares = drawn.squares / f64::from((FRAMES - FIRST) * EDGE * EDGE * PICTURES);
            let (mean, error) = drawn.sum();
            let (mean, error) = (mean / exact, error / exact);
            let rays = RAYS[rays_then as usize];
            let line = format!("| {name} | {cap} | {neighbours} | {rays} | {squares:.3} | {mean:.4} | {error:.4} |");
            testbed::say!("{line}");
            // Without the scene of the last frame, shares are those of other shadows than reservoirs have seen.
            let has_shadows_that_move = !matches!(change, Change::Nothing | Change::Camera);
            let is_biased = rays_then == 2 || rays_then == 1 && has_shadows_that_move;
            // A false alarm in one of a hundred runs: 25 means of 32 pictures.
            if !is_biased && (mean - 1.0).abs() > 4.0 * error {
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
