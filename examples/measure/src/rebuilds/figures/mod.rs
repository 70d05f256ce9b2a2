//! The lights of deforming trees as functions of time, in the tree's own space: metres, Y up.

mod crowd;
mod ferris_wheel;
mod figure;
mod market;
mod parade;
mod strings;
mod swarm;
mod trade;

use super::motion::{Moment, Motion, Tempo};
use girandole::glam::{Vec3, vec3};
use girandole::light::luminance;
use girandole::{Light, Shape};
use testbed::scene::rng::Rng;

use figure::Figure;

/// The kinds of figures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Strings of bulbs that swing.
    Strings,
    /// Drones that trade places.
    Swarm,
    /// A turning wheel with upright gondolas.
    FerrisWheel,
    /// Stalls with lamps that are carried from one to another.
    Market,
    /// Floats and lanterns that pass each other.
    Parade,
    /// People with lanterns who disperse.
    Crowd,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Self; 6] = [Self::Strings, Self::Swarm, Self::FerrisWheel, Self::Market, Self::Parade, Self::Crowd];

    /// The kind's name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Strings => "strings",
            Self::Swarm => "swarm",
            Self::FerrisWheel => "ferris wheel",
            Self::Market => "market",
            Self::Parade => "parade",
            Self::Crowd => "crowd",
        }
    }

    /// The kind of the `index`-th tree of a stage. Ten trees in a row have all kinds; a stage that
    /// scatters has mostly crowds.
    pub fn of(index: usize, motion: Motion) -> Self {
        let all = match motion {
            Motion::Scattering => [
                Self::Crowd,
                Self::Strings,
                Self::Crowd,
                Self::Swarm,
                Self::Crowd,
                Self::Parade,
                Self::Crowd,
                Self::Market,
                Self::Crowd,
                Self::FerrisWheel,
            ],
            _ => [
                Self::Swarm,
                Self::Strings,
                Self::Market,
                Self::Parade,
                Self::FerrisWheel,
                Self::Crowd,
                Self::Swarm,
                Self::Strings,
                Self::Market,
                Self::Parade,
            ],
        };
        all[index % all.len()]
    }

    /// The flux of one light in lumens, before random variation.
    fn lumens(self) -> f32 {
        match self {
            Self::Strings => 500.0,
            Self::Swarm => 3_000.0,
            Self::FerrisWheel => 800.0,
            Self::Market => 1_500.0,
            Self::Parade => 1_500.0,
            Self::Crowd => 1_000.0,
        }
    }

    /// The share of such figures that only shine down.
    fn beams(self) -> f32 {
        match self {
            Self::Swarm | Self::Market => 0.4,
            Self::Parade | Self::FerrisWheel => 0.25,
            Self::Strings | Self::Crowd => 0.0,
        }
    }

    fn figure(self, rng: &mut Rng) -> Box<dyn Figure> {
        match self {
            Self::Strings => Box::new(strings::Strings::new(rng)),
            Self::Swarm => Box::new(swarm::Swarm::new(rng)),
            Self::FerrisWheel => Box::new(ferris_wheel::FerrisWheel::new(rng)),
            Self::Market => Box::new(market::Market::new(rng)),
            Self::Parade => Box::new(parade::Parade::new(rng)),
            Self::Crowd => Box::new(crowd::Crowd::new(rng)),
        }
    }
}

/// The lights of a figure, frame by frame.
pub struct Troupe {
    /// The kind of figure.
    pub kind: Kind,
    figure: Box<dyn Figure>,
    tempo: Tempo,
    /// The lights as of `moment`.
    lights: Vec<Light>,
    moment: Moment,
    /// The light whose place each light takes since the last jump.
    order: Vec<u32>,
    /// The share of the lights that jump.
    jumping: f32,
    seed: u64,
}

impl Troupe {
    /// Draws a figure of a kind, its lights and its tempo. The lights are those of frame 0.
    pub fn new(kind: Kind, motion: Motion, seed: u64) -> Self {
        let mut rng = Rng::new(seed, 0xf160);
        let figure = kind.figure(&mut rng);
        let tempo = Tempo::new(motion, &mut rng);
        let jumping = if rng.chance(0.5) { 1.0 } else { rng.range(0.1, 0.7) };
        let tint = vec3(rng.range(0.2, 1.0), rng.range(0.3, 0.8), rng.range(0.1, 0.9));
        let is_beam = rng.chance(kind.beams());
        let outer_angle = rng.range(0.9, 1.4);
        let light = |light: usize| {
            let place = figure.place(light, 0.0);
            let color = tint.lerp(vec3(rng.unit(), rng.unit(), rng.unit()), 0.3);
            let color = color / luminance(color) * (kind.lumens() * 2.0_f32.powf(rng.range(-1.0, 1.0)));
            match kind {
                // A sphere of L nits emits 4 pi^2 r^2 L lumens.
                _ if is_beam => Light::spot(place, Vec3::NEG_Y, 0.5 * outer_angle, outer_angle, color / 3.5),
                Kind::Strings | Kind::Market => {
                    let radius = 0.06;
                    Light::sphere(place, radius, color / (39.478_418 * radius * radius))
                }
                _ => Light::point(place, color / 12.566_371),
            }
        };
        let lights: Vec<Light> = (0..figure.count()).map(light).collect();
        let order = (0..lights.len() as u32).collect();
        let moment = Moment { time: 0.0, epoch: 0 };
        let mut troupe = Self { kind, figure, tempo, lights, moment, order, jumping, seed };
        troupe.advance(0);
        troupe
    }

    /// The lights as of the last [`Troupe::advance`].
    pub fn lights(&self) -> &[Light] {
        &self.lights
    }

    /// Moves the lights to a frame. Returns false if none of them moved.
    pub fn advance(&mut self, frame: u32) -> bool {
        let moment = self.tempo.at(frame);
        if moment == self.moment {
            return false;
        }
        if moment.epoch != self.moment.epoch {
            self.jump(moment.epoch);
        }
        self.moment = moment;
        let Self { figure, lights, order, .. } = self;
        for (light, place) in lights.iter_mut().zip(order) {
            move_to(light, figure.place(*place as usize, moment.time));
        }
        true
    }

    /// Assigns places at random. In epoch 0 each light has its own.
    fn jump(&mut self, epoch: u32) {
        let count = self.order.len();
        self.order = (0..count as u32).collect();
        if epoch > 0 {
            let mut rng = Rng::new(self.seed, 0x1000 + u64::from(epoch));
            let movers: Vec<usize> = (0..count).filter(|_| rng.chance(self.jumping)).collect();
            for i in 1..movers.len() {
                self.order.swap(movers[i], movers[rng.below(i + 1)]);
            }
        }
    }
}

fn move_to(light: &mut Light, place: Vec3) {
    match &mut light.shape {
        Shape::Point { position } | Shape::Spot { position, .. } | Shape::Profile { position, .. } => *position = place,
        Shape::Sphere { center, .. } | Shape::Rectangle { center, .. } => *center = place,
        Shape::Triangle { vertices, .. } => {
            let shift = place - vertices[0];
            vertices.iter_mut().for_each(|vertex| *vertex += shift);
        }
        &mut _ => unreachable!("this version has no others"),
    }
}
