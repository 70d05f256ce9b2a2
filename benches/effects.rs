//! What the code for each effect costs a sample in a world without effects.
//!
//! The bench times the variants of the sampling kernel in a world of points in rotated and translated
//! instances. Before anything is timed, all must give the samples of the variant without effects.
//!
//! `cargo bench --bench effects` prints a table. As a test (`cargo test --benches`), some of the
//! kernels sample a small world once, and no times are printed.

#![allow(clippy::print_stdout, reason = "a table is what this program is for")]

use std::time::{Duration, Instant};

use girandole::glam::{DVec3, Mat3, Quat, Vec3};
use girandole::gpu::GpuLights;
use girandole::{Effects, FrameBudget, Light, LightTree, LightWorld, Placement, Policy, WorldError, wgpu};
use testbed::common::batch::{self, SampleRecord, SampleRequest};

use testbed::common::gpu;
use testbed::testing::support::Rng;

/// Relative difference of products of some twenty terms that are taken in different orders.
const ROUNDING: f32 = 1.0e-5;
/// One sample in so many may name another light: where a random number falls within rounding of the
/// border between two lights, another variant may choose the other one.
const SAMPLES_PER_MISMATCH: usize = 1000;
/// Invocations of a workgroup in all kernels.
const LANES: u32 = 64;

/// How much is measured.
struct Size {
    instances: u32,
    shading_points: u32,
    /// Each round times all kernels once, in a new order.
    rounds: usize,
    /// No round begins after this.
    time: Duration,
}

/// A kernel, the buffers that it reads, and its times.
struct Case {
    name: &'static str,
    pipeline: wgpu::ComputePipeline,
    /// The time of each round.
    seconds: Vec<f64>,
}

fn main() {
    let is_bench = std::env::args().any(|a| a == "--bench");
    let machine = Machine::open();
    let shading_points = if machine.info.device_type == wgpu::DeviceType::Cpu { 1 << 11 } else { 1 << 20 };
    let size = match is_bench {
        true => Size { instances: 4000, shading_points, rounds: 1001, time: Duration::from_secs(60) },
        false => Size { instances: 40, shading_points: 1 << 10, rounds: 1, time: Duration::ZERO },
    };

    let lights = bare_world(&machine, size.instances).expect("a world of valid lights");
    let own = batch::in_and_out(&machine.device);
    let mut cases = cases(&machine, &lights, &own, is_bench);
    let requests = requests(size.shading_points);
    let input = machine.storage(size_of_val(&requests[..]) as u64);
    machine.queue.write_buffer(&input, 0, bytemuck::cast_slice(&requests));
    let output = machine.storage(u64::from(size.shading_points) * size_of::<SampleRecord>() as u64);
    let group = bind(&machine.device, &own, [&input, &output]);

    let mut bare_samples = Vec::new();
    for case in &cases {
        machine.time(case, &lights, &group, size.shading_points);
        let samples: Vec<SampleRecord> = machine.read(&output);
        if bare_samples.is_empty() {
            assert!(
                samples.iter().filter(|s| s.pmf > 0.0).count() > samples.len() / 2,
                "most shading points have a light"
            );
            bare_samples = samples;
        } else {
            assert_alike(&samples, &bare_samples, case.name);
        }
    }

    let start = Instant::now();
    let mut rng = Rng(20);
    let mut order: Vec<usize> = (0..cases.len()).collect();
    for _ in 0..size.rounds {
        for i in (1..order.len()).rev() {
            order.swap(i, (rng.bits() % (i as u64 + 1)) as usize);
        }
        for at in order.iter().copied() {
            // A first run warms the caches: right after itself, a kernel is up to 5 % faster than
            // after another one.
            machine.time(&cases[at], &lights, &group, size.shading_points);
            let seconds = machine.time(&cases[at], &lights, &group, size.shading_points);
            cases[at].seconds.push(seconds);
        }
        if start.elapsed() > size.time {
            break;
        }
    }
    if is_bench {
        report(&machine, &size, &cases);
    }
}

/// The lights of a world without effects.
fn bare_world(machine: &Machine, instances: u32) -> Result<GpuLights, WorldError> {
    let mut rng = Rng(18);
    let mut world = LightWorld::new();
    let mut trees = Vec::new();
    for _ in 0..instances.div_ceil(40) {
        let count = 10 + rng.bits() % 31;
        let mut lamp = || Light::point(rng.position(4.0), Vec3::splat(rng.between(10.0, 1000.0)));
        trees.push(world.add_tree(LightTree::new((0..count).map(|_| lamp()).collect())?));
    }
    // The density does not depend on the number of instances, and is that of a town.
    let side = 8.0 * (instances as f32).sqrt();
    for i in 0..instances as usize {
        let turn = Mat3::from_quat(Quat::from_axis_angle(rng.direction(), rng.between(0.0, 6.0)));
        let Vec3 { x, z, .. } = rng.position(0.5 * side);
        let translation = DVec3::new(f64::from(x), f64::from(rng.between(5.0, 30.0)), f64::from(z));
        world.add_instance(trees[i % trees.len()], Placement { linear: turn, translation }, Policy::Static)?;
    }
    // Updates divide trees among leaves of the top level.
    world.update(FrameBudget::UNLIMITED);
    Ok(upload(machine, &world))
}

fn upload(machine: &Machine, world: &LightWorld) -> GpuLights {
    let mut lights = GpuLights::new(&machine.device, &machine.queue).expect("WebGPU's default limits");
    lights.upload(world).expect("room enough");
    assert_eq!(lights.effects(), Effects::empty());
    let mut encoder = machine.device.create_command_encoder(&Default::default());
    lights.build_top(&mut encoder);
    machine.queue.submit([encoder.finish()]);
    lights
}

/// Shading points on the ground and in the air among the instances.
fn requests(count: u32) -> Vec<SampleRequest> {
    let mut rng = Rng(19);
    let mut request = || {
        let Vec3 { x, z, .. } = rng.position(200.0);
        let in_air = rng.bits().is_multiple_of(8);
        SampleRequest {
            position: [x, if in_air { rng.between(1.0, 20.0) } else { 0.0 }, z],
            normal: if in_air { [0.0; 3] } else { Vec3::new(0.1, 1.0, 0.2).normalize().to_array() },
            u: [(); 4].map(|()| rng.unit()),
            ..SampleRequest::default()
        }
    };
    (0..count).map(|_| request()).collect()
}

/// All kernels; the one without effects is first.
fn cases(machine: &Machine, lights: &GpuLights, own: &wgpu::BindGroupLayout, is_bench: bool) -> Vec<Case> {
    let none = lights.shader(0, Effects::empty());
    let batch = |effects: Effects| {
        let stage = batch::STAGE;
        let text = none.with_effects(effects).join(stage);
        machine.pipeline(lights, own, &text, "batch")
    };
    let case = |name, pipeline: &wgpu::ComputePipeline| Case { name, pipeline: pipeline.clone(), seconds: Vec::new() };
    let [bare, all] = [Effects::empty(), Effects::all()].map(batch);
    let mut cases = vec![case("no effect", &bare), case("no effect, once more", &bare)];
    if is_bench {
        let effects = [
            ("`CONES`", Effects::CONES),
            ("`RANGES`", Effects::RANGES),
            ("`AREAS`", Effects::AREAS),
            ("`AREAS` and `SOLID_ANGLES`", Effects::AREAS | Effects::SOLID_ANGLES),
            ("`DIRECTIONAL`", Effects::DIRECTIONAL),
            ("`NON_RIGID`", Effects::NON_RIGID),
            ("`GLOSSY`", Effects::GLOSSY),
            ("`FACTORS`", Effects::FACTORS),
            ("`MASKS`", Effects::MASKS),
        ];
        cases.extend(effects.map(|(name, effects)| case(name, &batch(effects))));
    }
    cases.push(case("all effects", &all));
    cases
}

fn assert_alike(samples: &[SampleRecord], bare: &[SampleRecord], name: &str) {
    let mut mismatches = 0;
    for (i, (ours, theirs)) in samples.iter().zip(bare).enumerate() {
        if (ours.instance, ours.light) != (theirs.instance, theirs.light) {
            mismatches += 1;
            continue;
        }
        let values = |s: &SampleRecord| {
            let ([a, b, c], [d, e, f]) = (s.direction, s.radiance);
            [a, b, c, s.dist, d, e, f, s.pdf, s.pmf]
        };
        // The difference is relative to the length of the direction, and to the value itself
        // otherwise.
        let scales = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        for ((a, b), scale) in values(ours).into_iter().zip(values(theirs)).zip(scales) {
            assert!((a - b).abs() <= ROUNDING * f32::max(b.abs(), scale), "{name}, {i}: {ours:?} is not {theirs:?}");
        }
        assert_eq!(ours.is_delta, theirs.is_delta, "{name}, {i}");
    }
    let allowed = samples.len() / SAMPLES_PER_MISMATCH;
    assert!(mismatches <= allowed, "{name}: {mismatches} of {} samples chose another light", samples.len());
}

fn report(machine: &Machine, size: &Size, cases: &[Case]) {
    println!("{} ({}), by {}.", machine.info.name, machine.info.driver_info, machine.timing());
    let rounds = cases[0].seconds.len();
    println!("{} instances, {} shading points, {rounds} rounds.\n", size.instances, size.shading_points);
    println!("| code for | ns per sample | relative to no effect | fastest | relative to no effect |");
    println!("|---|---:|---:|---:|---:|");
    let fastest_bare = quarters(&cases[0].seconds)[0];
    for case in cases {
        let [fastest, low, middle, high, _] =
            quarters(&case.seconds).map(|seconds| seconds * 1e9 / f64::from(size.shading_points));
        // Ratios are taken within a round: other work of the machine slows all kernels.
        let ratios: Vec<f64> = case.seconds.iter().zip(&cases[0].seconds).map(|(ours, theirs)| ours / theirs).collect();
        let [_, ratio_low, ratio, ratio_high, _] = quarters(&ratios);
        let of_fastest = quarters(&case.seconds)[0] / fastest_bare;
        println!(
            "| {} | {middle:.0} ({low:.0} – {high:.0}) | {ratio:.3} ({ratio_low:.3} – {ratio_high:.3}) | {fastest:.0} | {of_fastest:.3} |",
            case.name,
        );
    }
}

/// The minimum, the lower quartile, the median, the upper quartile and the maximum.
fn quarters(values: &[f64]) -> [f64; 5] {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    std::array::from_fn(|quarter| sorted[(sorted.len() - 1) * quarter / 4])
}

fn bind(device: &wgpu::Device, layout: &wgpu::BindGroupLayout, buffers: [&wgpu::Buffer; 2]) -> wgpu::BindGroup {
    let entry = |i: usize| wgpu::BindGroupEntry { binding: i as u32, resource: buffers[i].as_entire_binding() };
    let entries = [entry(0), entry(1)];
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
}

/// A device, and the way in which it is timed.
struct Machine {
    device: wgpu::Device,
    queue: wgpu::Queue,
    info: wgpu::AdapterInfo,
    /// Two timestamps; `None` if the device has none.
    queries: Option<wgpu::QuerySet>,
}

impl Machine {
    fn open() -> Self {
        let adapter = gpu::find_adapter(None).expect("an adapter; scripts/test.sh installs a software one");
        let required_features = adapter.features() & wgpu::Features::TIMESTAMP_QUERY;
        let (device, queue) =
            gpu::open_device(&adapter, required_features, wgpu::Limits::default()).expect("default limits");
        let queries = (!required_features.is_empty()).then(|| {
            device.create_query_set(&wgpu::QuerySetDescriptor { label: None, ty: wgpu::QueryType::Timestamp, count: 2 })
        });
        Self { device, queue, info: adapter.get_info(), queries }
    }

    fn timing(&self) -> &'static str {
        if self.queries.is_some() { "timestamps of compute passes" } else { "wall time of submission and wait" }
    }

    fn storage(&self, size: u64) -> wgpu::Buffer {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        self.device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
    }

    /// Compiles a kernel as `GpuLights::sample` compiles its own.
    fn pipeline(
        &self,
        lights: &GpuLights,
        own: &wgpu::BindGroupLayout,
        text: &str,
        entry: &str,
    ) -> wgpu::ComputePipeline {
        let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(entry),
            source: wgpu::ShaderSource::Wgsl(text.into()),
        });
        let layout = self.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(entry),
            bind_group_layouts: &[Some(lights.bind_group_layout()), Some(own)],
            ..Default::default()
        });
        self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(entry),
            layout: Some(&layout),
            module: &module,
            entry_point: Some(entry),
            compilation_options: Default::default(),
            cache: None,
        })
    }

    /// The seconds that a kernel takes for all shading points.
    fn time(&self, case: &Case, lights: &GpuLights, group: &wgpu::BindGroup, shading_points: u32) -> f64 {
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let timestamp_writes = self.queries.as_ref().map(|query_set| wgpu::ComputePassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(0),
            end_of_pass_write_index: Some(1),
        });
        let mut pass =
            encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(case.name), timestamp_writes });
        pass.set_pipeline(&case.pipeline);
        pass.set_bind_group(0, lights.bind_group(), &[]);
        pass.set_bind_group(1, group, &[]);
        pass.dispatch_workgroups(shading_points.div_ceil(LANES), 1, 1);
        drop(pass);
        let ticks = self.queries.as_ref().map(|queries| {
            let usage = wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC;
            let descriptor = wgpu::BufferDescriptor { label: None, size: 16, usage, mapped_at_creation: false };
            let ticks = self.device.create_buffer(&descriptor);
            encoder.resolve_query_set(queries, 0..2, &ticks, 0);
            ticks
        });
        let start = Instant::now();
        self.queue.submit([encoder.finish()]);
        self.wait();
        let wall = start.elapsed().as_secs_f64();
        ticks.map_or(wall, |ticks| {
            let ticks: Vec<u64> = self.read(&ticks);
            ticks[1].saturating_sub(ticks[0]) as f64 * f64::from(self.queue.get_timestamp_period()) * 1e-9
        })
    }

    fn wait(&self) {
        gpu::wait(&self.device).expect("the device finishes its work");
    }

    fn read<T: bytemuck::Pod>(&self, buffer: &wgpu::Buffer) -> Vec<T> {
        gpu::read(&self.device, &self.queue, buffer).expect("the device finishes its work and the buffer maps")
    }
}
