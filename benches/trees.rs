//! Bottom-level trees by stage and size: build, refit (with attributes), pick, pmf.
//!
//! `cargo bench --bench trees`. As a test (`cargo test --benches`) every case runs once, at the smallest size.

use criterion::{BatchSize, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use girandole::glam::Vec3;
use girandole::{DEFAULT_OPENINGS, Light, LightTree, Receiver};

#[path = "../tests/all/support.rs"]
#[allow(dead_code, reason = "tests use more of it")]
mod support;
use support::Rng;

/// Lights of several kinds in a flat block, ten times as wide as high, as in a city.
fn lights(count: usize) -> Vec<Light> {
    let mut rng = Rng(count as u64);
    let mut light = || {
        let Vec3 { x, y, z } = rng.place(500.0);
        let position = Vec3::new(x, 0.1 * y, z);
        match rng.bits() % 3 {
            0 => Light::point(position, Vec3::splat(rng.between(1.0, 100.0))),
            1 => Light::spot(position, rng.direction(), 0.2, 0.6, Vec3::splat(rng.between(100.0, 1000.0))),
            _ => Light::rectangle(position, rng.direction(), rng.direction(), Vec3::splat(rng.between(1.0, 9.0))),
        }
    };
    (0..count).map(|_| light()).collect()
}

/// Criterion measures only when `cargo bench` asks it to.
fn sizes() -> &'static [usize] {
    if std::env::args().any(|a| a == "--bench") { &[1_000, 10_000, 100_000, 1_000_000] } else { &[1_000] }
}

fn trees(c: &mut Criterion) {
    for &count in sizes() {
        let lights = lights(count);
        let mut tree = LightTree::new(lights.clone()).expect("valid lights");
        tree.check().expect("a sound tree, before its building is timed");
        let mut rng = Rng(7);
        let receivers: Vec<Receiver> = (0..1024).map(|_| rng.receiver(500.0)).collect();
        let numbers = |i: usize| [0.618_034, 0.754_878].map(|s: f64| (i as f64 * s).fract() as f32);
        let mut turns = (0..).map(|i| (receivers[i % receivers.len()], numbers(i)));

        let mut group = c.benchmark_group("tree");
        group.sample_size(10).throughput(Throughput::Elements(count as u64));
        group.bench_function(BenchmarkId::new("build", count), |b| {
            b.iter_batched(|| lights.clone(), |l| LightTree::new(l).expect("valid"), BatchSize::LargeInput);
        });
        group.bench_function(BenchmarkId::new("refit", count), |b| b.iter(|| tree.refit()));
        group.throughput(Throughput::Elements(1));
        group.bench_function(BenchmarkId::new("pick", count), |b| {
            b.iter(|| turns.next().map(|(receiver, u)| tree.pick(&receiver, u, DEFAULT_OPENINGS)));
        });
        group.bench_function(BenchmarkId::new("pmf", count), |b| {
            b.iter(|| {
                turns.next().map(|(receiver, u)| tree.pmf(&receiver, (u[0] * count as f32) as u32, DEFAULT_OPENINGS))
            });
        });
        group.finish();
    }
}

criterion_group!(benches, trees);
criterion_main!(benches);
