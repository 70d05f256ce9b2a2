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
    /// The axes of an instance that is no rotation: orthonormal, x along the image of the tree's x,
    /// z perpendicular to the images of x and y.
    pub axes: DMat3,
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
        let x = linear.x_axis.normalize();
        let z = linear.x_axis.cross(linear.y_axis).normalize() * linear.determinant().signum();
        Self {
            linear,
            inverse,
            is_rotation: linear.determinant() > 0.0 && largest(&(gram - DMat3::IDENTITY)) <= 4.0e-6,
            axes: DMat3::from_cols(x, z.cross(x), z),
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

/// A shading point in the space of a tree, in the axes of an instance, or in the space of the top
/// level.
#[derive(Clone, Copy, Debug)]
pub struct View {
    pub position: DVec3,
    /// A unit vector, or zero in a volume.
    pub normal: DVec3,
    /// From the middle of a segment, which is the position, to its end; zero for a point.
    pub segment: DVec3,
    /// The placement of an instance that is no rotation, whose axes these are.
    pub map: Option<Map>,
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
            map: None,
            margin: 1.0e-6,
            brightness: 1.0,
        }
    }

    /// A segment of a ray through a volume, by its middle and the vector from there to its end.
    pub fn along(middle: DVec3, segment: DVec3) -> Self {
        Self { segment, ..Self::of(middle, DVec3::ZERO) }
    }

    /// In the space of an instance's tree, or in the axes of the instance.
    pub fn in_tree(self, map: &Map, translation: DVec3, brightness: f64) -> Self {
        let (into, axes) = if map.is_rotation { (map.inverse, map.linear) } else { (map.axes.transpose(), map.axes) };
        Self {
            position: into * (self.position - translation),
            normal: (axes.transpose() * self.normal).normalize_or_zero(),
            segment: into * self.segment,
            map: (!map.is_rotation).then_some(*map),
            margin: 5.0e-6,
            brightness,
        }
    }
}
