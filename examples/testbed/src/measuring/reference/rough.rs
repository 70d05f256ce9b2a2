//! The walk from the root of the top level by rough estimates (docs/math.md, Shared cuts).

use super::child::Child;
use super::choice::{Below, Distribution, Tree};
use super::place::View;
use super::terms::{limited, lobe};
use girandole::glam::DVec3;
use girandole::tree::{ChildRef, WIDTH};
use std::f64::consts::PI;

/// The rough estimate of a child in lux, and whether rounding may turn one of its decisions.
fn rough(child: &Child, view: &View) -> (f64, bool) {
    let child = match &view.map {
        Some(map) => child.in_axes(map),
        None => *child,
    };
    let toward = child.mean - view.position;
    let dist = toward.length().max(1.0e-15);
    let variance = child.variance;
    let spread = variance / (dist * dist + variance);
    let highest = view.normal.dot(child.center() - view.position) + view.normal.abs().dot(child.half());
    let mut cosine = (view.normal.dot(toward) / dist).max(0.002) + 0.25 * spread;
    if highest <= 0.0 {
        cosine *= 0.01;
    }
    if view.normal == DVec3::ZERO {
        cosine = 1.0;
    }
    let facing = -child.axis.dot(toward) / dist;
    // How far inside its cap and its range the place is.
    let in_cap = child.half_angle.map_or(1.0, |angle| 4.0 * spread + 1.0e-4 + facing - angle.cos());
    let in_range = child.range.map_or(1.0, |range| 1.0 - dist / range);
    let likely = if in_cap < 0.0 || in_range < 0.0 { 0.1 } else { 1.0 };
    let (lobe, _) = lobe(child.length, facing, spread);
    let lux = view.brightness * child.flux / (4.0 * PI) * lobe * likely * cosine / (dist * dist + variance);
    let rounding = 1.0e-6 * (1.0 + view.position.abs().element_sum() / dist);
    let is_close = in_cap.abs() < 10.0 * rounding
        || in_range.abs() < rounding
        || (view.normal != DVec3::ZERO && highest.abs() < rounding * dist);
    (limited(lux), is_close)
}

/// The probability of every light that has one, by a walk from a root. It knows no conditions.
pub fn walk<'a>(root: &Tree<'a>, below: &dyn Fn(u32) -> Below<'a>) -> Distribution {
    let mut found = Distribution::default();
    let mut open = vec![(*root, ChildRef::Node(0), 1.0)];
    while let Some((tree, target, pmf)) = open.pop() {
        match target {
            ChildRef::Node(node) => {
                let record = &tree.nodes[node as usize];
                let children: Vec<_> = (0..WIDTH).filter_map(|slot| Child::of(record, slot)).collect();
                let weights: Vec<_> = children.iter().map(|child| rough(child, &tree.view)).collect();
                found.is_close |= weights.iter().any(|(_, is_close)| *is_close);
                let total: f64 = weights.iter().map(|(lux, _)| lux).sum();
                let each = children.iter().zip(&weights);
                open.extend(each.map(|(child, (lux, _))| (tree, child.target, pmf * lux / total)));
            }
            ChildRef::Leaf(light) if tree.instance.is_some() => found.lights.push(((tree.instance, light), pmf)),
            ChildRef::Leaf(leaf) => open.extend(below(leaf).map(|(tree, target)| (tree, target, pmf))),
            _ => unreachable!("this version has no others"),
        }
    }
    found
}
