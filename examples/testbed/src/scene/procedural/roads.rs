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

/// A piece of road on which cars drive one behind the other: a lane from the crossing `node` in direction `heading` to
/// the next crossing, or with a turn a way over the crossing `node`, which the car reaches in direction `heading`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Path {
    /// The crossing.
    pub node: u32,
    /// The direction of cars when they enter.
    pub heading: u32,
    /// The lane, from the kerb inwards.
    pub lane: u32,
    /// `None` between crossings.
    pub turn: Option<Turn>,
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
        roads.flat_map(|(node, heading)| [0, 1].map(|lane| Path { node, heading, lane, turn: None })).collect()
    }

    /// One more than the largest value of [`Roads::index`].
    pub fn path_count(&self) -> usize {
        self.nodes() as usize * 8 * (1 + TURNS.len())
    }

    /// A number that is unique to the path.
    pub fn index(&self, Path { node, heading, lane, turn }: Path) -> usize {
        let slot = ((node * 4 + heading % 4) * 2 + lane) as usize;
        turn.map_or(slot, |turn| self.nodes() as usize * 8 + slot * TURNS.len() + turn as usize)
    }

    /// The crossing at which a path ends.
    pub fn end(&self, path: Path) -> u32 {
        if path.turn.is_some() { path.node } else { self.neighbor(path.node, path.heading).unwrap_or(path.node) }
    }

    /// The ways over the crossing at the end of a lane. The kerb lane leads straight on or right, the inner lane
    /// straight on or left. Where neither street exists, all turns that lead to a street.
    pub fn ways(&self, lane: Path) -> Vec<Path> {
        let node = self.end(lane);
        let streets = |turns: &[Turn]| -> Vec<Path> {
            let ways = turns.iter().map(|&turn| Path { node, turn: Some(turn), ..lane });
            ways.filter(|&way| self.neighbor(node, self.after(way).heading).is_some()).collect()
        };
        let own = streets(&[Turn::Straight, if lane.lane == 0 { Turn::Right } else { Turn::Left }]);
        if own.is_empty() { streets(&TURNS) } else { own }
    }

    /// The lane that follows a way over a crossing.
    pub fn after(&self, way: Path) -> Path {
        let turned = way.turn.map_or(0, |turn| [0, 3, 1][turn as usize]);
        Path { heading: (way.heading + turned) % 4, turn: None, ..way }
    }

    /// Length of a path, metres.
    pub fn length(&self, path: Path) -> f32 {
        match path.turn {
            None => LANE_LENGTH,
            Some(Turn::Straight) => 2.0 * APPROACH,
            Some(turn) => turn_radius(path.lane, turn) * FRAC_PI_2,
        }
    }

    /// The place `along` metres from the start of a path.
    pub fn pose(&self, Path { node, heading, lane, turn }: Path, along: f32) -> Pose {
        let (forward, right) = (heading_vector(heading), heading_vector(heading + 3));
        let side = right * LANES[lane as usize];
        // `heading` quarter turns take +Z to `forward`; -Z needs another half turn.
        let straight = heading as f32 * FRAC_PI_2 + std::f32::consts::PI;
        let entry = self.position(node) + forward * if turn.is_none() { APPROACH } else { -APPROACH } + side;
        match turn {
            Some(turn @ (Turn::Right | Turn::Left)) => {
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
    APPROACH + if turn == Turn::Right { -LANES[lane as usize] } else { LANES[lane as usize] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn consecutive_paths_join_in_position_and_direction() {
        let roads = Roads { side: 3, corner: vec2(-100.0, 40.0) };
        for lane in roads.lanes() {
            let ways = roads.ways(lane);
            assert!(!ways.is_empty());
            for over in ways {
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
