//! Drawings over a darkened picture: the boxes of light trees.

use super::colors::{Rgb, WAITING, viridis};
use girandole::glam::{Vec2, Vec3};
use girandole::{InstanceKey, LightWorld};
use testbed::render::shading::View;

/// Instances that are drawn at most, those nearest to the camera.
const MAX_INSTANCES: usize = 4000;
/// What lies nearer to the camera's plane is cut off, metres.
const NEAR: f32 = 0.05;
/// Updates since the last build at which a box is yellow. A new tree is violet.
pub const OLD: f32 = 256.0;

/// A line in the picture. Positions are shares of its width and height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Both ends.
    pub ends: [Vec2; 2],
    /// Its colour.
    pub color: Rgb,
}

/// What is drawn over a picture.
#[derive(Clone, Debug, Default)]
pub struct Overlay {
    /// Lines.
    pub lines: Vec<Line>,
}

/// The corners of an instance's box in the space of the view: to the right, up, and in depth.
fn corners(world: &LightWorld, view: &View, instance: InstanceKey) -> Option<[Vec3; 8]> {
    let tree = world.tree(world.instance_tree(instance)?)?;
    let placement = world.placement(instance)?;
    let bounds = tree.cluster().aabb;
    if tree.light_count() == 0 || !bounds.min.is_finite() {
        return None;
    }
    let [right, up] = [view.right, view.up].map(|axis| axis / axis.length_squared());
    Some(std::array::from_fn(|i| {
        let pick = |axis: usize| if i >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] };
        let corner = placement.linear * Vec3::new(pick(0), pick(1), pick(2)) + placement.translation.as_vec3();
        let toward = corner - view.eye;
        Vec3::new(toward.dot(right), toward.dot(up), toward.dot(view.forward))
    }))
}

/// The place in the picture of a point in front of the camera.
fn place(point: Vec3) -> Vec2 {
    (Vec2::new(point.x, -point.y) / point.z + 1.0) * 0.5
}

/// A line between two points, without the part behind the camera; `None` if nothing is left.
fn line(a: Vec3, b: Vec3, color: Rgb) -> Option<Line> {
    let cut =
        |from: Vec3, to: Vec3| if from.z < NEAR { from.lerp(to, (NEAR - from.z) / (to.z - from.z)) } else { from };
    if a.z.max(b.z) <= NEAR {
        return None;
    }
    let ends = [cut(a, b), cut(b, a)].map(place);
    ends.iter().all(|end| end.is_finite()).then_some(Line { ends, color })
}

/// The instances with boxes that are in front of the camera, the nearest first.
fn in_front(world: &LightWorld, view: &View) -> Vec<(InstanceKey, [Vec3; 8])> {
    let mut found: Vec<(f32, InstanceKey, [Vec3; 8])> = world
        .instances()
        .filter_map(|instance| Some((instance, corners(world, view, instance)?)))
        .filter(|(_, corners)| corners.iter().any(|corner| corner.z > NEAR))
        .map(|(instance, corners)| ((corners.iter().sum::<Vec3>() / 8.0).length_squared(), instance, corners))
        .collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    found.truncate(MAX_INSTANCES);
    found.into_iter().map(|(_, instance, corners)| (instance, corners)).collect()
}

/// The boxes of the `MAX_INSTANCES` nearest instances in front of the camera: violet after a
/// build, yellow [`OLD`] updates later, and red while their tree waits for a rebuild.
pub fn tree_boxes(world: &LightWorld, view: &View) -> Overlay {
    let mut overlay = Overlay::default();
    for (instance, corners) in in_front(world, view) {
        let state = world.instance_tree(instance).and_then(|tree| world.rebuild_state(tree));
        let Some(state) = state else { continue };
        let share = (1.0 + state.age as f32).log2() / OLD.log2();
        let color = if state.waited.is_some() { WAITING } else { viridis(share) };
        for (from, corner) in corners.iter().enumerate() {
            let edges = [1, 2, 4].into_iter().filter(|bit| from & bit == 0);
            overlay.lines.extend(edges.filter_map(|bit| line(*corner, corners[from | bit], color)));
        }
    }
    overlay
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
    fn world(places: &[DVec3]) -> (LightWorld, Vec<InstanceKey>) {
        let mut world = LightWorld::new();
        let lights = [-1.0, 1.0].map(|x| Light::point(Vec3::splat(x), Vec3::ONE));
        let tree = world.add_tree(LightTree::new(lights.to_vec()).expect("valid lights"));
        let add = |place: &DVec3| world.add_instance(tree, Placement::at(*place), Policy::Budgeted);
        let instances = places.iter().map(add).collect::<Result<_, _>>().expect("valid placements");
        world.update(FrameBudget::UNLIMITED);
        (world, instances)
    }

    #[test]
    fn a_box_has_twelve_edges_around_its_middle() {
        let (world, _) = world(&[DVec3::new(0.0, 0.0, -10.0)]);
        let overlay = tree_boxes(&world, &view());
        assert_eq!(overlay.lines.len(), 12);
        // The nearest face is 9 m away, where half of the picture's height is 9 tan(0.5) m.
        let half = 0.5 / (9.0 * 0.5f32.tan());
        let highest = overlay.lines.iter().flat_map(|line| line.ends).map(|end| end.y).fold(f32::MAX, f32::min);
        assert!((highest - (0.5 - half)).abs() < 1e-5, "{highest}");
        // One update has passed: an eighth of the way from 1 to 256 on a logarithmic scale.
        assert!(overlay.lines.iter().all(|line| line.color == viridis(0.125)));
    }

    #[test]
    fn boxes_behind_the_camera_are_left_out_and_those_around_it_are_cut() {
        let (behind, _) = world(&[DVec3::new(0.0, 0.0, 10.0)]);
        assert!(tree_boxes(&behind, &view()).lines.is_empty());
        let (around, _) = world(&[DVec3::new(0.0, 0.0, 0.5)]);
        let lines = tree_boxes(&around, &view()).lines;
        // The far face and the four edges toward it.
        assert_eq!(lines.len(), 8);
        assert!(lines.iter().flat_map(|line| line.ends).all(|end| end.is_finite()));
    }
}
