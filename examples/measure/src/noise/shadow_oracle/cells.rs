//! Cells of the world whose surfaces share what is known about visibility.

use super::receivers::Receiver;
use girandole::ShadingPoint;
use girandole::glam::{IVec3, Vec3};
use testbed::direct_light::view::first_surface;
use testbed::render::geometry::Geometry;
use testbed::scene::rng::Rng;

/// The number of other surfaces of a cell that are looked for.
pub const NEIGHBOURS: usize = 16;
/// Camera rays per cell, at most. Few rays meet a cell on a surface that is seen at a grazing
/// angle.
const TRIES: usize = 4_000;

/// A cube of the world and one of six sides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cell {
    cube: IVec3,
    /// The axis of the greatest component of the normal, and whether it is negative.
    side: (usize, bool),
}

impl Cell {
    /// The cell of a surface, among cubes with edges of `edge` metres.
    pub fn of(shading_point: &ShadingPoint, edge: f32) -> Self {
        let axis = shading_point.normal.abs().max_position();
        let cube = (shading_point.position / edge).floor().as_ivec3();
        Self { cube, side: (axis, shading_point.normal[axis] < 0.0) }
    }
}

/// Up to [`NEIGHBOURS`] surfaces in the cell of a receiver that its eye sees: what camera rays
/// through random points of the cube meet first, if that lies in the cell. Fewer are found where
/// hardly any of the cell is in sight.
pub fn neighbours(geometry: &Geometry, receiver: &Receiver, edge: f32, rng: &mut Rng) -> Vec<ShadingPoint> {
    let cell = Cell::of(&receiver.shading_point, edge);
    let mut found = Vec::with_capacity(NEIGHBOURS);
    for _ in 0..TRIES {
        let within = Vec3::from_array(std::array::from_fn(|_| rng.unit()));
        let through = (cell.cube.as_vec3() + within) * edge;
        let Some(direction) = (through - receiver.eye).try_normalize() else { continue };
        if let Some(surface) = first_surface(geometry, receiver.eye, direction)
            && Cell::of(&surface.shading_point, edge) == cell
        {
            found.push(surface.shading_point);
            if found.len() == NEIGHBOURS {
                break;
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use girandole::glam::vec3;

    #[test]
    fn a_cell_is_a_cube_and_a_side() {
        let cell = |position, normal: Vec3| Cell::of(&ShadingPoint::surface(position, normal), 2.0);
        let at = cell(vec3(0.5, -0.1, 3.0), Vec3::Y);
        assert_eq!((at.cube, at.side), (IVec3::new(0, -1, 1), (1, false)));
        assert_eq!(at, cell(vec3(1.9, -1.9, 2.1), vec3(0.3, 0.9, 0.1).normalize()));
        assert_ne!(at, cell(vec3(0.5, -0.1, 3.0), Vec3::NEG_Y));
        assert_ne!(at, cell(vec3(0.5, -0.1, 3.0), Vec3::X));
        assert_ne!(at, cell(vec3(2.1, -0.1, 3.0), Vec3::Y));
    }
}
