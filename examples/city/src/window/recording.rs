//! What the plots of the panel show: the last frames.

use super::app::session::FrameStats;
use super::app::stage_times::StageTimes;
use std::collections::VecDeque;

/// Frames that are kept.
const LENGTH: usize = 240;

/// One frame.
#[derive(Clone, Debug)]
pub struct Record {
    /// Number of the frame.
    pub frame: u32,
    /// Time of each stage.
    pub times: StageTimes,
    /// Time that rebuilds were allowed to take, microseconds.
    pub budget_us: f64,
    /// Time that rebuilds took, microseconds.
    pub spent_us: f64,
    /// Bytes of light data that were uploaded.
    pub upload_bytes: u64,
}

/// The last frames, the oldest first.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    records: VecDeque<Record>,
}

impl Recording {
    /// Adds a frame, and forgets the oldest one if there are too many.
    pub fn add(&mut self, stats: &FrameStats) {
        if self.records.len() == LENGTH {
            self.records.pop_front();
        }
        self.records.push_back(Record {
            frame: stats.frame,
            times: stats.times,
            budget_us: stats.budget.as_secs_f64() * 1e6,
            spent_us: stats.spent.as_secs_f64() * 1e6,
            upload_bytes: stats.upload_bytes,
        });
    }

    /// Forgets all frames.
    pub fn clear(&mut self) {
        self.records.clear();
    }

    /// Points of a plot: the number of each frame and a value of it.
    pub fn points(&self, value: impl Fn(&Record) -> f64) -> Vec<[f64; 2]> {
        self.records.iter().map(|record| [f64::from(record.frame), value(record)]).collect()
    }
}
