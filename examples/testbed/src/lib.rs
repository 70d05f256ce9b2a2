//! What the programs, tests and benches share. Data passes through the modules in this order:
//!
//! | module | contents |
//! |---|---|
//! | [`common`] | command lines, tables, progress, random numbers, devices |
//! | [`measuring`] | the exact noise of a sample, errors of pictures, published samplers, formulas in f64 |
//! | [`scene`], [`scene_options`], [`fly`] | the procedural city, glTF scenes and real cities; a camera that flies |
//! | [`render`], [`tone_mapping`] | a renderer of direct light on the CPU and on a GPU |
//! | [`direct_light`] | pictures that judge samplers |
//! | [`testing`] | random lights, small scenes, and a device that plays plans, for tests |
//!
//! Without the feature `native`, only what renders the procedural city in a browser is left: no files,
//! no measurements and no threads that wait for a device.

pub mod common;
#[cfg(feature = "native")]
pub mod measuring;
pub mod scene;
#[cfg(feature = "native")]
pub mod scene_options;
pub mod fly;
pub mod render;
#[cfg(feature = "native")]
pub mod tone_mapping;
#[cfg(feature = "native")]
pub mod direct_light;
#[cfg(feature = "native")]
pub mod testing;
