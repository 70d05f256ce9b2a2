//! Times the load of a baked tree against a copy of its bytes, and against a build.
//!
//! `cargo bench --bench bake`; set `RAYON_NUM_THREADS=1` for the figures of one core. As a test
//! (`cargo test --benches`) every case runs once, at the smallest size.

use std::time::{Duration, Instant};

use criterion::{
    BatchSize, Bencher, BenchmarkId, Criterion, SamplingMode, Throughput, criterion_group, criterion_main,
};
use girandole::glam::Vec3;
use girandole::{Light, LightTree, LightWorld};

use testbed::testing::support::Rng;

/// Lights of three kinds in a flat block.
fn lights(count: usize) -> Vec<Light> {
    let mut rng = Rng(count as u64);
    let mut light = || {
        let position = rng.position(500.0) * Vec3::new(1.0, 0.1, 1.0);
        match rng.bits() % 3 {
            0 => Light::point(position, Vec3::splat(rng.between(1.0, 100.0))),
            1 => Light::spot(position, rng.direction(), 0.2, 0.6, Vec3::splat(rng.between(100.0, 1000.0))),
            _ => Light::rectangle(position, rng.direction(), rng.direction(), Vec3::splat(rng.between(1.0, 9.0))),
        }
    };
    (0..count).map(|_| light()).collect()
}

/// Numbers of lights. Only `cargo bench` measures; a test runs the smallest size.
fn sizes() -> &'static [usize] {
    if std::env::args().any(|a| a == "--bench") { &[1_000, 100_000, 1_000_000] } else { &[1_000] }
}

/// Times some work, but not the drop of what it makes: each result needs new memory.
fn time<T>(bencher: &mut Bencher<'_>, mut work: impl FnMut() -> T) {
    bencher.iter_custom(|iterations| {
        let mut sum = Duration::ZERO;
        for _ in 0..iterations {
            let start = Instant::now();
            let made = work();
            sum += start.elapsed();
            drop(std::hint::black_box(made));
        }
        sum
    });
}

fn bake(c: &mut Criterion) {
    for &count in sizes() {
        let tree = LightTree::new(lights(count)).expect("the lights are valid");
        let bytes = tree.bake();
        let loaded = LightTree::from_baked(&bytes).expect("bytes that were just written");
        loaded.check().expect("the loaded tree is sound");
        assert_eq!((loaded.nodes(), loaded.lights()), (tree.nodes(), tree.lights()));
        let mut group = c.benchmark_group("bake");
        group.sample_size(20).sampling_mode(SamplingMode::Flat);
        group.warm_up_time(Duration::from_millis(500)).measurement_time(Duration::from_secs(3));
        group.throughput(Throughput::Bytes(bytes.len() as u64));
        group.bench_function(BenchmarkId::new("copy", count), |b| time(b, || bytes.clone()));
        group.bench_function(BenchmarkId::new("load", count), |b| {
            time(b, || LightTree::from_baked(&bytes).expect("bytes that were just written"));
        });
        group.bench_function(BenchmarkId::new("write", count), |b| time(b, || loaded.bake()));
        let insert = |tree| {
            let mut world = LightWorld::new();
            world.add_tree(tree);
            world
        };
        group.bench_function(BenchmarkId::new("insert", count), |b| {
            b.iter_batched(|| loaded.clone(), insert, BatchSize::PerIteration);
        });
        group.bench_function(BenchmarkId::new("check", count), |b| b.iter(|| loaded.check()));
        group.bench_function(BenchmarkId::new("build", count), |b| {
            b.iter_batched(
                || tree.lights().to_vec(),
                |lights| LightTree::new(lights).expect("the lights are valid"),
                BatchSize::PerIteration,
            );
        });
        group.finish();
    }
}

criterion_group!(benches, bake);
criterion_main!(benches);
