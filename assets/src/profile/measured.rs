//! Intensities as they were measured, and the profile of all directions that they stand for.

use girandole::Profile;
use glam::{Mat3, Vec3};

use super::text::{Number, in_line, missing};
use crate::error::{AssetError, invalid};

/// The coordinates of a measurement: what its angles are from and around.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Coordinates {
    /// Of headlamps: horizontal angles around the vertical axis, clockwise from above; vertical ones above the horizon.
    A,
    /// Of floodlights: vertical angles around the horizontal axis, upward; horizontal ones from the middle to its right
    /// end.
    B,
    /// Of most luminaires: horizontal angles around the direction straight down, vertical ones from it.
    C,
}

/// Intensities of a table of angles in degrees.
#[derive(Clone, Debug)]
pub(super) struct Measured {
    pub coordinates: Coordinates,
    pub vertical: Vec<Number>,
    pub horizontal: Vec<Number>,
    /// For each horizontal angle, the intensities at all vertical ones.
    pub candela: Vec<Number>,
    /// Times this they are in candela.
    pub factor: f64,
}

/// The greatest intensity of a [`Profile`], in candela.
const MAX_CANDELA: f64 = 1.0e15;

/// The most intensities of a [`Profile`].
const MAX_VALUES: usize = 1 << 18;

/// The least difference of two angles, in degrees.
const MIN_STEP: f64 = 1.0e-3;

/// A table whose columns follow each other.
struct Table {
    rows: Vec<f64>,
    columns: Vec<f64>,
    /// For each column, the values of all rows.
    values: Vec<f64>,
}

impl Table {
    fn transposed(self) -> Self {
        let (height, width) = (self.rows.len(), self.columns.len());
        let values = (0..height).flat_map(|row| (0..width).map(move |column| column * height + row));
        Self { values: values.map(|at| self.values[at]).collect(), rows: self.columns, columns: self.rows }
    }

    /// The table with columns in the reverse order, at the negative angles.
    fn reversed(mut self) -> Self {
        let columns = self.values.chunks(self.rows.len()).rev();
        self.values = columns.flatten().copied().collect();
        self.columns = self.columns.iter().rev().map(|angle| -angle).collect();
        self
    }

    /// The table and its mirror image about its last column.
    fn mirrored(mut self) -> Self {
        let height = self.rows.len();
        let last = self.columns[self.columns.len() - 1];
        for column in (0..self.columns.len() - 1).rev() {
            self.columns.push(2.0 * last - self.columns[column]);
            self.values.extend_from_within(column * height..(column + 1) * height);
        }
        self
    }

    /// The table to both sides of 0, if it has one side only.
    fn of_both_sides(self) -> Self {
        if self.columns[0] == 0.0 { self.reversed().mirrored() } else { self }
    }
}

impl Measured {
    /// The profile of all directions.
    pub fn profile(self) -> Result<Profile, AssetError> {
        let Self { coordinates, vertical, horizontal, candela, factor } = self;
        let is_c = coordinates == Coordinates::C;
        let vertical = angles(&vertical, if is_c { [0.0, 180.0] } else { [-90.0, 90.0] })?;
        let line = horizontal.last().map_or(1, |last| last.line);
        let horizontal = angles(&horizontal, if is_c { [-180.0, 360.0] } else { [-90.0, 90.0] })?;
        if !is_c && horizontal.len() < 2 {
            return Err(missing(line, "a second horizontal angle"));
        }
        let intensity = |number: Number| {
            let Number { value, line, what } = number;
            Number { value: value * factor, line, what }.between(0.0, MAX_CANDELA)
        };
        let values = candela.into_iter().map(intensity).collect::<Result<_, _>>()?;
        let table = Table { rows: vertical, columns: horizontal, values };
        // Upward is +X, and rightward -Y.
        let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
        let (table, axes) = match coordinates {
            Coordinates::C => (whole_turn(table, line)?, [x, y, -z]),
            // From above instead of above the horizon.
            Coordinates::A => {
                let mut table = table.of_both_sides().transposed().of_both_sides().reversed();
                table.columns.iter_mut().for_each(|angle| *angle += 90.0);
                (table.transposed(), [-z, -y, x])
            }
            // From the left end.
            Coordinates::B => {
                let mut table = table.of_both_sides();
                table.columns.iter_mut().for_each(|angle| *angle += 90.0);
                (table.transposed().of_both_sides(), [-z, x, y])
            }
        };
        let radians = |angles: &[f64]| angles.iter().map(|angle| angle.to_radians() as f32).collect::<Vec<f32>>();
        let (polar, around) = (radians(&table.rows), radians(&table.columns));
        let candela: Vec<f32> = table.values.iter().map(|value| *value as f32).collect();
        Profile::new(&polar, &around, &candela, Mat3::from_cols(axes[0], axes[1], axes[2])).map_err(invalid)
    }
}

/// Angles, if they ascend within a range.
fn angles(numbers: &[Number], [least, most]: [f64; 2]) -> Result<Vec<f64>, AssetError> {
    let mut from = least;
    let mut angle = |number: &Number| {
        let angle = number.between(from, most)?;
        from = angle + MIN_STEP;
        Ok(angle)
    };
    numbers.iter().map(&mut angle).collect()
}

/// The number of values of so many angles, before they are read.
pub(super) fn value_count(vertical: &[Number], horizontal: &[Number]) -> Result<usize, AssetError> {
    let found = vertical.len() * horizontal.len();
    let line = horizontal.last().map_or(1, |last| last.line);
    if found <= MAX_VALUES {
        return Ok(found);
    }
    Err(in_line(line, format_args!("there are {found} intensities; at most {MAX_VALUES} are allowed")))
}

/// All planes around the axis, from those that a file has: one for all, a quarter, a half or all of them.
fn whole_turn(table: Table, line: usize) -> Result<Table, AssetError> {
    let [first, last] = [table.columns[0], table.columns[table.columns.len() - 1]];
    let turn = last - first;
    match (first, turn) {
        _ if table.columns.len() == 1 => Ok(table),
        (0.0, 90.0) => Ok(table.mirrored().mirrored()),
        (0.0 | 90.0 | -90.0, 180.0) => Ok(table.mirrored()),
        (_, 360.0) => Ok(table),
        // The last plane is the first one, and is left out.
        (_, turn) if turn > 180.0 && turn < 360.0 && 360.0 - turn < widest(&table.columns) + MIN_STEP => {
            let mut table = table;
            if 360.0 - turn < MIN_STEP {
                table.columns.pop();
                table.values.truncate(table.rows.len() * table.columns.len());
            }
            table.columns.push(first + 360.0);
            table.values.extend_from_within(..table.rows.len());
            Ok(table)
        }
        _ => Err(in_line(
            line,
            format_args!("planes from {first:?} to {last:?} degrees are no turn, and no half or quarter of one"),
        )),
    }
}

/// The greatest difference of two angles that follow each other.
fn widest(angles: &[f64]) -> f64 {
    angles.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max)
}
