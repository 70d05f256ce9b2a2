//! How stable the choice of lights is in f32: noise and rounding errors over the scale of a scene,
//! its distance from the origin, and its contrast.
//!
//! ```text
//! measure stability --out DIR [--quick] [--seed N]
//! ```
//!
//! The scene is a street with 3,000 lights of all shapes in 60 instances of 12 objects, in f64. A
//! sweep varies one property of it:
//!
//! - `scale`, from 1e-6 to 1e6: all lengths are multiplied by it, and the emission of points and
//!   spots by its square, so that the illuminance stays the same;
//! - `distance`, from 0 to 1e9 m: all positions move along a diagonal;
//! - `contrast`, from 1 to 1e24: lights are multiplied by factors from 1 / √contrast to √contrast.
//!
//! | sampler | how it holds the lights |
//! |---|---|
//! | `girandole` | two levels: lights in f32 in the space of their object, placements in f64, and the origin follows the scene |
//! | `girandole flat` | one tree over all lights in f32, in the space of the world |
//!
//! It prints a summary, and writes `stability.csv`, with a row for each sampler
//! at each step:
//!
//! | column | value |
//! |---|---|
//! | `sigma` | relative standard deviation of one sample, without noise of its own; mean over the shading points at which it is finite |
//! | `infinite` | the share of the lit shading points at which it is infinite: a light that contributes is never chosen |
//! | `unreached` | the same share, counting lights with less than a millionth of the illuminance too |
//! | `nan` | the share of the lit shading points at which some probability is NaN |
//! | `error_mean`, `error_99` | how far the probabilities are from those of the same formula and the same tree in f64, from lights that were not rounded; mean and 99th percentile |
//!
//! The difference of two probabilities is relative to the larger one: 0 if they are equal, and 1 if
//! one of them is 0 or NaN. A light counts by its share of the illuminance at the shading point,
//! since this is the share of the noise that it decides. `girandole` is evaluated in f64 from the
//! nodes as they are stored, by a reference that was written from docs/math.md. `girandole flat` is
//! not: its nodes hold what rounding has left of the lights.
//!
//! Expect a straight line for `girandole` over distance, and over scale one that rises by 5 % at
//! one step: the top level is cut along a curve whose cells are powers of two of a metre, so
//! another scale is another tree. Expect that `girandole flat` loses lights from 100 km on, and at
//! 10,000 km at every shading point. The run takes about a minute, and `--quick`,
//! with fewer steps and shading points, some seconds.

pub mod sweep;
pub mod measure;
pub mod record;
pub mod summary;
pub mod options;
