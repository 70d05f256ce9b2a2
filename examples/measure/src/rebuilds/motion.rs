//! When lights move: each tree has a time of its own, which depends only on the frame and a seed.

use testbed::scene::rng::Rng;

/// The frames of a whole run, 60 per second.
pub const FRAMES: u32 = 240;

/// How the trees of a stage move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// Trees move all the time, each at its own pace.
    Smooth,
    /// Most trees rest; a few at a time move fast for a third of a second.
    Bursty,
    /// The lights of a tree jump to each other's places in certain frames, and drift slowly in
    /// between.
    Teleporting,
    /// The lights of a tree stand in order and disperse from a certain frame on.
    Scattering,
    /// Everything moves during the first third of [`FRAMES`] and then stands still.
    Rest,
}

impl Motion {
    /// All motions.
    pub const ALL: [Self; 5] = [Self::Smooth, Self::Bursty, Self::Teleporting, Self::Scattering, Self::Rest];

    /// The motion's name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Smooth => "smooth",
            Self::Bursty => "bursty",
            Self::Teleporting => "teleporting",
            Self::Scattering => "scattering",
            Self::Rest => "rest",
        }
    }

    /// The frame whose traffic the city shows in a frame. Traffic is not part of any deforming
    /// tree.
    pub fn frame_of_traffic(self, frame: u32) -> u32 {
        if self == Self::Rest { frame.min(FRAMES / 3) } else { frame }
    }
}

/// The length of a burst, in frames.
const BURST: u32 = 20;
/// The speed of a burst, as a multiple of smooth motion.
const BURST_SPEED: f32 = 8.0;
/// The speed of drifting lights, in the same unit.
const DRIFT_SPEED: f32 = 0.1;
/// The speed of dispersing lights, in the same unit.
const SCATTER_SPEED: f32 = 1.5;

/// The state of a tree's motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// How long its lights have moved, in seconds.
    pub time: f32,
    /// How often its lights have jumped.
    pub epoch: u32,
}

/// The motion of one tree.
#[derive(Clone, Copy, Debug)]
pub struct Tempo {
    motion: Motion,
    pace: f32,
    /// Frames from one burst or jump to the next.
    period: u32,
    /// Frames of the first period that have already passed at the start.
    offset: u32,
    /// The frame in which lights begin to disperse.
    start: u32,
}

impl Tempo {
    /// Draws a tree's pace and frames.
    pub fn new(motion: Motion, rng: &mut Rng) -> Self {
        let period = if motion == Motion::Bursty { 80 + rng.below(120) } else { 40 + rng.below(51) };
        let (offset, start) = (rng.below(period), rng.below(FRAMES as usize * 3 / 8));
        Self { motion, pace: rng.range(0.6, 1.4), period: period as u32, offset: offset as u32, start: start as u32 }
    }

    /// The state of the motion in a frame.
    pub fn at(&self, frame: u32) -> Moment {
        let seconds = |frames: u32| frames as f32 / 60.0 * self.pace;
        let passed = frame + self.offset;
        let still = |time| Moment { time, epoch: 0 };
        match self.motion {
            Motion::Smooth => still(seconds(frame)),
            Motion::Rest => still(seconds(frame.min(FRAMES / 3))),
            Motion::Bursty => {
                let frames = |passed: u32| passed / self.period * BURST + (passed % self.period).min(BURST);
                still(BURST_SPEED * seconds(frames(passed) - frames(self.offset)))
            }
            Motion::Teleporting => Moment { time: DRIFT_SPEED * seconds(frame), epoch: passed / self.period },
            Motion::Scattering => still(SCATTER_SPEED * seconds(frame.saturating_sub(self.start))),
        }
    }
}
