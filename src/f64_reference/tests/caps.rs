//! Caps at the exact limit of what they prove.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};

use super::{direction, exact};
use crate::cluster::Aabb;
use crate::cluster::Cluster;
use crate::cluster::cone::CAP_PADDING;
use crate::f64_reference::merge::angle;
use crate::shading::importance::{LocalShadingPoint, child_importances};
use crate::shading::shading_point::ShadingPoint;
use crate::tree::testing::Rng;
use crate::tree::{LEAF, Node, WideCluster};
use testbed::measuring::reference::child::Child;

/// A node with one child, which has this box and cap.
fn node_of(half: Vec3, axis: Vec3, half_angle: f32) -> Node {
    let cluster = Cluster {
        aabb: Aabb { min: -half, max: half },
        flux: 1.0,
        mean: Vec3::ZERO,
        variance: half.length_squared() / 3.0,
        axis: 0.9 * axis,
        cos_half_angle: half_angle.cos() - CAP_PADDING,
        range: f32::INFINITY,
        ..Cluster::EMPTY
    };
    let mut wide = WideCluster::EMPTY;
    wide.set(0, &cluster);
    let mut node = Node::EMPTY;
    node.pack(&wide, &wide.merged().cluster.aabb, 1);
    node.children[0] = LEAF;
    node
}

#[test]
fn caps_prove_nothing_up_to_their_limit_and_darkness_beyond_the_margin() {
    let mut rng = Rng(540);
    let (mut lit, mut dark, mut contributing) = (0, 0, 0);
    for round in 0..4000 {
        let half_angle = [1.0e-3, 0.01, 0.1, 0.5, 1.0, 1.5, 1.6, 2.2, 3.0, PI as f32 - 0.1][round % 10];
        let half = Vec3::new(rng.unit(), rng.unit(), rng.unit()) * [0.0, 1.0, 1.0, 0.01][round / 10 % 4];
        let axis = direction(&mut rng);
        let node = node_of(half, axis, half_angle);
        let Some(child) = Child::of(&bytemuck::cast(node), 0) else { panic!("a lit child") };
        // From the packed cap, which is wider than the one that was given.
        let Some(packed) = child.half_angle else { continue };
        let (radius, dist) = (child.half().length(), f64::from(rng.between(2.0, 50.0)));
        let side = direction(&mut rng).as_dvec3().cross(child.axis).normalize();
        // The sphere about the box is seen under this angle from the shading point. Beyond a right
        // angle the nearest direction of the cap no longer passes the sphere.
        let limit = packed + (radius / dist).asin();
        for beyond in [-1.0e-2, -1.0e-4, -1.0e-6, 1.0e-6, 1.0e-4, 1.0e-2] {
            let turned = limit + beyond;
            if turned >= PI {
                continue;
            }
            let at = child.center() + (child.axis * turned.cos() + side * turned.sin()) * dist;
            let local = LocalShadingPoint::of(&ShadingPoint::volume(at.as_vec3()));
            let is_dark = child_importances(&node, &local).importance[0] == 0.0;
            if beyond < 0.0 {
                assert!(!is_dark, "{half_angle} {half} {beyond}");
                lit += 1;
            }
            // The margin is 1e-3 of the distance, on the sine of the angle beyond the cap.
            let margin = 1.5e-3 + 1.0e-5;
            if beyond > margin / (radius / dist).asin().cos() {
                assert!(is_dark, "{half_angle} {half} {beyond}");
                dark += 1;
            }
            // Whatever reaches the point from a corner, along a direction of the cap as it was given,
            // is not dark.
            for corner in 0..8 {
                let sign = DVec3::from([0, 1, 2].map(|k| if corner >> k & 1 == 0 { -1.0 } else { 1.0 }));
                let reaches = angle(exact(axis), at - exact(half) * sign) <= f64::from(half_angle);
                assert!(!(reaches && is_dark), "{half_angle} {half} {beyond}");
                contributing += u32::from(reaches);
            }
        }
    }
    assert!(lit > 5000 && dark > 2000 && contributing > 1000, "{lit} {dark} {contributing}");
}
