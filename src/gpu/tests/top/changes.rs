//! Nodes have names that change with their children.

use std::collections::HashMap;

use glam::DVec3;

use super::{Built, TopRig, build, placement, world_of};
use crate::LightWorld;
use crate::gpu::testing::random;
use crate::scheduler::FrameBudget;
use crate::tree::{ChildRef, WIDTH};

/// The children of each node that lasts, from the root on: slots and numbers of nodes and of parts. Those of runs are
/// in place of the runs.
fn children(built: &Built, runs: u32) -> HashMap<usize, Vec<(usize, ChildRef)>> {
    let mut all = HashMap::new();
    for node in built.reached().into_iter().filter(|node| *node < runs as usize) {
        let mut open: Vec<(usize, usize)> = vec![(node, 0)];
        let mut found = Vec::new();
        while let Some((node, place)) = open.pop() {
            for slot in 0..WIDTH {
                let place = 8 * place + slot;
                match built.nodes[node].child(slot) {
                    Some(ChildRef::Node(run)) if run >= runs => open.push((run as usize, place)),
                    Some(child) => found.push((place, child)),
                    None => {}
                }
            }
        }
        all.insert(node, found);
    }
    all
}

/// Moves one in so many instances by up to `length` to each side.
fn shake(world: &mut LightWorld, (one_in, length): (usize, f64), round: u32) {
    for (i, key) in (0..).zip(world.instances().collect::<Vec<_>>()).step_by(one_in) {
        let mut place = world.instance(key).unwrap().placement;
        let by = |k: u32| f64::from(random(i, 100 + 3 * round + k)) - 0.5;
        place.translation += 2.0 * length * DVec3::new(by(0), by(1), by(2));
        world.move_instance(key, place).unwrap();
    }
    world.update(FrameBudget::NONE);
}

#[test]
fn the_names_of_nodes_change_with_their_children() {
    let mut top = TopRig::new();
    let mut world = world_of(4000, placement);
    let mut former = HashMap::new();
    let (mut least, mut most) = (1.0_f32, 0.0_f32);
    for (round, (one_in, length)) in
        (0..).zip([(1, 0.0), (1, 0.0), (10, 1.0), (10, 1.0), (10, 100.0), (100, 1000.0), (1, 1000.0), (1, 0.0)])
    {
        shake(&mut world, (one_in, length), round);
        let built = build(&mut top, &world);
        let now: HashMap<usize, _> = children(&built, top.top.first_run())
            .into_iter()
            .map(|(node, children)| (node, (built.names[node], children)))
            .collect();
        let mut changed = 0;
        for (node, (name, children)) in &now {
            if let Some((former_name, before)) = former.get(node) {
                assert_eq!(name == former_name, children == before, "round {round}: {node}");
            }
            changed += u32::from(former.get(node) != now.get(node));
        }
        if round > 0 {
            let share = changed as f32 / now.len() as f32;
            (least, most) = (least.min(share), most.max(share));
        }
        former = now;
    }
    assert!(least == 0.0 && most > 0.5, "{least} {most}");
}
