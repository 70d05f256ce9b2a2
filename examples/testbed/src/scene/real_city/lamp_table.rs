//! Reads street lamps: a table in CSV, with commas, semicolons or tabs, or points in GeoJSON, whose properties are
//! the columns of the table.

use std::collections::BTreeSet;
use std::path::Path;

use girandole::glam::{DVec2, dvec2};
use serde_json::Value;

use super::SceneError;
use super::found::Found;
use super::lamp_columns::{COLUMNS, HEIGHT, LAT, LON, LUMENS, LampColumns, X, Y, keys, list};
use super::projection::{Utm, zone_for};
use super::spread::Spread;
use super::{geojson, source};

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

/// The lamps of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lamps {
    /// In the order of the file.
    pub all: Vec<LampRecord>,
    /// The middle of most of them, metres east and north; `None` without lamps.
    pub middle: Option<DVec2>,
    /// What the user should know about the file: one line each.
    pub warnings: Vec<String>,
}

/// Height and flux of lamps that state none, metres and lumens: the most frequent ones in Champaign, Illinois, where lamps
/// of 100 W with sodium are 9 m high.
const DEFAULT_HEIGHT: f64 = 9.0;
const DEFAULT_LUMENS: f64 = 9_500.0;

/// Reads all lamps. Degrees are projected as the network is, whose `projParameter` is `network`.
pub fn read(path: &Path, named: &LampColumns, network: Option<&str>) -> Result<Lamps, SceneError> {
    let text = source::read_text(path)?;
    let is_geojson = text.trim_start().starts_with('{');
    let read = if is_geojson { Table::of_geojson(&text, named) } else { Table::of_csv(&text, named) };
    let lamps = read.and_then(|table| table.lamps(network));
    lamps.map_err(|what| SceneError(format!("{}: {}", path.display(), what.replace('\n', " "))))
}

/// The records of a file. Errors are without its name.
struct Table {
    /// What a record is called: `line` or `feature`.
    record: &'static str,
    /// The names of the columns.
    names: [String; COLUMNS.len()],
    /// The columns of positions: those in metres or those in degrees.
    axes: [usize; 2],
    has_decimal_commas: bool,
    /// The number of each record.
    numbers: Vec<u64>,
    /// As the file has them.
    positions: Vec<DVec2>,
    /// Height and flux of each lamp.
    lights: Vec<[f32; 2]>,
    /// Lamps without a height, and without a flux.
    missing: [Found; 2],
    /// Features that are no points.
    others: Found,
}

impl Table {
    fn new(record: &'static str, named: &LampColumns) -> Self {
        let names = std::array::from_fn(|place| named.given(place).unwrap_or(COLUMNS[place].key).into());
        let are_named = named.given(LON).or(named.given(LAT)).is_some();
        Self {
            record,
            names,
            axes: if are_named { [LON, LAT] } else { [X, Y] },
            has_decimal_commas: false,
            numbers: Vec::new(),
            positions: Vec::new(),
            lights: Vec::new(),
            missing: Default::default(),
            others: Found::default(),
        }
    }

    fn of_csv(text: &str, named: &LampColumns) -> Result<Self, String> {
        let head = text.lines().find(|line| !line.trim().is_empty()).unwrap_or_default();
        // Of equals, the last one is chosen.
        let separators = [b'\t', b';', b','].into_iter();
        let separator = separators.max_by_key(|&separator| head.bytes().filter(|&byte| byte == separator).count());
        let separator = separator.unwrap_or(b',');
        // A row that is too short is reported below, with the column that it lacks.
        let mut builder = csv::ReaderBuilder::new();
        builder.flexible(true).trim(csv::Trim::All).delimiter(separator);
        let mut reader = builder.from_reader(text.as_bytes());
        let headers = reader.headers().map_err(|error| error.to_string())?.clone();
        let mut table = Self { has_decimal_commas: separator != b',', ..Self::new("line", named) };
        let mut places = [None; COLUMNS.len()];
        for (column, place) in places.iter_mut().enumerate() {
            *place = named.find(column, headers.iter());
            match *place {
                Some(place) => table.names[column] = headers[place].into(),
                None => named.check(column, headers.iter())?,
            }
        }
        let has = |axes: [usize; 2]| axes.iter().all(|axis| places[*axis].is_some());
        table.axes = match table.axes {
            [X, Y] if !has([X, Y]) && has([LON, LAT]) => [LON, LAT],
            axes => axes,
        };
        if !has(table.axes) {
            return Err(format!(
                "there are no columns x_m and y_m in metres or lon and lat in degrees among: {}; name them with \
                 --lamps-columns, of {}",
                list(headers.iter()),
                keys("=NAME")
            ));
        }
        for record in reader.records() {
            let record = record.map_err(|error| error.to_string())?;
            let line = record.position().map_or(0, |position| position.line());
            let lacking = (0..COLUMNS.len()).find(|&column| places[column].is_some_and(|place| place >= record.len()));
            if let Some(column) = lacking {
                return Err(format!("line {line}, column {:?}: the row is too short", table.names[column]));
            }
            table.take(line, places.map(|place| record.get(place?)))?;
        }
        Ok(table)
    }

    fn of_geojson(text: &str, named: &LampColumns) -> Result<Self, String> {
        let mut table = Self::new("feature", named);
        let (mut properties, mut is_found) = (BTreeSet::new(), [false; COLUMNS.len()]);
        geojson::read(text.as_bytes(), &mut |feature, number| {
            let geometry = &feature["geometry"];
            let points = match geometry["type"].as_str() {
                Some("Point") => std::slice::from_ref(&geometry["coordinates"]),
                Some("MultiPoint") => geometry["coordinates"].as_array().map_or(&[][..], Vec::as_slice),
                _ => &[],
            };
            if points.is_empty() {
                table.others.add(format_args!("feature {number}"));
            }
            let stated = feature["properties"].as_object();
            properties.extend(stated.iter().flat_map(|stated| stated.keys().cloned()));
            for point in points {
                let cells: [Option<String>; COLUMNS.len()] = std::array::from_fn(|column| {
                    let value = match (column, named.given(column)) {
                        (X | Y, None) => point.get(column)?,
                        _ => {
                            let stated = stated?;
                            stated.values().nth(named.find(column, stated.keys().map(String::as_str))?)?
                        }
                    };
                    is_found[column] = true;
                    match value {
                        Value::Null => None,
                        Value::String(text) => Some(text.trim().into()),
                        other => Some(other.to_string()),
                    }
                });
                for column in table.axes.into_iter().filter(|&column| cells[column].is_none()) {
                    named.check(column, properties.iter().map(String::as_str))?;
                }
                table.take(number as u64, cells.each_ref().map(Option::as_deref))?;
            }
            Ok(())
        })?;
        for column in (0..COLUMNS.len()).filter(|&column| !is_found[column] && !table.positions.is_empty()) {
            named.check(column, properties.iter().map(String::as_str))?;
        }
        Ok(table)
    }

    /// Takes a record, from the texts of its columns.
    fn take(&mut self, number: u64, cells: [Option<&str>; COLUMNS.len()]) -> Result<(), String> {
        let mut values = [None; COLUMNS.len()];
        for column in self.axes.into_iter().chain([HEIGHT, LUMENS]) {
            let text = cells[column].unwrap_or_default();
            if text.is_empty() && column >= HEIGHT {
                self.missing[column - HEIGHT].add(format_args!("{} {number}", self.record));
                continue;
            }
            let wrong = |what: String| format!("{} {number}, column {:?}: {what}", self.record, self.names[column]);
            let point =
                if self.has_decimal_commas && !text.contains('.') { text.replace(',', ".") } else { text.into() };
            let value = point.parse::<f64>().map_err(|_| wrong(format!("{text:?} is not a number")))?;
            let [min, max] = COLUMNS[column].range;
            if !(min..=max).contains(&value) {
                return Err(wrong(format!("{value} is not between {min} and {max}")));
            }
            values[column] = Some(value);
        }
        self.numbers.push(number);
        self.positions.push(dvec2(values[self.axes[0]].unwrap_or(0.0), values[self.axes[1]].unwrap_or(0.0)));
        let light = [values[HEIGHT].unwrap_or(DEFAULT_HEIGHT), values[LUMENS].unwrap_or(DEFAULT_LUMENS)];
        self.lights.push(light.map(|value| value as f32));
        Ok(())
    }

    /// The lamps in metres.
    fn lamps(mut self, network: Option<&str>) -> Result<Lamps, String> {
        if self.positions.is_empty() {
            return Err("it contains no lamps".into());
        }
        let name = |index: usize| format!("{} {}", self.record, self.numbers[index]);
        let mut spread = Spread::of(&self.positions);
        let is_table = self.record == "line";
        if is_table && self.axes == [X, Y] && self.positions.len() > 1 && spread.are_degrees() {
            return Err(format!(
                "the positions are degrees of longitude and latitude; name their columns with --lamps-columns \
                 lon={},lat={}, or project them to metres, for example to EPSG:{}",
                self.names[X],
                self.names[Y],
                Utm::at(spread.middle).epsg()
            ));
        }
        if self.axes == [LON, LAT] || !is_table && spread.are_degrees() {
            let zone = zone_for(spread.middle, network)?;
            for (index, at) in self.positions.iter_mut().enumerate() {
                *at = zone.project(*at).map_err(|what| format!("{}: {what}", name(index)))?;
            }
            spread = Spread::of(&self.positions);
        }
        let lights = self.positions.iter().zip(&self.lights);
        let all: Vec<LampRecord> =
            lights.map(|(at, &[height, lumens])| LampRecord { east: at.x, north: at.y, height, lumens }).collect();
        let missing = |column: usize, what: &str| {
            let found = &self.missing[column - HEIGHT];
            let key = COLUMNS[column].key;
            let hint = format!("; if there is a column for it, name it with --lamps-columns {key}=NAME");
            Some(found.told("lamp", what)? + if found.count() == all.len() { &hint } else { "" })
        };
        let told = [
            missing(HEIGHT, &format!("state no height, and are {DEFAULT_HEIGHT} m high")),
            missing(LUMENS, &format!("state no flux, and have {DEFAULT_LUMENS} lm")),
            self.others.told("feature", "are left out, since they are no points"),
            spread.told("lamp", &self.positions, name),
        ];
        let warnings = told.into_iter().flatten().collect();
        Ok(Lamps { all, middle: Some(spread.middle), warnings })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads a file with these bytes. `columns` are those of the option.
    fn read_bytes(name: &str, bytes: &[u8], columns: &str, network: Option<&str>) -> Result<Lamps, SceneError> {
        let path = std::env::temp_dir().join(format!("girandole_lamps_{}_{name}", std::process::id()));
        std::fs::write(&path, bytes).unwrap();
        let named = if columns.is_empty() { LampColumns::default() } else { columns.parse().unwrap() };
        let lamps = read(&path, &named, network);
        std::fs::remove_file(&path).unwrap();
        lamps
    }

    fn read_text(name: &str, text: &str) -> Result<Lamps, SceneError> {
        read_bytes(name, text.as_bytes(), "", None)
    }

    /// The message of an error, which must have one line.
    fn refused(name: &str, text: &str, columns: &str) -> String {
        let SceneError(message) = read_bytes(name, text.as_bytes(), columns, None).unwrap_err();
        assert!(!message.contains('\n'), "{message}");
        message
    }

    fn geojson(features: &[(&str, &str)]) -> String {
        let feature = |(geometry, properties): &(&str, &str)| {
            format!(r#"{{"type":"Feature","geometry":{geometry},"properties":{properties}}}"#)
        };
        let features: Vec<String> = features.iter().map(feature).collect();
        format!(r#" {{"type":"FeatureCollection","features":[{}]}}"#, features.join(","))
    }

    const LAMP: LampRecord = LampRecord { east: 1.5, north: -2.5, height: 8.0, lumens: 9000.0 };
    /// A position in degrees, and in UTM: an example of the manual of GeographicLib's GeoConvert.
    const DEGREES: &str = "44.4,33.3";
    const METRES: DVec2 = dvec2(444_140.54, 3_684_706.36);
    const NETWORK: Option<&str> = Some("+proj=utm +zone=38 +ellps=WGS84 +datum=WGS84 +units=m +no_defs");

    #[test]
    fn tables_may_have_other_orders_separators_cases_and_encodings() {
        let utf_16 = |text: &str, bytes: fn(u16) -> [u8; 2]| -> Vec<u8> {
            format!("\u{feff}{text}").encode_utf16().flat_map(bytes).collect()
        };
        let plain = "kind,est_lumens,y_m,x_m,est_height_m\nLED,9000,-2.5,1.5,8\n";
        let commas = "X;Y;Height;Lumens;Ort\n1,5;-2,5;8,0;9000;Br\u{fc}cke\n";
        for (name, bytes) in [
            ("plain", plain.into()),
            ("mark", format!("\u{feff}{plain}").into_bytes()),
            ("semicolons", commas.into()),
            ("tabs", commas.replace(';', "\t").into_bytes()),
            ("points", commas.replace("1,5", "1.5").into_bytes()),
            ("little", utf_16(commas, u16::to_le_bytes)),
            ("big", utf_16(commas, u16::to_be_bytes)),
            ("latin", commas.chars().map(|c| c as u8).collect()),
        ] {
            let lamps = read_bytes(name, &bytes, "", None).unwrap();
            assert_eq!(
                lamps,
                Lamps { all: vec![LAMP], middle: Some(dvec2(1.5, -2.5)), warnings: Vec::new() },
                "{name}"
            );
        }
        let named = "OST,NORD,x,H\u{d6}HE,est_lumens\n1.5,-2.5,7,8,9000\n";
        let columns = "x=ost,y=Nord,height=h\u{f6}he";
        assert_eq!(read_bytes("named", named.as_bytes(), columns, None).unwrap().all, [LAMP]);
    }

    #[test]
    fn errors_name_the_line_and_the_column() {
        let head = "x_m,y_m,est_height_m,est_lumens\n1,2,8,9000\n";
        for (name, row, expected) in [
            ("word", "1,two,8,9000", "line 3, column \"y_m\": \"two\" is not a number"),
            ("comma", "1,\"2,5\",8,9000", "line 3, column \"y_m\": \"2,5\" is not a number"),
            ("nan", "NaN,2,8,9000", "line 3, column \"x_m\": NaN is not between"),
            ("short", "1,2,8", "line 3, column \"est_lumens\": the row is too short"),
            ("low", "1,2,0,9000", "line 3, column \"est_height_m\": 0 is not between"),
            ("dark", "1,2,8,-1", "line 3, column \"est_lumens\": -1 is not between"),
            ("empty", "1,,8,9000", "line 3, column \"y_m\": \"\" is not a number"),
        ] {
            let message = refused(name, &format!("{head}{row}\n"), "");
            assert!(message.contains(expected), "{message}");
        }
        let message = refused("header", "x_m,h\n1,2\n", "");
        assert!(message.contains("no columns x_m and y_m") && message.contains("among: x_m, h;"), "{message}");
        let message = refused("lacks", head, "height=MAST");
        assert!(message.ends_with("no column \"MAST\" among: x_m, y_m, est_height_m, est_lumens"), "{message}");
        assert!(refused("none", "x_m,y_m,est_height_m,est_lumens\n", "").contains("no lamps"));
        assert!(read(Path::new("/nowhere/lamps.csv"), &LampColumns::default(), None).is_err());
        for columns in ["", "x", "x=", "z=a", "x=a,x=b"] {
            assert!(columns.parse::<LampColumns>().unwrap_err().contains("lumens=NAME"), "{columns}");
        }
    }

    #[test]
    fn lamps_without_height_or_flux_get_the_usual_ones_with_a_warning() {
        let read = read_text("missing", "x_m,y_m,height\n1,2,\n1,90,7\n").unwrap();
        let lights: Vec<_> = read.all.iter().map(|lamp| (lamp.height, lamp.lumens)).collect();
        assert_eq!(lights, [(9.0, 9_500.0), (7.0, 9_500.0)]);
        let lumens = "2 lamp(s) state no flux, and have 9500 lm (the first is line 2); if there is a column for it, name \
                      it with --lamps-columns lumens=NAME";
        assert_eq!(read.warnings, ["1 lamp(s) state no height, and are 9 m high (the first is line 2)", lumens]);
    }

    #[test]
    fn points_of_geojson_are_lamps_and_their_properties_are_columns() {
        let metres = geojson(&[
            (r#"{"type":"Point","coordinates":[1.5,-2.5]}"#, r#"{"Height":8,"LUMENS":" 9000 ","x":3}"#),
            ("null", "null"),
            (r#"{"type":"MultiPoint","coordinates":[[500,7,1],[900,7]]}"#, r#"{"height":null,"lumens":1}"#),
        ]);
        let read = read_text("metres", &metres).unwrap();
        let places: Vec<_> = read.all.iter().map(|lamp| (lamp.east, lamp.height)).collect();
        assert_eq!((read.all[0], &places[1..]), (LAMP, &[(500.0, 9.0), (900.0, 9.0)][..]));
        let expected = [
            "2 lamp(s) state no height, and are 9 m high (the first is feature 2)",
            "1 feature(s) are left out, since they are no points (the first is feature 1)",
        ];
        assert_eq!(read.warnings, expected);
        let message = refused("property", &metres, "height=MAST");
        assert!(message.contains("\"MAST\" among: Height, LUMENS, height, lumens, x"), "{message}");
        assert!(refused("lon", &metres, "lon=LON,lat=LAT").contains("\"LON\" among: Height, LUMENS, x"));
        let message = refused("text", &metres.replace("[900,7]", "[900,\"n\"]"), "");
        assert!(message.contains("feature 2, column \"y\": \"n\" is not a number at line 1"), "{message}");
    }

    #[test]
    fn degrees_are_projected_as_the_network_is() {
        let table = format!("longitude,LAT,height,lumens\n{DEGREES},8,9000\n{DEGREES},8,9000\n");
        let point = format!(r#"{{"type":"Point","coordinates":[{DEGREES}]}}"#);
        let points = geojson(&[(&point, r#"{"height":8,"lumens":9000}"#)]);
        let named = table.replace("longitude,LAT", "x,y");
        for (name, text, columns) in [("table", &table, ""), ("points", &points, ""), ("xy", &named, "lon=x,lat=y")] {
            let read = read_bytes(name, text.as_bytes(), columns, NETWORK).unwrap();
            assert!(dvec2(read.all[0].east, read.all[0].north).distance(METRES) < 0.01, "{read:?}");
            assert!(read.warnings.is_empty(), "{read:?}");
            let message = refused(name, text, columns);
            assert!(message.contains("--net") && message.contains("EPSG:32638"), "{message}");
        }
        let message = refused("degrees", &named, "");
        assert!(message.contains("--lamps-columns lon=x,lat=y") && message.contains("EPSG:32638"), "{message}");
        let far = format!("{table}-88,40,8,9000\n");
        let SceneError(message) = read_bytes("far", far.as_bytes(), "", NETWORK).unwrap_err();
        assert!(message.contains("line 4: [-88, 40] is too far"), "{message}");
        assert!(refused("range", &format!("{table}200,33,8,9000\n"), "").contains("200 is not between -180 and 180"));
        let near = "x_m,y_m,est_height_m,est_lumens\n1,2,8,9000\n1,8,8,9000\n";
        assert_eq!(read_text("near", near).unwrap().all.len(), 2);
    }

    #[test]
    fn the_sample_file_is_read() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/lamps_small.csv");
        let lamps = read(Path::new(path), &LampColumns::default(), None).unwrap();
        assert_eq!((lamps.all.len(), lamps.warnings.len()), (24, 0));
    }
}
