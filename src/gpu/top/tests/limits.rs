//! Sizes: of buffers, plans, workgroups and uniforms.

use std::mem::offset_of;

use naga::TypeInner;

use super::super::TopBuild;
use super::super::plan::{MAX_PASSES, Places, Plan, TopPass};
use super::super::stage::{GROUP, KEYS, LANES, LEAVES, NODE, ROOT, ROOT_GROUP, SPLIT_LANES};
use crate::effects::Effects;
use crate::gpu::error::{GpuError, largest_storage_buffer};
use crate::gpu::layout::{ClusterRecord, LeafRecord, Strides};
use crate::gpu::testing::gpu;
use crate::tree::Node;

#[test]
fn more_parts_than_the_device_can_bind_are_refused_and_change_nothing() {
    let (device, queue) = gpu();
    let mut top = TopBuild::new(&device, &queue).unwrap();
    top.reserve(100, false).unwrap();
    assert_eq!(top.generation(), 1);
    top.reserve(100, false).unwrap();
    let before = (top.generation(), top.buffers.capacity, top.nodes().clone());
    // The largest number of parts whose clusters and nodes fit, and one more.
    let limit = largest_storage_buffer(&device);
    let needed = |parts: u32| {
        let nodes = u64::from(Plan::new(parts, parts, Places::default(), Strides::of(Effects::all())).nodes);
        let clusters = (u64::from(parts) + nodes) * size_of::<ClusterRecord>() as u64;
        let records = u64::from(parts) * size_of::<LeafRecord>() as u64;
        [("top-level clusters", clusters), ("top-level nodes", nodes * size_of::<Node>() as u64 + records)]
    };
    let too_much = |parts: u32| needed(parts).into_iter().find(|(_, needed)| *needed > limit);
    let (mut fits, mut fails) = (0u32, 1 << 24);
    while fails - fits > 1 {
        let middle = fits.midpoint(fails);
        if too_much(middle).is_none() { fits = middle } else { fails = middle }
    }
    assert!(fits > 1_200_000, "{fits} parts fit");
    for parts in [fails, u32::MAX] {
        let (what, needed) = too_much(parts).unwrap();
        assert_eq!(top.reserve(parts, false), Err(GpuError::Full { what, needed, limit }));
    }
    assert_eq!(before, (top.generation(), top.buffers.capacity, top.nodes().clone()));
    top.reserve(fits, false).unwrap();
    assert_eq!((top.generation(), top.buffers.capacity), (2, fits));
    // Masks take room beside as many parts, once.
    let mut top = TopBuild::new(&device, &queue).unwrap();
    top.reserve(100, false).unwrap();
    let (capacity, bytes) = (top.buffers.capacity, top.nodes().size());
    for _ in 0..2 {
        top.reserve(100, true).unwrap();
        assert_eq!((top.generation(), top.buffers.capacity), (2, capacity));
        assert!(top.nodes().size() > bytes && top.masks() > top.parts());
    }
}

#[test]
fn a_plan_for_any_number_of_parts_fits_into_the_uniform() {
    for parts in [0, 1, 256, 257, 512, 513, 100_000, 1 << 20, 1 << 30, u32::MAX] {
        let plan = Plan::new(parts, parts, Places::default(), Strides::of(Effects::all()));
        assert!(plan.passes.len() <= MAX_PASSES as usize, "{parts}: {}", plan.passes.len());
        assert!(u64::from(plan.nodes) <= u64::from(parts) / 2 + 1024, "{parts}: {}", plan.nodes);
    }
}

#[test]
fn the_stages_are_valid_and_have_the_sizes_that_the_host_expects() {
    for stage in [&LEAVES, &KEYS, &GROUP, &NODE, &ROOT_GROUP, &ROOT] {
        let text = stage.text();
        let module = naga::front::wgsl::parse_str(&text).map_err(|e| e.emit_to_string(&text)).expect(stage.entry);
        naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::default())
            .validate(&module)
            .map_err(|e| e.emit_to_string(&text))
            .expect(stage.entry);
        assert_eq!(module.entry_points.len(), 1);
        assert_eq!(module.entry_points[0].name, stage.entry);
        let lanes = if stage.piece > 0 { SPLIT_LANES } else { LANES };
        assert_eq!(module.entry_points[0].workgroup_size, [lanes, 1, 1]);
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
                ("node_cones", offset_of!(TopPass, strides.cones)),
                ("node_range", offset_of!(TopPass, strides.range)),
                ("light_stride", offset_of!(TopPass, strides.light)),
                ("instance_stride", offset_of!(TopPass, strides.instance)),
                ("masks", offset_of!(TopPass, masks)),
            ]
        );
    }
}
