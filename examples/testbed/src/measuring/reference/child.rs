//! A child of a packed node, decoded in f64 (docs/math.md, Packed nodes).

use super::place::Map;
use girandole::glam::{DMat3, DVec3};
use girandole::tree::{ChildRef, Node};
use std::f64::consts::PI;

/// What a node says about one child, in the space of the tree or in the axes of an instance.
#[derive(Clone, Copy, Debug)]
pub struct Child {
    pub target: ChildRef,
    pub flux: f64,
    pub min: DVec3,
    pub max: DVec3,
    pub mean: DVec3,
    pub variance: f64,
    /// The standard deviation of position, as a share of half the diagonal of the packed box.
    pub deviation: f64,
    /// A unit vector.
    pub axis: DVec3,
    /// The length of the mean direction.
    pub length: f64,
    /// The half-angle of the cap in radians; `None` for all directions.
    pub half_angle: Option<f64>,
    /// `None` for an unlimited one.
    pub range: Option<f64>,
    /// The shares of the flux that come from lights without size and from surfaces.
    pub shares: [f64; 2],
    /// Whether the axis is that of surfaces.
    pub has_normal: bool,
}

impl Child {
    /// `None` for an unused slot and for a dark child.
    pub fn of(node: &Node, slot: usize) -> Option<Self> {
        let target = node.child(slot)?;
        let upper_half = |bits: u16| f64::from(f32::from_bits(u32::from(bits) << 16));
        let flux = upper_half(node.flux[slot]);
        if flux <= 0.0 {
            return None;
        }
        let corner = |bytes: &[[u8; 8]; 3]| {
            DVec3::from([0, 1, 2].map(|k| {
                let exponent = (node.steps >> (8 * k) & 0xff) as i32 - 127;
                // An exponent of 0 stands for no extent.
                let step = if exponent > -127 { 2.0_f64.powi(exponent) } else { 0.0 };
                f64::from(node.origin[k]) + f64::from(bytes[k][slot]) * step
            }))
        };
        let (min, max) = (corner(&node.low), corner(&node.high));
        let shares = DVec3::from([0, 1, 2].map(|k| f64::from(node.mean[k][slot]) / 255.0));
        let half_diagonal = 0.5 * (max - min).length();
        let deviation = f64::from(node.deviation[slot]) / 255.0;
        let shortness = f64::from(node.shortness[slot]) / 255.0;
        let range = upper_half(node.range[slot]);
        let code = node.area_ratios >> (4 * slot) & 15;
        let ratio = 2.0_f64.powi(code as i32 - 7 - 3 * (node.steps as i32 >> 28));
        Some(Self {
            target,
            flux,
            min,
            max,
            mean: min + (max - min) * shares,
            variance: (deviation * half_diagonal).powi(2),
            deviation,
            axis: DVec3::from([0, 1, 2].map(|k| f64::from(node.axis[k][slot]))).normalize(),
            length: 1.0 - shortness * shortness,
            half_angle: (node.cap[slot] < 254).then(|| (1.0 - f64::from(node.cap[slot]) / 127.0).acos()),
            range: (range < 1.0e18).then_some(range),
            shares: match code {
                0 => [1.0, 0.0],
                15 => [0.0, 1.0],
                _ => [1.0 / (1.0 + ratio), ratio / (1.0 + ratio)],
            },
            has_normal: code >= 4,
        })
    }

    /// In the axes of an instance, about its translation (docs/math.md, The shading point in tree
    /// space).
    pub fn in_axes(self, map: &Map) -> Self {
        let linear = map.axes.transpose() * map.linear;
        let half_sq = self.half() * self.half();
        let columns = DVec3::from([0, 1, 2].map(|k| linear.col(k).length_squared()));
        let center = linear * self.center();
        let half = DMat3::from_cols_array(&linear.to_cols_array().map(f64::abs)) * self.half();
        let [punctual, area] = self.shares;
        let (axis, half_angle) =
            map.cap([self.has_normal, self.has_normal && punctual <= 0.0], self.axis, self.half_angle.unwrap_or(PI));
        Self {
            flux: self.flux * (punctual + area * map.area_factor(self.axis, self.length)),
            min: center - half,
            max: center + half,
            mean: linear * self.mean,
            variance: self.deviation.powi(2) * half_sq.dot(columns),
            axis: map.axes.transpose() * axis,
            half_angle,
            ..self
        }
    }

    /// The centre of the box.
    pub fn center(&self) -> DVec3 {
        0.5 * (self.min + self.max)
    }

    /// Half the edges of the box.
    pub fn half(&self) -> DVec3 {
        0.5 * (self.max - self.min)
    }
}
