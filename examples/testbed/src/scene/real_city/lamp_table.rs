//! Reads street lamps from a CSV file with the columns `x_m` and `y_m` (metres east and north),
//! `est_height_m` and `est_lumens`. Their order does not matter, and other columns are ignored.

use std::path::Path;

use girandole::glam::{DVec2, dvec2};

use super::SceneError;
use super::footprints::utm_zone;
use super::source;

/// A lamp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LampRecord {
    /// Metres east.
    pub east: f64,
    /// Metres north.
    pub north: f64,
    /// Height of the light above the ground, metres.
    pub height: f32,
    /// Luminous flux, lumens.
    pub lumens: f32,
}

/// Name, smallest and largest allowed value of each column.
const COLUMNS: [(&str, f64, f64); 4] = [
    ("x_m", -2e7, 2e7),
    ("y_m", -2e7, 2e7),
    // The highest masts are below 100 m, and the strongest floodlights below 10 million lumens.
    ("est_height_m", 0.5, 200.0),
    ("est_lumens", 0.0, 1e8),
];

/// Lamps whose positions could be degrees have degrees if they are all within this: five degrees are 500 km, and
/// lamps within five metres no town.
const LEAST_EXTENT: f64 = 5.0;

/// Reads all lamps.
pub fn read(path: &Path) -> Result<Vec<LampRecord>, SceneError> {
    let fail = |what: String| SceneError(format!("{}: {what}", path.display()));
    // A row that is too short is reported below, with the column that it lacks.
    let mut builder = csv::ReaderBuilder::new();
    let mut reader = builder.flexible(true).trim(csv::Trim::All).from_reader(source::open(path)?);
    let headers = reader.headers().map_err(|error| fail(one_line(error)))?.clone();
    let mut places = [0; COLUMNS.len()];
    for (place, (name, ..)) in places.iter_mut().zip(COLUMNS) {
        let found = headers.iter().position(|header| header == name);
        let name_of = |header: &str| header.chars().filter(|c| !c.is_control()).take(30).collect::<String>();
        let all = || headers.iter().take(20).map(name_of).collect::<Vec<_>>().join(", ");
        *place = found.ok_or_else(|| fail(format!("line 1: there is no column \"{name}\" among: {}", all())))?;
    }
    let mut lamps = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|error| fail(one_line(error)))?;
        let line = record.position().map_or(0, |position| position.line());
        let mut values = [0.0; COLUMNS.len()];
        for ((value, place), (name, min, max)) in values.iter_mut().zip(places).zip(COLUMNS) {
            let wrong = |what: String| fail(format!("line {line}, column \"{name}\": {what}"));
            let text = record.get(place).ok_or_else(|| wrong("the row is too short".into()))?;
            *value = text.parse::<f64>().map_err(|_| wrong(format!("{text:?} is not a number")))?;
            if !(min..=max).contains(value) {
                return Err(wrong(format!("{value} is not between {min} and {max}")));
            }
        }
        let [east, north, height, lumens] = values;
        lamps.push(LampRecord { east, north, height: height as f32, lumens: lumens as f32 });
    }
    if lamps.is_empty() {
        return Err(fail("it contains no lamps".into()));
    }
    let positions = lamps.iter().map(LampRecord::position);
    let [low, high] = positions.fold([lamps[0].position(); 2], |[low, high], at| [low.min(at), high.max(at)]);
    let limit = dvec2(180.0, 90.0);
    let are_degrees = low.cmpge(-limit).all() && high.cmple(limit).all() && (high - low).max_element() < LEAST_EXTENT;
    if lamps.len() > 1 && are_degrees {
        let epsg = utm_zone(low);
        return Err(fail(format!(
            "the positions are degrees of longitude and latitude; project them to metres, for example to EPSG:{epsg}"
        )));
    }
    Ok(lamps)
}

impl LampRecord {
    fn position(&self) -> DVec2 {
        dvec2(self.east, self.north)
    }
}

/// The message of an error on one line.
fn one_line(error: csv::Error) -> String {
    error.to_string().replace('\n', " ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(name: &str, text: &str) -> Result<Vec<LampRecord>, SceneError> {
        let path = std::env::temp_dir().join(format!("girandole_lamps_{}_{name}.csv", std::process::id()));
        std::fs::write(&path, text).unwrap();
        let lamps = read(&path);
        std::fs::remove_file(&path).unwrap();
        lamps
    }

    #[test]
    fn columns_may_have_any_order_and_others_are_ignored() {
        let text = "kind,est_lumens,y_m,x_m,est_height_m\nLED,9000,-2.5,1.5,8\n";
        let lamps = read_text("order", text).unwrap();
        assert_eq!(lamps, [LampRecord { east: 1.5, north: -2.5, height: 8.0, lumens: 9000.0 }]);
    }

    #[test]
    fn errors_name_the_line_and_the_column() {
        let head = "x_m,y_m,est_height_m,est_lumens\n1,2,8,9000\n";
        for (name, row, expected) in [
            ("word", "1,two,8,9000", "line 3, column \"y_m\": \"two\" is not a number"),
            ("nan", "NaN,2,8,9000", "line 3, column \"x_m\": NaN is not between"),
            ("short", "1,2,8", "line 3, column \"est_lumens\": the row is too short"),
            ("low", "1,2,0,9000", "line 3, column \"est_height_m\": 0 is not between"),
            ("dark", "1,2,8,-1", "line 3, column \"est_lumens\": -1 is not between"),
            ("empty", "1,,8,9000", "line 3, column \"y_m\": \"\" is not a number"),
        ] {
            let SceneError(message) = read_text(name, &format!("{head}{row}\n")).unwrap_err();
            assert!(message.contains(expected), "{message}");
            assert!(!message.contains('\n'));
        }
        let SceneError(message) = read_text("header", "x_m,y_m,est_lumens\n1,2,3\n").unwrap_err();
        assert!(message.contains("no column \"est_height_m\""), "{message}");
        assert!(read_text("none", "x_m,y_m,est_height_m,est_lumens\n").is_err());
        assert!(read(Path::new("/nowhere/lamps.csv")).is_err());
    }

    #[test]
    fn degrees_are_refused_and_a_byte_order_mark_is_skipped() {
        let head = "x_m,y_m,est_height_m,est_lumens\n";
        let SceneError(message) =
            read_text("degrees", &format!("{head}12.37,45.45,8,9000\n12.39,45.47,8,9000\n")).unwrap_err();
        assert!(message.contains("degrees") && message.contains("EPSG:32633"), "{message}");
        let near = format!("\u{feff}{head}1,2,8,9000\n1,8,8,9000\n");
        assert_eq!(read_text("near", &near).unwrap().len(), 2);
    }

    #[test]
    fn the_sample_file_is_read() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/lamps_small.csv");
        assert_eq!(read(Path::new(path)).unwrap().len(), 24);
    }
}
