//! What deciding costs: updates among many trees that ask for a rebuild, an update where nothing moved, and the frame in
//! which a tree that was built in the background takes its place.
//!
//! `cargo bench --bench scheduler`. Prints what the world itself reports of deciding, too. As a test (`cargo test
//! --benches`) every case runs once, at the smallest size.
#![allow(clippy::print_stdout, reason = "a program talks to its user")]

use std::time::{Duration, Instant};

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, BenchmarkId, Criterion, SamplingMode, criterion_group, criterion_main};
use girandole::glam::{DVec3, Vec3};
use girandole::{FrameBudget, FrameReport, Light, LightWorld, Placement, Policy, TreeKey};

#[path = "../examples/common/mod.rs"]
#[allow(dead_code, reason = "examples use more of it")]
mod common;
#[path = "../tests/all/support.rs"]
#[allow(dead_code, reason = "tests use more of it")]
mod support;
use support::Rng;

/// Of each of many trees: more than one node holds.
const LIGHTS: usize = 12;

/// Hardly room for one of those.
const TINY: FrameBudget = FrameBudget::new(Duration::from_micros(5));

/// Room for no tree of more than some hundred lights.
const SMALL: FrameBudget = FrameBudget::new(Duration::from_micros(40));

/// Longer than any build takes: something is wrong.
const TOO_LONG: Duration = Duration::from_secs(20);

/// Criterion measures only when `cargo bench` asks it to.
fn is_bench() -> bool {
    std::env::args().any(|a| a == "--bench")
}

/// Lights that may be anywhere within `size`.
fn cloud(count: usize, size: f32, rng: &mut Rng) -> Vec<(u32, Light)> {
    (0..count as u32).map(|light| (light, Light::point(rng.place(size), Vec3::splat(10.0)))).collect()
}

fn lights(changes: &[(u32, Light)]) -> Vec<Light> {
    changes.iter().map(|(_, light)| *light).collect()
}

/// Trees in a square, all new.
fn square(trees: usize, lights_each: usize, rng: &mut Rng) -> (LightWorld, Vec<TreeKey>) {
    let mut world = LightWorld::new();
    let side = (trees as f64).sqrt().ceil() as usize;
    let mut tree = |index: usize| {
        let key = world.add_tree(lights(&cloud(lights_each, 5.0, rng))).expect("valid lights");
        let place = DVec3::new((index % side) as f64, 0.0, (index / side) as f64) * 20.0;
        world.add_instance(key, Placement::at(place), Policy::Budgeted).expect("a valid placement");
        key
    };
    let keys = (0..trees).map(&mut tree).collect();
    world.set_viewpoint(DVec3::ZERO);
    (world, keys)
}

/// All lights go elsewhere, so that trees ask for a rebuild.
fn scatter(
    world: &mut LightWorld,
    keys: &[TreeKey],
    lights_each: usize,
    rng: &mut Rng,
    budget: FrameBudget,
) -> FrameReport {
    for key in keys {
        world.set_lights(*key, &cloud(lights_each, 5.0, rng)).expect("valid lights");
    }
    world.update(budget)
}

fn scheduler(c: &mut Criterion) {
    let mut group = c.benchmark_group("update");
    group.sample_size(20).sampling_mode(SamplingMode::Flat);
    group.warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(1));
    let sizes: &[usize] = if is_bench() { &[100, 1_000, 10_000, 100_000] } else { &[100] };
    for trees in sizes {
        decisions(&mut group, *trees);
    }
    let sizes: &[usize] = if is_bench() { &[1_000, 10_000] } else { &[1_000] };
    sizes.iter().for_each(|trees| frames(*trees));
    let sizes: &[usize] = if is_bench() { &[1_000, 10_000, 100_000] } else { &[1_000] };
    for lights in sizes {
        swaps(&mut group, *lights);
    }
    group.finish();
}

fn decisions(group: &mut BenchmarkGroup<WallTime>, trees: usize) {
    let mut rng = Rng(trees as u64);
    let (mut world, mut keys) = square(trees, LIGHTS, &mut rng);
    assert!(world.update(TINY).waiting_trees == 0, "new trees ask for nothing, before that is timed");
    // Until all are frozen, which takes their looking after off the update.
    let frozen = if is_bench() { girandole::effects::EFFECT_HOLD_UPDATES as usize + trees / 32 } else { 1 };
    for _ in 0..frozen {
        world.update(TINY);
    }
    group.bench_function(BenchmarkId::new("nothing moved", trees), |b| b.iter(|| world.update(TINY)));

    let mut waiting = scatter(&mut world, &keys, LIGHTS, &mut rng, FrameBudget::NONE).waiting_trees;
    assert!(waiting > trees / 2, "{waiting} of {trees} ask for a rebuild, before choosing among them is timed");
    let mut reported = Vec::new();
    group.bench_function(BenchmarkId::new("choosing among", trees), |b| {
        b.iter_custom(|rounds| {
            let mut took = Duration::ZERO;
            for _ in 0..rounds {
                if waiting <= trees / 2 {
                    // Trees learn from rebuilds, and may find that they need none: new ones know nothing.
                    (world, keys) = square(trees, LIGHTS, &mut rng);
                    waiting = scatter(&mut world, &keys, LIGHTS, &mut rng, FrameBudget::NONE).waiting_trees;
                    assert!(waiting > trees / 2, "{waiting} of {trees} ask for a rebuild");
                }
                let start = Instant::now();
                let report = world.update(TINY);
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
        println!("choosing among {trees}: median {deciding:?} by the report, {rebuilt:.1} trees rebuilt in the mean");
    }
}

/// Prints what choosing takes of the usual budget while every tree moves in every frame and rebuilds go on.
fn frames(trees: usize) {
    let mut rng = Rng(trees as u64);
    let (mut world, keys) = square(trees, LIGHTS, &mut rng);
    let budget = FrameBudget::default();
    let frames = if is_bench() { 60 } else { 2 };
    let mut reports: Vec<_> = (0..frames).map(|_| scatter(&mut world, &keys, LIGHTS, &mut rng, budget)).collect();
    reports.sort_unstable_by_key(|report| report.deciding);
    let FrameReport { deciding, spent, waiting_trees, rebuilt_trees, .. } = reports[frames / 2];
    assert!(rebuilt_trees > 0 && waiting_trees > 0, "there is something to choose");
    let share = 100.0 * deciding.as_secs_f64() / budget.time().as_secs_f64();
    println!(
        "choosing {rebuilt_trees} of {waiting_trees} that wait, all moving: {deciding:?} ({share:.1} % of the budget), \
         rebuilding {spent:?}"
    );
}

/// Times the update in which a tree that is too large for a frame gets the one that was built for it.
fn swaps(group: &mut BenchmarkGroup<WallTime>, count: usize) {
    let mut rng = Rng(count as u64);
    let (mut world, keys) = square(1, count, &mut rng);
    group.bench_function(BenchmarkId::new("swap of a tree of", count), |b| {
        b.iter_custom(|rounds| {
            let mut took = Duration::ZERO;
            for _ in 0..rounds {
                scatter(&mut world, &keys, count, &mut rng, FrameBudget::NONE);
                let begin = Instant::now();
                loop {
                    let start = Instant::now();
                    let report = world.update(SMALL);
                    if report.background.taken > 0 {
                        took += start.elapsed();
                        break;
                    }
                    assert_eq!(report.rebuilt_trees, 0, "no frame has room for it");
                    assert!(begin.elapsed() < TOO_LONG, "{report:?}");
                    std::thread::sleep(Duration::from_micros(100));
                }
            }
            took
        });
    });
    world.tree(keys[0]).expect("it lives").check().expect("sound");
}

criterion_group!(benches, scheduler);
criterion_main!(benches);
