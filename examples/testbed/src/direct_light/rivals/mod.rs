//! Published samplers that prepare each frame, written from their descriptions.
//!
//! Read the files in the order of the list below, in which data passes through them.

mod points;
mod candidates;
mod proxies;

mod tiles;
mod regir;
mod nee_at;

mod by_name;

pub use by_name::{NAMES, by_name};
pub use candidates::{FULL_HD, Random};
