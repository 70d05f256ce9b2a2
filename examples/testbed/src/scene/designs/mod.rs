//! Designs: the parts that cities are made from, each with the lights of its emissive faces.
//!
//! Read in this order: `facade` and `buildings`, then `land`, `furniture`, `signs` and `vehicles`,
//! which stand alone.

use super::{SceneError, assembly, palette, part, rng};

pub mod facade;
pub mod buildings;

pub mod land;
pub mod furniture;
pub mod signs;
pub mod vehicles;
