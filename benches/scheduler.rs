//! The cost of the scheduler itself: of updates with many trees that wait for a rebuild, of updates
//! in which nothing moved (with trees that are frozen, and with trees that are not), and of the
//! update that installs a tree that was built in the background.
//!
//! Run it with `cargo bench --bench scheduler`. It also prints the times that the world reports. As
//! a test (`cargo test --benches`) every case runs once, at the smallest size.
#![allow(clippy::print_stdout, reason = "a program talks to its user")]

use std::time::{Duration, Instant};

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, BenchmarkId, Criterion, SamplingMode, criterion_group, criterion_main};
use girandole::glam::{DVec3, Vec3};
use girandole::{Effects, FrameBudget, FrameReport, Light, LightTree, LightWorld, Placement, Policy, TreeKey};

use testbed::testing::support::Rng;

/// The lights of each of many trees: more than one node holds.
const LIGHTS: usize = 12;

/// A budget with hardly enough time for one tree of [`LIGHTS`] lights.
const ONE_TREE: FrameBudget = FrameBudget::new(Duration::from_micros(5));

/// A budget that is too small for trees of more than some hundred lights.
const TOO_SMALL: FrameBudget = FrameBudget::new(Duration::from_micros(40));

/// The number of updates without a change that are timed before all trees move again: so few that
/// all trees still count as moving.
const STILL_UPDATES: u64 = 100;

/// Far more time than any build in the background takes.
const BUILD_TIMEOUT: Duration = Duration::from_secs(20);

/// Whether this runs as a benchmark and not as a test: Criterion measures only under `cargo bench`.
fn is_bench() -> bool {
    std::env::args().any(|a| a == "--bench")
}

/// Random point lights within `size` metres of the origin, with their indices.
fn random_lights(count: usize, size: f32, rng: &mut Rng) -> Vec<(u32, Light)> {
    (0..count as u32).map(|light| (light, Light::point(rng.position(size), Vec3::splat(10.0)))).collect()
}

fn lights(changes: &[(u32, Light)]) -> Vec<Light> {
    changes.iter().map(|(_, light)| *light).collect()
}

/// A world of new trees in a square grid, seen from its corner.
fn grid_of_trees(trees: usize, lights_each: usize, rng: &mut Rng) -> (LightWorld, Vec<TreeKey>) {
    let mut world = LightWorld::new();
    let side = (trees as f64).sqrt().ceil() as usize;
    let mut add_tree = |index: usize| {
        let key = world.add_tree(LightTree::new(lights(&random_lights(lights_each, 5.0, rng))).expect("valid lights"));
        let translation = DVec3::new((index % side) as f64, 0.0, (index / side) as f64) * 20.0;
        world.add_instance(key, Placement::at(translation), Policy::Budgeted).expect("a valid placement");
        key
    };
    let keys = (0..trees).map(&mut add_tree).collect();
    world.set_viewpoint(DVec3::ZERO).expect("a finite viewpoint");
    (world, keys)
}

/// Moves all lights of the trees, so that the trees request a rebuild, and updates the world.
fn scatter(
    world: &mut LightWorld,
    keys: &[TreeKey],
    lights_each: usize,
    rng: &mut Rng,
    budget: FrameBudget,
) -> FrameReport {
    for key in keys {
        world.set_lights(*key, &random_lights(lights_each, 5.0, rng)).expect("valid lights");
    }
    world.update(budget)
}

fn scheduler(c: &mut Criterion) {
    let mut group = c.benchmark_group("update");
    group.sample_size(20).sampling_mode(SamplingMode::Flat);
    group.warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(1));
    let sizes: &[usize] = if is_bench() { &[100, 1_000, 10_000, 100_000] } else { &[100] };
    for trees in sizes {
        choose_among(&mut group, *trees);
        stay_awake(&mut group, *trees);
    }
    let sizes: &[usize] = if is_bench() { &[1_000, 10_000] } else { &[1_000] };
    sizes.iter().for_each(|trees| print_frame(*trees));
    let sizes: &[usize] = if is_bench() { &[1_000, 10_000, 100_000] } else { &[1_000] };
    for lights in sizes {
        install_build(&mut group, *lights);
    }
    group.finish();
}

/// Times updates in which nothing moved, and updates that choose among waiting trees.
fn choose_among(group: &mut BenchmarkGroup<WallTime>, trees: usize) {
    let mut rng = Rng(trees as u64);
    let (mut world, keys) = grid_of_trees(trees, LIGHTS, &mut rng);
    assert!(world.update(ONE_TREE).waiting_trees == 0, "new trees request nothing");
    // Freezes are not timed, so all trees are frozen first. At least 32 are frozen in one update.
    let updates = if is_bench() { girandole::effects::EFFECT_HOLD_UPDATES as usize + trees / 32 } else { 1 };
    for _ in 0..updates {
        world.update(ONE_TREE);
    }
    group.bench_function(BenchmarkId::new("nothing moved", trees), |b| b.iter(|| world.update(ONE_TREE)));

    let mut waiting = scatter(&mut world, &keys, LIGHTS, &mut rng, FrameBudget::NONE).waiting_trees;
    assert!(waiting > trees / 2, "only {waiting} of {trees} request a rebuild");
    let mut reported = Vec::new();
    group.bench_function(BenchmarkId::new("choosing among", trees), |b| {
        b.iter_custom(|rounds| {
            let mut took = Duration::ZERO;
            for _ in 0..rounds {
                if waiting <= trees / 2 {
                    waiting = scatter(&mut world, &keys, LIGHTS, &mut rng, FrameBudget::NONE).waiting_trees;
                    assert!(waiting > trees / 2, "only {waiting} of {trees} request a rebuild");
                }
                let start = Instant::now();
                let report = world.update(ONE_TREE);
                took += start.elapsed();
                waiting = report.waiting_trees;
                reported.push((report.deciding, report.rebuilt_trees));
            }
            took
        });
    });
    reported.sort_unstable();
    if let Some((deciding, _)) = reported.get(reported.len() / 2) {
        let rebuilt = reported.iter().map(|(_, rebuilt)| rebuilt).sum::<usize>() as f64 / reported.len() as f64;
        println!("choosing among {trees}: the report says {deciding:?} (median); {rebuilt:.1} trees rebuilt (mean)");
    }
}

/// Times updates in which nothing moved shortly after all trees moved, so that no tree is frozen
/// and all of them count as moving.
fn stay_awake(group: &mut BenchmarkGroup<WallTime>, trees: usize) {
    const { assert!(STILL_UPDATES < girandole::effects::EFFECT_HOLD_UPDATES as u64) };
    let lamp = |x: f32| Light::point(Vec3::new(x, 0.0, 0.0), Vec3::ONE);
    let mut world = LightWorld::new();
    let keys: Vec<_> =
        (0..trees).map(|_| world.add_tree(LightTree::new(vec![lamp(0.0)]).expect("a valid light"))).collect();
    let mut x = 0.0;
    group.bench_function(BenchmarkId::new("nothing moved, awake", trees), |b| {
        b.iter_custom(|rounds| {
            let (mut took, mut left) = (Duration::ZERO, rounds);
            while left > 0 {
                x += 1.0;
                for key in &keys {
                    world.set_lights(*key, &[(0, lamp(x))]).expect("a valid light");
                }
                world.update(FrameBudget::NONE);
                let updates = left.min(STILL_UPDATES);
                let start = Instant::now();
                for _ in 0..updates {
                    world.update(FrameBudget::NONE);
                }
                took += start.elapsed();
                left -= updates;
                assert_eq!(world.effect_counts().of(Effects::MOVING), trees as u64, "all trees count as moving");
            }
            took
        });
    });
}

/// Prints the share of the default budget that the choice takes while all trees move in every
/// frame.
fn print_frame(trees: usize) {
    let mut rng = Rng(trees as u64);
    let (mut world, keys) = grid_of_trees(trees, LIGHTS, &mut rng);
    let budget = FrameBudget::default();
    let frames = if is_bench() { 60 } else { 2 };
    let mut reports: Vec<_> = (0..frames).map(|_| scatter(&mut world, &keys, LIGHTS, &mut rng, budget)).collect();
    reports.sort_unstable_by_key(|report| report.deciding);
    let FrameReport { deciding, spent, waiting_trees, rebuilt_trees, .. } = reports[frames / 2];
    assert!(rebuilt_trees > 0 && waiting_trees > 0, "some trees are rebuilt and others wait");
    let share = 100.0 * deciding.as_secs_f64() / budget.time().as_secs_f64();
    println!(
        "{rebuilt_trees} trees rebuilt and {waiting_trees} waiting, all moving: choosing takes {deciding:?} \
         ({share:.1} % of the budget), rebuilding {spent:?}"
    );
}

/// Times the update that installs a build of a tree that is too large for a frame.
fn install_build(group: &mut BenchmarkGroup<WallTime>, count: usize) {
    let mut rng = Rng(count as u64);
    let (mut world, keys) = grid_of_trees(1, count, &mut rng);
    group.bench_function(BenchmarkId::new("installing a build", count), |b| {
        b.iter_custom(|rounds| {
            let mut took = Duration::ZERO;
            for _ in 0..rounds {
                scatter(&mut world, &keys, count, &mut rng, FrameBudget::NONE);
                let begin = Instant::now();
                loop {
                    let start = Instant::now();
                    let report = world.update(TOO_SMALL);
                    if report.background.taken > 0 {
                        took += start.elapsed();
                        break;
                    }
                    assert_eq!(report.rebuilt_trees, 0, "the tree is too large for a frame");
                    assert!(begin.elapsed() < BUILD_TIMEOUT, "{report:?}");
                    std::thread::sleep(Duration::from_micros(100));
                }
            }
            took
        });
    });
    world.tree(keys[0]).expect("the tree exists").check().expect("a sound tree");
}

criterion_group!(benches, scheduler);
criterion_main!(benches);
