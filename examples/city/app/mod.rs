//! The program around the renderer: the command line, the loop over frames, and the files.
//!
//! Read in this order:
//!
//! 1. `scene_options` and `options`: the command line;
//! 2. `stage_times` and `session`: the loop, which shows how an engine uses the library;
//! 3. `denoiser` and `tone_mapping`: from radiance to a picture for a screen;
//! 4. `files`, `output` and `video`: the files;
//! 5. `compare`: several samplers in equal time;
//! 6. `run`: the whole program.

use super::{render, scene};

pub mod scene_options;
pub mod options;

pub mod stage_times;
pub mod session;

pub mod denoiser;
pub mod tone_mapping;

pub mod files;
pub mod output;
pub mod video;

pub mod compare;

pub mod run;
