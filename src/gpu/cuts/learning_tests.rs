//! The GPU learns what the CPU learns.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};
use wgpu::util::DeviceExt;

use super::super::testing::{compute_pipeline, gpu, gpu_lights, mixed_world, read, unit};
use super::*;
use crate::effects::Effects;
use crate::keys::LightId;
use crate::math::dice::hash;
use crate::plan::cuts::layout::CutPlaces;
use crate::sampling::cuts::CutOptions;
use crate::sampling::sample::{LightSample, LightSampler};
use crate::shading::shading_point::ShadingPoint;
use crate::visibility::{TABLE_HEAD, VisibilityOptions, VisibilityTable};

/// What an invocation of the shader below gets: a shading point, and the light that was seen or
/// not.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Input {
    position: [f32; 3],
    instance: u32,
    normal: [f32; 3],
    light: u32,
    is_visible: u32,
    padding: [u32; 3],
}

const ENGINE: &str = "
    struct Input { position: vec3<f32>, instance: u32, normal: vec3<f32>, light: u32, is_visible: u32 }
    @group(0) @binding(0) var<storage, read> inputs: array<Input>;
    @compute @workgroup_size(64) fn engine(@builtin(global_invocation_id) id: vec3<u32>) {
        if id.x >= arrayLength(&inputs) { return; }
        let input = inputs[id.x];
        let at = light_surface_point(input.position, input.normal);
        WORK
    }";

/// A light of the tree, and then the name of one that may be gone.
const RECORD: &str = "
        var chosen = light_reservoir_sample(at, light_reservoir_of(input.instance, input.light % 30u, vec2(0.25, 0.75)));
        chosen.light = input.light;
        light_record_visibility(at, chosen, input.is_visible != 0u);";

/// What the shader records.
fn record(sampler: &LightSampler<'_>, input: &Input) {
    let (at, world) = (point(input), sampler.world);
    let Some(instance) = world.instance_at(input.instance) else { return };
    let incident = sampler.sample_light(&at, LightId::Local { instance, light: input.light % 30 }, [0.25, 0.75]);
    if let Some(incident) = incident {
        let light = LightId::Local { instance, light: input.light };
        sampler.record_visibility(&at, &LightSample { light, pmf: 1.0, incident, user_data: 0 }, input.is_visible != 0);
    }
}

/// Shading points, which are the same in each frame, and what each of them sees in this one.
fn inputs(sampler: &LightSampler<'_>, frame: u32) -> Vec<Input> {
    let input = |i: u32| {
        let at = |k: u32| unit(7 * i + k);
        let normal = match i % 5 {
            0 => Vec3::ZERO,
            1 => Vec3::X,
            _ => Vec3::new(at(0) - 0.5, 1.0, at(1) - 0.5).normalize(),
        };
        let position = Vec3::new(at(2), 0.1 * at(3), at(4)) * 40.0;
        let u = [unit(hash(i) ^ frame), unit(hash(i) ^ hash(frame))];
        let pick = sampler.pick(&ShadingPoint::surface(position, normal), u);
        let (instance, light) = match pick.map(|pick| pick.light) {
            Some(LightId::Local { instance, light }) => (sampler.world.slot(instance).expect("it lives"), light),
            _ => (u32::MAX, 0),
        };
        // Some are gone: the trees have 30 lights.
        let light = if i % 11 == 3 { light + 30 } else { light };
        let is_visible = u32::from(instance.wrapping_add(light / 4 + (position.x / 8.0) as u32).is_multiple_of(3));
        let (position, normal) = (position.to_array(), normal.to_array());
        Input { position, instance, normal, light, is_visible, padding: [0; 3] }
    };
    (0..3000).map(input).collect()
}

fn point(input: &Input) -> ShadingPoint {
    ShadingPoint::surface(input.position.into(), input.normal.into())
}

/// Runs the shader above, and folds.
fn run(lights: &mut GpuLights, pipeline: &(wgpu::BindGroupLayout, wgpu::ComputePipeline), inputs: &[Input]) {
    let (device, queue) = gpu();
    let input = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: None,
        contents: bytemuck::cast_slice(inputs),
        usage: wgpu::BufferUsages::STORAGE,
    });
    let group = super::super::bindings::bind(&device, "test", &pipeline.0, &[&input]);
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    lights.build_top(&mut encoder);
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
    pass.set_pipeline(&pipeline.1);
    pass.set_bind_group(0, &group, &[]);
    pass.set_bind_group(1, lights.bind_group(), &[]);
    pass.dispatch_workgroups((inputs.len() as u32).div_ceil(64), 1, 1);
    drop(pass);
    lights.build_cuts(&mut encoder);
    queue.submit([encoder.finish()]);
}

fn pipeline(lights: &GpuLights) -> (wgpu::BindGroupLayout, wgpu::ComputePipeline) {
    use super::super::bindings::storage_entry;
    let (device, _) = gpu();
    let own = device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &[storage_entry(0, true)] });
    let shader = lights.shader(1, Effects::all()).with_learning();
    let pipeline = compute_pipeline(shader.join(&ENGINE.replace("WORK", RECORD)), "engine", [&own, &shader.layout]);
    (own, pipeline)
}

#[test]
fn the_gpu_learns_what_the_cpu_learns() {
    let (device, queue) = gpu();
    let mut world = mixed_world();
    let mut lights = gpu_lights();
    let pipeline = pipeline(&lights);
    let options = VisibilityOptions::new(4.0, 256).expect("valid");
    let mut table = VisibilityTable::new(options);
    lights.make_cells(&GpuOptions::default().with_learning(options)).expect("memory enough");
    lights.rebind();
    for frame in 0..12 {
        if frame == 6 {
            // What was learnt stays in place.
            world.set_origin_near(DVec3::new(3.3, 0.0, -1100.0)).expect("finite");
        }
        lights.upload(&world).expect("room enough");
        let sampler = world.sampler().with_visibility(&table);
        let mut inputs = inputs(&sampler, frame);
        if frame >= 6 {
            let moved = |input: &mut Input| {
                input.position = (DVec3::from(Vec3::from(input.position)) - world.origin()).as_vec3().to_array();
            };
            inputs.iter_mut().for_each(moved);
        }
        run(&mut lights, &pipeline, &inputs);
        inputs.iter().for_each(|input| record(&sampler, input));
        table.end_frame();
        let cuts: Vec<u32> = read(&device, &queue, lights.player.buffer(lights.planner.cells().expect("a table")[0]));
        let first = CutPlaces::new(CutOptions::default(), Some(options)).learnt_ranges()[0].start as usize / 4;
        let (learnt, known) = (&cuts[first + 4 * TABLE_HEAD as usize..], table.words());
        assert_eq!(learnt.len(), known.len());
        let rows = options.cells() * 9 / 8;
        let heads = 2 * rows;
        let same_cells = learnt[..heads].iter().zip(&known[..heads]).filter(|(a, b)| a == b).count();
        // A shading point within rounding of a border may claim or touch another cell.
        assert!(same_cells + 2 >= heads, "frame {frame}: {same_cells} of {heads}");
        // The rows of cells and blocks. Rows that were never used hold zeros on the GPU.
        let rows = (0..rows).filter(|row| known[*row] != 0 && known[*row] == learnt[*row]);
        let words = rows.flat_map(|row| heads + 128 * row..heads + 128 * (row + 1));
        let (mut all, mut same) = (0, 0);
        for word in words {
            all += 1;
            same += usize::from(learnt[word] == known[word]);
        }
        assert!(same * 100 >= all * 99, "frame {frame}: {same} of {all}");
    }
    let rows = options.cells() * 9 / 8;
    let words = table.words();
    let is_learnt = |row: &usize| words[*row] & 1 == 1;
    let full = (0..rows).filter(is_learnt).flat_map(|row| &words[2 * rows + 128 * row..][..128]);
    let full = full.filter(|word| **word == u32::MAX).count();
    assert!(table.cell_count() > 100 && full < 100, "{table:?} {full}");
}
