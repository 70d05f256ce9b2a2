//! A dump: the light world of one frame as a file, to be looked at elsewhere.
//!
//! A dump is a file of `src/file.rs` with this content:
//!
//! | bytes | content |
//! |---|---|
//! | 64 | a [`Header`](record::Header) |
//! | 4 + 4 n per profile | the number n, a record of `profile/record.rs` |
//! | 8, then a tree per tree | the source, whether the tree is loose; the content of a baked tree (`tree/bake`) |
//! | 4 or 100 per slot, from slot 1 on | 0 for an empty slot, or the number of the tree from 1 on, and an [`InstanceRecord`](record::InstanceRecord) |
//! | 24 per directional light | its direction, its illuminance |

mod read;
mod record;
#[cfg(test)]
mod tests;
mod write;

use crate::effects::Effects;
use crate::file::Mark;
use crate::world::TreeSource;

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

const MARK: Mark = *b"\x89GDUMP\r\n";

/// The effects that a world has because they were switched on, in the order of their bits.
const SWITCHES: [Effects; 3] = [Effects::SOLID_ANGLES, Effects::GLOSSY, Effects::SEGMENTS];

/// The first slot that an instance can have: slot maps never use slot 0.
const FIRST_SLOT: usize = 1;

/// The sources of trees, by their numbers.
const SOURCES: [TreeSource; 3] = [TreeSource::Cpu, TreeSource::GpuMesh, TreeSource::GpuParticles];
