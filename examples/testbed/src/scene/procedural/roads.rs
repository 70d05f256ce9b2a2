//! The street network: a grid of crossings with two lanes in each direction, and the paths that
//! cars follow.
//!
//! Cars drive on the right. Directions are numbered in quarter turns about +Y: 0 is +Z, 1 is +X, 2
//! is -Z, 3 is -X.

use std::f32::consts::FRAC_PI_2;

use girandole::glam::{Vec2, vec2};

/// Distance between crossings, metres.
pub const PITCH: f32 = 104.0;
/// Distance from the middle of a crossing to the lines where cars stop, metres.
pub const APPROACH: f32 = 13.0;
/// Distances of the lanes of one direction from the middle of the street, from the kerb inwards,
/// metres.
pub const LANES: [f32; 2] = [5.25, 1.75];
/// Length of a lane between two crossings, metres.
pub const LANE_LENGTH: f32 = PITCH - 2.0 * APPROACH;

/// Which way a car goes at a crossing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    /// Straight on.
    Straight,
    /// A quarter turn clockwise as seen from above.
    Right,
    /// A quarter turn counter-clockwise.
    Left,
}

const TURNS: [Turn; 3] = [Turn::Straight, Turn::Right, Turn::Left];

/// A piece of road on which cars drive one behind the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Path {
    /// From the crossing `node` in direction `heading` to the next crossing.
    Lane { node: u32, heading: u32, lane: u32 },
    /// Over the crossing `node`, which the car reaches in direction `heading`.
    Connector { node: u32, heading: u32, lane: u32, turn: Turn },
}

/// A place on the road.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// (x, z), metres.
    pub position: Vec2,
    /// The angle about +Y that turns -Z into the direction of travel, radians.
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
    /// Crossings along each side.
    pub side: u32,
    /// (x, z) of crossing 0, metres.
    pub corner: Vec2,
}

impl Roads {
    /// Number of crossings.
    pub fn nodes(&self) -> u32 {
        self.side * self.side
    }

    /// (x, z) of the middle of a crossing.
    pub fn position(&self, node: u32) -> Vec2 {
        self.corner + vec2((node % self.side) as f32, (node / self.side) as f32) * PITCH
    }

    /// The next crossing in a direction, if there is one.
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

    /// One more than the largest value of [`Roads::index`].
    pub fn path_count(&self) -> usize {
        self.nodes() as usize * 8 * (1 + TURNS.len())
    }

    /// A number that is unique to the path.
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

    /// The crossing at which a path ends.
    pub fn end(&self, path: Path) -> u32 {
        match path {
            Path::Lane { node, heading, .. } => self.neighbor(node, heading).unwrap_or(node),
            Path::Connector { node, .. } => node,
        }
    }

    /// The direction in which cars leave a path.
    pub fn exit_heading(path: Path) -> u32 {
        match path {
            Path::Lane { heading, .. } | Path::Connector { heading, turn: Turn::Straight, .. } => heading % 4,
            Path::Connector { heading, turn: Turn::Right, .. } => (heading + 3) % 4,
            Path::Connector { heading, turn: Turn::Left, .. } => (heading + 1) % 4,
        }
    }

    /// The turns at the end of a lane. The kerb lane leads straight on or right, the inner lane
    /// straight on or left. Where neither street exists, all turns that lead to a street.
    pub fn turns(&self, node: u32, heading: u32, lane: u32) -> Vec<Turn> {
        let is_street = |turn: Turn| {
            self.neighbor(node, Self::exit_heading(Path::Connector { node, heading, lane, turn })).is_some()
        };
        let own = [Turn::Straight, if lane == 0 { Turn::Right } else { Turn::Left }];
        let own: Vec<Turn> = own.into_iter().filter(|&turn| is_street(turn)).collect();
        if own.is_empty() { TURNS.into_iter().filter(|&turn| is_street(turn)).collect() } else { own }
    }

    /// The lane that follows a connector.
    pub fn after(&self, path: Path) -> Path {
        let (Path::Connector { node, lane, .. } | Path::Lane { node, lane, .. }) = path;
        Path::Lane { node, heading: Self::exit_heading(path), lane }
    }

    /// Length of a path, metres.
    pub fn length(&self, path: Path) -> f32 {
        match path {
            Path::Lane { .. } => LANE_LENGTH,
            Path::Connector { turn: Turn::Straight, .. } => 2.0 * APPROACH,
            Path::Connector { lane, turn, .. } => turn_radius(lane, turn) * FRAC_PI_2,
        }
    }

    /// The place `along` metres from the start of a path.
    pub fn pose(&self, path: Path, along: f32) -> Pose {
        let (Path::Lane { node, heading, lane } | Path::Connector { node, heading, lane, .. }) = path;
        let (forward, right) = (heading_vector(heading), right_of(heading));
        let side = right * LANES[lane as usize];
        // `heading` quarter turns take +Z to `forward`; -Z needs another half turn.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn consecutive_paths_join_in_position_and_direction() {
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
}
