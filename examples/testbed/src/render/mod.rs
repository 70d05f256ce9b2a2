//! Renders a scene and the light world that goes with it, on the CPU or on a GPU.
//!
//! Read in this order:
//!
//! 1. `settings` and `image`: what goes in and what comes out;
//! 2. `sequence` and `shading`: random numbers, camera rays and the BRDF;
//! 3. `textures`, `nodes`, `geometry` and `rays`: textured surfaces, and the hierarchies that rays
//!    traverse;
//! 4. `cpu`: the whole renderer on threads, which is the easier one to read, and `metering`, an exposure
//!    for what it shows;
//! 5. `backend` and `gpu`: the same renderer as a compute shader, whose pixels may keep lights from frame to frame.

use super::scene;

#[cfg(feature = "native")]
pub mod settings;
pub mod image;

pub mod sequence;
pub mod shading;

pub mod textures;
pub mod nodes;
pub mod geometry;
pub mod rays;

#[cfg(feature = "native")]
pub mod cpu;
#[cfg(feature = "native")]
pub mod metering;

#[cfg(feature = "native")]
pub mod backend;
pub mod gpu;
