//! What a node keeps of a group of lights: a Gaussian of position, a spherical Gaussian of
//! direction, and bounds.

use super::gaussian::{peak, sharpness_of};
use girandole::Light;
use girandole::cluster::Aabb;
use girandole::glam::DVec3;
use std::f64::consts::PI;

/// The mean direction of emission of one light is at most as long as that of a Lambertian emitter,
/// the mean of a cosine. Narrower lobes, which are true to spots, hide a lamp beside the middle of
/// its group: mean sigma on city S is then 5e15, and on Bistro 32 instead of 0.68. The authors'
/// code has 1/2 for Lambertian emitters: 2.6 instead of 2.2 on city S.
const MAX_LENGTH: f64 = 2.0 / 3.0;

/// A group of lights with some power.
#[derive(Clone, Copy, Debug)]
pub struct Moments {
    /// In lumens.
    power: f64,
    mean: DVec3,
    /// The trace of the covariance of position, in square metres.
    variance: f64,
    /// The mean direction of emission.
    axis: DVec3,
    aabb: Aabb,
    /// The radius of a sphere about the mean around all lights, in metres.
    radius: f64,
}

impl Moments {
    /// The moments of one light; `None` without power.
    pub fn of(light: &Light) -> Option<Self> {
        let cluster = light.cluster();
        let mean = cluster.mean.as_dvec3();
        let axis = cluster.axis.as_dvec3().clamp_length_max(MAX_LENGTH);
        let power = f64::from(cluster.flux);
        let own = Self { power, mean, variance: f64::from(cluster.variance), axis, aabb: cluster.aabb, radius: 0.0 };
        (cluster.flux > 0.0).then(|| Self { radius: own.farthest(), ..own })
    }

    /// The moments of both groups.
    pub fn union(&self, other: &Self) -> Self {
        let power = self.power + other.power;
        let [a, b] = [self.power / power, other.power / power];
        let mean = self.mean * a + other.mean * b;
        let between = a * self.mean.distance_squared(mean) + b * other.mean.distance_squared(mean);
        let both = Self {
            power,
            mean,
            variance: a * self.variance + b * other.variance + between,
            axis: self.axis * a + other.axis * b,
            aabb: self.aabb.union(&other.aabb),
            radius: 0.0,
        };
        let reach = |group: &Self| group.mean.distance(mean) + group.radius;
        Self { radius: both.farthest().min(reach(self).max(reach(other))), ..both }
    }

    /// The distance of the farthest corner of the box.
    fn farthest(&self) -> f64 {
        let [min, max] = [self.aabb.min.as_dvec3() - self.mean, self.aabb.max.as_dvec3() - self.mean];
        min.abs().max(max.abs()).length()
    }
}

// The rows of [`GaussianLights`]. A vector has three.

/// The mean position, in metres.
pub const MEAN: usize = 0;
/// The unit vector against the mean direction of emission.
pub const AXIS: usize = 3;
/// The middle of the box.
pub const CENTER: usize = 6;
/// Half of the edges of the box.
pub const HALF: usize = 9;
/// The variance of position across the view, in square metres: half of the trace of the
/// covariance, because the authors take lights to lie in a plane.
pub const VARIANCE: usize = 12;
/// The greatest variance that the bounding sphere allows.
pub const MOST_VARIANCE: usize = 13;
/// The sharpness of the emission.
pub const SHARPNESS: usize = 14;
/// The intensity along the mean direction over 2 pi, in candela.
pub const INTENSITY: usize = 15;

/// [`INTENSITY`] is the last row, and one without values follows: see [`GaussianLights::row`].
const ROWS: usize = 17;

/// Groups of lights side by side, one per lane. Lanes without lights have no intensity.
#[derive(Clone, Copy, Debug)]
pub struct GaussianLights<const N: usize> {
    rows: [[f32; N]; ROWS],
}

impl<const N: usize> GaussianLights<N> {
    pub const DARK: Self = Self { rows: [[0.0; N]; ROWS] };

    /// A value of a lane. Lanes from `N` up to twice `N` have values of the next row: what is computed from them
    /// is not used, but the loop over them is as wide as a vector.
    #[inline(always)]
    pub fn row(&self, row: usize, lane: usize) -> f32 {
        self.rows.as_flattened()[row * N + lane]
    }

    pub fn set(&mut self, lane: usize, group: &Moments) {
        let sharpness = sharpness_of(group.axis.length() as f32);
        let axis = -group.axis.normalize_or(DVec3::NEG_Z).as_vec3();
        let Aabb { min, max } = group.aabb;
        let vectors =
            [(MEAN, group.mean.as_vec3()), (AXIS, axis), (CENTER, 0.5 * (min + max)), (HALF, 0.5 * (max - min))];
        for (row, vector) in vectors {
            (0..3).for_each(|k| self.rows[row + k][lane] = vector[k]);
        }
        self.rows[VARIANCE][lane] = (0.5 * group.variance) as f32;
        self.rows[MOST_VARIANCE][lane] = (0.5 * group.radius * group.radius) as f32;
        self.rows[SHARPNESS][lane] = sharpness;
        self.rows[INTENSITY][lane] = (group.power / (2.0 * PI)) as f32 * peak(sharpness);
    }
}
