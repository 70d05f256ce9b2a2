//! Builds can be repeated, and store the same nodes in every layout.

use super::{TopRig, build, placement, world_of};
use crate::effects::Effects;
use crate::plan::layout::Strides;
use crate::plan::node_record::NodeRecord;

#[test]
fn two_builds_of_one_world_are_equal_bit_for_bit() {
    let mut top = TopRig::new();
    let world = world_of(2000, placement);
    let (first, second) = (build(&mut top, &world), build(&mut top, &world));
    assert_eq!(first.nodes, second.nodes);
    assert_eq!(first.records, second.records);
}

#[test]
fn every_layout_stores_its_parts_of_the_same_nodes() {
    let mut top = TopRig::new();
    let world = world_of(600, placement);
    let built = build(&mut top, &world);
    let full: Vec<NodeRecord> = built.nodes.iter().map(NodeRecord::of).collect();
    let full: &[[[u32; 4]; 14]] = bytemuck::cast_slice(&full);
    for effects in [Effects::empty(), Effects::CONES, Effects::RANGES, Effects::all()] {
        // The layout of the instances stays the same.
        let Strides { instance, sector, .. } = Strides::of(Effects::all());
        let strides = Strides { instance, sector, ..Strides::of(effects) };
        top.strides = strides;
        build(&mut top, &world);
        let stored: Vec<[u32; 4]> = top.rig.read(top.top.nodes());
        for node in built.reached() {
            let ours = &stored[node * strides.node as usize..][..strides.node as usize];
            let (core, rest) = full[node].split_at(10);
            assert_eq!(&ours[..9], &core[..9]);
            // What follows is the name of the node.
            assert_eq!(ours[9][..2], core[9][..2]);
            if strides.lobes > 0 {
                assert_eq!(&ours[strides.lobes as usize..], rest);
            }
        }
    }
}
