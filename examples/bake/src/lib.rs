//! The program's own modules, in the order in which data passes through them. `main.rs` and a test
//! include this file.

pub mod manifest;
pub mod write;
pub mod load;
pub mod compare;
pub mod options;
