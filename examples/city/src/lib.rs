//! The parts of the program: `app` renders frames to files, `window` shows them.
//!
//! Scenes and the renderer are in the package `testbed`.

pub mod app;
pub mod window;
