//! The lights of a world as they are at one moment.

use crate::sampling::reservoir::Reservoir;
use crate::sampling::sample::{LightSample, LightSampler};
use crate::shading::shading_point::ShadingPoint;
use crate::top::TopLevel;
use crate::world::LightWorld;

/// The lights of a world as they were when [`LightWorld::snapshot`] was called, without their trees: what a merge of
/// [reservoirs](Reservoir) needs of the last frame. A GPU has the same as `GpuOptions::with_previous`.
pub struct LightSnapshot {
    world: LightWorld,
    /// Empty.
    top: TopLevel,
}

impl LightWorld {
    /// Copies the lights, as of the last [`LightWorld::update`], and the instances as they are now.
    ///
    /// O(distinct lights + instances + pixels of the sky).
    pub fn snapshot(&self) -> LightSnapshot {
        LightSnapshot { world: self.without_nodes(), top: TopLevel::default() }
    }
}

impl LightSnapshot {
    /// Returns the light of a reservoir as it was: see [`LightSampler::reservoir_sample`]. Positions are relative to the
    /// world's origin as it was.
    pub fn reservoir_sample(&self, shading_point: &ShadingPoint, reservoir: &Reservoir) -> Option<LightSample> {
        LightSampler::new(&self.world, &self.top).reservoir_sample(shading_point, reservoir)
    }
}

impl std::fmt::Debug for LightSnapshot {
    /// Counts, not contents.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LightSnapshot").field("instances", &self.world.instances().len()).finish_non_exhaustive()
    }
}
