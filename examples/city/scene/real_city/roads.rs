//! Roads, walks, tracks and junctions of a SUMO network as one part.

use earcut::Earcut;
use girandole::glam::{DVec2, Vec2, vec3};

use super::grid::to_plane;
use super::ground::RoadSegment;
use super::net::{Lane, LaneUse, Network};
use super::palette::Palette;
use super::part::Part;

/// Heights of the surfaces, metres. They differ where they may overlap.
const ROAD: f32 = 0.0;
const JUNCTION: f32 = 0.003;
const TRACK: f32 = 0.006;
const LINE: f32 = 0.009;
const WALK: f32 = 0.03;
/// Half the width of a painted line, its length and the distance from one to the next, metres.
const LINE_HALF: f32 = 0.07;
const LINE_LENGTH: f32 = 3.0;
const LINE_STEP: f32 = 7.5;
/// A corner of a lane is at most this many times as wide as the lane.
const MOST_MITRE: f32 = 3.0;

/// The straight pieces of all lanes for vehicles, relative to `shift`.
pub fn segments(network: &Network, shift: DVec2) -> Vec<RoadSegment> {
    let roads = network.lanes.iter().filter(|lane| lane.usage == LaneUse::Road);
    let lines = roads.map(|lane| plane(&lane.line, shift));
    lines
        .flat_map(|line| line.windows(2).map(|ends| RoadSegment { from: ends[0], to: ends[1] }).collect::<Vec<_>>())
        .filter(|segment| segment.from.distance(segment.to) > 0.1)
        .collect()
}

/// Everything that is paved.
pub fn pave(network: &Network, shift: DVec2, palette: &mut Palette) -> Part {
    let mut part = Part::default();
    let asphalt = palette.glossy([0.045, 0.045, 0.048], 0.4);
    let walk = palette.matte(0.21, 0.2, 0.19);
    let gravel = palette.matte(0.12, 0.11, 0.1);
    let white = palette.glossy([0.6, 0.6, 0.58], 0.6);
    for Lane { line, width, usage } in &network.lanes {
        let line = plane(line, shift);
        let (height, material) = match usage {
            LaneUse::Road => (ROAD, asphalt),
            LaneUse::Walk => (WALK, walk),
            LaneUse::Rail => (TRACK, gravel),
        };
        let half = 0.5 * width;
        strip(&mut part, &line, [-half, half], height, material);
        if *usage == LaneUse::Road {
            // The line on the left of a lane divides it from the next one.
            dashes(&mut part, &line, half, white);
        }
    }
    let mut earcut = Earcut::new();
    let mut corners: Vec<u32> = Vec::new();
    for border in &network.junctions {
        let border = plane(border, shift);
        earcut.earcut(border.iter().map(|at| at.to_array()), &[], &mut corners);
        for corner in corners.chunks_exact(3) {
            let [a, b, c] = [0, 1, 2].map(|i: usize| border[corner[i] as usize]);
            let up = if (b - a).perp_dot(c - a) < 0.0 { [a, b, c] } else { [a, c, b] };
            part.triangle(up.map(|at| vec3(at.x, JUNCTION, at.y)), asphalt);
        }
    }
    part
}

fn plane(line: &[DVec2], shift: DVec2) -> Vec<Vec2> {
    line.iter().map(|at| to_plane(*at - shift)).collect()
}

/// For each point of a line, the vector to the parallel line one metre to its left. At a corner it is
/// longer than a metre, by a factor of at most [`MOST_MITRE`].
fn sides(line: &[Vec2]) -> Vec<Vec2> {
    // North is -z, so the left of (x, z) is (z, -x).
    let left = |from: Vec2, to: Vec2| {
        let along = (to - from).normalize_or_zero();
        Vec2::new(along.y, -along.x)
    };
    (0..line.len())
        .map(|i| {
            let before = if i > 0 { left(line[i - 1], line[i]) } else { left(line[0], line[1]) };
            let after = if i + 1 < line.len() { left(line[i], line[i + 1]) } else { before };
            let middle = (before + after).normalize_or(before);
            middle / middle.dot(before).max(1.0 / MOST_MITRE)
        })
        .collect()
}

/// A strip along a line, between two distances to its left.
fn strip(part: &mut Part, line: &[Vec2], [right, left]: [f32; 2], height: f32, material: u32) {
    let sides = sides(line);
    for i in 1..line.len() {
        let at = |i: usize, side: f32| {
            let at = line[i] + sides[i] * side;
            vec3(at.x, height, at.y)
        };
        part.quad([at(i - 1, right), at(i, right), at(i, left), at(i - 1, left)], material);
    }
}

/// Short lines at a distance to the left of a line.
fn dashes(part: &mut Part, line: &[Vec2], left: f32, material: u32) {
    for ends in line.windows(2) {
        let length = ends[0].distance(ends[1]);
        let along = (ends[1] - ends[0]).normalize_or_zero();
        let mut from = 0.5 * (LINE_STEP - LINE_LENGTH);
        while from + LINE_LENGTH <= length {
            let dash = [ends[0] + along * from, ends[0] + along * (from + LINE_LENGTH)];
            strip(part, &dash, [left - LINE_HALF, left + LINE_HALF], LINE, material);
            from += LINE_STEP;
        }
    }
}

#[cfg(test)]
mod tests {
    use girandole::glam::{Vec3, dvec2};

    use super::*;

    fn area(part: &Part, height: f32) -> f32 {
        let flat = part.mesh.triangles.iter().filter(|triangle| triangle.vertices[0].y == height);
        flat.map(|triangle| {
            let [a, b, c] = triangle.vertices;
            let normal = (b - a).cross(c - a);
            assert!(normal.y > 0.0, "a floor faces up");
            0.5 * normal.dot(Vec3::Y)
        })
        .sum()
    }

    #[test]
    fn lanes_and_junctions_have_their_areas_and_face_up() {
        // A lane with a right angle, and a junction in the shape of an L.
        let line = [(0.0, 0.0), (10.0, 0.0), (10.0, 20.0)].map(|(x, y)| dvec2(x, y)).to_vec();
        let l = [(0.0, 0.0), (4.0, 0.0), (4.0, 1.0), (1.0, 1.0), (1.0, 4.0), (0.0, 4.0)];
        let network = Network {
            offset: DVec2::ZERO,
            lanes: vec![Lane { line, width: 3.0, usage: LaneUse::Road }],
            junctions: vec![l.map(|(x, y)| dvec2(x, y)).to_vec()],
        };
        let part = pave(&network, dvec2(100.0, 50.0), &mut Palette::default());
        assert!((area(&part, ROAD) - 3.0 * 30.0).abs() < 1e-3, "{}", area(&part, ROAD));
        assert!((area(&part, JUNCTION) - 7.0).abs() < 1e-3, "{}", area(&part, JUNCTION));
        assert!(area(&part, LINE) > 0.0);
        let segments = segments(&network, dvec2(100.0, 50.0));
        assert_eq!(
            (segments.len(), segments[0].from, segments[0].to),
            (2, Vec2::new(-100.0, 50.0), Vec2::new(-90.0, 50.0))
        );
    }
}
