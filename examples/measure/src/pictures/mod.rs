//! What accuracy costs in time: direct light with shadows and materials by every setting of the library and by other
//! samplers, against a converged reference.
//!
//! `measure pictures --out DIR` plays the scene for two seconds, and renders the last frame eight times with every
//! setting. All settings use the same eight seeds. It prints the front of least error, and writes into DIR:
//!
//! - `accuracy.csv`: a row for each setting (`table.rs` explains the columns);
//! - `equal_time.csv`: the best samplers in equal time;
//! - `error_over_time.svg` and `equal_time.svg`: the front as a plot, and the same part of the picture by several
//!   samplers in equal time.
//!
//! With `--rivals`, it compares published samplers with the library in several scenes instead: relMSE times time at 16
//! samples per pixel over that of the library, in `rivals.csv` (`rivals.rs`). With `--reuse`, it keeps reservoirs over
//! frames, with new samples by several samplers, in `reuse.csv` (`reuse.rs`).
//!
//! All work is done by threads of the CPU; times are those of one core. Read them as ratios within one run. Only uploads
//! use a GPU, or a software Vulkan driver; without one their column stays empty. City S takes about 15 minutes on two
//! cores, a third of it for the reference. `--quick` takes seconds and proves only that everything runs.

pub mod options;

pub mod played;
pub mod scene_view;
pub mod simplified;

pub mod settings;
pub mod samplers;
pub mod noise;
pub mod errors;

pub mod table;
pub mod measured;

pub mod front;

pub mod charts;
pub mod crops;
pub mod extracts;

pub mod rival_scenes;
pub mod contests;
pub mod rivals;

pub mod reuse_scenes;
pub mod reuse;

pub mod run;
