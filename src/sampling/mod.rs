//! How a light is chosen for a shading point, with its probability, and then a point on the light.

pub(crate) mod along;
pub(crate) mod cut;
pub(crate) mod cuts;
mod distribution;
pub(crate) mod emit;
pub(crate) mod equiangular;
pub(crate) mod hit;
mod learn;
mod pdf;
pub(crate) mod resample;
pub(crate) mod reservoir;
mod roots;
pub(crate) mod sample;
mod sky;
pub(crate) mod snapshot;
pub(crate) mod view;
pub(crate) mod walk;
