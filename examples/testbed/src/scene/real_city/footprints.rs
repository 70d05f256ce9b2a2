//! Reads the footprints and heights of buildings from GeoJSON.
//!
//! Heights follow from the properties by which OpenStreetMap describes buildings: `height` in metres or
//! feet, else `building:levels` or `levels`; `min_height` is the height of the lower side.

use std::collections::BTreeSet;
use std::path::Path;

use earcut::{Earcut, deviation};
use girandole::glam::{DVec2, dvec2};
use serde_json::Value;

use super::SceneError;
use super::found::Found;
use super::geojson;
use super::projection::zone_for;
use super::source::{self, Source};
use super::spread::{MAX_DEGREES, Spread};

/// The most footprints of a file, and the most corners of all of them.
const MAX_FOOTPRINTS: usize = 1_000_000;
const MAX_CORNERS: usize = 20_000_000;
/// The greatest coordinate, metres. That of lamps is the same.
const MAX_COORDINATE: f64 = 2e7;
/// The greatest height, metres, and the most levels.
const MAX_HEIGHT: f64 = 2_000.0;
const MAX_LEVELS: f64 = 500.0;
/// The height of a level, metres.
const LEVEL: f64 = 3.2;
/// The height of a building that states none, metres: two levels.
const DEFAULT_HEIGHT: f64 = 2.0 * LEVEL;
/// A footprint whose coordinates could be degrees has degrees if it is not larger than this: a tenth of a
/// degree is 11 km, and a tenth of a metre is no building.
const LEAST_EXTENT: f64 = 0.1;
/// Metres of a foot.
const FOOT: f64 = 0.3048;
/// The triangles of a footprint may differ from its area by this share, by rounding. They differ by more
/// if its rings cross themselves or each other.
const MAX_DEVIATION: f64 = 1e-4;

/// A building or a part of one.
#[derive(Clone, Debug, PartialEq)]
pub struct Footprint {
    /// The outer ring, counter-clockwise seen from above, then the holes, clockwise. Metres east and
    /// north. The last corner of a ring differs from the first.
    pub rings: Vec<Vec<DVec2>>,
    /// Triangles, counter-clockwise seen from above, as indices into the corners of all rings.
    pub triangles: Vec<u32>,
    /// Heights of the lower side and of the roof, metres.
    pub heights: [f32; 2],
    /// The number of its feature in the file.
    pub feature: usize,
}

impl Footprint {
    fn name(&self) -> String {
        format!("feature {}", self.feature)
    }

    /// Whether its outer ring could be degrees of longitude and latitude, and is too small for metres.
    fn is_in_degrees(&self) -> bool {
        let ring = &self.rings[0];
        let [low, high] = ring.iter().fold([ring[0]; 2], |[low, high], at| [low.min(*at), high.max(*at)]);
        low.abs().max(high.abs()).cmple(MAX_DEGREES).all() && (high - low).max_element() < LEAST_EXTENT
    }
}

/// The content of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Footprints {
    /// In the order of the file.
    pub all: Vec<Footprint>,
    /// A warning about footprints far from the others.
    far: Option<String>,
    /// Footprints without an area or a height, and those whose rings touch or cross themselves.
    skipped: Found,
    /// Footprints that state an impossible height, such as a negative one.
    impossible: Found,
    /// Buildings that state a height that is no length.
    unread_heights: Found,
    /// Buildings that state no height.
    without_height: Found,
    /// Footprints in degrees among others in metres.
    in_degrees: Found,
    corners: usize,
}

impl Footprints {
    /// Reads a file.
    pub fn read(path: &Path, network: Option<&str>) -> Result<Self, SceneError> {
        Self::parse(source::open(path)?, &path.display().to_string(), network)
    }

    /// Reads from any source. Errors begin with `name`. Degrees are projected as the network is, whose
    /// `projParameter` is `network`.
    pub fn parse(source: Source, name: &str, network: Option<&str>) -> Result<Self, SceneError> {
        let fail = |what: String| SceneError(format!("{name}: {}", what.replace('\n', " ")));
        let mut footprints = Self::default();
        geojson::read(source, &mut |feature, number| footprints.take(feature, number)).map_err(fail)?;
        if footprints.all.is_empty() && footprints.skipped.count() + footprints.impossible.count() == 0 {
            return Err(fail("there is no Polygon or MultiPolygon".into()));
        }
        let all = &mut footprints.all;
        match all.first().map(|footprint| footprint.rings[0][0]) {
            Some(first) if all.iter().all(Footprint::is_in_degrees) => {
                let zone = zone_for(first, network).map_err(fail)?;
                for Footprint { rings, feature, .. } in all {
                    for at in rings.iter_mut().flatten() {
                        *at = zone.project(*at).map_err(|what| fail(format!("feature {feature}: {what}")))?;
                    }
                }
            }
            _ => {
                let in_degrees = all.extract_if(.., |footprint| footprint.is_in_degrees());
                in_degrees.for_each(|footprint| footprints.in_degrees.add(footprint.name()));
            }
        }
        let corners: Vec<DVec2> = footprints.all.iter().map(|footprint| footprint.rings[0][0]).collect();
        let name = |index: usize| footprints.all[index].name();
        footprints.far = (!corners.is_empty()).then(|| Spread::of(&corners).told("building", &corners, name)).flatten();
        Ok(footprints)
    }

    /// What the user should know about the file: one line each.
    pub fn warnings(&self) -> Vec<String> {
        let missing = format!("state no height or levels, and are {DEFAULT_HEIGHT} m high");
        let told = [
            self.skipped.told("building", "are left out, since their rings touch or cross, or have no area or height"),
            self.impossible.told("building", "are left out, since their heights or levels are negative or too large"),
            self.in_degrees.told("building", "are left out, since their positions are degrees among metres"),
            self.unread_heights.told("building", "state heights that are no lengths, which are not used"),
            self.without_height.told("building", &missing),
        ];
        told.into_iter().flatten().chain(self.far.clone()).collect()
    }

    /// Takes the polygons of a feature.
    fn take(&mut self, feature: &Value, number: usize) -> Result<(), String> {
        let fail = |what: String| format!("feature {number}: {what}");
        if feature.get("type").and_then(Value::as_str) != Some("Feature") {
            return Err(fail("\"type\" is not \"Feature\"".into()));
        }
        let geometry = &feature["geometry"];
        let one = std::slice::from_ref(&geometry["coordinates"]);
        let polygons = match geometry["type"].as_str() {
            Some("Polygon") => one,
            Some("MultiPolygon") => list(&geometry["coordinates"]).map_err(fail)?,
            // Points and lines, and features without a geometry.
            _ => return Ok(()),
        };
        let Stated { heights, is_read, is_missing, is_possible } = Stated::by(&feature["properties"]);
        if !is_possible {
            self.impossible.add(format_args!("feature {number}"));
            return Ok(());
        }
        if !is_read {
            self.unread_heights.add(format_args!("feature {number}"));
        } else if is_missing {
            self.without_height.add(format_args!("feature {number}"));
        }
        for polygon in polygons {
            let rings: Vec<Vec<DVec2>> =
                list(polygon).and_then(|rings| rings.iter().map(ring).collect()).map_err(fail)?;
            self.corners += rings.iter().map(Vec::len).sum::<usize>();
            if self.all.len() == MAX_FOOTPRINTS || self.corners > MAX_CORNERS {
                return Err(fail(format!("the limit is {MAX_FOOTPRINTS} footprints with {MAX_CORNERS} corners")));
            }
            match footprint(rings, heights) {
                Some(footprint) => self.all.push(Footprint { feature: number, ..footprint }),
                None => self.skipped.add(format_args!("feature {number}")),
            }
        }
        Ok(())
    }
}

/// What the properties of a feature tell of its heights.
struct Stated {
    /// The lower and the upper one, in metres.
    heights: [f32; 2],
    /// All of what is stated could be read.
    is_read: bool,
    /// Neither a height nor levels are stated.
    is_missing: bool,
    /// No number is negative or too large.
    is_possible: bool,
}

impl Stated {
    fn by(properties: &Value) -> Self {
        let (mut is_read, mut is_possible) = (true, true);
        let mut number = |name: &str, max: f64| {
            let value = &properties[name];
            let number = value.as_f64().or_else(|| metres(value.as_str()?));
            is_read &= value.is_null() || number.is_some();
            is_possible &= number.is_none_or(|number| (0.0..=max).contains(&number));
            number
        };
        let [height, low] = [number("height", MAX_HEIGHT), number("min_height", MAX_HEIGHT)];
        let [levels, others] = [number("building:levels", MAX_LEVELS), number("levels", MAX_LEVELS)];
        let stated = height.or(levels.or(others).map(|levels| levels * LEVEL));
        let heights = [low.unwrap_or(0.0) as f32, stated.unwrap_or(DEFAULT_HEIGHT) as f32];
        Self { heights, is_read, is_missing: stated.is_none(), is_possible }
    }
}

/// A length as OpenStreetMap writes it: in metres, as `12.5` or `12.5 m`, or in feet and inches, as `39 ft`,
/// `39'` or `39'6"`.
fn metres(text: &str) -> Option<f64> {
    let number = |text: &str| text.trim().parse::<f64>().ok();
    let text = text.trim();
    if let Some((feet, inches)) = text.split_once('\'') {
        let inches = inches.trim().trim_end_matches('"');
        let inches = if inches.is_empty() { 0.0 } else { number(inches)? };
        return Some((number(feet)? + inches / 12.0) * FOOT);
    }
    match text.strip_suffix("ft") {
        Some(feet) => Some(number(feet)? * FOOT),
        None => number(text.strip_suffix('m').unwrap_or(text)),
    }
}

fn list(value: &Value) -> Result<&[Value], String> {
    value.as_array().map(Vec::as_slice).ok_or_else(|| "\"coordinates\" have the wrong depth".into())
}

/// The corners of a ring, of which the last differs from the first.
fn ring(value: &Value) -> Result<Vec<DVec2>, String> {
    let mut corners = Vec::new();
    for position in list(value)? {
        let axis = |axis: usize| position.get(axis).and_then(Value::as_f64).filter(|at| at.abs() <= MAX_COORDINATE);
        let (Some(east), Some(north)) = (axis(0), axis(1)) else {
            return Err(format!("{position} is not a position of two numbers of at most {MAX_COORDINATE}"));
        };
        corners.push(dvec2(east, north));
    }
    // A ring that is not closed is closed here.
    while corners.len() > 1 && corners.first() == corners.last() {
        corners.pop();
    }
    if corners.len() < 3 {
        return Err(format!("a ring has {} corner(s), and needs three", corners.len()));
    }
    Ok(corners)
}

/// A footprint whose rings run as they should; `None` if it has no area or height, or if a ring touches
/// or crosses itself or another one.
fn footprint(mut rings: Vec<Vec<DVec2>>, heights: [f32; 2]) -> Option<Footprint> {
    let origin = *rings.first()?.first()?;
    for (index, ring) in rings.iter_mut().enumerate() {
        ring.dedup();
        let corners: BTreeSet<[u64; 2]> = ring.iter().map(|at| at.to_array().map(f64::to_bits)).collect();
        let area = area(ring, origin);
        if corners.len() < ring.len() || ring.len() < 3 || area == 0.0 {
            return None;
        }
        if (area > 0.0) != (index == 0) {
            ring.reverse();
        }
    }
    // Corners relative to the first one, since rounding grows with the distance from (0, 0).
    let corners: Vec<[f64; 2]> = rings.iter().flatten().map(|at| (*at - origin).to_array()).collect();
    let mut holes: Vec<u32> = Vec::new();
    for ring in &rings[..rings.len() - 1] {
        holes.push(holes.last().unwrap_or(&0) + ring.len() as u32);
    }
    let mut triangles: Vec<u32> = Vec::new();
    Earcut::new().earcut(corners.iter().copied(), &holes, &mut triangles);
    let is_whole = deviation(corners.iter().copied(), &holes, &triangles) < MAX_DEVIATION;
    if triangles.is_empty() || !is_whole || heights[0] >= heights[1] {
        return None;
    }
    for triangle in triangles.chunks_exact_mut(3) {
        let [a, b, c] = [0, 1, 2].map(|corner: usize| DVec2::from(corners[triangle[corner] as usize]));
        if (b - a).perp_dot(c - a) < 0.0 {
            triangle.swap(1, 2);
        }
    }
    Some(Footprint { rings, triangles, heights, feature: 0 })
}

/// The area of a ring, which is negative if it runs clockwise.
fn area(ring: &[DVec2], origin: DVec2) -> f64 {
    let next = ring.iter().cycle().skip(1);
    0.5 * ring.iter().zip(next).map(|(a, b)| (*a - origin).perp_dot(*b - origin)).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file of features with these geometries and properties.
    fn file(features: &[(&str, &str, &str)]) -> String {
        let features: Vec<String> = features
            .iter()
            .map(|(kind, coordinates, properties)| {
                format!(
                    r#"{{"type":"Feature","properties":{properties},"geometry":{{"type":"{kind}","coordinates":{coordinates}}}}}"#
                )
            })
            .collect();
        format!(r#"{{"features":[{}],"name":"a","type":"FeatureCollection"}}"#, features.join(","))
    }

    fn parse(text: &str) -> Result<Footprints, SceneError> {
        Footprints::parse(Box::new(std::io::Cursor::new(text.to_owned())), "test.geojson", None)
    }

    fn roof(footprint: &Footprint) -> f64 {
        let corners: Vec<DVec2> = footprint.rings.iter().flatten().copied().collect();
        let triangle = |index: &[u32]| {
            let [a, b, c] = [0, 1, 2].map(|corner: usize| corners[index[corner] as usize]);
            0.5 * (b - a).perp_dot(c - a)
        };
        footprint.triangles.chunks_exact(3).map(triangle).inspect(|area| assert!(*area > 0.0)).sum()
    }

    const HIGH: &str = r#"{"height":9}"#;
    const SQUARE: &str = "[[[0,0],[20,0],[20,10],[0,10],[0,0]]]";

    #[test]
    fn rings_are_turned_and_holes_are_cut_out() {
        let holed = "[[[500000,4400000],[500000,4400020],[500030,4400020],[500030,4400000],[500000,4400000]],\
                     [[500010,4400005],[500020,4400005],[500020,4400015],[500010,4400015],[500010,4400005]]]";
        let both = format!("[{SQUARE},{holed}]");
        let read = parse(&file(&[("Polygon", SQUARE, HIGH), ("MultiPolygon", &both, HIGH), ("Point", "[1,2]", HIGH)]));
        let read = read.unwrap();
        assert_eq!(read.all.iter().map(|footprint| roof(footprint).round()).collect::<Vec<_>>(), [200.0, 200.0, 500.0]);
        let far = "1 building(s) are more than 1 km from the middle of all (the first is feature 1, at 500030 4400000)";
        assert_eq!(read.warnings(), [far]);
        let rings = &read.all[2].rings;
        let origin = rings[0][0];
        assert_eq!([area(&rings[0], origin), area(&rings[1], origin)], [600.0, -100.0]);
    }

    #[test]
    fn a_ring_may_be_closed_more_than_once_or_not_at_all() {
        for coordinates in ["[[[0,0],[20,0],[20,10],[0,10],[0,0],[0,0]]]", "[[[0,0],[20,0],[20,10],[0,10]]]"] {
            let read = parse(&file(&[("Polygon", coordinates, HIGH)])).unwrap();
            assert!(read.warnings().is_empty(), "{coordinates}: {:?}", read.warnings());
            assert_eq!((read.all.len(), roof(&read.all[0]).round()), (1, 200.0));
        }
    }

    #[test]
    fn heights_follow_from_the_properties() {
        for (properties, expected) in [
            ("{}", [0.0, 6.4]),
            (r#"{"height":12.5}"#, [0.0, 12.5]),
            (r#"{"height":"12 m","levels":9}"#, [0.0, 12.0]),
            (r#"{"height":"9.5m","min_height":"3"}"#, [3.0, 9.5]),
            (r#"{"building:levels":"5"}"#, [0.0, 16.0]),
            (r#"{"height":null,"levels":2.5}"#, [0.0, 8.0]),
            (r#"{"height":"39 ft"}"#, [0.0, 11.8872]),
            (r#"{"height":"39'"}"#, [0.0, 11.8872]),
            (r#"{"height":"39' 6\""}"#, [0.0, 12.0396]),
        ] {
            let read = parse(&file(&[("Polygon", SQUARE, HIGH), ("Polygon", SQUARE, properties)])).unwrap();
            match read.all.get(1) {
                Some(footprint) => assert_eq!(footprint.heights, expected, "{properties}"),
                None => assert_eq!(expected, [0.0, 0.0]),
            }
        }
        let read = parse(&file(&[("Polygon", SQUARE, "{}"), ("Polygon", SQUARE, "{}")])).unwrap();
        let expected = "2 building(s) state no height or levels, and are 6.4 m high (the first is feature 0)";
        assert_eq!(read.warnings(), [expected]);
        let read = parse(&file(&[("Polygon", SQUARE, r#"{"height":"tall","levels":3}"#)])).unwrap();
        assert!((read.all[0].heights[1] - 9.6).abs() < 1e-5);
        assert!(
            read.warnings()[0].starts_with("1 building(s) state heights that are no lengths"),
            "{:?}",
            read.warnings()
        );
    }

    #[test]
    fn rings_that_are_not_closed_are_closed() {
        let open = "[[[0,0],[20,0],[20,10],[0,10]]]";
        let [open, closed] = [open, SQUARE].map(|ring| parse(&file(&[("Polygon", ring, "{}")])).unwrap());
        assert_eq!(open, closed);
    }

    #[test]
    fn degenerate_footprints_are_left_out_with_one_warning() {
        let read = parse(&file(&[
            ("Polygon", SQUARE, HIGH),
            // Crosses itself.
            ("Polygon", "[[[0,0],[20,10],[20,0],[0,10],[0,0]]]", HIGH),
            // Touches itself in (10, 5).
            ("Polygon", "[[[0,0],[10,5],[20,0],[20,10],[10,5],[0,10],[0,0]]]", HIGH),
            // Has no area.
            ("Polygon", "[[[0,0],[10,0],[20,0],[0,0]]]", HIGH),
            // Its hole crosses the outer ring.
            ("Polygon", "[[[0,0],[20,0],[20,10],[0,10],[0,0]],[[5,5],[25,5],[25,8],[5,8],[5,5]]]", HIGH),
            // Its roof is below its lower side.
            ("Polygon", SQUARE, r#"{"height":3,"min_height":5}"#),
        ]));
        let read = read.unwrap();
        assert_eq!(read.all.len(), 1);
        assert!(read.warnings().len() == 1 && read.warnings()[0].starts_with("5 building(s)"), "{:?}", read.warnings());
    }

    #[test]
    fn degrees_are_refused_with_the_zone_to_project_to() {
        let town = "[[[-88.24,40.11],[-88.2398,40.11],[-88.2398,40.1102],[-88.24,40.1102],[-88.24,40.11]]]";
        let south = "[[[151.2,-33.87],[151.2003,-33.87],[151.2003,-33.8698],[151.2,-33.87]]]";
        for (ring, zone) in [(town, "EPSG:32616"), (south, "EPSG:32756")] {
            let SceneError(message) = parse(&file(&[("Polygon", ring, "{}")])).unwrap_err();
            assert!(message.contains("degrees") && message.contains(zone) && !message.contains('\n'), "{message}");
        }
        // Metres near the origin.
        assert!(parse(&file(&[("Polygon", SQUARE, "{}")])).is_ok());
    }

    #[test]
    fn degrees_are_projected_as_the_network_is() {
        let ring = "[[[44.4,33.3],[44.401,33.3],[44.401,33.301],[44.4,33.301],[44.4,33.3]]]";
        let source: Source = Box::new(std::io::Cursor::new(file(&[("Polygon", ring, HIGH)])));
        let read = Footprints::parse(source, "test.geojson", Some("+proj=utm +zone=38")).unwrap();
        // The corner is an example of the manual of GeographicLib's GeoConvert. At this latitude, WGS 84 has 93,135 m
        // for a degree of longitude and 110,910 m for one of latitude, and the scale here is 0.9996.
        assert!(read.all[0].rings[0][0].distance(dvec2(444_140.54, 3_684_706.36)) < 0.01);
        assert!((roof(&read.all[0]) / (93.135 * 110.91 * 0.9996_f64.powi(2)) - 1.0).abs() < 2e-4);
    }

    #[test]
    fn buildings_with_impossible_heights_or_in_degrees_among_metres_are_left_out_with_one_warning() {
        let good = ("Polygon", SQUARE, HIGH);
        for properties in [r#"{"height":-3}"#, r#"{"height":"-3 m"}"#, r#"{"levels":1e6}"#, r#"{"min_height":-1}"#] {
            let read = parse(&file(&[good, ("Polygon", SQUARE, properties), ("Polygon", SQUARE, properties)])).unwrap();
            assert_eq!(read.all.len(), 1);
            let expected = "2 building(s) are left out, since their heights or levels are negative or too large (the \
                            first is feature 1)";
            assert_eq!(read.warnings(), [expected]);
        }
        let degrees = "[[[12.3,45.4],[12.3002,45.4],[12.3002,45.4001],[12.3,45.4]]]";
        let read = parse(&file(&[good, ("Polygon", degrees, HIGH), good])).unwrap();
        assert_eq!(read.all.len(), 2);
        assert!(
            read.warnings().len() == 1 && read.warnings()[0].contains("degrees among metres (the first is feature 1)")
        );
    }

    #[test]
    fn malformed_files_are_refused_with_one_line() {
        let polygon = |ring: &str| file(&[("Polygon", SQUARE, "{}"), ("Polygon", ring, "{}")]);
        for (text, expected) in [
            (String::new(), "EOF"),
            ("[]".into(), "expected a FeatureCollection"),
            ("{\"type\":\"Topology\"}".into(), "\"type\" is \"Topology\""),
            ("{\"type\":\"FeatureCollection\"}".into(), "no \"features\""),
            ("{\"type\":\"FeatureCollection\",\"features\":[]}".into(), "no Polygon"),
            ("{\"type\":\"FeatureCollection\",\"features\":[{}]}".into(), "feature 0: \"type\" is not \"Feature\""),
            (format!("{} x", file(&[("Polygon", SQUARE, "{}")])), "trailing characters"),
            (file(&[("Polygon", SQUARE, "{}")])[..80].into(), "EOF"),
            (polygon("[[[0,0],[1,0],[0,0]]]"), "feature 1: a ring has 2 corner(s)"),
            (polygon("[[0,0],[20,0],[20,10]]"), "feature 1: "),
            (polygon("[[[0,0],[1,null],[1,1],[0,0]]]"), "feature 1: [1,null]"),
            (polygon("[[[0,0],[1e999,0],[1,1],[0,0]]]"), "out of range"),
            (polygon("[[[0,0],[1e9,0],[1,1],[0,0]]]"), "feature 1: [1000000000.0,0]"),
            (polygon("7"), "feature 1: \"coordinates\" have the wrong depth"),
        ] {
            let SceneError(message) = parse(&text).expect_err(&text);
            assert!(message.contains(expected) && !message.contains('\n'), "{text}: {message}");
        }
    }

    #[test]
    fn compressed_files_are_read_as_others() {
        use std::io::Write;
        let path = std::env::temp_dir().join(format!("girandole_blocks_{}.geojson.gz", std::process::id()));
        let mut encoder = flate2::write::GzEncoder::new(std::fs::File::create(&path).unwrap(), Default::default());
        encoder.write_all(file(&[("Polygon", SQUARE, "{}")]).as_bytes()).unwrap();
        encoder.finish().unwrap();
        let read = Footprints::read(&path, None);
        std::fs::remove_file(&path).unwrap();
        assert_eq!(read.unwrap().all.len(), 1);
    }
}
