//! When lights move: each tree's own time, frame by frame, a function of the frame and a seed alone.

use super::scene::rng::Rng;

/// Frames of a whole run, 60 a second.
pub const FRAMES: u32 = 240;

/// How the trees of a stage move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// All the time, each tree at its own pace.
    Smooth,
    /// Most trees rest; a few at a time move fast for a third of a second.
    Bursty,
    /// Lights jump to each other's places at once, each tree in frames of its own, and drift slowly between.
    Teleporting,
    /// Lights stand in order and disperse, each tree from a frame of its own.
    Scattering,
    /// Everything moves for the first third of [`FRAMES`], then all stands still.
    Rest,
}

impl Motion {
    /// All motions.
    pub const ALL: [Self; 5] = [Self::Smooth, Self::Bursty, Self::Teleporting, Self::Scattering, Self::Rest];

    /// As in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Smooth => "smooth",
            Self::Bursty => "bursty",
            Self::Teleporting => "teleporting",
            Self::Scattering => "scattering",
            Self::Rest => "rest",
        }
    }

    /// The frame up to which what is not part of any tree, the city's traffic, has moved.
    pub fn frame_of_traffic(self, frame: u32) -> u32 {
        if self == Self::Rest { frame.min(FRAMES / 3) } else { frame }
    }
}

/// Frames of a burst.
const BURST: u32 = 20;
/// A burst is so many times as fast as smooth motion.
const BURST_SPEED: f32 = 8.0;
/// Lights that drift are so many times as fast.
const DRIFT_SPEED: f32 = 0.1;
/// Lights that disperse are so many times as fast.
const SCATTER_SPEED: f32 = 1.5;

/// Where a tree is in its motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Seconds that its lights have moved.
    pub time: f32,
    /// How often they have jumped.
    pub epoch: u32,
}

/// One tree's motion.
#[derive(Clone, Copy, Debug)]
pub struct Tempo {
    motion: Motion,
    pace: f32,
    /// Frames from a burst or jump to the next.
    period: u32,
    /// Frames of the first period that have passed at the start.
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

    /// Where the tree is in a frame.
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
