//! The program's modules, in the order in which data passes through them. `main.rs` and a test
//! include this file.

pub mod options;

pub mod played;
pub mod scene_view;
pub mod simplified;

pub mod settings;
pub mod samplers;
pub mod noise;
pub mod pictures;

pub mod table;
pub mod measured;

pub mod answers;

pub mod charts;
pub mod crops;
pub mod extracts;
pub mod page;

pub mod rival_scenes;
pub mod contests;
pub mod rivals;

pub mod reuse_scenes;
pub mod reuse;

pub mod run;
