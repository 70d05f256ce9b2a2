//! Probabilities do not depend on where a scene lies, how it is turned, in which unit it is
//! measured and how bright it is as a whole.

use girandole::glam::{Mat3, Quat, Vec3};
use girandole::{DirectionalLight, Light, LightTree, LightWorld, Placement, Policy, ShadingPoint, Shape};

use testbed::testing::support::{Rng, SPLITS, all_pmfs, place_tree};

/// What a world is made of.
struct Scene {
    trees: Vec<Vec<Light>>,
    /// Each with the number of its tree.
    instances: Vec<(usize, Placement)>,
    moon: DirectionalLight,
}

impl Scene {
    /// Instances under all kinds of transforms, within 20 m.
    fn new(rng: &mut Rng) -> Self {
        // Bright enough that no flux is below the least one after the scene is dimmed.
        let light = |rng: &mut Rng| {
            let light = rng.light(2.0);
            light.with_emission(light.emission + 1.0)
        };
        let trees = (0..4).map(|_| (0..40).map(|_| light(rng)).collect()).collect();
        let instances = (0..24).map(|i| (i % 4, rng.affine(20.0).into())).collect();
        Self { trees, instances, moon: DirectionalLight { direction: rng.direction(), illuminance: Vec3::ONE } }
    }

    fn world(&self) -> LightWorld {
        let mut world = LightWorld::new();
        let trees: Vec<_> =
            self.trees.iter().map(|lights| world.add_tree(LightTree::new(lights.clone()).expect("valid"))).collect();
        for (tree, placement) in &self.instances {
            world.add_instance(trees[*tree], *placement, Policy::Static).expect("valid");
        }
        world.add_directional(self.moon).expect("valid");
        world
    }

    /// The same scene with lights and placements mapped.
    fn mapped(&self, light: impl Fn(&Light) -> Light, placement: impl Fn(&Placement) -> Placement) -> Self {
        Self {
            trees: self.trees.iter().map(|lights| lights.iter().map(&light).collect()).collect(),
            instances: self.instances.iter().map(|(tree, place)| (*tree, placement(place))).collect(),
            moon: self.moon,
        }
    }
}

/// A light in another unit of length, which sends the same light to the same place.
fn measured(light: &Light, unit: f32) -> Light {
    let mut scaled = light.with_range(light.range * unit);
    match &mut scaled.shape {
        Shape::Point { position } | Shape::Spot { position, .. } => {
            *position *= unit;
            scaled.emission *= unit * unit;
        }
        Shape::Rectangle { center, half_u, half_v, .. } => {
            (*center, *half_u, *half_v) = (*center * unit, *half_u * unit, *half_v * unit);
        }
        Shape::Triangle { vertices, .. } => *vertices = vertices.map(|vertex| vertex * unit),
        Shape::Sphere { center, radius } => (*center, *radius) = (*center * unit, *radius * unit),
        &mut _ => unreachable!("this version has no others"),
    }
    scaled
}

fn dimmed(light: &Light, factor: f32) -> Light {
    light.with_emission(light.emission * factor)
}

/// The bits of the probabilities of all lights.
fn bits(world: &LightWorld, at: &ShadingPoint, splits: usize) -> Vec<u32> {
    all_pmfs(&world.sampler().with_splits(splits), at).into_iter().map(|(_, pmf)| pmf.to_bits()).collect()
}

#[test]
fn worlds_in_units_that_are_powers_of_two_have_the_same_bits() {
    let mut rng = Rng(470);
    let scene = Scene::new(&mut rng);
    let world = scene.world();
    for power in [-20, -10, -1, 1, 10, 20] {
        let unit = 2.0_f32.powi(power);
        let other = scene
            .mapped(
                |light| measured(light, unit),
                |place| Placement { translation: place.translation * f64::from(unit), ..*place },
            )
            .world();
        for round in 0..60 {
            let at = rng.shading_point(25.0);
            let scaled = ShadingPoint::surface(at.position * unit, at.normal);
            let splits = SPLITS[round % 2];
            assert!(bits(&world, &at, splits) == bits(&other, &scaled, splits), "2^{power}: {at:?}");
        }
    }
}

#[test]
fn worlds_that_are_dimmed_by_powers_of_two_have_the_same_bits() {
    let mut rng = Rng(471);
    let scene = Scene::new(&mut rng);
    let world = scene.world();
    // 2^-40 and 2^40 are 1e-12 and 1e12.
    for power in [-40, -20, -1, 1, 20, 38] {
        let factor = 2.0_f32.powi(power);
        let mut other = scene.mapped(|light| dimmed(light, factor), |place| *place);
        other.moon.illuminance *= factor;
        let other = other.world();
        for round in 0..60 {
            let (at, splits) = (rng.shading_point(25.0), SPLITS[round % 2]);
            assert!(bits(&world, &at, splits) == bits(&other, &at, splits), "2^{power}: {at:?}");
        }
    }
}

/// The probability with which two choices differ at best: half of the sum of all differences.
fn difference(a: &[f32], b: &[f32]) -> f64 {
    0.5 * a.iter().zip(b).map(|(a, b)| f64::from((a - b).abs())).sum::<f64>()
}

/// Probabilities of the lights of a world.
fn pmfs(world: &LightWorld, at: &ShadingPoint, splits: usize) -> Vec<f32> {
    all_pmfs(&world.sampler().with_splits(splits), at).into_iter().map(|(_, pmf)| pmf).collect()
}

/// A world with one instance.
fn one(lights: Vec<Light>, placement: Placement) -> LightWorld {
    let mut world = LightWorld::new();
    place_tree(&mut world, lights, placement, Policy::Static);
    world
}

/// The differences in ascending order, as the one at a share of them.
fn sorted(mut differences: Vec<f64>) -> impl Fn(f64) -> f64 {
    differences.sort_by(f64::total_cmp);
    move |share| differences[(share * (differences.len() - 1) as f64) as usize]
}

#[test]
fn moving_turning_and_scaling_an_instance_changes_probabilities_by_rounding_only() {
    let mut rng = Rng(472);
    // Too few lights for sides, whose boxes in the world change with the turn. In scaled instances
    // lights of one kind, since the means of a tree weigh points and surfaces as in its own space.
    for kind in 0..3 {
        let mut differences = [Vec::new(), Vec::new()];
        for _ in 0..100 {
            let all = rng.lights(400, 5.0).into_iter();
            let lights: Vec<Light> = match kind {
                0 => all.take(15).collect(),
                1 => all.filter(|light| light.area().is_some()).take(15).collect(),
                _ => all.filter(|light| light.area().is_none()).take(15).collect(),
            };
            let turn = Mat3::from_quat(Quat::from_axis_angle(rng.direction(), rng.between(0.0, 6.0)));
            let power = rng.between(-6.0, 6.0);
            // By a power of two where intensities change, so that they are packed as before.
            let scale = [1.0, 10.0_f32.powf(power), (3.3 * power).round().exp2()][kind];
            // Points keep their intensity under a scale, and all keep their ranges.
            let factor = if kind == 2 { scale * scale } else { 1.0 };
            let sent = |light: &Light| dimmed(light, factor).with_range(light.range * scale);
            let plain = one(lights.clone(), Placement::IDENTITY);
            let placement = Placement { linear: turn * scale, translation: (rng.position(20.0) * scale).as_dvec3() };
            let other = one(lights.iter().map(sent).collect(), placement);
            for _ in 0..20 {
                let at = rng.shading_point(8.0);
                let moved = placement.linear.as_dmat3() * at.position.as_dvec3() + placement.translation;
                let moved = ShadingPoint::surface(moved.as_vec3(), turn * at.normal);
                for (splits, found) in SPLITS.into_iter().zip(&mut differences) {
                    found.push(difference(&pmfs(&plain, &at, splits), &pmfs(&other, &moved, splits)));
                }
            }
        }
        for found in differences {
            let found = sorted(found);
            // The margins of bounds may turn the verdict about a light that sends next to nothing.
            assert!(found(0.99) < 2.0e-6 && found(1.0) < 2.0e-5, "{kind}: {:e} {:e}", found(0.99), found(1.0));
        }
    }
}

#[test]
fn units_and_brightness_that_are_no_powers_of_two_change_probabilities_by_packing_only() {
    let mut rng = Rng(473);
    for kind in 0..2 {
        let mut differences = [Vec::new(), Vec::new()];
        for _ in 0..100 {
            let bright = |light: &Light| light.with_emission(light.emission + 1.0);
            let lights: Vec<Light> = rng.lights(200, 5.0).iter().map(bright).collect();
            let tree = LightTree::new(lights.clone()).expect("valid");
            let power = if kind == 0 { rng.between(-6.0, 6.0) } else { rng.between(-12.0, 11.0) };
            let factor = 10.0_f32.powf(power);
            let change = |light: &Light| if kind == 0 { measured(light, factor) } else { dimmed(light, factor) };
            // A refit, so that the tree keeps its shape.
            let mut other = tree.clone();
            let changes: Vec<_> = (0..).zip(lights.iter().map(change)).collect();
            other.set_lights(&changes).expect("valid");
            other.refit();
            for _ in 0..10 {
                let at = rng.shading_point(8.0);
                let unit = if kind == 0 { factor } else { 1.0 };
                let scaled = ShadingPoint::surface(at.position * unit, at.normal);
                for (splits, found) in SPLITS.into_iter().zip(&mut differences) {
                    let pmfs = |tree: &LightTree, at| (0..200).map(|i| tree.pmf(at, i, splits)).collect::<Vec<f32>>();
                    found.push(difference(&pmfs(&tree, &at), &pmfs(&other, &scaled)));
                }
            }
        }
        for found in differences {
            let found = sorted(found);
            // Fluxes have eight bits. Boxes and means have eight bits of a node, whose steps are powers
            // of two. In one of a hundred draws at most another cluster is split for it.
            let (most, all) = [(0.05, 0.25), (2.0e-3, 0.05)][kind];
            assert!(found(0.99) < 1.2 * most && found(1.0) < all, "{kind}: {:e} {:e}", found(0.99), found(1.0));
            assert!(found(0.5) < [5.0e-3, 1.0e-3][kind], "{kind}: {:e}", found(0.5));
        }
    }
}
