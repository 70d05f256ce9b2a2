//! What frames took, at the end.

use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy_girandole::{GirandoleReport, GirandoleStats};

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

/// The first frames, which load assets and compile shaders, are not reported.
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

/// The median and the minimum of some times, in milliseconds.
fn millis(times: impl Iterator<Item = Duration>) -> String {
    let mut times: Vec<Duration> = times.collect();
    times.sort_unstable();
    let [median, least] = [times.len() / 2, 0].map(|i| 1000.0 * times[i].as_secs_f64());
    format!("{median:10.3} ms {least:10.3} ms")
}

fn print(mut exits: MessageReader<AppExit>, frames: Res<Frames>) {
    if exits.read().next().is_none() {
        return;
    }
    for (name, frames) in [("moving", &frames.moving), ("still", &frames.still)] {
        let Some((_, last)) = frames.last() else { continue };
        println!("{} frames {name}, {} lights in {} trees; median and minimum:", frames.len(), last.lights, last.trees);
        println!("  {}  frame", millis(frames.iter().map(|(took, _)| *took)));
        let part = |name, part: fn(&GirandoleReport) -> Duration| {
            println!("  {}  {name}", millis(frames.iter().map(|(_, report)| part(report))));
        };
        part("search for changes, main world", |report| report.gather);
        part("edits, render world", |report| report.apply);
        part("refits and rebuilds, render world", |report| report.update);
        part("upload, render world", |report| report.upload);
        part("shadows, both worlds", |report| report.shadows);
        println!("  {} bytes uploaded in the last of them, shadow rays: {:?}", last.bytes, last.shadow_rays);
    }
}
