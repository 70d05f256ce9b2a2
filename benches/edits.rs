//! Times edits, and the plans that send them to a GPU.
//!
//! - Moves of a tenth of all instances, which are scattered over the slots: one by one and in one
//!   call, turned and scaled or only translated; the list of them; and the plan of their
//!   frame. The throughput is that of moved instances.
//! - One light of a large tree that is changed, or removed and added elsewhere: the edit with the
//!   update of the world, and the plan of the frame.
//! - A hundred lights of a tree of 1,000 that are removed and as many added, beside a tree of as many
//!   lights that is built anew; and the frame that takes a build of a large tree that a thread has made.
//! - A region of 1,000 instances and 10,000 lights, in 100 trees or in one: to fill it, to add it, to remove it, and to free it. The throughput is that of lights where it is
//!   filled, and of instances elsewhere.
//! - The top level that the CPU builds for the first sampler after a change. The throughput is that of
//!   instances.
//! - Frames in which the origin moves, and frames in which it does not: the call that
//!   moves it, the update and the plan.
//!
//! `cargo bench --bench edits`; set `RAYON_NUM_THREADS=1` for the figures of one core. As a test
//! (`cargo test --benches`) every case runs once, at the smallest size.

use std::time::{Duration, Instant};

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, BenchmarkId, Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use girandole::glam::{DVec3, Vec3};
use girandole::plan::{LightPlanner, PlanLimits};
use girandole::{
    FrameBudget, InstanceKey, Light, LightTree, LightWorld, ORIGIN_GRID, Placement, Policy, Region, RegionInstance,
    TreeKey,
};

use testbed::testing::support::Rng;

/// The trees that the instances share.
const TREES: usize = 100;

/// Half of the side of the block in which the instances lie, in metres.
const SIZE: f32 = 500.0;

type Moves = Vec<(InstanceKey, Placement)>;

/// How the instances are placed.
#[derive(Clone, Copy, Debug)]
enum Kind {
    Translated,
    Affine,
}

impl Kind {
    fn place(self, rng: &mut Rng) -> Placement {
        match self {
            Self::Translated => Placement::at(DVec3::from(rng.position(SIZE))),
            Self::Affine => rng.affine(SIZE).into(),
        }
    }
}

/// A world that was updated.
fn world(count: usize, kind: Kind, rng: &mut Rng) -> LightWorld {
    let mut world = LightWorld::new();
    let trees: Vec<_> =
        (0..TREES).map(|_| world.add_tree(LightTree::new(rng.lights(4, 2.0)).expect("valid lights"))).collect();
    for index in 0..count {
        world.add_instance(trees[index % TREES], kind.place(rng), Policy::Budgeted).expect("a valid placement");
    }
    world.update(FrameBudget::NONE);
    world
}

/// Moves of a tenth of all instances, in random order.
fn scattered(world: &LightWorld, kind: Kind, rng: &mut Rng) -> Moves {
    let mut keys: Vec<_> = world.instances().collect();
    let moved = keys.len() / 10;
    for i in 0..moved {
        let other = i + rng.bits() as usize % (keys.len() - i);
        keys.swap(i, other);
    }
    keys[..moved].iter().map(|key| (*key, kind.place(rng))).collect()
}

/// Times frames that each move other instances. `frame` makes the moves, and returns the time of
/// what is measured.
fn time(
    group: &mut BenchmarkGroup<WallTime>,
    (name, kind, count): (&str, Kind, usize),
    mut frame: impl FnMut(&mut LightWorld, &Moves) -> Duration,
) {
    let mut rng = Rng(count as u64);
    let mut world = world(count, kind, &mut rng);
    group.throughput(Throughput::Elements(count as u64 / 10));
    group.bench_function(BenchmarkId::new(format!("{name}, {kind:?}"), count), |b| {
        b.iter_custom(|rounds| {
            let mut took = Duration::ZERO;
            for _ in 0..rounds {
                let moves = scattered(&world, kind, &mut rng);
                took += frame(&mut world, &moves);
                world.update(FrameBudget::NONE);
                assert!(
                    moves.iter().all(|(key, placement)| world.instance(*key).map(|i| i.placement) == Some(*placement))
                );
            }
            took
        });
    });
}

fn one_by_one(world: &mut LightWorld, moves: &Moves) -> Duration {
    let start = Instant::now();
    for (key, placement) in moves {
        world.move_instance(*key, *placement).expect("a valid placement");
    }
    start.elapsed()
}

fn in_one_call(world: &mut LightWorld, moves: &Moves) -> Duration {
    let start = Instant::now();
    world.move_instances(moves).expect("valid placements");
    start.elapsed()
}

fn list(world: &mut LightWorld, moves: &Moves) -> Duration {
    let seen = world.revision();
    in_one_call(world, moves);
    let start = Instant::now();
    let moved: Vec<u32> = world.changes_since(seen).moved_instances().collect();
    let took = start.elapsed();
    assert_eq!(moved.len(), moves.len());
    took
}

/// Plans frames with moves.
fn plan() -> impl FnMut(&mut LightWorld, &Moves) -> Duration {
    let mut planner = LightPlanner::new(PlanLimits::default());
    let mut is_first = true;
    move |world, moves| {
        if std::mem::take(&mut is_first) {
            planner.reserve(world).expect("room enough").plan();
        }
        world.move_instances(moves).expect("valid placements");
        let start = Instant::now();
        let plan = planner.reserve(world).expect("room enough").plan();
        let took = start.elapsed();
        assert_eq!(plan.report.instances, moves.len());
        took
    }
}

fn moves(c: &mut Criterion) {
    let mut group = c.benchmark_group("moves");
    group.sample_size(20).sampling_mode(SamplingMode::Flat);
    group.warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(1));
    let count = if std::env::args().any(|a| a == "--bench") { 100_000 } else { 10_000 };
    for kind in [Kind::Translated, Kind::Affine] {
        time(&mut group, ("move_instance", kind, count), one_by_one);
        time(&mut group, ("move_instances", kind, count), in_one_call);
    }
    time(&mut group, ("list", Kind::Translated, count), list);
    time(&mut group, ("plan", Kind::Translated, count), plan());
    group.finish();
}

/// An edit of one light of a tree.
type Edit = fn(&mut LightWorld, TreeKey, u32, &mut Rng);

/// A light that is dimmed.
fn change(world: &mut LightWorld, tree: TreeKey, light: u32, rng: &mut Rng) {
    world.set_emission(tree, light, Vec3::splat(rng.between(10.0, 20.0))).expect("valid");
}

/// A light that is removed, and one that is added elsewhere.
fn replace(world: &mut LightWorld, tree: TreeKey, light: u32, rng: &mut Rng) {
    let is_light = world.tree(tree).is_some_and(|tree| !tree.lights()[light as usize].is_removed());
    if is_light {
        world.remove_lights(tree, &[light]).expect("it is a light");
    }
    world.add_lights(tree, &[Light::point(rng.position(SIZE), Vec3::ONE)]).expect("valid");
}

fn lights(c: &mut Criterion) {
    let mut group = c.benchmark_group("lights");
    group.sample_size(20).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(1));
    let counts: &[u32] = if std::env::args().any(|a| a == "--bench") { &[1_000, 1_000_000] } else { &[1_000] };
    for count in counts.iter().copied() {
        let edits: [(&str, Edit); 2] = [("change", change), ("remove and add", replace)];
        for (name, edit) in edits {
            let mut rng = Rng(7);
            let mut world = LightWorld::new();
            let lamp = |rng: &mut Rng| Light::point(rng.position(SIZE), Vec3::ONE);
            let tree = world.add_tree(LightTree::new((0..count).map(|_| lamp(&mut rng)).collect()).expect("valid"));
            world.add_instance(tree, Placement::IDENTITY, Policy::Budgeted).expect("valid");
            world.update(FrameBudget::NONE);
            let mut planner = LightPlanner::new(PlanLimits::new(1 << 30));
            planner.reserve(&world).expect("room enough").plan();
            for is_planned in [false, true] {
                let name = format!("{name}{}", if is_planned { ", plan" } else { "" });
                group.bench_function(BenchmarkId::new(name, count), |b| {
                    b.iter_custom(|rounds| {
                        let mut took = Duration::ZERO;
                        for _ in 0..rounds {
                            let light = rng.bits() as u32 % count;
                            let start = Instant::now();
                            edit(&mut world, tree, light, &mut rng);
                            world.update(FrameBudget::NONE);
                            let edited = start.elapsed();
                            let start = Instant::now();
                            let plan = planner.reserve(&world).expect("room enough").plan();
                            took += if is_planned { start.elapsed() } else { edited };
                            assert!(plan.report.trees == 1 && plan.report.lights > 0);
                        }
                        took
                    });
                });
            }
        }
    }
    group.finish();
}

/// Many edits of a small tree, and what they replace: a build.
fn many_edits(c: &mut Criterion) {
    const LIGHTS: u32 = 1_000;
    const EDITS: usize = 100;
    let mut group = c.benchmark_group("many edits");
    group.sample_size(20).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(1));
    let mut rng = Rng(11);
    let mut lamps =
        |count: usize| -> Vec<Light> { (0..count).map(|_| Light::point(rng.position(SIZE), Vec3::ONE)).collect() };
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(lamps(LIGHTS as usize)).expect("valid"));
    world.add_instance(tree, Placement::IDENTITY, Policy::Budgeted).expect("valid");
    world.update(FrameBudget::NONE);
    let mut there: Vec<u32> = (0..LIGHTS).collect();
    let mut choices = Rng(12);
    group.bench_function("remove and add 100 of 1,000", |b| {
        b.iter_custom(|rounds| {
            let mut took = Duration::ZERO;
            for _ in 0..rounds {
                let added = lamps(EDITS);
                let gone: Vec<u32> =
                    (0..EDITS).map(|_| there.swap_remove(choices.bits() as usize % there.len())).collect();
                let start = Instant::now();
                world.remove_lights(tree, &gone).expect("they are lights");
                there.extend(world.add_lights(tree, &added).expect("valid"));
                world.update(FrameBudget::NONE);
                took += start.elapsed();
                assert_eq!(world.light_count(), LIGHTS as usize);
            }
            took
        });
    });
    group.bench_function("build 1,000", |b| {
        let lights = lamps(LIGHTS as usize);
        b.iter(|| LightTree::new(lights.clone()).expect("valid"));
    });
    group.finish();
}

/// The frame in which a build of a thread replaces its tree. Five lights changed in each of five frames since.
fn taken_builds(c: &mut Criterion) {
    let mut group = c.benchmark_group("taken builds");
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    group.warm_up_time(Duration::from_millis(1)).measurement_time(Duration::from_secs(2));
    let counts: &[u32] =
        if std::env::args().any(|a| a == "--bench") { &[20_000, 200_000, 1_000_000] } else { &[20_000] };
    for count in counts.iter().copied() {
        let mut rng = Rng(13);
        let mut world = LightWorld::new();
        let lights = (0..count).map(|_| Light::point(rng.position(SIZE), Vec3::ONE)).collect();
        let tree = world.add_tree(LightTree::new(lights).expect("valid"));
        world.add_instance(tree, Placement::IDENTITY, Policy::AlwaysRebuild).expect("valid");
        world.update(FrameBudget::NONE);
        group.bench_function(BenchmarkId::new("the frame that takes it", count), |b| {
            b.iter_custom(|rounds| {
                let mut took = Duration::ZERO;
                for _ in 0..rounds {
                    for number in 0.. {
                        for _ in 0..if number < 5 { 5 } else { 0 } {
                            change(&mut world, tree, rng.bits() as u32 % count, &mut rng);
                        }
                        let start = Instant::now();
                        let report = world.update(FrameBudget::new(Duration::from_micros(300)));
                        let frame = start.elapsed();
                        if report.background.taken == 1 {
                            took += frame;
                            break;
                        }
                        // As long as a frame of an engine.
                        std::thread::sleep(Duration::from_millis(1));
                    }
                }
                took
            });
        });
    }
    group.finish();
}

/// The instances and the lights of a region.
const REGION_INSTANCES: usize = 1_000;
const REGION_LIGHTS: usize = 10_000;

/// A region of so many trees.
fn region(trees: usize, rng: &mut Rng) -> Region {
    let mut region = Region::new();
    let mut trees = (0..trees)
        .map(|_| region.add_tree(LightTree::new(rng.lights(REGION_LIGHTS / trees, 5.0)).expect("valid lights")))
        .collect::<Vec<_>>()
        .into_iter()
        .cycle();
    for _ in 0..REGION_INSTANCES {
        let tree = trees.next().expect("a tree");
        let instance = RegionInstance::new(tree, rng.affine(SIZE), Policy::Budgeted);
        region.add_instance(instance).expect("a valid placement");
    }
    region
}

/// The stages of a region in a world.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    Fill,
    Add,
    Remove,
    Free,
}

fn regions(c: &mut Criterion) {
    let mut group = c.benchmark_group("regions");
    group.sample_size(20).sampling_mode(SamplingMode::Flat);
    group.warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(1));
    for trees in [100, 1] {
        for stage in [Stage::Fill, Stage::Add, Stage::Remove, Stage::Free] {
            let is_fill = stage == Stage::Fill;
            group.throughput(Throughput::Elements(if is_fill { REGION_LIGHTS } else { REGION_INSTANCES } as u64));
            group.bench_function(BenchmarkId::new(format!("{stage:?}"), trees), |b| {
                let mut rng = Rng(9);
                let mut world = world(10_000, Kind::Translated, &mut rng);
                let counts = (world.instances().len(), world.light_count());
                b.iter_custom(|rounds| {
                    let mut took = [Duration::ZERO; 4];
                    for _ in 0..rounds {
                        let start = Instant::now();
                        let mut filled = region(trees, &mut rng);
                        took[Stage::Fill as usize] += start.elapsed();
                        let start = Instant::now();
                        let key = world.add_region(&mut filled).expect("a valid region");
                        took[Stage::Add as usize] += start.elapsed();
                        let lights = REGION_INSTANCES * (REGION_LIGHTS / trees);
                        assert_eq!(world.light_count(), counts.1 + lights);
                        world.update(FrameBudget::NONE);
                        let start = Instant::now();
                        let removed = world.remove_region(key).expect("it lives");
                        took[Stage::Remove as usize] += start.elapsed();
                        assert_eq!((world.instances().len(), world.light_count()), counts);
                        let start = Instant::now();
                        drop(removed);
                        took[Stage::Free as usize] += start.elapsed();
                        world.update(FrameBudget::NONE);
                    }
                    took[stage as usize]
                });
            });
        }
    }
    group.finish();
}

/// Frames of a camera that moves by a step of the grid in each, or rests.
fn origin(c: &mut Criterion) {
    let mut group = c.benchmark_group("origin");
    group.sample_size(20).sampling_mode(SamplingMode::Flat);
    group.warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(1));
    let counts: &[usize] = if std::env::args().any(|a| a == "--bench") { &[1_000, 100_000] } else { &[1_000] };
    for count in counts.iter().copied() {
        for moves in [true, false] {
            let mut world = world(count, Kind::Affine, &mut Rng(9));
            let mut planner = LightPlanner::new(PlanLimits::default());
            planner.reserve(&world).expect("room enough").plan();
            let mut step = 0.0;
            let name = if moves { "moves" } else { "at rest" };
            group.bench_function(BenchmarkId::new(name, count), |b| {
                b.iter(|| {
                    step += if moves { 2.0 * ORIGIN_GRID } else { 0.0 };
                    world.set_origin_near(DVec3::X * (step % 1.0e6)).expect("within the limits");
                    world.update(FrameBudget::NONE);
                    let plan = planner.reserve(&world).expect("room enough").plan();
                    assert_eq!(plan.report.instances, 0);
                    assert_eq!(plan.is_empty(), !moves);
                });
            });
        }
    }
    group.finish();
}

/// The top level that the CPU builds for the first sampler after a change.
fn top_level(c: &mut Criterion) {
    let mut group = c.benchmark_group("top level");
    group.sample_size(10).sampling_mode(SamplingMode::Flat);
    group.warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(2));
    let counts: &[usize] =
        if std::env::args().any(|a| a == "--bench") { &[1_000, 10_000, 100_000, 1_000_000] } else { &[1_000] };
    for count in counts.iter().copied() {
        let mut world = world(count, Kind::Translated, &mut Rng(10));
        let mover = world.instances().next().expect("there are instances");
        let mut step = 0.0;
        group.throughput(Throughput::Elements(count as u64));
        group.bench_function(BenchmarkId::new("after a move", count), |b| {
            b.iter_custom(|rounds| {
                let mut took = Duration::ZERO;
                for _ in 0..rounds {
                    step += 1.0;
                    world.move_instance(mover, Placement::at(DVec3::X * (step % 100.0))).expect("a valid placement");
                    let start = Instant::now();
                    let nodes = world.sampler().top_nodes().len();
                    took += start.elapsed();
                    // Eight children for a node at most, and mostly so.
                    assert!(nodes >= count / 8 && nodes <= count, "{nodes}");
                }
                took
            });
        });
    }
    group.finish();
}

criterion_group!(benches, moves, lights, many_edits, taken_builds, regions, origin, top_level);
criterion_main!(benches);
