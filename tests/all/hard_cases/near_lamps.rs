//! Shading points on a lamp, where probes and fog are: the other lamps must still be sampled.

use super::*;

/// Draws per shading point, evenly spaced in two dimensions.
const DRAWS: u32 = 64 * 64;

/// The least probability of the other lamp, 1 m away.
const MIN_OTHER_PMF: f32 = 0.1;

/// The least probability at a surface among a thousand lamps. The splits may end above both lamps,
/// because clusters that the surface faces are split first. Without the lamp at the shading point
/// the other one has 1.2 % to 1.8 % in these cases.
const MIN_OTHER_PMF_UNSPLIT: f32 = 0.005;

/// How much the share of the draws may differ from the probability.
const SPACING: f64 = 0.015;

/// The vector from one lamp to the other, 1 m long.
const AWAY: Vec3 = Vec3::new(0.48, 0.6, 0.64);

/// The same where translations are added: the sums are exact, and the length is 1 m to half a
/// percent.
const EXACT_AWAY: Vec3 = Vec3::new(0.5, 0.625, 0.59375);

fn bulb(position: Vec3) -> Light {
    Light::point(position, Vec3::splat(100.0))
}

/// The two lamps of a case, whose distance is 1 m.
struct Pair {
    world: LightWorld,
    /// Relative to the world's origin.
    positions: [Vec3; 2],
    lights: [LightId; 2],
}

impl Pair {
    /// The lamps are the last two of a tree's lights.
    fn in_a_tree(mut lights: Vec<Light>, pair: [Light; 2], translation: DVec3) -> Self {
        let first = lights.len() as u32;
        lights.extend(pair);
        let world = placed(lights, [Placement::at(translation)]);
        let instance = world.instances().next().expect("one instance");
        Self {
            positions: pair.map(|light| light.aabb().center() + translation.as_vec3()),
            lights: [first, first + 1].map(|light| LightId::Local { instance, light }),
            world,
        }
    }

    /// The lamps are the last two instances of a tree with a single light.
    fn of_instances(light: Light, placements: Vec<Placement>, pair: [DVec3; 2]) -> Self {
        let mut world = placed(vec![light], placements);
        let tree = world.trees().next().expect("one tree");
        let lights = pair.map(|translation| {
            let instance = world.add_instance(tree, Placement::at(translation), Policy::Static).expect("allowed");
            LightId::Local { instance, light: 0 }
        });
        Self { world, positions: pair.map(|p| p.as_vec3() + light.aabb().center()), lights }
    }

    /// Checks both lamps in turn: volume points and surface points on one are lit by the other.
    fn check(mut self, name: &str) {
        let mut on_lamps = Vec::new();
        for (near, far) in [(0, 1), (1, 0)] {
            let at = self.positions[near];
            let toward = (self.positions[far] - at).normalize();
            let side = toward.any_orthonormal_vector();
            for normal in [Vec3::ZERO, toward, (toward + side).normalize(), (toward - side).normalize()] {
                let point = ShadingPoint::surface(at, normal);
                for splits in [6, 7] {
                    self.check_at(&point, splits, near, &format!("{name}, {splits} splits, normal {normal}"));
                }
                on_lamps.push(point);
            }
        }
        prove(&self.world, &on_lamps, 20);
        prove_on_gpu(&mut self.world, &on_lamps, 20);
    }

    fn check_at(&self, point: &ShadingPoint, splits: usize, near: usize, name: &str) {
        let sampler = self.world.sampler().with_splits(splits);
        let (on, other) = (self.lights[near], self.lights[1 - near]);
        assert_eq!(sampler.sample_light(point, on, [0.5; 2]), None, "{name}: the point is not on the lamp");
        let pmf = sampler.pmf(point, other);
        let are_few = sampler.all_lights().count() < 1000;
        let least = if are_few || point.normal == Vec3::ZERO { MIN_OTHER_PMF } else { MIN_OTHER_PMF_UNSPLIT };
        assert!(pmf >= least, "{name}: the other lamp has the probability {pmf}");
        let side = DRAWS.isqrt();
        let number = |i| (i as f32 + 0.5) / side as f32;
        let draws = (0..DRAWS).map(|i| [number(i % side), number(i / side), 0.5, 0.5]);
        let returned = draws.filter(|u| sampler.sample(point, *u).is_some_and(|s| s.light == other)).count();
        let share = returned as f64 / f64::from(DRAWS);
        assert!(
            (share - f64::from(pmf)).abs() < SPACING,
            "{name}: {share} of the draws return the other lamp, not {pmf}"
        );
    }
}

/// A thousand places on a square grid with a spacing of 30 m, 6 m above the ground.
fn grid() -> impl Iterator<Item = Vec3> {
    (0..1000).map(|i| Vec3::new((i % 32) as f32 * 30.0 - 465.0, 6.0, (i / 32) as f32 * 30.0 - 450.0))
}

#[test]
fn both_lamps_in_one_tree() {
    let at = Vec3::new(1.3, 2.7, -0.4);
    Pair::in_a_tree(vec![], [bulb(at), bulb(at + AWAY)], DVec3::ZERO).check("two points");
    Pair::in_a_tree(vec![], [bulb(Vec3::ZERO), bulb(EXACT_AWAY)], DVec3::new(7.0, 0.0, -3.0))
        .check("at the tree's origin");
    let spot = |position, direction| Light::spot(position, direction, 0.3, 0.9, Vec3::splat(100.0));
    Pair::in_a_tree(vec![], [spot(at, AWAY), spot(at + AWAY, -AWAY)], DVec3::ZERO).check("two spots");
}

#[test]
fn two_instances_of_a_tree_with_one_lamp() {
    let near = DVec3::new(12.0, 0.0, -5.0);
    let pair = [near, near + EXACT_AWAY.as_dvec3()];
    Pair::of_instances(bulb(Vec3::ZERO), vec![], pair).check("lamp at the tree's origin");
    Pair::of_instances(bulb(Vec3::new(0.0, 6.0, 0.0)), vec![], pair).check("lamp on a post");
}

#[test]
fn two_instances_among_a_thousand() {
    let others = || grid().map(|place| Placement::at(place.as_dvec3())).collect();
    for near in [DVec3::new(31.0, 4.0, 62.0), DVec3::new(-300.25, 6.0, 14.5)] {
        let pair = [near, near + EXACT_AWAY.as_dvec3()];
        Pair::of_instances(bulb(Vec3::ZERO), others(), pair).check("a city of bulbs");
    }
}

#[test]
fn a_point_on_a_lamp_of_a_tree_with_a_thousand_lamps() {
    for near in [Vec3::new(31.0, 4.0, 62.0), Vec3::new(-300.3, 6.1, 14.7)] {
        Pair::in_a_tree(grid().map(bulb).collect(), [bulb(near), bulb(near + AWAY)], DVec3::ZERO).check("a large tree");
    }
}

#[test]
fn lamps_a_hundred_kilometres_from_the_origin() {
    let far = Vec3::new(1.0e5, 0.0, -1.0e5);
    Pair::in_a_tree(vec![], [bulb(far), bulb(far + AWAY)], DVec3::ZERO).check("far lights");
    Pair::in_a_tree(vec![], [bulb(Vec3::ZERO), bulb(EXACT_AWAY)], far.as_dvec3()).check("a far instance");
    let pair = [far.as_dvec3(), (far + EXACT_AWAY).as_dvec3()];
    Pair::of_instances(bulb(Vec3::ZERO), vec![], pair).check("far instances");
}

#[test]
fn several_lamps_at_the_shading_point() {
    let at = Vec3::new(1.3, 2.7, -0.4);
    for count in [2, 7, 60] {
        Pair::in_a_tree(vec![bulb(at); count], [bulb(at), bulb(at + AWAY)], DVec3::ZERO).check_one_way(count);
    }
}

impl Pair {
    /// Checks points on the first lamp only, with what else is there.
    fn check_one_way(self, count: usize) {
        let point = ShadingPoint::volume(self.positions[0]);
        for splits in [6, 7] {
            self.check_at(&point, splits, 0, &format!("{count} lamps"));
        }
    }
}

#[test]
fn the_sun_on_a_lamp() {
    let mut world = alone(vec![bulb(Vec3::ONE)]);
    let sun = DirectionalLight { direction: Vec3::NEG_Y, illuminance: Vec3::splat(0.01) };
    let sun = LightId::Directional(world.add_directional(sun).expect("allowed"));
    for point in at_point(Vec3::ONE).into_iter().filter(|point| point.normal == Vec3::ZERO || point.normal.y > 0.0) {
        assert!(world.sampler().pmf(&point, sun) >= MIN_OTHER_PMF);
    }
    let points = at_point(Vec3::ONE);
    prove(&world, &points, 21);
    prove_on_gpu(&mut world, &points, 21);
}

#[test]
fn a_lamp_that_is_near_gets_nearly_all_draws() {
    let far = |near: Vec3| near + EXACT_AWAY;
    let post = Vec3::new(31.0, 4.0, 62.0);
    let tree = |near: Vec3| Pair::in_a_tree(vec![], [bulb(near), bulb(far(near))], DVec3::ZERO);
    let cases = [
        ("at the origin", tree(Vec3::ZERO)),
        ("in a tree", tree(post)),
        ("instances", Pair::of_instances(bulb(Vec3::ZERO), vec![], [post.as_dvec3(), far(post).as_dvec3()])),
        ("instances at the origin", Pair::of_instances(bulb(Vec3::ZERO), vec![], [DVec3::ZERO, EXACT_AWAY.as_dvec3()])),
    ];
    for (name, pair) in cases {
        let sampler = pair.world.sampler();
        let mut nearest = 1.0;
        for exponent in (-48..=0).rev() {
            let dist = 10.0_f32.powf(exponent as f32 / 4.0);
            let point = ShadingPoint::volume(pair.positions[0] - AWAY * dist);
            let pmf = sampler.pmf(&point, pair.lights[0]);
            if sampler.sample_light(&point, pair.lights[0], [0.5; 2]).is_none() {
                // Nearer than 1e-11 m, or rounded onto the lamp.
                assert!(pmf < 1.0 - MIN_OTHER_PMF, "{name}: {dist} m away the probability is {pmf}");
                continue;
            }
            let (near_sq, far_sq) = (point.position.distance_squared(pair.positions[0]), (1.0 + dist).powi(2));
            let ideal = far_sq / (near_sq + far_sq);
            // Where the distance is less than nodes and f32 can tell, the lamp gets half.
            let least = if dist > 1.0e-4 { 0.98 * ideal } else { 0.49 };
            assert!(pmf >= least && pmf <= 1.0, "{name}: {dist} m away the probability is {pmf}, not {ideal}");
            nearest = f32::min(nearest, dist);
        }
        assert!(nearest < 1.0e-5, "{name}: no point nearer than {nearest} m");
    }
}
