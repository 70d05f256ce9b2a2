//! Times moves of a tenth of all instances, which are scattered over the slots: one by one and in
//! one call, turned and scaled or only translated; and the delta that names them.
//!
//! `cargo bench --bench moves`; set `RAYON_NUM_THREADS=1` for the figures of one core. As a test
//! (`cargo test --benches`) every case runs once, at the smallest size.

use std::time::{Duration, Instant};

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, BenchmarkId, Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use girandole::glam::DVec3;
use girandole::{FrameBudget, FrameDelta, InstanceKey, LightWorld, Placement, Policy};

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

/// Times work in frames that each move other instances. The work returns the time that counts.
fn time(
    group: &mut BenchmarkGroup<WallTime>,
    id: BenchmarkId,
    kind: Kind,
    count: usize,
    work: impl Fn(&mut LightWorld, &Moves) -> Duration,
) {
    let mut rng = Rng(count as u64);
    let mut world = world(count, kind, &mut rng);
    group.throughput(Throughput::Elements(count as u64 / 10));
    group.bench_function(id, |b| {
        b.iter_custom(|rounds| {
            let frame = |_| {
                let moves = scattered(&world, kind, &mut rng);
                let took = work(&mut world, &moves);
                world.update(FrameBudget::NONE);
                world.take_delta();
                assert!(moves.iter().all(|(key, placement)| world.placement(*key) == Some(*placement)));
                took
            };
            (0..rounds).map(frame).sum()
        });
    });
}

fn since(start: Instant, work: impl FnOnce()) -> Duration {
    work();
    start.elapsed()
}

fn one_by_one(world: &mut LightWorld, moves: &Moves) {
    for (key, placement) in moves {
        world.move_instance(*key, *placement).expect("a valid placement");
    }
}

fn in_one_call(world: &mut LightWorld, moves: &Moves) {
    world.move_instances(moves).expect("valid placements");
}

fn take(world: &mut LightWorld, moves: &Moves) -> Duration {
    in_one_call(world, moves);
    let mut delta = FrameDelta::default();
    let took = since(Instant::now(), || delta = world.take_delta());
    assert_eq!(delta.moved_instances().len(), moves.len());
    took
}

fn moves(c: &mut Criterion) {
    let mut group = c.benchmark_group("moves");
    group.sample_size(20).sampling_mode(SamplingMode::Flat);
    group.warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(1));
    let count = if std::env::args().any(|a| a == "--bench") { 100_000 } else { 1_000 };
    for kind in [Kind::Translated, Kind::Affine] {
        let id = |name| BenchmarkId::new(format!("{name}, {kind:?}"), count);
        let timed = |work: fn(&mut LightWorld, &Moves)| {
            move |world: &mut LightWorld, moves: &Moves| since(Instant::now(), || work(world, moves))
        };
        time(&mut group, id("one by one"), kind, count, timed(one_by_one));
        time(&mut group, id("move_instances"), kind, count, timed(in_one_call));
    }
    time(&mut group, BenchmarkId::new("take_delta", count), Kind::Translated, count, take);
    group.finish();
}

criterion_group!(benches, moves);
criterion_main!(benches);
