//! Beams that shine the same way, seen from behind and from close by: their caps prove darkness
//! there, although no bounding sphere is small beside its distance.

use glam::Vec3;

use super::{both_importances, direction, exact, size};
use crate::light::Light;
use crate::shading::shading_point::ShadingPoint;
use crate::tree::LightTree;
use crate::tree::testing::Rng;

/// Spots in a ball of this radius that shine almost the same way.
fn beams(rng: &mut Rng, axis: Vec3, radius: f32) -> LightTree {
    let lights = (0..40).map(|_| {
        let outer = rng.between(0.1, 0.6);
        let beam = (axis + 0.05 * direction(rng)).normalize();
        Light::spot(rng.position(radius), beam, 0.5 * outer, outer, Vec3::ONE)
    });
    LightTree::new(lights.collect()).expect("valid lights")
}

/// Compares with the reference which children are dark. Returns how many children of more than one
/// place are dark, and how many are lit, within twice the radius of their box.
fn compare(tree: &LightTree, at: &ShadingPoint, loose: &mut usize) -> [usize; 2] {
    let position = exact(at.position);
    let mut found = [0; 2];
    for (lux, child, expected) in both_importances(tree, at).into_iter().filter(|(_, _, expected)| !expected.is_close) {
        let (is_lit, should) = (lux != 0.0, expected.lux != 0.0);
        assert!(is_lit || !should, "{child:?} {at:?}");
        *loose += usize::from(is_lit && !should);
        let radius = child.half().length();
        if radius > 0.0 && (child.center() - position).length() < 2.0 * radius {
            found[usize::from(should)] += 1;
        }
    }
    found
}

#[test]
fn beams_are_dark_behind_their_boxes_and_lit_inside_of_them() {
    let mut rng = Rng(540);
    let (mut points, mut segments, mut loose) = ([0; 2], [0; 2], [0; 2]);
    for _ in 0..60 {
        let (axis, radius) = (direction(&mut rng), size(&mut rng, -2.0, 2.0));
        let tree = beams(&mut rng, axis, radius);
        for _ in 0..200 {
            // Behind the middle of the ball, at the distance of its surface or so.
            let away = (0.7 * direction(&mut rng) - axis).normalize();
            let place = away * (radius * rng.between(0.2, 3.0)) + rng.position(0.3 * radius);
            let found = compare(&tree, &ShadingPoint::volume(place), &mut loose[0]);
            points = [points[0] + found[0], points[1] + found[1]];
            let length = radius * size(&mut rng, -2.0, 0.3);
            let segment = ShadingPoint::segment(place, direction(&mut rng), length);
            let found = compare(&tree, &segment, &mut loose[1]);
            segments = [segments[0] + found[0], segments[1] + found[1]];
        }
    }
    assert_eq!(loose, [0; 2], "dark in f64 and not in f32");
    assert!(points.iter().chain(&segments).all(|count| *count > 3_000), "{points:?} {segments:?}");
}
