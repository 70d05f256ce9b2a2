//! The program around the renderer: the command line, the loop over frames, and the files.
//!
//! Read in this order:
//!
//! 1. `options`: the command line;
//! 2. `stage_times` and `session`: the loop, which shows how an engine uses the library;
//! 3. `denoiser`: pictures with less noise;
//! 4. `files`, `output` and `video`: the files;
//! 5. `run`: the whole program.

pub mod options;

pub mod stage_times;
pub mod session;

pub mod denoiser;

pub mod files;
pub mod output;
pub mod video;

pub mod run;
