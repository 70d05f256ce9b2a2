//! The goals of `docs/benchmarks.md` for a GPU, and whether a run reached them.

use super::machine::Machine;
use super::{sampling, top_level};
use serde_json::{Value, json};
use testbed::scene::procedural::Size;

/// The number of instances for which the time of the top level has goals. The goal for dispatches
/// holds for any number of instances up to a million.
const INSTANCES: u32 = 100_000;
const MOST_DISPATCHES: u32 = 13;
/// The most milliseconds of that top level, and the greatest ratio to the sort of its keys.
const TOP_LEVEL_MS: f64 = 0.3;
const PER_SORT: f64 = 2.5;
/// The picture of one sample for each pixel for which there is a goal, and its milliseconds.
const PICTURE: (u32, u32) = (1920, 1080);
const PICTURE_MS: f64 = 1.0;

/// A goal and what was measured.
pub struct Verdict {
    pub goal: String,
    pub most: f64,
    /// `None` if it was not measured.
    pub measured: Option<f64>,
    /// Whether it depends on the time that a GPU takes.
    pub is_time: bool,
}

/// How a measured value compares with its goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    Met,
    Missed,
    NotMeasured,
    /// A time on a CPU that stands in for a GPU.
    Software,
}

impl Outcome {
    pub fn name(self) -> &'static str {
        match self {
            Self::Met => "met",
            Self::Missed => "missed",
            Self::NotMeasured => "not measured",
            Self::Software => "not judged on a software adapter",
        }
    }
}

impl Verdict {
    /// On a software adapter only counts are judged.
    pub fn outcome(&self, is_software: bool) -> Outcome {
        match self.measured {
            None => Outcome::NotMeasured,
            Some(_) if self.is_time && is_software => Outcome::Software,
            Some(value) if value <= self.most => Outcome::Met,
            Some(_) => Outcome::Missed,
        }
    }

    pub fn to_json(&self, machine: &Machine) -> Value {
        let outcome = self.outcome(machine.is_software()).name();
        json!({ "goal": self.goal, "most": self.most, "measured": self.measured, "outcome": outcome })
    }
}

/// Compares what was measured with the goals.
pub fn verdicts(tops: &[top_level::Row], samplings: &[sampling::Row]) -> Vec<Verdict> {
    let top = tops.iter().find(|row| row.instances == INSTANCES).and_then(|row| row.built.as_ref().ok());
    let largest = tops.iter().filter_map(|row| row.built.as_ref().ok()).map(|built| built.dispatches).max();
    let picture = samplings
        .iter()
        .find(|row| row.city == format!("{:?}", Size::L) && row.candidates == 1 && row.picture == PICTURE);
    let time = |goal: String, most, measured| Verdict { goal, most, measured, is_time: true };
    vec![
        time(
            format!("top level of {INSTANCES} instances, ms"),
            TOP_LEVEL_MS,
            top.map(|built| built.total.median * 1e3),
        ),
        time(
            format!("top level of {INSTANCES} instances over its sort"),
            PER_SORT,
            top.and_then(top_level::Built::per_sort),
        ),
        time(
            "one sample for each pixel of 1920 × 1080, city L, ms".to_owned(),
            PICTURE_MS,
            picture.map(|row| row.time.median * 1e3),
        ),
        Verdict {
            goal: "dispatches of the largest top level".to_owned(),
            most: f64::from(MOST_DISPATCHES),
            measured: largest.map(f64::from),
            is_time: false,
        },
    ]
}
