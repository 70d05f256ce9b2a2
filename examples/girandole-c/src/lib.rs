//! The C interface of Girandole: include/girandole.h is made from this package's sources.
//!
//! Each function runs its body through `status::call`, which turns errors and panics into a
//! status. Objects are opaque; values are plain structs; arrays are a pointer and a length.
//!
//! # Safety
//! All unsafe code follows pointers of the caller. It relies on these rules, which the head of the
//! header states for C programs:
//!
//! - A pointer is NULL, or points to as many values as the call says, which live until the call
//!   returns. NULL, misaligned pointers and impossible lengths are refused; other pointers cannot
//!   be checked.
//! - An object comes from this interface and was not destroyed.
//! - No other thread is in a call that may change the same object.
//! - What a call stores does not overlap with what it reads.
//!
//! `memory` follows pointers to values, and `world` holds what several threads read.

#![deny(unsafe_op_in_unsafe_fn, clippy::undocumented_unsafe_blocks)]
#![warn(missing_docs, missing_debug_implementations)]
#![allow(clippy::missing_safety_doc, reason = "all functions have the same rules, stated above")]

mod status;
mod memory;
mod names;
mod vectors;
mod light;
mod place;
mod shading_point;
mod blob;
mod world;
mod origin;
mod directional;
mod profile;
mod sky;
mod texture;
mod trees;
mod instances;
mod region;
mod sampling;
mod changes;
mod buffers;
mod plan;
mod planner;
mod cuts;
mod planners;
mod light_sources;
mod readback;
mod reservations;
mod bindings;
mod shader;
mod source;
mod writers;
mod translate;
mod kernels;
mod shader_text;

pub use bindings::*;
pub use blob::*;
pub use buffers::*;
pub use changes::*;
pub use cuts::*;
pub use directional::*;
pub use instances::*;
pub use kernels::*;
pub use light::*;
pub use light_sources::*;
pub use origin::*;
pub use place::*;
pub use plan::*;
pub use planner::*;
pub use planners::*;
pub use profile::*;
pub use readback::*;
pub use region::*;
pub use reservations::*;
pub use sampling::*;
pub use shader::*;
pub use shader_text::*;
pub use shading_point::*;
pub use sky::*;
pub use status::*;
pub use texture::*;
pub use translate::*;
pub use trees::*;
pub use vectors::*;
pub use world::*;
