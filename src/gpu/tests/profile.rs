//! Photometric profiles on the GPU: their tables are sent once, and samples are those of the CPU.

use glam::{DVec3, Mat3, Quat, Vec3};

use crate::effects::Effects;
use crate::gpu::GpuLights;
use crate::gpu::testing::{gpu, gpu_lights, random, random_vec, read, record_batch, small_sky};
use crate::instance::placement::Placement;
use crate::keys::LightId;
use crate::light::Light;
use crate::policy::Policy;
use crate::profile::Profile;
use crate::profile::tests::{of_degrees, street_lamp};
use crate::shading::shading_point::ShadingPoint;
use crate::tree::LightTree;
use crate::world::LightWorld;
use testbed::common::batch::{SampleRecord, SampleRequest};

const COUNT: u32 = 4096;

/// Adds a tree of lamps with a profile, and three instances of it: turned, stretched and mirrored.
fn add_lamps(world: &mut LightWorld, profile: Profile, seed: u32) {
    let lamp = |i: u32| {
        let turn = Quat::from_axis_angle(random_vec(i, seed).normalize_or(Vec3::X), 6.0 * random(i, seed + 3));
        Light::profile(4.0 * random_vec(i, seed + 4), turn, profile, Vec3::new(1.0, 0.9, 0.7))
    };
    let tree = world.add_tree(LightTree::new((0..40).map(lamp).collect()).expect("valid lamps"));
    for (i, scale) in [Vec3::ONE, Vec3::new(0.5, 2.0, 1.0), Vec3::new(1.0, -1.0, 1.0)].into_iter().enumerate() {
        let linear = Mat3::from_rotation_y(i as f32) * Mat3::from_diagonal(scale);
        let translation = DVec3::new(12.0 * i as f64, 3.0, f64::from(seed) * 0.1);
        world.add_instance(tree, Placement { linear, translation }, Policy::Static).expect("a placement");
    }
}

fn requests() -> Vec<SampleRequest> {
    let request = |i| SampleRequest {
        position: (Vec3::new(40.0, 10.0, 40.0) * random_vec(i, 40)).to_array(),
        normal: if i.is_multiple_of(4) { [0.0; 3] } else { random_vec(i, 43).normalize_or(Vec3::Y).to_array() },
        u: [46, 47, 48, 49].map(|salt| random(i, salt)),
        ..SampleRequest::default()
    };
    (0..COUNT).map(request).collect()
}

fn samples(lights: &mut GpuLights) -> Vec<SampleRecord> {
    let (device, queue) = gpu();
    let (encoder, output) = record_batch(lights, &requests(), Effects::all());
    queue.submit([encoder.finish()]);
    read(&device, &queue, &output)
}

/// Asserts that samples are those of the CPU, but for a few choices within rounding.
fn compare(world: &LightWorld, lights: &mut GpuLights, what: &str) {
    let (mut others, mut lit) = (0, 0);
    for (request, ours) in requests().iter().zip(samples(lights)) {
        let at = ShadingPoint::surface(request.position.into(), request.normal.into());
        let Some(theirs) = world.sampler().from_roots().sample(&at, request.u) else {
            others += usize::from(ours.pmf > 0.0);
            continue;
        };
        let LightId::Local { instance, light } = theirs.light else { panic!("there is no sun") };
        if [ours.instance, ours.light] != [world.slot(instance).expect("an instance"), light] || ours.pmf <= 0.0 {
            others += 1;
            continue;
        }
        lit += 1;
        assert!((ours.pmf / theirs.pmf - 1.0).abs() < 2.0e-3, "{what}: {ours:?} {theirs:?}");
        let (radiance, other) = (Vec3::from(ours.radiance), theirs.incident.radiance);
        // Angles round by some 1e-6, and the steepest cell has 900 candela in a degree.
        let rounding = 5.0e-6 * 900.0 * 57.3 / (theirs.incident.dist * theirs.incident.dist);
        assert!((radiance - other).length() <= 1.0e-5 * other.length() + rounding, "{what}: {ours:?} {theirs:?}");
    }
    assert!(others <= 12 && lit > COUNT / 3, "{what}: {others} others, {lit} lit");
}

#[test]
fn the_gpu_samples_profiles_as_the_cpu_does_and_gets_each_table_once() {
    let mut world = LightWorld::new();
    add_lamps(&mut world, street_lamp(100), 1);
    let mut lights = gpu_lights();
    lights.upload(&world).expect("room enough");
    assert!(lights.effects().contains(Effects::PROFILES | Effects::CONES));
    compare(&world, &mut lights, "one profile");
    // A tree with a known profile sends lamps only.
    let known = street_lamp(100);
    add_lamps(&mut world, known, 200);
    let with_known = lights.upload(&world).expect("room enough").bytes;
    // A table of its own is more than the records of a tree of 40 lamps.
    let vertical: Vec<f32> = (0..181).map(|i| i as f32).collect();
    let horizontal: Vec<f32> = (0..=72).map(|i| 5.0 * i as f32).collect();
    let candela: Vec<f32> = (0..181 * 73).map(|i| 100.0 + 900.0 * random(i % (181 * 72), 70)).collect();
    let large = of_degrees(&vertical, &horizontal, &candela);
    add_lamps(&mut world, large, 300);
    let with_new = lights.upload(&world).expect("room enough").bytes;
    // The first tree may grow the buffer of the tables, which then gets those that it had.
    assert!(with_known < 40_000 && with_new > 4 * 181 * 72, "{with_known} {with_new}");
    compare(&world, &mut lights, "two profiles");
    // The sky lies behind the tables, and begins elsewhere when they grow.
    world.set_sky(small_sky());
    lights.upload(&world).expect("room enough");
    compare(&world, &mut lights, "with a sky");
}
