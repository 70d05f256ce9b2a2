//! The values of the four attributes, and the changes that leave them as they are.

use girandole::glam::Vec3;
use girandole::{Attribute, Light, Shape};

use super::{checked, mapped};
use testbed::testing::support::Rng;

/// Relative tolerance. Moments are relative to a position; its rounding and that of rotated or
/// scaled sums is far less.
const TOLERANCE: f32 = 1.0e-4;

/// Lights of all kinds on a grid of 2^-6 m, so that a translation by whole metres rounds nothing.
fn grid_lights(count: usize) -> Vec<Light> {
    let mut rng = Rng(60);
    let snap = |v: Vec3| (v * 64.0).round() / 64.0;
    let mut light = || mapped(&rng.light(8.0).with_range(f32::INFINITY), snap, |v| v);
    (0..count).map(|_| light()).collect()
}

#[test]
fn a_refit_keeps_the_attributes_of_lights_that_are_all_moved_rotated_mirrored_scaled_or_dimmed() {
    let mut tree = checked(grid_lights(500));
    let lights = tree.lights().to_vec();
    let first = tree.attributes();
    let quarter = |v: Vec3| Vec3::new(v.x, -v.z, v.y);
    let shift = Vec3::new(300.0, -20.0, 7.0);
    let scaled = |light: &Light, factor: f32| {
        // The flux of a surface grows with its area. Scale the emission of points and spots
        // instead.
        let is_area = light.area().is_some();
        let emission = light.emission * if is_area { 1.0 } else { factor * factor };
        let grown = mapped(light, |p| p * factor, |v| v * factor);
        grown.with_emission(emission)
    };
    let dimmed = |light: &Light| light.with_emission(light.emission * 1.0e-6);
    let all = |change: &dyn Fn(&Light) -> Light| -> Vec<_> { (0..).zip(lights.iter().map(change)).collect() };
    for (name, changes) in [
        ("moved", all(&|light| mapped(light, |p| p + shift, |v| v))),
        ("rotated", all(&|light| mapped(light, quarter, quarter))),
        ("mirrored", all(&mirrored)),
        ("scaled up", all(&|light| scaled(light, 64.0))),
        ("scaled down", all(&|light| scaled(light, 0.1))),
        ("dimmed", all(&dimmed)),
        ("as before", all(&|light| *light)),
    ] {
        tree.set_lights(&changes).expect("the lights are valid");
        tree.refit();
        tree.check().expect("the tree is sound");
        let now = tree.attributes();
        for attribute in [Attribute::Distance, Attribute::Overlap, Attribute::Variance, Attribute::SplittingCost] {
            let (a, b) = (first.get(attribute), now.get(attribute));
            assert!(a > 0.0 && (a - b).abs() <= TOLERANCE * a, "{name}: {first:?} {now:?}");
        }
    }
    assert_eq!(tree.attributes(), first);
}

/// A light mirrored in x. Flat lights emit to the mirrored side.
fn mirrored(light: &Light) -> Light {
    let flip = |v: Vec3| Vec3::new(-v.x, v.y, v.z);
    let mut light = mapped(light, flip, flip);
    match &mut light.shape {
        Shape::Rectangle { half_u, half_v, .. } => std::mem::swap(half_u, half_v),
        Shape::Triangle { vertices, .. } => vertices.swap(1, 2),
        _ => {}
    }
    light
}

#[test]
fn the_attributes_of_one_node_have_the_values_worked_out_by_hand() {
    // Two equal points are 2 m apart: the means are 1 m from the centre, and the box's diagonal and
    // half perimeter are 2 m.
    let pair = checked(vec![Light::point(Vec3::NEG_X, Vec3::ONE), Light::point(Vec3::X, Vec3::ONE)]).attributes();
    assert!((pair.distance - 0.5).abs() < 1e-6);
    assert!((pair.variance - 0.25).abs() < 1e-6);
    assert_eq!((pair.overlap, pair.splitting_cost), (0.0, 0.0));
    // Two equal unit squares overlap by half: boxes of 1 x 1 at x in 0..1 and in 0.5..1.5 share 0.5
    // + 1 of the node's 1.5 + 1.
    let square = |x| Light::rectangle(Vec3::new(x, 0.0, 0.0), Vec3::X * 0.5, Vec3::Y * 0.5, Vec3::ONE);
    let squares = checked(vec![square(0.0), square(0.5)]).attributes();
    assert!((squares.overlap - 1.5 / 2.5).abs() < 1e-6);
    // The means are 0.25 m from the centre. Each square's own variance is (0.25 + 0.25) / 3. The
    // squared diagonal is 3.25.
    assert!((squares.distance - 0.25 / 3.25_f32.sqrt()).abs() < 1e-6);
    assert!((squares.variance - (0.0625 + 0.5 / 3.0) / 3.25).abs() < 1e-6);
    // The cost is flux · (half area + 0.05 diagonal²) · π. Half areas are 1 and 1.5, squared
    // diagonals 2 and 3.25; each square has half of the flux.
    let expected = (1.0 + 0.05 * 2.0) / (1.5 + 0.05 * 3.25);
    assert!((squares.splitting_cost - expected).abs() < 1e-4, "{}", squares.splitting_cost);
}

#[test]
fn the_attributes_of_two_nodes_have_the_values_worked_out_by_hand() {
    // Four unit squares at x = 0, four at 0.5 and one at 100 all face z and have the same flux. The
    // far one is split off, and the other eight fill a node.
    let square = |x| Light::rectangle(Vec3::new(x, 0.0, 0.0), Vec3::X * 0.5, Vec3::Y * 0.5, Vec3::ONE);
    let tree = checked([[0.0; 4], [0.5; 4]].concat().into_iter().chain([100.0]).map(square).collect());
    assert_eq!(tree.nodes().iter().map(|node| node.count()).collect::<Vec<_>>(), [2, 8]);
    let all = tree.attributes();
    let close = |a: f32, b: f64| assert!((f64::from(a) / b - 1.0).abs() < 1e-5, "{a} {b}");
    // The lower node has eight of nine fluxes. The root's box is 101 x 1, the lower node's 1.5 x 1.
    let diagonal_sq = 101.0 * 101.0 + 1.0;
    // Means are 0.25 m from the lower node's mean. At the root it is the standard deviation of 8/9
    // at 0.25 and 1/9 at 100.
    let between = 99.75 * 99.75 * 8.0 / 81.0;
    close(all.distance, (8.0 / 9.0 * 0.25 + f64::sqrt(between)) / f64::sqrt(diagonal_sq));
    // Each square's own variance is (0.25 + 0.25) / 3.
    let lower = 0.0625 + 0.5 / 3.0;
    let upper = between + 8.0 / 9.0 * lower + 1.0 / 9.0 * 0.5 / 3.0;
    close(all.variance, (8.0 / 9.0 * lower + upper) / diagonal_sq);
    // In the lower node, of 1.5 + 1, twelve pairs coincide and share 1 + 1; sixteen are shifted and
    // share 0.5 + 1. At the root nothing overlaps.
    close(all.overlap, 8.0 / 9.0 * (12.0 * 2.0 + 16.0 * 1.5) / 2.5);
    // Flux · (half area + 0.05 diagonal²), all of the same orientation: eight squares, then the two
    // children of the root.
    let unit = 1.0 + 0.05 * 2.0;
    let children = 8.0 * unit + 8.0 * (1.5 + 0.05 * 3.25) + unit;
    close(all.splitting_cost, children / (9.0 * (101.0 + 0.05 * diagonal_sq)));
}
