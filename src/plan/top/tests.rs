//! Sizes: of buffers, passes, workgroups and uniforms.

use std::mem::offset_of;

use naga::TypeInner;

use super::passes::{MAX_PASSES, Passes, Places, TopPass};
use super::stage::{GROUP, KEYS, LANES, LEAVES, NODE, NODE_LANES, PLANES, SPLIT_LANES};
use super::*;
use crate::effects::Effects;
use crate::plan::kernel::MAX_WORKGROUPS;
use crate::plan::layout::{ClusterRecord, LeafRecord};
use crate::plan::node_record::NodeRecord;
use crate::plan::{Command, MAX_LARGEST_BUFFER};
use crate::top;
use crate::tree::space_order;

/// Reserves and takes into use. Returns the bytes of the new buffers by what they hold.
fn reserve(top: &mut TopBuild, parts: u32, has_masks: bool, growth: Growth) -> Result<Vec<NewBuffer>, PlanError> {
    let mut new = Vec::new();
    top.reserve(parts, (has_masks, MapQuads::default()), growth, (&mut Ids::default(), &mut new))?;
    top.adopt(&mut Commands::default(), &mut Vec::new());
    Ok(new)
}

#[test]
fn more_parts_than_the_device_can_bind_are_refused_and_change_nothing() {
    let limit = 128 << 20;
    let mut top = TopBuild::new(limit);
    let first = reserve(&mut top, 3, false, Growth::Double).unwrap();
    assert_eq!((first.len(), top.capacity()), (11, 64));
    assert_eq!(reserve(&mut top, 64, false, Growth::Double), Ok(Vec::new()));
    // The largest number of parts whose clusters and nodes fit, and one more.
    let needed = |parts: u32| {
        let nodes = u64::from(Passes::new(parts, parts, Places::default(), Strides::of(Effects::all())).nodes);
        let clusters = (u64::from(parts) + nodes) * size_of::<ClusterRecord>() as u64;
        let records = u64::from(parts) * size_of::<LeafRecord>() as u64;
        [("top-level clusters", clusters), ("top-level nodes", nodes * size_of::<NodeRecord>() as u64 + records)]
    };
    let too_much = |parts: u32| needed(parts).into_iter().find(|(_, needed)| *needed > limit);
    let (mut fits, mut fails) = (0u32, 1 << 24);
    while fails - fits > 1 {
        let middle = fits.midpoint(fails);
        if too_much(middle).is_none() { fits = middle } else { fails = middle }
    }
    assert!(fits > 1_100_000, "{fits} parts fit");
    let before = (top.nodes(), top.capacity());
    for parts in [fails, u32::MAX] {
        let (what, needed) = too_much(parts).unwrap();
        let refused = reserve(&mut top, parts, false, Growth::Double);
        assert_eq!(refused, Err(PlanError::Full { what, needed, limit }));
    }
    assert_eq!((top.nodes(), top.capacity()), before);
    assert_eq!(reserve(&mut top, fits, false, Growth::Double).map(|new| new.len()), Ok(10));
    assert_eq!(top.capacity(), fits);
}

#[test]
fn forty_million_parts_are_covered_by_dispatches_of_two_dimensions_and_words_of_32_bits() {
    const PARTS: u32 = 40_000_000;
    let mut top = TopBuild::new(MAX_LARGEST_BUFFER);
    let new = reserve(&mut top, PARTS, true, Growth::Exact).expect("large buffers");
    // Kernels count the words of a buffer in 32 bits.
    assert!(new.iter().all(|buffer| buffer.bytes / 4 <= 1 << 32), "{new:?}");
    let mut commands = Commands::default();
    top.prepare(&mut commands, PARTS, Strides::of(Effects::all()), (top.masks(), [0; 3]));
    top.build(&mut commands, [0; 3].map(|_| Ids::default().storage("read only", 4).id));
    let mut groups = Vec::new();
    for command in commands.iter() {
        if let Command::Dispatch { kernel, workgroups: [x, y, z], .. } = command {
            assert!(x <= MAX_WORKGROUPS && y <= MAX_WORKGROUPS && z == 1, "{kernel:?}");
            groups.push((kernel.entry(), u64::from(x) * u64::from(y)));
        }
    }
    let lanes = |entry: &str| groups.iter().find(|(other, _)| *other == entry).map(|(_, groups)| *groups);
    assert!(lanes("top_leaves").is_some_and(|groups| groups * u64::from(LANES) >= u64::from(PARTS)));
    let pieces = u64::from(PARTS.div_ceil(top::SHARE as u32));
    assert!(pieces > u64::from(MAX_WORKGROUPS), "one dimension is too short");
    assert!(lanes("top_group").is_some_and(|groups| groups >= pieces));
    // Leaves, planes, keys, four passes of the sort, and two stages for each of four passes.
    assert_eq!(groups.len(), 15);
}

#[test]
fn buffers_double_or_grow_to_what_is_needed_and_make_room_for_masks_once() {
    let nodes = |new: &[NewBuffer]| new.iter().find(|buffer| buffer.what == "top level nodes").unwrap().bytes;
    let mut top = TopBuild::new(128 << 20);
    reserve(&mut top, 100, false, Growth::Double).unwrap();
    assert_eq!(top.capacity(), 100);
    reserve(&mut top, 101, false, Growth::Exact).unwrap();
    assert_eq!(top.capacity(), 101);
    let plain = nodes(&reserve(&mut top, 102, false, Growth::Double).unwrap());
    assert_eq!((top.capacity(), top.masks()), (202, 0));
    let masked = nodes(&reserve(&mut top, 102, true, Growth::Double).unwrap());
    assert!(masked > plain && top.masks() > top.parts());
    assert_eq!(top.capacity(), 202);
    assert_eq!(reserve(&mut top, 102, true, Growth::Double), Ok(Vec::new()));
    // An undone frame leaves the buffers in use.
    let before = (top.nodes(), top.capacity());
    top.reserve(1000, (true, MapQuads::default()), Growth::Double, (&mut Ids::default(), &mut Vec::new())).unwrap();
    top.undo();
    assert!(!top.is_replaced());
    assert_eq!((top.nodes(), top.capacity()), before);
}

#[test]
fn the_passes_for_any_number_of_parts_fit_into_the_uniform() {
    for parts in [0, 1, 511, 512, 513, 100_000, 1 << 20, 1 << 30, u32::MAX] {
        let all = Passes::new(parts, parts, Places::default(), Strides::of(Effects::all()));
        assert!(all.passes.len() <= MAX_PASSES as usize, "{parts}: {}", all.passes.len());
        assert!(u64::from(all.nodes) <= u64::from(parts) / 4 + u64::from(parts) / 150 + 512, "{parts}: {}", all.nodes);
    }
}

#[test]
fn the_stages_are_valid_and_have_the_sizes_that_the_host_expects() {
    for (stage, lanes) in [
        (&LEAVES, LANES),
        (&PLANES, space_order::SAMPLES as u32),
        (&KEYS, LANES),
        (&GROUP, SPLIT_LANES),
        (&NODE, NODE_LANES),
    ] {
        let text = stage.text();
        let module = naga::front::wgsl::parse_str(&text).map_err(|e| e.emit_to_string(&text)).expect(stage.entry);
        naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::default())
            .validate(&module)
            .map_err(|e| e.emit_to_string(&text))
            .expect(stage.entry);
        assert_eq!(module.entry_points.len(), 1);
        assert_eq!(module.entry_points[0].name, stage.entry);
        assert_eq!(module.entry_points[0].workgroup_size, [lanes, 1, 1]);
        let mut layouter = naga::proc::Layouter::default();
        layouter.update(module.to_ctx()).unwrap();
        let shared = module.global_variables.iter().filter(|(_, v)| v.space == naga::AddressSpace::WorkGroup);
        // WebGPU counts multiples of 16 bytes for each variable, and allows 16 KiB by default.
        let bytes: u32 = shared.map(|(_, variable)| layouter[variable.ty].size.next_multiple_of(16)).sum();
        assert!(bytes <= 16_384, "{}: {bytes} bytes of workgroup memory", stage.entry);
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
                ("units_before", offset_of!(TopPass, units_before)),
                ("pieces_before", offset_of!(TopPass, pieces_before)),
                ("units_after", offset_of!(TopPass, units_after)),
                ("pieces", offset_of!(TopPass, pieces)),
                ("first_node", offset_of!(TopPass, first_node)),
                ("node_stride", offset_of!(TopPass, strides.node)),
                ("node_lobes", offset_of!(TopPass, strides.lobes)),
                ("light_stride", offset_of!(TopPass, strides.light)),
                ("instance_stride", offset_of!(TopPass, strides.instance)),
                ("instance_sector", offset_of!(TopPass, strides.sector)),
                ("masks", offset_of!(TopPass, masks)),
                ("sort_block", offset_of!(TopPass, sort_block)),
                ("home", offset_of!(TopPass, home)),
            ]
        );
    }
}
