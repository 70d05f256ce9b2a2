//! The GPU builds the cuts that the CPU builds, and chooses lights from them.

use std::collections::BTreeMap;

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};
use wgpu::util::DeviceExt;

use super::super::bindings::{bind, storage_entry};
use super::super::memory::refusals::Refusals;
use super::super::testing::{compute_pipeline, gpu, gpu_lights, mixed_world, noop, read, unit};
use super::*;
use crate::effects::Effects;
use crate::gpu::LightShader;
use crate::instance::placement::Placement;
use crate::keys::LightId;
use crate::light::Light;
use crate::plan::cuts::layout::{CutPlaces, HEAD, ROW_FROM, ROW_NODES, ROW_QUADS, ROW_SUMS, SLOT_WORDS, STATE_AT};
use crate::plan::text;
use crate::policy::Policy;
use crate::sampling::cuts::shared::{Contested, NodeId};
use crate::sampling::cuts::table::CutTable;
use crate::sampling::cuts::{CutOptions, camera};
use crate::sampling::sample::{LightSample, LightSampler};
use crate::scheduler::FrameBudget;
use crate::shading::gloss::Gloss;
use crate::shading::shading_point::ShadingPoint;
use crate::tree::{LightTree, WIDTH};
use crate::visibility::{VisibilityOptions, VisibilityTable};
use crate::world::LightWorld;

mod masks;

/// What an invocation of the shaders below gets.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Input {
    position: [f32; 3],
    roughness: f32,
    normal: [f32; 3],
    mask: u32,
    view: [f32; 3],
    more_padding: u32,
    u: [f32; 4],
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
    struct Input { position: vec3<f32>, roughness: f32, normal: vec3<f32>, mask: u32, view: vec3<f32>, u: vec4<f32> }
    @group(0) @binding(0) var<storage, read> inputs: array<Input>;
    @group(0) @binding(1) var<storage, read_write> outputs: array<vec4<u32>>;
    fn shading_point(input: Input) -> LightShadingPoint {
        var at = light_surface_point(input.position, input.normal);
        if input.roughness >= 0.0 {
            at = light_glossy_point(input.position, input.normal, input.view, input.roughness, 0.3, 0.4);
        }
        return light_masked_point(at, input.mask);
    }
    @compute @workgroup_size(64) fn engine(@builtin(global_invocation_id) id: vec3<u32>) {
        if id.x >= arrayLength(&inputs) { return; }
        let at = shading_point(inputs[id.x]);
        WORK
    }";

const MARK: &str = "light_mark(at);";

const CHOOSE: &str = "
        let pick = light_pick(at, inputs[id.x].u.xy);
        var pmf = 0.0;
        if pick.pmf > 0.0 { pmf = light_pmf(at, pick.instance, pick.light); }
        outputs[id.x] = vec4(pick.instance, pick.light, bitcast<u32>(pick.pmf), bitcast<u32>(pmf));";

const CHOOSE_AND_RECORD: &str = "
        let pick = light_pick(at, inputs[id.x].u.xy);
        let chosen = light_sample(at, vec4(inputs[id.x].u.xy, 0.25, 0.75));
        outputs[id.x] = vec4(pick.instance, pick.light, bitcast<u32>(pick.pmf), 0u);
        light_record_visibility(at, chosen, (pick.instance + pick.light / 4u) % 3u == 0u);";

/// What is kept of eight candidates, and its weight.
const RESAMPLE: &str = "
        let u = inputs[id.x].u;
        let kept = light_resample(at, u, u.x, 8u);
        outputs[id.x] = vec4(kept.instance, kept.light, bitcast<u32>(kept.weight), 0u);";

const COUNT: &str = "
        light_nodes_read = 0u;
        let pick = light_pick(at, inputs[id.x].u.xy);
        let one = light_nodes_read;
        light_nodes_read = 0u;
        let kept = light_resample(at, inputs[id.x].u, 0.5, 8u);
        outputs[id.x] = vec4(one, light_nodes_read, u32(pick.pmf > 0.0), u32(kept.weight > 0.0));";

struct Rig {
    lights: GpuLights,
    own: wgpu::BindGroupLayout,
    mark: wgpu::ComputePipeline,
    choose: wgpu::ComputePipeline,
}

impl Rig {
    fn new(effects: Effects, options: CutOptions) -> Self {
        Self::choosing(effects, options, CHOOSE)
    }

    /// With another text that chooses lights.
    fn choosing(effects: Effects, options: CutOptions, work: &str) -> Self {
        let (device, _) = gpu();
        let lights = lights_with(&GpuOptions::default().with_cuts(options));
        let own = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: None,
            entries: &[storage_entry(0, true), storage_entry(1, false)],
        });
        let shader = lights.shader(1, effects);
        let pipeline = |work: &str| compute_pipeline(engine(&shader, work), "engine", [&own, &shader.layout]);
        let [mark, choose] = [MARK, work].map(pipeline);
        Self { lights, own, mark, choose }
    }

    /// Marks points, builds cuts, and chooses lights for other points.
    fn run(&mut self, marked: &[Input], chosen: &[Input]) -> Vec<Output> {
        let (device, queue) = gpu();
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.lights.build_top(&mut encoder);
        if !marked.is_empty() {
            self.pass(&mut encoder, &self.mark, marked);
            self.lights.build_cuts(&mut encoder);
        }
        let output = self.pass(&mut encoder, &self.choose, chosen);
        queue.submit([encoder.finish()]);
        read(&device, &queue, &output)
    }

    fn pass(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        pipeline: &wgpu::ComputePipeline,
        inputs: &[Input],
    ) -> wgpu::Buffer {
        let (device, _) = gpu();
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
        let group = bind(&device, "test", &self.own, &[&input, &output]);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.set_bind_group(1, self.lights.bind_group(), &[]);
        pass.dispatch_workgroups((inputs.len() as u32).div_ceil(64), 1, 1);
        drop(pass);
        output
    }

    /// Marked, built, kept, rare, refused, lost.
    fn report(&self) -> [u32; 6] {
        let (device, queue) = gpu();
        let words: Vec<u32> = read(&device, &queue, self.lights.cut_report().expect("a table"));
        std::array::from_fn(|i| words[4 + i])
    }

    /// The words of the cuts behind the grid, and those of the marks.
    fn tables(&self) -> [Vec<u32>; 2] {
        let (device, queue) = gpu();
        let tables = self.lights.planner.cells().expect("a table");
        let [cuts, marks] = tables.map(|id| read::<u32>(&device, &queue, self.lights.player.buffer(id)));
        [cuts[STATE_AT as usize / 4..].to_vec(), marks]
    }

    /// The cuts by cell.
    fn cuts(&self, options: CutOptions) -> BTreeMap<[u32; 5], Row> {
        let places = CutPlaces::new(options, None);
        let [words, marks] = self.tables();
        let slots = marks[HEAD as usize..].chunks_exact(SLOT_WORDS as usize).take(places.slots as usize);
        // What shaders look up, and where its row begins.
        let shown = words[4..].chunks_exact(4);
        let row_of = |slot: &[u32]| places.first_row + (slot[2] - 1) * ROW_QUADS;
        let used = slots.zip(shown).filter(|(slot, shown)| {
            let is_used = slot[0] != 0 && slot[3] != 0;
            let known = if is_used { [slot[0], row_of(slot)] } else { [0; 2] };
            assert_eq!(shown[..2], known, "shaders see what is built");
            is_used
        });
        used.map(|(slot, shown)| {
            assert!(slot[1] == 0 && slot[9..].iter().all(|word| *word == 0), "marks are forgotten: {slot:?}");
            let start = 4 * row_of(slot) as usize;
            let row = &words[start..start + 4 * ROW_QUADS as usize];
            let nodes = &row[4 * ROW_NODES as usize..][..2 * (row[0] & 0xffff) as usize];
            let sums = &row[4 * ROW_SUMS as usize..4 * ROW_FROM as usize];
            let ends: Vec<u32> = sums.chunks_exact(16).map(|block| block[15]).collect();
            assert_eq!(row[4..20], ends, "the ends of blocks");
            assert!(row[3] == sums[sums.len() - 1] && row[3] <= crate::sampling::cuts::UNITS);
            let cell = [slot[4], slot[5], slot[6], slot[7], slot[8]];
            let nodes = nodes.chunks_exact(2).map(|node| [node[0], node[1]]).collect();
            let byte = |word: u32, k: usize| word.to_le_bytes()[k];
            let row = Row {
                nodes,
                sums: sums.to_vec(),
                points: row[0] >> 16,
                directional: f32::from_bits(row[2]),
                contested: [0, 1, 2, 3].map(|k| Contested { node: byte(shown[2], k), children: byte(shown[3], k) }),
                rest: f32::from_bits(row[1]),
            };
            (cell, row)
        })
        .collect()
    }
}

/// Lights with these cells, whose kernels are compiled once for all tests.
fn lights_with(options: &GpuOptions) -> GpuLights {
    let mut lights = gpu_lights();
    lights.make_cells(options).expect("memory enough");
    lights.rebind();
    lights
}

/// The text of a shader that does this work.
fn engine(shader: &LightShader, work: &str) -> String {
    shader.join(&ENGINE.replace("WORK", work))
}

/// A cut on the GPU.
struct Row {
    nodes: Vec<[u32; 2]>,
    sums: Vec<u32>,
    points: u32,
    contested: [Contested; 4],
    rest: f32,
    directional: f32,
}

/// Shading points near a few places; a number of them are glossy.
fn inputs(count: u32, eye: Vec3, seed: u32) -> Vec<Input> {
    let input = |i: u32| {
        let at = |k: u32| unit(seed + 31 * i + k);
        let middle = Vec3::new(unit(i % 40), 0.05, unit(777 + i % 40)) * 40.0;
        let position = middle + Vec3::new(at(0), 0.1 * at(1), at(2)) * 2.0;
        let normal = match i % 7 {
            0 => Vec3::ZERO,
            1 => Vec3::X,
            2 => Vec3::new(at(3) - 0.5, 1.0, at(4) - 0.5).normalize(),
            _ => Vec3::Y,
        };
        let roughness = if i.is_multiple_of(5) { 0.3 } else { -1.0 };
        Input {
            position: position.to_array(),
            roughness,
            normal: normal.to_array(),
            mask: u32::MAX,
            view: (eye - position).normalize().to_array(),
            more_padding: 0,
            u: [at(5), at(6), at(7), at(8)],
        }
    };
    (0..count).map(input).collect()
}

fn glossy_world() -> LightWorld {
    let mut world = mixed_world();
    world.set_glossy_sampling(true);
    world
}

fn point(input: &Input) -> ShadingPoint {
    let point = ShadingPoint::surface(input.position.into(), input.normal.into()).with_mask(input.mask);
    if input.roughness < 0.0 {
        return point;
    }
    point.with_gloss(Gloss { view: input.view.into(), roughness: input.roughness, specular: 0.3, diffuse: 0.4 })
}

fn mark(world: &LightWorld, table: &CutTable, inputs: &[Input]) {
    let sampler = world.sampler().with_cuts(table);
    inputs.iter().for_each(|input| sampler.mark(&point(input)));
}

/// The number of choices that name another light or another probability than the CPU's.
fn others(sampler: &LightSampler<'_>, inputs: &[Input], outputs: &[Output]) -> usize {
    let sampler = sampler.from_roots();
    let is_other = |(input, output): &(&Input, &Output)| {
        let Some(pick) = sampler.pick(&point(input), [input.u[0], input.u[1]]) else { return output.pmf > 0.0 };
        let (instance, light) = match pick.light {
            LightId::Local { instance, light } => (sampler.world.slot(instance).expect("it lives"), light),
            LightId::Directional(_) => (u32::MAX, 0),
        };
        (output.instance, output.light) != (instance, light) || (output.pmf / pick.pmf - 1.0).abs() > 2.0e-3
    };
    inputs.iter().zip(outputs).filter(is_other).count()
}

/// As [`others`] for one of eight candidates, where cells have cuts.
fn other_reservoirs(sampler: &LightSampler<'_>, inputs: &[Input], outputs: &[Output]) -> usize {
    let is_other = |(input, output): &(&Input, &Output)| {
        let (at, [x, y, z, w]) = (point(input), input.u);
        let kept = sampler.resample(&at, [x, y, z, w, x], 8);
        let Some(light) = kept.light else { return output.pmf > 0.0 };
        let (instance, light) = match light {
            LightId::Local { instance, light } => (sampler.world.slot(instance).expect("it lives"), light),
            LightId::Directional(_) => (u32::MAX, 0),
        };
        (output.instance, output.light) != (instance, light) || (output.pmf / kept.weight - 1.0).abs() > 1.0e-2
    };
    let has_cut = |(input, _): &(&Input, &Output)| sampler.shared_cut(&point(input)).is_some();
    inputs.iter().zip(outputs).filter(has_cut).filter(is_other).count()
}

fn assert_exact(outputs: &[Output]) {
    let chosen = outputs.iter().filter(|output| output.pmf > 0.0);
    let far = chosen.clone().filter(|output| (output.pmf_of_light / output.pmf - 1.0).abs() > 1.0e-4);
    assert!(far.count() == 0 && chosen.count() > outputs.len() / 2, "a pick and its probability agree");
}

const EYE: Vec3 = Vec3::new(20.0, 12.0, -3.0);

fn options() -> CutOptions {
    CutOptions::new(2.0, 1024).expect("valid").with_min_marks(2)
}

#[test]
fn the_gpu_builds_the_cuts_that_the_cpu_builds_and_chooses_the_same_lights() {
    let world = glossy_world();
    let mut rig = Rig::new(Effects::all(), options());
    rig.lights.upload(&world).expect("room enough");
    let pixel = 0.01;
    rig.lights.set_cut_view(EYE.as_dvec3(), pixel);
    let mut table = CutTable::new(options());
    table.set_view(EYE.as_dvec3(), pixel);
    let (marked, chosen) = (inputs(3000, EYE, 0), inputs(3000, EYE, 500_000));
    mark(&world, &table, &marked);
    table.build(world.sampler());
    let outputs = rig.run(&marked, &chosen);
    let report = table.report();
    let known = [report.marked, report.built, report.kept, report.rare, report.refused, report.lost_marks];
    let found = rig.report();
    // A point within rounding of a border may mark another cell.
    for (found, known) in found.iter().zip(known) {
        assert!(found.abs_diff(known as u32) <= 4, "{found:?} {known:?}");
    }
    assert!(report.built > 100 && report.rare > 20 && report.refused == 0, "{report:?}");

    let cuts = rig.cuts(options());
    let (mut alike, mut total, mut contested) = (0, 0, 0);
    let grid = options().grid(camera(EYE.as_dvec3(), pixel), DVec3::ZERO);
    // The first node of each instance's tree in the buffer of nodes. The GPU gives the nodes of the top
    // level other numbers.
    let mut bases = BTreeMap::new();
    for input in &marked {
        let (cell, _) = grid.cell(&point(input)).expect("the camera sees it");
        let [x, y, z] = cell.corner;
        let at = point(input);
        let sampler = world.sampler().with_cuts(&table);
        let Some(cut) = sampler.shared_cut(&at).map(|placed| placed.cut) else { continue };
        total += 1;
        let Some(row) = cuts.get(&[x, y, z, cell.kind, cell.mask]) else { continue };
        let mut is_node = |[instance, index]: [u32; 2], node: &NodeId| {
            let base = *bases.entry(instance).or_insert(index.wrapping_sub(node.node));
            instance == node.instance && (instance == u32::MAX || index == node.node.wrapping_add(base))
        };
        let sums = cut.sums().iter().zip(&row.sums);
        let is_alike = row.nodes.len() == cut.count
            && row.nodes.iter().zip(&cut.nodes).all(|(a, b)| is_node(*a, b))
            && cut.points as u32 == row.points
            && (cut.directional - row.directional).abs() <= 1.0e-3 * cut.directional
            && cut.contested == row.contested
            && (cut.rest - row.rest).abs() <= 1.0e-3 * cut.rest
            && sums.clone().all(|(a, b)| a.abs_diff(*b) <= crate::sampling::cuts::UNITS / 4096)
            && row.sums[WIDTH * cut.count..].iter().all(|sum| *sum == cut.total());
        alike += usize::from(is_alike);
        contested += usize::from(cut.contested[0].children != 0);
    }
    assert!(total > 1500 && alike * 50 >= total * 49 && contested > 300, "{alike} of {total}, {contested}");

    assert_exact(&outputs);
    let sampler = world.sampler().with_cuts(&table);
    let count = others(&sampler, &chosen, &outputs);
    assert!(count <= chosen.len() / 50, "{count} of {}", chosen.len());
    let without = others(&world.sampler(), &chosen, &outputs);
    assert!(without > chosen.len() / 3, "cuts matter: {without}");
}

/// Three lamps between the points of large cells: each point weighs all of them itself, so no cell has units.
#[test]
fn cells_whose_candidates_are_all_contested_choose_as_on_the_cpu() {
    let mut world = LightWorld::new();
    let lamps = (0..3).map(|i| Light::point(Vec3::new(i as f32, 0.3, 0.5 * i as f32), Vec3::splat(1.0 + i as f32)));
    let tree = world.add_tree(LightTree::new(lamps.collect()).expect("valid"));
    world.add_instance(tree, Placement::IDENTITY, Policy::Static).expect("valid");
    world.update(FrameBudget::UNLIMITED);
    let mut rig = Rig::new(Effects::all(), options());
    rig.lights.upload(&world).expect("room enough");
    let mut table = CutTable::new(options());
    let input = |i: u32, seed: u32| Input {
        position: [unit(seed + 9 * i) * 4.0 - 1.0, 0.0, unit(seed + 9 * i + 1) * 4.0 - 1.0],
        roughness: -1.0,
        normal: [0.0, 1.0, 0.0],
        mask: u32::MAX,
        view: [0.0; 3],
        more_padding: 0,
        u: [2, 3, 4, 5].map(|k| unit(seed + 9 * i + k)),
    };
    let [marked, chosen] = [0, 900_000].map(|seed| (0..3000).map(|i| input(i, seed)).collect::<Vec<_>>());
    mark(&world, &table, &marked);
    table.build(world.sampler());
    let sampler = world.sampler().with_cuts(&table);
    let has_no_units = |input: &Input| {
        sampler.shared_cut(&point(input)).is_some_and(|placed| placed.cut.total() == 0 && placed.cut.count > 0)
    };
    let all_contested = chosen.iter().filter(|input| has_no_units(input)).count();
    let outputs = rig.run(&marked, &chosen);
    assert_exact(&outputs);
    let count = others(&sampler, &chosen, &outputs);
    assert!(all_contested > 1000 && count <= chosen.len() / 100, "{all_contested} {count}");
}

/// The nodes that a sample weighs, and one of eight candidates: 3.2 and 25 where a cell has a cut; 0.45 and 3.7 without
/// contested nodes, which nearly all of these cells have, two metres wide and with lamps in them. A candidate of the cut
/// itself takes no node, but four bytes of one. The build of a cell weighs up to 256 nodes.
#[test]
fn choices_from_a_cell_read_few_nodes() {
    let mut world = glossy_world();
    let sky = world.sky().map(|(sky, _)| sky).expect("a sky");
    world.remove_instance(sky).expect("it lives");
    let mut rig = Rig::new(EFFECTS, options());
    let text = text::wgsl_counting(1, EFFECTS) + &ENGINE.replace("WORK", COUNT);
    let pipeline = compute_pipeline(text, "engine", [&rig.own, rig.lights.bind_group_layout()]);
    rig.lights.upload(&world).expect("room enough");
    rig.lights.set_cut_view(EYE.as_dvec3(), 0.01);
    let mut table = CutTable::new(options());
    table.set_view(EYE.as_dvec3(), 0.01);
    let at = inputs(3000, EYE, 0);
    mark(&world, &table, &at);
    table.build(world.sampler());
    rig.run(&at, &at[..1]);

    let (device, queue) = gpu();
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let output = rig.pass(&mut encoder, &pipeline, &at);
    queue.submit([encoder.finish()]);
    let found: Vec<[u32; 4]> = read(&device, &queue, &output);
    let sampler = world.sampler().with_cuts(&table);
    let has_cut = |input: &Input| sampler.shared_cut(&point(input)).is_some();
    let known: Vec<[u32; 4]> =
        at.iter().zip(found).filter(|(input, _)| has_cut(input)).map(|(_, found)| found).collect();
    let mean = |i: usize| known.iter().map(|found| f64::from(found[i])).sum::<f64>() / known.len() as f64;
    assert!(known.len() > 1500 && mean(2) > 0.5 && mean(3) > 0.5);
    assert!(mean(0) < 3.6 && mean(1) < 26.0, "{} {}", mean(0), mean(1));
}

#[test]
fn cells_know_what_shadow_rays_have_taught_as_on_the_cpu() {
    let (device, queue) = gpu();
    let world = glossy_world();
    let mut rig = Rig::new(EFFECTS, options());
    let learning = VisibilityOptions::new(4.0, 1024).expect("valid");
    rig.lights = lights_with(&GpuOptions::default().with_cuts(options()).with_learning(learning));
    let shader = rig.lights.shader(1, EFFECTS).with_learning();
    let [choose, resample] = [CHOOSE_AND_RECORD, RESAMPLE]
        .map(|work| compute_pipeline(engine(&shader, work), "engine", [&rig.own, &shader.layout]));
    rig.lights.upload(&world).expect("room enough");
    rig.lights.set_cut_view(EYE.as_dvec3(), 0.01);
    let (mut table, mut learnt) = (CutTable::new(options()), VisibilityTable::new(learning));
    table.set_view(EYE.as_dvec3(), 0.01);
    let at = inputs(3000, EYE, 0);
    for frame in 0..10 {
        mark(&world, &table, &at);
        table.build(world.sampler().with_visibility(&learnt));
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        rig.lights.build_top(&mut encoder);
        rig.pass(&mut encoder, &rig.mark, &at);
        rig.lights.build_cuts(&mut encoder);
        let kept_of_eight = rig.pass(&mut encoder, &resample, &at);
        let chosen = rig.pass(&mut encoder, &choose, &at);
        queue.submit([encoder.finish()]);
        let outputs: Vec<Output> = read(&device, &queue, &chosen);
        let [_, built, kept, ..] = rig.report();
        // In the first frame cells get rows and nothing is learnt. Young cells are built again when they have learnt, and
        // later in turn.
        let (report, is_whole) = (table.report(), [0, 2, 4].contains(&frame));
        assert!(built.abs_diff(report.built as u32) <= 4 && kept.abs_diff(report.kept as u32) <= 4);
        assert!(built + kept > 100 && is_whole == (kept == 0), "frame {frame}: {built} {kept}");
        let sampler = world.sampler().with_visibility(&learnt).with_cuts(&table);
        // As above, and a mean position within rounding of the border between two groups may count in the other one.
        let count = others(&sampler, &at, &outputs);
        assert!(count <= at.len() / 40, "frame {frame}: {count} of {}", at.len());
        if frame == 9 {
            let kept: Vec<Output> = read(&device, &queue, &kept_of_eight);
            // Eight draws and one choice are each as exact as a pick.
            let count = other_reservoirs(&sampler, &at, &kept);
            assert!(count <= at.len() / 10, "{count} of {}", at.len());
            let count = other_reservoirs(&world.sampler().with_cuts(&table), &at, &kept);
            assert!(count > at.len() / 5, "candidates are kept by what is learnt: {count}");
            let mut plain = CutTable::new(options());
            plain.set_view(EYE.as_dvec3(), 0.01);
            mark(&world, &plain, &at);
            plain.build(world.sampler());
            let count = others(&world.sampler().with_cuts(&plain), &at, &outputs);
            assert!(count > at.len() / 3, "what is learnt matters: {count}");
        }
        for (input, output) in at.iter().zip(&outputs).filter(|(_, output)| output.pmf > 0.0) {
            let Some(instance) = world.instance_at(output.instance) else { continue };
            let is_visible = (output.instance + output.light / 4).is_multiple_of(3);
            let (at, light) = (point(input), LightId::Local { instance, light: output.light });
            if let Some(incident) = sampler.sample_light(&at, light, [0.25, 0.75]) {
                let sample = LightSample { light, pmf: output.pmf, incident, user_data: 0 };
                sampler.record_visibility(&at, &sample, is_visible);
            }
        }
        learnt.end_frame();
    }
    assert!(learnt.cell_count() > 50, "{learnt:?}");
    // A build without marks gives all rows back, and folds what was recorded. One without records keeps what is known.
    let [first, second] = [0; 2].map(|_| {
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        rig.lights.build_cuts(&mut encoder);
        queue.submit([encoder.finish()]);
        let [words, _] = rig.tables();
        words[4 * CutPlaces::new(options(), Some(learning)).learnt as usize..].to_vec()
    });
    let rows = learning.cells() * 9 / 8;
    assert!(first[16..16 + rows] == second[16..16 + rows] && first[16 + 2 * rows..] == second[16 + 2 * rows..]);
    assert!(first[16..16 + rows].iter().filter(|tag| *tag & 1 != 0).count() > 50, "the tags of what is known");
    // What was recorded before was folded with the first of them.
    rig.lights.forget_visibility();
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    rig.lights.build_cuts(&mut encoder);
    queue.submit([encoder.finish()]);
    let [words, _] = rig.tables();
    let tags = &words[4 * CutPlaces::new(options(), Some(learning)).learnt as usize + 16..][..rows];
    assert!(tags.iter().all(|tag| *tag == 0), "nothing is known");
}

/// The effects of the world of these tests, and glossy points.
const EFFECTS: Effects = Effects::CONES
    .union(Effects::RANGES)
    .union(Effects::AREAS)
    .union(Effects::DIRECTIONAL)
    .union(Effects::NON_RIGID)
    .union(Effects::SOLID_ANGLES)
    .union(Effects::GLOSSY)
    .union(Effects::SKY)
    .union(Effects::PROFILES);

fn assert_as_without_cuts(world: &LightWorld, chosen: &[Input], outputs: &[Output]) {
    let count = others(&world.sampler(), chosen, outputs);
    assert!(count <= chosen.len() / 100, "{count} of {}", chosen.len());
}

#[test]
fn cuts_are_kept_while_nothing_changes_and_void_after_a_change_until_they_are_built_again() {
    let mut world = glossy_world();
    assert!(EFFECTS.contains(world.effects() - Effects::MOVING));
    let mut rig = Rig::new(EFFECTS, options());
    rig.lights.upload(&world).expect("room enough");
    let (marked, chosen) = (inputs(3000, EYE, 0), inputs(1500, EYE, 500_000));
    assert_as_without_cuts(&world, &chosen, &rig.run(&[], &chosen));
    rig.lights.set_cut_view(EYE.as_dvec3(), 0.01);
    let first = rig.run(&marked, &chosen);
    let [all, built, kept, rare, ..] = rig.report();
    assert!(built > 100 && kept == 0 && all == built + rare);
    let cuts = rig.cuts(options());

    let again = rig.run(&marked, &chosen);
    let report = rig.report();
    // Cells that no light reaches have no cut to keep.
    assert!(report[2] >= built * 9 / 10 && report[1] + report[2] == built, "{report:?}");
    assert!(again == first && rig.cuts(options()).keys().eq(cuts.keys()));

    // Glossy cells depend on the view.
    let eye = EYE + Vec3::new(5.0, 0.0, 2.0);
    rig.lights.set_cut_view(eye.as_dvec3(), 0.01);
    rig.run(&inputs(3000, eye, 0), &inputs(1500, eye, 500_000));
    let [_, built, kept, ..] = rig.report();
    let glossy = rig.cuts(options()).keys().filter(|cell| cell[3] >> crate::sampling::cuts::GLOSS_SHIFT != 0).count();
    assert!(glossy > 20 && built as usize >= glossy && kept > 100, "{glossy} {built} {kept}");

    assert_eq!(rig.lights.upload(&world).expect("nothing has changed").bytes, 0);
    let instance = world.instance_at(3).expect("it lives");
    let placement = world.instance(instance).expect("it lives").placement;
    let lifted = Placement { translation: placement.translation + DVec3::Y, ..placement };
    world.move_instance(instance, lifted).expect("valid");
    world.update(FrameBudget::NONE);
    rig.lights.upload(&world).expect("room enough");
    assert_as_without_cuts(&world, &chosen, &rig.run(&[], &chosen));
    rig.lights.set_cut_view(EYE.as_dvec3(), 0.01);
    let outputs = rig.run(&marked, &chosen);
    assert_exact(&outputs);
    assert!(outputs != first);

    // Cells stay where they are when the origin moves.
    let cells: Vec<_> = rig.cuts(options()).into_keys().collect();
    world.set_origin_near(DVec3::new(3.25, 0.5, -1100.0)).expect("finite");
    rig.lights.upload(&world).expect("room enough");
    let moved = |inputs: &[Input]| -> Vec<Input> {
        let moved = |input: &Input| {
            let position = (DVec3::from(Vec3::from(input.position)) - world.origin()).as_vec3().to_array();
            Input { position, ..*input }
        };
        inputs.iter().map(moved).collect()
    };
    let outputs = rig.run(&moved(&marked), &moved(&chosen));
    assert_exact(&outputs);
    let found: Vec<_> = rig.cuts(options()).into_keys().collect();
    let same = cells.iter().filter(|cell| found.contains(cell)).count();
    assert!(same * 50 >= cells.len() * 49, "{same} of {}", cells.len());
}

#[test]
fn cells_keep_their_cuts_as_on_the_cpu_while_lights_move_come_and_go() {
    let mut world = glossy_world();
    let mut rig = Rig::new(EFFECTS | Effects::MASKS, options());
    rig.lights.set_cut_view(EYE.as_dvec3(), 0.01);
    let mut table = CutTable::new(options());
    table.set_view(EYE.as_dvec3(), 0.01);
    let at = inputs(3000, EYE, 0);
    let (mut all, mut some) = (0, 0);
    for frame in 0..16 {
        let keys: Vec<_> = world.instances().collect();
        for (i, key) in keys.iter().enumerate().filter(|(i, _)| i % 5 == frame % 5) {
            let placement = world.instance(*key).expect("it lives").placement;
            let by = 0.1 * DVec3::new(f64::from(unit(i as u32)) - 0.5, 0.0, 0.5);
            if frame > 0 && Some(*key) != world.sky().map(|(sky, _)| sky) {
                let moved = Placement { translation: placement.translation + by, ..placement };
                world.move_instance(*key, moved).expect("valid");
            }
        }
        match frame {
            3 => world.remove_instance(keys[4]).expect("it lives"),
            5 => {
                let tree = world.instance(keys[5]).expect("it lives").tree;
                let placement = world.instance(keys[5]).expect("it lives").placement;
                world.add_instance(tree, placement, Policy::Static).expect("valid");
            }
            7 => world.set_appearance(keys[6], |a| a.factor = Vec3::splat(20.0)).expect("valid"),
            9 => world.set_appearance(keys[7], |a| a.mask = 2).expect("valid"),
            _ => {}
        }
        world.update(FrameBudget::NONE);
        rig.lights.upload(&world).expect("room enough");
        mark(&world, &table, &at);
        table.build(world.sampler());
        let outputs = rig.run(&at, &at);
        assert_exact(&outputs);
        let (report, [_, built, kept, ..]) = (table.report(), rig.report());
        // The names of nodes are not the same, but change together.
        let far = built.abs_diff(report.built as u32).max(kept.abs_diff(report.kept as u32));
        assert!(far <= 8 && built + kept > 100, "frame {frame}: {built} {kept} {report:?}");
        let sampler = world.sampler().with_cuts(&table);
        let count = others(&sampler, &at, &outputs);
        assert!(count <= at.len() / 25, "frame {frame}: {count} of {}", at.len());
        (all, some) = (all + usize::from(kept == 0), some + usize::from(kept > built));
    }
    assert!(all >= 1 && some >= 8, "{all} {some}");
}

#[test]
fn what_has_no_room_is_refused_and_rows_come_back() {
    let world = glossy_world();
    // As many rows as there are cells, one less, and a tenth; in the end one cell, with 16 places for marks.
    let (marked, chosen) = (inputs(3000, EYE, 0), inputs(1000, EYE, 500_000));
    let mut rig = Rig::new(EFFECTS, options());
    rig.lights.upload(&world).expect("room enough");
    rig.run(&marked, &chosen);
    let [_, wanted, ..] = rig.report();
    for (rows, refused) in [(wanted, 0), (wanted - 1, 1), (wanted / 10, 0)] {
        let options = CutOptions::new(2.0, rows as usize).expect("valid").with_min_marks(2);
        rig.lights = lights_with(&GpuOptions::default().with_cuts(options));
        rig.lights.upload(&world).expect("room enough");
        for _ in 0..3 {
            let outputs = rig.run(&marked, &chosen);
            assert_exact(&outputs);
            let [marked, built, kept, rare, found, lost] = rig.report();
            // With a tenth of the rows, there are places for a third of the marked cells.
            let has_places = rows >= wanted / 2;
            assert!(built + kept == rows && found >= refused && (lost == 0) == has_places, "{found} {lost}");
            assert!(!has_places || found == refused);
            assert_eq!(marked, built + kept + rare + found);
        }
        // Other cells take the rows, once those have been free for a frame.
        let others = inputs(3000, EYE, 0).into_iter().map(|input| {
            let [x, y, z] = input.position;
            Input { position: [x + 64.0, y, z], ..input }
        });
        let others: Vec<_> = others.collect();
        rig.run(&others, &chosen);
        let [marked, built, kept, rare, found, _] = rig.report();
        assert_eq!((built, kept, marked), (0, 0, rare + found));
        rig.run(&others, &chosen);
        let [_, built, kept, rare, found, _] = rig.report();
        assert!(rare > 0 && built == rows.min(built + found) && kept == 0, "{built} {kept} {rare} {found}");
    }
    let one = CutOptions::new(2.0, 1).expect("valid").with_min_marks(2);
    rig.lights = lights_with(&GpuOptions::default().with_cuts(one));
    rig.lights.upload(&world).expect("room enough");
    let outputs = rig.run(&marked, &chosen);
    assert_exact(&outputs);
    let [marked, built, _, rare, refused, lost] = rig.report();
    assert!(marked == 16 && built == 1 && built + rare + refused == 16 && lost > 1000);
}

#[test]
fn each_buffer_of_a_table_may_be_refused() {
    let (device, queue) = noop();
    let options = GpuOptions::default().with_learning(VisibilityOptions::default());
    let mut refused = Vec::new();
    for successes in 0.. {
        let refusals = Refusals::of_buffers_after(successes);
        let result = GpuLights::with_options(&device, &queue, options);
        if refusals.count() == 0 {
            assert!(result.is_ok());
            break;
        }
        let Err(GpuError::OutOfMemory { what, .. }) = result else { panic!("{result:?}") };
        refused.push(what);
    }
    for what in ["shared cuts", "marks of cells", "report of shared cuts", "known visibility"] {
        assert!(refused.contains(&what), "{refused:?}");
    }
}

#[test]
fn the_largest_table_fits_what_webgpu_lets_a_shader_bind() {
    let learning = VisibilityOptions::new(1.0, 16_384).expect("the most that learn");
    let most = CutPlaces::new(CutOptions::new(0.25, 65_536).expect("the most cells"), Some(learning)).bytes();
    assert!(most[0].max(most[1]) <= wgpu::Limits::default().max_storage_buffer_binding_size, "{most:?}");
}
