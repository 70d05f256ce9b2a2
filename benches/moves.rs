//! Times moves of a tenth of all instances, which are scattered over the slots: one by one and in
//! one call, turned and scaled or only translated; and the delta that names them. The throughput is
//! that of moved instances.
//!
//! `cargo bench --bench moves`; set `RAYON_NUM_THREADS=1` for the figures of one core. As a test
//! (`cargo test --benches`) every case runs once, at the smallest size.

use std::time::{Duration, Instant};

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, BenchmarkId, Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use girandole::glam::DVec3;
use girandole::{FrameBudget, InstanceKey, LightWorld, Placement, Policy};

#[path = "../examples/common/mod.rs"]
#[allow(dead_code, reason = "examples use more of it")]
mod common;
#[path = "../tests/all/support.rs"]
#[allow(dead_code, reason = "tests use more of it")]
mod support;
use support::Rng;

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
            Self::Translated => Placement::at(DVec3::from(rng.place(SIZE))),
            Self::Affine => rng.affine(SIZE).into(),
        }
    }
}

/// A world whose changes were taken.
fn world(count: usize, kind: Kind, rng: &mut Rng) -> LightWorld {
    let mut world = LightWorld::new();
    let trees: Vec<_> = (0..TREES).map(|_| world.add_tree(rng.lights(4, 2.0)).expect("valid lights")).collect();
    for index in 0..count {
        world.add_instance(trees[index % TREES], kind.place(rng), Policy::Budgeted).expect("a valid placement");
    }
    world.update(FrameBudget::NONE);
    world.take_delta();
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
    frame: fn(&mut LightWorld, &Moves) -> Duration,
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
                world.take_delta();
                assert!(moves.iter().all(|(key, placement)| world.placement(*key) == Some(*placement)));
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

fn take_delta(world: &mut LightWorld, moves: &Moves) -> Duration {
    in_one_call(world, moves);
    let start = Instant::now();
    let delta = world.take_delta();
    let took = start.elapsed();
    assert_eq!(delta.moved_instances().len(), moves.len());
    took
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
    time(&mut group, ("take_delta", Kind::Translated, count), take_delta);
    group.finish();
}

criterion_group!(benches, moves);
criterion_main!(benches);
