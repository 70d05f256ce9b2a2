//! The light tree of spherical Gaussians.
//!
//! Source: Tokuyoshi, Ikeda, Kulkarni and Harada, Hierarchical Light Sampling with Accurate
//! Spherical Gaussian Lighting (SIGGRAPH Asia 2024), with its supplement. A group of lights is one
//! Gaussian of position and one spherical Gaussian of direction; what it sends to a surface is
//! approximated in closed form, for a Lambertian and for a GGX part.
//!
//! SG means spherical Gaussian: exp(sharpness (cos - 1)), where cos is that of the angle to an axis.

mod gaussian;
mod light;
mod surface;
mod vectors;
mod tree;

pub use tree::GaussianTree;
