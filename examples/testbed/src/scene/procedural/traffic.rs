//! Simulated traffic: cars follow each other, wait at red lights and turn at crossings.
//!
//! Based on the intelligent driver model of Treiber, Hennecke and Helbing (2000). Steps have a
//! fixed length, so that the same seed gives the same traffic at any frame rate.

use std::collections::VecDeque;

use super::SceneError;
use super::rng::Rng;
use super::roads::{LANE_LENGTH, Path, Pose, Roads, Turn};
use super::signals::{Signal, signal, signal_group};

/// Seconds per step. Between steps, cars move on at their current speed.
const STEP: f64 = 0.1;
/// Speed on a free lane, and on each turn at a crossing, m/s.
const FREE_SPEED: f32 = 12.5;
const TURN_SPEEDS: [f32; 3] = [FREE_SPEED, 4.5, 6.5];
/// Largest acceleration, m/s^2.
const ACCELERATION: f32 = 1.8;
/// Comfortable deceleration, m/s^2.
const BRAKING: f32 = 2.6;
/// Distance between bumpers in a queue, metres.
const STANDSTILL: f32 = 2.2;
/// Time by which a car follows the one in front, seconds.
const HEADWAY: f32 = 1.1;

/// A car on the road.
#[derive(Clone, Copy, Debug)]
pub struct Car {
    path: Path,
    /// Position of its middle along its path, metres.
    along: f32,
    speed: f32,
    length: f32,
    turn: Turn,
    /// Its desired speed as a share of the free speed.
    pace: f32,
    rng: Rng,
}

/// All cars.
pub struct Traffic {
    roads: Roads,
    cars: Vec<Car>,
    /// The cars of each path by [`Roads::index`], the foremost car first.
    queues: Vec<VecDeque<u32>>,
    /// The paths that exist, with their indices, in the order in which a step visits them.
    paths: Vec<(usize, Path)>,
    time: f64,
}

impl Traffic {
    /// Distributes cars of the given lengths, in metres, over the lanes and lets them drive for a
    /// while.
    pub fn new(roads: Roads, lengths: &[f32], seed: u64) -> Result<Self, SceneError> {
        let lanes = roads.lanes();
        let longest = lengths.iter().copied().fold(4.0, f32::max);
        let slot = longest + STANDSTILL + 1.0;
        let slots = (LANE_LENGTH / slot).floor() as usize;
        if lengths.len() > lanes.len() * slots {
            let limit = lanes.len() * slots;
            return Err(SceneError(format!("{} cars do not fit; the lanes of this city hold {limit}", lengths.len())));
        }
        let mut rng = Rng::new(seed, 0x0ca4);
        // The slots of all lanes in random order; cars take the first ones.
        let mut places: Vec<usize> = (0..lanes.len() * slots).collect();
        for taken in 0..lengths.len() {
            let other = taken + rng.below(places.len() - taken);
            places.swap(taken, other);
        }
        let car = |(car, &length): (usize, &f32)| {
            let (path, along) = (lanes[places[car] / slots], ((places[car] % slots) as f32 + 0.5) * slot);
            let mut rng = Rng::new(seed, 0x1000 + car as u64);
            let pace = rng.range(0.8, 1.1);
            let mut car = Car { path, along, speed: 8.0, length, turn: Turn::Straight, pace, rng };
            car.choose_turn(&roads);
            car
        };
        let cars: Vec<Car> = lengths.iter().enumerate().map(car).collect();
        // Higher slots are nearer to the end of the lane, so that cars enter their queues in
        // descending order of slots.
        let mut order: Vec<usize> = (0..cars.len()).collect();
        order.sort_by_key(|&car| std::cmp::Reverse(places[car]));
        let mut queues = vec![VecDeque::new(); roads.path_count()];
        order.into_iter().for_each(|car| queues[roads.index(cars[car].path)].push_back(car as u32));
        let paths = lanes.into_iter().flat_map(|lane| [vec![lane], roads.ways(lane)].concat());
        let paths = paths.map(|path| (roads.index(path), path)).collect();
        /// Seconds before the first picture.
        const WARM_UP: f64 = 43.0;
        let mut traffic = Self { roads, cars, queues, paths, time: -WARM_UP };
        traffic.advance(0.0);
        Ok(traffic)
    }

    /// Simulates up to `time`, in seconds.
    pub fn advance(&mut self, time: f64) {
        while self.time + STEP <= time + 1e-9 {
            self.step();
        }
    }

    /// The place of a car at `time`, which is at most one step ahead of the simulation.
    pub fn pose(&self, car: usize, time: f64) -> Pose {
        let car = &self.cars[car];
        let ahead = car.along + car.speed * (time - self.time).clamp(0.0, STEP) as f32;
        let length = self.roads.length(car.path);
        if ahead <= length { self.roads.pose(car.path, ahead) } else { self.roads.pose(self.next(car), ahead - length) }
    }

    /// The path that a car follows next.
    fn next(&self, car: &Car) -> Path {
        match car.path.turn {
            None => Path { node: self.roads.end(car.path), turn: Some(car.turn), ..car.path },
            Some(_) => self.roads.after(car.path),
        }
    }

    /// The free length behind the last car of a path, in metres from the start of the path, and the
    /// speed of that car.
    fn free_length(&self, path: Path) -> Option<(f32, f32)> {
        let last = *self.queues[self.roads.index(path)].back()? as usize;
        Some((self.cars[last].along - self.cars[last].length * 0.5, self.cars[last].speed))
    }

    /// For the first car of a path, the distance to the next obstacle and the speed of the
    /// obstacle.
    fn gap_of_first(&self, car: &Car) -> (f32, f32) {
        let left = self.roads.length(car.path) - car.along - car.length * 0.5;
        let free = (1e4, FREE_SPEED);
        let next = self.next(car);
        if car.path.turn.is_some() {
            return self.free_length(next).map_or(free, |(room, speed)| (left + room, speed));
        }
        let shown = signal(signal_group(next.node, self.roads.side, next.heading), self.time);
        let stops = car.speed * car.speed / (2.0 * 4.0) < left;
        let closed = shown == Signal::Red || (shown == Signal::Amber && stops);
        // A car does not enter a crossing that it could not leave.
        let beyond = self.roads.after(next);
        let full = self.free_length(beyond).is_some_and(|(room, speed)| room < car.length + 3.0 && speed < 3.0);
        // A car whose front is past the line drives on; only its middle is still on the lane.
        if (closed || full) && left > -0.5 {
            return (left + STANDSTILL - 0.6, 0.0);
        }
        match (self.free_length(next), self.free_length(beyond)) {
            (Some((room, speed)), _) => (left + room, speed),
            (None, Some((room, speed))) => (left + self.roads.length(next) + room, speed),
            (None, None) => free,
        }
    }

    /// The acceleration of a car at a distance `gap` behind an obstacle of speed `leader_speed`.
    fn acceleration(&self, car: &Car, gap: f32, leader_speed: f32) -> f32 {
        let mut desired_speed = FREE_SPEED * car.pace;
        match car.path.turn {
            Some(turn) => desired_speed = desired_speed.min(TURN_SPEEDS[turn as usize]),
            None => {
                let left = (LANE_LENGTH - car.along).max(0.0);
                let limit = TURN_SPEEDS[car.turn as usize];
                desired_speed = desired_speed.min((limit * limit + 2.0 * 1.8 * left).sqrt());
            }
        }
        let closing = car.speed * (car.speed - leader_speed) / (2.0 * (ACCELERATION * BRAKING).sqrt());
        let desired_gap = STANDSTILL + (car.speed * HEADWAY + closing).max(0.0);
        let interaction = desired_gap / gap.max(0.1);
        let free = (car.speed / desired_speed).powi(4);
        (ACCELERATION * (1.0 - free - interaction * interaction)).max(-8.0)
    }

    fn step(&mut self) {
        let mut accelerations = vec![0.0; self.cars.len()];
        for (index, _) in &self.paths {
            let queue = &self.queues[*index];
            for (place, &car) in queue.iter().enumerate() {
                let own = &self.cars[car as usize];
                let (gap, leader_speed) = match place.checked_sub(1).map(|ahead| &self.cars[queue[ahead] as usize]) {
                    Some(ahead) => (ahead.along - own.along - (ahead.length + own.length) * 0.5, ahead.speed),
                    None => self.gap_of_first(own),
                };
                accelerations[car as usize] = self.acceleration(own, gap, leader_speed);
            }
        }
        let dt = STEP as f32;
        for (car, acceleration) in self.cars.iter_mut().zip(accelerations) {
            car.speed = (car.speed + acceleration * dt).max(0.0);
            car.along += car.speed * dt;
        }
        for place in 0..self.paths.len() {
            let (index, path) = self.paths[place];
            let length = self.roads.length(path);
            while let Some(&first) = self.queues[index].front() {
                let car = self.cars[first as usize];
                if car.along <= length {
                    break;
                }
                let next = self.next(&car);
                self.queues[index].pop_front();
                self.queues[self.roads.index(next)].push_back(first);
                let car = &mut self.cars[first as usize];
                car.path = next;
                car.along -= length;
                if next.turn.is_none() {
                    car.choose_turn(&self.roads);
                }
            }
        }
        self.time += STEP;
    }
}

impl Car {
    /// Chooses the turn at the end of its lane.
    fn choose_turn(&mut self, roads: &Roads) {
        let turns: Vec<Turn> = roads.ways(self.path).iter().filter_map(|way| way.turn).collect();
        let straight = turns.contains(&Turn::Straight) && self.rng.chance(0.6);
        self.turn = if straight { Turn::Straight } else { self.rng.pick(&turns) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use girandole::glam::vec2;

    fn busy_streets() -> Traffic {
        let roads = Roads { side: 4, corner: vec2(-150.0, -150.0) };
        let lengths: Vec<f32> = (0..240).map(|car| [4.6, 3.9, 11.0, 5.2][car % 4]).collect();
        Traffic::new(roads, &lengths, 7).unwrap()
    }

    #[test]
    fn cars_stay_on_their_paths_and_never_overlap() {
        let mut traffic = busy_streets();
        let mut turned = 0;
        for frame in 1..900 {
            traffic.advance(frame as f64 * 0.1);
            for (index, path) in &traffic.paths {
                let queue: Vec<&Car> = traffic.queues[*index].iter().map(|&car| &traffic.cars[car as usize]).collect();
                for pair in queue.windows(2) {
                    let gap = pair[0].along - pair[1].along - (pair[0].length + pair[1].length) * 0.5;
                    assert!(gap > 0.0, "{path:?} at frame {frame}: gap {gap}");
                }
                for car in queue {
                    assert!(car.along >= 0.0 && car.along <= traffic.roads.length(*path));
                    turned += usize::from(matches!(path.turn, Some(Turn::Left | Turn::Right)));
                }
            }
        }
        assert!(turned > 1000, "only {turned} cars were turning");
    }

    #[test]
    fn cars_move_and_some_stand_still() {
        let mut traffic = busy_streets();
        let mut travelled = 0.0;
        let mut standing = 0;
        for frame in 1..600 {
            traffic.advance(frame as f64 * 0.1);
            travelled += traffic.cars.iter().map(|car| car.speed * 0.1).sum::<f32>();
            standing += traffic.cars.iter().filter(|car| car.speed < 0.05).count();
        }
        let mean = travelled / traffic.cars.len() as f32 / 60.0;
        assert!((1.5..9.0).contains(&mean), "mean speed {mean}");
        assert!(standing > 1000);
    }

    #[test]
    fn the_same_seed_gives_the_same_traffic_at_any_frame_rate() {
        let (mut smooth, mut jerky) = (busy_streets(), busy_streets());
        (1..=400).for_each(|frame| smooth.advance(frame as f64 * 0.025));
        jerky.advance(10.0);
        assert!((0..smooth.cars.len()).all(|car| smooth.pose(car, 10.0) == jerky.pose(car, 10.0)));
    }

    #[test]
    fn too_many_cars_are_refused() {
        let roads = Roads { side: 2, corner: vec2(0.0, 0.0) };
        assert!(Traffic::new(roads, &[4.0; 5000], 1).is_err());
    }
}
