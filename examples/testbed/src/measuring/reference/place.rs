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
}

/// The greatest singular value: the limit of the roots of traces of powers of the Gram matrix.
fn greatest_scale(m: &DMat3) -> f64 {
    let (mut power, mut log, mut share) = (m.transpose() * *m, 0.0, 0.5);
    for _ in 0..60 {
        let trace = power.x_axis.x + power.y_axis.y + power.z_axis.z;
        log += share * trace.ln();
        power *= trace.recip();
        power = power * power;
        share *= 0.5;
    }
    log.exp()
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
        let x = linear.x_axis.normalize();
        let z = linear.x_axis.cross(linear.y_axis).normalize() * linear.determinant().signum();
        Self {
            linear,
            inverse,
            is_rotation: linear.determinant() > 0.0 && largest(&(gram - DMat3::IDENTITY)) <= 4.0e-6,
            axes: DMat3::from_cols(x, z.cross(x), z),
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

    /// The image of a cap: its unit axis and its half-angle, `None` for all directions. The axis is that
    /// of surfaces if `has_normal`. Half spaces of surfaces alone stay half spaces. Caps of lights without size
    /// are widened by the angle by which directions turn against each other.
    pub fn cap(&self, [has_normal, is_surface]: [bool; 2], axis: DVec3, half_angle: f64) -> (DVec3, Option<f64>) {
        let image = if has_normal { self.cofactor() } else { self.linear } * axis;
        let condition = greatest_scale(&self.linear) * greatest_scale(&self.inverse);
        let turn = match 4.0 * condition.sqrt().atan() - PI {
            _ if condition < 1.0 + 1.0e-5 => 0.0,
            turn if turn >= 3.0 => PI,
            turn => turn,
        };
        let half_angle = match () {
            () if turn == 0.0 => half_angle,
            () if is_surface => {
                (half_angle.cos().min(0.0) * greatest_scale(&self.cofactor()) / image.length()).max(-1.0).acos()
            }
            () if has_normal => PI,
            () => half_angle + turn,
        };
        (image.normalize(), (half_angle < PI).then_some(half_angle))
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
