//! Scenes: what the examples draw, how it moves, and the light world that goes with it.
//!
//! A loader returns a [`Stage`]: geometry, lights and an animation. There are four loaders: `procedural`
//! builds a city, `gltf_scene` reads a file, `lamps` reads a table of the street lamps of a real city, and
//! `dump` reads a light world without surfaces. Renderers take any stage and do not depend on the loader.
//!
//! Metres, right-handed, Y up. Radiance and emission are in nits, per linear Rec. 709 channel.
//!
//! Read in this order:
//!
//! 1. `texture` and `stage`: the types of a stage;
//! 2. `palette`, `part` and `assembly`: materials, and meshes that are built together with their
//!    lights (`rng` is in `examples/testbed/src/common/pcg.rs`);
//! 3. `designs`: buildings, street furniture, signs and vehicles;
//! 4. `procedural`: the city, and `dusk`, `screen` and `festival`: what is added to it;
//! 5. the other loaders, in any order, and `rooms`: a house for measurements.

pub mod texture;
mod stage;

pub mod palette;
pub mod part;
pub mod assembly;

pub mod designs;
pub mod procedural;
pub mod dusk;
#[cfg(feature = "native")]
pub mod screen;
pub mod festival;

#[cfg(feature = "native")]
pub mod gltf_scene;
#[cfg(feature = "native")]
pub mod lamps;
#[cfg(feature = "native")]
pub mod dump;
pub mod rooms;

/// Random numbers.
pub use crate::common::pcg as rng;

pub use stage::*;
