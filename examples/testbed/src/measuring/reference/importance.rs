//! The importance of a child (docs/math.md, Importance).

use super::child::Child;
use super::place::View;
use super::terms::Importance;
use super::{point, segment};
use girandole::glam::DVec3;
use girandole::tree::Node;

/// The importance of a child of a node.
pub fn importance(child: &Child, node: &Node, view: &View, is_light: bool) -> Importance {
    let of = if view.segment == DVec3::ZERO { point::importance } else { segment::importance };
    match &view.map {
        Some(map) => of(&child.in_axes(map), node, view, is_light),
        None => of(child, node, view, is_light),
    }
}
