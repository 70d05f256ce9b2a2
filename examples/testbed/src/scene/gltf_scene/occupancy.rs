//! A coarse grid of solid cells. It tells how far a view is clear without a hierarchy over the
//! triangles.

use girandole::glam::Vec3;

/// Edge of a cell, metres.
const CELL: f32 = 0.5;
/// Most cells along a side; nothing beyond them counts as solid.
const MAX_CELLS: f32 = 400.0;

/// The cells of a box, each solid or empty.
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

    /// The index of the cell at a point, if it lies in the box.
    fn cell(&self, at: Vec3) -> Option<usize> {
        let place = (at - self.low) / CELL;
        let inside = place.to_array().into_iter().zip(self.size).all(|(p, size)| p >= 0.0 && p < size as f32);
        let [x, y, z] = place.to_array().map(|p| p as usize);
        inside.then(|| (z * self.size[1] + y) * self.size[0] + x)
    }

    /// Marks the cells that a triangle touches, to within a cell.
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
        // Only the longest edge is halved: halving all edges would cut thin triangles into four
        // times as many pieces.
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

    /// The distance from `eye` to the first solid cell along a unit direction, at most `reach`, in
    /// metres.
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
    fn a_wall_limits_the_clear_distance() {
        let mut grid = Occupancy::new(Vec3::ZERO, vec3(20.0, 4.0, 20.0));
        grid.add([vec3(10.0, -50.0, -50.0), vec3(10.0, -50.0, 50.0), vec3(10.0, 80.0, 0.0)]);
        let eye = vec3(2.0, 2.0, 10.0);
        assert!((grid.clear_distance(eye, Vec3::X, 30.0) - 8.0).abs() < 0.6);
        assert_eq!(grid.clear_distance(eye, Vec3::NEG_X, 30.0), 30.0);
    }
}
