use glam::{DVec3, Quat, Vec3};

use super::*;
use crate::light::{Light, luminance};
use crate::placement::Placement;
use crate::policy::Policy;
use crate::sample::{LightId, LightSampler};
use crate::shading_point::ShadingPoint;
use crate::tree::{Item, shape};
use crate::world::LightWorld;

/// A number in [0, 1) for each index and purpose: SplitMix64's output function.
fn random(index: usize, salt: u64) -> f32 {
    let x = (index as u64 * 64 + salt + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((x ^ (x >> 31)) >> 40) as f32 / (1u32 << 24) as f32
}

/// Lamps, shop windows and strings of lights along the streets of a square city, instance by instance.
fn city(instances: usize) -> LightWorld {
    let mut world = LightWorld::new();
    let mut add = |lights: Vec<Light>| world.add_tree(lights).expect("valid lights");
    let head = Light::spot(Vec3::Y * 6.0, Vec3::NEG_Y, 0.6, 1.2, Vec3::splat(900.0));
    let trees = [
        add(vec![head]),
        add((0..12).map(|i| Light::point(Vec3::new(i as f32, 4.0 + random(i, 0), 0.0), Vec3::splat(20.0))).collect()),
        add((0..4)
            .map(|i| Light::rectangle(Vec3::new(3.0 * i as f32, 2.0, 0.0), Vec3::X, Vec3::Y, Vec3::splat(60.0)))
            .collect()),
        add((0..40)
            .map(|i| {
                Light::point(
                    Vec3::new(8.0 * random(i, 1), 20.0 * random(i, 2), 8.0 * random(i, 3)),
                    Vec3::splat(5.0 + 50.0 * random(i, 4)),
                )
            })
            .collect()),
    ];
    let size = 12.0 * (instances as f32).sqrt();
    for i in 0..instances {
        // Along streets every 60 m, in either direction.
        let street = (random(i, 10) * size / 60.0).floor() * 60.0 + 4.0 * random(i, 11);
        let along = random(i, 12) * size;
        let (x, z) = if i % 2 == 0 { (street, along) } else { (along, street) };
        let linear = glam::Mat3::from_quat(Quat::from_rotation_y(6.3 * random(i, 13)));
        let placement = Placement { linear, translation: DVec3::new(x.into(), 0.0, z.into()) };
        world.add_instance(trees[(random(i, 14) * 4.0) as usize], placement, Policy::Static).expect("valid");
    }
    world
}

/// The top level that a full sweep of bins makes of the same instances, as bottom trees are built.
fn by_cost(instances: &[Cluster]) -> TopLevel {
    let lit: Vec<u32> = (0..instances.len() as u32).filter(|slot| instances[*slot as usize].flux > 0.0).collect();
    let mut items: Vec<Item> = lit.iter().zip(0..).map(|(slot, i)| Item::new(&instances[*slot as usize], i)).collect();
    let shapes = shape(&mut items);
    let mut top = TopLevel { nodes: vec![Node::EMPTY; shapes.len()], places: vec![0; instances.len()] };
    let mut made: Vec<Option<Unit>> = vec![None; shapes.len()];
    for (index, shape) in shapes.iter().enumerate().rev() {
        let units: Vec<Unit> = shape.targets[..shape.count as usize]
            .iter()
            .map(|target| match target & LEAF {
                0 => made[*target as usize].expect("children come after their parents"),
                _ => {
                    let slot = lit[(target & !LEAF) as usize];
                    Unit { cluster: instances[slot as usize], target: LEAF | slot }
                }
            })
            .collect();
        made[index] = Some(top.add(&units, Some(index as u32)));
    }
    top
}

/// The exact relative standard deviation of one sample, by shading points (docs/benchmarks.md), in ascending order.
fn sigmas(sampler: &LightSampler<'_>, shading_points: &[ShadingPoint]) -> Vec<f64> {
    let lights: Vec<LightId> = sampler.all_lights().collect();
    let mut sigmas: Vec<f64> = shading_points
        .iter()
        .map(|shading_point| {
            let (mut sum, mut squares) = (0.0, 0.0);
            for light in &lights {
                let Some(incident) = sampler.sample_light(shading_point, *light, [0.5, 0.5]) else { continue };
                let lux = f64::from(
                    luminance(incident.radiance) * incident.direction.dot(shading_point.normal) / incident.pdf,
                );
                sum += lux;
                squares += lux * lux / f64::from(sampler.pmf(shading_point, *light));
            }
            (squares / (sum * sum) - 1.0).max(0.0).sqrt()
        })
        .collect();
    sigmas.sort_by(f64::total_cmp);
    sigmas
}

#[test]
fn rounds_of_pieces_are_hardly_noisier_than_a_tree_by_cost_over_all_instances() {
    // So many that a round of pieces and another come before the upper part.
    let world = city(6000);
    let instances = world.clusters();
    let (ours, best) = (TopLevel::build(&instances), by_cost(&instances));
    let size = 12.0 * 6000.0_f32.sqrt();
    let place = |i: usize| Vec3::new(random(i, 20) * size, 0.0, random(i, 21) * size);
    let shading_points: Vec<ShadingPoint> = (0..40).map(|i| ShadingPoint::surface(place(i), Vec3::Y)).collect();
    let [ours, best] = [&ours, &best].map(|top| sigmas(&world.sampler().with_top(top), &shading_points));
    let mean = |sigmas: &[f64]| sigmas.iter().sum::<f64>() / sigmas.len() as f64;
    let (means, medians) = (mean(&ours) / mean(&best), ours[20] / best[20]);
    assert!(mean(&best) > 0.1, "noise to compare");
    // Measured: 1.09 and 1.07. Pieces of 256 units are beyond the first.
    assert!(means < 1.2 && medians < 1.1, "{means} {medians}");
}
