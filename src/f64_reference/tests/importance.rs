//! Importances of the children of random nodes.

use glam::Vec3;

use super::{direction, exact, light, size};
use crate::f64_reference::ROUNDING;
use crate::f64_reference::formulas::child::Child;
use crate::f64_reference::formulas::importance::importance;
use crate::f64_reference::formulas::place::View;
use crate::importance::{LocalShadingPoint, child_importances};
use crate::shading_point::ShadingPoint;
use crate::tree::testing::Rng;
use crate::tree::{LEAF, LightTree, WIDTH};

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
            let (local, view) = (LocalShadingPoint::of(&at), View::of(exact(at.position), exact(at.normal)));
            for node in tree.nodes() {
                let ours = child_importances(node, &local);
                for slot in 0..WIDTH {
                    let Some(child) = Child::of(node, slot) else {
                        assert_eq!(ours.importance[slot], 0.0);
                        continue;
                    };
                    let expected = importance(&child, node, &view, node.targets[slot] & LEAF != 0);
                    if expected.is_close {
                        close += 1;
                        continue;
                    }
                    let lux = f64::from(ours.importance[slot]);
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
    }
    // Measured: 1.7 and 13. The condition counts the largest term of each difference, which has few
    // roundings of its own.
    assert!(worst < 4.0 && worst_plain < 24.0 && plain > 20_000, "{worst} {worst_plain} {plain}");
    assert!(compared > 300_000 && dark > 300_000 && close < 100, "{compared} {dark} {close}");
    assert!(below > 10_000 && behind > 20_000, "{below} {behind}");
}
