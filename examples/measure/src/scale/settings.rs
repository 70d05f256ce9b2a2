//! The sizes of a flight.

use girandole::plan::PlanLimits;
use std::time::Duration;

/// The world, the path, and the limits of each frame.
#[derive(Clone, Debug)]
pub struct Settings {
    pub seed: u64,
    /// Blocks along each side of the world, which is a square.
    pub blocks: u32,
    /// The edge of a block, in metres.
    pub block_size: f64,
    /// Lights of a block, on average: see `blocks.rs`.
    pub lights_per_block: f32,
    /// All lights are points, which the tests' checker of buffers needs.
    pub is_plain: bool,
    /// Blocks whose middle is within this horizontal distance of the camera should be resident, in
    /// metres.
    pub radius: f64,
    /// Frames of one round along the path.
    pub frames: u32,
    /// Metres per second.
    pub speed: f64,
    /// Vehicles that move in each frame.
    pub vehicles: usize,
    /// Blocks with lights that flicker, along each side of a square around the camera.
    pub flickering: i32,
    /// The most blocks that arrive, and the most that leave, in one frame.
    pub blocks_per_frame: usize,
    /// Frames from the request of a block to its arrival.
    pub latency: u32,
    /// The budget for rebuilds in one frame.
    pub budget: Duration,
    pub limits: PlanLimits,
}

impl Settings {
    /// Ten million lights.
    pub fn full(seed: u64) -> Self {
        Self {
            seed,
            blocks: 160,
            block_size: 125.0,
            lights_per_block: 392.0,
            is_plain: false,
            radius: 3570.0,
            frames: 10_000,
            speed: 200.0,
            vehicles: 1_000,
            flickering: 4,
            blocks_per_frame: 2,
            latency: 8,
            budget: Duration::from_micros(300),
            limits: PlanLimits::default().with_tree_memory(128 << 20).with_frame_bytes(256 << 10),
        }
    }

    /// A world of 5 km with 600,000 lights, and 600 frames.
    pub fn quick(seed: u64) -> Self {
        let limits = PlanLimits::default().with_tree_memory(16 << 20).with_frame_bytes(256 << 10);
        Self { blocks: 40, radius: 900.0, frames: 600, vehicles: 200, limits, ..Self::full(seed) }
    }

    /// Metres of one round.
    pub fn length(&self) -> f64 {
        self.speed * f64::from(self.frames) / 60.0
    }

    /// The edge of the world, in metres.
    pub fn world_size(&self) -> f64 {
        f64::from(self.blocks) * self.block_size
    }
}
