//! A region that a world has refused.

use super::Region;
use crate::error::WorldError;

/// A region that [`LightWorld::add_region`](crate::LightWorld::add_region) has refused, unchanged,
/// and the reason. It converts to that reason, so `?` works where only the reason matters.
#[derive(Debug, thiserror::Error)]
#[error("{error}")]
pub struct RefusedRegion {
    /// The region.
    pub region: Box<Region>,
    /// Why it was refused.
    #[source]
    pub error: WorldError,
}

impl From<RefusedRegion> for WorldError {
    fn from(refused: RefusedRegion) -> Self {
        refused.error
    }
}
