//! The window to fly through a scene.
//!
//! A thread renders pictures as fast as it can; the window shows the latest one and stays responsive.
//! Requests go one way and pictures the other.
//!
//! Read in this order:
//!
//! 1. `controls`: what the panel changes;
//! 2. `accumulation`: pictures of several frames become one with less noise;
//! 3. `colors`, `overlay`, `tree_boxes`, `light_marks`, `looseness`, `drawing` and `noise_view`: the views that are not
//!    pictures;
//! 4. `viewer`: renders what the controls ask for;
//! 5. `worker`: runs a viewer on a thread of its own;
//! 6. `save`, `recording` and `panel`: saved pictures, the plots and the panel;
//! 7. `presenter`, `shell`: the window itself;
//! 8. `still`: the picture of a dump, without a window.

use super::app;

pub mod controls;

pub mod accumulation;

pub mod colors;
pub mod overlay;
pub mod tree_boxes;
pub mod light_marks;
pub mod looseness;
pub mod drawing;
pub mod noise_view;

pub mod viewer;
pub mod worker;

pub mod save;
pub mod recording;
pub mod panel;

pub mod presenter;
pub mod shell;

pub mod still;
