//! The painted lines of a network: a double yellow line between the two directions of a road, dashed
//! white lines between the lanes of one direction, and solid white lines at the edges.

use std::collections::BTreeMap;

use girandole::glam::{DVec2, Vec2};

use super::grid::plane_line;
use super::net::{Lane, LaneUse, Network};
use super::palette::Palette;
use super::part::Part;
use super::strips::{length, parallel, piece, strip};

/// Half the width of a line, the length of a dash, and the distance from one dash to the next, metres.
const LINE_HALF: f32 = 0.06;
const DASH: f32 = 3.0;
const DASH_STEP: f32 = 9.0;
/// Distance between the middles of the two centre lines, metres.
const CENTRE_GAP: f32 = 0.24;
/// Distance of an edge line from the edge of its lane, metres.
const EDGE_INSET: f32 = 0.2;
/// The directions of a road touch each other within this distance, metres.
const TOUCH: f32 = 0.6;

/// What one draws with.
struct Painter<'a> {
    part: &'a mut Part,
    height: f32,
    white: u32,
    yellow: u32,
    /// 1 if the inner side of lanes is their left one, and -1 if it is their right one.
    inner: f32,
}

impl Painter<'_> {
    fn solid(&mut self, line: &[Vec2], material: u32) {
        strip(self.part, line, [-LINE_HALF, LINE_HALF], self.height, material);
    }

    fn dashed(&mut self, line: &[Vec2]) {
        let length = length(line);
        let mut from = 0.5 * (DASH_STEP - DASH);
        while from + DASH <= length {
            let dash = piece(line, [from, from + DASH]);
            if dash.len() >= 2 {
                self.solid(&dash, self.white);
            }
            from += DASH_STEP;
        }
    }

    /// A border of a lane, moved towards the inner side by a distance.
    fn border(&self, lane: &RoadLane, inner: bool, by: f32) -> Vec<Vec2> {
        let half = if inner { lane.half } else { -lane.half };
        parallel(&lane.line, self.inner * (half + by))
    }
}

/// A lane in the plane of the ground.
struct RoadLane {
    line: Vec<Vec2>,
    /// Half its width, metres.
    half: f32,
    is_road: bool,
}

/// Adds the lines of all edges at the given height.
pub fn paint(part: &mut Part, network: &Network, shift: DVec2, height: f32, palette: &mut Palette) {
    let white = palette.glossy([0.6, 0.6, 0.58], 0.6);
    let yellow = palette.glossy([0.62, 0.4, 0.04], 0.6);
    let inner = if network.is_left_hand { -1.0 } else { 1.0 };
    let mut painter = Painter { part, height, white, yellow, inner };
    let mut edges: BTreeMap<usize, Vec<RoadLane>> = BTreeMap::new();
    for Lane { line, width, usage, edge } in &network.lanes {
        let lane = RoadLane { line: plane_line(line, shift), half: 0.5 * width, is_road: *usage == LaneUse::Road };
        edges.entry(*edge).or_default().push(lane);
    }
    // The inner borders of the edges from one junction to another.
    let mut inner_borders: BTreeMap<[&str; 2], Vec<(usize, Vec<Vec2>)>> = BTreeMap::new();
    for (&edge, lanes) in &edges {
        if let Some(last) = lanes.last().filter(|last| last.is_road) {
            let [from, to] = &network.edges[edge];
            let border = painter.border(last, true, 0.0);
            inner_borders.entry([from, to]).or_default().push((edge, border));
        }
    }
    for (&edge, lanes) in &edges {
        for (index, lane) in lanes.iter().enumerate().filter(|(_, lane)| lane.is_road) {
            let before = index.checked_sub(1).map(|before| &lanes[before]);
            if !before.is_some_and(|before| before.is_road) {
                let line = painter.border(lane, false, EDGE_INSET);
                painter.solid(&line, white);
            }
            match lanes.get(index + 1) {
                Some(next) if next.is_road => {
                    let line = painter.border(lane, true, 0.0);
                    painter.dashed(&line);
                }
                Some(_) => {
                    let line = painter.border(lane, true, -EDGE_INSET);
                    painter.solid(&line, white);
                }
                None => {
                    let [from, to] = &network.edges[edge];
                    let is_named = !from.is_empty() && !to.is_empty();
                    let back = inner_borders.get(&[to.as_str(), from.as_str()]).filter(|_| is_named);
                    let own = painter.border(lane, true, 0.0);
                    let middle = piece(&own, [0.5 * length(&own), length(&own)]).first().copied();
                    let touches = |border: &[Vec2]| middle.is_some_and(|at| distance(at, border) < TOUCH);
                    match back.into_iter().flatten().find(|(other, border)| *other != edge && touches(border)) {
                        // The first of both edges draws the line.
                        Some((other, _)) if *other < edge => {}
                        Some(_) => {
                            for side in [-0.5, 0.5] {
                                let line = parallel(&own, side * CENTRE_GAP);
                                painter.solid(&line, painter.yellow);
                            }
                        }
                        None => {
                            let line = painter.border(lane, true, -EDGE_INSET);
                            painter.solid(&line, white);
                        }
                    }
                }
            }
        }
    }
}

/// Distance of a point from a line, metres.
fn distance(at: Vec2, line: &[Vec2]) -> f32 {
    let to_piece = |ends: &[Vec2]| {
        let along = ends[1] - ends[0];
        let t = ((at - ends[0]).dot(along) / along.length_squared().max(1e-12)).clamp(0.0, 1.0);
        at.distance(ends[0] + along * t)
    };
    line.windows(2).map(to_piece).fold(f32::INFINITY, f32::min)
}

#[cfg(test)]
mod tests {
    use girandole::glam::dvec2;

    use super::*;

    /// The total length of the lines of each material whose middle lies between two heights north.
    fn painted(network: &Network, [low, high]: [f32; 2]) -> [f32; 2] {
        let (mut part, mut palette) = (Part::default(), Palette::default());
        paint(&mut part, network, DVec2::ZERO, 0.0, &mut palette);
        let yellow = |material: u32| palette.materials[material as usize].base_color.z < 0.1;
        [false, true].map(|is_yellow| {
            let triangles = part.mesh.triangles.iter().filter(|triangle| yellow(triangle.material) == is_yellow);
            let area: f32 = triangles
                .filter(|triangle| {
                    let north = -triangle.vertices.iter().map(|vertex| vertex.z).sum::<f32>() / 3.0;
                    (low..high).contains(&north)
                })
                .map(|triangle| {
                    let [a, b, c] = triangle.vertices;
                    assert!((b - a).cross(c - a).y > 0.0, "lines face up");
                    0.5 * (b - a).cross(c - a).length()
                })
                .sum();
            area / (2.0 * LINE_HALF)
        })
    }

    #[test]
    fn a_road_that_leads_back_to_its_start_has_no_centre_line() {
        for ends in [["", ""], ["a", "a"]] {
            let one_way = Network { edges: vec![ends.map(str::to_owned)], ..road(&[1.5], &[], false) };
            assert_eq!(painted(&one_way, [-9.0, 9.0])[1], 0.0, "{ends:?}");
        }
    }

    /// A road of 90 m to the east, 3 m wide lanes at these distances north of its middle, and back.
    fn road(norths: &[f64], back: &[f64], is_left_hand: bool) -> Network {
        let lane = |north: f64, edge: usize| {
            let line = [dvec2(0.0, north), dvec2(90.0, north)];
            let line = if edge == 0 { line.to_vec() } else { line.iter().rev().copied().collect() };
            Lane { line, width: 3.0, usage: LaneUse::Road, edge }
        };
        let there = norths.iter().map(|north| lane(*north, 0));
        let back = back.iter().map(|north| lane(*north, 1));
        let edges = [["a", "b"], ["b", "a"]].map(|ends| ends.map(str::to_owned)).to_vec();
        Network { lanes: there.chain(back).collect(), edges, is_left_hand, ..Network::default() }
    }

    #[test]
    fn a_road_of_two_directions_has_one_double_line_in_its_middle() {
        for (network, name) in [
            (road(&[-4.5, -1.5], &[4.5, 1.5], false), "on the right"),
            (road(&[4.5, 1.5], &[-4.5, -1.5], true), "on the left"),
        ] {
            let close = |[white, yellow]: [f32; 2], expected: [f32; 2]| {
                (white - expected[0]).abs() < 1e-2 && (yellow - expected[1]).abs() < 1e-2
            };
            assert!(close(painted(&network, [-1.0, 1.0]), [0.0, 180.0]), "{name}");
            // Ten dashes between the lanes of each direction.
            for lanes in [[2.0, 4.0], [-4.0, -2.0]] {
                assert!(close(painted(&network, lanes), [30.0, 0.0]), "{name}: {:?}", painted(&network, lanes));
            }
            for edge in [[5.0, 7.0], [-7.0, -5.0]] {
                assert!(close(painted(&network, edge), [90.0, 0.0]), "{name}");
            }
        }
    }

    #[test]
    fn a_road_of_one_direction_and_roads_apart_have_lines_at_both_edges() {
        let one_way = road(&[0.0], &[], false);
        assert_eq!(painted(&one_way, [-9.0, 9.0]).map(f32::round), [180.0, 0.0]);
        let apart = road(&[-6.0], &[6.0], false);
        assert_eq!(painted(&apart, [-9.0, 9.0]).map(f32::round), [360.0, 0.0]);
    }

    #[test]
    fn a_walk_beside_a_lane_is_divided_by_a_solid_line() {
        let mut network = road(&[-4.5, -1.5], &[], false);
        network.lanes[0].usage = LaneUse::Walk;
        assert_eq!(painted(&network, [-4.0, -2.0]).map(f32::round), [90.0, 0.0]);
        assert_eq!(painted(&network, [-9.0, -4.0]), [0.0, 0.0]);
    }
}
