//! Importances of the children of random nodes.

use glam::Vec3;

use super::{both_importances, direction, light, size, view};
use crate::f64_reference::ROUNDING;
use crate::shading::shading_point::ShadingPoint;
use crate::tree::LightTree;
use crate::tree::testing::Rng;

#[test]
fn importances_are_those_of_the_formula_in_f64() {
    let mut rng = Rng(510);
    let (mut compared, mut dark, mut close, mut below, mut behind) = (0, 0, 0, 0, 0);
    let (mut worst, mut worst_plain, mut plain) = (0.0_f64, 0.0_f64, 0);
    for _ in 0..60 {
        let scale = size(&mut rng, -6.0, 6.0);
        let lights = (0..200).map(|_| {
            let emission = size(&mut rng, -12.0, 12.0);
            light(&mut rng, scale, emission)
        });
        let tree = LightTree::new(lights.collect()).expect("valid");
        for _ in 0..60 {
            let position = if rng.below(3) == 0 {
                // Near a light, and from 1e-9 to 1e15 m.
                let lamp = tree.lights()[rng.below(200)].aabb().center();
                lamp + direction(&mut rng) * size(&mut rng, -9.0, 3.0) * scale
            } else {
                direction(&mut rng) * (scale * size(&mut rng, -1.0, 9.0)).min(1.0e15)
            };
            let normal = if rng.below(4) == 0 { Vec3::ZERO } else { direction(&mut rng) };
            let at = ShadingPoint::surface(position, normal);
            let view = view(&at);
            for (lux, child, expected) in both_importances(&tree, &at) {
                if expected.is_close {
                    close += 1;
                    continue;
                }
                assert_eq!(lux == 0.0, expected.lux == 0.0, "{child:?} {at:?} {lux} {expected:?}");
                if lux == 0.0 {
                    dark += 1;
                    continue;
                }
                assert_eq!(lux < 0.0, expected.is_unresolved, "{child:?} {at:?}");
                compared += 1;
                let toward = child.mean - view.position;
                below += u32::from(view.normal.dot(toward) < 0.0);
                behind += u32::from(child.length > 0.5 && child.axis.dot(toward) > 0.0);
                // Positions round with the coordinates.
                let size = child.min.abs().max(child.max.abs()).max(view.position.abs()).element_sum();
                let near = if child.variance > 0.0 { expected.gap.min(toward.length()) } else { toward.length() };
                let magnified = expected.condition * (1.0 + size / near);
                let error = (lux.abs() / expected.lux - 1.0).abs() / ROUNDING;
                worst = worst.max(error / magnified);
                if magnified < 10.0 {
                    plain += 1;
                    worst_plain = worst_plain.max(error);
                }
            }
        }
    }
    // Measured: 1.7 and 13. The condition counts the largest term of each difference, which has few
    // roundings of its own.
    assert!(worst < 4.0 && worst_plain < 24.0 && plain > 20_000, "{worst} {worst_plain} {plain}");
    assert!(compared > 300_000 && dark > 300_000 && close < 100, "{compared} {dark} {close}");
    assert!(below > 10_000 && behind > 20_000, "{below} {behind}");
}
