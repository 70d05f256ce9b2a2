//! The tests of the program in one binary, so that wgpu is linked only once.

mod cases;
mod figures;
mod strategies;
