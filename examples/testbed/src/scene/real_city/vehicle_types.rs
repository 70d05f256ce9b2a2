//! Reads the vehicle types of SUMO's route files and additional files: the class and the size of
//! each type.

use std::collections::BTreeMap;
use std::io::BufRead;
use std::path::PathBuf;

use quick_xml::events::{BytesStart, Event};

use super::SceneError;
use super::vehicle_class::VehicleClass;
use super::xml::XmlFile;

/// The longest and the shortest extent of a vehicle, metres.
const EXTENTS: std::ops::RangeInclusive<f64> = 0.05..=2_000.0;

/// A type.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VehicleType {
    /// Its class.
    pub class: VehicleClass,
    /// Length, width and height in metres, if the file states them.
    pub extents: [Option<f32>; 3],
}

/// Types by their ids.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VehicleTypes {
    types: BTreeMap<String, VehicleType>,
}

impl VehicleTypes {
    /// Reads all files. If several define a type, the last one counts.
    pub fn read(paths: &[PathBuf]) -> Result<Self, SceneError> {
        let mut all = Self::default();
        for path in paths {
            all.types.extend(Self::parse(XmlFile::open(path)?)?.types);
        }
        Ok(all)
    }

    /// Reads from any source, which must define a type.
    pub fn parse<R: BufRead>(mut file: XmlFile<R>) -> Result<Self, SceneError> {
        let (mut types, mut buffer, mut depth) = (BTreeMap::new(), Vec::new(), 0_usize);
        loop {
            match file.next(&mut buffer)? {
                Event::Start(element) => {
                    take(&file, &element, &mut types)?;
                    depth += 1;
                }
                Event::Empty(element) => take(&file, &element, &mut types)?,
                Event::End(_) => depth = depth.saturating_sub(1),
                Event::Eof if depth > 0 => return Err(file.fail("the file ends within an element")),
                Event::Eof if types.is_empty() => return Err(file.fail("there is no <vType>")),
                Event::Eof => return Ok(Self { types }),
                _ => {}
            }
        }
    }

    /// The type with an id. SUMO appends `@` and the name of a vehicle to the types that it makes for
    /// single vehicles.
    pub fn get(&self, id: &str) -> Option<VehicleType> {
        let original = || id.split_once('@').map(|(original, _)| original);
        let default = |id: &str| Some(VehicleType { class: VehicleClass::of_default_type(id)?, extents: [None; 3] });
        let known = self.types.get(id).or_else(|| self.types.get(original()?));
        known.copied().or_else(|| default(id)).or_else(|| default(original()?))
    }
}

/// Adds the type that an element defines, if it is one.
fn take<R: BufRead>(
    file: &XmlFile<R>,
    element: &BytesStart<'_>,
    types: &mut BTreeMap<String, VehicleType>,
) -> Result<(), SceneError> {
    if element.name().as_ref() != "vType" {
        return Ok(());
    }
    let id = file.text(element, "id")?.ok_or_else(|| file.fail("<vType> without \"id\""))?;
    let class = match file.text(element, "vClass")? {
        Some(name) => VehicleClass::named(&name).ok_or_else(|| {
            file.fail(format!("the \"vClass\" of <vType> {id:?} is {name:?}, which SUMO does not have"))
        })?,
        None => VehicleType::default_class(&id),
    };
    let mut extents = [None; 3];
    for (extent, name) in extents.iter_mut().zip(["length", "width", "height"]) {
        if file.text(element, name)?.is_some() {
            let metres = file.number(element, name)?;
            if !EXTENTS.contains(&metres) {
                let (low, high) = EXTENTS.into_inner();
                let what =
                    format!("\"{name}\" of <vType> {id:?} is {metres}, which is not between {low} m and {high} m");
                return Err(file.fail(what));
            }
            *extent = Some(metres as f32);
        }
    }
    types.insert(id, VehicleType { class, extents });
    Ok(())
}

impl VehicleType {
    /// The class of a type that states none.
    fn default_class(id: &str) -> VehicleClass {
        let is_default = id.starts_with("DEFAULT_");
        VehicleClass::of_default_type(id).filter(|_| is_default).unwrap_or_else(VehicleClass::passenger)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn types(text: &str) -> Result<VehicleTypes, SceneError> {
        VehicleTypes::parse(XmlFile::new(text.as_bytes(), "test.rou.xml".into()))
    }

    fn class(name: &str) -> VehicleClass {
        VehicleClass::named(name).unwrap()
    }

    #[test]
    fn types_have_the_classes_and_extents_of_the_file() {
        let types = types(
            r#"<routes><vType id="a" vClass="tram" length="30.5" width="2.65" height="3.4"/>
            <vTypeDistribution id="mixed"><vType id="b" vClass="bicycle" probability="0.5"/>
                <vType id="c" probability="0.5"><param key="k" value="v"/></vType></vTypeDistribution>
            <vType id="DEFAULT_BIKETYPE" length="1.9"/>
            <vehicle id="v" type="a" depart="0"/></routes>"#,
        )
        .unwrap();
        let get = |id: &str| types.get(id).map(|found| (found.class, found.extents));
        assert_eq!(get("a"), Some((class("tram"), [Some(30.5), Some(2.65), Some(3.4)])));
        assert_eq!(get("b"), Some((class("bicycle"), [None; 3])));
        assert_eq!(get("c"), Some((class("passenger"), [None; 3])));
        assert_eq!(get("b@vehicle_7"), get("b"));
        assert_eq!(get("DEFAULT_BIKETYPE"), Some((class("bicycle"), [Some(1.9), None, None])));
        assert_eq!(get("DEFAULT_PEDTYPE@p"), Some((class("pedestrian"), [None; 3])));
        assert_eq!((get("mixed"), get("unknown"), get("v")), (None, None, None));
    }

    #[test]
    fn malformed_files_are_refused_with_one_line() {
        for (text, expected) in [
            ("", "no <vType>"),
            ("<routes/>", "no <vType>"),
            ("<routes><vType id=\"a\"/>", "ends within"),
            ("<routes><vType vClass=\"bus\"/></routes>", "without \"id\""),
            ("<routes><vType id=\"a\" vClass=\"buss\"/></routes>", "<vType> \"a\" is \"buss\""),
            ("<routes><vType id=\"a\" length=\"x\"/></routes>", "\"length\" of <vType> is \"x\""),
            ("<routes><vType id=\"a\" width=\"-1\"/></routes>", "\"width\" of <vType> \"a\" is -1"),
            ("<routes><vType id=\"a\" height=\"1e7\"/></routes>", "\"height\" of <vType> \"a\""),
            ("<routes>\n<vType id=\"a\"></routes>", "line 2: "),
        ] {
            let SceneError(message) = types(text).expect_err(text);
            assert!(message.contains(expected) && !message.contains('\n'), "{text}: {message}");
        }
    }
}
