//! The columns of a table of lamps: what they tell, and their names.

use std::str::FromStr;

use super::spread::MAX_DEGREES;

/// What a column tells of lamps.
pub struct Column {
    /// Its key in the option that names columns.
    pub key: &'static str,
    /// Its names by default, in any case. The first one that the file has counts.
    names: &'static [&'static str],
    /// The smallest and the largest allowed value.
    pub range: [f64; 2],
}

/// Positions have metres in the first two columns or degrees in the next two.
pub const COLUMNS: [Column; 6] = [
    Column { key: "x", names: &["x_m", "x", "east", "easting"], range: [-2e7, 2e7] },
    Column { key: "y", names: &["y_m", "y", "north", "northing"], range: [-2e7, 2e7] },
    Column { key: "lon", names: &["lon", "lng", "long", "longitude"], range: [-MAX_DEGREES.x, MAX_DEGREES.x] },
    Column { key: "lat", names: &["lat", "latitude"], range: [-MAX_DEGREES.y, MAX_DEGREES.y] },
    // The highest masts are below 100 m, and the strongest floodlights below 10 million lumens.
    Column { key: "height", names: &["est_height_m", "height_m", "height"], range: [0.5, 200.0] },
    Column { key: "lumens", names: &["est_lumens", "lumens"], range: [0.0, 1e8] },
];
pub const X: usize = 0;
pub const Y: usize = 1;
pub const LON: usize = 2;
pub const LAT: usize = 3;
pub const HEIGHT: usize = 4;
pub const LUMENS: usize = 5;

/// The names of columns that the user has given.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LampColumns([Option<String>; COLUMNS.len()]);

impl FromStr for LampColumns {
    type Err = String;

    /// Such as `x=EAST,y=NORTH,height=MAST`.
    fn from_str(text: &str) -> Result<Self, String> {
        let mut columns = Self::default();
        for part in text.split(',') {
            let given = part.split_once('=').map(|(key, name)| (key.trim(), name.trim()));
            let place = given.and_then(|(key, _)| COLUMNS.iter().position(|column| column.key == key));
            match (given, place) {
                (Some((_, name)), Some(place)) if !name.is_empty() && columns.0[place].is_none() => {
                    columns.0[place] = Some(name.into());
                }
                _ => return Err(format!("{part:?} is not one of {}, each once", keys("=NAME"))),
            }
        }
        Ok(columns)
    }
}

impl LampColumns {
    /// The name that the user has given.
    pub fn given(&self, column: usize) -> Option<&str> {
        self.0[column].as_deref()
    }

    /// The place of a column among all columns of a file, in any case of letters. Where the user has named it, only
    /// that name counts.
    pub fn find<'h>(&self, column: usize, headers: impl Iterator<Item = &'h str> + Clone) -> Option<usize> {
        let given = self.given(column);
        let names = given.iter().chain(COLUMNS[column].names.iter().filter(|_| given.is_none()));
        let mut names = names.map(|name| name.to_lowercase());
        names.find_map(|name| headers.clone().position(|header| header.to_lowercase() == name))
    }

    /// An error if the user has named a column, which the file lacks.
    pub fn check<'h>(&self, column: usize, headers: impl Iterator<Item = &'h str>) -> Result<(), String> {
        let Some(name) = self.given(column) else { return Ok(()) };
        Err(format!("there is no column {name:?} among: {}", list(headers)))
    }
}

/// All keys, with the same text behind each.
pub fn keys(after: &str) -> String {
    COLUMNS.map(|column| format!("{}{after}", column.key)).join(", ")
}

/// The first names of columns, as a list.
pub fn list<'h>(headers: impl Iterator<Item = &'h str>) -> String {
    let name = |header: &str| header.chars().filter(|c| !c.is_control()).take(30).collect::<String>();
    headers.take(20).map(name).collect::<Vec<_>>().join(", ")
}
