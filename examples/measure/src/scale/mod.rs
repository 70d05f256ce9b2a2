//! A flight over a streaming world: 20 km by 20 km with ten million lights, one million of which
//! are resident. It measures what the library does in each frame, on the CPU.
//!
//! ```text
//! measure scale --out DIR [--quick] [--runs N] [--seed N]
//! measure scale --out DIR --scale [--quick] [--seed N]
//! ```
//!
//! The first form flies along a closed path, at 60 frames per second of simulated time. A loader
//! thread fills regions, blocks of 125 m, and frees those that have left. In each frame at most two
//! blocks arrive and two leave, 1,000 vehicles move, lights of 16 blocks flicker, and the budget
//! for rebuilds is 0.3 ms. The GPU side is a `LightPlanner` whose plans are checked and not played,
//! so no GPU is needed. It writes:
//!
//! - `flight.csv`: a row for each frame;
//! - `summary.csv`: median, 99.9th percentile and worst of each measure over the frames;
//! - `worst.csv`: the 20 slowest frames, with the same columns.
//!
//! It prints a summary. With `--runs 5`, expect a worst frame of about twice the median. In a
//! single run on a busy machine it may take four times the median or more. The whole flight takes
//! less than a minute, and `--quick`, a smaller world and 600 frames, some seconds.
//!
//! `frame_us` is CPU time of the frame's thread, which does all work of the world. `wall_us` is
//! wall-clock time: the two differ where other programs run. Blocks arrive in fixed frames, so that
//! the flight repeats; neither time contains waiting for the loader.
//!
//! Other programs disturb CPU time too, through caches and shared cores. With `--runs N` the flight
//! is flown N times, and each frame counts in the run in which it took the least time. All runs do
//! the same work in the same frames: the world's clock is virtual and counts 0.4 µs for each light
//! of a rebuild.
//!
//! `--scale` measures frames with a camera at rest and 30,000 to three million resident lights. The
//! same number of vehicles move and the same number of lights flicker at each size. It writes
//! `scale.csv`; expect times that hardly grow.

pub mod settings;
pub mod route;
pub mod blocks;
pub mod stream;
pub mod loader;
pub mod traffic;
pub mod flight;
pub mod device;
pub mod record;
pub mod summary;
pub mod sizes;
pub mod options;
