//! Sizes: of buffers, passes, workgroups and uniforms.

use std::mem::offset_of;

use glam::Vec3;
use naga::TypeInner;

use super::stage::{LANES, NODE_LANES};
use super::*;
use crate::plan::kernel::MAX_WORKGROUPS;
use crate::plan::layout::{ClusterRecord, LeafRecord};
use crate::plan::node_record::NodeRecord;
use crate::plan::{Command, MAX_LARGEST_BUFFER, NewBuffer};
use crate::top::PARTS_PER_RUN;
use crate::top::partition::Place;

fn maps(has_masks: bool) -> MapQuads {
    MapQuads { has_masks, ..MapQuads::default() }
}

/// Returns the bytes of the new buffers by what they hold.
fn reserve(top: &mut TopBuild, sizes: [u32; 2], has_masks: bool, growth: Growth) -> Result<Vec<NewBuffer>, PlanError> {
    let mut draft = Draft::new(Default::default(), growth);
    top.reserve(sizes[0], sizes[1], maps(has_masks), &mut draft)?;
    Ok(draft.plan.new_buffers)
}

/// Names of buffers.
fn ids() -> [BufferId; 3] {
    let mut draft = Draft::new(Default::default(), Growth::Exact);
    [(); 3].map(|()| draft.storage("read only", 4))
}

fn params(masks: u32, home: [i32; 3]) -> ParamsRecord {
    ParamsRecord { masks, home, ..ParamsRecord::default() }
}

#[test]
fn more_parts_or_nodes_than_the_device_can_bind_are_refused_and_change_nothing() {
    let limit = 128 << 20;
    let mut top = TopBuild::new(limit);
    let first = reserve(&mut top, [3, 1], false, Growth::Double).unwrap();
    assert_eq!((first.len(), top.capacity()), (11, 64));
    assert_eq!(reserve(&mut top, [64, 16], false, Growth::Double), Ok(Vec::new()));
    // The largest number of parts whose clusters and nodes fit beside their nodes, and one more.
    let needed = |[parts, nodes]: [u32; 2]| {
        let nodes = u64::from(nodes) + u64::from(parts) / PARTS_PER_RUN as u64;
        let clusters = (u64::from(parts) + nodes) * size_of::<ClusterRecord>() as u64;
        let records = u64::from(parts) * size_of::<LeafRecord>() as u64;
        [("top-level clusters", clusters), ("top-level nodes", nodes * size_of::<NodeRecord>() as u64 + records)]
    };
    let too_much = |sizes: [u32; 2]| needed(sizes).into_iter().find(|(_, needed)| *needed > limit);
    for share in [4, 1] {
        let sizes = |parts: u32| [parts, parts.div_ceil(share)];
        let (mut fits, mut fails) = (0u32, 1 << 24);
        while fails - fits > 1 {
            let middle = fits.midpoint(fails);
            if too_much(sizes(middle)).is_none() { fits = middle } else { fails = middle }
        }
        assert!(fits > 400_000 && (fits >= 1 << 20 || share == 1), "{fits} parts fit");
        if share == 4 {
            assert_eq!(top.most_parts(maps(false)), fits);
        }
        let before = (top.nodes(), top.capacity());
        for parts in [fails, 10 * fails, u32::MAX] {
            let (what, needed) = too_much(sizes(parts)).unwrap();
            let refused = reserve(&mut top, sizes(parts), false, Growth::Double);
            assert_eq!(refused, Err(PlanError::Full { what, needed, limit }));
        }
        assert_eq!((top.nodes(), top.capacity()), before);
        let mut full = TopBuild::new(limit);
        assert_eq!(reserve(&mut full, sizes(fits), false, Growth::Double).map(|new| new.len()), Ok(11));
        assert_eq!(full.capacity(), fits);
    }
}

#[test]
fn forty_million_parts_are_covered_by_dispatches_of_two_dimensions_and_words_of_32_bits() {
    const PARTS: u32 = 40_000_000;
    const NODES: u32 = PARTS / 5;
    let mut top = TopBuild::new(MAX_LARGEST_BUFFER);
    let new = reserve(&mut top, [PARTS, NODES], true, Growth::Exact).expect("large buffers");
    // Kernels count the words of a buffer in 32 bits.
    assert!(new.iter().all(|buffer| buffer.bytes / 4 <= 1 << 32), "{new:?}");
    let mut commands = Commands::default();
    let masks = top.masks();
    top.prepare(&mut commands, PARTS, &Partition::default(), params(masks, [0; 3]));
    top.passes = top.passes.iter().map(|pass| TopPass { nodes: NODES, ..*pass }).collect();
    top.build(&mut commands, ids());
    let mut groups = Vec::new();
    for command in commands.iter() {
        if let Command::Dispatch { kernel, workgroups: [x, y, z], .. } = command {
            assert!(x <= MAX_WORKGROUPS && y <= MAX_WORKGROUPS && z == 1, "{kernel:?}");
            groups.push((kernel.entry(), u64::from(x) * u64::from(y)));
        }
    }
    let lanes = |entry: &str| groups.iter().find(|(other, _)| *other == entry).map(|(_, groups)| *groups);
    assert!(lanes("top_leaves").is_some_and(|groups| groups * u64::from(LANES) >= u64::from(PARTS)));
    assert!(lanes("top_cells").is_some_and(|groups| groups * u64::from(NODE_LANES) / 8 >= u64::from(NODES)));
}

/// A partition of lamps in a square.
fn partition_of(parts: u32) -> Partition {
    let at = |i: u32| Vec3::new((i * 37 % 1009) as f32, 0.01 * (i % 7) as f32, (i * 53 % 997) as f32);
    let mut partition = Partition::default();
    let cluster = |i: u32| crate::Light::point(at(i), Vec3::ONE).cluster();
    (0..parts).for_each(|i| partition.file(i, std::iter::once(Place::of(&cluster(i), 1))));
    partition.renew(usize::MAX, |part| cluster(part.slot));
    partition
}

#[test]
fn a_build_takes_ten_dispatches_or_fewer_and_each_block_is_packed_once_after_those_below_it() {
    for (parts, most) in [(0, 7), (1, 7), (100, 8), (20_000, 9), (1_000_000, 10)] {
        let partition = partition_of(parts);
        let mut top = TopBuild::new(MAX_LARGEST_BUFFER);
        reserve(&mut top, [parts, partition.len() as u32], false, Growth::Double).unwrap();
        let mut commands = Commands::default();
        top.prepare(&mut commands, parts, &partition, params(0, [0; 3]));
        let mut build = Commands::default();
        top.build(&mut build, ids());
        let dispatches = build.iter().filter(|command| matches!(command, Command::Dispatch { .. })).count();
        assert!(dispatches <= most, "{parts}: {dispatches}");
        let divided = partition.all_divided().count();
        let [_, stages @ ..] = &top.passes[..] else { panic!("there are passes") };
        let blocks: u32 = stages.iter().map(|stage| stage.block_count).sum();
        assert_eq!(blocks > 0, divided > 0);
        let in_blocks: usize =
            partition.all_divided().map(|(.., divided)| divided.stage.same.count_ones() as usize).sum();
        assert_eq!(blocks as usize + in_blocks, divided, "{parts}");
        // Nothing is sent twice.
        let sent = commands.bytes_written();
        top.prepare(&mut commands, parts, &partition, params(0, [0; 3]));
        assert_eq!(commands.bytes_written(), sent);
        top.prepare(&mut commands, parts, &partition, params(0, [1; 3]));
        assert_eq!(commands.bytes_written(), sent + size_of::<TopPass>() as u64);
    }
}

#[test]
fn buffers_double_or_grow_to_what_is_needed_and_make_room_for_masks_once() {
    let nodes = |new: &[NewBuffer]| new.iter().find(|buffer| buffer.what == "top level nodes").unwrap().bytes;
    let mut top = TopBuild::new(128 << 20);
    reserve(&mut top, [100, 1], false, Growth::Double).unwrap();
    assert_eq!(top.capacity(), 100);
    reserve(&mut top, [101, 1], false, Growth::Exact).unwrap();
    assert_eq!(top.capacity(), 101);
    let plain = nodes(&reserve(&mut top, [102, 1], false, Growth::Double).unwrap());
    assert_eq!((top.capacity(), top.masks()), (202, 0));
    let masked = nodes(&reserve(&mut top, [102, 1], true, Growth::Double).unwrap());
    assert!(masked > plain && top.masks() > top.parts());
    assert_eq!(top.capacity(), 202);
    assert_eq!(reserve(&mut top, [102, 16], true, Growth::Double), Ok(Vec::new()));
    assert!(nodes(&reserve(&mut top, [102, 17], true, Growth::Double).unwrap()) > masked);
}

#[test]
fn the_stages_are_valid_and_have_the_sizes_that_the_host_expects() {
    for (kernel, lanes) in [(LEAVES, LANES), (KEYS, LANES), (CELLS, NODE_LANES), (BLOCKS, NODE_LANES)] {
        let (entry, text) = (kernel.entry(), kernel.wgsl());
        let module = naga::front::wgsl::parse_str(&text).map_err(|e| e.emit_to_string(&text)).expect(entry);
        naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::default())
            .validate(&module)
            .map_err(|e| e.emit_to_string(&text))
            .expect(entry);
        assert_eq!(module.entry_points.len(), 1);
        assert_eq!(module.entry_points[0].name, entry);
        assert_eq!(module.entry_points[0].workgroup_size, [lanes, 1, 1]);
        let mut layouter = naga::proc::Layouter::default();
        layouter.update(module.to_ctx()).unwrap();
        let shared = module.global_variables.iter().filter(|(_, v)| v.space == naga::AddressSpace::WorkGroup);
        // WebGPU counts multiples of 16 bytes for each variable, and allows 16 KiB by default.
        let bytes: u32 = shared.map(|(_, variable)| layouter[variable.ty].size.next_multiple_of(16)).sum();
        assert!(bytes <= 16_384, "{}: {bytes} bytes of workgroup memory", entry);
        let (_, pass) = module.types.iter().find(|(_, t)| t.name.as_deref() == Some("TopPass")).unwrap();
        let TypeInner::Struct { members, span } = &pass.inner else { panic!("TopPass is a struct") };
        assert_eq!(*span as usize, size_of::<TopPass>());
        let names: Vec<_> = members.iter().map(|m| (m.name.as_deref().unwrap(), m.offset as usize)).collect();
        assert_eq!(
            names,
            [
                ("count", offset_of!(TopPass, count)),
                ("capacity", offset_of!(TopPass, capacity)),
                ("parts", offset_of!(TopPass, parts)),
                ("nodes", offset_of!(TopPass, nodes)),
                ("runs", offset_of!(TopPass, runs)),
                ("is_divided", offset_of!(TopPass, is_divided)),
                ("blocks", offset_of!(TopPass, blocks)),
                ("block_count", offset_of!(TopPass, block_count)),
                ("masks", offset_of!(TopPass, masks)),
                ("sort_block", offset_of!(TopPass, sort_block)),
                ("home", offset_of!(TopPass, home)),
            ]
        );
    }
}
