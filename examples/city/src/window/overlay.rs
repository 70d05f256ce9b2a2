//! Drawings over a darkened picture: lines in space, as a camera sees them.

use super::colors::Rgb;
use girandole::cluster::Aabb;
use girandole::glam::{Mat3, Vec2, Vec3};
use testbed::render::shading::View;

/// What lies nearer to the camera's plane is cut off, metres.
const NEAR: f32 = 0.05;

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

/// The corners of a box after a map to the world: bit `k` of an index tells the side along axis `k`.
pub fn corners(bounds: &Aabb, linear: &Mat3, translation: Vec3) -> [Vec3; 8] {
    std::array::from_fn(|i| {
        let pick = |axis: usize| if i >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] };
        *linear * Vec3::new(pick(0), pick(1), pick(2)) + translation
    })
}

/// A point in the space of the view: to the right, up, and in depth.
pub fn seen(view: &View, point: Vec3) -> Vec3 {
    let [right, up] = [view.right, view.up].map(|axis| axis / axis.length_squared());
    let toward = point - view.eye;
    Vec3::new(toward.dot(right), toward.dot(up), toward.dot(view.forward))
}

/// Whether some of these points are in front of the camera.
pub fn is_in_front(view: &View, points: &[Vec3]) -> bool {
    points.iter().any(|point| seen(view, *point).z > NEAR)
}

/// The place in the picture of a point in the space of the view, which is in front of the camera.
fn place(point: Vec3) -> Vec2 {
    (Vec2::new(point.x, -point.y) / point.z + 1.0) * 0.5
}

impl Overlay {
    /// Draws a line between two points of the world, without the part behind the camera.
    pub fn line(&mut self, view: &View, ends: [Vec3; 2], color: Rgb) {
        let [a, b] = ends.map(|end| seen(view, end));
        let cut =
            |from: Vec3, to: Vec3| if from.z < NEAR { from.lerp(to, (NEAR - from.z) / (to.z - from.z)) } else { from };
        if a.z.max(b.z) <= NEAR {
            return;
        }
        let ends = [cut(a, b), cut(b, a)].map(place);
        if ends.iter().all(|end| end.is_finite()) {
            self.lines.push(Line { ends, color });
        }
    }

    /// Draws lines through some points, and back to the first.
    pub fn outline(&mut self, view: &View, points: &[Vec3], color: Rgb) {
        let next = points.iter().cycle().skip(1);
        points.iter().zip(next).for_each(|(a, b)| self.line(view, [*a, *b], color));
    }

    /// Draws the edges of a box with these [`corners`].
    pub fn edges(&mut self, view: &View, corners: &[Vec3; 8], color: Rgb) {
        for (from, corner) in corners.iter().enumerate() {
            let edges = [1, 2, 4].into_iter().filter(|bit| from & bit == 0);
            edges.for_each(|bit| self.line(view, [*corner, corners[from | bit]], color));
        }
    }

    /// Draws a cross that has the same size at any distance: `half` are shares of the picture's width and
    /// height.
    pub fn cross(&mut self, view: &View, point: Vec3, half: Vec2, color: Rgb) {
        let point = seen(view, point);
        let middle = place(point);
        if point.z > NEAR && middle.is_finite() {
            let arms = [Vec2::new(half.x, 0.0), Vec2::new(0.0, half.y)];
            self.lines.extend(arms.map(|arm| Line { ends: [middle - arm, middle + arm], color }));
        }
    }
}
