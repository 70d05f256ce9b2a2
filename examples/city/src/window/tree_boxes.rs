//! The boxes of light trees, at one level of both trees.

use super::colors::{Rgb, TOP_LEVEL, WAITING, viridis};
use super::overlay::{Overlay, corners, is_in_front};
use girandole::cluster::Aabb;
use girandole::glam::{Mat3, Vec3};
use girandole::tree::{ChildRef, Node};
use girandole::{InstanceKey, LightWorld, TreeKey};
use std::collections::HashMap;
use testbed::render::shading::View;

/// Instances that are drawn at most, those nearest to the camera.
const MAX_INSTANCES: usize = 4000;
/// Boxes that are drawn at most.
const MAX_BOXES: usize = 20_000;
/// Updates since the last build at which a box is yellow. A new tree is violet.
pub const OLD: f32 = 256.0;
/// The looseness at which a box is yellow. The tree of a fresh build is blue.
pub const LOOSE: f32 = 4.0;

/// The colour of a tree by a logarithmic share of [`LOOSE`]: without the violet that is hard to see on black.
pub fn loose_color(share: f32) -> Rgb {
    viridis(0.3 + 0.7 * share.max(0.0))
}

/// What the colours of trees mean.
pub enum TreeColors<'a> {
    /// Their age, and whether they wait for a rebuild.
    Age,
    /// How loose they are: see [`looseness`](super::looseness::looseness).
    Looseness(&'a HashMap<TreeKey, f32>),
}

impl TreeColors<'_> {
    fn of(&self, world: &LightWorld, tree: TreeKey) -> Option<Rgb> {
        match self {
            Self::Age => {
                let state = world.rebuild_state(tree)?;
                let share = (1.0 + state.age as f32).log2() / OLD.log2();
                Some(if state.waited.is_some() { WAITING } else { viridis(share) })
            }
            Self::Looseness(trees) => {
                let ratio = trees.get(&tree).copied().unwrap_or(1.0);
                Some(loose_color(ratio.log2() / LOOSE.log2()))
            }
        }
    }
}

/// The map of an instance to the world relative to its origin, in which cameras are.
pub fn map(world: &LightWorld, instance: InstanceKey) -> Option<(Mat3, Vec3)> {
    let placement = world.instance(instance)?.placement;
    Some((placement.linear, (placement.translation - world.origin()).as_vec3()))
}

/// The instances with lights that are in front of the camera, the nearest first.
pub fn in_front(world: &LightWorld, view: &View) -> Vec<InstanceKey> {
    let of = |instance: InstanceKey| {
        let bounds = world.tree(world.instance(instance)?.tree)?.cluster().aabb;
        let (linear, translation) = map(world, instance)?;
        let corners = corners(&bounds, &linear, translation);
        let distance_sq = (corners.iter().sum::<Vec3>() / 8.0 - view.eye).length_squared();
        (!bounds.is_empty() && is_in_front(view, &corners)).then_some((distance_sq, instance))
    };
    let is_sky = |instance: &InstanceKey| world.sky().is_some_and(|(sky, _)| sky == *instance);
    let mut found: Vec<_> = world.instances().filter(|instance| !is_sky(instance)).filter_map(of).collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    found.truncate(MAX_INSTANCES);
    found.into_iter().map(|(_, instance)| instance).collect()
}

/// Boxes by level: 0 is the box of each instance, 1 and more are the boxes of its nodes and lights so far
/// below its root, and -1 and less those of the top level, from its lowest nodes up to its root. Of
/// instances, those nearest to the camera.
pub fn tree_boxes(world: &LightWorld, view: &View, level: i32, colors: &TreeColors) -> Overlay {
    let mut overlay = Overlay::default();
    if level < 0 {
        let levels = node_levels(world.top_nodes());
        let boxes = &levels[levels.len().saturating_sub(level.unsigned_abs() as usize)];
        let world_boxes = boxes.iter().take(MAX_BOXES).map(|bounds| corners(bounds, &Mat3::IDENTITY, Vec3::ZERO));
        world_boxes.for_each(|corners| overlay.edges(view, &corners, TOP_LEVEL));
        return overlay;
    }
    let mut left = MAX_BOXES;
    for instance in in_front(world, view) {
        let Some(key) = world.instance(instance).map(|i| i.tree) else { continue };
        let (Some(tree), Some((linear, translation))) = (world.tree(key), map(world, instance)) else { continue };
        let Some(color) = colors.of(world, key) else { continue };
        let boxes = if level == 0 { vec![tree.cluster().aabb] } else { boxes_below(tree.nodes(), level as usize) };
        for bounds in boxes.into_iter().take(left) {
            overlay.edges(view, &corners(&bounds, &linear, translation), color);
            left -= 1;
        }
    }
    overlay
}

/// The children of a node, with their boxes. Dark ones have none.
fn children(node: &Node) -> impl Iterator<Item = (ChildRef, Aabb)> {
    let child = |slot| Some((node.child(slot)?, node.cluster(slot).aabb));
    (0..node.count()).filter_map(child).filter(|(_, bounds)| !bounds.is_empty())
}

/// The boxes of nodes and lights that are `depth` steps below the root.
fn boxes_below(nodes: &[Node], depth: usize) -> Vec<Aabb> {
    let mut parents: Vec<&Node> = nodes.first().into_iter().collect();
    for _ in 1..depth {
        let below = |(child, _)| if let ChildRef::Node(index) = child { nodes.get(index as usize) } else { None };
        parents = parents.into_iter().flat_map(children).filter_map(below).collect();
    }
    parents.into_iter().flat_map(children).map(|(_, bounds)| bounds).collect()
}

/// The boxes of nodes alone, by depth: first that of the root.
fn node_levels(nodes: &[Node]) -> Vec<Vec<Aabb>> {
    let root = boxes_below(nodes, 1).into_iter().fold(Aabb::EMPTY, |all, one| all.union(&one));
    let mut levels = vec![if root.is_empty() { Vec::new() } else { vec![root] }];
    let mut parents: Vec<&Node> = nodes.first().into_iter().collect();
    loop {
        let below = |(child, bounds)| match child {
            ChildRef::Node(index) => Some((nodes.get(index as usize)?, bounds)),
            _ => None,
        };
        let found: Vec<(&Node, Aabb)> = parents.into_iter().flat_map(children).filter_map(below).collect();
        if found.is_empty() {
            return levels;
        }
        levels.push(found.iter().map(|(_, bounds)| *bounds).collect());
        parents = found.into_iter().map(|(node, _)| node).collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use girandole::glam::DVec3;
    use girandole::{FrameBudget, Light, LightTree, Placement, Policy};
    use testbed::scene::Camera;

    fn view() -> View {
        View::new(&Camera { eye: Vec3::ZERO, target: Vec3::NEG_Z, vertical_fov: 1.0, up: Vec3::Y }, 200, 100)
    }

    /// Instances of a tree with lights at opposite corners of a cube of two metres.
    fn world(places: &[DVec3]) -> LightWorld {
        let mut world = LightWorld::new();
        let lights = [-1.0, 1.0].map(|x| Light::point(Vec3::splat(x), Vec3::ONE));
        let tree = world.add_tree(LightTree::new(lights.to_vec()).expect("valid lights"));
        for place in places {
            world.add_instance(tree, Placement::at(*place), Policy::Budgeted).expect("valid placements");
        }
        world.update(FrameBudget::UNLIMITED);
        world
    }

    fn boxes(world: &LightWorld, level: i32) -> Overlay {
        tree_boxes(world, &view(), level, &TreeColors::Age)
    }

    #[test]
    fn a_box_has_twelve_edges_around_its_middle() {
        let mut world = world(&[DVec3::new(0.0, 0.0, -10.0)]);
        let overlay = boxes(&world, 0);
        assert_eq!(overlay.lines.len(), 12);
        // The nearest face is 9 m away, where half of the picture's height is 9 tan(0.5) m.
        let half = 0.5 / (9.0 * 0.5f32.tan());
        let highest = overlay.lines.iter().flat_map(|line| line.ends).map(|end| end.y).fold(f32::MAX, f32::min);
        assert!((highest - (0.5 - half)).abs() < 1e-5, "{highest}");
        // One update has passed: an eighth of the way from 1 to 256 on a logarithmic scale.
        assert!(overlay.lines.iter().all(|line| line.color == viridis(0.125)));
        // The camera is relative to the origin, as all of the world is.
        let far = DVec3::new(1024.0e4, 0.0, 0.0);
        let key = world.instances().next().expect("an instance");
        world.set_origin_near(far).expect("within the limits");
        world.move_instance(key, Placement::at(far - DVec3::Z * 10.0)).expect("near the origin");
        assert_eq!(boxes(&world, 0).lines, overlay.lines);
    }

    #[test]
    fn boxes_behind_the_camera_are_left_out_and_those_around_it_are_cut() {
        let behind = world(&[DVec3::new(0.0, 0.0, 10.0)]);
        assert!(boxes(&behind, 0).lines.is_empty());
        let around = world(&[DVec3::new(0.0, 0.0, 0.5)]);
        let lines = boxes(&around, 0).lines;
        // The far face and the four edges toward it.
        assert_eq!(lines.len(), 8);
        assert!(lines.iter().flat_map(|line| line.ends).all(|end| end.is_finite()));
    }

    #[test]
    fn levels_go_from_lights_up_to_the_root_of_the_top_level() {
        let places: Vec<DVec3> = (0..100).map(|i| DVec3::new(f64::from(i % 10), f64::from(i / 10), -30.0)).collect();
        let world = world(&places);
        let count = |level| boxes(&world, level).lines.len() / 12;
        // Two lights in each instance.
        assert_eq!([count(0), count(1), count(2)], [100, 200, 0]);
        // Each node of the top level has up to eight children.
        let below_root = (-8..0).map(count).collect::<Vec<_>>();
        assert!((13..=50).contains(&below_root[7]) && below_root[0] == 1, "{below_root:?}");
        assert!(boxes(&world, -1).lines.iter().all(|line| line.color == TOP_LEVEL));
        assert_eq!(tree_boxes(&LightWorld::new(), &view(), -1, &TreeColors::Age).lines.len(), 0);
    }

    #[test]
    fn loose_trees_are_yellow() {
        let world = world(&[DVec3::new(0.0, 0.0, -10.0)]);
        let key = world.trees().next().expect("a tree");
        for (ratio, share) in [(1.0, 0.0), (2.0, 0.5), (9.0, 1.0)] {
            let overlay = tree_boxes(&world, &view(), 0, &TreeColors::Looseness(&HashMap::from([(key, ratio)])));
            assert!(overlay.lines.iter().all(|line| line.color == loose_color(share)), "{ratio}");
        }
    }
}
