//! The noise in a town does not depend on where one of its lamps is: somewhere among the others, at a
//! border, or anywhere up to a million kilometres away.

use girandole::glam::{DVec3, Vec3, vec3};
use girandole::{FrameBudget, Light, LightTree, LightWorld, Placement, Policy, ShadingPoint};
use testbed::measuring::lights::{carried, reflections};
use testbed::measuring::samplers;
use testbed::testing::support::Rng;

/// Lamps in a square kilometre.
const LAMPS: usize = 1200;
/// Shading points among the lamps, and as many within three metres of the borders.
const SHADING_POINTS: usize = 40;
/// The most that the mean sigma may be, relative to its mean while the lamp is in the town or at most
/// one side of the town away. 0.89 to 1.22 was measured with a sample of 512 positions: the
/// lamp moves single cuts.
const OF_NEAR: f64 = 1.3;
/// The same anywhere. Up to 2.02 was measured, and 1.8 for one tree: the lamp takes a child of the root.
const OF_FAR: f64 = 2.2;

/// A point of a box around the origin with these half edges.
fn in_box(rng: &mut Rng, half: Vec3) -> Vec3 {
    half * vec3(rng.between(-1.0, 1.0), rng.between(-1.0, 1.0), rng.between(-1.0, 1.0))
}

fn shading_points(rng: &mut Rng) -> Vec<ShadingPoint> {
    let border = |rng: &mut Rng, i: usize| {
        let along = in_box(rng, vec3(500.0, 0.0, 3.0)) + Vec3::Z * 497.0;
        [along, -along, vec3(along.z, 0.0, along.x), vec3(-along.z, 0.0, along.x)][i % 4]
    };
    let points = (0..2 * SHADING_POINTS).map(|i| match i < SHADING_POINTS {
        true => in_box(rng, vec3(500.0, 0.0, 500.0)),
        false => border(rng, i),
    });
    points.map(|at| ShadingPoint::surface(at, Vec3::Y)).collect()
}

/// Mean sigma of one sample in two levels, of the shading points.
fn sigma(world: &LightWorld, shading_points: &[ShadingPoint]) -> f64 {
    let lights = carried(world);
    let lux: Vec<Vec<f32>> = shading_points.iter().map(|at| reflections(&lights, at)).collect();
    samplers::noise(&samplers::two_level(world), shading_points, &lux).0.mean
}

#[test]
fn a_lamp_that_leaves_a_town_does_not_make_the_town_noisier() {
    let mut rng = Rng(31);
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(vec![Light::point(Vec3::ZERO, Vec3::splat(100.0))]).expect("valid"));
    for _ in 0..LAMPS {
        let at = in_box(&mut rng, vec3(500.0, 1.0, 500.0)) + Vec3::Y * 5.0;
        world.add_instance(tree, Placement::at(at.as_dvec3()), Policy::Static).expect("valid");
    }
    let lamp = world.add_instance(tree, Placement::at(DVec3::ZERO), Policy::Static).expect("valid");
    let shading_points = shading_points(&mut rng);
    // Around the border, where the lamp crosses powers of two of the size of the town, and far away.
    let near = (0..=7).map(|i| 500.0 + 10.0 * f64::from(i * i));
    let far = (0..=4).map(|i| 1.0e9 * 0.03_f64.powi(4 - i));
    let distances: Vec<f64> = [0.0].into_iter().chain(near).chain(far).collect();
    let mut sigmas = Vec::new();
    for direction in [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::new(1.0, 0.0, 1.0), DVec3::new(-0.6, 0.5, -0.6)] {
        for distance in &distances {
            // Along a diagonal it leaves the town after the same distance along each axis.
            let at = (direction * *distance).clamp_length_max(1.0e9);
            world.move_instance(lamp, Placement::at(at)).expect("valid");
            world.update(FrameBudget::UNLIMITED);
            sigmas.push((*distance < 1000.0, sigma(&world, &shading_points), at));
        }
    }
    let near: Vec<f64> = sigmas.iter().filter(|(is_near, ..)| *is_near).map(|(_, sigma, _)| *sigma).collect();
    let mean = near.iter().sum::<f64>() / near.len() as f64;
    for (is_near, sigma, at) in sigmas {
        let most = if is_near { OF_NEAR } else { OF_FAR };
        assert!(sigma < most * mean, "{sigma} at {at}, {mean} near the town");
    }
}
