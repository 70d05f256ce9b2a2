//! The program around the renderers: options, frames, denoising, tone mapping and files.

use super::{render, scene};

pub mod denoise;
pub mod tone;

pub mod frames;
pub mod options;
pub mod output;

pub mod run;
