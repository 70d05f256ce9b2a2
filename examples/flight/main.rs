//! A flight over a world that streams: 20 km by 20 km with ten million lights, one million of which
//! are resident. It measures what the library does in each frame, on the CPU.
//!
//! ```text
//! cargo run --release --example flight -- --out DIR [--quick] [--runs N] [--seed N]
//! cargo run --release --example flight -- --out DIR --scale [--quick] [--seed N]
//! ```
//!
//! The first form flies along a closed path, at 60 frames a second of simulated time. A thread
//! fills regions, blocks of 125 m, and frees those that have left. In each frame at most two blocks
//! come and two go, 1,000 vehicles move, lights of 16 blocks flicker, and trees are rebuilt for at
//! most 0.3 ms. The GPU side is a `LightPlanner` whose plans are checked and not played, so a GPU is
//! not needed. It writes:
//!
//! - `flight.csv`: a row for each frame;
//! - `worst.csv`: the 20 frames that took longest, by part;
//! - `flight.svg`: the columns over time;
//! - `map.svg`: the world from above, with the path.
//!
//! It prints a summary. Expect a worst frame of about twice the median where nothing else runs. The
//! whole flight takes less than a minute, and `--quick`, a smaller world and 600 frames, a second.
//!
//! `frame_us` is CPU time of the frame's thread, and `wall_us` the same by the clock on the wall: the
//! two differ where other programs run. All work of the world is done on that thread. What a frame
//! waits for the loader is part of neither, so arrivals have fixed frames and the flight repeats.
//!
//! Other programs disturb CPU time too, by way of caches and shared cores. With `--runs 3` the flight
//! is flown three times, and of each frame the run counts in which it took the least time. All
//! runs do the same work in the same frames: the world's clock is a virtual one, which takes 0.4 µs
//! for each light of a rebuild.
//!
//! `--scale` measures frames with a camera at rest and 30,000 to three million resident lights, in
//! which the same number of vehicles move and the same number of lights flicker. It writes
//! `scale.csv`; expect times that hardly grow.

#[path = "../common/mod.rs"]
#[allow(dead_code, reason = "other programs use more of it")]
mod common;
#[path = "../measuring/mod.rs"]
#[allow(dead_code, reason = "the variance tool uses more of it")]
mod measuring;
#[path = "modules.rs"]
#[allow(dead_code, reason = "tests use more of it")]
mod modules;

use modules::options::run;
use std::process::ExitCode;

fn main() -> ExitCode {
    common::exit::run_program(run)
}
