//! Copies records from one stored layout to another on the GPU, so that a change of layout sends no
//! records from the CPU.

use super::error::GpuError;
use super::memory;
use super::stages::{Access, Stages, dispatch};
use super::stored::{Missing, Stored};

/// Invocations in a workgroup. Each writes 16 bytes.
const LANES: u32 = 64;

/// The longest record, in units of 16 bytes.
const MAX_QUADS: usize = 13;

/// The entry of [`RelayoutPass::sources`] for a word that was not stored.
const NOT_STORED: u32 = u32::MAX;

/// Twin of `RelayoutPass` in `shaders/relayout.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
struct RelayoutPass {
    /// The number of records.
    records: u32,
    /// The stride in the old layout, in words.
    words_before: u32,
    /// The stride in the new layout, in units of 16 bytes.
    quads_after: u32,
    padding: u32,
    /// For each word of the new record its offset in the old record, or [`NOT_STORED`].
    sources: [[u32; 4]; MAX_QUADS],
    /// For each word of the new record its value if it was not stored.
    values: [[u32; 4]; MAX_QUADS],
}

impl RelayoutPass {
    fn new(records: u32, before: &Stored, after: &Stored, missing: fn(usize) -> Missing) -> Self {
        let mut pass = Self {
            records,
            words_before: before.bytes() as u32 / 4,
            quads_after: after.bytes() as u32 / 16,
            padding: 0,
            sources: [[NOT_STORED; 4]; MAX_QUADS],
            values: [[0; 4]; MAX_QUADS],
        };
        for (place, word) in after.words().enumerate() {
            let source = before.word_offset(word).map_or_else(|| missing(word), Missing::Word);
            match source {
                Missing::Value(value) => pass.values[place / 4][place % 4] = value,
                Missing::Word(source) => pass.sources[place / 4][place % 4] = source as u32,
            }
        }
        pass
    }
}

/// The pipeline that copies records, and the uniform that each copy overwrites and submits at once.
#[derive(Debug)]
pub(crate) struct Relayout {
    stages: Stages,
    pipeline: wgpu::ComputePipeline,
    uniform: wgpu::Buffer,
}

impl Relayout {
    /// Compiles the pipeline.
    pub(crate) fn new(device: &wgpu::Device) -> Result<Self, GpuError> {
        let bytes = size_of::<RelayoutPass>() as u64;
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let uniform = memory::create_buffer(device, "relayout", bytes, usage)?;
        let stages = Stages::new(device, "relayout", bytes, &[Access::Read, Access::Write]);
        let pipeline = stages.pipeline(device, "relayout", text());
        Ok(Self { stages, pipeline, uniform })
    }

    /// Submits a copy of the first `records` records from one buffer to another, which must have
    /// room for them. Returns the bytes that it sends: a few hundred.
    pub(crate) fn submit(
        &self,
        (device, queue): (&wgpu::Device, &wgpu::Queue),
        records: u32,
        (from, before): (&wgpu::Buffer, &Stored),
        (to, after): (&wgpu::Buffer, &Stored),
        missing: fn(usize) -> Missing,
    ) -> u64 {
        let pass = RelayoutPass::new(records, before, after, missing);
        queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(&pass));
        let group = self.stages.bind(device, &self.uniform, &[from, to]);
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut compute = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("girandole relayout"),
                timestamp_writes: None,
            });
            compute.set_pipeline(&self.pipeline);
            compute.set_bind_group(0, &group, &[0]);
            dispatch(&mut compute, (records * pass.quads_after).div_ceil(LANES));
        }
        queue.submit([encoder.finish()]);
        size_of::<RelayoutPass>() as u64
    }
}

fn text() -> String {
    format!(
        "const RELAYOUT_LANES: u32 = {LANES}u;\nconst RELAYOUT_QUADS: u32 = {MAX_QUADS}u;\n\
         const RELAYOUT_NOT_STORED: u32 = {NOT_STORED}u;\n{}",
        include_str!("../../shaders/relayout.wgsl")
    )
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Mat3, Quat, Vec3};
    use naga::TypeInner;

    use super::*;
    use crate::appearance::Appearance;
    use crate::effects::Effects;
    use crate::gpu::layout::{Bases, InstanceRecord, LightRecord};
    use crate::gpu::pool::Pool;
    use crate::gpu::stored::{missing_of_instance, missing_of_light, missing_of_node};
    use crate::gpu::testing::{gpu, read};
    use crate::light::Light;
    use crate::placement::{Placed, Placement};
    use crate::tree::{LightTree, Node};

    /// Effects that between them use every layout of every record.
    const LAYOUTS: [Effects; 11] = [
        Effects::empty(),
        Effects::CONES,
        Effects::RANGES,
        Effects::CONES.union(Effects::RANGES),
        Effects::AREAS,
        Effects::DIRECTIONAL,
        Effects::NON_RIGID,
        Effects::NON_RIGID.union(Effects::CONES),
        Effects::FACTORS,
        Effects::NON_RIGID.union(Effects::MASKS),
        Effects::all(),
    ];

    /// A tree of lights that need no more than these effects; some of the lights are dark.
    fn tree(effects: Effects) -> LightTree {
        let light = |i: u32| {
            let at = Vec3::new((i * 7 % 50) as f32, (i * 13 % 31) as f32, (i * 3 % 17) as f32);
            let emission = if i.is_multiple_of(11) { Vec3::ZERO } else { Vec3::splat(1.0 + i as f32) };
            let light = match i % 3 {
                1 if effects.contains(Effects::CONES) => Light::spot(at, Vec3::NEG_Y, 0.2, 0.9, emission),
                2 if effects.contains(Effects::AREAS) => Light::sphere(at, 0.1, emission),
                _ => Light::point(at, emission),
            };
            if effects.contains(Effects::RANGES) && i.is_multiple_of(2) { light.with_range(5.0) } else { light }
        };
        LightTree::new((0..100).map(light).collect()).expect("valid lights")
    }

    /// Instances that need no more than these effects; some of the slots are empty.
    fn instances(effects: Effects) -> Vec<InstanceRecord> {
        let instance = |i: u32| {
            if i.is_multiple_of(5) {
                return InstanceRecord::NONE;
            }
            let rotation = Mat3::from_quat(Quat::from_axis_angle(Vec3::new(1.0, 2.0, 3.0).normalize(), 0.1 * i as f32));
            let scale = if effects.contains(Effects::NON_RIGID) { 0.5 + i as f32 } else { 1.0 };
            let placement = Placement { linear: rotation * scale, translation: DVec3::new(f64::from(i), 2.0, -3.0) };
            let placed = Placed::new(&placement, DVec3::ZERO).expect("a valid placement").expect("not hidden");
            assert_eq!(placed.linear.is_rigid(), scale == 1.0);
            let mut appearance = Appearance::default();
            if effects.contains(Effects::FACTORS) && i.is_multiple_of(3) {
                appearance.set_factor(Vec3::new(0.5, 2.0, i as f32));
            }
            if effects.contains(Effects::MASKS) {
                appearance.mask = i;
            }
            InstanceRecord::of(&placed, &appearance, Bases { tree: i, node: 10 * i, light: 20 * i, ..Bases::default() })
        };
        (0..40).map(instance).collect()
    }

    /// Compares a pool that was filled in one layout and then copied to another with a pool that
    /// was filled in the other layout.
    fn check<T: bytemuck::NoUninit>(
        relayout: &Relayout,
        records: &[T],
        stored: [&Stored; 2],
        missing: fn(usize) -> Missing,
    ) {
        let (device, queue) = gpu();
        let fill = |pool: &mut Pool<T>| {
            pool.alloc(records.len() as u32).expect("room enough");
            pool.write(0, records)
        };
        let [before, after] = stored;
        let pool = || Pool::<T>::new(&device, &queue, "test records", 1).expect("room");
        let (mut moved, mut fresh) = (pool(), pool());
        moved.set_layout(before.clone(), missing, relayout);
        fresh.set_layout(after.clone(), missing, relayout);
        assert_eq!(fill(&mut moved), (records.len() * before.bytes()) as u64);
        assert_eq!(fill(&mut fresh), (records.len() * after.bytes()) as u64);
        moved.set_layout(after.clone(), missing, relayout);
        let bytes = |pool: &Pool<T>| read::<u32>(&device, &queue, pool.buffer());
        assert_eq!(bytes(&moved), bytes(&fresh), "{before:?} to {after:?}");
    }

    #[test]
    fn a_copy_to_a_new_layout_equals_an_upload_in_that_layout_byte_for_byte() {
        let (device, _) = gpu();
        let relayout = Relayout::new(&device).expect("room enough");
        for before in LAYOUTS {
            for after in LAYOUTS {
                let tree = tree(before & after);
                let nodes: &[Node] = tree.nodes();
                check(&relayout, nodes, [before, after].map(Stored::nodes).each_ref(), missing_of_node);
                let lights: Vec<_> =
                    tree.lights().iter().zip(tree.leaves()).map(|(l, place)| LightRecord::of(l, *place)).collect();
                check(&relayout, &lights, [before, after].map(Stored::lights).each_ref(), missing_of_light);
                let instances = instances(before & after);
                check(&relayout, &instances, [before, after].map(Stored::instances).each_ref(), missing_of_instance);
            }
        }
    }

    #[test]
    fn more_workgroups_than_fit_into_one_dimension_copy_all_records() {
        let (device, queue) = gpu();
        let relayout = Relayout::new(&device).expect("room enough");
        // A stored record has 80 bytes, which 5 invocations copy.
        let count = 65_540 * LANES / 5;
        let mut pool = Pool::<InstanceRecord>::new(&device, &queue, "test records", 1).expect("room");
        pool.set_layout(Stored::instances(Effects::empty()), missing_of_instance, &relayout);
        pool.alloc(count).expect("room enough");
        let last = InstanceRecord { flags: 7, first_part: 9, ..InstanceRecord::NONE };
        pool.write(count - 1, &[last]);
        // The layout stays the same, but the pool copies nevertheless.
        pool.set_layout(Stored::instances(Effects::empty()), missing_of_instance, &relayout);
        let words: Vec<u32> = read(&device, &queue, pool.buffer());
        assert_eq!((words.len() / 20, words[words.len() - 8], words[words.len() - 4]), (count as usize, 7, 9));
    }

    #[test]
    fn the_stage_is_valid_and_its_uniform_has_the_layout_of_the_rust_struct() {
        let text = text();
        let module = naga::front::wgsl::parse_str(&text).map_err(|e| e.emit_to_string(&text)).expect("it parses");
        let (_, pass) = module.types.iter().find(|(_, t)| t.name.as_deref() == Some("RelayoutPass")).expect("a struct");
        let TypeInner::Struct { members, span } = &pass.inner else { panic!("RelayoutPass is a struct") };
        let theirs: Vec<_> = members.iter().map(|m| m.offset as usize).collect();
        let ours = [
            std::mem::offset_of!(RelayoutPass, records),
            std::mem::offset_of!(RelayoutPass, words_before),
            std::mem::offset_of!(RelayoutPass, quads_after),
            std::mem::offset_of!(RelayoutPass, padding),
            std::mem::offset_of!(RelayoutPass, sources),
            std::mem::offset_of!(RelayoutPass, values),
        ];
        assert_eq!((theirs, *span as usize), (ours.to_vec(), size_of::<RelayoutPass>()));
        assert_eq!(module.entry_points[0].workgroup_size, [LANES, 1, 1]);
        let longest = [size_of::<Node>(), size_of::<LightRecord>(), size_of::<InstanceRecord>()];
        assert_eq!(longest.into_iter().max(), Some(16 * MAX_QUADS));
    }
}
