//! Tests that all variants of the shaders that serve the effects of a world sample the same lights.

use glam::{DVec3, Mat3, Quat, Vec3};

use super::testing::{compute_pipeline, gpu, gpu_lights, random, random_vec, read, record_batch, small_sky};
use super::*;
use crate::instance::placement::Placement;
use crate::instance::portal::Portal;
use crate::keys::InstanceKey;
use crate::light::{DirectionalLight, Light};
use crate::plan::text;
use crate::policy::Policy;
use crate::profile::Profile;
use crate::profile::tests::of_degrees;
use crate::tree::LightTree;
use crate::world::LightWorld;
use testbed::common::batch::{SampleRecord, SampleRequest};

const SHADING_POINTS: u32 = 2048;

/// How many of [`SHADING_POINTS`] samples may name another light. Variants sum matrix products in
/// different orders, and a choice within rounding of the border between two lights may take the
/// other.
const MAX_MISMATCHES: usize = 2;

/// Relative difference of probabilities and radiances, which are products of some twenty terms.
const ROUNDING: f32 = 1.0e-5;

fn light(i: u32, effects: Effects) -> Light {
    let at = 6.0 * random_vec(i, 0);
    let direction = random_vec(i, 3).normalize_or(Vec3::Y);
    let emission = Vec3::splat(1.0 + 100.0 * random(i, 6));
    let side = direction.any_orthonormal_vector();
    let (has_cones, has_areas) = (effects.contains(Effects::CONES), effects.contains(Effects::AREAS));
    let light = match i % 6 {
        0 if effects.contains(Effects::PROFILES) => Light::profile(at, turn_of(i), even_lamp(), emission * 0.002),
        1 if has_cones => Light::spot(at, direction, 0.01, 0.1 + 1.2 * random(i, 7), emission),
        2 if has_areas && has_cones => Light::rectangle(at, direction, side * 0.3, emission),
        3 if has_areas && has_cones => Light::triangle([at, at + direction, at + side], emission),
        4 if has_areas => Light::triangle([at, at + direction, at + side], emission).two_sided(),
        5 if has_areas => Light::sphere(at, 0.1 + random(i, 7), emission),
        _ => Light::point(at, emission),
    };
    let has_range = effects.contains(Effects::RANGES) && i.is_multiple_of(4);
    if has_range { light.with_range(3.0 + 20.0 * random(i, 8)) } else { light }
}

/// A profile without dark directions, in which rounding would decide.
fn even_lamp() -> Profile {
    let candela: Vec<f32> = (0..16).map(|i| 300.0 + 700.0 * random(i % 12, 60)).collect();
    of_degrees(&[0.0, 40.0, 75.0, 180.0], &[0.0, 130.0, 250.0, 360.0], &candela)
}

fn turn_of(i: u32) -> Quat {
    Quat::from_axis_angle(random_vec(i, 20).normalize_or(Vec3::X), 6.0 * random(i, 21))
}

fn placement(i: u32, effects: Effects) -> Placement {
    let turn = Mat3::from_quat(turn_of(i));
    let scale = match i % 4 {
        _ if !effects.contains(Effects::NON_RIGID) => Vec3::ONE,
        0 => Vec3::ONE,
        1 => Vec3::splat(0.3 + 2.0 * random(i, 22)),
        2 => Vec3::new(-1.0, 1.0, 1.0),
        _ => Vec3::new(0.5, 2.0, 1.0),
    };
    Placement { linear: turn * Mat3::from_diagonal(scale), translation: (30.0 * random_vec(i, 23)).as_dvec3() }
}

/// Lights of a tree: many for an opened tree; the instances overlap.
const LIGHTS: u32 = 130;

/// Gives an instance what these effects allow.
fn adorn(world: &mut LightWorld, instance: InstanceKey, i: u32, effects: Effects) {
    if effects.contains(Effects::FACTORS) && i.is_multiple_of(2) {
        world.set_appearance(instance, |a| a.factor = Vec3::new(0.2, 3.0 * random(i, 30), 1.0)).unwrap();
    }
    // The shading points of these tests have all bits.
    if effects.contains(Effects::MASKS) && i != 1 {
        world.set_appearance(instance, |a| a.mask = if i == 3 { 0 } else { 0x80 }).unwrap();
    }
}

/// 12,000 km from zero.
const ORIGIN: DVec3 = DVec3::new(9_766.0 * 1024.0, -8_000.0 * 1024.0, 7.0 * 1024.0);

/// A world with exactly these effects.
fn world_of(effects: Effects) -> LightWorld {
    let mut world = LightWorld::new();
    world.set_solid_angle_sampling(effects.contains(Effects::SOLID_ANGLES));
    world.set_glossy_sampling(effects.contains(Effects::GLOSSY));
    world.set_segment_sampling(effects.contains(Effects::SEGMENTS));
    world.set_origin_near(ORIGIN).unwrap();
    let origin = world.origin();
    for tree in 0..4 {
        let key =
            world.add_tree(LightTree::new((0..LIGHTS).map(|i| light(200 * tree + i, effects)).collect()).unwrap());
        for i in 0..5 {
            let here = placement(10 * tree + i, effects);
            let there = Placement { translation: origin + here.translation, ..here };
            let instance = world.add_instance(key, there, Policy::default()).unwrap();
            adorn(&mut world, instance, i, effects);
        }
    }
    if effects.contains(Effects::DIRECTIONAL) {
        let sun = DirectionalLight { direction: Vec3::new(0.3, -1.0, 0.2).normalize(), illuminance: Vec3::splat(0.3) };
        world.add_directional(sun).unwrap();
    }
    if effects.contains(Effects::SKY) {
        world.set_sky(small_sky());
    }
    if effects.contains(Effects::PORTALS) {
        let (center, room) = (
            DVec3::new(0.0, 10.0, 0.0),
            Placement { linear: Mat3::from_diagonal(Vec3::splat(10.0)), ..Placement::IDENTITY },
        );
        world.set_portals(&[Portal { center, half_u: 8.0 * Vec3::X, half_v: 8.0 * Vec3::Z, room }]).unwrap();
    }
    assert_eq!(world.effects() | Effects::MOVING, effects | Effects::MOVING);
    world
}

fn requests() -> Vec<SampleRequest> {
    let request = |i| SampleRequest {
        position: (40.0 * random_vec(i, 40)).to_array(),
        normal: if i.is_multiple_of(5) { [0.0; 3] } else { random_vec(i, 43).normalize_or(Vec3::Y).to_array() },
        u: [46, 47, 48, 49].map(|salt| random(i, salt)),
        ..SampleRequest::default()
    };
    (0..SHADING_POINTS).map(request).collect()
}

/// The samples of the pipeline for these effects.
fn sample(lights: &mut GpuLights, variant: Effects) -> Vec<SampleRecord> {
    let (encoder, output) = record(lights, variant);
    let (device, queue) = gpu();
    queue.submit([encoder.finish()]);
    read(&device, &queue, &output)
}

/// The commands that build the top level and sample, and the buffer for the samples.
fn record(lights: &mut GpuLights, variant: Effects) -> (wgpu::CommandEncoder, wgpu::Buffer) {
    record_batch(lights, &requests(), variant)
}

fn upload(world: &LightWorld) -> GpuLights {
    let mut lights = gpu_lights();
    lights.upload(world).unwrap();
    lights
}

/// Asserts that samples agree to float rounding, except for [`MAX_MISMATCHES`].
fn assert_alike(ours: &[SampleRecord], twin: &[SampleRecord], what: &str) {
    let close = |a: f32, b: f32| (a - b).abs() <= ROUNDING * a.abs().max(b.abs());
    // The inverse of a density is a solid angle. Where a surface is seen at a grazing angle, it is a small
    // difference, with the rounding of a square metre at that distance.
    let is_as_dense = |a: &SampleRecord, b: &SampleRecord| {
        let rounding = 2.0 * f32::EPSILON / (a.dist * a.dist).max(f32::MIN_POSITIVE);
        close(a.pdf, b.pdf) || (a.pdf.recip() - b.pdf.recip()).abs() <= rounding
    };
    let mut mismatches = 0;
    for (a, b) in ours.iter().zip(twin) {
        if (a.instance, a.light, a.pmf > 0.0) != (b.instance, b.light, b.pmf > 0.0) {
            mismatches += 1;
            continue;
        }
        let (radiance, other) = (Vec3::from(a.radiance), Vec3::from(b.radiance));
        assert!(close(a.pmf, b.pmf) && is_as_dense(a, b) && close(a.dist, b.dist), "{what}: {a:?} {b:?}");
        assert!((radiance - other).length() <= ROUNDING * other.length(), "{what}: {a:?} {b:?}");
        assert!((Vec3::from(a.direction) - Vec3::from(b.direction)).length() <= ROUNDING, "{what}: {a:?} {b:?}");
        assert_eq!(a.is_delta, b.is_delta, "{what}");
    }
    let lit = twin.iter().filter(|record| record.pmf > 0.0).count();
    assert!(mismatches <= MAX_MISMATCHES && lit > 500, "{what}: {mismatches} differ, {lit} are lit");
}

const EFFECTS: [Effects; 10] = [
    Effects::CONES,
    Effects::RANGES,
    Effects::AREAS,
    Effects::DIRECTIONAL,
    Effects::NON_RIGID,
    Effects::FACTORS,
    Effects::MASKS,
    Effects::SKY,
    Effects::PROFILES,
    Effects::PORTALS,
];

#[test]
fn a_world_that_lacks_an_effect_is_sampled_alike_by_the_variant_without_it() {
    let all = Effects::all();
    for absent in EFFECTS.into_iter().chain([all - Effects::AREAS, all]) {
        let effects = match all - absent {
            // Patches of the sky count as surfaces.
            rest if !rest.contains(Effects::AREAS) => rest - Effects::SKY,
            // And a profile is a cone of directions.
            rest if !rest.contains(Effects::CONES) => rest - Effects::PROFILES,
            rest => rest,
        };
        let world = world_of(effects);
        let mut lights = upload(&world);
        let twin = sample(&mut upload(&world), all);
        for variant in [all, all - absent, effects] {
            let records = sample(&mut lights, variant);
            assert_alike(&records, &twin, &format!("{variant:?} of a world without {absent:?}"));
        }
    }
}

#[test]
fn the_variant_that_counts_nodes_counts_those_that_a_sample_reads() {
    let (device, queue) = gpu();
    let mut world = LightWorld::new();
    let lamp = world.add_tree(LightTree::new(vec![Light::point(Vec3::Y, Vec3::ONE)]).unwrap());
    world.add_instance(lamp, Placement::at(DVec3::X), Policy::default()).unwrap();
    let mut lights = upload(&world);
    let text = text::wgsl_counting(0, Effects::empty())
        + "@group(1) @binding(0) var<storage, read_write> counts: array<u32>;
        @compute @workgroup_size(1) fn count() {
            let s = light_sample(light_surface_point(vec3(0.0), vec3(0.0)), vec4(0.5));
            counts[0] = select(0u, light_nodes_read, s.pmf > 0.0);
        }";
    let own = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: None,
        entries: &[bindings::storage_entry(0, false)],
    });
    let pipeline = compute_pipeline(text, "count", [lights.bind_group_layout(), &own]);
    let output = device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: 4,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    });
    // The root of the top level, then the root of the tree.
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    lights.build_top(&mut encoder);
    let group = bind(&device, "counts", &own, &[&output]);
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, lights.bind_group(), &[]);
        pass.set_bind_group(1, &group, &[]);
        pass.dispatch_workgroups(1, 1, 1);
    }
    queue.submit([encoder.finish()]);
    assert_eq!(read::<u32>(&device, &queue, &output), [2]);
}
