//! The cost of a map of the sky, of a change of a part of it, and of picks and samples among spots, profiles, and
//! points with and without a sky.
//!
//! Run it with `cargo bench --bench sky`. As a test (`cargo test --benches`) every case runs once, with a small map.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use girandole::glam::{Mat3, Quat, Vec3};
use girandole::{Light, LightTree, LightWorld, Placement, Policy, Profile, ShadingPoint, Sky};

use testbed::testing::support::Rng;

/// Columns and rows of the map.
fn size() -> [usize; 2] {
    if std::env::args().any(|a| a == "--bench") { [4096, 2048] } else { [64, 32] }
}

/// A map with clouds.
fn pixels([width, height]: [usize; 2]) -> Vec<Vec3> {
    let mut rng = Rng(45);
    (0..width * height).map(|_| Vec3::new(0.3, 0.6, 1.0) * rng.between(100.0, 4000.0)).collect()
}

fn maps(c: &mut Criterion) {
    let size = size();
    let pixels = pixels(size);
    let name = |what: &str| format!("{what} of {} x {}", size[0], size[1]);
    c.bench_function(&name("a map"), |b| {
        b.iter(|| Sky::equirectangular(size[0], black_box(&pixels)).expect("a sound map"));
    });
    let mut world = LightWorld::new();
    world.set_sky(Sky::equirectangular(size[0], &pixels).expect("a sound map"));
    let mut column = 0;
    c.bench_function(&name("a part of 32 x 32"), |b| {
        b.iter(|| {
            column = (column + 5) % 32;
            world.set_sky_part([column, 0], [32, 32], black_box(&pixels[..1024])).expect("a part of the map");
        });
    });
}

fn samples(c: &mut Criterion) {
    let mut rng = Rng(46);
    let mut world_of = |lamp: &dyn Fn(Vec3) -> Light| {
        let lamps = (0..2000).map(|_| lamp(rng.position(100.0))).collect();
        let mut world = LightWorld::new();
        let tree = world.add_tree(LightTree::new(lamps).expect("valid lamps"));
        world.add_instance(tree, Placement::IDENTITY, Policy::Static).expect("a valid placement");
        world
    };
    let down = Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2);
    let spots = world_of(&|at| Light::spot(at, Vec3::NEG_Y, 0.0, 1.5, Vec3::splat(50.0)));
    let vertical: Vec<f32> = (0..37).map(|i| 2.5 * i as f32).collect();
    let planes: Vec<f32> = (0..=24).map(|i| 15.0 * i as f32).collect();
    let candela: Vec<f32> = (0..37 * 25).map(|i| 50.0 + (i % 7) as f32).collect();
    let [vertical, planes] =
        [vertical, planes].map(|degrees| degrees.iter().map(|d| d.to_radians()).collect::<Vec<f32>>());
    let axes = Mat3::from_cols(Vec3::X, Vec3::Y, Vec3::NEG_Z);
    let profile = Profile::new(&vertical, &planes, &candela, axes).expect("a sound table");
    let profiles = world_of(&|at| Light::profile(at, down, profile, Vec3::ONE));
    let mut world = world_of(&|at| Light::point(at, Vec3::splat(50.0)));
    let mut time = |what: &str, world: &LightWorld| {
        let mut rng = Rng(47);
        let mut at = move || {
            let at = ShadingPoint::surface(rng.position(100.0) * Vec3::new(1.0, 0.0, 1.0), Vec3::Y);
            (at, [rng.unit(), rng.unit(), rng.unit(), rng.unit()])
        };
        c.bench_function(&format!("a pick among {what}"), |b| {
            b.iter(|| {
                let (at, u) = at();
                world.sampler().pick(&at, [u[0], u[1]])
            });
        });
        c.bench_function(&format!("a sample among {what}"), |b| {
            b.iter(|| {
                let (at, u) = at();
                world.sampler().sample(&at, u)
            });
        });
    };
    time("2,000 spots", &spots);
    time("2,000 profiles of 37 x 24", &profiles);
    time("2,000 points", &world);
    let size = size();
    world.set_sky(Sky::equirectangular(size[0], &pixels(size)).expect("a sound map"));
    time("2,000 points and a sky", &world);
}

criterion_group!(benches, maps, samples);
criterion_main!(benches);
