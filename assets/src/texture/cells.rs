//! The average of texels over triangles and rectangles. Texels are squares of one colour.

use glam::{DVec2, DVec4, Vec4};

/// A triangle whose area is below this share of the square over its longest edge has no area: that of
/// three points on a line is not exactly 0 after rounding.
const MIN_AREA_SHARE: f64 = 1e-9;
/// The height that a triangle without area is given, as a share of its longest edge.
const ADDED_HEIGHT: f64 = 1e-6;

/// What a texture shows beyond the sides of its image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum TextureWrap {
    /// The image again. The default of glTF.
    #[default]
    Repeat,
    /// The image again, each copy mirrored.
    Mirror,
    /// The pixels at its sides.
    Clamp,
}

/// The texels along one axis of an image, with what lies beyond its sides. A cell is the square of a
/// texel or of one of its copies.
pub(super) struct Axis {
    pub size: usize,
    pub wrap: TextureWrap,
}

impl Axis {
    /// Whether all that lies beyond the sides is the same as inside, so that there is one cell.
    fn is_constant(&self) -> bool {
        self.size == 1
    }

    /// The number of texels after which the axis repeats.
    fn period(&self) -> f64 {
        match self.wrap {
            TextureWrap::Repeat => self.size as f64,
            TextureWrap::Mirror => 2.0 * self.size as f64,
            TextureWrap::Clamp => f64::INFINITY,
        }
    }

    /// The cell that begins at or before a position.
    pub fn cell(&self, position: f64) -> i64 {
        let cell = position.floor() as i64;
        match self.wrap {
            _ if self.is_constant() => 0,
            TextureWrap::Clamp => cell.clamp(0, self.size as i64 - 1),
            _ => cell,
        }
    }

    /// The end of a cell.
    fn end(&self, cell: i64) -> f64 {
        let is_last = self.is_constant() || (self.wrap == TextureWrap::Clamp && cell == self.size as i64 - 1);
        if is_last { f64::INFINITY } else { cell.saturating_add(1) as f64 }
    }

    /// The texels between two positions, and the share of each.
    fn shares(&self, low: f64, high: f64) -> Vec<(usize, f64)> {
        let (mut shares, mut cell, mut at) = (Vec::new(), self.cell(low), low);
        loop {
            let end = self.end(cell).min(high);
            let share = if high > low { (end - at) / (high - low) } else { 1.0 };
            shares.push((self.texel(cell), share));
            if end >= high {
                return shares;
            }
            (cell, at) = (cell + 1, end);
        }
    }

    /// The texel of a cell.
    pub fn texel(&self, cell: i64) -> usize {
        let size = self.size as i64;
        let texel = match self.wrap {
            _ if self.is_constant() => 0,
            TextureWrap::Clamp => cell,
            TextureWrap::Repeat => cell.rem_euclid(size),
            TextureWrap::Mirror => {
                let place = cell.rem_euclid(2 * size);
                place.min(2 * size - 1 - place)
            }
        };
        texel as usize
    }
}

/// Moves coordinates by whole periods of the axes, to near zero, where they have the most digits.
fn near_zero<const N: usize>(mut corners: [DVec2; N], axes: &[Axis; 2]) -> [DVec2; N] {
    for (axis, along) in axes.iter().enumerate() {
        let low = corners.iter().fold(f64::MAX, |low, corner| low.min(corner[axis]));
        let shift = (low / along.period()).floor() * along.period();
        if shift.is_finite() && shift != 0.0 {
            corners.iter_mut().for_each(|corner| corner[axis] -= shift);
        }
    }
    corners
}

/// The average of texels over a triangle, whose corners are in texels.
pub(super) fn average_over(corners: [DVec2; 3], axes: &[Axis; 2], texel: impl Fn(usize, usize) -> Vec4) -> DVec4 {
    let at = |cell: [i64; 2]| texel(axes[0].texel(cell[0]), axes[1].texel(cell[1])).as_dvec4();
    let [a, b, c] = with_area(near_zero(corners, axes));
    let triangle = Polygon::new(&[a, b, c]);
    let (mut sum, mut covered) = (DVec4::ZERO, 0.0);
    for_each_cell(&triangle, 1, &axes[1], |row, strip| {
        for_each_cell(strip, 0, &axes[0], |column, part| {
            let area = part.area();
            sum += at([column, row]) * area;
            covered += area;
        });
    });
    if covered > 0.0 { sum / covered } else { at([axes[0].cell(a.x), axes[1].cell(a.y)]) }
}

/// The average of texels over a rectangle along the axes, given by two opposite corners in texels.
pub(super) fn average_within(corners: [DVec2; 2], axes: &[Axis; 2], texel: impl Fn(usize, usize) -> Vec4) -> DVec4 {
    let [a, b] = near_zero(corners, axes);
    let [columns, rows] = [0, 1].map(|k| axes[k].shares(a[k].min(b[k]), a[k].max(b[k])));
    let row = |y: usize| columns.iter().map(|(x, share)| texel(*x, y).as_dvec4() * *share).sum::<DVec4>();
    rows.iter().map(|(y, share)| row(*y) * *share).sum()
}

/// The triangle, with one corner moved a little if all lie on a line. The average over it tends to
/// that over the line, on which the points of the triangle are not spread evenly.
fn with_area([a, b, c]: [DVec2; 3]) -> [DVec2; 3] {
    let edge_sq = |[_, from, to]: &[DVec2; 3]| from.distance_squared(*to);
    let turns = [[a, b, c], [b, c, a], [c, a, b]];
    // The corner opposite the longest edge is moved.
    let [moved, from, to] = turns.into_iter().max_by(|x, y| edge_sq(x).total_cmp(&edge_sq(y))).unwrap_or(turns[0]);
    if (b - a).perp_dot(c - a).abs() > MIN_AREA_SHARE * from.distance_squared(to) {
        return turns[0];
    }
    [moved + (to - from).perp() * ADDED_HEIGHT, from, to]
}

/// A convex polygon: a triangle that is cut by up to four lines.
#[derive(Clone, Copy)]
struct Polygon {
    corners: [DVec2; 8],
    count: usize,
}

impl Polygon {
    fn new(corners: &[DVec2]) -> Self {
        let mut polygon = Self { corners: [DVec2::ZERO; 8], count: 0 };
        corners.iter().for_each(|corner| polygon.push(*corner));
        polygon
    }

    fn push(&mut self, corner: DVec2) {
        // Rounding can add corners that coincide; no cut of a triangle has more than eight.
        if self.count < self.corners.len() {
            self.corners[self.count] = corner;
            self.count += 1;
        }
    }

    fn corners(&self) -> &[DVec2] {
        &self.corners[..self.count]
    }

    fn area(&self) -> f64 {
        let corners = self.corners();
        let Some(&first) = corners.first() else { return 0.0 };
        let fan = corners.windows(2).map(|pair| (pair[0] - first).perp_dot(pair[1] - first));
        fan.sum::<f64>().abs() * 0.5
    }

    /// The least and the greatest coordinate along an axis.
    fn range(&self, axis: usize) -> (f64, f64) {
        let along = self.corners().iter().map(|corner| corner[axis]);
        along.fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(x), high.max(x)))
    }

    /// The parts below and above a coordinate along an axis.
    fn cut(&self, axis: usize, at: f64) -> [Self; 2] {
        let mut parts = [Self::new(&[]); 2];
        let corners = self.corners();
        for (i, &corner) in corners.iter().enumerate() {
            let next = corners[(i + 1) % corners.len()];
            let (x, next_x) = (corner[axis], next[axis]);
            if x <= at {
                parts[0].push(corner);
            }
            if x >= at {
                parts[1].push(corner);
            }
            if (x < at && next_x > at) || (x > at && next_x < at) {
                let mut crossing = corner.lerp(next, (at - x) / (next_x - x));
                crossing[axis] = at;
                parts.iter_mut().for_each(|part| part.push(crossing));
            }
        }
        parts
    }
}

/// Visits the parts of a polygon in the cells along an axis.
fn for_each_cell(polygon: &Polygon, axis: usize, along: &Axis, mut visit: impl FnMut(i64, &Polygon)) {
    if polygon.count < 3 {
        return;
    }
    let (low, high) = polygon.range(axis);
    let (mut rest, mut cell) = (*polygon, along.cell(low));
    while high > along.end(cell) {
        let [part, beyond] = rest.cut(axis, along.end(cell));
        visit(cell, &part);
        (rest, cell) = (beyond, cell + 1);
    }
    visit(cell, &rest);
}
