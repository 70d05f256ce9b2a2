//! How long each stage of a frame takes.

use std::ops::Add;
use std::time::{Duration, Instant};

/// Wall-clock times of the stages of a frame, in the order in which they run. No stage is part of
/// another, so that their sum is the time of the frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct StageTimes {
    /// Moves the objects and lights of the scene.
    pub animation: Duration,
    /// Refits and rebuilds light trees, and chooses which.
    pub light_update: Duration,
    /// Refits the hierarchies that rays traverse; in the first frame, measures the exposure too.
    pub geometry: Duration,
    /// Uploads lights and geometry; zero on the CPU backend. It includes the recompilation of the
    /// shader where the lights need another one.
    pub upload: Duration,
    /// Builds the top level of the light trees on the CPU. Zero on a GPU, where rendering waits for it.
    pub top_build: Duration,
    /// Renders the picture and, on a GPU, reads it back.
    pub rendering: Duration,
    /// Filters the noise; zero if it is kept.
    pub denoising: Duration,
    /// Tone mapping.
    pub tone_mapping: Duration,
    /// Encodes and writes the files.
    pub writing: Duration,
}

impl StageTimes {
    /// The names of the stages and their times, in the order in which the stages run.
    pub fn named(&self) -> [(&'static str, Duration); 9] {
        [
            ("animation", self.animation),
            ("light update", self.light_update),
            ("geometry", self.geometry),
            ("upload", self.upload),
            ("top-level build", self.top_build),
            ("rendering", self.rendering),
            ("denoising", self.denoising),
            ("tone mapping", self.tone_mapping),
            ("writing", self.writing),
        ]
    }

    /// The time of all stages together.
    pub fn total(&self) -> Duration {
        self.named().iter().map(|(_, time)| *time).sum()
    }
}

impl Add for StageTimes {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            animation: self.animation + other.animation,
            light_update: self.light_update + other.light_update,
            geometry: self.geometry + other.geometry,
            upload: self.upload + other.upload,
            top_build: self.top_build + other.top_build,
            rendering: self.rendering + other.rendering,
            denoising: self.denoising + other.denoising,
            tone_mapping: self.tone_mapping + other.tone_mapping,
            writing: self.writing + other.writing,
        }
    }
}

/// A stopwatch that is read after each stage.
pub struct Laps(Instant);

impl Laps {
    /// Starts with the first stage.
    pub fn start() -> Self {
        Self(Instant::now())
    }

    /// The time since the last call, or since the start. The next stage begins.
    pub fn lap(&mut self) -> Duration {
        let before = std::mem::replace(&mut self.0, Instant::now());
        self.0 - before
    }
}
