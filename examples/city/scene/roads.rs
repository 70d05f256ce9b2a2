//! The street network: a grid of crossings, two lanes a direction, and the paths that join them.
//!
//! Traffic keeps to the right. Directions are numbered in quarter turns about +Y: 0 is +Z, 1 is +X, 2 is -Z, 3 is -X.

use std::f32::consts::FRAC_PI_2;

use girandole::glam::{Vec2, vec2};

/// Distance between crossings, metres.
pub const PITCH: f32 = 104.0;
/// From the middle of a crossing to the lines where cars wait.
pub const APPROACH: f32 = 13.0;
/// Lanes of one direction, from the kerb inwards: their distance from the middle of the street.
pub const LANES: [f32; 2] = [5.25, 1.75];
/// How far a car drives on a lane between two crossings.
pub const LANE_LENGTH: f32 = PITCH - 2.0 * APPROACH;

/// Where a car goes at a crossing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    /// Straight on.
    Straight,
    /// A quarter turn clockwise, seen from above.
    Right,
    /// A quarter turn the other way.
    Left,
}

const TURNS: [Turn; 3] = [Turn::Straight, Turn::Right, Turn::Left];

/// A piece of road that cars follow one after the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Path {
    /// From `node` in direction `heading` to the next crossing.
    Lane { node: u32, heading: u32, lane: u32 },
    /// Over the crossing `node`, having come in direction `heading`.
    Connector { node: u32, heading: u32, lane: u32, turn: Turn },
}

/// A place on the road: position (x, z) and the angle about +Y that turns -Z into the direction of travel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Metres.
    pub position: Vec2,
    /// Radians.
    pub angle: f32,
}

/// The unit vector (x, z) of a direction.
pub fn heading_vector(heading: u32) -> Vec2 {
    [vec2(0.0, 1.0), vec2(1.0, 0.0), vec2(0.0, -1.0), vec2(-1.0, 0.0)][heading as usize % 4]
}

fn right_of(heading: u32) -> Vec2 {
    heading_vector(heading + 3)
}

/// A square grid of crossings.
#[derive(Clone, Copy, Debug)]
pub struct Roads {
    /// Crossings a side.
    pub side: u32,
    /// Position of crossing 0.
    pub corner: Vec2,
}

impl Roads {
    /// Number of crossings.
    pub fn nodes(&self) -> u32 {
        self.side * self.side
    }

    /// The middle of a crossing.
    pub fn position(&self, node: u32) -> Vec2 {
        self.corner + vec2((node % self.side) as f32, (node / self.side) as f32) * PITCH
    }

    /// The next crossing in a direction, if the street leads to one.
    pub fn neighbor(&self, node: u32, heading: u32) -> Option<u32> {
        let (x, z) = (node % self.side, node / self.side);
        match heading % 4 {
            0 => (z + 1 < self.side).then(|| node + self.side),
            1 => (x + 1 < self.side).then(|| node + 1),
            2 => z.checked_sub(1).map(|_| node - self.side),
            _ => x.checked_sub(1).map(|_| node - 1),
        }
    }

    /// Every lane, in a fixed order.
    pub fn lanes(&self) -> Vec<Path> {
        let starts = (0..self.nodes()).flat_map(|node| (0..4).map(move |heading| (node, heading)));
        let roads = starts.filter(|&(node, heading)| self.neighbor(node, heading).is_some());
        roads.flat_map(|(node, heading)| [0, 1].map(|lane| Path::Lane { node, heading, lane })).collect()
    }

    /// Number of values of [`Roads::index`].
    pub fn path_count(&self) -> usize {
        self.nodes() as usize * 8 * (1 + TURNS.len())
    }

    /// A path's own number.
    pub fn index(&self, path: Path) -> usize {
        let lanes = self.nodes() as usize * 8;
        let slot = |node: u32, heading: u32, lane: u32| ((node * 4 + heading % 4) * 2 + lane) as usize;
        match path {
            Path::Lane { node, heading, lane } => slot(node, heading, lane),
            Path::Connector { node, heading, lane, turn } => {
                lanes + slot(node, heading, lane) * TURNS.len() + turn as usize
            }
        }
    }

    /// The crossing that a lane ends at.
    pub fn end(&self, path: Path) -> u32 {
        match path {
            Path::Lane { node, heading, .. } => self.neighbor(node, heading).unwrap_or(node),
            Path::Connector { node, .. } => node,
        }
    }

    /// Direction in which a path is left.
    pub fn exit_heading(path: Path) -> u32 {
        match path {
            Path::Lane { heading, .. } | Path::Connector { heading, turn: Turn::Straight, .. } => heading % 4,
            Path::Connector { heading, turn: Turn::Right, .. } => (heading + 3) % 4,
            Path::Connector { heading, turn: Turn::Left, .. } => (heading + 1) % 4,
        }
    }

    /// The turns that a lane offers at its end: the kerb lane goes straight or right, the inner one straight or left;
    /// where neither exists, whatever does.
    pub fn turns(&self, node: u32, heading: u32, lane: u32) -> Vec<Turn> {
        let leads = |turn: Turn| {
            self.neighbor(node, Self::exit_heading(Path::Connector { node, heading, lane, turn })).is_some()
        };
        let own = [Turn::Straight, if lane == 0 { Turn::Right } else { Turn::Left }];
        let own: Vec<Turn> = own.into_iter().filter(|&turn| leads(turn)).collect();
        if own.is_empty() { TURNS.into_iter().filter(|&turn| leads(turn)).collect() } else { own }
    }

    /// The lane that a connector leads to.
    pub fn after(&self, path: Path) -> Path {
        let (Path::Connector { node, lane, .. } | Path::Lane { node, lane, .. }) = path;
        Path::Lane { node, heading: Self::exit_heading(path), lane }
    }

    /// Metres along the path.
    pub fn length(&self, path: Path) -> f32 {
        match path {
            Path::Lane { .. } => LANE_LENGTH,
            Path::Connector { turn: Turn::Straight, .. } => 2.0 * APPROACH,
            Path::Connector { lane, turn, .. } => turn_radius(lane, turn) * FRAC_PI_2,
        }
    }

    /// The place `along` metres from the path's start.
    pub fn pose(&self, path: Path, along: f32) -> Pose {
        let (Path::Lane { node, heading, lane } | Path::Connector { node, heading, lane, .. }) = path;
        let (forward, right) = (heading_vector(heading), right_of(heading));
        let side = right * LANES[lane as usize];
        // -Z turned by half a turn more than the quarter turns that take +Z to `forward`.
        let straight = heading as f32 * FRAC_PI_2 + std::f32::consts::PI;
        let entry = match path {
            Path::Lane { .. } => self.position(node) + forward * APPROACH + side,
            Path::Connector { .. } => self.position(node) - forward * APPROACH + side,
        };
        match path {
            Path::Connector { turn: turn @ (Turn::Right | Turn::Left), .. } => {
                let radius = turn_radius(lane, turn);
                let sign = if turn == Turn::Right { 1.0 } else { -1.0 };
                let (sin, cos) = (along / radius).sin_cos();
                let position = entry + forward * (sin * radius) + right * (sign * (1.0 - cos) * radius);
                Pose { position, angle: straight - sign * along / radius }
            }
            _ => Pose { position: entry + forward * along, angle: straight },
        }
    }
}

fn turn_radius(lane: u32, turn: Turn) -> f32 {
    match turn {
        Turn::Right => APPROACH - LANES[lane as usize],
        _ => APPROACH + LANES[lane as usize],
    }
}

/// Seconds for which each approach in turn is green, amber, and all are red.
const PHASES: [f64; 3] = [8.0, 1.5, 1.5];
/// Where the lights' round begins at time 0: the first picture shows cars that have just got green.
const ROUND_START: f64 = 18.0;

/// What a traffic light shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Signal {
    /// Stop.
    Red,
    /// About to be red.
    Amber,
    /// Go.
    Green,
}

/// Lights of one group show the same at all times; there are four.
pub fn signal_group(node: u32, side: u32, heading: u32) -> u32 {
    (heading + (node % side) + 2 * (node / side)) % 4
}

/// What a group shows at a time: one approach of each crossing after the other, so that turning cars never meet.
pub fn signal(group: u32, time: f64) -> Signal {
    let slot: f64 = PHASES.iter().sum();
    let local = (time + ROUND_START + slot * f64::from(group)).rem_euclid(4.0 * slot);
    match local {
        t if t < PHASES[0] => Signal::Green,
        t if t < PHASES[0] + PHASES[1] => Signal::Amber,
        _ => Signal::Red,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_join_without_gaps() {
        let roads = Roads { side: 3, corner: vec2(-100.0, 40.0) };
        for lane in roads.lanes() {
            let Path::Lane { heading, lane: number, .. } = lane else { unreachable!() };
            let node = roads.end(lane);
            let turns = roads.turns(node, heading, number);
            assert!(!turns.is_empty());
            for turn in turns {
                let over = Path::Connector { node, heading, lane: number, turn };
                let next = roads.after(over);
                for (from, to) in [(lane, over), (over, next)] {
                    let (a, b) = (roads.pose(from, roads.length(from)), roads.pose(to, 0.0));
                    assert!(a.position.distance(b.position) < 1e-3, "{from:?} {to:?}");
                    let turned = (a.angle - b.angle).rem_euclid(std::f32::consts::TAU);
                    assert!(turned.min(std::f32::consts::TAU - turned) < 1e-4, "{from:?} {to:?}");
                }
            }
        }
    }

    #[test]
    fn one_approach_of_a_crossing_is_open_at_a_time() {
        for tenth in 0..1000 {
            let open = (0..4).filter(|&group| signal(group, tenth as f64 * 0.1) != Signal::Red).count();
            assert!(open <= 1);
        }
    }
}
