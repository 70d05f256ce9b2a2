//! Girandole as a plugin for Bevy: a picture with any number of lights.
//!
//! [`GirandolePlugin`] follows the lights of an application's world by change detection, keeps them
//! in a [`LightWorld`](girandole::LightWorld) in the render world, and adds their light to the
//! picture of each camera with a [`GirandoleCamera`]. `docs/bevy.md` describes how to use it, what
//! it costs, and its limits.
//!
//! Data passes through the modules in this order: `components` and `settings` come from the
//! application; `gather` finds what changed, `gathered` and `kinds` assign `numbers` to it, `triangles`,
//! `texels`, `textures`, `rigs`, `sky` and `shadows` read meshes and images, and `extract` moves the `edits` to the render
//! world; `world` applies the edits, `gpu` uploads the result, and `posing` poses what joints and morph targets move, and
//! `pass` draws with the texts of `shader` and the textures of `history`.

mod components;
mod edits;
mod extract;
mod gather;
mod gathered;
mod gpu;
mod history;
mod kinds;
#[cfg(not(feature = "wesl"))]
mod naga_oil;
mod names;
mod numbers;
mod pass;
mod plugin;
mod posing;
mod rigs;
mod settings;
mod shader;
mod shadows;
mod sky;
mod surfaces;
mod texels;
mod textures;
mod triangles;
mod units;
#[cfg(feature = "wesl")]
mod wesl;
mod world;

pub use components::{Estimate, GirandoleCamera, GirandoleLight, GirandoleSky, GirandoleSource, NoGirandole};
pub use gpu::{GirandoleGpu, buffer_entry, effects, lights_layout, sources_layout};
pub use names::{GirandoleName, GirandoleNames};
pub use plugin::{GirandolePlugin, GirandoleSystems};
pub use settings::{GirandoleReport, GirandoleSettings, GirandoleStats};
pub use shader::{LIGHTS_GROUP, SOURCES_GROUP};
pub use shadows::{GirandoleShadows, ShadowRays};
pub use world::GirandoleLights;

/// The program in the documents compiles.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/bevy.md")]
struct Page;
