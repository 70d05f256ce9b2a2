//! Roads, walks, tracks and junctions of a SUMO network as one part.

use earcut::Earcut;
use girandole::glam::{DVec2, vec3};

use super::grid::plane_line;
use super::ground::RoadSegment;
use super::lane_lines;
use super::net::{Lane, LaneUse, Network};
use super::palette::Palette;
use super::part::Part;
use super::strips::strip;

/// Heights of the surfaces, metres. They differ where they may overlap.
const ROAD: f32 = 0.0;
const JUNCTION: f32 = 0.003;
const TRACK: f32 = 0.006;
const LINE: f32 = 0.009;
const WALK: f32 = 0.03;

/// The straight pieces of all lanes for vehicles, relative to `shift`.
pub fn segments(network: &Network, shift: DVec2) -> Vec<RoadSegment> {
    let roads = network.lanes.iter().filter(|lane| lane.usage == LaneUse::Road);
    let lines = roads.map(|lane| plane_line(&lane.line, shift));
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
    for Lane { line, width, usage, .. } in &network.lanes {
        let line = plane_line(line, shift);
        let (height, material) = match usage {
            LaneUse::Road => (ROAD, asphalt),
            LaneUse::Walk => (WALK, walk),
            LaneUse::Rail => (TRACK, gravel),
        };
        let half = 0.5 * width;
        strip(&mut part, &line, [-half, half], height, material);
    }
    lane_lines::paint(&mut part, network, shift, LINE, palette);
    let mut earcut = Earcut::new();
    let mut corners: Vec<u32> = Vec::new();
    for border in &network.junctions {
        let border = plane_line(border, shift);
        earcut.earcut(border.iter().map(|at| at.to_array()), &[], &mut corners);
        for corner in corners.chunks_exact(3) {
            let [a, b, c] = [0, 1, 2].map(|i: usize| border[corner[i] as usize]);
            let up = if (b - a).perp_dot(c - a) < 0.0 { [a, b, c] } else { [a, c, b] };
            part.triangle(up.map(|at| vec3(at.x, JUNCTION, at.y)), asphalt);
        }
    }
    part
}

#[cfg(test)]
mod tests {
    use girandole::glam::{Vec2, Vec3, dvec2};

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
            lanes: vec![Lane { line, width: 3.0, usage: LaneUse::Road, edge: 0 }],
            edges: vec![["a", "b"].map(str::to_owned)],
            junctions: vec![l.map(|(x, y)| dvec2(x, y)).to_vec()],
            ..Network::default()
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
