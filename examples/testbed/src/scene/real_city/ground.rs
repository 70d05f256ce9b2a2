//! The ground of a real city, derived from the positions of its lamps and vehicles: roads along
//! rows of lamps, patches of road where vehicles drive, and houses away from both.

use std::collections::BTreeSet;

use girandole::glam::{Affine3A, Quat, Vec2, Vec3, vec2, vec3};

use super::grid::{Grid, key};
use super::palette::Palette;
use super::part::Part;
use super::rng::Rng;

/// Largest distance between lamps of one row, metres.
const ROW_GAP: f32 = 85.0;
/// Lamps of one row are at least this far from each other, metres. Roads follow from one lamp of each square of this
/// edge, so that their number and the time that they take are bounded by the area, however many lamps there are.
pub const LEAST_ROW_GAP: f32 = 4.0;
/// Half the width of a road, metres.
const ROAD_HALF: f32 = 4.5;
/// Distance from a row of lamps to the middle of its road, metres.
const SETBACK: f32 = 7.0;
/// Edge of the cells that record where vehicles drive, metres.
pub const DRIVEN_CELL: f32 = 3.0;

/// A straight piece of road, in (x, z).
#[derive(Clone, Copy, Debug)]
pub struct RoadSegment {
    /// Middle of the road at one end.
    pub from: Vec2,
    /// Middle of the road at the other end.
    pub to: Vec2,
}

/// Roads beside rows of lamps, and the direction of each lamp's arm.
pub fn road_segments(lamps: &[Vec2], seed: u64) -> (Vec<RoadSegment>, Vec<Vec2>) {
    let grid = Grid::new(lamps.to_vec(), ROW_GAP);
    let mut links: BTreeSet<(usize, usize)> = BTreeSet::new();
    for (index, &lamp) in lamps.iter().enumerate() {
        let near: Vec<usize> = grid.near(lamp, ROW_GAP).filter(|&other| other != index).collect();
        let closest = |is_right: &dyn Fn(usize) -> bool| {
            let distance = |other: usize| lamps[other].distance_squared(lamp);
            let right = near.iter().copied().filter(|&other| is_right(other));
            right.min_by(|&a, &b| distance(a).total_cmp(&distance(b)).then(a.cmp(&b)))
        };
        // A row continues at the nearest lamp, and at the nearest lamp in the opposite direction.
        let Some(first) = closest(&|other| lamps[other].distance(lamp) > LEAST_ROW_GAP) else { continue };
        let along = (lamps[first] - lamp).normalize();
        let second = closest(&|other| (lamps[other] - lamp).normalize_or_zero().dot(along) < -0.8);
        for other in std::iter::once(first).chain(second) {
            links.insert((index.min(other), index.max(other)));
        }
    }
    let mut rng = Rng::new(seed, 0x1a4b);
    let mut arms: Vec<Vec2> = lamps.iter().map(|_| Vec2::from_angle(rng.range(0.0, std::f32::consts::TAU))).collect();
    let mut segments = Vec::new();
    for (a, b) in links {
        let along = (lamps[b] - lamps[a]).normalize();
        // The road lies on the same side of all parallel rows.
        let along = if along.x + 0.37 * along.y < 0.0 { -along } else { along };
        let side = vec2(-along.y, along.x);
        (arms[a], arms[b]) = (side, side);
        let (from, to) = (lamps[a] + side * SETBACK, lamps[b] + side * SETBACK);
        let reach = (to - from).normalize() * 3.0;
        segments.push(RoadSegment { from: from - reach, to: to + reach });
    }
    (segments, arms)
}

/// Turns the arms of lamps to the nearest road.
pub fn turn_arms(lamps: &[Vec2], segments: &[RoadSegment], arms: &mut [Vec2]) {
    /// A lamp that is farther away than this from every road keeps its direction, metres.
    const REACH: f32 = 40.0;
    // A road is found from any of its points, which are closer to each other than the reach.
    let mut points = Vec::new();
    let mut owners = Vec::new();
    for (index, segment) in segments.iter().enumerate() {
        let count = (segment.from.distance(segment.to) / REACH).ceil().max(1.0) as usize;
        for step in 0..=count {
            points.push(segment.from.lerp(segment.to, step as f32 / count as f32));
            owners.push(index);
        }
    }
    let grid = Grid::new(points, 2.0 * REACH);
    for (lamp, arm) in lamps.iter().zip(arms) {
        let near = grid.near(*lamp, 2.0 * REACH).map(|point| segments[owners[point]]);
        let nearest = near.min_by(|a, b| a.distance(*lamp).total_cmp(&b.distance(*lamp)));
        if let Some(segment) = nearest.filter(|segment| segment.distance(*lamp) < REACH) {
            *arm = (segment.nearest(*lamp) - *lamp).normalize_or(*arm);
        }
    }
}

/// The arms of lamps, from those of the posts that they share: evenly around each. Lamps in one place thus
/// do not have the same box, for which obvhs 0.4 takes quadratic time.
pub fn share_posts(post_of: &[usize], arms: &[Vec2]) -> Vec<Vec2> {
    let mut counts = vec![0.0; arms.len()];
    post_of.iter().for_each(|&post| counts[post] += 1.0);
    let mut taken = vec![0.0; arms.len()];
    let turned = post_of.iter().map(|&post| {
        let angle = std::f32::consts::TAU * taken[post] / counts[post];
        taken[post] += 1.0;
        arms[post].rotate(Vec2::from_angle(angle))
    });
    turned.collect()
}

impl RoadSegment {
    /// The point of the middle line that is nearest to a point.
    pub fn nearest(&self, at: Vec2) -> Vec2 {
        let along = self.to - self.from;
        let t = ((at - self.from).dot(along) / along.length_squared()).clamp(0.0, 1.0);
        self.from + along * t
    }

    /// Distance of a point from the middle line of the road, metres.
    pub fn distance(&self, at: Vec2) -> f32 {
        at.distance(self.nearest(at))
    }
}

/// Roads and their markings as one part; empty if there are none.
pub fn roads(segments: &[RoadSegment], driven_cells: &BTreeSet<(i32, i32)>, palette: &mut Palette) -> Part {
    let mut part = Part::default();
    let asphalt = [0.32, 0.4, 0.48].map(|roughness| palette.glossy([0.045, 0.045, 0.048], roughness));
    let walk = palette.matte(0.21, 0.2, 0.19);
    let white = palette.glossy([0.6, 0.6, 0.58], 0.6);
    for (index, segment) in segments.iter().enumerate() {
        let along = segment.to - segment.from;
        let length = along.length();
        let (along, side) = (along / length, vec2(-along.y, along.x) / length);
        let mut slab = |from: f32, to: f32, half: f32, y: f32, material: u32| {
            let corner = |t: f32, s: f32| {
                let at = segment.from + along * t + side * s;
                vec3(at.x, y, at.y)
            };
            part.quad([corner(from, half), corner(to, half), corner(to, -half), corner(from, -half)], material);
        };
        slab(0.0, length, ROAD_HALF + 2.2, -0.03, walk);
        slab(0.0, length, ROAD_HALF, 0.0, asphalt[index % asphalt.len()]);
        let mut dash = 2.0;
        while dash + 3.0 < length {
            slab(dash, dash + 3.0, 0.07, 0.006, white);
            dash += 7.5;
        }
    }
    for &(x, z) in driven_cells {
        let (x, z) = (x as f32 * DRIVEN_CELL, z as f32 * DRIVEN_CELL);
        let material = asphalt[((x + z * 3.0) / DRIVEN_CELL).abs() as usize % asphalt.len()];
        part.floor([x - 1.2, z - 1.2], [x + DRIVEN_CELL + 1.2, z + DRIVEN_CELL + 1.2], 0.002, material);
    }
    part
}

/// Placements of houses within `reach` metres of `middle`: 12 m from lamps and from where vehicles
/// drive, 3 m from the nearest road, and not farther than 60 m from it.
pub fn house_places(
    lamps: &Grid,
    segments: &[RoadSegment],
    driven_cells: &BTreeSet<(i32, i32)>,
    middle: Vec2,
    reach: f32,
    seed: u64,
) -> Vec<Affine3A> {
    let pitch = 27.0;
    // Half the diagonal of a house, and the free space around it.
    let (half_diagonal, clearance) = (14.5, 12.0);
    let near: Vec<&RoadSegment> = segments.iter().filter(|segment| segment.distance(middle) < reach + 50.0).collect();
    let mut rng = Rng::new(seed, 0x40e5);
    let mut places = Vec::new();
    let count = (reach / pitch) as i32;
    for (x, z) in (-count..=count).flat_map(|x| (-count..=count).map(move |z| (x, z))) {
        let jitter = vec2(rng.range(-2.0, 2.0), rng.range(-2.0, 2.0));
        let at = middle + vec2(x as f32, z as f32) * pitch + jitter;
        let roll = rng.unit();
        if lamps.near(at, half_diagonal + clearance).next().is_some() || roll > 0.92 || at.distance(middle) > reach {
            continue;
        }
        let Some(closest) = near.iter().min_by(|a, b| a.distance(at).total_cmp(&b.distance(at))) else { continue };
        let distance = closest.distance(at);
        if distance < half_diagonal + ROAD_HALF + 3.0 || distance > 60.0 {
            continue;
        }
        let cells = ((half_diagonal + clearance) / DRIVEN_CELL) as i32;
        let (cx, cz) = key(at, DRIVEN_CELL);
        let driven = driven_cells
            .range((cx - cells, i32::MIN)..=(cx + cells, i32::MAX))
            .any(|cell| (cell.1 - cz).abs() <= cells);
        if driven {
            continue;
        }
        // The front faces the nearest road.
        let toward = closest.nearest(at) - at;
        let turn = Quat::from_rotation_y(toward.x.atan2(toward.y));
        // The origin of a lot is the middle of its front edge, and the lot is 24 m deep.
        let front = turn * Vec3::Z * 12.0;
        places.push(Affine3A::from_rotation_translation(turn, vec3(at.x, 0.0, at.y) + front));
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lamps_of_a_post_have_arms_evenly_around_it() {
        let arms = share_posts(&[0, 1, 1, 0, 1, 1], &[Vec2::X, Vec2::Y]);
        let expected = [Vec2::X, Vec2::Y, -Vec2::X, -Vec2::X, -Vec2::Y, Vec2::X];
        assert!(arms.iter().zip(expected).all(|(arm, expected)| arm.abs_diff_eq(expected, 1e-6)), "{arms:?}");
    }
}
