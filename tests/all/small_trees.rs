//! The memory of small trees on the CPU, which worlds of a million lamps consist of. docs/memory.md
//! states it.

use girandole::glam::{DVec3, Vec3};
use girandole::{FrameBudget, Light, LightTree, LightWorld, Placement, Policy};

use crate::allocations::on_one_thread;
use testbed::testing::counting::held_bytes;

/// With the slot that slot maps never use, a power of two: their arrays are full.
const TREES: usize = 4095;

fn lamp(index: usize, candela: f32) -> Light {
    Light::point(Vec3::new(index as f32, 3.0, 0.0), Vec3::splat(candela))
}

fn tree(lights: usize) -> LightTree {
    let mut all = Vec::with_capacity(lights);
    all.extend((0..lights).map(|index| lamp(index, 1.0)));
    LightTree::new(all).expect("valid")
}

/// The bytes of a tree of so many lights: alone, with its place in a world and an instance, the same
/// while an edit of a light waits for the update, and after the update.
fn bytes(lights: usize) -> [usize; 4] {
    let (_boxed, alone) = held_bytes(|| Box::new(tree(lights)));
    let mut world = LightWorld::new();
    let (mut keys, mut bytes) = (Vec::with_capacity(TREES), [alone, 0, 0, 0]);
    let (_, held) = held_bytes(|| {
        for index in 0..TREES {
            let key = world.add_tree(tree(lights));
            let place = DVec3::new((index % 64) as f64, 0.0, (index / 64) as f64) * 1000.0;
            world.add_instance(key, Placement::at(place), Policy::Budgeted).expect("valid");
            keys.push(key);
        }
        world.update(FrameBudget::NONE);
    });
    bytes[1] = held;
    let (_, held) = held_bytes(|| {
        keys.iter().for_each(|key| world.set_lights(*key, &[(0, lamp(0, 2.0))]).expect("valid"));
    });
    bytes[2] = bytes[1] + held;
    let (report, held) = held_bytes(|| world.update(FrameBudget::NONE));
    assert_eq!(report.refit_trees, TREES);
    bytes[3] = bytes[2] + held;
    let per_tree = |bytes: isize| bytes as usize / TREES;
    [alone as usize, per_tree(bytes[1]), per_tree(bytes[2]), per_tree(bytes[3])]
}

#[cfg(target_pointer_width = "64")]
#[test]
fn the_bytes_of_small_trees_are_those_of_the_page_on_memory() {
    on_one_thread(|| {
        let rows: Vec<String> = [1, 8, 9, 100]
            .map(|lights| {
                let [alone, present, edited, updated] = bytes(lights);
                format!("| {lights} | {alone} | {present} | {edited} | {updated} |\n")
            })
            .into();
        let page = include_str!("../../docs/memory.md");
        assert!(page.contains(&rows.concat()), "\n{}", rows.concat());
    });
}
