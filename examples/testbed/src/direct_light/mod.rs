//! Pictures of direct light with shadows and materials, drawn with one chosen light per sample:
//! what the programs that judge samplers render.
//!
//! Read the files in the order of the list
//! below, in which data passes through them.

pub mod stage;
pub mod view;
pub mod shadows;

pub mod numbers;
pub mod sobol;
pub mod draw;
pub mod cells;
pub mod renderer;
pub mod frames;
pub mod times;
pub mod converged;
pub mod rivals;
pub mod reuse;

pub mod reference;
