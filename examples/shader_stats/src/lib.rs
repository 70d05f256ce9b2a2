//! The tool's own modules, in the order in which data passes through them. `main.rs` and a test
//! include this file.

pub mod subjects;
pub mod translate;

pub mod driver;
pub mod record;
pub mod limits;
pub mod page;
pub mod options;
