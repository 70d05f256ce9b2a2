//! What every program needs: a command line, tables, progress, random numbers, a device.

#[cfg(feature = "native")]
pub mod alias;
pub mod batch;
#[cfg(feature = "native")]
pub mod exit;
#[cfg(feature = "native")]
pub mod gpu;
pub mod hash;
#[cfg(feature = "native")]
pub mod lattice;
#[cfg(feature = "native")]
pub mod origin;
pub mod pcg;
#[cfg(feature = "native")]
pub mod progress;
#[cfg(feature = "native")]
pub mod split_mix;
#[cfg(feature = "native")]
pub mod stopwatch;
#[cfg(feature = "native")]
pub mod table;
