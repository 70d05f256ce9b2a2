//! The program's own modules, in the order in which data passes through them. `main.rs` and a test
//! include this file.

pub mod settings;
pub mod route;
pub mod blocks;
pub mod stream;
pub mod loader;
pub mod traffic;
pub mod flight;
pub mod device;
pub mod record;
pub mod summary;
pub mod scale;
pub mod plots;
pub mod map;
pub mod options;
