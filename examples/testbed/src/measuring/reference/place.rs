//! Linear maps of instances, and shading points in the space of a tree (docs/math.md, Placements and
//! The shading point in tree space).

use girandole::glam::{DMat3, DVec3};
use std::f64::consts::PI;

/// A linear map with what is derived from it.
#[derive(Clone, Copy, Debug)]
pub struct Map {
    pub linear: DMat3,
    pub inverse: DMat3,
    pub is_rotation: bool,
    /// A lower bound of the least singular value.
    pub least_scale: f64,
    /// The angle by which directions turn against each other, at most; π where it is 3 or more.
    pub turn: f64,
}

fn norm_sq(m: &DMat3) -> f64 {
    m.to_cols_array().iter().map(|entry| entry * entry).sum()
}

fn largest(m: &DMat3) -> f64 {
    m.to_cols_array().iter().fold(0.0, |most, entry| entry.abs().max(most))
}

impl Map {
    pub fn new(linear: DMat3) -> Self {
        let inverse = linear.inverse();
        let gram = linear.transpose() * linear;
        let square = norm_sq(&linear) / 3.0;
        let is_similarity = largest(&(gram - DMat3::IDENTITY * square)) <= 1.0e-5 * square;
        // κ + 1 + 1/κ of the singular values is at most the product of the norms.
        let sum = (norm_sq(&linear) * norm_sq(&inverse)).sqrt() - 1.0;
        let condition = 0.5 * (sum + (sum * sum - 4.0).max(0.0).sqrt());
        let turn = 4.0 * condition.sqrt().atan() - PI;
        Self {
            linear,
            inverse,
            is_rotation: linear.determinant() > 0.0 && largest(&(gram - DMat3::IDENTITY)) <= 4.0e-6,
            least_scale: if is_similarity { square.sqrt() * (1.0 - 1.0e-5) } else { 1.0 / norm_sq(&inverse).sqrt() },
            turn: match turn {
                _ if is_similarity => 0.0,
                turn if turn >= 3.0 => PI,
                turn => turn,
            },
        }
    }

    /// The mean of the squared singular values.
    pub fn mean_square(&self) -> f64 {
        norm_sq(&self.linear) / 3.0
    }

    /// Carries normals with their area.
    pub fn cofactor(&self) -> DMat3 {
        self.inverse.transpose() * self.linear.determinant().abs()
    }

    /// The factor of the flux of surfaces that emit along a unit vector on the mean; `length` is
    /// that of the mean direction.
    pub fn area_factor(&self, axis: DVec3, length: f64) -> f64 {
        let agreement = (1.5 * length).min(1.0);
        let cofactor = self.cofactor();
        agreement * (cofactor * axis).length() + (1.0 - agreement) * (norm_sq(&cofactor) / 3.0).sqrt()
    }
}

/// A shading point in the space of a tree or of the top level.
#[derive(Clone, Copy, Debug)]
pub struct View {
    pub position: DVec3,
    /// A unit vector, or zero in a volume.
    pub normal: DVec3,
    /// From the middle of a segment, which is the position, to its end; zero for a point.
    pub segment: DVec3,
    /// The map to the world if lengths differ there.
    pub to_world: Option<Map>,
    /// The angle by which caps are widened.
    pub turn: f64,
    /// The most metres of this space per metre of the world.
    pub range_scale: f64,
    /// The margin for positions, as a share of coordinates.
    pub margin: f64,
    /// The luminance of the factor of the instance.
    pub brightness: f64,
}

impl View {
    /// In the space in which the shading point is given. The normal may have any length, and is zero
    /// in a volume.
    pub fn of(position: DVec3, normal: DVec3) -> Self {
        Self {
            position,
            normal: normal.normalize_or_zero(),
            segment: DVec3::ZERO,
            to_world: None,
            turn: 0.0,
            range_scale: 1.0,
            margin: 1.0e-6,
            brightness: 1.0,
        }
    }

    /// A segment of a ray through a volume, by its middle and the vector from there to its end.
    pub fn along(middle: DVec3, segment: DVec3) -> Self {
        Self { segment, ..Self::of(middle, DVec3::ZERO) }
    }

    /// In the space of an instance's tree.
    pub fn in_tree(self, map: &Map, translation: DVec3, brightness: f64) -> Self {
        let condition = (map.mean_square().sqrt() / map.least_scale).max(1.0);
        Self {
            position: map.inverse * (self.position - translation),
            normal: (map.linear.transpose() * self.normal).normalize_or_zero(),
            segment: map.inverse * self.segment,
            to_world: (!map.is_rotation).then_some(*map),
            turn: if map.is_rotation { 0.0 } else { map.turn },
            range_scale: 1.0 / map.least_scale,
            margin: 1.0e-6 * condition + 4.0e-6,
            brightness,
        }
    }
}
