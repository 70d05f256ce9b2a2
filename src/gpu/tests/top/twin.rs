//! The GPU builds the same tree as its twin on the CPU.

use glam::{DVec3, Vec3};

use super::bounds::assert_bounds_hold;
use super::{Built, TopRig, build, placement, world_of};
use crate::cluster::Cluster;
use crate::effects::Effects;
use crate::light::UNLIMITED_RANGE;
use crate::plan::layout::LeafRecord;
use crate::scheduler::FrameBudget;
use crate::top::TopLevel;
use crate::tree::LightTree;
use crate::tree::{ChildRef, EMPTY_SLOT, NO_PARENT, Node, WIDTH};
use crate::{Light, LightWorld, Placement, Policy};

/// The relative difference of sums of up to eight products in `f32` that are added in different
/// orders or with fused multiply-adds.
const SUMS: f32 = 4.0e-6;

/// The steps by which a packed mean, deviation, length or coordinate of a direction may differ,
/// where the value is near the border between two steps. Caps may differ by twice as many, because
/// they are relative to the packed direction.
const STEP: u8 = 1;

fn close(a: f32, b: f32, scale: f32) -> bool {
    (a - b).abs() <= SUMS * scale
}

/// Compares two clusters to float rounding.
fn assert_alike(ours: &Cluster, twin: &Cluster, what: &str) {
    assert!((ours.flux - twin.flux).abs() <= SUMS * twin.flux, "{what}: flux {} {}", ours.flux, twin.flux);
    if twin.flux <= 0.0 {
        return;
    }
    let (a, b) = (ours, twin);
    let size = b.aabb.min.abs().max(b.aabb.max.abs()).max_element();
    assert!((a.aabb.min - b.aabb.min).abs().max_element() <= SUMS * size, "{what}: {a:?} {b:?}");
    assert!((a.aabb.max - b.aabb.max).abs().max_element() <= SUMS * size, "{what}: {a:?} {b:?}");
    assert!((a.mean - b.mean).abs().max_element() <= SUMS * size, "{what}: {a:?} {b:?}");
    let spread = b.aabb.extent().length_squared();
    assert!(close(a.variance, b.variance, b.variance + spread), "{what}: variance {} {}", a.variance, b.variance);
    assert_eq!(a.range, b.range.min(UNLIMITED_RANGE), "{what}");
    assert!((a.axis - b.axis).length() <= SUMS, "{what}: axis {} {}", a.axis, b.axis);
    assert!(close(a.cos_half_angle, b.cos_half_angle, 1.0), "{what}: {} {}", a.cos_half_angle, b.cos_half_angle);
}

/// Compares two nodes of the same leaves. Boxes, ranges and fluxes are minima, maxima and sums in
/// the same order, so they are equal bit for bit.
fn assert_same_node(ours: &Node, twin: &Node, index: usize) {
    assert_eq!(ours.steps, twin.steps, "node {index}");
    assert_eq!((ours.origin, ours.low, ours.high), (twin.origin, twin.low, twin.high), "node {index}");
    assert_eq!((ours.flux, ours.range), (twin.flux, twin.range), "node {index}");
    for slot in 0..WIDTH {
        let near =
            |a: u8, b: u8, steps: u8| assert!(a.abs_diff(b) <= steps, "node {index}, child {slot}: {ours:?} {twin:?}");
        for k in 0..3 {
            near(ours.mean[k][slot], twin.mean[k][slot], STEP);
            assert!(ours.axis[k][slot].abs_diff(twin.axis[k][slot]) <= STEP, "node {index}, child {slot}");
        }
        near(ours.deviation[slot], twin.deviation[slot], STEP);
        near(ours.shortness[slot], twin.shortness[slot], STEP);
        near(ours.cap[slot], twin.cap[slot], 2 * STEP);
    }
}

/// Compares two trees, whose nodes may be in different orders.
fn assert_same_tree(built: &Built, twin: &TopLevel) {
    let mut pairs = vec![(0, 0)];
    let mut next = 0;
    while let Some((ours, theirs)) = pairs.get(next).copied() {
        let (node, other) = (&built.nodes[ours], &twin.nodes[theirs]);
        assert_same_node(node, other, ours);
        assert_eq!(built.masks.is_empty(), twin.masks.is_empty());
        if !built.masks.is_empty() {
            assert_eq!(built.masks[ours], twin.masks[theirs], "node {ours} and {theirs}");
        }
        for slot in 0..WIDTH {
            match (node.child(slot), other.child(slot)) {
                (Some(ChildRef::Node(a)), Some(ChildRef::Node(b))) => {
                    assert_eq!(built.nodes[a as usize].parent as usize, ours * WIDTH + slot, "node {a}");
                    pairs.push((a as usize, b as usize));
                }
                (a, b) => assert_eq!(a, b, "node {ours} and {theirs}, child {slot}"),
            }
        }
        next += 1;
    }
}

/// A world of equal lamps.
fn world_of_lamps(count: u32, place: impl Fn(u32) -> Placement) -> LightWorld {
    let mut world = LightWorld::new();
    let lamp = world.add_tree(LightTree::new(vec![Light::point(Vec3::ZERO, Vec3::ONE)]).unwrap());
    for i in 0..count {
        world.add_instance(lamp, place(i), Policy::default()).unwrap();
    }
    world.update(FrameBudget::NONE);
    world
}

/// Builds the top level of a world, compares it with the CPU's and checks its bounds.
pub(super) fn check(top: &mut TopRig, world: &LightWorld) -> Built {
    let built = build(top, world);
    // The clusters of the parts agree.
    for (index, (part, cluster)) in world.parts().iter().enumerate() {
        assert_alike(&built.leaves[index], cluster, &format!("part {index}, {part:?}"));
    }
    // From the GPU's own leaves the CPU makes the same tree.
    let parts: Vec<_> = built.parts.iter().copied().zip(built.leaves.iter().copied()).collect();
    let mut twin = TopLevel::build(&parts, world.slot_count(), world.partition());
    let mask_of =
        |slot| world.instance_at(slot).and_then(|key| world.instance(key).map(|i| i.appearance.mask)).unwrap_or(0);
    if world.effects().contains(Effects::MASKS) {
        twin.set_masks(mask_of);
        for (index, record) in built.records.iter().enumerate() {
            assert_eq!(record.mask, mask_of(record.slot), "part {index}");
        }
    }
    for (index, (part, leaf)) in parts.iter().enumerate() {
        let LeafRecord { slot, child_bits, place, .. } = built.records[index];
        let below = if child_bits == 0 { ChildRef::Node(0) } else { ChildRef::of(child_bits).unwrap() };
        assert_eq!((slot, below), (part.slot, part.entry), "part {index}");
        if leaf.flux <= 0.0 {
            assert_eq!(place, NO_PARENT, "part {index} is dark");
            continue;
        }
        let place = place as usize;
        assert_eq!(built.nodes[place / WIDTH].children[place % WIDTH], part.leaf(index as u32));
        assert_eq!(built.child(place), *leaf, "part {index}");
    }
    assert_same_tree(&built, &twin);
    assert_bounds_hold(&built);
    built
}

/// Dispatches of more than 65,535 workgroups have two dimensions, and more workgroups than are needed.
#[test]
fn a_build_by_dispatches_of_two_dimensions_makes_the_same_tree_as_on_the_cpu() {
    for widest in [1, 3] {
        let mut top = TopRig::new();
        top.rig.player.widest = widest;
        for slots in [3, 300, 1300] {
            check(&mut top, &world_of(slots, placement));
        }
    }
}

#[test]
fn any_number_of_slots_makes_the_same_tree_as_on_the_cpu() {
    let mut top = TopRig::new();
    // The buffers grow, and later builds are not disturbed by what a larger world has left in them.
    for slots in [0, 1, 2, 8, 9, 65, 300, 510, 511, 512, 600, 5000, 25_000, 1100, 7, 0] {
        check(&mut top, &world_of(slots, placement));
    }
}

#[test]
fn cells_of_any_number_of_parts_make_the_same_tree_as_on_the_cpu() {
    let mut top = TopRig::new();
    // The world is not updated after all parts have gathered in one cell of many.
    for slots in [2, 8, 9, 16, 17, 32, 33, 63, 64, 65, 127, 128, 129, 512, 513, 1025, 5000] {
        let mut world = world_of_lamps(slots, placement);
        for key in world.instances().collect::<Vec<_>>() {
            world.move_instance(key, placement(0)).unwrap();
        }
        check(&mut top, &world);
    }
    // Planes that were made for other places: parts move into few cells.
    let mut world = world_of(2000, placement);
    for (key, i) in world.instances().collect::<Vec<_>>().into_iter().zip(0..) {
        let at = Placement::at(DVec3::X * 0.01 * f64::from(i % 1500));
        if i % 10 != 0 {
            world.move_instance(key, at).unwrap();
        }
    }
    check(&mut top, &world);
}

#[test]
fn instances_at_one_point_and_along_a_line_make_the_same_tree_as_on_the_cpu() {
    let mut top = TopRig::new();
    check(&mut top, &world_of(100, |_| Placement::IDENTITY));
    check(&mut top, &world_of(300, |i| Placement::at(DVec3::new(-5.0e6 + f64::from(i) * 0.5, 0.0, 0.0))));
}

#[test]
fn rows_and_grids_of_equal_lamps_make_the_same_tree_as_on_the_cpu() {
    let mut top = TopRig::new();
    // Many cuts have the same cost, and many sides of boxes are within rounding of a grid line.
    for (side, step) in [(16, 10.0), (23, 10.0), (50, 10.0), (50, 0.1)] {
        let place = |i: u32| Placement::at(DVec3::new(f64::from(i % side) * step, 5.0, f64::from(i / side) * step));
        check(&mut top, &world_of_lamps(side * side, place));
    }
}

#[test]
fn chains_of_single_units_make_the_same_tree_as_on_the_cpu() {
    let mut top = TopRig::new();
    // The instances of a site halve their distance one by one, so each split of a site separates its
    // farthest instance. Squares of shorter distances are not normal numbers: drivers may flush them.
    for per_site in [16, 30, 110] {
        let place = |i: u32| {
            let (site, k) = (i / per_site, i % per_site);
            let corner = 1000.0 * DVec3::new(f64::from(site % 8), 0.0, f64::from(site / 8));
            Placement::at(corner + 500.0 * 0.7_f64.powi(k as i32) * DVec3::X)
        };
        check(&mut top, &world_of_lamps(1024, place));
    }
}

#[test]
fn a_world_without_light_has_a_root_of_empty_slots() {
    let mut top = TopRig::new();
    let mut world = LightWorld::new();
    let dark = world.add_tree(LightTree::new(vec![Light::point(Vec3::ONE, Vec3::ZERO)]).unwrap());
    for i in 0..20 {
        world.add_instance(dark, placement(i), Policy::default()).unwrap();
    }
    let built = check(&mut top, &world);
    let root = &built.nodes[0];
    assert_eq!((root.flux, root.children, root.parent), ([0; WIDTH], [EMPTY_SLOT; WIDTH], NO_PARENT));
}
