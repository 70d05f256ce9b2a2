//! Readers that follow a world in each frame, in some frames or from the last one on end with the
//! same records.

use girandole::glam::{DVec3, Vec3};
use girandole::{DirectionalLight, InstanceKey, LightTree, LightWorld, Placement, Policy, Revision, TreeKey};

use super::limits::{lamp, lamps};
use super::update;
use testbed::testing::plan_device::{Played, slots};
use testbed::testing::plan_records::check_as_new;
use testbed::testing::support::Rng;

/// The words of an instance record that say where its tree is.
const PLACES: std::ops::Range<usize> = 13..17;

/// What the buffers say of a world, wherever they hold it: the settings, each instance with the
/// nodes and lights of its tree, and the directional lights.
fn records(played: &Played, world: &LightWorld) -> Vec<Vec<u32>> {
    let [params, _, nodes, instances, lights] = played.bound();
    let words = |id| bytemuck::pod_collect_to_vec::<u8, u32>(played.device.content(id));
    let (mut params, nodes, instances, lights) = (words(params), words(nodes), words(instances), words(lights));
    let [node_stride, light_stride, instance_stride] = [56, 16, 40];
    let mut records = Vec::new();
    for slot in 1..slots(world) {
        let mut record = instances[slot * instance_stride..][..instance_stride].to_vec();
        let [node, light] = [14, 15].map(|word| record[word] as usize);
        record[PLACES].fill(0);
        let tree = world.instance_at(slot as u32).and_then(|key| world.instance(key).map(|i| i.tree));
        // Hidden instances have no place.
        if let Some(tree) = tree.and_then(|tree| world.tree(tree)).filter(|_| record[12] & 1 == 1) {
            record.extend(&nodes[node * node_stride..][..tree.nodes().len() * node_stride]);
            record.extend(&lights[light * light_stride..][..tree.lights().len() * light_stride]);
        }
        records.push(record);
    }
    let [first, count] = [params[1] as usize, params[2] as usize];
    records.push(lights[first * light_stride..][..count * light_stride].to_vec());
    // The place of the directional lights, and the ranges of parts and of masks.
    [1, 5, 7].into_iter().for_each(|word| params[word] = 0);
    records.push(params);
    records
}

/// Any edit of a world.
fn edit(world: &mut LightWorld, rng: &mut Rng) {
    let pick = |count: usize, rng: &mut Rng| rng.bits() as usize % count.max(1);
    let trees: Vec<TreeKey> = world.trees().collect();
    let keys: Vec<InstanceKey> = world.instances().collect();
    let suns: Vec<_> = world.directionals().collect();
    let is_yes = rng.bits().is_multiple_of(2);
    let sun = DirectionalLight { direction: Vec3::NEG_Y, illuminance: Vec3::splat(rng.between(0.1, 1.0)) };
    let place = |rng: &mut Rng| Placement::at(rng.position(200.0).as_dvec3());
    match rng.bits() % 20 {
        0 | 1 => {
            let count = [1, 5, 17, 60, 300][pick(5, rng)];
            let tree = world.add_tree(LightTree::new(lamps(rng, count)).expect("valid"));
            world.add_instance(tree, place(rng), Policy::Budgeted).expect("valid");
        }
        2 if !suns.is_empty() => world.remove_directional(suns[pick(suns.len(), rng)]).expect("it lives"),
        3 => drop(world.add_directional(sun).expect("valid")),
        4 => world.set_origin_near(DVec3::splat(1024.0 * f64::from(rng.bits() as u32 % 5))).expect("near"),
        _ if keys.is_empty() => {}
        5 => {
            let tree = trees[pick(trees.len(), rng)];
            let of = |key: &&InstanceKey| world.instance(**key).map(|i| i.tree) == Some(tree);
            let instances: Vec<_> = keys.iter().filter(of).collect();
            instances.into_iter().for_each(|key| world.remove_instance(*key).expect("it lives"));
            world.remove_tree(tree).expect("no instances");
        }
        6 => drop(world.add_instance(trees[pick(trees.len(), rng)], place(rng), Policy::Budgeted).expect("valid")),
        7 => world.remove_instance(keys[pick(keys.len(), rng)]).expect("it lives"),
        8 => drop(world.make_unique(keys[pick(keys.len(), rng)]).expect("it lives")),
        9 => world.set_appearance(keys[pick(keys.len(), rng)], |a| a.is_enabled = is_yes).expect("it lives"),
        10 => world
            .set_appearance(keys[pick(keys.len(), rng)], |a| a.factor = Vec3::splat(rng.between(0.0, 2.0)))
            .expect("valid"),
        11 => world.set_appearance(keys[pick(keys.len(), rng)], |a| a.user_data = rng.bits() as u32).expect("it lives"),
        12 => world.set_lights(trees[pick(trees.len(), rng)], &[(0, lamp(rng))]).expect("the first one stays"),
        13 => {
            let tree = trees[pick(trees.len(), rng)];
            let added = world.add_lights(tree, &lamps(rng, 3)).expect("valid");
            world.remove_lights(tree, &added[1..2]).expect("it was added");
        }
        14 => {
            let count = 1 + pick(100, rng);
            world.replace_lights(trees[pick(trees.len(), rng)], lamps(rng, count)).expect("valid");
        }
        15 => drop(world.rebuild_tree(trees[pick(trees.len(), rng)]).expect("it lives")),
        16 => world.set_appearance(keys[pick(keys.len(), rng)], |a| a.mask = rng.bits() as u32).expect("it lives"),
        17 => {
            let moves: Vec<_> = keys.iter().step_by(2).map(|key| (*key, place(rng))).collect();
            world.move_instances(&moves).expect("valid");
        }
        _ => world.move_instance(keys[pick(keys.len(), rng)], place(rng)).expect("valid"),
    }
}

#[test]
fn readers_that_skip_frames_or_start_late_end_with_the_records_of_one_that_follows_each_frame() {
    for seed in 0..10 {
        let mut rng = Rng(700 + seed);
        let mut world = LightWorld::new();
        let (mut follower, mut skipper) = (Played::new(), Played::new());
        for frame in 0..60 {
            for _ in 0..rng.bits() % 6 {
                edit(&mut world, &mut rng);
            }
            update(&mut world);
            let is_changed = !world.changes_since(follower.planner.revision()).is_empty();
            let plan = follower.frame(&world);
            assert_eq!(world.revision(), follower.planner.revision());
            assert!(is_changed || plan.report.instances + plan.report.trees == 0);
            match rng.bits() % 16 {
                // A reservation that is dropped.
                0 => drop(skipper.planner.reserve(&world).expect("room enough")),
                // A device that loses what it has.
                1 => {
                    skipper.frame(&world);
                    skipper.planner.lose();
                    skipper.device.forget();
                }
                2 => drop(skipper.frame(&world)),
                _ if frame < 59 => continue,
                _ => {}
            }
            skipper.frame(&world);
            let mut fresh = Played::new();
            assert_eq!(fresh.planner.revision(), Revision::default());
            fresh.frame(&world);
            let expected = records(&fresh, &world);
            assert!(records(&follower, &world) == expected, "seed {seed}, frame {frame}: a reader of each frame");
            assert!(records(&skipper, &world) == expected, "seed {seed}, frame {frame}: a reader of some frames");
        }
        // Every instance that the top level is built from must be shown.
        let keys: Vec<_> = world.instances().collect();
        for key in keys {
            world.set_appearance(key, |a| a.is_enabled = true).expect("it lives");
            world.set_appearance(key, |a| a.factor = Vec3::ONE).expect("valid");
        }
        update(&mut world);
        for reader in [&mut follower, &mut skipper] {
            reader.frame(&world);
            check_as_new(reader, &world);
        }
    }
}
