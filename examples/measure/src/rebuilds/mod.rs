//! What a time budget for rebuilds gains in noise, and whether it is kept: the library's scheduler
//! beside other strategies.
//!
//! ```text
//! measure rebuilds --out DIR [--quick] [--costs FILE]
//!     [--scene A,B] [--motion A,B] [--strategies A,B] [--shares A,B] [--seed N]
//! measure rebuilds --cases --out DIR [--quick] [--scene A,B]
//! ```
//!
//! The first form plays deforming trees in several motions, each under several strategies and
//! budgets. Every few frames it measures the exact relative standard deviation of one light sample
//! at fixed shading points. It writes:
//!
//! - `budget.csv`: a row for each scene, motion, strategy and budget;
//! - `scenes.csv`: the values that the others are relative to, which are the noise without rebuilds
//!   and with a rebuild of everything in each frame, the time of the latter, and the time of the
//!   smallest job;
//! - `costs.csv`: the measured times of work;
//! - an SVG plot per scene.
//!
//! Expect `girandole` near `oracle` and above `round robin` and `oldest first`. `--quick` takes
//! less than a minute, the whole run about 25. `docs/benchmarks.md` has a measured run. `--cases` plays scenes that broke earlier schedulers:
//! varying budgets, a large tree, trees whose predicted noise misleads, and trees at rest. It
//! prints a table for each and writes all values to `cases.csv`. Its clock is virtual, with stated
//! costs, so it repeats exactly on any machine. It takes one to two minutes, and with `--quick`
//! some seconds.
//!
//! `--shares` replaces the budgets, which are shares of the mean time per frame of rebuilding
//! everything that changed. `--seed` (1 if it is missing) seeds the city, the trees and the shading
//! points, so that results can be averaged over seeds; write each seed to a folder of its own.
//!
//! Time is virtual. The times of work are measured at the start (`costs.rs`) and then drawn at
//! random, so that a run with `--costs DIR/costs.csv` repeats bit for bit. **If the machine stalls
//! while costs are measured, the stall is among them** and comes back as often as it was measured;
//! frames then exceed their budget under any strategy. Of two builds the faster counts, but measure
//! while nothing else runs, and look at the largest costs first.
//!
//! Some strategies do not use the library's scheduler: round robin, oldest first and the oracle.
//! Their rebuilds are part of the frame if they fit into the budget of a whole frame. Larger
//! rebuilds run in the background, and the budgets of the following frames pay for them; their time
//! counts as spent but belongs to no frame, like the library's background builds.

use testbed::measuring::{lights, sigma};

pub mod figures;
pub mod motion;
pub mod rays;
pub mod stage;

pub mod lit;
pub mod noise;

pub mod costs;
pub mod oracle;
pub mod reference;
pub mod strategies;

pub mod player;
pub mod run;

pub mod cases;

pub mod plots;
pub mod report;

pub mod options;
