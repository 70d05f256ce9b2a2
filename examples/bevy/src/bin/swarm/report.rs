//! What frames took, as medians at the end.

use std::time::{Duration, Instant};

use bevy::prelude::*;
use girandole_bevy::{GirandoleReport, GirandoleStats};

use crate::lamps::Clock;
use crate::options::Options;

pub fn add_systems(app: &mut App) {
    app.init_resource::<Frames>().add_systems(First, record).add_systems(Last, print);
}

#[derive(Resource, Default)]
struct Frames {
    moving: Vec<(Duration, GirandoleReport)>,
    still: Vec<(Duration, GirandoleReport)>,
}

/// Frames that load and compile.
const FIRST: usize = 3;

fn record(
    mut frames: ResMut<Frames>,
    mut last: Local<Option<Instant>>,
    mut count: Local<usize>,
    stats: Res<GirandoleStats>,
    clock: Res<Clock>,
    options: Res<Options>,
) {
    let now = Instant::now();
    let Some(took) = last.replace(now).map(|last| now - last) else { return };
    *count += 1;
    if *count <= FIRST {
        return;
    }
    let report = stats.report();
    match clock.frame >= options.settle {
        true if report.moved == 0 => frames.still.push((took, report)),
        false => frames.moving.push((took, report)),
        true => {}
    }
}

fn median<T: Ord + Copy + Default>(values: impl Iterator<Item = T>) -> T {
    let mut values: Vec<T> = values.collect();
    values.sort_unstable();
    values.get(values.len() / 2).copied().unwrap_or_default()
}

fn print(mut exits: MessageReader<AppExit>, frames: Res<Frames>) {
    if exits.read().next().is_none() {
        return;
    }
    for (name, frames) in [("moving", &frames.moving), ("still", &frames.still)] {
        let millis = |part: fn(&GirandoleReport) -> Duration| {
            1000.0 * median(frames.iter().map(|(_, report)| part(report))).as_secs_f64()
        };
        let Some((_, last)) = frames.last() else { continue };
        println!("{} frames {name}, {} lights in {} trees; medians:", frames.len(), last.lights, last.trees);
        println!("  {:8.1} ms  frame", 1000.0 * median(frames.iter().map(|(took, _)| *took)).as_secs_f64());
        println!("  {:8.3} ms  search for changes, main world", millis(|report| report.gather));
        println!("  {:8.3} ms  edits, render world", millis(|report| report.apply));
        println!("  {:8.3} ms  refits and rebuilds, render world", millis(|report| report.update));
        println!("  {:8.3} ms  upload, render world", millis(|report| report.upload));
        println!("  {:8}     bytes uploaded", median(frames.iter().map(|(_, report)| report.bytes)));
    }
}
