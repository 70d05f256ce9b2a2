//! Renders a scene and the light world that goes with it, on the CPU or on a GPU.
//!
//! Read in this order:
//!
//! 1. `settings` and `image`: what goes in and what comes out;
//! 2. `shading`: camera rays, random numbers and the BRDF;
//! 3. `textures`, `nodes`, `geometry` and `rays`: textured surfaces, and the hierarchies that rays
//!    traverse;
//! 4. `cpu`: the whole renderer on threads, which is the easier one to read;
//! 5. `backend` and `gpu`: the same renderer as a compute shader.

use super::scene;

pub mod settings;
pub mod image;

pub mod shading;

pub mod textures;
pub mod nodes;
pub mod geometry;
pub mod rays;

pub mod cpu;

pub mod backend;
pub mod gpu;
