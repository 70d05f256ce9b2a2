//! What accuracy costs in time, on one page: direct light with shadows and materials by every
//! setting of the library and by other samplers, against a converged reference.
//!
//! ```text
//! cargo run --release -p accuracy -- --out DIR [--quick]
//!     [--world S|M|L | --gltf FILE | --lamps FILE.csv --traffic FILE.xml] [--camera x,y,z,x,y,z]
//!     [--matte] [--size WxH] [--pictures N] [--passes N]
//! ```
//!
//! The scene plays for two seconds. Then the last frame is rendered eight times with every setting;
//! all settings use the same eight seeds. The program prints the front of least error, and writes
//! into DIR:
//!
//! - `accuracy.html`: the page, in one file without links. It answers what each budget of time
//!   buys, what half of the error costs, which knob to turn first, and where the time goes;
//! - `accuracy.csv`: a row for each setting (`table.rs` explains the columns);
//! - `front.csv` and `equal_time.csv`: the front of least error, and all samplers in equal time;
//! - `error_over_time.svg`, `alternatives.svg`, `stages.svg`: the plots of the page;
//! - `equal_time.svg`: the same part of the picture by several samplers in equal time.
//!
//! ```text
//! cargo run --release -p accuracy -- --rivals --out DIR [--quick] [--gltf FILE] [--camera x,y,z,x,y,z]
//!     [--size WxH] [--pictures N]
//! ```
//!
//! The second form compares published samplers with the library in six procedural scenes, and in one of a
//! file. It prints relMSE times time at 16 samples per pixel over that of the library, with confidence
//! intervals, lists the samplers that come closer than the goal, and writes `rivals.csv` (`rivals.rs`
//! explains the columns).
//!
//! With `--reuse` in place of `--rivals`, the program keeps reservoirs over frames, with new samples by several
//! samplers, and writes `reuse.csv` (`reuse.rs`).
//!
//! All work is done by threads of the CPU; times are those of one core. Read them as ratios within
//! one run, since machines and their load differ. Only uploads use a GPU, or a software Vulkan
//! driver; without one their column stays empty.
//!
//! City S takes about 15 minutes on two cores, a third of it for the reference. `--quick` takes
//! seconds and proves only that everything runs. Expect Girandole's settings to form the front of
//! least error from about 0.4 ms of the page on. With few samples, the relMSE of uniform and flux
//! may rise before it falls.

use accuracy::options::Options;
use accuracy::run::run;
use accuracy::{reuse, rivals};
use std::process::ExitCode;

fn main() -> ExitCode {
    testbed::common::exit::run_program(|options: &Options| match options {
        Options { rivals: true, .. } => rivals::run(options),
        Options { reuse: true, .. } => reuse::run(options),
        _ => run(options).map(drop),
    })
}
