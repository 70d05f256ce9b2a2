//! The point that sampling coordinates are relative to (a floating origin), and how it moves.

use glam::{DVec3, Vec3};

use super::LightWorld;
use crate::effects::Effects;
use crate::error::{WorldError, check_finite};
use crate::instance::placement::{Anchor, MAX_DISTANCE, Placed};
use crate::instance::sector::{self, ORIGIN_GRID};
use crate::keys::slot_of;

/// How [`LightWorld::origin`] moves.
///
/// Placements and viewpoints are f64; sampling is f32, relative to the origin. So the origin has to
/// stay near the camera: 10 km away, f32 resolves a millimetre.
///
/// With [`OriginMode::Free`] a new origin changes the data of every instance. With the other modes
/// the origin lies on a grid of [`ORIGIN_GRID`](crate::ORIGIN_GRID) metres, and the data of
/// instances do not depend on it. These modes add
/// [`Effects::SECTORS`](crate::Effects::SECTORS): 16 bytes more for each instance on the GPU, and
/// three more additions for each instance that a walk enters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum OriginMode {
    /// The origin is anywhere. [`LightWorld::set_origin`] is O(instances), and all instances are
    /// uploaded again. Instances are at most [`MAX_DISTANCE`](crate::MAX_DISTANCE) from the origin
    /// along each axis.
    #[default]
    Free,
    /// The origin is on the grid. [`LightWorld::set_origin`] is O(1), and an upload sends less than
    /// 200 bytes for it. The origin and all instances are at most
    /// [`MAX_DISTANCE`](crate::MAX_DISTANCE) from zero along each axis, so no instance prevents a
    /// move of the origin.
    Grid,
    /// As [`OriginMode::Grid`], and the origin follows [`LightWorld::set_viewpoint`]: once the
    /// viewpoint is more than [`ORIGIN_GRID`](crate::ORIGIN_GRID) from the origin along some axis,
    /// the origin moves to the nearest point of the grid. That point is at most half a step of the
    /// grid away along each axis, so a camera that turns around moves the origin again only after
    /// half a step.
    Following,
}

/// The origin of a world.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Origin {
    mode: OriginMode,
    position: DVec3,
    /// The origin as the centre of a sector; 0 where it is not on a grid.
    home: Vec3,
}

impl Origin {
    /// What translations of instances are stored relative to.
    pub fn anchor(&self) -> Anchor {
        match self.mode {
            OriginMode::Free => Anchor::Point(self.position),
            OriginMode::Grid | OriginMode::Following => Anchor::Sector,
        }
    }

    /// The origin at another place, in another mode.
    fn at(mode: OriginMode, position: DVec3) -> Result<Self, WorldError> {
        let what = "a coordinate of the origin";
        check_finite(what, position)?;
        if mode == OriginMode::Free {
            return Ok(Self { mode, position, home: Vec3::ZERO });
        }
        check_limit(what, position)?;
        if let Some(value) = position.to_array().into_iter().find(|value| value % ORIGIN_GRID != 0.0) {
            return Err(WorldError::OriginOffGrid { value, grid: ORIGIN_GRID });
        }
        Ok(Self { mode, position, home: position.as_vec3() })
    }
}

/// Checks that a point is not too far from zero for an origin on the grid.
fn check_limit(what: &'static str, point: DVec3) -> Result<(), WorldError> {
    match point.to_array().into_iter().find(|value| value.abs() > MAX_DISTANCE) {
        Some(value) => Err(WorldError::OriginTooFar { what, value, limit: MAX_DISTANCE }),
        None => Ok(()),
    }
}

impl LightWorld {
    /// The point that sampling coordinates are relative to, in metres. Zero until
    /// [`LightWorld::set_origin`] is called or the origin follows the viewpoint.
    ///
    /// A shader sees a new origin after the upload of the next delta, whose
    /// [`FrameDelta::origin_shift`](crate::FrameDelta::origin_shift) is the move. A
    /// [`LightSampler`](crate::LightSampler) sees it at once.
    pub fn origin(&self) -> DVec3 {
        self.origin.position
    }

    /// How the origin moves: [`OriginMode::Free`] until [`LightWorld::set_origin_mode`] is called.
    pub fn origin_mode(&self) -> OriginMode {
        self.origin.mode
    }

    /// The origin as the centre of a sector; 0 where there are no sectors.
    pub(crate) fn home(&self) -> Vec3 {
        self.origin.home
    }

    /// Sets how the origin moves. The origin itself stays where it is.
    ///
    /// Call it before instances are added: then it is O(1). Later, a change from or to
    /// [`OriginMode::Free`] is O(instances) and uploads every instance again. It also changes
    /// [`LightWorld::effects`], so other shaders are needed. Between the other two modes it is
    /// O(1).
    ///
    /// # Errors
    /// [`WorldError::OriginOffGrid`] and [`WorldError::OriginTooFar`] if the new mode does not
    /// allow the present origin; [`WorldError::Placement`] if an instance would be too far away.
    pub fn set_origin_mode(&mut self, mode: OriginMode) -> Result<(), WorldError> {
        let former = self.origin.mode;
        let origin = Origin::at(mode, self.origin.position)?;
        let [was_on_grid, is_on_grid] = [former, mode].map(|mode| mode != OriginMode::Free);
        if was_on_grid != is_on_grid {
            self.place_all_relative_to(origin.anchor())?;
            self.switch(Effects::SECTORS, is_on_grid);
        }
        self.origin = origin;
        Ok(())
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
    /// [`WorldError::NotFinite`] for a coordinate that is NaN or infinite. With
    /// [`OriginMode::Free`] [`WorldError::Placement`] if an instance would be too far from the
    /// origin. With the other modes [`WorldError::OriginOffGrid`] and [`WorldError::OriginTooFar`].
    pub fn set_origin(&mut self, position: DVec3) -> Result<(), WorldError> {
        let origin = Origin::at(self.origin.mode, position)?;
        if position == self.origin.position {
            return Ok(());
        }
        if origin.mode == OriginMode::Free {
            self.place_all_relative_to(origin.anchor())?;
        }
        self.origin = origin;
        self.top.take();
        Ok(())
    }

    /// Moves the origin if it follows the viewpoint and the viewpoint is far from it.
    pub(super) fn follow(&mut self, viewpoint: DVec3) -> Result<(), WorldError> {
        if self.origin.mode != OriginMode::Following {
            return Ok(());
        }
        check_limit("a coordinate of the viewpoint", viewpoint)?;
        let is_far = (viewpoint - self.origin.position).abs().max_element() > ORIGIN_GRID;
        if is_far { self.set_origin(nearest_origin(viewpoint)) } else { Ok(()) }
    }

    /// Computes the data of all instances again, with translations relative to another anchor.
    fn place_all_relative_to(&mut self, anchor: Anchor) -> Result<(), WorldError> {
        let placed: Vec<Option<Placed>> =
            self.instances.values().map(|i| Placed::new(&i.placement, anchor)).collect::<Result<_, _>>()?;
        for (instance, placed) in self.instances.values_mut().zip(placed) {
            instance.placed = placed;
        }
        for key in self.instances.keys() {
            self.changes.instance(slot_of(key));
        }
        self.top.take();
        Ok(())
    }
}

/// The point of the grid that is nearest to a viewpoint, within the limits of the origin.
fn nearest_origin(viewpoint: DVec3) -> DVec3 {
    let last = (MAX_DISTANCE / ORIGIN_GRID).floor() * ORIGIN_GRID;
    sector::nearest(viewpoint).clamp(DVec3::splat(-last), DVec3::splat(last))
}
