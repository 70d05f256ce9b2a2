//! The cell of a shading point, and the few bits that a cell keeps of some of its points.

use glam::{DVec3, Vec3};

use crate::math::dice::{U_STEP, hash};
use crate::shading::gloss::Gloss;
use crate::shading::segment::LocalSegment;
use crate::shading::shading_point::ShadingPoint;
use crate::visibility::{MAX_COORDINATE, TAG_SEED, side};

/// The points that a cell keeps, at most. With the middle of the cell they are as many as the children of
/// a node.
pub(crate) const POINTS: usize = 7;

/// Bits of a point's place in its cell along each axis.
pub(crate) const PLACE_BITS: u32 = 6;
/// Bits of each of the two slopes of a normal within its class.
pub(crate) const SLOPE_BITS: u32 = 4;
/// The steps of a slope within its class, and the step of the middle.
pub(crate) const SLOPE_STEPS: f32 = 15.0;
/// See [`SLOPE_STEPS`].
pub(crate) const SLOPE_ZERO: f32 = 7.0;
/// The random bits of a point's word, below its place and its slopes.
pub(crate) const RANDOM_BITS: u32 = 32 - 3 * PLACE_BITS - 2 * SLOPE_BITS;

/// The classes of a slope, the component of a normal along an axis over the largest component, for one
/// unit of slope. There are three: rounded to -1, 0 and 1.
pub(crate) const SLOPE_CLASSES: f32 = 1.2;
/// The class of the normals of volumes. Surfaces have nine classes for each of six sides.
pub(crate) const VOLUME: u32 = 54;

/// The steps of perceptual roughness from 0 to 1 that are told apart.
pub(crate) const ROUGHNESS_STEPS: f32 = 16.0;
/// The powers of two of the ratio of specular to diffuse reflectance that are told apart.
pub(crate) const REFLECTANCES: [f32; 2] = [-6.0, 8.0];
/// Points belong to the cells of a camera's surfaces only if their view is to the camera, as far as
/// this cosine.
pub(crate) const VIEW_COSINE: f32 = 0.98;

/// How often the edge of a cell that follows a camera can be halved, and doubled.
pub(crate) const LEVELS: [u32; 2] = [3, 5];

/// With a camera, the cut of a cell whose edge was doubled so often more stands in where a cell has none.
pub(crate) const COARSER: u32 = 2;
/// One in so many places marks that cell too.
pub(crate) const COARSE_MARKS: u32 = 16;

/// The lowest bit of a kind that belongs to the gloss.
pub(crate) const GLOSS_SHIFT: u32 = 10;

/// The camera whose pixels decide the size of cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Camera {
    /// Position in the world.
    pub eye: DVec3,
    /// The edge of a cell at a distance of one metre.
    pub edge_per_metre: f32,
}

/// The grid of cells, for coordinates that are relative to an origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CutGrid {
    /// The edge of the smallest place in a cell, in metres.
    pub unit: f32,
    pub units_per_metre: f32,
    /// The origin in its own unit, in metres.
    pub offset: Vec3,
    /// The unit of the origin, modulo 2^32.
    pub first: [u32; 3],
    /// The position of the camera relative to the origin.
    pub eye: Option<Vec3>,
    /// Squares of distances are multiplied by this. The result is the square of the edge of a cell in
    /// edges of the smallest cells, and twice that, to round to the nearest power of two.
    pub edges_sq: f32,
}

/// What tells cells apart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct CutCell {
    /// In edges of the cell, modulo 2^32.
    pub corner: [u32; 3],
    /// From the lowest bits up: the level (4 bits), the class of the normal (6), the steps of roughness
    /// (8, with 0 for a matte surface) and the reflectances (8).
    pub kind: u32,
    pub mask: u32,
}

impl CutCell {
    /// Where to look in the table, and what tells cells apart there, which is not 0.
    pub fn keys(&self) -> [u32; 2] {
        let [x, y, z] = self.corner;
        let first = hash(x ^ hash(y ^ hash(z ^ hash(self.kind ^ hash(self.mask)))));
        [first, hash(first ^ hash(x ^ TAG_SEED)).max(1)]
    }

    fn level(&self) -> u32 {
        self.kind & 15
    }

    /// Whether its points are glossy.
    pub fn is_glossy(&self) -> bool {
        self.kind >> GLOSS_SHIFT != 0
    }

    fn normal_class(&self) -> u32 {
        self.kind >> 4 & 63
    }
}

impl CutGrid {
    /// Cells with edges of `edge` metres; with a camera, edges halved and doubled as often as [`LEVELS`] says. They lie at
    /// multiples of their edges in the world.
    pub fn new(edge: f32, camera: Option<Camera>, origin: DVec3) -> Self {
        let smallest = edge / (1 << LEVELS[0]) as f32;
        let unit = smallest / (1 << PLACE_BITS) as f32;
        let exact = f64::from(unit);
        let first = (origin / exact).floor();
        let edges = camera.map_or(0.0, |camera| camera.edge_per_metre / smallest);
        Self {
            unit,
            units_per_metre: 1.0 / unit,
            offset: (origin - first * exact).as_vec3(),
            first: first.to_array().map(|coordinate| coordinate as i64 as u32),
            eye: camera.map(|camera| (camera.eye - origin).as_vec3()),
            edges_sq: 2.0 * edges * edges,
        }
    }

    /// The cell of a shading point, and the bits to keep of the point; `None` for points that share no
    /// cells: segments, and glossy points that are not seen from the camera.
    pub fn cell(&self, shading_point: &ShadingPoint) -> Option<(CutCell, Place)> {
        self.cell_with(shading_point, 0)
    }

    /// The cell that stands in for that of a shading point; `None` without a camera, and for the largest cells.
    pub fn coarse_cell(&self, shading_point: &ShadingPoint) -> Option<(CutCell, Place)> {
        let fits =
            |eye: Vec3| self.level(shading_point.position.distance_squared(eye)) + COARSER <= LEVELS[0] + LEVELS[1];
        self.eye.filter(|eye| fits(*eye)).and_then(|_| self.cell_with(shading_point, COARSER))
    }

    /// The edge is doubled `coarser` times more.
    fn cell_with(&self, shading_point: &ShadingPoint, coarser: u32) -> Option<(CutCell, Place)> {
        if LocalSegment::of(shading_point).is_some() {
            return None;
        }
        let position = shading_point.position;
        let gloss = self.gloss_class(shading_point)?;
        let level = coarser + self.eye.map_or(LEVELS[0], |eye| self.level(position.distance_squared(eye)));
        let units = ((position + self.offset) * self.units_per_metre).floor();
        let limited = units.clamp(Vec3::splat(-MAX_COORDINATE), Vec3::splat(MAX_COORDINATE));
        let place = |k: usize| (limited[k] as i32 as u32).wrapping_add(self.first[k]) as i32;
        let (mut corner, mut bits) = ([0; 3], 0);
        for k in 0..3 {
            corner[k] = (place(k) >> (PLACE_BITS + level)) as u32;
            bits = bits << PLACE_BITS | (place(k) >> level) as u32 & ((1 << PLACE_BITS) - 1);
        }
        // The same for positions that differ by rounding.
        let random = hash(bits ^ hash(corner[0] ^ hash(corner[1] ^ hash(corner[2]))));
        let (normal_class, slopes) = normal_bits(shading_point.normal, random);
        let content = bits << (2 * SLOPE_BITS) | slopes;
        let word = scrambled(content << RANDOM_BITS | random >> (32 - RANDOM_BITS)).max(1);
        let kind = level | normal_class << 4 | gloss << GLOSS_SHIFT;
        let cell = CutCell { corner, kind, mask: shading_point.mask };
        let marks_coarse = (random / POINTS as u32).is_multiple_of(COARSE_MARKS);
        Some((cell, Place { which: random as usize % POINTS, word, marks_coarse }))
    }

    /// The point that a word stands for, in a cell.
    pub fn point(&self, cell: &CutCell, word: u32) -> ShadingPoint {
        let word = unscrambled(word) >> RANDOM_BITS;
        let place = |k: usize| {
            let within = word >> (2 * SLOPE_BITS + PLACE_BITS * (2 - k as u32)) & ((1 << PLACE_BITS) - 1);
            within as f32 + 0.5
        };
        let normal = normal_of(cell.normal_class(), word);
        self.shading_point(cell, Vec3::from_array([0, 1, 2].map(place)), normal)
    }

    /// The middle of a cell, as a point in a volume.
    pub fn center(&self, cell: &CutCell) -> ShadingPoint {
        let matte = CutCell { kind: cell.kind & ((1 << GLOSS_SHIFT) - 1), ..*cell };
        self.shading_point(&matte, Vec3::splat((1 << (PLACE_BITS - 1)) as f32), Vec3::ZERO)
    }

    /// The direction from the middle of a glossy cell to the eye; 0 for a matte one.
    pub fn toward(&self, cell: &CutCell) -> Vec3 {
        let eye = self.eye.filter(|_| cell.is_glossy());
        eye.map_or(Vec3::ZERO, |eye| (eye - self.center(cell).position).normalize_or_zero())
    }

    /// `place` is in units of the cell's level, from its corner.
    fn shading_point(&self, cell: &CutCell, place: Vec3, normal: Vec3) -> ShadingPoint {
        let level = cell.level();
        let corner = |k: usize| (cell.corner[k] << (PLACE_BITS + level)).wrapping_sub(self.first[k]) as i32 as f32;
        let units = Vec3::from_array([0, 1, 2].map(corner)) + place * (1 << level) as f32;
        let position = units * self.unit - self.offset;
        let point = ShadingPoint { normal, ..ShadingPoint::volume(position) }.with_mask(cell.mask);
        match (cell.kind >> GLOSS_SHIFT, self.eye) {
            (0, _) | (_, None) => point,
            (gloss, Some(eye)) => point.with_gloss(gloss_of(gloss, eye - position)),
        }
    }

    /// Whether another grid has the same camera position, or neither has one.
    pub fn has_eye_of(&self, other: &Self) -> bool {
        self.eye == other.eye
    }

    /// From the square of the distance to the eye.
    fn level(&self, dist_sq: f32) -> u32 {
        let exponent = (dist_sq * self.edges_sq).to_bits() >> 23;
        (exponent.saturating_sub(127) / 2).min(LEVELS[0] + LEVELS[1])
    }

    /// The class of a gloss, 0 for a matte surface; `None` if its points share no cells.
    fn gloss_class(&self, shading_point: &ShadingPoint) -> Option<u32> {
        let Some(gloss) = shading_point.gloss.filter(|_| shading_point.normal != Vec3::ZERO) else { return Some(0) };
        let view = self.eye? - shading_point.position;
        (view.dot(gloss.view) >= VIEW_COSINE * (view.length() * gloss.view.length())).then_some(())?;
        let roughness = (gloss.roughness.clamp(0.0, 1.0) * ROUGHNESS_STEPS).round() as u32;
        let ratio = (gloss.specular / gloss.diffuse.max(1.0e-6)).log2().clamp(REFLECTANCES[0], REFLECTANCES[1]);
        Some((1 + roughness) | ((ratio - REFLECTANCES[0]).round() as u32) << 8)
    }
}

/// The bits that a cell keeps of one of its points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Place {
    /// Which of the [`POINTS`] words it may become.
    pub which: usize,
    /// The place in the cell, the slopes of the normal and random bits, [`scrambled`]. Not 0. The greatest word of all
    /// points is kept, so their order has no effect, and no place is preferred.
    pub word: u32,
    /// Whether the point marks its coarse cell as well.
    pub marks_coarse: bool,
}

/// A permutation of all words that leaves no order between neighbours.
///
/// Source: Wellons, Prospecting for Hash Functions (2018), `lowbias32`, and its inverse.
fn scrambled(word: u32) -> u32 {
    let word = (word ^ word >> 16).wrapping_mul(0x7feb_352d);
    let word = (word ^ word >> 15).wrapping_mul(0x846c_a68b);
    word ^ word >> 16
}

/// The inverse of [`scrambled`].
fn unscrambled(word: u32) -> u32 {
    let word = (word ^ word >> 16).wrapping_mul(0x4302_1123);
    let word = (word ^ word >> 15 ^ word >> 30).wrapping_mul(0x1d69_e2a5);
    word ^ word >> 16
}

/// The middle of a class of glosses.
fn gloss_of(class: u32, view: Vec3) -> Gloss {
    let roughness = ((class & 255) - 1) as f32 / ROUGHNESS_STEPS;
    let ratio = ((class >> 8) as f32 + REFLECTANCES[0]).exp2();
    Gloss { view, roughness, specular: ratio / (1.0 + ratio), diffuse: 1.0 / (1.0 + ratio) }
}

/// The class of a normal, and its slopes within the class. `random` decides how they are rounded.
fn normal_bits(normal: Vec3, random: u32) -> (u32, u32) {
    let side = side(normal);
    if 9 * side == VOLUME {
        return (VOLUME, 0);
    }
    let axis = side as usize / 2;
    let slope = |k: usize| {
        let slope = normal[(axis + k) % 3] / normal[axis].abs() * SLOPE_CLASSES;
        let class = slope.round().clamp(-1.0, 1.0);
        // A slope of 0 is kept as it is: near walls and floors a tilt would show lights that lie in them.
        // Others are rounded up or down at random, so that a cell's points together have their mean.
        let step = (slope - class) * SLOPE_STEPS + SLOPE_ZERO + U_STEP * (hash(random ^ k as u32) >> 8) as f32;
        let step = step.floor().clamp(0.0, 2.0 * SLOPE_ZERO + 1.0);
        ((class + 1.0) as u32, step as u32)
    };
    let ((a, p), (b, q)) = (slope(1), slope(2));
    (9 * side + 3 * a + b, p << SLOPE_BITS | q)
}

/// The normal in the middle of what bits stand for.
fn normal_of(class: u32, slopes: u32) -> Vec3 {
    if class >= VOLUME {
        return Vec3::ZERO;
    }
    let (axis, sign) = (class / 18, if class / 9 % 2 == 1 { -1.0 } else { 1.0 });
    let slope = |class: u32, step: u32| {
        let within = ((step & ((1 << SLOPE_BITS) - 1)) as f32 - SLOPE_ZERO) / SLOPE_STEPS;
        ((class % 3) as f32 - 1.0 + within) / SLOPE_CLASSES
    };
    let (a, b) = (slope(class / 3, slopes >> SLOPE_BITS), slope(class, slopes));
    let mut normal = Vec3::ZERO;
    normal[axis as usize] = sign;
    normal[(axis as usize + 1) % 3] = a;
    normal[(axis as usize + 2) % 3] = b;
    normal.normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::testing::Rng;

    fn grid(camera: Option<Camera>, origin: DVec3) -> CutGrid {
        CutGrid::new(0.25, camera, origin)
    }

    #[test]
    fn a_cell_keeps_places_to_a_part_of_its_edge_and_normals_to_a_few_degrees() {
        let mut rng = Rng(501);
        let mut worst = [0.0_f32; 2];
        for _ in 0..2000 {
            let camera = Camera { eye: rng.position(50.0).as_dvec3(), edge_per_metre: 0.01 };
            let grid = grid(Some(camera), rng.position(3.0).as_dvec3());
            let at = ShadingPoint::surface(rng.position(100.0), rng.position(1.0).normalize());
            let (cell, place) = grid.cell(&at).expect("a surface");
            let kept = grid.point(&cell, place.word);
            assert_eq!(grid.cell(&kept).map(|(cell, _)| cell.corner), Some(cell.corner));
            let edge = grid.unit * (1 << PLACE_BITS) as f32 * (1 << cell.level()) as f32;
            worst[0] = worst[0].max((kept.position - at.position).abs().max_element() / edge);
            worst[1] = worst[1].max(kept.normal.angle_between(at.normal));
            let center = grid.center(&cell);
            assert!((center.position - at.position).abs().max_element() <= 0.501 * edge && center.normal == Vec3::ZERO);
        }
        // Half of the smallest place, and one step of both slopes.
        assert!(worst[0] <= 0.51 / (1 << PLACE_BITS) as f32, "{worst:?}");
        assert!(worst[1] > 0.01 && worst[1] <= (2.0_f32.sqrt() / (SLOPE_STEPS * SLOPE_CLASSES)), "{worst:?}");
    }

    #[test]
    fn normals_along_axes_stay_exact_and_all_classes_are_reached() {
        let mut classes = std::collections::BTreeSet::new();
        let mut rng = Rng(502);
        for (i, normal) in [Vec3::X, Vec3::Y, Vec3::Z].into_iter().flat_map(|axis| [axis, -axis]).enumerate() {
            for _ in 0..100 {
                let (class, slopes) = normal_bits(normal, rng.bits() as u32);
                assert_eq!((class, normal_of(class, slopes)), (9 * i as u32 + 4, normal));
            }
        }
        for _ in 0..5000 {
            classes.insert(normal_bits(rng.position(1.0).normalize(), 0).0);
        }
        assert_eq!(classes.len(), VOLUME as usize);
        assert_eq!(normal_bits(Vec3::ZERO, 5).0, VOLUME);
    }

    #[test]
    fn words_are_scrambled_and_unscrambled() {
        let mut rng = Rng(503);
        assert!((0..100_000).map(|_| rng.bits() as u32).all(|word| unscrambled(scrambled(word)) == word));
    }

    #[test]
    fn no_place_in_a_cell_is_preferred_however_many_points_are_marked() {
        let mut rng = Rng(504);
        let grid = grid(None, DVec3::ZERO);
        for marks in [8, 600, 20_000] {
            let mut sum = Vec3::ZERO;
            for cell in 0..64 {
                let corner = 0.25 * Vec3::new(cell as f32, 3.0, 5.0);
                let mut kept = [0; POINTS];
                for _ in 0..marks {
                    let at = corner + 0.125 * (rng.position(1.0) + 1.0);
                    let (_, place) = grid.cell(&ShadingPoint::surface(at, Vec3::Y)).expect("a surface");
                    kept[place.which] = kept[place.which].max(place.word);
                }
                for word in kept.into_iter().filter(|word| *word != 0) {
                    let (cell, _) = grid.cell(&ShadingPoint::surface(corner + 0.1, Vec3::Y)).expect("a surface");
                    sum += (grid.point(&cell, word).position - corner) / 0.25 - 0.5;
                }
            }
            // The standard deviation of a mean of up to 448 uniform numbers is 0.014; 5 of them for one in 600,000 runs.
            let mean = sum / (64 * POINTS) as f32;
            assert!(mean.abs().max_element() < 0.07, "{marks} marks: {mean}");
        }
    }

    #[test]
    fn cells_stay_in_place_when_the_origin_moves() {
        let world = DVec3::new(1.0e6 + 0.4, -0.2, -3.0e5 + 0.7);
        let cell = |origin: DVec3| {
            let at = ShadingPoint::surface((world - origin).as_vec3(), Vec3::Y);
            let (cell, place) = grid(None, origin).cell(&at).expect("a surface");
            let kept = grid(None, origin).point(&cell, place.word);
            assert!((kept.position - at.position).abs().max_element() < 0.005);
            cell
        };
        let near = cell(world - DVec3::new(0.3, 0.2, 0.1));
        for origin in [world, world.floor(), world + DVec3::new(-870.25, 12.0, 3.3)] {
            assert_eq!(cell(origin), near, "{origin}");
        }
    }

    #[test]
    fn edges_follow_the_distance_between_their_limits() {
        // 16 pixels of 0.002 at one metre.
        let camera = Camera { eye: DVec3::ZERO, edge_per_metre: 0.032 };
        let grid = grid(Some(camera), DVec3::ZERO);
        let level = |dist: f32| {
            let (cell, _) = grid.cell(&ShadingPoint::surface(Vec3::X * dist, Vec3::Y)).expect("a surface");
            cell.level()
        };
        // The nearest power of two of 0.25 m: 0.354 m are 11.05 m away, and 0.707 m 22.1 m. The limits are 1/32 m and 8 m.
        let at = [0.0, 1.0, 11.0, 11.1, 22.0, 22.2, 176.0, 177.0, 1.0e6, f32::INFINITY, f32::NAN];
        assert_eq!(at.map(level), [0, 0, 3, 4, 4, 5, 7, 8, 8, 8, 8]);
        let (still, _) = CutGrid::new(0.25, None, DVec3::ZERO).cell(&ShadingPoint::volume(Vec3::X)).expect("a point");
        assert_eq!((still.level(), still.corner), (3, [4, 0, 0]));
    }

    #[test]
    fn segments_and_glossy_points_that_the_camera_does_not_see_share_no_cells() {
        let camera = Camera { eye: DVec3::new(0.0, 5.0, 5.0), edge_per_metre: 0.01 };
        let (with, without) = (grid(Some(camera), DVec3::ZERO), grid(None, DVec3::ZERO));
        let glossy = |view| {
            ShadingPoint::surface(Vec3::ZERO, Vec3::Y).with_gloss(Gloss {
                view,
                roughness: 0.2,
                specular: 0.5,
                diffuse: 0.1,
            })
        };
        let seen = glossy(Vec3::new(0.1, 5.0, 5.0));
        let (cell, place) = with.cell(&seen).expect("the camera sees it");
        assert!(without.cell(&seen).is_none() && with.cell(&glossy(Vec3::Y)).is_none());
        assert!(with.cell(&glossy(Vec3::splat(f32::NAN))).is_none());
        let kept = with.point(&cell, place.word).gloss.expect("glossy");
        assert!((kept.roughness - 0.2).abs() <= 0.5 / ROUGHNESS_STEPS);
        // A power of two next to 5.
        assert!((kept.specular / kept.diffuse - 4.0).abs() < 1.0e-3 && kept.specular + kept.diffuse <= 1.0 + 1.0e-6);
        let matte = with.cell(&ShadingPoint::surface(Vec3::ZERO, Vec3::Y)).expect("a surface").0;
        assert!(matte != cell && with.point(&matte, place.word).gloss.is_none());
        assert!(with.cell(&ShadingPoint::segment(Vec3::ZERO, Vec3::X, 3.0)).is_none());
    }
}
