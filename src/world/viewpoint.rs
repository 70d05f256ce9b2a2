//! How the origin moves, by itself or with the camera.

use glam::DVec3;

use super::LightWorld;
use super::delta::Delta;
use super::log::InstanceChange;
use super::origin::{Origin, OriginMode, nearest_origin};
use crate::error::{WorldError, check_point};
use crate::instance::placement::{MAX_DISTANCE, Placed};
use crate::instance::sector::ORIGIN_GRID;
use crate::keys::InstanceKey;

impl LightWorld {
    /// The point that sampling coordinates are relative to, in metres. Zero until
    /// [`LightWorld::set_origin`] is called or the origin follows the viewpoint.
    ///
    /// A shader sees a new origin after the next upload; [`Changes::origin_shift`](crate::Changes)
    /// tells how far it moved since an earlier one. A [`LightSampler`](crate::LightSampler) sees it at
    /// once.
    pub fn origin(&self) -> DVec3 {
        self.scene.origin.position
    }

    /// How the origin moves: [`OriginMode::Free`] until [`LightWorld::set_origin_mode`] is called.
    pub fn origin_mode(&self) -> OriginMode {
        self.scene.origin.mode
    }

    /// Sets how the origin moves. The origin itself stays where it is.
    ///
    /// Call it before instances are added: then it is O(1). Later, a change from or to
    /// [`OriginMode::Free`] is O(instances) and uploads every instance again. Between the other two modes it is O(1).
    ///
    /// # Errors
    /// [`WorldError::Value`] if the new mode does not allow the present origin, or if an instance would be too
    /// far away.
    pub fn set_origin_mode(&mut self, mode: OriginMode) -> Result<(), WorldError> {
        self.change_origin(mode, self.scene.origin.position)
    }

    /// Moves the point that sampling coordinates are relative to, in metres, for example to the
    /// camera. Instances keep their places in the world, and do not count as moved.
    ///
    /// With [`OriginMode::Free`] this is O(instances), and every instance is uploaded again: call it
    /// when the camera has moved by kilometres, not in every frame. With the other modes it is O(1),
    /// and the next upload sends less than 200 bytes for it. In all modes the top level is built
    /// again: once on the GPU, and at the next sample on the CPU. With [`OriginMode::Following`] the
    /// next call to [`LightWorld::set_viewpoint`] may move the origin again.
    ///
    /// # Errors
    /// [`WorldError::Value`] for a coordinate that is NaN or infinite. With
    /// [`OriginMode::Free`] also if an instance would be too far from the
    /// origin; with the other modes also for a coordinate that is not on the grid, or beyond
    /// [`MAX_DISTANCE`].
    pub fn set_origin(&mut self, position: DVec3) -> Result<(), WorldError> {
        self.change_origin(self.scene.origin.mode, position)
    }

    /// Puts the origin in a place, in a mode, and the instances relative to it.
    fn change_origin(&mut self, mode: OriginMode, position: DVec3) -> Result<(), WorldError> {
        let origin = Origin::at(mode, position)?;
        if origin.anchor() != self.scene.origin.anchor() {
            let instances = self.scene.instances.values();
            let placed: Vec<Option<Placed>> =
                instances.map(|i| Placed::new(&i.placement, origin.anchor())).collect::<Result<_, _>>()?;
            let keys: Vec<InstanceKey> = self.scene.instances.keys().collect();
            for (key, placed) in keys.into_iter().zip(placed) {
                self.scene.instances[key].placed = placed;
                self.record(Delta::Instance(key, InstanceChange::Altered));
            }
        }
        if origin != self.scene.origin {
            self.scene.origin = origin;
            self.record(Delta::Origin);
        }
        Ok(())
    }

    /// Moves the origin if it follows the viewpoint and the viewpoint is far from it.
    pub(super) fn follow(&mut self, viewpoint: DVec3) -> Result<(), WorldError> {
        if self.scene.origin.mode != OriginMode::Following {
            return Ok(());
        }
        check_point("a coordinate of the viewpoint", viewpoint, MAX_DISTANCE)?;
        let is_far = (viewpoint - self.scene.origin.position).abs().max_element() > ORIGIN_GRID;
        if is_far { self.set_origin(nearest_origin(viewpoint)) } else { Ok(()) }
    }

    /// Sets the viewpoint: the position of the camera, in metres in world coordinates. Trees whose
    /// light is strong there are rebuilt first. Trees whose lights change get their new priorities
    /// within eight updates; of the waiting trees whose lights do not change, one gets its new
    /// priority in each update. O(1).
    ///
    /// With [`OriginMode::Following`](crate::OriginMode::Following) this also moves the origin if the
    /// viewpoint is far from it. Call it before the upload in every frame then.
    ///
    /// # Errors
    /// [`WorldError::Value`] for a coordinate that is NaN or infinite and, if the origin follows the
    /// viewpoint, for one beyond [`MAX_DISTANCE`].
    pub fn set_viewpoint(&mut self, viewpoint: DVec3) -> Result<(), WorldError> {
        check_point("a coordinate of the viewpoint", viewpoint, f64::MAX)?;
        self.follow(viewpoint)?;
        self.rebuilds.weights.viewpoint = Some(viewpoint);
        Ok(())
    }
}
