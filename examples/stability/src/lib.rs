//! The program's own modules, in the order in which data passes through them. `main.rs` and a test
//! include this file.

pub mod sweep;
pub mod measure;
pub mod record;
pub mod summary;
pub mod plots;
pub mod options;
