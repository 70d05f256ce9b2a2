//! Scenes: what the example draws, how it moves, and the light world that goes with it.
//!
//! A loader returns a [`Stage`]: geometry, lights and an animation. There are three loaders, each
//! in a folder: `procedural` builds a city, `real_city` reads the lamps, the traffic, the roads and
//! the buildings of a real one, and `gltf_scene` reads a file. Renderers take any stage and do not
//! depend on the loader.
//!
//! Metres, right-handed, Y up. Radiance and emission are in nits, per linear Rec. 709 channel.
//!
//! Read in this order:
//!
//! 1. `texture` and `stage`: the types of a stage;
//! 2. `palette`, `part` and `assembly`: materials, and meshes that are built together with their
//!    lights (`rng` is in `examples/testbed/src/common/pcg.rs`);
//! 3. `designs`: buildings, street furniture, signs and vehicles;
//! 4. `dusk`, `screen` and `festival`: what is added to a city, and `rooms`: a house for measurements;
//! 5. the loaders, in any order; each folder's `mod.rs` states the order of its files;
//! 6. `dump`: a light world without surfaces, of any engine;
//! 7. `size_argument`: the sizes of the procedural city on a command line.

pub mod texture;
mod stage;

pub mod palette;
pub mod part;
pub mod assembly;

pub mod designs;
pub mod dusk;
pub mod festival;
#[cfg(feature = "native")]
pub mod screen;

pub mod rooms;
#[cfg(feature = "native")]
pub mod gltf_scene;
pub mod procedural;
#[cfg(feature = "native")]
pub mod real_city;

#[cfg(feature = "native")]
pub mod dump;

#[cfg(feature = "native")]
mod size_argument;

/// Random numbers.
pub use crate::common::pcg as rng;

pub use stage::*;
