//! Where sampling coordinates begin, and where the camera is.

use glam::DVec3;

use super::LightWorld;
use super::delta::Delta;
use crate::error::{WorldError, check_point};
use crate::instance::placement::MAX_DISTANCE;
use crate::instance::sector::{self, ORIGIN_GRID};

impl LightWorld {
    /// The point that sampling coordinates are relative to, in metres: a multiple of [`ORIGIN_GRID`] along each
    /// axis. Zero until [`LightWorld::set_origin_near`] moves it.
    ///
    /// A shader sees a new origin after the next upload; [`Changes::origin_shift`](crate::Changes)
    /// tells how far it moved since an earlier one. A [`LightSampler`](crate::LightSampler) sees it at
    /// once.
    pub fn origin(&self) -> DVec3 {
        self.scene.origin
    }

    /// Keeps the origin near a position in metres, usually that of the camera (a *floating origin*). Placements are
    /// f64 and sampling is f32, which resolves a millimetre 10 km away from the origin.
    ///
    /// The origin moves once the position is more than [`ORIGIN_GRID`] from it along some axis: to the nearest
    /// multiple of [`ORIGIN_GRID`]. That is at most half a step away along each axis, so a camera that turns around
    /// moves the origin again only after half a step. Call it in every frame before the upload, or never in a world
    /// of a few kilometres.
    ///
    /// O(1). Instances keep their places in the world and do not count as moved. The next upload sends less than 200
    /// bytes for a new origin. The top level is built again: once on the GPU, and at the next sample on the CPU.
    ///
    /// # Errors
    /// [`WorldError::Value`] for a coordinate that is NaN or more than [`MAX_DISTANCE`] from zero.
    pub fn set_origin_near(&mut self, position: DVec3) -> Result<(), WorldError> {
        check_point("a coordinate of the position near the origin", position, MAX_DISTANCE)?;
        if (position - self.scene.origin).abs().max_element() > ORIGIN_GRID {
            let last = (MAX_DISTANCE / ORIGIN_GRID).floor() * ORIGIN_GRID;
            self.scene.origin = sector::nearest(position).clamp(DVec3::splat(-last), DVec3::splat(last));
            self.record(Delta::Origin);
        }
        Ok(())
    }

    /// Sets the viewpoint: the position of the camera, in metres in world coordinates. Trees whose
    /// light is strong there are rebuilt first. Trees whose lights change get their new priorities
    /// within eight updates; of the waiting trees whose lights do not change, one gets its new
    /// priority in each update. O(1).
    ///
    /// # Errors
    /// [`WorldError::Value`] for a coordinate that is NaN or infinite.
    pub fn set_viewpoint(&mut self, viewpoint: DVec3) -> Result<(), WorldError> {
        check_point("a coordinate of the viewpoint", viewpoint, f64::MAX)?;
        self.rebuilds.weights.viewpoint = Some(viewpoint);
        Ok(())
    }
}
