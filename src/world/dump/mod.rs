//! A dump: the light world of one frame as a file, to be looked at elsewhere.
//!
//! All numbers have 32 bits, the least significant byte first.
//!
//! | numbers | content |
//! |---|---|
//! | 2, 1 | the mark of the format, its version |
//! | 8 | the origin: its mode, its position in f64; which effects are switched on |
//! | 4 | what is left out |
//! | 4 | the counts of profiles, trees, slots of instances and directional lights |
//! | 1 + n per profile | the number n, a record of `profile/record.rs` |
//! | 4 per tree | the source, whether the tree is loose, the bytes of the baked tree; a baked tree (`tree/bake`) |
//! | 1 or 26 per slot, from slot 1 on | 0 for an empty slot, or the number of the tree from 1 on, and a record of `record.rs` |
//! | 6 per directional light | its direction, its illuminance |
//! | 1 | CRC-32 of all other bytes |

mod error;
mod read;
mod record;
#[cfg(test)]
mod tests;
mod words;
mod write;

pub use error::DumpError;

use crate::effects::Effects;

/// What the world had that its dump lacks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct LeftOut {
    /// Skies: 0 or 1.
    pub skies: u32,
    /// Portals, which only a sky needs.
    pub portals: u32,
    /// Trees with changes of lights that waited for the next [`LightWorld::update`](crate::LightWorld::update).
    pub waiting_trees: u32,
    /// Trees whose lights a kernel wrote on the GPU: the dump has the lights that the CPU knew.
    pub gpu_trees: u32,
}

/// The first bytes of every version of the format. As those of baked trees, they show at once that a
/// file was transferred as text.
const MAGIC: [u8; 8] = *b"\x89GDUMP\r\n";

/// The version of the format. It rises with every change of what a dump holds, but not with that of
/// baked trees, which have a version of their own.
const VERSION: u32 = 2;

/// The effects that a world has because they were switched on, in the order of their bits.
const SWITCHES: [Effects; 3] = [Effects::SOLID_ANGLES, Effects::GLOSSY, Effects::SEGMENTS];

/// The first slot that an instance can have: slot maps never use slot 0.
const FIRST_SLOT: usize = 1;
