//! Times bottom-level trees by stage and size: builds (compared with a published binary build), the
//! parts of a refit (compared with a copy of as many bytes), picks and pmf.
//!
//! `cargo bench --bench trees`; set `RAYON_NUM_THREADS=1` for the figures of one core. As a test
//! (`cargo test --benches`) every case runs once, at the smallest size.

use std::time::{Duration, Instant};

use criterion::measurement::WallTime;
use criterion::{
    BatchSize, Bencher, BenchmarkGroup, BenchmarkId, Criterion, SamplingMode, Throughput, criterion_group,
    criterion_main,
};
use girandole::glam::Vec3;
use girandole::tree::{Node, WIDTH};
use girandole::{Light, LightTree, ShadingPoint, Shape};

use testbed::measuring::baselines::{BinaryTree, Pbrt};
use testbed::testing::support::Rng;

/// Bytes of a node that a refit reads and writes in addition to the packed node: 17 properties of
/// eight children, in f32.
const FULL_PRECISION_BYTES: usize = 17 * WIDTH * size_of::<f32>();

/// The published build takes seconds for more lights.
const MAX_BASELINE_LIGHTS: usize = 100_000;

/// Relative tolerance. A pick multiplies probabilities on the way down and a pmf on the way up, so
/// both round differently.
const PMF_TOLERANCE: f32 = 1.0e-5;

/// Lights of several kinds in a flat block, ten times as wide as it is high, as in a city.
fn lights(count: usize) -> Vec<Light> {
    let mut rng = Rng(count as u64);
    let mut light = || {
        let Vec3 { x, y, z } = rng.position(500.0);
        let position = Vec3::new(x, 0.1 * y, z);
        match rng.bits() % 3 {
            0 => Light::point(position, Vec3::splat(rng.between(1.0, 100.0))),
            1 => Light::spot(position, rng.direction(), 0.2, 0.6, Vec3::splat(rng.between(100.0, 1000.0))),
            _ => Light::rectangle(position, rng.direction(), rng.direction(), Vec3::splat(rng.between(1.0, 9.0))),
        }
    };
    (0..count).map(|_| light()).collect()
}

/// A light moved to a position.
fn moved_to(mut light: Light, to: Vec3) -> Light {
    match &mut light.shape {
        Shape::Point { position } | Shape::Spot { position, .. } => *position = to,
        Shape::Rectangle { center, .. } => *center = to,
        other => unreachable!("these lights have no {other:?}"),
    }
    light
}

/// Numbers of lights. Only `cargo bench` measures; a test runs the smallest size.
fn sizes() -> &'static [usize] {
    if std::env::args().any(|a| a == "--bench") { &[1_000, 10_000, 100_000, 1_000_000] } else { &[1_000] }
}

fn built(lights: &[Light]) -> LightTree {
    let tree = LightTree::new(lights.to_vec()).expect("the lights are valid");
    tree.check().expect("the tree is sound");
    tree
}

fn trees(c: &mut Criterion) {
    for &count in sizes() {
        let lights = lights(count);
        let mut group = c.benchmark_group("tree");
        group.sample_size(10).sampling_mode(SamplingMode::Flat);
        group.warm_up_time(Duration::from_millis(200)).measurement_time(Duration::from_millis(500));
        group.throughput(Throughput::Elements(count as u64));
        builds(&mut group, &lights);
        refits(&mut group, &lights);
        group.throughput(Throughput::Elements(1));
        picks(&mut group, &lights);
        group.finish();
    }
}

fn builds(group: &mut BenchmarkGroup<WallTime>, lights: &[Light]) {
    let count = lights.len();
    built(lights);
    group.bench_function(BenchmarkId::new("build", count), |b| {
        b.iter_batched(
            || lights.to_vec(),
            |l| LightTree::new(l).expect("the lights are valid"),
            BatchSize::PerIteration,
        );
    });
    if count > MAX_BASELINE_LIGHTS {
        return;
    }
    let published = |lights| BinaryTree::new(Pbrt { is_opaque: true }, lights);
    // Points emit to all sides, so each has a probability above 0.
    let pmfs = published(lights.to_vec()).pmfs(&ShadingPoint::volume(Vec3::ZERO));
    let is_covered = |(light, pmf): (&Light, &f32)| !matches!(light.shape, Shape::Point { .. }) || *pmf > 0.0;
    assert!(lights.iter().zip(&pmfs).all(is_covered), "the published tree does not cover a point light");
    group.bench_function(BenchmarkId::new("build of pbrt's tree", count), |b| {
        b.iter_batched(|| lights.to_vec(), published, BatchSize::PerIteration);
    });
}

fn refits(group: &mut BenchmarkGroup<WallTime>, lights: &[Light]) {
    let count = lights.len();
    let mut rng = Rng(8);
    let mut tree = built(lights);
    let near = |light: &Light, rng: &mut Rng| moved_to(*light, light.cluster().mean + rng.position(0.5));
    let here: Vec<(u32, Light)> = (0..).zip(lights.iter().copied()).collect();
    let there: Vec<(u32, Light)> = here.iter().map(|(index, light)| (*index, near(light, &mut rng))).collect();
    let few = |lights: &[(u32, Light)]| lights.iter().copied().skip(7).step_by(100).collect();
    let both_few: [Vec<(u32, Light)>; 2] = [few(&here), few(&there)];
    let both = [here, there];

    for changes in [&both[1], &both_few[0], &both[0]] {
        tree.set_lights(changes).expect("the lights are valid");
        tree.refit();
        tree.check().expect("the tree is sound after a refit");
    }
    assert_eq!(tree.nodes(), built(lights).nodes());

    let name = |name: &str| BenchmarkId::new(name, count);
    group.bench_function(name("refit"), |b| time_refits(b, &mut tree, &both, LightTree::refit));
    group.bench_function(name("refit without attributes"), |b| {
        time_refits(b, &mut tree, &both, LightTree::refit_without_attributes);
    });
    tree.refit();
    let mut turn = 0;
    group.bench_function(name("set and refit"), |b| {
        b.iter(|| {
            turn ^= 1;
            tree.set_lights(&both[turn]).expect("the lights are valid");
            tree.refit();
        });
    });
    group.bench_function(name("refit of 1 %"), |b| time_refits(b, &mut tree, &both_few, LightTree::refit));
    let from = vec![1_u8; tree.nodes().len() * (size_of::<Node>() + FULL_PRECISION_BYTES)];
    let mut to = from.clone();
    group.bench_function(name("copy of a refit's bytes"), |b| {
        b.iter(|| {
            to.copy_from_slice(std::hint::black_box(&from));
            std::hint::black_box(&mut to);
        });
    });
}

/// Times refits alone. Sets one of two sets of changes before each, in turn: a refit without
/// changes has nothing to do.
fn time_refits(b: &mut Bencher, tree: &mut LightTree, both: &[Vec<(u32, Light)>; 2], refit: fn(&mut LightTree)) {
    let mut turn = 0;
    b.iter_custom(|rounds| {
        let round = |_| {
            turn ^= 1;
            tree.set_lights(&both[turn]).expect("the lights are valid");
            let start = Instant::now();
            refit(tree);
            start.elapsed()
        };
        (0..rounds).map(round).sum()
    });
}

fn picks(group: &mut BenchmarkGroup<WallTime>, lights: &[Light]) {
    let count = lights.len();
    let tree = built(lights);
    let mut rng = Rng(7);
    let shading_points: Vec<ShadingPoint> = (0..1024).map(|_| rng.shading_point(500.0)).collect();
    let numbers = |i: usize| [0.618_034, 0.754_878].map(|s: f64| (i as f64 * s).fract() as f32);
    let mut turns = (0..).map(|i| (shading_points[i % shading_points.len()], numbers(i)));
    for splits in [0, 6] {
        for (shading_point, u) in turns.by_ref().take(100) {
            if let Some((light, pmf)) = tree.pick(&shading_point, u, splits) {
                let expected = tree.pmf(&shading_point, light, splits);
                assert!((expected - pmf).abs() <= PMF_TOLERANCE * pmf, "{expected} {pmf}");
            }
        }
        group.bench_function(BenchmarkId::new(format!("pick, {splits} splits"), count), |b| {
            b.iter(|| turns.next().map(|(shading_point, u)| tree.pick(&shading_point, u, splits)));
        });
        group.bench_function(BenchmarkId::new(format!("pmf, {splits} splits"), count), |b| {
            b.iter(|| {
                turns.next().map(|(shading_point, u)| tree.pmf(&shading_point, (u[0] * count as f32) as u32, splits))
            });
        });
    }
}

criterion_group!(benches, trees);
criterion_main!(benches);
