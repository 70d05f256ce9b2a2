//! The GPU learns what the CPU learns, and chooses lights by it.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};
use wgpu::util::DeviceExt;

use super::super::memory::refusals::Refusals;
use super::super::testing::{compute_pipeline, gpu, gpu_lights, mixed_world, noop, read, unit};
use super::*;
use crate::keys::LightId;
use crate::math::dice::hash;
use crate::sampling::counts::CandidateCount;
use crate::sampling::sample::{LightSample, LightSampler};
use crate::shading::shading_point::ShadingPoint;
use crate::visibility::{TABLE_HEAD, VisibilityTable};

/// What an invocation of the shader below gets: a shading point, and the light that was seen or
/// not.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Input {
    position: [f32; 3],
    instance: u32,
    normal: [f32; 3],
    light: u32,
    u: [f32; 2],
    is_visible: u32,
    padding: u32,
}

/// What it chooses, and the probability that it finds for that.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
struct Output {
    instance: u32,
    light: u32,
    pmf: f32,
    pmf_of_light: f32,
}

const ENGINE: &str = "
    struct Input { position: vec3<f32>, instance: u32, normal: vec3<f32>, light: u32, u: vec2<f32>, is_visible: u32 }
    @group(0) @binding(0) var<storage, read> inputs: array<Input>;
    @group(0) @binding(1) var<storage, read_write> outputs: array<vec4<u32>>;
    @compute @workgroup_size(64) fn engine(@builtin(global_invocation_id) id: vec3<u32>) {
        if id.x >= arrayLength(&inputs) { return; }
        let input = inputs[id.x];
        let at = light_surface_point(input.position, input.normal);
        WORK
    }";

const PICK_AND_RECORD: &str = "
        let pick = light_pick(at, input.u);
        var pmf = 0.0;
        if pick.pmf > 0.0 { pmf = light_pmf(at, pick.instance, pick.light); }
        outputs[id.x] = vec4(pick.instance, pick.light, bitcast<u32>(pick.pmf), bitcast<u32>(pmf));
        var chosen = light_sample(at, vec4(input.u, 0.25, 0.75));
        chosen.instance = input.instance;
        chosen.light = input.light;
        light_record_visibility(at, chosen, input.is_visible != 0u);";

const RESAMPLE: &str = "
        let kept = light_resample(at, input.u.xyyx, input.u.x, 8u);
        outputs[id.x] = vec4(kept.chosen.instance, kept.chosen.light, bitcast<u32>(kept.weight), 0u);";

/// What the shader records.
fn record(sampler: &LightSampler<'_>, input: &Input) {
    let (at, [a, b], world) = (point(input), input.u, sampler.world);
    let drawn = sampler.sample(&at, [a, b, 0.25, 0.75]);
    if let (Some(sample), Some(instance)) = (drawn, world.instance_at(input.instance)) {
        let light = LightId::Local { instance, light: input.light };
        sampler.record_visibility(&at, &LightSample { light, ..sample }, input.is_visible != 0);
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
        Input { position, instance, normal, light, u, is_visible, padding: 0 }
    };
    (0..3000).map(input).collect()
}

fn point(input: &Input) -> ShadingPoint {
    ShadingPoint::surface(input.position.into(), input.normal.into())
}

/// Runs the shader above, folds, and returns what it chose.
fn run(
    lights: &mut GpuLights,
    pipeline: &(wgpu::BindGroupLayout, wgpu::ComputePipeline),
    inputs: &[Input],
) -> Vec<Output> {
    let (device, queue) = gpu();
    let input = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: None,
        contents: bytemuck::cast_slice(inputs),
        usage: wgpu::BufferUsages::STORAGE,
    });
    let output = device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: size_of::<Output>() as u64 * inputs.len() as u64,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    });
    let own = [input.as_entire_binding(), output.as_entire_binding()];
    let group = super::super::bindings::bind(&device, "test", &pipeline.0, &own);
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    lights.build_top(&mut encoder);
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
    pass.set_pipeline(&pipeline.1);
    pass.set_bind_group(0, &group, &[]);
    pass.set_bind_group(1, lights.visibility_bind_group(), &[]);
    pass.dispatch_workgroups((inputs.len() as u32).div_ceil(64), 1, 1);
    drop(pass);
    lights.fold_visibility(&mut encoder);
    queue.submit([encoder.finish()]);
    read(&device, &queue, &output)
}

fn pipeline(lights: &GpuLights, work: &str) -> (wgpu::BindGroupLayout, wgpu::ComputePipeline) {
    use super::super::bindings::storage_entry;
    let (device, _) = gpu();
    let own = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: None,
        entries: &[storage_entry(0, true), storage_entry(1, false)],
    });
    let shader = lights.visibility_shader(1, Effects::all());
    let pipeline = compute_pipeline(shader.join(&ENGINE.replace("WORK", work)), "engine", [&own, &shader.layout]);
    (own, pipeline)
}

/// The number of choices that name another light or another probability than the CPU's.
fn others(sampler: &LightSampler<'_>, inputs: &[Input], outputs: &[Output]) -> usize {
    let is_other = |(input, output): &(&Input, &Output)| {
        let Some(pick) = sampler.pick(&point(input), input.u) else { return output.pmf > 0.0 };
        let (instance, light) = match pick.light {
            LightId::Local { instance, light } => (sampler.world.slot(instance).expect("it lives"), light),
            LightId::Directional(_) => (u32::MAX, 0),
        };
        (output.instance, output.light) != (instance, light) || (output.pmf / pick.pmf - 1.0).abs() > 2.0e-3
    };
    inputs.iter().zip(outputs).filter(is_other).count()
}

#[test]
fn the_gpu_learns_and_chooses_as_the_cpu_does() {
    let (device, queue) = gpu();
    let mut world = mixed_world();
    let mut lights = gpu_lights();
    let pipeline = pipeline(&lights, PICK_AND_RECORD);
    let options = VisibilityOptions::new(4.0, 256).expect("valid");
    let mut table = VisibilityTable::new(options);
    lights.learn_visibility(Some(options)).expect("memory enough");
    let mut chosen = 0;
    for frame in 0..12 {
        if frame == 6 {
            // What was learnt stays in place.
            world.set_origin(DVec3::new(3.3, 0.0, -700.1)).expect("finite");
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
        let outputs = run(&mut lights, &pipeline, &inputs);
        // A mean position within rounding of the border between two groups may count in the other
        // one, and random numbers may fall within rounding of the border between two lights: see
        // `OTHER_PICKS` in tests/all/gpu.rs.
        let count = others(&sampler, &inputs, &outputs);
        assert!(count <= inputs.len() / 100, "frame {frame}: {count} of {}", inputs.len());
        for output in outputs.iter().filter(|output| output.pmf > 0.0) {
            assert!((output.pmf_of_light / output.pmf - 1.0).abs() < 1.0e-4, "{output:?}");
            chosen += 1;
        }
        inputs.iter().for_each(|input| record(&sampler, input));
        table.end_frame();
        let learnt: Vec<u32> =
            read(&device, &queue, lights.player.buffer(lights.planner.visibility_table().expect("a table")[0]));
        let (learnt, known) = (&learnt[4 * TABLE_HEAD as usize..], table.words());
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
    assert!(table.cell_count() > 100 && full < 100 && chosen > 20_000, "{table:?} {full} {chosen}");
}

#[test]
fn without_a_table_the_shader_chooses_as_without_learning() {
    let world = mixed_world();
    let mut lights = gpu_lights();
    let pipeline = pipeline(&lights, PICK_AND_RECORD);
    lights.upload(&world).expect("room enough");
    let inputs = inputs(&world.sampler(), 3);
    let before = run(&mut lights, &pipeline, &inputs);
    assert!(others(&world.sampler(), &inputs, &before) <= inputs.len() / 500);
    lights.learn_visibility(Some(VisibilityOptions::default())).expect("memory enough");
    for _ in 0..6 {
        run(&mut lights, &pipeline, &inputs);
    }
    let learnt = run(&mut lights, &pipeline, &inputs);
    assert!(learnt != before, "the table matters");
    lights.learn_visibility(None).expect("nothing is made");
    assert!(run(&mut lights, &pipeline, &inputs) == before);
}

#[test]
fn candidates_are_kept_by_what_is_learnt_as_on_the_cpu() {
    let world = mixed_world();
    let mut lights = gpu_lights();
    let (learn, resample) = (pipeline(&lights, PICK_AND_RECORD), pipeline(&lights, RESAMPLE));
    let options = VisibilityOptions::new(4.0, 1024).expect("valid");
    let mut table = VisibilityTable::new(options);
    lights.learn_visibility(Some(options)).expect("memory enough");
    lights.upload(&world).expect("room enough");
    for frame in 0..8 {
        let sampler = world.sampler().with_visibility(&table);
        let inputs = inputs(&sampler, frame);
        run(&mut lights, &learn, &inputs);
        inputs.iter().for_each(|input| record(&sampler, input));
        table.end_frame();
    }
    let (with, without) = (world.sampler().with_visibility(&table), world.sampler());
    let inputs = inputs(&with, 99);
    let outputs = run(&mut lights, &resample, &inputs);
    let count = |sampler: &LightSampler<'_>| {
        let is_other = |(input, output): &(&Input, &Output)| {
            let [x, y] = input.u;
            let kept = sampler.resample(&point(input), [x, y, y, x, x], CandidateCount::of::<8>());
            let Some(kept) = kept else { return output.pmf > 0.0 };
            let (instance, light) = match kept.chosen.light {
                LightId::Local { instance, light } => (sampler.world.slot(instance).expect("it lives"), light),
                LightId::Directional(_) => (u32::MAX, 0),
            };
            (output.instance, output.light) != (instance, light) || (output.pmf / kept.weight - 1.0).abs() > 1.0e-2
        };
        inputs.iter().zip(&outputs).filter(is_other).count()
    };
    // Eight draws and one choice are each as exact as a pick above.
    assert!(count(&with) <= inputs.len() / 20, "{} of {}", count(&with), inputs.len());
    assert!(count(&without) > inputs.len() / 3, "{} of {}", count(&without), inputs.len());
}

#[test]
fn each_buffer_of_a_table_may_be_refused_and_the_present_one_stays() {
    let (device, queue) = noop();
    let mut lights = GpuLights::new(&device, &queue).expect("default limits are enough");
    lights.learn_visibility(None).expect("there is none");
    lights.learn_visibility(Some(VisibilityOptions::default())).expect("memory enough");
    let before = lights.visibility_bind_group().clone();
    let mut refused = Vec::new();
    for successes in 0.. {
        let refusals = Refusals::of_buffers_after(successes);
        let result = lights.learn_visibility(Some(VisibilityOptions::new(2.0, 64).expect("valid")));
        if refusals.count() == 0 {
            assert!(result.is_ok() && *lights.visibility_bind_group() != before);
            break;
        }
        let Err(GpuError::OutOfMemory { what, .. }) = result else { panic!("{result:?}") };
        assert!(*lights.visibility_bind_group() == before, "{what}");
        refused.push(what);
    }
    assert_eq!(refused, ["learnt visibility", "records of visibility", "known visibility"]);
}
