//! Draws a scene, on the CPU or on a GPU, through the light world beside it.

use super::scene;

pub mod image;
pub mod settings;

pub mod geometry;
pub mod geometry_nodes;
pub mod shading;

pub mod backend;
pub mod cpu;
pub mod gpu;
