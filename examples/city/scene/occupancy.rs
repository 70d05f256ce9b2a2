//! A coarse grid of what is solid, to ask how far one sees without building a hierarchy over the triangles first.

use girandole::glam::Vec3;

/// Edge of a cell, metres.
const CELL: f32 = 0.5;
/// No more than this many cells a side: beyond, nothing is solid.
const MAX_CELLS: f32 = 400.0;

/// Solid cells of a box.
pub struct Occupancy {
    low: Vec3,
    size: [usize; 3],
    solid: Vec<bool>,
}

impl Occupancy {
    /// An empty grid over a box.
    pub fn new(low: Vec3, high: Vec3) -> Self {
        let size = ((high - low) / CELL).ceil().clamp(Vec3::ONE, Vec3::splat(MAX_CELLS));
        let size = size.to_array().map(|cells| cells as usize);
        Self { low, size, solid: vec![false; size.iter().product()] }
    }

    fn cell(&self, at: Vec3) -> Option<usize> {
        let place = (at - self.low) / CELL;
        let inside = place.to_array().into_iter().zip(self.size).all(|(p, size)| p >= 0.0 && p < size as f32);
        let [x, y, z] = place.to_array().map(|p| p as usize);
        inside.then(|| (z * self.size[1] + y) * self.size[0] + x)
    }

    /// Marks what a triangle touches, to within a cell.
    pub fn add(&mut self, [a, b, c]: [Vec3; 3]) {
        let high = self.low + Vec3::from(self.size.map(|cells| cells as f32)) * CELL;
        if a.max(b).max(c).cmplt(self.low).any() || a.min(b).min(c).cmpgt(high).any() {
            return;
        }
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        if longest <= CELL {
            for point in [a, b, c, (a + b + c) / 3.0] {
                if let Some(cell) = self.cell(point) {
                    self.solid[cell] = true;
                }
            }
            return;
        }
        // The longest edge is halved, so that thin triangles do not take four times the pieces.
        let [a, b, c] = if longest == a.distance(b) {
            [a, b, c]
        } else if longest == b.distance(c) {
            [b, c, a]
        } else {
            [c, a, b]
        };
        let middle = (a + b) * 0.5;
        if middle.is_finite() && middle != a && middle != b {
            self.add([a, middle, c]);
            self.add([middle, b, c]);
        }
    }

    /// How far a ray goes before it meets a solid cell, at most `reach`.
    pub fn clear_distance(&self, eye: Vec3, direction: Vec3, reach: f32) -> f32 {
        let step = CELL * 0.5;
        let steps = (reach / step) as usize;
        let is_solid = |i: &usize| self.cell(eye + direction * (*i as f32 * step)).is_some_and(|cell| self.solid[cell]);
        (0..steps).find(is_solid).map_or(reach, |i| i as f32 * step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use girandole::glam::vec3;

    #[test]
    fn walls_end_views() {
        let mut grid = Occupancy::new(Vec3::ZERO, vec3(20.0, 4.0, 20.0));
        grid.add([vec3(10.0, -50.0, -50.0), vec3(10.0, -50.0, 50.0), vec3(10.0, 80.0, 0.0)]);
        let eye = vec3(2.0, 2.0, 10.0);
        assert!((grid.clear_distance(eye, Vec3::X, 30.0) - 8.0).abs() < 0.6);
        assert_eq!(grid.clear_distance(eye, Vec3::NEG_X, 30.0), 30.0);
    }
}
