//! The library against the reference. Bounds are those of the measured errors, rounded up, with the
//! reason beside them.

mod behind;
mod caps;
mod gloss;
mod importance;
mod merge;
mod pmf;
mod resolution;
mod segments;

use glam::{DVec3, Mat3, Quat, Vec3};

use crate::light::Light;
use crate::shading::importance::{LocalShadingPoint, child_importances};
use crate::shading::shading_point::ShadingPoint;
use crate::tree::testing::Rng;
use crate::tree::{LEAF, LightTree, WIDTH};
use testbed::measuring::reference::child::Child;
use testbed::measuring::reference::importance::importance;
use testbed::measuring::reference::place::View;
use testbed::measuring::reference::terms::Importance;

/// A number whose logarithm is uniform between those of powers of ten.
fn size(rng: &mut Rng, least: f32, most: f32) -> f32 {
    10.0_f32.powf(rng.between(least, most))
}

fn direction(rng: &mut Rng) -> Vec3 {
    loop {
        let v = rng.position(1.0);
        if v.length_squared() > 1.0e-3 && v.length_squared() < 1.0 {
            return v.normalize();
        }
    }
}

fn turn(rng: &mut Rng) -> Mat3 {
    Mat3::from_quat(Quat::from_axis_angle(direction(rng), rng.between(0.0, 6.0)))
}

/// A light of any shape in a cube, about a tenth of it large. One of eight has a range.
fn light(rng: &mut Rng, cube: f32, emission: f32) -> Light {
    let (at, emission) = (rng.position(cube), Vec3::new(rng.unit(), rng.unit(), rng.unit()) * emission);
    let mut edge = || direction(rng) * (cube * rng.between(0.005, 0.05));
    let (u, v) = (edge(), edge());
    let light = match rng.below(6) {
        0 => Light::point(at, emission),
        1 => {
            let outer = rng.between(0.3, 3.0);
            Light::spot(at, direction(rng), outer * rng.unit(), outer, emission)
        }
        2 => Light::rectangle(at, u, v, emission),
        3 => Light::triangle([at, at + u, at + v], emission),
        4 => Light::triangle([at, at + u, at + v], emission).two_sided(),
        _ => Light::sphere(at, cube * rng.between(0.001, 0.03), emission),
    };
    if rng.below(8) == 0 { light.with_range(cube * rng.between(0.3, 3.0)) } else { light }
}

/// A shading point in a cube, one of five in a volume.
fn shading_point(rng: &mut Rng, cube: f32) -> ShadingPoint {
    let position = rng.position(cube);
    if rng.below(5) == 0 { ShadingPoint::volume(position) } else { ShadingPoint::surface(position, direction(rng)) }
}

/// A segment of a ray through a cube.
fn segment(rng: &mut Rng, cube: f32) -> ShadingPoint {
    let length = cube * size(rng, -3.0, 1.0);
    ShadingPoint::segment(rng.position(cube), direction(rng), length)
}

/// The view of a shading point in the space in which it is given.
fn view(at: &ShadingPoint) -> View {
    if at.segment == Vec3::ZERO {
        return View::of(exact(at.position), exact(at.normal));
    }
    View::along(exact(at.position), 0.5 * exact(at.segment))
}

/// What the library and the reference say of every child of every node of a tree: the importance,
/// the child, and the importance in f64. A child that has no flux in the node must have none.
fn both_importances(tree: &LightTree, at: &ShadingPoint) -> Vec<(f64, Child, Importance)> {
    let (local, view) = (LocalShadingPoint::of(at), view(at));
    let mut all = Vec::new();
    for node in tree.nodes() {
        let ours = child_importances(node, &local);
        let record = bytemuck::cast_ref(node);
        for slot in 0..WIDTH {
            let Some(child) = Child::of(record, slot) else {
                assert_eq!(ours.importance[slot], 0.0);
                continue;
            };
            let expected = importance(&child, record, &view, node.children[slot] & LEAF != 0);
            all.push((f64::from(ours.importance[slot]), child, expected));
        }
    }
    all
}

fn exact(v: Vec3) -> DVec3 {
    v.as_dvec3()
}
