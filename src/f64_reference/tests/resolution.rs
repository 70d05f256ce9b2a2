//! Lamps nearer to a shading point than its coordinates can tell.

use super::{both_importances, direction, exact, size};
use crate::light::Light;
use crate::shading::shading_point::ShadingPoint;
use crate::tree::LightTree;
use crate::tree::testing::Rng;

use glam::Vec3;

/// The distance below which a lamp is unresolved, for the sum of the absolute coordinates of a point
/// or of the farther end of a segment (docs/math.md).
fn resolution(coordinates: f32) -> f32 {
    6.0_f32.sqrt() * (3.0e-7 * coordinates + 2.0e-11)
}

#[test]
fn lamps_are_unresolved_up_to_the_distance_that_coordinates_can_tell() {
    let mut rng = Rng(550);
    let mut found = [0; 2];
    for _ in 0..40_000 {
        let place = direction(&mut rng) * if rng.below(4) == 0 { 0.0 } else { size(&mut rng, -7.0, 4.0) };
        let away = direction(&mut rng);
        let length = place.length() * size(&mut rng, -2.0, 1.0);
        let is_segment = rng.below(2) == 0 && length > 1.0e-8;
        let along = away.any_orthonormal_vector() * if is_segment { length } else { 0.0 };
        let coordinates = place.abs().element_sum() + 0.5 * along.abs().element_sum();
        // Rounding moves the lamp by a third of this at most, and turns a long segment.
        let factor = size(&mut rng, -0.7, 0.7);
        let lamp = place + away * (factor * resolution(coordinates));
        let tree = LightTree::new(vec![Light::point(lamp, Vec3::ONE)]).expect("a valid light");
        let at = match is_segment {
            true => ShadingPoint::segment(place - 0.5 * along, along / length, length),
            false => ShadingPoint::volume(place),
        };
        let [(lux, _, expected)] = both_importances(&tree, &at)[..] else { panic!("it shines") };
        // Rounding hides the distance from a segment, so nothing is said near the limit.
        let (dist, doubtful) = match is_segment {
            true => (f64::from(factor * resolution(coordinates)), 0.5..2.0),
            false => ((exact(lamp) - exact(at.position)).length(), 0.99..1.01),
        };
        let share = dist / f64::from(resolution(coordinates));
        if doubtful.contains(&share) {
            continue;
        }
        let is_unresolved = lux < 0.0;
        assert_eq!(is_unresolved, share < 1.0, "{share} of {lamp} at {at:?}");
        assert!(is_segment || expected.is_unresolved == is_unresolved, "{lamp} at {at:?}");
        found[usize::from(is_unresolved)] += 1;
    }
    assert!(found.iter().all(|count| *count > 10_000), "{found:?}");
}
