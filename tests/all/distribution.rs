//! The probabilities of all lights in one pass are those that are computed one by one.

use girandole::glam::Vec3;
use girandole::{Light, LightTree, MAX_SPLITS, ShadingPoint};

use testbed::testing::support::Rng;

/// Rounding of products of up to two dozen ratios in another order: each step rounds by 6e-8 of the
/// probability.
const TOLERANCE: f32 = 1.0e-5;

/// Rounding of a sum of up to a few thousand probabilities.
const SUM_TOLERANCE: f64 = 1.0e-4;

/// Below this the floors that keep a probability from rounding to 0 may apply in another order.
const LEAST: f32 = 1.0e-28;

fn agree(one: f32, other: f32) -> bool {
    (one > 0.0) == (other > 0.0) && (one - other).abs() <= TOLERANCE * other + LEAST
}

#[test]
fn the_distribution_of_a_tree_is_the_pmf_of_each_light_and_sums_to_one() {
    let mut rng = Rng(72);
    let mut pmfs = Vec::new();
    for count in [0, 1, 2, 9, 100, 3000] {
        // Point lights reach everything: no draw ends without a light.
        let lights = (0..count).map(|_| Light::point(rng.position(20.0), Vec3::splat(rng.unit() + 0.01))).collect();
        let tree = LightTree::new(lights).expect("valid lights");
        for splits in 0..=MAX_SPLITS {
            let shading_point = ShadingPoint::volume(rng.position(30.0));
            tree.distribution(&shading_point, splits, &mut pmfs);
            assert_eq!(pmfs.len(), count);
            for (light, pmf) in (0..).zip(&pmfs) {
                assert!(agree(*pmf, tree.pmf(&shading_point, light, splits)));
            }
            let sum: f64 = pmfs.iter().map(|p| f64::from(*p)).sum();
            assert!(count == 0 || (sum - 1.0).abs() < SUM_TOLERANCE, "{sum}");
        }
    }
}
