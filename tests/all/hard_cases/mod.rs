//! Cases that other light samplers got wrong: the ends of every allowed range, degenerate shapes,
//! shading points on lights, and thousands of equal lights.

mod deep;
mod extremes;
mod far_lights;
mod inputs;
mod near_lamps;
mod poles;
mod ranges;
mod rims;
mod shapes;
mod stretched;

use std::f32::consts::PI;

use girandole::glam::{DVec3, Mat3, Quat, Vec3};
use girandole::gpu::GpuLights;
use girandole::light::{MAX_COORDINATE, MAX_EMISSION};
use girandole::{
    DirectionalLight, Effects, FrameBudget, Gloss, Light, LightId, LightSampler, LightTree, LightWorld, MAX_SCALE,
    ORIGIN_GRID, Placement, Policy, ShadingPoint,
};
use testbed::common::batch::SampleRequest;

use crate::gpu::{OTHER_PICKS, compare, gpu, sample_by};
use testbed::testing::support::{Rng, SPLITS, all_pmfs, rounds};

/// Rounding of a sum over thousands of lights. Each probability is a product of ratios of sums of
/// eight, and each ratio rounds by a few 6e-8.
const SUM_TOLERANCE: f64 = 1.0e-4;

/// Draws that are compared with the sum of all probabilities.
const DRAWS: u32 = 64;

const ONE_MINUS_EPSILON: f32 = 1.0 - f32::EPSILON / 2.0;

/// A world with instances of one tree.
fn placed(lights: Vec<Light>, placements: impl IntoIterator<Item = Placement>) -> LightWorld {
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(lights).expect("allowed lights"));
    world.tree(tree).expect("just added").check().expect("a sound tree");
    for placement in placements {
        world.add_instance(tree, placement, Policy::Budgeted).expect("an allowed placement");
    }
    world
}

/// A world with one instance, placed where its lights are.
fn alone(lights: Vec<Light>) -> LightWorld {
    placed(lights, [Placement::IDENTITY])
}

fn linear(linear: Mat3) -> Placement {
    Placement { linear, ..Placement::IDENTITY }
}

/// Checks with every number of splits that each light that sends anything has a probability above
/// 0, that probabilities sum to at most 1 and to the share of draws that find a light, and that
/// picks carry their own. Returns the number of contributions.
fn prove(world: &LightWorld, shading_points: &[ShadingPoint], seed: u64) -> usize {
    let [plain, split] = SPLITS.map(|splits| prove_with(&world.sampler().with_splits(splits), shading_points, seed));
    assert_eq!(plain, split, "splits do not change what arrives");
    plain
}

fn prove_with(sampler: &LightSampler, shading_points: &[ShadingPoint], seed: u64) -> usize {
    let mut rng = Rng(seed);
    let mut contributions = 0;
    for shading_point in shading_points {
        let mut sum = 0.0;
        for (light, pmf) in all_pmfs(sampler, shading_point) {
            assert!((0.0..=1.0).contains(&pmf), "{light:?} has the probability {pmf} at {shading_point:?}");
            sum += f64::from(pmf);
            for u in [[0.0, 0.0], [ONE_MINUS_EPSILON, ONE_MINUS_EPSILON], [rng.unit(), rng.unit()]] {
                if let Some(incident) = sampler.sample_light(shading_point, light, u) {
                    assert!(pmf > 0.0, "{light:?} sends {incident:?} to {shading_point:?} but is never chosen");
                    assert!(incident.radiance.is_finite() && incident.radiance.min_element() >= 0.0, "{incident:?}");
                    assert!(incident.pdf.is_normal() && incident.pdf > 0.0, "{incident:?}");
                    assert!((incident.direction.length() - 1.0).abs() < 1.0e-4, "{incident:?}");
                    assert!(incident.dist > 0.0, "{incident:?}");
                    contributions += 1;
                }
            }
        }
        assert!(sum <= 1.0 + SUM_TOLERANCE, "probabilities sum to {sum} at {shading_point:?}");
        let found = (0..DRAWS).filter(|_| sampler.pick(shading_point, [rng.unit(), rng.unit()]).is_some()).count();
        let (mean, share) = (f64::from(DRAWS) * sum, sum.clamp(0.0, 1.0));
        // Six standard deviations and six draws: a false alarm in less than one of 10^8 shading points.
        let slack = 6.0 * (f64::from(DRAWS) * share * (1.0 - share)).sqrt() + 6.0;
        assert!((found as f64 - mean).abs() <= slack, "{found} of {mean} draws find a light at {shading_point:?}");
        for u in [0.0, 0.5, ONE_MINUS_EPSILON, rng.unit(), 1.0, -1.0, f32::NAN, f32::INFINITY] {
            for v in [0.0, ONE_MINUS_EPSILON, rng.unit(), f32::NAN] {
                let Some(pick) = sampler.pick(shading_point, [u, v]) else { continue };
                let pmf = sampler.pmf(shading_point, pick.light);
                assert!(pick.pmf > 0.0 && pmf > 0.0, "{pick:?} {pmf} at {shading_point:?}");
                assert!((pick.pmf / pmf - 1.0).abs() < 1.0e-4, "{pick:?} {pmf}");
            }
        }
    }
    contributions
}

/// Checks that the GPU chooses the same lights as the CPU.
fn prove_on_gpu(world: &mut LightWorld, shading_points: &[ShadingPoint], seed: u64) {
    let mut rng = Rng(seed);
    let (device, queue) = gpu();
    let mut lights = GpuLights::new(&device, &queue).expect("default limits are enough");
    let requests: Vec<_> = (0..1024)
        .map(|i| {
            let shading_point = shading_points[i % shading_points.len()];
            SampleRequest {
                position: shading_point.position.to_array(),
                normal: shading_point.normal.to_array(),
                u: [rng.unit(), rng.unit(), rng.unit(), rng.unit()],
                ..SampleRequest::default()
            }
        })
        .collect();
    lights.upload(world).expect("room enough");
    // The variant for this world, and that for every world.
    for effects in [lights.effects(), Effects::all()] {
        let records = sample_by(effects, &mut lights, &requests);
        assert!(records.iter().all(|r| r.pmf.is_finite() && r.pdf.is_finite() && Vec3::from(r.radiance).is_finite()));
        let others = compare(world, &requests, &records);
        assert!(others as f64 <= OTHER_PICKS * 1024.0 + 1.0, "{others} of 1024 draws choose another light");
    }
}

fn shading_points(rng: &mut Rng, count: usize, size: f32) -> Vec<ShadingPoint> {
    (0..count).map(|_| rng.shading_point(size)).collect()
}

/// A volume point, and surface points that face along the axes, so that lights lie exactly on
/// horizons.
fn at_point(position: Vec3) -> Vec<ShadingPoint> {
    let normals = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z];
    normals.map(|normal| ShadingPoint::surface(position, normal)).to_vec()
}

/// One light of every kind, about `size` metres large.
fn one_of_each(rng: &mut Rng, at: Vec3, size: f32) -> Vec<Light> {
    let (u, v) = (rng.direction() * size, rng.direction() * size);
    let bright = Vec3::splat(10.0);
    vec![
        Light::point(at, bright),
        Light::spot(at, rng.direction(), 0.2, 0.6, bright),
        Light::spot(at, rng.direction(), 0.2, 2.2, bright),
        Light::rectangle(at, u, v, bright),
        Light::rectangle(at, u, v, bright).two_sided(),
        Light::triangle([at, at + u, at + v], bright),
        Light::triangle([at, at + u, at + v], bright).two_sided(),
        Light::sphere(at, size, bright),
    ]
}
