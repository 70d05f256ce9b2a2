//! Intensities on a grid of angles: those from a pole, and those around it.

use std::f32::consts::{PI, TAU};

use glam::{DVec3, Mat3, Vec3};

use crate::error::ProfileError;

/// The most intensities of a grid: half degrees in all directions.
pub(super) const MAX_VALUES: usize = 1 << 18;

/// The greatest intensity, in candela.
const MAX_CANDELA: f32 = 1.0e15;

/// The least difference of two angles, in radians: a little less than that of files, 0.001 degrees.
const MIN_STEP: f32 = 1.0e-5;

/// A whole turn, with its rounding.
const MAX_TURN: f32 = 1.0001 * TAU;

/// Planes that cover as much go all around, in radians.
pub(crate) const WHOLE_TURN: f32 = 0.9999 * TAU;

/// Where a cone is looked for, cells are cut into squares of at most this side, in radians.
const FINE: f32 = 2.0 * PI / 180.0;

/// All directions of such a square are this close to a corner, in radians.
const FINE_MARGIN: f32 = 1.5 * PI / 180.0;

/// Intensities, interpolated linearly in both angles. Beyond the first and last angle it is dark.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Grid {
    /// Radians from the pole, two or more, ascending.
    pub polar: Vec<f32>,
    /// Radians around the pole, ascending, a turn at most. A single one stands for all.
    pub around: Vec<f32>,
    /// In candela, at least 0: for each angle around, those of all angles from the pole.
    pub candela: Vec<f32>,
    /// Axes in the space of the lamp: where the angle around is 0 and where it is 90 degrees, and the pole.
    pub axes: Mat3,
}

/// What a grid emits altogether, in the space of the lamp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lobe {
    /// In lumens.
    pub flux: f32,
    /// The mean direction of emission; its length is the mean cosine of the angle to it.
    pub mean: Vec3,
    /// All light leaves within this angle of the mean direction, in radians.
    pub half_angle: f32,
}

impl Grid {
    /// Checks the numbers, of which nothing is known.
    pub fn check(&self) -> Result<(), ProfileError> {
        let Self { polar, around, candela, axes } = self;
        let [rows, columns, count] = [polar, around, candela].map(Vec::len);
        let is_full = rows >= 2 && columns >= 1 && rows.checked_mul(columns) == Some(count) && count <= MAX_VALUES;
        if !is_full {
            let message = format!(
                "{count} intensities for {rows} angles from the pole and {columns} around it; there must be one for each \
                 pair, {MAX_VALUES} at most, of two angles or more and one or more"
            );
            return Err(ProfileError { message });
        }
        check_numbers("angle from the pole", polar, [0.0, PI], MIN_STEP)?;
        let end = (around[0] + MAX_TURN).min(2.0 * MAX_TURN);
        check_numbers("angle around the pole", around, [-MAX_TURN, end], MIN_STEP)?;
        check_numbers("intensity", candela, [0.0, MAX_CANDELA], f32::NEG_INFINITY)?;
        let is_along_axes = axes.to_cols_array().iter().all(|entry| [-1.0, 0.0, 1.0].contains(entry));
        if is_along_axes && *axes * axes.transpose() == Mat3::IDENTITY {
            return Ok(());
        }
        Err(ProfileError { message: format!("the axes {axes} are not those of the lamp in any order") })
    }

    /// The intensity in a direction of any length but 0, whose coordinates are along the axes of the grid.
    pub fn candela(&self, direction: Vec3) -> f32 {
        let polar = direction.x.hypot(direction.y).atan2(direction.z);
        let around = direction.y.atan2(direction.x);
        // A single angle has a cell of no width.
        let first = self.around[0];
        let around = if around < first { around + TAU } else { around };
        // A whole turn has no end, however the angle rounds.
        let last = self.around[self.around.len() - 1];
        let around = if last - first >= WHOLE_TURN { around.min(last) } else { around };
        let column = if self.around.len() == 1 { Some((0, 0.0)) } else { cell(&self.around, around) };
        let (Some((i, s)), Some((j, t))) = (cell(&self.polar, polar), column) else { return 0.0 };
        let of_column = |j: usize| {
            let at = j * self.polar.len() + i;
            self.candela[at] + (self.candela[at + 1] - self.candela[at]) * s
        };
        let low = of_column(j);
        if t == 0.0 { low } else { low + (of_column(j + 1) - low) * t }
    }

    /// The quads that a GPU stores: two numbers of angles, then all numbers.
    #[cfg(feature = "gpu-plan")]
    pub fn stored_quads(&self) -> u32 {
        // Less than 2^20 numbers.
        1 + (self.polar.len() + self.around.len() + self.candela.len()).div_ceil(4) as u32
    }

    /// The direction of two angles, in the space of the lamp.
    fn direction(&self, polar: f32, around: f32) -> Vec3 {
        self.axes * Vec3::new(polar.sin() * around.cos(), polar.sin() * around.sin(), polar.cos())
    }

    /// The exact integrals of the interpolated intensities.
    pub fn lobe(&self) -> Lobe {
        // A product of two functions of one angle each belongs to every number of the grid.
        let polar = weights(&self.polar, |angle| {
            let (sin, cos) = angle.sin_cos();
            [sin, sin * sin, sin * cos]
        });
        let around = match self.around.len() {
            1 => vec![[f64::from(TAU), 0.0, 0.0]],
            _ => weights(&self.around, |angle| [1.0, angle.cos(), angle.sin()]),
        };
        let (mut flux, mut moment) = (0.0, DVec3::ZERO);
        for (j, [all, cos, sin]) in around.iter().enumerate() {
            for (i, [flat, across, along]) in polar.iter().enumerate() {
                let candela = f64::from(self.candela[j * self.polar.len() + i]);
                flux += candela * flat * all;
                moment += candela * DVec3::new(across * cos, across * sin, along * all);
            }
        }
        let mean = if flux > 0.0 { self.axes * (moment / flux).as_vec3() } else { Vec3::ZERO };
        Lobe { flux: flux as f32, mean, half_angle: self.half_angle(mean) }
    }

    /// The largest angle between a direction and one in which light leaves.
    fn half_angle(&self, mean: Vec3) -> f32 {
        let Some(axis) = mean.try_normalize() else { return PI };
        let all_around = [0.0, TAU];
        let around: &[f32] = if self.around.len() == 1 { &all_around } else { &self.around };
        let is_lit = |j: usize, i: usize| {
            let columns = [j.min(self.around.len() - 1), (j + 1).min(self.around.len() - 1)];
            columns.iter().any(|j| [i, i + 1].iter().any(|i| self.candela[j * self.polar.len() + i] > 0.0))
        };
        let mut least: f32 = 1.0;
        for (j, sides) in around.windows(2).enumerate() {
            for (_, ends) in self.polar.windows(2).enumerate().filter(|(i, _)| is_lit(j, *i)) {
                for polar in steps(ends[0], ends[1]) {
                    steps(sides[0], sides[1]).for_each(|a| least = least.min(self.direction(polar, a).dot(axis)));
                }
            }
        }
        (least.clamp(-1.0, 1.0).acos() + FINE_MARGIN).min(PI)
    }
}

/// Checks that numbers are in a range, and each is above the one before by a step. NaN is in no range.
fn check_numbers(what: &str, numbers: &[f32], [least, most]: [f32; 2], step: f32) -> Result<(), ProfileError> {
    let mut from = least;
    for (index, number) in numbers.iter().enumerate() {
        if !(from..=most).contains(number) {
            return Err(ProfileError {
                message: format!("{what} {index} is {number:?}, outside {from:?} to {most:?}"),
            });
        }
        from = from.max(number + step);
    }
    Ok(())
}

/// Angles from one to another, by [`FINE`] at most.
fn steps(first: f32, last: f32) -> impl Iterator<Item = f32> {
    let count = ((last - first) / FINE).ceil().max(1.0) as usize;
    (0..=count).map(move |k| first + (last - first) * (k as f32 / count as f32))
}

/// The cell that holds an angle, and how far it is from the cell's first side to its second.
fn cell(angles: &[f32], angle: f32) -> Option<(usize, f32)> {
    let last = angles.len() - 1;
    // NaN is in no range.
    (angles[0]..=angles[last]).contains(&angle).then_some(())?;
    let i = (angles.partition_point(|side| *side <= angle) - 1).min(last - 1);
    Some((i, (angle - angles[i]) / (angles[i + 1] - angles[i])))
}

/// For each angle, integrals of its share in an interpolation times some functions, by the quadrature of Gauss with 8
/// points in each cell.
fn weights(angles: &[f32], functions: impl Fn(f64) -> [f64; 3]) -> Vec<[f64; 3]> {
    const POINTS: [(f64, f64); 4] = [
        (0.183_434_642_495_649_8, 0.362_683_783_378_362),
        (0.525_532_409_916_329, 0.313_706_645_877_887_3),
        (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
        (0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
    ];
    let mut weights = vec![[0.0; 3]; angles.len()];
    for (i, ends) in angles.windows(2).enumerate() {
        let [first, last] = [ends[0], ends[1]].map(f64::from);
        for (offset, weight) in POINTS.iter().flat_map(|(offset, weight)| [(*offset, *weight), (-offset, *weight)]) {
            let share = 0.5 * (1.0 + offset);
            let values = functions(first + (last - first) * share);
            for k in 0..3 {
                let value = values[k] * weight * 0.5 * (last - first);
                weights[i][k] += value * (1.0 - share);
                weights[i + 1][k] += value * share;
            }
        }
    }
    weights
}
