//! The point that sampling coordinates are relative to (a floating origin).

use glam::{DVec3, Vec3};

use crate::error::{ValueError, check_point};
use crate::instance::placement::{Anchor, MAX_DISTANCE};
use crate::instance::sector::{self, ORIGIN_GRID};

/// How [`LightWorld::origin`](crate::LightWorld::origin) moves.
///
/// Placements and viewpoints are f64; sampling is f32, relative to the origin. So the origin has to
/// stay near the camera: 10 km away, f32 resolves a millimetre.
///
/// With [`OriginMode::Free`] a new origin changes the data of every instance. With the other modes
/// the origin lies on a grid of [`ORIGIN_GRID`](crate::ORIGIN_GRID) metres, and the data of
/// instances do not depend on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum OriginMode {
    /// The origin is anywhere. [`LightWorld::set_origin`](crate::LightWorld::set_origin) is O(instances), and all instances are
    /// uploaded again. Instances are at most [`MAX_DISTANCE`](crate::MAX_DISTANCE) from the origin
    /// along each axis.
    #[default]
    Free,
    /// The origin is on the grid. [`LightWorld::set_origin`](crate::LightWorld::set_origin) is O(1), and an upload sends less than
    /// 200 bytes for it. The origin and all instances are at most
    /// [`MAX_DISTANCE`](crate::MAX_DISTANCE) from zero along each axis, so no instance prevents a
    /// move of the origin.
    Grid,
    /// As [`OriginMode::Grid`], and the origin follows
    /// [`LightWorld::set_viewpoint`](crate::LightWorld::set_viewpoint): once the
    /// viewpoint is more than [`ORIGIN_GRID`](crate::ORIGIN_GRID) from the origin along some axis,
    /// the origin moves to the nearest point of the grid. That point is at most half a step of the
    /// grid away along each axis, so a camera that turns around moves the origin again only after
    /// half a step.
    Following,
}

/// The origin of a world.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Origin {
    pub mode: OriginMode,
    pub position: DVec3,
    /// The origin as the centre of a sector; 0 where it is not on a grid.
    pub home: Vec3,
}

impl Origin {
    /// Whether the origin lies on the grid, so that instances do not depend on it.
    pub fn is_on_grid(&self) -> bool {
        self.mode != OriginMode::Free
    }

    /// What translations of instances are stored relative to.
    pub fn anchor(&self) -> Anchor {
        if self.is_on_grid() { Anchor::Sector } else { Anchor::Point(self.position) }
    }

    /// The origin at another place, in another mode.
    pub fn at(mode: OriginMode, position: DVec3) -> Result<Self, ValueError> {
        let what = "a coordinate of the origin";
        if mode == OriginMode::Free {
            check_point(what, position, f64::MAX)?;
            return Ok(Self { mode, position, home: Vec3::ZERO });
        }
        check_point(what, position, MAX_DISTANCE)?;
        if let Some(value) = position.to_array().into_iter().find(|value| value % ORIGIN_GRID != 0.0) {
            let coordinate = ValueError::new(what, value, -MAX_DISTANCE, MAX_DISTANCE);
            return Err(ValueError { rule: "a multiple of 1024", ..coordinate });
        }
        Ok(Self { mode, position, home: position.as_vec3() })
    }
}

/// The point of the grid that is nearest to a viewpoint, within the limits of the origin.
pub(super) fn nearest_origin(viewpoint: DVec3) -> DVec3 {
    let last = (MAX_DISTANCE / ORIGIN_GRID).floor() * ORIGIN_GRID;
    sector::nearest(viewpoint).clamp(DVec3::splat(-last), DVec3::splat(last))
}
