//! Where most positions of a file are. One wrong position among many does not change it.

use girandole::glam::{DVec2, dvec2};

use super::found::Found;

/// Positions farther from the middle than this multiple of the median distance are far from the others. The
/// farthest of 4,556 street lamps of Champaign, Illinois, is at 5.9 times the median distance, so that this
/// leaves a wide margin for suburbs, and wrong positions are usually at (0, 0) of a national grid or in degrees.
const FAR: f64 = 100.0;
/// Nothing closer to the middle than this is far, metres: positions may be equal, or be those of one crossing.
const LEAST_FAR: f64 = 1_000.0;
/// Positions that could be degrees have degrees if half of them are within this distance of the middle: 2.5 degrees are 280
/// km, and half of the lamps of a town are not within 2.5 m.
const LEAST_DISTANCE: f64 = 2.5;
/// The greatest longitude and latitude, degrees.
pub const MAX_DEGREES: DVec2 = dvec2(180.0, 90.0);

/// Where most positions are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// The medians of both coordinates.
    pub middle: DVec2,
    /// The median distance from the middle.
    pub distance: f64,
}

impl Spread {
    /// That of at least one position.
    pub fn of(positions: &[DVec2]) -> Self {
        let middle = dvec2(median(positions.iter().map(|at| at.x)), median(positions.iter().map(|at| at.y)));
        Self { middle, distance: median(positions.iter().map(|at| at.distance(middle))) }
    }

    /// Whether most positions are degrees of longitude and latitude.
    pub fn are_degrees(&self) -> bool {
        self.middle.abs().cmple(MAX_DEGREES).all() && self.distance < LEAST_DISTANCE
    }

    /// A warning if positions in metres are far from the others. `records` names them in their order.
    pub fn told(&self, name: &str, positions: &[DVec2], records: impl Fn(usize) -> String) -> Option<String> {
        let limit = (FAR * self.distance).max(LEAST_FAR);
        let mut far = Found::default();
        for (index, at) in positions.iter().enumerate().filter(|(_, at)| at.distance(self.middle) > limit) {
            far.add(format_args!("{}, at {:.0} {:.0}", records(index), at.x, at.y));
        }
        let kilometres = limit / 1000.0;
        far.told(name, &format!("are more than {kilometres:.0} km from the middle of all"))
    }
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    let half = values.len() / 2;
    *values.select_nth_unstable_by(half, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_far_from_most_others_are_named() {
        // A square of 21 x 21 lamps 10 m apart: half of them are within 80 m of the middle.
        let town: Vec<DVec2> =
            (0..441).map(|i| dvec2(5e5, 4e6) + 10.0 * dvec2(f64::from(i % 21), f64::from(i / 21))).collect();
        let told = |positions: &[DVec2]| Spread::of(positions).told("lamp", positions, |index| format!("line {index}"));
        assert_eq!(told(&town), None);
        let with = |more: &[DVec2]| told(&[&town[..], more].concat());
        assert_eq!(with(&[dvec2(5e5, 4e6 + 7_000.0)]), None);
        let expected = "2 lamp(s) are more than 8 km from the middle of all (the first is line 441, at 0 0)";
        assert_eq!(with(&[DVec2::ZERO, dvec2(5e5 + 9_000.0, 4e6)]).as_deref(), Some(expected));
        // Equal positions, and one across the road.
        assert_eq!(told(&[DVec2::ZERO, DVec2::ZERO, dvec2(0.0, 20.0)]), None);
    }
}
