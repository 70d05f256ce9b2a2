//! A frame in which nothing grows allocates nothing, and what a file claims allocates nothing.

use std::cell::Cell;

use girandole::effects::EFFECT_HOLD_UPDATES;
use girandole::glam::{DVec3, Vec3};
use girandole::plan::{LightPlanner, PlanLimits, UploadReport};
use girandole::{
    Effects, FrameBudget, InstanceKey, Light, LightTree, LightWorld, Placement, Policy, Region, RegionInstance,
    Reservoir, TreeKey,
};

use testbed::testing::counting::{Counting, held_bytes, live_bytes, requested_bytes, requests};
use testbed::testing::support::{Rng, world_of};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Runs on a pool of one thread, so that all of the work is counted.
pub fn on_one_thread(work: impl FnOnce() + Send) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
    pool.install(work);
}

#[test]
fn an_edit_and_a_refit_of_a_tree_ask_for_no_memory() {
    on_one_thread(|| {
        let mut rng = Rng(71);
        for count in [1, 9, 500, 50_000] {
            let tree = LightTree::new(rng.lights(count, 50.0)).expect("valid");
            // A clone has as much capacity as the tree itself.
            for mut tree in [tree.clone(), tree] {
                for changed in [1, count.div_ceil(50), count] {
                    // Lights that jump get other places in the tree, which asks for memory.
                    let mut change = || {
                        let index = (rng.bits() % count as u64) as usize;
                        let mut light = tree.lights()[index];
                        light.emission = rng.light(50.0).emission;
                        (index as u32, light)
                    };
                    let changes: Vec<_> = (0..changed).map(|_| change()).collect();
                    for refit in [LightTree::refit, LightTree::refit_without_attributes] {
                        let requests = requests(|| {
                            tree.set_lights(&changes).expect("valid");
                            refit(&mut tree);
                        });
                        assert_eq!(requests, 0, "{changed} of {count} lights");
                    }
                }
            }
        }
    });
}

#[test]
fn a_tree_that_was_made_elsewhere_is_taken_in_without_a_copy_or_a_build() {
    on_one_thread(|| {
        let mut rng = Rng(74);
        let made: Vec<_> = (0..3).map(|_| LightTree::new(rng.lights(20_000, 50.0)).expect("valid")).collect();
        let addresses: Vec<_> = made.iter().map(|tree| (tree.nodes().as_ptr(), tree.lights().as_ptr())).collect();
        let mut world = rng.world(2, 50, 3, 20.0);
        world.update(FrameBudget::NONE);
        let small = world.trees().next().expect("a tree");
        let [first, second, third] = <[LightTree; 3]>::try_from(made).expect("three trees");
        let mut keys = Vec::with_capacity(3);
        // Lists of the world grow, whatever the size of the tree; a build asks for 10 MB.
        let asked = requested_bytes(|| {
            keys.push(world.add_tree(first));
            keys.push(world.add_tree(second));
        });
        assert!(asked < 20_000, "{asked} bytes");
        let asked = requested_bytes(|| drop(world.replace_tree(small, third).expect("it lives")));
        assert!(asked < 20_000, "{asked} bytes");
        keys.push(small);
        for (key, address) in keys.into_iter().zip(addresses) {
            let tree = world.tree(key).expect("it lives");
            assert_eq!((tree.nodes().as_ptr(), tree.lights().as_ptr()), address);
        }
    });
}

/// A region of two trees of so many lights, and one that is frozen, with 30 instances.
fn region(rng: &mut Rng, lights: usize) -> Region {
    let mut region = Region::new();
    let mut frozen = LightTree::new(rng.lights(lights, 50.0)).expect("valid");
    frozen.freeze();
    let trees = [
        region.add_tree(LightTree::new(rng.lights(lights, 50.0)).expect("valid")),
        region.add_tree(LightTree::new(rng.lights(lights, 50.0)).expect("valid")),
        region.add_tree(frozen),
    ];
    for i in 0..30 {
        let instance = RegionInstance::new(trees[i % 3], rng.affine(100.0), Policy::Budgeted);
        region.add_instance(instance).expect("valid");
    }
    region
}

#[test]
fn a_region_is_added_and_removed_without_a_build_a_copy_or_a_freed_tree() {
    on_one_thread(|| {
        let mut rng = Rng(77);
        let mut asked_before = None;
        for lights in [1_000, 20_000] {
            let mut world = rng.world(2, 50, 3, 20.0);
            drop(world.add_region(&mut region(&mut rng, 9)).map(|key| world.remove_region(key)));
            world.update(FrameBudget::NONE);
            let mut filled = region(&mut rng, lights);
            let mut key = None;
            let asked = requested_bytes(|| key = Some(world.add_region(&mut filled).expect("valid")));
            let key = key.expect("it was added");
            // The lists of the region and of the world; the trees have 20 MB.
            assert!(asked < 10_000, "{asked} bytes for trees of {lights} lights");
            assert!(asked_before.is_none_or(|before| asked <= before), "{asked} bytes");
            asked_before = Some(asked);
            let trees = world.region(key).expect("it lives").trees.clone();
            let tree = |index: usize| world.tree(trees[index]).expect("it lives");
            assert!(!tree(0).is_frozen() && tree(2).is_frozen());
            let bytes: usize = (0..3).map(|index| tree(index).memory_bytes()).sum();

            let mut removed = None;
            let ((), held) = held_bytes(|| removed = Some(world.remove_region(key).expect("it lives")));
            assert!(held > -10_000, "{held} bytes");
            let ((), held) = held_bytes(|| drop(removed));
            assert!(held <= -(bytes as isize), "{held} of {bytes} bytes");
        }
    });
}

#[test]
fn the_memory_of_a_tree_is_what_it_holds() {
    on_one_thread(|| {
        let mut rng = Rng(78);
        for count in [0, 1, 40, 3_000, 50_000] {
            let (lights, more) = (rng.lights(count, 50.0), rng.lights(count / 3, 50.0));
            let exact = |tree: &LightTree, held: isize, what: &str| {
                let bytes = tree.memory_bytes() as isize;
                let parts = tree.memory();
                assert_eq!(tree.memory_bytes(), parts.nodes + parts.lights + parts.refits);
                assert_eq!(bytes, held, "{what}: {parts:?} of {count} lights");
            };
            let (tree, of_lights) = held_bytes(|| lights.clone());
            let (tree, held) = held_bytes(|| LightTree::new(tree).expect("valid"));
            exact(&tree, held + of_lights, "built");
            let held_before = held + of_lights;
            let (tree, held) = held_bytes(|| {
                let mut tree = tree;
                tree.freeze();
                tree
            });
            exact(&tree, held_before + held, "frozen");
            let (copy, held) = held_bytes(|| tree.clone());
            exact(&copy, held, "copied");
            // Sets of indices take more than their 4 bytes for each.
            let tree = LightTree::new(lights.clone()).expect("valid");
            let before = tree.memory_bytes() as isize;
            let (edited, held) = held_bytes(|| {
                let mut tree = tree;
                tree.add_lights(&more).expect("valid");
                tree.remove_lights(&(0..count as u32 / 5).collect::<Vec<_>>()).expect("lights");
                tree
            });
            let slack = 16 * (edited.lights().len() - edited.light_count()) as isize + 1_000;
            let bytes = edited.memory_bytes() as isize;
            assert!((bytes - before - held).abs() <= slack, "{bytes} and {} bytes held", before + held);
        }
    });
}

#[test]
fn the_memory_of_a_world_is_what_it_holds_but_for_one_percent() {
    on_one_thread(|| {
        let mut rng = Rng(79);
        let trees: Vec<_> = (0..200).map(|_| rng.lights(100, 5.0)).collect();
        let changes: Vec<_> = (0..2_000).map(|index| (index, rng.light(50.0))).collect();
        let places: Vec<_> = (0..5_000).map(|_| rng.affine(100.0)).collect();
        let before = live_bytes();
        let mut world = LightWorld::new();
        let parts = Cell::new(0);
        let check = |world: &LightWorld, what: &str| {
            let (held, memory) = (live_bytes() - before, world.memory());
            let bytes = memory.total() as isize;
            // Left out are the lists of the scheduler, of what changed and of crowds: at
            // most 200 bytes for each instance and each tree; and the partition of the top level.
            let left_out =
                200 * (world.instances().len() + world.trees().len()) as isize + 120 * parts.get() as isize + 60_000;
            assert!((bytes..bytes + bytes / 100 + left_out).contains(&held), "{what}: {held} held, {memory:?}");
        };
        check(&world, "empty");
        let mut keys = Vec::with_capacity(2);
        for lights in [20_000, 300] {
            keys.push(world.add_region(&mut region(&mut rng, lights)).expect("valid"));
        }
        check(&world, "regions");
        for lights in &trees {
            let tree = world.add_tree(LightTree::new(lights.clone()).expect("valid"));
            places.iter().step_by(200).for_each(|place| drop(world.add_instance(tree, *place, Policy::Budgeted)));
        }
        check(&world, "trees");
        let large = world.region(keys[0]).expect("it lives").trees[1];
        world.set_lights(large, &changes).expect("valid");
        check(&world, "edits");
        for _ in 0..6 {
            parts.set(world.update(FrameBudget::UNLIMITED).parts.max(parts.get()));
            check(&world, "updates");
        }
        for key in keys {
            drop(world.remove_region(key).expect("it lives"));
        }
        check(&world, "after the removal");
        assert_eq!(world.memory().successors, 0);
    });
}

#[test]
fn a_load_asks_for_about_the_bytes_of_the_file_and_a_refusal_for_next_to_none() {
    on_one_thread(|| {
        let bytes = LightTree::new(Rng(75).lights(20_000, 50.0)).expect("valid").bake();
        let asked = requested_bytes(|| drop(LightTree::from_baked(&bytes).expect("bytes that were just written")));
        assert!(asked <= bytes.len() + 20_000, "{asked} bytes for a file of {}", bytes.len());
        let put = |at: usize, word: u32| {
            let mut bytes = bytes.clone();
            bytes[at..at + 4].copy_from_slice(&word.to_le_bytes());
            bytes
        };
        // The header claims up to 2^31 lights, 2^29 nodes or 2^32 sides, and the checksum is right.
        let counts = [12, 16, 20].into_iter().flat_map(|at| [u32::MAX, (1 << 31) - 1, (1 << 29) - 1].map(|n| (at, n)));
        let forged = counts.map(|(at, count)| {
            let mut bytes = put(at, count);
            let end = bytes.len() - 4;
            let sum = crc32fast::hash(&bytes[..end]);
            bytes[end..].copy_from_slice(&sum.to_le_bytes());
            bytes
        });
        let shorter = [0, 7, 12, 15, 159, 160, bytes.len() / 2, bytes.len() - 1].map(|n| bytes[..n].to_vec());
        let others = [put(0, 7), put(8, u32::MAX), put(bytes.len() / 2, 0x5eed)];
        for wrong in forged.chain(shorter).chain(others) {
            let asked = requested_bytes(|| assert!(LightTree::from_baked(&wrong).is_err()));
            // A checksum of several pieces takes a list, and the error a text.
            assert!(asked < 2000, "{asked} bytes");
        }
    });
}

#[test]
fn edits_that_wait_for_the_update_take_memory_for_each_light_once() {
    let mut rng = Rng(73);
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(rng.lights(500, 10.0)).expect("valid"));
    let changes: Vec<_> = (0..500).map(|index| (index, rng.light(10.0))).collect();
    world.set_lights(tree, &changes).expect("valid");
    let asked = requests(|| {
        for _ in 0..1000 {
            let some: [(u32, Light); 2] = std::array::from_fn(|_| ((rng.bits() % 500) as u32, rng.light(10.0)));
            world.set_lights(tree, &some).expect("valid");
        }
        world.set_lights(tree, &changes).expect("valid");
    });
    assert_eq!(asked, 0);
    world.update(FrameBudget::NONE);
    assert!(
        world.tree(tree).expect("it lives").lights().iter().zip(&changes).all(|(light, change)| *light == change.1)
    );
}

#[test]
fn an_update_in_which_nothing_moves_asks_for_no_memory_while_100_000_trees_come_to_rest() {
    let lamp = |x: f32| Light::point(Vec3::new(x, 0.0, 0.0), Vec3::ONE);
    let mut world = LightWorld::new();
    let trees: Vec<_> = (0..100_000).map(|_| world.add_tree(LightTree::new(vec![lamp(0.0)]).expect("valid"))).collect();
    // A part of the trees move in each of some updates, so that they come to rest in different
    // updates.
    for group in trees.chunks(trees.len() / 10) {
        for tree in group.iter().step_by(2) {
            world.set_lights(*tree, &[(0, lamp(1.0))]).expect("valid");
        }
        world.update(FrameBudget::NONE);
    }
    let frozen = |world: &LightWorld| trees.iter().filter(|tree| world.tree(**tree).unwrap().is_frozen()).count();
    assert_eq!((world.effect_counts().of(Effects::MOVING), frozen(&world)), (50_000, 0));
    for _ in 0..5 * EFFECT_HOLD_UPDATES {
        let seen = world.revision();
        let asked = requests(|| {
            world.update(FrameBudget::NONE);
            assert!(world.changes_since(seen).is_empty());
        });
        assert_eq!(asked, 0);
    }
    assert_eq!(world.effect_counts().of(Effects::MOVING), 0);
    assert!(frozen(&world) > 5000);
}

#[test]
fn moves_of_many_instances_and_lists_of_them_ask_for_no_memory() {
    on_one_thread(|| {
        let mut rng = Rng(76);
        let mut world = rng.world(5, 3, 4_000, 100.0);
        let keys: Vec<_> = world.instances().collect();
        let mut moves = |count: usize| -> Vec<(InstanceKey, Placement)> {
            // A part of the instances is moved twice.
            let key = |bits: u64| keys[bits as usize % keys.len()];
            (0..count).map(|_| (key(rng.bits()), rng.affine(100.0).into())).collect()
        };
        let all: Vec<_> = keys.iter().map(|key| (*key, Placement::at(DVec3::ONE))).collect();
        world.move_instances(&all).expect("valid");
        world.update(FrameBudget::NONE);
        for count in [1, 100, 10_000] {
            let (moves, seen) = (moves(count), world.revision());
            assert_eq!(requests(|| world.move_instances(&moves).expect("valid")), 0, "{count} moves");
            world.update(FrameBudget::NONE);
            let mut moved = 0;
            assert_eq!(requests(|| moved = world.changes_since(seen).moved_instances().count()), 0, "{count} moves");
            assert!((1..=count).contains(&moved));
            let asked = requests(|| moves.iter().for_each(|(key, to)| world.move_instance(*key, *to).expect("valid")));
            assert_eq!(asked, 0, "{count} moves, one by one");
        }
    });
}

/// An edit of a world of one large tree and many instances.
type Edit = fn(&mut LightWorld, TreeKey, InstanceKey, u32);

#[test]
fn a_frame_asks_for_memory_by_what_it_changes_and_not_by_the_size_of_the_world() {
    let lamp = |i: u32| Light::point(Vec3::new(i as f32, 3.0, 7.0), Vec3::ONE);
    let edits: [(&str, Edit); 8] = [
        ("move", |world, _, key, i| world.move_instance(key, Placement::at(DVec3::splat(i.into()))).expect("valid")),
        ("enabled", |world, _, key, i| world.set_appearance(key, |a| a.is_enabled = i % 2 == 1).expect("it lives")),
        ("factor", |world, _, key, i| {
            world.set_appearance(key, |a| a.factor = Vec3::splat(0.5 + i as f32)).expect("valid")
        }),
        ("user data", |world, _, key, i| world.set_appearance(key, |a| a.user_data = i).expect("it lives")),
        ("change", |world, tree, _, i| world.set_emission(tree, 7, Vec3::splat(2.0 + i as f32)).expect("valid")),
        ("add", |world, tree, _, i| drop(world.add_lights(tree, &[Light::point(Vec3::splat(i as f32), Vec3::ONE)]))),
        ("remove", |world, tree, _, i| world.remove_lights(tree, &[20 + i]).expect("a light")),
        ("nothing", |_, _, _, _| {}),
    ];
    on_one_thread(|| {
        for (name, edit) in edits {
            let mut asked_before = None;
            for (lights, instances) in [(1_000, 300), (30_000, 20_000)] {
                let (mut world, tree, _) = world_of((0..lights).map(lamp).collect(), Policy::Budgeted);
                let small = world.add_tree(LightTree::new(vec![lamp(0)]).expect("valid"));
                // So far away that the large tree is whole: they are sent with what changes.
                let place = |i: u32| Placement::at(DVec3::new(f64::from(i * i % 9973), 500.0, f64::from(i % 997)));
                let add = |i| world.add_instance(small, place(i), Policy::Budgeted).expect("valid");
                let keys: Vec<_> = (0..instances).map(add).collect();
                let mut planner = LightPlanner::new(PlanLimits::new(1 << 30));
                let mut frame = |world: &mut LightWorld, i: u32| {
                    edit(world, tree, keys[17], i);
                    world.update(FrameBudget::NONE);
                    planner.reserve(world).expect("room enough").plan().report
                };
                // Lists reach their size.
                for i in 0..6 {
                    frame(&mut world, i);
                }
                let mut least = usize::MAX;
                for i in 6..10 {
                    let mut report = UploadReport::default();
                    let asked = requested_bytes(|| report = frame(&mut world, i));
                    assert_eq!(report == UploadReport::default(), name == "nothing", "{name}");
                    least = least.min(asked);
                }
                // Now and then a list grows; it does not in all four frames. A larger top level takes
                // some more dispatches.
                let limit = asked_before.map_or(16_384, |before| 2 * before);
                assert!(least <= limit, "{name}: {least} bytes with {lights} lights and {instances} instances");
                assert_eq!(least == 0, name == "nothing");
                asked_before = Some(least);
            }
        }
    });
}

#[test]
fn an_origin_that_follows_the_camera_asks_for_no_memory() {
    let (mut world, mut rng) = (LightWorld::new(), Rng(79));
    let tree = world.add_tree(LightTree::new(rng.lights(20, 1.0)).expect("valid"));
    for _ in 0..1000 {
        world.add_instance(tree, rng.affine(3000.0), Policy::Static).expect("valid");
    }
    world.update(FrameBudget::NONE);
    let mut shifts = 0;
    for i in 0..200 {
        let viewpoint = DVec3::new(300.0 * f64::from(i), 1.7, -5.0);
        let seen = world.revision();
        let asked = requests(|| {
            world.set_origin_near(viewpoint).expect("within the limits");
            world.update(FrameBudget::NONE);
            shifts += usize::from(world.changes_since(seen).origin_shift().is_some());
        });
        assert_eq!(asked, 0, "frame {i}");
    }
    assert!(shifts > 50, "{shifts}");
}

#[test]
fn sampling_asks_for_no_memory() {
    let mut rng = Rng(83);
    let world = rng.world(3, 30, 4, 10.0);
    // This builds the top level.
    let sampler = world.sampler();
    let shading_points: Vec<_> = (0..50).map(|_| rng.shading_point(12.0)).collect();
    let asked = requests(|| {
        for shading_point in &shading_points {
            let u = [rng.unit(), rng.unit(), rng.unit(), rng.unit()];
            let five = [u[0], u[1], u[2], u[3], rng.unit()];
            let kept = sampler.resample(shading_point, five, 32);
            if let Some(sample) = sampler
                .reservoir_sample(shading_point, &Reservoir { reflected: 1.0, ..kept }.merge(2.0, &kept, 1.0, u[0]))
            {
                std::hint::black_box(sampler.pdf(shading_point, sample.light, Vec3::ZERO));
            }
            std::hint::black_box(sampler.sample(shading_point, u));
        }
    });
    assert_eq!(asked, 0);
}

#[test]
fn a_planner_takes_the_bytes_for_each_tree_and_each_instance_that_its_documentation_states() {
    on_one_thread(|| {
        let lamp = || LightTree::new(vec![Light::point(Vec3::ONE, Vec3::ONE)]).expect("valid");
        let bytes = |trees: u32, instances: u32| {
            let mut world = LightWorld::new();
            let keys: Vec<TreeKey> = (0..trees).map(|_| world.add_tree(lamp())).collect();
            for i in 0..instances {
                world.add_instance(keys[0], Placement::at(DVec3::X * f64::from(i)), Policy::Static).expect("valid");
            }
            world.update(FrameBudget::NONE);
            let (planner, held) = held_bytes(|| {
                let mut planner = LightPlanner::new(PlanLimits::new(1 << 30));
                drop(planner.reserve(&world).expect("room enough").plan());
                planner
            });
            drop(planner);
            held as f64
        };
        let (empty, trees, instances) = (bytes(1, 0), bytes(64_000, 0), bytes(1, 64_000));
        let [of_tree, of_instance] = [trees, instances].map(|bytes| (bytes - empty) / 64_000.0);
        assert!(of_tree <= 97.0 && of_instance <= 9.0, "{of_tree} for each tree, {of_instance} for each instance");
        assert!(of_tree > 64.0 && of_instance > 7.0, "{of_tree} for each tree, {of_instance} for each instance");
    });
}
