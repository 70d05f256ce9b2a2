//! Points in the plane of the ground, and a grid of square cells to find those near a position.

use std::collections::BTreeMap;

use girandole::glam::{DVec2, Vec2, vec2};

/// Metres east and north to x and z.
pub fn to_plane(at: DVec2) -> Vec2 {
    vec2(at.x as f32, -at.y as f32)
}

/// A line in metres east and north to one in x and z, relative to `shift`.
pub fn plane_line(line: &[DVec2], shift: DVec2) -> Vec<Vec2> {
    line.iter().map(|at| to_plane(*at - shift)).collect()
}

/// Points in square cells.
pub struct Grid {
    /// Edge of a cell, metres.
    cell: f32,
    points: Vec<Vec2>,
    /// Indices of the points in each cell.
    cells: BTreeMap<(i32, i32), Vec<u32>>,
}

impl Grid {
    /// Sorts points into cells.
    pub fn new(points: Vec<Vec2>, cell: f32) -> Self {
        let mut cells: BTreeMap<(i32, i32), Vec<u32>> = BTreeMap::new();
        for (index, point) in points.iter().enumerate() {
            cells.entry(key(*point, cell)).or_default().push(index as u32);
        }
        Self { cell, points, cells }
    }

    /// Indices of the points within `radius`, which must not exceed the edge of a cell.
    pub fn near(&self, at: Vec2, radius: f32) -> impl Iterator<Item = usize> {
        let (x, z) = key(at, self.cell);
        let around = (-1..=1).flat_map(move |dx| (-1..=1).map(move |dz| (x + dx, z + dz)));
        let inside = around.filter_map(|cell| self.cells.get(&cell)).flatten().map(|&point| point as usize);
        #[cfg(test)]
        let inside = inside.inspect(|_| LOOKED_AT.set(LOOKED_AT.get() + 1));
        inside.filter(move |&point| self.points[point].distance(at) <= radius)
    }

    /// The mean of the points in the cell with the most points, and their number.
    pub fn densest(&self) -> Option<(Vec2, usize)> {
        let (_, points) = self.cells.iter().max_by_key(|(_, points)| points.len())?;
        let sum: Vec2 = points.iter().map(|&point| self.points[point as usize]).sum();
        Some((sum / points.len() as f32, points.len()))
    }
}

#[cfg(test)]
thread_local! {
    /// How many points the grids of this thread have looked at.
    pub static LOOKED_AT: std::cell::Cell<usize> = const { std::cell::Cell::new(0) };
}

/// One point of each cell, and for each point the index of the one of its cell.
pub fn thin(points: &[Vec2], cell: f32) -> (Vec<Vec2>, Vec<usize>) {
    let (mut kept, mut cells) = (Vec::new(), BTreeMap::new());
    let indices = points.iter().map(|&point| {
        *cells.entry(key(point, cell)).or_insert_with(|| {
            kept.push(point);
            kept.len() - 1
        })
    });
    let indices = indices.collect();
    (kept, indices)
}

/// The cell of a point, for cells with an edge of `cell` metres.
pub fn key(point: Vec2, cell: f32) -> (i32, i32) {
    let cell = (point / cell).floor();
    (cell.x as i32, cell.y as i32)
}
