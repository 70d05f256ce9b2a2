//! The tests of the program in one binary, so that wgpu is linked only once.

mod stats;
mod translations;
