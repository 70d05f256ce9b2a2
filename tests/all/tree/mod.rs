//! Trees keep their promises through builds, refits and random edits.

use girandole::glam::Vec3;
use girandole::{Light, LightTree};
use proptest::prelude::*;

use crate::support::Rng;

fn checked(lights: Vec<Light>) -> LightTree {
    let tree = LightTree::new(lights).expect("valid lights");
    tree.check().expect("a fresh tree is sound");
    tree
}

#[test]
fn trees_of_every_small_size_are_sound() {
    let mut rng = Rng(1);
    for count in (0..70).chain([500, 4095, 4096, 5000]) {
        checked(rng.lights(count, 50.0));
    }
}

#[test]
fn a_tree_is_the_same_for_any_number_of_threads() {
    let lights = Rng(2).lights(20_000, 100.0);
    let build = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| checked(lights.clone()))
    };
    assert_eq!(build(1).nodes(), build(4).nodes());
}

#[test]
fn lights_at_one_point_in_a_line_and_in_a_plane_make_sound_trees() {
    let lamp = |position| Light::point(position, Vec3::ONE);
    checked((0..5000).map(|_| lamp(Vec3::splat(3.0))).collect());
    let street = checked((0..1000).map(|i| lamp(Vec3::new(i as f32 * 10.0, 0.0, 0.0))).collect());
    // A street has boxes without area; if every split cost zero, the first level would not tell near from far.
    let root = &street.nodes()[0];
    let longest = (0..root.count()).map(|slot| root.cluster(slot).aabb.extent().x).fold(0.0, f32::max);
    assert!(longest < 0.4 * 9990.0, "{longest}");
    checked((0..1000).map(|i| lamp(Vec3::new((i % 30) as f32, 0.0, (i / 30) as f32))).collect());
}

#[test]
fn a_lamp_that_is_switched_off_and_on_leaves_the_tree_as_it_was() {
    let lights = Rng(3).lights(300, 20.0);
    let mut tree = checked(lights.clone());
    let before = (tree.nodes().to_vec(), tree.attributes());
    for round in 0..3 {
        let off: Vec<_> = lights
            .iter()
            .zip(0..)
            .filter(|(_, i)| i % 3 == round)
            .map(|(l, i)| (i, Light { emission: Vec3::ZERO, ..*l }))
            .collect();
        tree.set(&off).expect("dark lights are valid");
        tree.refit();
        tree.check().expect("sound while some are dark");
    }
    assert_eq!(tree.flux().area + tree.flux().punctual, 0.0);
    let on: Vec<_> = (0..).zip(lights).collect();
    tree.set(&on).expect("valid");
    tree.refit();
    tree.check().expect("sound when all are back");
    assert_eq!((tree.nodes().to_vec(), tree.attributes()), before);
}

#[test]
fn a_refused_change_changes_nothing() {
    let mut tree = checked(Rng(4).lights(50, 5.0));
    let before = tree.lights().to_vec();
    let good = Light::point(Vec3::ONE, Vec3::ONE);
    assert!(tree.set(&[(0, good), (1, Light::point(Vec3::NAN, Vec3::ONE))]).is_err());
    assert!(tree.set(&[(0, good), (50, good)]).is_err());
    assert_eq!(tree.lights(), before);
}

#[test]
fn twelve_decades_of_flux_live_in_one_tree() {
    let mut rng = Rng(5);
    let lights = (0..200).map(|i| {
        let exponent = -12.0 + 24.0 * i as f32 / 199.0;
        Light::point(rng.place(10.0), Vec3::splat(10.0_f32.powf(exponent)))
    });
    let tree = checked(lights.collect());
    let fluxes = tree.nodes().iter().flat_map(|node| (0..node.count()).map(|slot| node.cluster(slot).flux));
    assert!(fluxes.into_iter().all(|flux| flux > 0.0 && flux.is_finite()));
}

#[test]
fn attributes_do_not_change_when_everything_is_moved_scaled_or_dimmed() {
    let mut rng = Rng(6);
    let base: Vec<_> = (0..200).map(|_| (rng.place(10.0), rng.between(1.0, 100.0))).collect();
    let tree = |scale: f32, shift: Vec3, dim: f32| {
        checked(base.iter().map(|(p, i)| Light::point(*p * scale + shift, Vec3::splat(i * dim))).collect()).attributes()
    };
    let first = tree(1.0, Vec3::ZERO, 1.0);
    for other in
        [tree(64.0, Vec3::ZERO, 1.0), tree(1.0, Vec3::new(300.0, -20.0, 7.0), 1.0), tree(1.0, Vec3::ZERO, 1e-6)]
    {
        for (a, b) in [
            (first.distance, other.distance),
            (first.overlap, other.overlap),
            (first.variance, other.variance),
            (first.splitting_cost, other.splitting_cost),
        ] {
            // The moved tree rounds its positions to 3e-5 m and may bin one light differently.
            assert!((a - b).abs() <= 0.01 * a.abs().max(0.01), "{first:?} {other:?}");
        }
    }
}

#[test]
fn attributes_have_the_values_worked_out_by_hand() {
    // Two equal points 2 m apart: means 1 m from the middle; the box's diagonal and half perimeter are 2 m.
    let pair = checked(vec![Light::point(Vec3::NEG_X, Vec3::ONE), Light::point(Vec3::X, Vec3::ONE)]).attributes();
    assert!((pair.distance - 0.5).abs() < 1e-6);
    assert!((pair.variance - 0.25).abs() < 1e-6);
    assert_eq!((pair.overlap, pair.splitting_cost), (0.0, 0.0));
    // Two equal unit squares on one another, half shifted: boxes 1 x 1 at x 0..1 and 0.5..1.5 share 0.5 + 1 of the
    // node's 1.5 + 1.
    let square = |x| Light::rectangle(Vec3::new(x, 0.0, 0.0), Vec3::X * 0.5, Vec3::Y * 0.5, Vec3::ONE);
    let squares = checked(vec![square(0.0), square(0.5)]).attributes();
    assert!((squares.overlap - 1.5 / 2.5).abs() < 1e-6);
    // Means 0.25 m from the middle; each square's own variance is (0.25 + 0.25) / 3; the diagonal squared is 3.25.
    assert!((squares.distance - 0.25 / 3.25_f32.sqrt()).abs() < 1e-6);
    assert!((squares.variance - (0.0625 + 0.5 / 3.0) / 3.25).abs() < 1e-6);
    // Cost: flux x (half area + 0.05 diagonal^2) x pi each; half areas 1 and 1.5, diagonals^2 2 and 3.25; both fluxes halved.
    let expected = (1.0 + 0.05 * 2.0) / (1.5 + 0.05 * 3.25);
    assert!((squares.splitting_cost - expected).abs() < 1e-4, "{}", squares.splitting_cost);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn random_edits_keep_a_tree_sound(seed in any::<u64>(), count in 1_usize..400, rounds in 1_usize..6) {
        let mut rng = Rng(seed);
        let mut tree = checked(rng.lights(count, 30.0));
        for _ in 0..rounds {
            let edits = rng.bits() as usize % count + 1;
            let changes: Vec<_> = (0..edits).map(|_| ((rng.bits() % count as u64) as u32, rng.light(60.0))).collect();
            tree.set(&changes).expect("random lights are valid");
            tree.refit();
            prop_assert!(tree.check().is_ok(), "{:?}", tree.check());
            if rng.bits().is_multiple_of(3) {
                tree.rebuild();
                prop_assert!(tree.check().is_ok(), "{:?}", tree.check());
            }
        }
    }
}
