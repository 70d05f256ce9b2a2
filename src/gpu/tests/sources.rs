//! Lights that a kernel writes, and the refit of their trees: the nodes of the CPU's refit.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Mat3, Vec3};
use wgpu::util::DeviceExt;

use crate::cluster::cone::angle;
use crate::gpu::GpuLights;
use crate::gpu::bindings::{bind, storage_entry};
use crate::gpu::testing::{gpu, gpu_lights, random, random_vec, read, record_batch};
use crate::keys::slot_of;
use crate::light::UNLIMITED_RANGE;
use crate::plan::layout::{LightRecord, NODE_QUADS, TreeRecord};
use crate::plan::node_record::NodeRecord;
use crate::plan::sources::MeasureRecord;
use crate::plan::{BufferId, Command, LightPlanner, PlanLimits, Readback, ShaderBuffers};
use crate::scheduler::VirtualClock;
use crate::top::partition::MOST_PARTS;
use crate::tree::{LightTree, NO_LEAF, Node, WIDTH};
use crate::{Effects, FrameBudget, Light, LightWorld, Placement, Policy, ShadingPoint, TreeKey, TreeSource};
use testbed::common::batch::{SampleRecord, SampleRequest};

/// What the kernel of the tests writes to a light. A kind of 99 makes it dark.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Put {
    a: [f32; 3],
    kind: u32,
    b: [f32; 3],
    source: u32,
    c: [f32; 3],
    light: u32,
    emission: [f32; 3],
    is_new: u32,
}

const ENGINE: &str = "
    struct Put { a: vec3<f32>, kind: u32, b: vec3<f32>, source: u32, c: vec3<f32>, light: u32, emission: vec3<f32>, is_new: u32 }
    @group(0) @binding(0) var<storage, read> puts: array<Put>;
    @compute @workgroup_size(64) fn engine(@builtin(global_invocation_id) id: vec3<u32>) {
        if id.x >= arrayLength(&puts) { return; }
        let p = puts[id.x];
        if p.is_new != 0u { light_put_new(p.source, p.light); }
        switch p.kind {
            case 0u: { light_put_point(p.source, p.light, p.a, p.emission); }
            case 1u: { light_put_spot(p.source, p.light, p.a, p.b, p.emission); }
            case 2u: { light_put_rectangle(p.source, p.light, p.a, p.b, p.c, p.emission); }
            case 3u: { light_put_triangle(p.source, p.light, p.a, p.b, p.c, p.emission); }
            case 4u: { light_put_sphere(p.source, p.light, p.a, p.c.x, p.emission); }
            default: { light_put_dark(p.source, p.light); }
        }
    }";

impl Put {
    fn of(source: u32, light: u32, value: &Light) -> Self {
        let LightRecord { a, kind, b, c, emission, .. } = LightRecord::of(value, 0);
        Self { a, kind: kind & 0xff, b, source, c, light, emission, is_new: 0 }
    }
}

/// A kernel that writes lights: the text that an engine adds, and the layout of its own group 0.
fn source_pipeline(lights: &GpuLights, own: &wgpu::BindGroupLayout, text: &str) -> wgpu::ComputePipeline {
    let (device, _) = gpu();
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl((lights.source_shader(1) + text).into()),
    });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        bind_group_layouts: &[Some(own), Some(lights.source_layout())],
        ..Default::default()
    });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: Some(&layout),
        module: &module,
        entry_point: Some("engine"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    })
}

/// Runs such a kernel for so many lights, then builds the top level.
fn run_and_build(lights: &mut GpuLights, pipeline: &wgpu::ComputePipeline, group: &wgpu::BindGroup, count: u32) {
    let (device, queue) = gpu();
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, group, &[]);
        pass.set_bind_group(1, lights.source_group().expect("a tree with a source was sent"), &[]);
        pass.dispatch_workgroups(count.div_ceil(64), 1, 1);
    }
    lights.build_top(&mut encoder);
    queue.submit([encoder.finish()]);
}

/// Puts lights by the kernel, then builds the top level.
fn put(lights: &mut GpuLights, puts: &[Put]) {
    let (device, _) = gpu();
    let buffer = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: None,
        contents: bytemuck::cast_slice(puts),
        usage: wgpu::BufferUsages::STORAGE,
    });
    let own = device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &[storage_entry(0, true)] });
    let pipeline = source_pipeline(lights, &own, ENGINE);
    let group = bind(&device, "test", &own, &[&buffer]);
    run_and_build(lights, &pipeline, &group, puts.len() as u32);
}

/// A light of a kind, at a place and of a brightness that follow `salt`.
fn light(i: u32, salt: u32) -> Light {
    let at = 20.0 * random_vec(i, 7 * salt) + Vec3::splat(10.0 * random(i / 16, salt));
    let direction = random_vec(i, 3 + 7 * salt).normalize_or(Vec3::Y);
    let emission = Vec3::new(0.5, 1.0, 2.0) * (1.0 + 100.0 * random(i, 6 + salt).powi(4));
    let kind = i % 7;
    match kind {
        0 => Light::point(at, emission).with_range(1.0 + 50.0 * random(i, 7)),
        1 => Light::spot(at, direction, 0.01, 0.02 + 1.2 * random(i, 7), emission),
        2 => Light::rectangle(at, direction, direction.any_orthonormal_vector() * 0.3, emission),
        3 => Light::triangle([at, at + direction, at + random_vec(i, 8 + salt)], emission),
        4 => Light::triangle([at, at + direction, at + random_vec(i, 8 + salt)], emission).two_sided(),
        5 => Light::point(at, emission),
        _ => Light::sphere(at, 0.1 + random(i, 9 + salt), emission),
    }
}

fn lights_of(count: u32, salt: u32) -> Vec<Light> {
    (0..count).map(|i| light(i, salt)).collect()
}

/// A world with a tree of each size, each with one instance.
fn world_of(sizes: &[u32], placement: impl Fn(u32) -> Placement) -> (LightWorld, Vec<TreeKey>) {
    let mut world = LightWorld::new();
    let add = |(index, size): (u32, &u32)| {
        let tree = world.add_tree(LightTree::new(lights_of(*size, 1)).expect("valid lights"));
        world.add_instance(tree, placement(index), Policy::RefitOnly).expect("a valid instance");
        tree
    };
    let trees = (0..).zip(sizes).map(add).collect();
    world.update(FrameBudget::NONE);
    (world, trees)
}

/// Nodes as the GPU holds them, whose parents are not compared: what is above openings has another form there.
fn read_nodes(lights: &GpuLights, buffer: BufferId, range: Range<u32>) -> Vec<Node> {
    let (device, queue) = gpu();
    let stride = 16 * NODE_QUADS as usize;
    let bytes: Vec<u8> = read(&device, &queue, lights.player.buffer(buffer));
    let node = |index: u32| {
        let mut record = NodeRecord::of(&Node::EMPTY);
        let stored = &bytes[index as usize * stride..][..stride];
        bytemuck::bytes_of_mut(&mut record)[..stride].copy_from_slice(stored);
        record.node()
    };
    range.map(node).collect()
}

/// What the GPU holds of a tree: its nodes and the records of its parts.
fn read_tree(lights: &GpuLights, tree: TreeKey) -> (Vec<Node>, Vec<TreeRecord>, Vec<LightRecord>) {
    let (device, queue) = gpu();
    let (records, [nodes, of_lights, parts]) = lights.planner.tree_ranges(slot_of(tree));
    let ShaderBuffers([_, _, node_buffer, _, light_buffer]) = lights.planner.bindings().expect("sent");
    let buffer = |id: BufferId| lights.player.buffer(id);
    let slice = |range: &Range<u32>| range.start as usize..range.end as usize;
    let nodes = read_nodes(lights, node_buffer, nodes);
    let all: Vec<TreeRecord> = read(&device, &queue, buffer(records));
    let parts = all[slice(&parts)].to_vec();
    let all: Vec<LightRecord> = read(&device, &queue, buffer(light_buffer));
    (nodes, parts, all[slice(&of_lights)].to_vec())
}

/// Compares nodes of the GPU with those of a refit on the CPU. Boxes are extremes of the same numbers, so they
/// are equal bit for bit; sums are not.
fn assert_same_nodes(ours: &[Node], twin: &[Node]) {
    for (index, (a, b)) in ours.iter().zip(twin).enumerate() {
        assert_eq!((a.steps, a.origin, a.low, a.high), (b.steps, b.origin, b.low, b.high), "node {index}");
        assert_eq!((a.children, a.range), (b.children, b.range), "node {index}");
        for slot in 0..WIDTH {
            let near = |a: u8, b: u8, steps: u8| assert!(a.abs_diff(b) <= steps, "node {index}, {slot}: {ours:?}");
            assert!(a.flux[slot].abs_diff(b.flux[slot]) <= 1, "node {index}, {slot}");
            for k in 0..3 {
                near(a.mean[k][slot], b.mean[k][slot], 1);
                assert!(a.axis[k][slot].abs_diff(b.axis[k][slot]) <= 1, "node {index}, {slot}");
            }
            near(a.deviation[slot], b.deviation[slot], 1);
            near(a.shortness[slot], b.shortness[slot], 1);
            near(a.cap[slot], b.cap[slot], 2);
            let code = |node: &Node| (node.area_ratios >> (4 * slot) & 15) as u8;
            near(code(a), code(b), 1);
            assert_eq!([0, 15].contains(&code(a)), [0, 15].contains(&code(b)), "node {index}, {slot}");
        }
    }
}

/// Checks that the nodes above each light bound it.
fn assert_bounds_hold(nodes: &[Node], tree: &LightTree, lights: &[Light]) {
    for (light, leaf) in lights.iter().zip(tree.leaves()).filter(|(light, _)| light.flux() > 0.0) {
        let mut place = *leaf;
        assert_ne!(place, NO_LEAF);
        while let Some(node) = nodes.get(place as usize / WIDTH) {
            let cluster = node.cluster(place as usize % WIDTH);
            assert!(cluster.flux > 0.0 && cluster.aabb.contains(&light.aabb()), "{light:?} {cluster:?}");
            assert!(cluster.range >= light.range.min(UNLIMITED_RANGE));
            let (cone, outer) = (light.emission_cone(), cluster.cos_half_angle.acos());
            let reach = angle(cluster.axis.normalize_or(Vec3::Z), cone.axis) + cone.half_angle;
            assert!(cluster.cos_half_angle <= -1.0 || reach <= outer, "{light:?} {cluster:?}");
            // The places above openings have another form on the GPU.
            place = tree.nodes()[place as usize / WIDTH].parent;
        }
    }
}

/// The measures of the first sources.
fn read_measures(lights: &GpuLights, count: u32) -> Vec<MeasureRecord> {
    let (device, queue) = gpu();
    let Readback { buffer, offset, bytes, .. } = lights.planner.measures(0, count).expect("sources");
    assert_eq!((offset, bytes), (0, 32 * u64::from(count)));
    read(&device, &queue, lights.player.buffer(buffer))
}

fn close(a: f32, b: f32, scale: f32) -> bool {
    (a - b).abs() <= 1.0e-5 * scale
}

#[test]
fn a_refit_on_the_gpu_makes_the_nodes_of_a_refit_on_the_cpu() {
    let sizes = [1, 7, 9, 60, 700, 9_000, 3];
    let squashed = Mat3::from_diagonal(Vec3::new(0.02, 1.0, 3.0));
    let placement = |index: u32| Placement {
        linear: if index == 4 { squashed } else { Mat3::IDENTITY },
        translation: DVec3::X * 300.0 * f64::from(index),
    };
    let (mut world, trees) = world_of(&sizes, placement);
    let (mut twin, twins) = world_of(&sizes, placement);
    trees.iter().for_each(|tree| world.set_light_source(*tree, TreeSource::GpuMesh).expect("no profiles"));
    let mut lights = gpu_lights();
    lights.upload(&world).expect("room");
    let mut puts = Vec::new();
    for (tree, (other, size)) in trees.iter().zip(twins.iter().zip(sizes)) {
        let mut moved = lights_of(size, 2);
        moved.iter_mut().skip(5).step_by(11).for_each(|light| light.emission = Vec3::ZERO);
        let (source, number) = world.light_source(*tree).expect("set");
        assert_eq!(source, TreeSource::GpuMesh);
        puts.extend((0..).zip(&moved).map(|(index, light)| Put::of(number, index, light)));
        twin.set_light_range(*other, 0, &moved).expect("valid");
    }
    twin.update(FrameBudget::NONE);
    put(&mut lights, &puts);
    for (tree, other) in trees.iter().zip(&twins) {
        let (nodes, parts, _) = read_tree(&lights, *tree);
        let expected = twin.tree(*other).expect("live");
        assert_eq!(nodes.len(), expected.nodes().len());
        assert_same_nodes(&nodes, expected.nodes());
        assert_bounds_hold(&nodes, expected, expected.lights());
        if let [part] = parts[..] {
            let (ours, all) = (part.cluster, expected.cluster());
            assert!(close(ours.flux, all.flux, all.flux), "{ours:?} {all:?}");
            assert!(
                close(part.area_flux, all.area_flux, all.flux)
                    && close(part.punctual_flux, all.punctual_flux, all.flux)
            );
            assert_eq!((ours.box_min, ours.box_max), (all.aabb.min.to_array(), all.aabb.max.to_array()));
            assert!(
                (Vec3::from(ours.mean) - all.mean).length() < 1.0e-3
                    && close(ours.variance, all.variance, all.variance)
            );
            assert!((Vec3::from(ours.axis) - all.axis).length() < 1.0e-4);
        }
    }
}

#[test]
fn values_that_the_cpu_would_refuse_make_a_light_dark_and_nothing_else() {
    let (mut world, trees) = world_of(&[300], |_| Placement::IDENTITY);
    world.set_light_source(trees[0], TreeSource::GpuMesh).expect("no profiles");
    let mut lights = gpu_lights();
    lights.upload(&world).expect("room");
    let mut moved = lights_of(300, 2);
    let mut puts: Vec<Put> = (0..).zip(&moved).map(|(index, light)| Put::of(0, index, light)).collect();
    let bad = |puts: &mut [Put], i: usize| match i % 8 {
        0 => puts[i].a[1] = f32::NAN,
        1 => puts[i].emission[2] = f32::INFINITY,
        2 => puts[i].emission[0] = -1.0e-3,
        3 => puts[i].a[0] = -1.1e9,
        4 => puts[i].kind = (puts[i].kind + 1) % 5,
        5 => puts[i].emission[1] = f32::from_bits(0xffc0_0001),
        6 => puts[i].a[2] = f32::NEG_INFINITY,
        _ => puts[i].emission[0] = 1.0e16,
    };
    let refused: Vec<usize> = (0..300).filter(|i| i % 3 == 1).collect();
    for i in &refused {
        bad(&mut puts, *i);
        // It is dark, wherever it was before.
        moved[*i] = world.tree(trees[0]).expect("live").lights()[*i].with_emission(Vec3::ZERO);
    }
    // A sphere of negative radius, a spot that is not of unit length, lights and sources that are not there.
    let sphere = (0..300).find(|i| i % 7 == 6 && i % 3 != 1).expect("one");
    let spot = (0..300).find(|i| i % 7 == 1 && i % 3 != 1).expect("one");
    (puts[sphere].c[0], puts[spot].b) = (-0.5, [0.0, 0.9, 0.0]);
    for i in [sphere, spot] {
        moved[i] = world.tree(trees[0]).expect("live").lights()[i].with_emission(Vec3::ZERO);
    }
    puts.push(Put { light: 300, ..puts[0] });
    puts.push(Put { light: u32::MAX, ..puts[0] });
    puts.push(Put { source: 1, ..puts[0] });
    puts.push(Put { source: u32::MAX, ..puts[0] });
    put(&mut lights, &puts);
    let (nodes, _, records) = read_tree(&lights, trees[0]);
    let mut twin = world.tree(trees[0]).expect("live").clone();
    let changes: Vec<_> = (0..).zip(moved.iter().copied()).collect();
    twin.set_lights(&changes).expect("valid");
    twin.refit();
    assert_same_nodes(&nodes, twin.nodes());
    assert_bounds_hold(&nodes, &twin, &moved);
    for i in refused.iter().chain([&sphere, &spot]) {
        assert_eq!(records[*i].emission, [0.0; 3], "light {i}");
    }
    let measures = read_measures(&lights, trees.len() as u32);
    assert_eq!(measures[0].refused as usize, refused.len() + 2);
    // Sound values shine again.
    let puts: Vec<Put> = (0..).zip(&lights_of(300, 2)).map(|(index, light)| Put::of(0, index, light)).collect();
    lights.upload(&world).expect("room");
    put(&mut lights, &puts);
    let (_, _, records) = read_tree(&lights, trees[0]);
    assert!(records.iter().all(|record| record.emission[1] > 0.0));
}

#[test]
fn measures_are_the_attributes_of_a_refit_on_the_cpu() {
    let sizes = [1, 40, 2_000];
    let (mut world, trees) = world_of(&sizes, |index| Placement::at(DVec3::X * 200.0 * f64::from(index)));
    trees.iter().for_each(|tree| world.set_light_source(*tree, TreeSource::GpuMesh).expect("no profiles"));
    let mut lights = gpu_lights();
    lights.upload(&world).expect("room");
    let mut puts = Vec::new();
    let mut twins = Vec::new();
    for (source, (tree, size)) in (0..).zip(trees.iter().zip(sizes)) {
        let moved = lights_of(size, 2);
        puts.extend((0..).zip(&moved).map(|(index, light)| Put::of(source, index, light)));
        let mut twin = world.tree(*tree).expect("live").clone();
        twin.set_lights(&(0..).zip(moved).collect::<Vec<_>>()).expect("valid");
        twin.refit();
        twins.push(twin);
    }
    put(&mut lights, &puts);
    for (measure, twin) in read_measures(&lights, trees.len() as u32).iter().zip(&twins) {
        let expected = twin.attributes();
        let expected = [expected.distance, expected.overlap, expected.variance, expected.splitting_cost];
        for (ours, expected) in measure.attributes.iter().zip(expected) {
            assert!((ours - expected).abs() <= 1.0e-4 * expected, "{measure:?} {expected:?}");
        }
        let all = twin.cluster();
        let spread = all.aabb.extent().length_squared() / all.variance;
        assert!((measure.spread - spread).abs() <= 1.0e-4 * spread || !spread.is_finite(), "{measure:?} {spread}");
        assert!((measure.axis_length - all.axis.length()).abs() < 1.0e-4 && close(measure.flux, all.flux, all.flux));
    }
}

/// The estimates of the illuminance at a point by GPU samples, and the sum over all lights.
fn mean_and_sum(lights: &mut GpuLights, world: &LightWorld, all: &LightWorld) -> ([f64; 2], f64) {
    let (device, queue) = gpu();
    let at = ShadingPoint::surface(Vec3::new(3.0, -30.0, 4.0), Vec3::Y);
    let count = 1 << 16;
    let requests: Vec<_> = (0..count)
        .map(|i| SampleRequest {
            position: at.position.to_array(),
            normal: at.normal.to_array(),
            u: [40, 41, 42, 43].map(|salt| random(i, salt)),
            ..SampleRequest::default()
        })
        .collect();
    let (encoder, output) = record_batch(lights, &requests, world.effects());
    queue.submit([encoder.finish()]);
    let samples: Vec<SampleRecord> = read(&device, &queue, &output);
    let estimate = |s: &SampleRecord| match s.pmf > 0.0 {
        true => f64::from(s.radiance[1] * s.direction[1].max(0.0)) / (f64::from(s.pmf) * f64::from(s.pdf)),
        false => 0.0,
    };
    let n = f64::from(count);
    let mean = samples.iter().map(estimate).sum::<f64>() / n;
    let variance = samples.iter().map(|s| (estimate(s) - mean).powi(2)).sum::<f64>() / (n - 1.0);
    // The reference takes the lights one by one, with many points on each.
    let sampler = all.sampler();
    let mut sum = 0.0;
    for instance in all.instances() {
        let lights = all.tree(all.instance(instance).expect("live").tree).expect("live").lights().len() as u32;
        for light in 0..lights {
            let id = crate::LightId::Local { instance, light };
            let points = 256;
            let at_point = |i: u32| {
                let u = [(i as f32 + 0.5) / points as f32, (i as f32 * 0.618_034).fract()];
                sampler.sample_light(&at, id, u).map_or(0.0, |incident| {
                    f64::from(incident.radiance.y * incident.direction.y.max(0.0)) / f64::from(incident.pdf)
                })
            };
            sum += (0..points).map(at_point).sum::<f64>() / f64::from(points);
        }
    }
    ([mean, (variance / n).sqrt()], sum)
}

#[test]
fn samples_of_lights_that_kernels_write_have_the_mean_of_the_sum() {
    // Buffers of any size, and of a size in which not all particles can be parts: the large tree is whole then.
    let [large, small] = [PlanLimits::default(), PlanLimits::new(0)];
    for (source, limits) in
        [(TreeSource::GpuMesh, large), (TreeSource::GpuParticles, large), (TreeSource::GpuParticles, small)]
    {
        let sizes = [1500, 90];
        let placement = |index: u32| Placement::at(DVec3::X * 30.0 * f64::from(index));
        let (mut world, trees) = world_of(&sizes, placement);
        let (mut twin, twins) = world_of(&sizes, placement);
        trees.iter().for_each(|tree| world.set_light_source(*tree, source).expect("no profiles"));
        world.update(FrameBudget::NONE);
        let mut lights = gpu_lights();
        lights.planner = LightPlanner::new(limits);
        let report = lights.upload(&world).expect("room");
        assert_eq!(report.held_back_instances, usize::from(limits == small));
        let mut puts = Vec::new();
        for (number, (tree, size)) in (0..).zip(twins.iter().zip(sizes)) {
            let moved = lights_of(size, 2);
            puts.extend((0..).zip(&moved).map(|(index, light)| Put::of(number, index, light)));
            twin.set_light_range(*tree, 0, &moved).expect("valid");
        }
        twin.update(FrameBudget::NONE);
        put(&mut lights, &puts);
        let ([mean, error], sum) = mean_and_sum(&mut lights, &world, &twin);
        // A false alarm in about 16,000 runs with other seeds.
        assert!(
            (mean - sum).abs() < 4.0 * error,
            "{source:?}: {mean} of {sum}, off by {} errors",
            (mean - sum) / error
        );
        assert!(error < 0.01 * sum, "{source:?}: {error} of {sum}");
    }
}

/// The dispatches of refits in the last build.
fn refits(lights: &GpuLights) -> usize {
    let is_refit =
        |command: &Command<'_>| matches!(command, Command::Dispatch { kernel, .. } if kernel.stage() == "refit");
    lights.top.iter().filter(is_refit).count()
}

#[test]
fn a_frame_in_which_nothing_changes_on_the_cpu_refits_and_sends_nothing() {
    let (mut world, trees) = world_of(&[700, 40], |_| Placement::IDENTITY);
    let mut lights = gpu_lights();
    lights.upload(&world).expect("room");
    assert!(refits(&lights) == 0 && lights.source_group().is_none(), "no source yet");
    trees.iter().for_each(|tree| world.set_light_source(*tree, TreeSource::GpuMesh).expect("no profiles"));
    assert!(lights.upload(&world).expect("room").bytes > 0);
    for _ in 0..3 {
        assert_eq!(lights.upload(&world).expect("room").bytes, 0);
        // The passes of the pieces, and one for the records.
        assert!((2..=8).contains(&refits(&lights)), "{} dispatches", refits(&lights));
    }
    // The CPU writes again.
    trees.iter().for_each(|tree| world.set_light_source(*tree, TreeSource::Cpu).expect("no profiles"));
    lights.upload(&world).expect("room");
    assert_eq!(refits(&lights), 0);
}

#[test]
fn a_particle_that_is_born_where_another_died_is_another_light() {
    let lamps = |salt| (0..64).map(|i| Light::point(9.0 * random_vec(i, salt), Vec3::ONE)).collect::<Vec<_>>();
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(lamps(1)).expect("valid"));
    world.add_instance(tree, Placement::IDENTITY, Policy::RefitOnly).expect("valid");
    world.set_light_source(tree, TreeSource::GpuParticles).expect("no profiles");
    world.update(FrameBudget::NONE);
    assert_eq!(world.effects(), Effects::empty());
    let mut lights = gpu_lights();
    lights.upload(&world).expect("room");
    let (device, queue) = gpu();
    let births = |lights: &GpuLights| -> Vec<u32> {
        let (_, [_, range, _]) = lights.planner.tree_ranges(slot_of(tree));
        let ShaderBuffers([.., buffer]) = lights.planner.bindings().expect("sent");
        let words: Vec<[u32; 16]> = read(&device, &queue, lights.player.buffer(buffer));
        words[range.start as usize..range.end as usize].iter().map(|record| record[3]).collect()
    };
    let before = births(&lights);
    let mut puts: Vec<Put> = (0..).zip(&lamps(2)).map(|(index, light)| Put::of(0, index, light)).collect();
    puts[10].is_new = 1;
    (puts[11].is_new, puts[11].kind) = (1, 99);
    put(&mut lights, &puts);
    let after = births(&lights);
    for i in 0..64 {
        assert_eq!(before[i] != after[i], i == 10 || i == 11, "{i}");
    }
}

#[test]
fn a_film_that_only_the_gpu_has_lights_the_parts_of_a_screen_as_on_the_cpu() {
    let (width, height) = (64_u32, 32_u32);
    let texel = |i: u32| Vec3::new(random(i, 60), random(i, 61), random(i, 62)).powf(4.0);
    let texels: Vec<Vec3> = (0..width * height).map(texel).collect();
    // Parts of 8 x 8 texels, and every other one of 4 x 4.
    let corners =
        |size: u32| (0..width * height / (size * size)).map(move |i| [i % (width / size), i / (width / size), size]);
    let is_cut = |x: u32, y: u32| (x + y).is_multiple_of(2);
    let large = corners(8).filter(|[x, y, _]| !is_cut(*x, *y));
    let small = corners(4).filter(|[x, y, _]| is_cut(x / 2, y / 2));
    let part = |[x, y, size]: [u32; 3]| {
        let at = |i: u32| texels[((y * size + i / size) * width + x * size + i % size) as usize];
        let mean = (0..size * size).map(at).sum::<Vec3>() / (size * size) as f32;
        let [half, scale] = [0.5 * size as f32, 8.0 / width as f32];
        let [right, up] = [(x * size) as f32 + half, height as f32 - (y * size) as f32 - half].map(|at| at * scale);
        let center = Vec3::new(-3.0 + right, 1.0 + up, 2.0);
        let [u, v] = [Vec3::X, Vec3::Y].map(|axis| axis * half * scale);
        Light::rectangle(center, u, v, Vec3::new(900.0, 800.0, 700.0) * mean)
    };
    let expected: Vec<Light> = large.chain(small).map(part).collect();
    let mut world = LightWorld::new();
    let dark = expected.iter().map(|light| light.with_emission(Vec3::ZERO)).collect();
    let tree = world.add_tree(LightTree::new(dark).expect("valid"));
    world.add_instance(tree, Placement::IDENTITY, Policy::RefitOnly).expect("valid");
    world.set_light_source(tree, TreeSource::GpuMesh).expect("no profiles");
    let mut lights = gpu_lights();
    lights.upload(&world).expect("room");

    // The document's kernel, with an entry point.
    let (device, queue) = gpu();
    let page = include_str!("../../../docs/gpu-lights.md");
    let kernel = page.split("```wgsl\n").nth(1).and_then(|rest| rest.split("```").next()).expect("a kernel");
    let entry = "
        @compute @workgroup_size(64) fn engine(@builtin(global_invocation_id) id: vec3<u32>) {
            if id.x < light_source_count(0u) { screen_put(0u, id.x, vec3(900.0, 800.0, 700.0)); }
        }";
    let texture = device.create_texture_with_data(
        &queue,
        &wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba32Float,
            usage: wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        },
        wgpu::util::TextureDataOrder::LayerMajor,
        bytemuck::cast_slice(&texels.iter().map(|t| t.extend(1.0).to_array()).collect::<Vec<_>>()),
    );
    // Each part as words: three vectors of four, then its corner and its size in texels. Rows of texels begin
    // at the top.
    let words: Vec<[u32; 16]> = expected
        .iter()
        .map(|light| {
            let crate::light::Shape::Rectangle { center, half_u, half_v, .. } = light.shape else {
                unreachable!("parts of a rectangle")
            };
            let size = [half_u.x / 4.0 * width as f32, half_v.y / 2.0 * height as f32];
            let corner =
                [(center.x - half_u.x + 3.0) / 8.0 * width as f32, (5.0 - center.y - half_v.y) / 4.0 * height as f32];
            let [center, u, v] = [center, half_u, half_v].map(|v| v.extend(0.0).to_array().map(f32::to_bits));
            let texels = [corner[0], corner[1], size[0], size[1]].map(|x| x.round() as u32);
            let mut words = [0; 16];
            words[..4].copy_from_slice(&center);
            words[4..8].copy_from_slice(&u);
            words[8..12].copy_from_slice(&v);
            words[12..16].copy_from_slice(&texels);
            words
        })
        .collect();
    let buffer = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: None,
        contents: bytemuck::cast_slice(&words),
        usage: wgpu::BufferUsages::STORAGE,
    });
    let own = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: None,
        entries: &[
            wgpu::BindGroupLayoutEntry {
                binding: 0,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty: wgpu::BindingType::Texture {
                    sample_type: wgpu::TextureSampleType::Float { filterable: false },
                    view_dimension: wgpu::TextureViewDimension::D2,
                    multisampled: false,
                },
                count: None,
            },
            storage_entry(1, true),
        ],
    });
    let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &own,
        entries: &[
            wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&view) },
            wgpu::BindGroupEntry { binding: 1, resource: buffer.as_entire_binding() },
        ],
    });
    let pipeline = source_pipeline(&lights, &own, &(kernel.to_owned() + entry));
    run_and_build(&mut lights, &pipeline, &group, expected.len() as u32);
    let (_, _, records) = read_tree(&lights, tree);
    for (record, light) in records.iter().zip(&expected) {
        let difference = (Vec3::from(record.emission) - light.emission).abs().max_element();
        assert!(difference <= 1.0e-4 * light.emission.max_element(), "{record:?} {light:?}");
    }
}

/// Lights that whirl, each at its own speed, so that neighbours part.
fn whirl(count: u32, time: f32) -> Vec<Light> {
    let place = |i: u32| {
        let angle = 6.0 * random(i, 50) + time * (0.02 + 0.3 * random(i, 51));
        let radius = 2.0 + 30.0 * random(i, 52);
        Vec3::new(radius * angle.cos(), 8.0 * random(i, 53), radius * angle.sin())
    };
    (0..count).map(|i| Light::point(place(i), Vec3::splat(1.0 + random(i, 54)))).collect()
}

/// One frame of an engine: follows, updates, uploads, writes these lights and builds. Returns the number of trees
/// that were rebuilt.
fn frame(lights: &mut GpuLights, world: &mut LightWorld, puts: &[Put]) -> usize {
    lights.follow_sources(world);
    let report = world.update(FrameBudget::new(std::time::Duration::from_millis(2)));
    lights.upload(world).expect("room");
    put(lights, puts);
    gpu().0.poll(wgpu::PollType::wait_indefinitely()).expect("the device works");
    report.rebuilt_trees
}

fn puts_of(world: &LightWorld, tree: TreeKey, lights: &[Light]) -> Vec<Put> {
    let (_, number) = world.light_source(tree).expect("a source");
    (0..).zip(lights).map(|(index, light)| Put::of(number, index, light)).collect()
}

#[test]
fn a_tree_is_rebuilt_from_what_kernels_wrote_once_its_lights_have_parted() {
    let count = 600;
    let mut world = LightWorld::with_clock(std::sync::Arc::new(VirtualClock::new(|work| {
        std::time::Duration::from_nanos(100 * work.lights as u64)
    })));
    let tree = world.add_tree(LightTree::new(whirl(count, 0.0)).expect("valid"));
    let rest = world.add_tree(LightTree::new(whirl(count, 0.0)).expect("valid"));
    for key in [tree, rest] {
        world.add_instance(key, Placement::IDENTITY, Policy::Budgeted).expect("valid");
        world.set_light_source(key, TreeSource::GpuMesh).expect("no profiles");
    }
    assert!(world.active_effects().contains(Effects::MOVING));
    let mut lights = gpu_lights();
    let mut rebuilt = 0;
    world.update(FrameBudget::NONE);
    lights.upload(&world).expect("room");
    for time in 0..60 {
        let mut puts = puts_of(&world, tree, &whirl(count, time as f32));
        puts.extend(puts_of(&world, rest, &whirl(count, 0.0)));
        rebuilt += frame(&mut lights, &mut world, &puts);
    }
    assert!((3..40).contains(&rebuilt), "{rebuilt} rebuilds");
    assert_eq!(world.tree(rest).expect("live").lights(), whirl(count, 0.0), "nothing was read of what rests");
    let known = world.tree(tree).expect("live").lights().to_vec();
    let age = (0..60).rev().find(|time| whirl(count, *time as f32) == known);
    assert!(age.is_some_and(|time| time > 40), "the CPU knows the lights of frame {age:?}");
    // The nodes are those of the CPU's present tree, refitted.
    let mut twin = world.tree(tree).expect("live").clone();
    twin.set_lights(&(0..).zip(whirl(count, 59.0)).collect::<Vec<_>>()).expect("valid");
    twin.refit();
    let (_, [range, _, _]) = lights.planner.tree_ranges(slot_of(tree));
    let nodes = read_nodes(&lights, lights.planner.bindings().expect("sent")[2], range);
    assert_same_nodes(&nodes, twin.nodes());
}

#[test]
fn frames_that_are_dropped_and_trees_that_go_disturb_no_readback() {
    let mut world = LightWorld::with_clock(std::sync::Arc::new(VirtualClock::new(|work| {
        std::time::Duration::from_nanos(100 * work.lights as u64)
    })));
    let add = |world: &mut LightWorld, policy| {
        let tree = world.add_tree(LightTree::new(whirl(90, 0.0)).expect("valid"));
        let instance = world.add_instance(tree, Placement::IDENTITY, policy).expect("valid");
        world.set_light_source(tree, TreeSource::GpuMesh).expect("no profiles");
        (tree, instance)
    };
    let (first, instance) = add(&mut world, Policy::AlwaysRebuild);
    let (second, _) = add(&mut world, Policy::AlwaysRebuild);
    let (device, _) = gpu();
    let mut lights = gpu_lights();
    for time in 0..4 {
        let puts = puts_of(&world, first, &whirl(90, time as f32));
        frame(&mut lights, &mut world, &puts);
        // A frame that is recorded and dropped.
        lights.upload(&world).expect("room");
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        lights.build_top(&mut encoder);
        drop(encoder);
    }
    world.remove_instance(instance).expect("live");
    world.remove_tree(first).expect("no instances");
    // The number is used again, by another tree.
    let (third, _) = add(&mut world, Policy::RefitOnly);
    assert_eq!(world.light_source(third), Some((TreeSource::GpuMesh, 0)));
    for time in 4..9 {
        let puts = puts_of(&world, second, &whirl(90, time as f32));
        frame(&mut lights, &mut world, &puts);
    }
    assert_eq!(world.tree(third).expect("live").lights(), whirl(90, 0.0), "it never asks for its lights");
    assert_ne!(world.tree(second).expect("live").lights(), whirl(90, 0.0));
}

#[test]
fn the_top_level_has_nodes_where_kernels_have_moved_particles() {
    // The most parts in a cell of the top level if the lights are at these places, and the number of cells with any.
    let fullest = |world: &LightWorld, lights: &[Light], offset: Vec3| {
        let mut counts = std::collections::HashMap::new();
        for (light, i) in lights.iter().zip(0..) {
            *counts.entry(world.partition().cell(light.cluster().mean + offset, i)).or_insert(0) += 1;
        }
        (counts.values().copied().max().unwrap_or(0), counts.len())
    };
    let count = 3_000;
    let mut world = LightWorld::new();
    // The CPU knows no more than where the emitter is.
    let tree =
        world.add_tree(LightTree::new(vec![Light::point(Vec3::ZERO, Vec3::ONE); count as usize]).expect("valid"));
    let emitter = world.add_instance(tree, Placement::IDENTITY, Policy::Budgeted).expect("valid");
    world.set_light_source(tree, TreeSource::GpuParticles).expect("no profiles");
    let mut lights = gpu_lights();
    world.update(FrameBudget::NONE);
    lights.upload(&world).expect("room");
    // Places come back some frames late: how many is up to the device.
    const LATE: u32 = 30;
    let follows = |lights: &mut GpuLights, world: &mut LightWorld, shining: u32, range: Range<usize>, speed: f32| {
        let mut found = (0, 0);
        let last = (1..=12 + LATE).find(|time| {
            let offset = speed * (*time).min(12) as f32;
            world.move_instance(emitter, Placement::at(DVec3::X * f64::from(offset))).expect("live");
            let mut puts = puts_of(world, tree, &whirl(count, *time as f32));
            puts.iter_mut().skip(shining as usize).for_each(|put| put.kind = 99);
            frame(lights, world, &puts);
            found = fullest(world, &whirl(shining, *time as f32), Vec3::X * offset);
            *time >= 12 && found.0 <= 3 * MOST_PARTS && range.contains(&found.1)
        });
        assert!(last.is_some(), "{} in one of {} cells", found.0, found.1);
    };
    follows(&mut lights, &mut world, count, 201..3_000, 0.0);
    // An emitter that moves, and particles that are gone at once.
    follows(&mut lights, &mut world, 1_000, 70..300, 100.0);
    // The CPU's lights are told nothing.
    assert_eq!(world.tree(tree).expect("live").lights()[7], Light::point(Vec3::ZERO, Vec3::ONE));
    // What the CPU writes again is where the CPU says.
    world.set_light_source(tree, TreeSource::Cpu).expect("live");
    world.set_lights(tree, &(0..).zip(whirl(count, 0.0)).collect::<Vec<_>>()).expect("valid");
    world.update(FrameBudget::NONE);
    let parts = world.parts();
    assert!(parts.len() < 100 && parts.iter().all(|(_, cluster)| cluster.mean.x > 1_000.0));
}

#[test]
fn the_records_of_openings_follow_the_lights() {
    // Two trees between each other's lights, and a third one that is divided by side.
    let at = |index: u32| Placement::at(DVec3::X * if index == 2 { 500.0 } else { 0.0 });
    let (mut world, trees) = world_of(&[1_000, 200, 40], at);
    trees.iter().for_each(|tree| world.set_light_source(*tree, TreeSource::GpuMesh).expect("no profiles"));
    for _ in 0..3 {
        world.update(FrameBudget::NONE);
    }
    let mut lights = gpu_lights();
    lights.upload(&world).expect("room");
    let mut puts = Vec::new();
    for tree in &trees {
        let count = world.tree(*tree).expect("live").lights().len() as u32;
        puts.extend(puts_of(&world, *tree, &lights_of(count, 2)));
    }
    put(&mut lights, &puts);
    let (mut of_lights, mut of_nodes) = (0, 0);
    for tree in &trees {
        let entry = world.tree_entry(*tree).expect("live");
        let mut twin = entry.tree.clone();
        let moved = lights_of(twin.lights().len() as u32, 2);
        twin.set_lights(&(0..).zip(moved).collect::<Vec<_>>()).expect("valid");
        twin.refit();
        let (_, parts, _) = read_tree(&lights, *tree);
        assert!(parts.len() == entry.openings.len() && parts.len() > 1, "{} parts", parts.len());
        for (part, opening) in parts.iter().zip(&entry.openings) {
            let (ours, all) = (part.cluster, twin.opening_cluster(opening));
            assert_eq!((part.child_bits, part.place), (opening.child_bits, opening.place));
            assert!(close(ours.flux, all.flux, 500.0 * all.flux), "{ours:?} {all:?}");
            // Boxes of nodes are unpacked from the same bytes, and boxes of lights are exact.
            assert_eq!((ours.box_min, ours.box_max), (all.aabb.min.to_array(), all.aabb.max.to_array()));
            let size = all.aabb.extent().length();
            assert!((Vec3::from(ours.mean) - all.mean).length() <= 0.02 * size + 1.0e-4, "{ours:?} {all:?}");
            assert!((Vec3::from(ours.axis) - all.axis).length() < 0.02, "{ours:?} {all:?}");
            assert!((ours.cos_half_angle - all.cos_half_angle).abs() < 0.02, "{ours:?} {all:?}");
            assert_eq!(ours.range, all.range.min(UNLIMITED_RANGE));
            match opening.light() {
                Some(_) => of_lights += 1,
                None => of_nodes += 1,
            }
        }
    }
    assert!(of_lights >= 1_200 && of_nodes > 1, "{of_lights} {of_nodes}");
}

#[test]
fn lights_are_written_where_their_tree_lies_once_buffers_have_grown() {
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(whirl(200, 0.0)).expect("valid"));
    world.add_instance(tree, Placement::IDENTITY, Policy::RefitOnly).expect("valid");
    world.set_light_source(tree, TreeSource::GpuMesh).expect("no profiles");
    world.update(FrameBudget::NONE);
    let mut lights = gpu_lights();
    for (time, has_more) in [(3.0, false), (5.0, true)] {
        if has_more {
            // More trees make the buffers larger.
            let more = world.add_tree(LightTree::new(lights_of(2_000, 1)).expect("valid"));
            let place = Placement::at(DVec3::X * 500.0);
            world.add_instance(more, place, Policy::RefitOnly).expect("valid");
            world.update(FrameBudget::NONE);
        }
        lights.upload(&world).expect("room");
        let moved = whirl(200, time);
        put(&mut lights, &puts_of(&world, tree, &moved));
        let (_, [range, _, _]) = lights.planner.tree_ranges(slot_of(tree));
        let nodes = read_nodes(&lights, lights.planner.bindings().expect("sent")[2], range);
        let mut twin = world.tree(tree).expect("live").clone();
        twin.set_lights(&(0..).zip(moved.iter().copied()).collect::<Vec<_>>()).expect("valid");
        twin.refit();
        assert_same_nodes(&nodes, twin.nodes());
        assert_bounds_hold(&nodes, &twin, &moved);
    }
}

#[test]
fn a_device_without_room_for_a_tree_takes_no_lights_of_it_until_there_is_room() {
    let (mut world, trees) = world_of(&[3_000, 20], |index| Placement::at(DVec3::X * 300.0 * f64::from(index)));
    trees.iter().for_each(|tree| world.set_light_source(*tree, TreeSource::GpuMesh).expect("no profiles"));
    let mut lights = gpu_lights();
    lights.set_tree_memory(Some(128 * 1024));
    lights.upload(&world).expect("room for stand-ins");
    assert!(lights.planner.source_lights(trees[0]).is_none(), "the large tree has stand-ins");
    let puts: Vec<Put> = trees
        .iter()
        .flat_map(|tree| {
            let count = world.tree(*tree).expect("live").lights().len() as u32;
            puts_of(&world, *tree, &lights_of(count, 2))
        })
        .collect();
    put(&mut lights, &puts);
    lights.set_tree_memory(None);
    for _ in 0..3 {
        lights.upload(&world).expect("room");
    }
    put(&mut lights, &puts);
    for tree in &trees {
        let moved = lights_of(world.tree(*tree).expect("live").lights().len() as u32, 2);
        let (nodes, _, _) = read_tree(&lights, *tree);
        assert_bounds_hold(&nodes, world.tree(*tree).expect("live"), &moved);
    }
}
