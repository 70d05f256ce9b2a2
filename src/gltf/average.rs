//! The average of a texture over triangles.
//!
//! Texels count as squares of one colour. The average is exact for triangles of up to
//! [`MAX_CELLS`] texels along each axis. Longer ones are averaged over an image that is reduced
//! along that axis, so that the average of a surface that shows the whole image stays exact.

use std::collections::BTreeMap;
use std::rc::Rc;

use glam::{DAffine2, DVec2, DVec3, Vec2, Vec3};

use super::texture::{TextureImage, TextureUse, TextureWrap};

/// Most texels that a triangle is averaged over along each axis.
const MAX_CELLS: f64 = 128.0;
/// Texels of reduced images that are kept for later triangles, 12 bytes each.
const MAX_HELD: usize = 1 << 25;
/// A triangle whose area is below this share of the square over its longest edge has no area: that of
/// three points on a line is not exactly 0 after rounding.
const MIN_AREA_SHARE: f64 = 1e-9;
/// The height that a triangle without area is given, as a share of its longest edge.
const ADDED_HEIGHT: f64 = 1e-6;

/// An image that is reduced by powers of two along its axes, on demand.
pub(super) struct Averager<'a> {
    image: TextureImage<'a>,
    /// The linear value of each byte.
    linear: Box<[f32; 256]>,
    /// Reduced images, by the exponents of their reductions along both axes.
    reduced: BTreeMap<[u32; 2], Rc<Reduced>>,
    /// Texels of all reduced images.
    held: usize,
}

/// A reduced image, in linear colours.
struct Reduced {
    size: [usize; 2],
    texels: Vec<Vec3>,
}

/// The linear value of an sRGB-encoded one; both are from 0 to 1.
fn srgb_to_linear(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

impl<'a> Averager<'a> {
    /// `image` has passed its check.
    pub fn new(image: TextureImage<'a>) -> Self {
        let linear = Box::new(std::array::from_fn(|byte| srgb_to_linear(byte as f32 / 255.0)));
        Self { image, linear, reduced: BTreeMap::new(), held: 0 }
    }

    /// The average linear colour over a triangle, whose texture coordinates are finite.
    pub fn average(&mut self, tex_coords: [Vec2; 3], texture: &TextureUse) -> Vec3 {
        // In f64, where the products of finite numbers of f32 are finite.
        let transform = DAffine2::from_mat2_translation(
            texture.transform.matrix2.as_dmat2(),
            texture.transform.translation.as_dvec2(),
        );
        let corners = tex_coords.map(|corner| transform.transform_point2(corner.as_dvec2()));
        let size = [self.image.width, self.image.height];
        let levels = [0, 1].map(|axis| {
            let ends = corners.map(|corner| corner[axis] * f64::from(size[axis]));
            reduction(ends, size[axis], texture.wrap[axis])
        });
        let reduced = (levels != [0, 0]).then(|| self.reduced(levels));
        let size = reduced.as_ref().map_or(size.map(|size| size as usize), |reduced| reduced.size);
        let axes = [0, 1].map(|axis| Axis { size: size[axis], wrap: texture.wrap[axis] });
        let mean = match &reduced {
            None => average_over(corners, &axes, |x, y| self.texel(x, y)),
            Some(reduced) => average_over(corners, &axes, |x, y| reduced.texels[y * size[0] + x]),
        };
        mean.as_vec3()
    }

    fn texel(&self, x: usize, y: usize) -> Vec3 {
        let first = 4 * (y * self.image.width as usize + x);
        let bytes = &self.image.rgba[first..first + 3];
        Vec3::new(self.linear[bytes[0] as usize], self.linear[bytes[1] as usize], self.linear[bytes[2] as usize])
    }

    /// The image, reduced by powers of two along its axes.
    fn reduced(&mut self, levels: [u32; 2]) -> Rc<Reduced> {
        if let Some(reduced) = self.reduced.get(&levels) {
            return reduced.clone();
        }
        let full = [self.image.width as usize, self.image.height as usize];
        let size = [0, 1].map(|axis| full[axis].div_ceil(1 << levels[axis]));
        // The axes are reduced one after the other, so that images that are reduced along both need few
        // passes over the whole image.
        let texels = match levels {
            [_, 0] => shrink_rows(full, size[0], |x, y| self.texel(x, y)),
            [0, _] => shrink_columns(full, size[1], |x, y| self.texel(x, y)),
            [columns, _] => {
                let narrow = self.reduced([columns, 0]);
                shrink_columns(narrow.size, size[1], |x, y| narrow.texels[y * narrow.size[0] + x])
            }
        };
        if self.held + texels.len() > MAX_HELD {
            self.reduced.clear();
            self.held = 0;
        }
        self.held += texels.len();
        let reduced = Rc::new(Reduced { size, texels });
        self.reduced.insert(levels, reduced.clone());
        reduced
    }
}

/// The texels of an image of the same height that is `columns` wide.
fn shrink_rows(full: [usize; 2], columns: usize, texel: impl Fn(usize, usize) -> Vec3) -> Vec<Vec3> {
    let shares = shares(full[0], columns);
    let mut texels = Vec::with_capacity(columns * full[1]);
    let mut sums = vec![DVec3::ZERO; columns];
    for y in 0..full[1] {
        sums.fill(DVec3::ZERO);
        for (x, shares) in shares.iter().enumerate() {
            let color = texel(x, y).as_dvec3();
            shares.iter().for_each(|(column, share)| sums[*column] += color * *share);
        }
        texels.extend(sums.iter().map(|sum| sum.as_vec3()));
    }
    texels
}

/// The texels of an image of the same width that is `rows` high.
fn shrink_columns(full: [usize; 2], rows: usize, texel: impl Fn(usize, usize) -> Vec3) -> Vec<Vec3> {
    let mut sums = vec![DVec3::ZERO; full[0] * rows];
    for (y, shares) in shares(full[1], rows).iter().enumerate() {
        for x in 0..full[0] {
            let color = texel(x, y).as_dvec3();
            shares.iter().for_each(|(row, share)| sums[row * full[0] + x] += color * *share);
        }
    }
    sums.into_iter().map(|sum| sum.as_vec3()).collect()
}

/// For each texel along an axis, the one or two reduced texels that it overlaps, and its share of
/// each.
fn shares(full: usize, size: usize) -> Vec<[(usize, f64); 2]> {
    let scale = size as f64 / full as f64;
    let share = |texel: usize| {
        let (begin, end) = (texel as f64 * scale, (texel + 1) as f64 * scale);
        let first = (begin as usize).min(size - 1);
        let cut = (first + 1) as f64;
        if end <= cut || first + 1 == size {
            return [(first, scale), (first, 0.0)];
        }
        [(first, cut - begin), (first + 1, end - cut)]
    };
    (0..full).map(share).collect()
}

/// The exponent of the power of two by which an image is reduced along an axis. `ends` holds the
/// coordinates of a triangle's corners along this axis, in texels.
fn reduction(ends: [f64; 3], size: u32, wrap: TextureWrap) -> u32 {
    let limit = f64::from(size);
    let ends = if wrap == TextureWrap::Clamp { ends.map(|end| end.clamp(0.0, limit)) } else { ends };
    let extent = ends.into_iter().fold(f64::MIN, f64::max) - ends.into_iter().fold(f64::MAX, f64::min);
    let last = u32::BITS - (size - 1).leading_zeros();
    let cells = |level: u32| extent * f64::from(size.div_ceil(1 << level)) / limit;
    (0..last).find(|level| cells(*level) <= MAX_CELLS).unwrap_or(last)
}

/// The texels along one axis of an image, with what lies beyond its sides. A cell is the square of a
/// texel or of one of its copies.
struct Axis {
    size: usize,
    wrap: TextureWrap,
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
    fn cell(&self, position: f64) -> i64 {
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

    /// The texel of a cell.
    fn texel(&self, cell: i64) -> usize {
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

/// The average of texels over a triangle, whose corners are in units of the image.
fn average_over(corners: [DVec2; 3], axes: &[Axis; 2], texel: impl Fn(usize, usize) -> Vec3) -> DVec3 {
    let size = DVec2::new(axes[0].size as f64, axes[1].size as f64);
    let mut corners = corners.map(|corner| corner * size);
    let low = corners[0].min(corners[1]).min(corners[2]);
    // Coordinates near zero have the most digits.
    for (axis, along) in axes.iter().enumerate() {
        let shift = (low[axis] / along.period()).floor() * along.period();
        if shift.is_finite() && shift != 0.0 {
            corners.iter_mut().for_each(|corner| corner[axis] -= shift);
        }
    }
    let at = |cell: [i64; 2]| texel(axes[0].texel(cell[0]), axes[1].texel(cell[1])).as_dvec3();
    let [a, b, c] = with_area(corners);
    let triangle = Polygon::new(&[a, b, c]);
    let (mut sum, mut covered) = (DVec3::ZERO, 0.0);
    let strips = Cells::new(&triangle, 1, &axes[1]);
    for (row, strip) in strips {
        for (column, part) in Cells::new(&strip, 0, &axes[0]) {
            let area = part.area();
            sum += at([column, row]) * area;
            covered += area;
        }
    }
    if covered > 0.0 { sum / covered } else { at([axes[0].cell(a.x), axes[1].cell(a.y)]) }
}

/// The triangle, with one corner moved a little if all lie on a line. The average over it tends to
/// that over the line, on which the points of the triangle are not spread evenly.
fn with_area([a, b, c]: [DVec2; 3]) -> [DVec2; 3] {
    let length_sq = |from: DVec2, to: DVec2| from.distance_squared(to);
    let longest = length_sq(a, b).max(length_sq(b, c)).max(length_sq(c, a));
    if (b - a).perp_dot(c - a).abs() > MIN_AREA_SHARE * longest {
        return [a, b, c];
    }
    // The corner opposite the longest edge is moved.
    let (moved, from, to) = if longest == length_sq(a, b) {
        (c, a, b)
    } else if longest == length_sq(b, c) {
        (a, b, c)
    } else {
        (b, c, a)
    };
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

/// The parts of a polygon in the cells along an axis.
struct Cells<'a> {
    rest: Option<Polygon>,
    axis: usize,
    along: &'a Axis,
    cell: i64,
    high: f64,
}

impl<'a> Cells<'a> {
    fn new(polygon: &Polygon, axis: usize, along: &'a Axis) -> Self {
        let (low, high) = polygon.range(axis);
        let rest = (polygon.count > 2).then_some(*polygon);
        Self { rest, axis, along, cell: along.cell(low), high }
    }
}

impl Iterator for Cells<'_> {
    type Item = (i64, Polygon);

    fn next(&mut self) -> Option<Self::Item> {
        let rest = self.rest.take()?;
        let (cell, end) = (self.cell, self.along.end(self.cell));
        if self.high <= end {
            return Some((cell, rest));
        }
        let [part, rest] = rest.cut(self.axis, end);
        self.rest = Some(rest);
        self.cell += 1;
        Some((cell, part))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Affine2, vec2};

    const WHITE: [u8; 4] = [255; 4];
    const BLACK: [u8; 4] = [0, 0, 0, 255];

    /// An image of black and white pixels.
    fn image(width: u32, height: u32, is_white: impl Fn(u32, u32) -> bool) -> Vec<u8> {
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        pixels.flat_map(|(x, y)| if is_white(x, y) { WHITE } else { BLACK }).collect()
    }

    fn texture(wrap: TextureWrap) -> TextureUse {
        TextureUse { image: 0, tex_coord: 0, transform: Affine2::IDENTITY, wrap: [wrap; 2], is_nearest: true }
    }

    /// The average over a triangle of an image of black and white pixels.
    fn average(size: (u32, u32), rgba: &[u8], wrap: TextureWrap, corners: [Vec2; 3]) -> f32 {
        let mut averager = Averager::new(TextureImage { width: size.0, height: size.1, rgba });
        averager.average(corners, &texture(wrap)).x
    }

    /// The average over both triangles of a rectangle, which have the same area.
    fn quad(size: (u32, u32), rgba: &[u8], wrap: TextureWrap, [low, high]: [Vec2; 2]) -> f32 {
        let [a, b, c, d] = [low, vec2(high.x, low.y), high, vec2(low.x, high.y)];
        0.5 * (average(size, rgba, wrap, [a, b, c]) + average(size, rgba, wrap, [a, c, d]))
    }

    fn assert_close(found: f32, expected: f32, what: &str) {
        assert!((found - expected).abs() < 1e-5, "{what}: {found} instead of {expected}");
    }

    #[test]
    fn half_of_a_texture_that_is_half_white_is_white() {
        for (width, height) in [(2, 1), (64, 8), (1000, 3), (2048, 2048)] {
            let rgba = image(width, height, |x, _| x < width / 2);
            let whole = [Vec2::ZERO, Vec2::ONE];
            for wrap in [TextureWrap::Repeat, TextureWrap::Mirror, TextureWrap::Clamp] {
                assert_close(quad((width, height), &rgba, wrap, whole), 0.5, &format!("{width} x {height}, {wrap:?}"));
            }
        }
        // Of the triangle (0, 0), (1, 0), (0, 1), three quarters lie to the left of the middle.
        let rgba = image(64, 64, |x, _| x < 32);
        let corners = [Vec2::ZERO, Vec2::X, Vec2::Y];
        assert_close(average((64, 64), &rgba, TextureWrap::Clamp, corners), 0.75, "left of the middle");
    }

    #[test]
    fn half_of_a_checkerboard_is_white() {
        let rgba = image(16, 16, |x, y| (x + y) % 2 == 0);
        for wrap in [TextureWrap::Repeat, TextureWrap::Mirror] {
            for scale in [1.0, 3.0, 50.0] {
                let found = quad((16, 16), &rgba, wrap, [Vec2::splat(-scale), Vec2::splat(scale)]);
                assert_close(found, 0.5, &format!("{wrap:?}, {scale}"));
            }
        }
        // A large triangle along no axis: its 40,000 texels leave an error of its border only.
        let corners = [vec2(0.1, 0.2), vec2(17.3, 3.1), vec2(4.4, 15.9)];
        assert!((average((16, 16), &rgba, TextureWrap::Repeat, corners) - 0.5).abs() < 2e-3);
    }

    #[test]
    fn triangles_within_one_texel_have_its_colour() {
        let rgba = image(16, 16, |x, y| (x, y) == (3, 5));
        let within = |x: f32, y: f32, size: f32| {
            let low = vec2(x, y) / 16.0;
            let corners = [low, low + Vec2::X * size, low + Vec2::Y * size];
            average((16, 16), &rgba, TextureWrap::Repeat, corners)
        };
        for size in [0.0, 1e-7, 1e-4, 0.02] {
            assert_eq!(within(3.4, 5.4, size), 1.0, "{size}");
            assert_eq!(within(2.4, 5.4, size), 0.0, "{size}");
            // Copies of the image.
            assert_eq!(within(3.4 - 16.0, 5.4 + 32.0, size), 1.0, "{size}");
        }
        // A line through the texel and its neighbour.
        let line = [vec2(3.0, 5.5), vec2(4.0, 5.5), vec2(5.0, 5.5)].map(|corner| corner / 16.0);
        assert_close(average((16, 16), &rgba, TextureWrap::Repeat, line), 0.5, "line");
    }

    #[test]
    fn what_lies_beyond_the_sides_depends_on_the_wrap() {
        // White on the left half; from 1 to 1.5 the copy shows white, the mirrored copy black, and
        // the right side goes on in black.
        let rgba = image(8, 8, |x, _| x < 4);
        let beyond = |wrap| quad((8, 8), &rgba, wrap, [vec2(1.0, 0.0), vec2(1.5, 1.0)]);
        assert_close(beyond(TextureWrap::Repeat), 1.0, "repeat");
        assert_close(beyond(TextureWrap::Mirror), 0.0, "mirror");
        assert_close(beyond(TextureWrap::Clamp), 0.0, "clamp");
        // To the left: black, white, white.
        let before = |wrap| quad((8, 8), &rgba, wrap, [vec2(-0.5, 0.0), vec2(0.0, 1.0)]);
        assert_close(before(TextureWrap::Repeat), 0.0, "repeat");
        assert_close(before(TextureWrap::Mirror), 1.0, "mirror");
        assert_close(before(TextureWrap::Clamp), 1.0, "clamp");
        // Three quarters of [-1, 1] are white, however far it reaches along y.
        let far = quad((8, 8), &rgba, TextureWrap::Clamp, [vec2(-1.0, -1e6), vec2(1.0, 1e6)]);
        assert_close(far, 0.75, "far");
    }

    #[test]
    fn reduced_images_keep_their_average() {
        // One white pixel in an image whose sides are no powers of two, at each of some places.
        let size = (301, 517);
        for place in [(0, 0), (150, 77), (300, 516), (127, 128)] {
            let rgba = image(size.0, size.1, |x, y| (x, y) == place);
            let found = quad(size, &rgba, TextureWrap::Repeat, [Vec2::ZERO, Vec2::ONE]);
            let expected = 1.0 / (size.0 * size.1) as f32;
            assert!((found / expected - 1.0).abs() < 1e-3, "{place:?}: {found} instead of {expected}");
        }
    }

    #[test]
    fn colours_are_averaged_in_linear_light() {
        let rgba = [188, 188, 188, 255, 0, 128, 255, 255];
        let mut averager = Averager::new(TextureImage { width: 2, height: 1, rgba: &rgba });
        let corners = [vec2(0.5, 0.0), vec2(1.0, 0.0), vec2(1.0, 1.0)];
        let found = averager.average(corners, &texture(TextureWrap::Repeat));
        assert!(found.abs_diff_eq(Vec3::new(0.0, 0.215_860_5, 1.0), 1e-5), "{found}");
        let corners = [vec2(0.0, 0.0), vec2(0.5, 0.0), vec2(0.0, 1.0)];
        assert!((averager.average(corners, &texture(TextureWrap::Repeat)).x - 0.502_886_5).abs() < 1e-5);
    }
}
