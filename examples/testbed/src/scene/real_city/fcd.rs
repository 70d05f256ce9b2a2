//! Reads floating car data, which `sumo --fcd-output` writes. The file is read as a stream: only
//! one time step is in memory.

use std::io::BufRead;
use std::path::Path;

use quick_xml::events::{BytesStart, Event};

use super::SceneError;
use super::source::Source;
use super::vehicle_class::VehicleClass;
use super::xml::XmlFile;

/// A vehicle, a person or a container in a time step.
#[derive(Clone, Debug, PartialEq)]
pub struct FcdVehicle {
    /// Its name. Those of persons and containers follow the name of the element, since a vehicle may
    /// have the same name.
    pub id: String,
    /// The id of its type; may be empty.
    pub kind: String,
    /// Its class: that which the file states, or that of persons and containers.
    pub class: Option<VehicleClass>,
    /// Position of the front bumper, metres east.
    pub east: f64,
    /// Position of the front bumper, metres north.
    pub north: f64,
    /// Direction in degrees, clockwise from north.
    pub angle: f32,
    /// Metres per second, if the file states it.
    pub speed: Option<f64>,
}

/// All vehicles at one time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Timestep {
    /// Seconds.
    pub time: f64,
    /// In the order of the file.
    pub vehicles: Vec<FcdVehicle>,
}

/// Reads one time step after the other.
pub struct FcdReader<R> {
    file: XmlFile<R>,
    buffer: Vec<u8>,
    /// Number of open elements.
    depth: usize,
    /// Whether `<fcd-export>` was read.
    in_export: bool,
    finished: bool,
    /// Time of the last time step.
    last_time: f64,
}

impl FcdReader<Source> {
    /// Opens a file.
    pub fn open(path: &Path) -> Result<Self, SceneError> {
        Ok(Self::new(XmlFile::open(path)?))
    }
}

impl<R: BufRead> FcdReader<R> {
    /// Reads from any source.
    pub fn new(file: XmlFile<R>) -> Self {
        let (buffer, last_time) = (Vec::new(), f64::NEG_INFINITY);
        Self { file, buffer, depth: 0, in_export: false, finished: false, last_time }
    }

    fn fail(&self, what: impl std::fmt::Display) -> SceneError {
        self.file.fail(what)
    }

    /// The next time step; `None` at the end of a complete file.
    pub fn next_step(&mut self) -> Result<Option<Timestep>, SceneError> {
        if self.finished {
            return Ok(None);
        }
        let mut step: Option<Timestep> = None;
        loop {
            let mut buffer = std::mem::take(&mut self.buffer);
            let event = self.file.next(&mut buffer)?;
            let is_step_end = match &event {
                Event::Start(element) => {
                    self.open_element(element, &mut step)?;
                    self.depth += 1;
                    false
                }
                Event::Empty(element) => {
                    self.open_element(element, &mut step)?;
                    // `<timestep .../>` has no end tag.
                    element.name().as_ref() == "timestep"
                }
                Event::End(element) => {
                    self.depth -= 1;
                    element.name().as_ref() == "timestep"
                }
                Event::Eof if self.depth > 0 => return Err(self.fail("the file ends within an element")),
                Event::Eof if !self.in_export => return Err(self.fail("there is no <fcd-export>")),
                Event::Eof => {
                    self.finished = true;
                    return Ok(None);
                }
                _ => false,
            };
            drop(event);
            self.buffer = buffer;
            if is_step_end && step.is_some() {
                return Ok(step);
            }
        }
    }

    fn open_element(&mut self, element: &BytesStart<'_>, step: &mut Option<Timestep>) -> Result<(), SceneError> {
        match (self.depth, element.name().as_ref()) {
            (0, "fcd-export") => self.in_export = true,
            (0, other) => return Err(self.fail(format!("expected <fcd-export>, found <{other}>"))),
            (1, "timestep") => {
                let time = self.file.number(element, "time")?;
                if time <= self.last_time {
                    return Err(self.fail(format!("time {time} does not follow {}", self.last_time)));
                }
                self.last_time = time;
                *step = Some(Timestep { time, vehicles: Vec::new() });
            }
            (2, tag @ ("vehicle" | "person" | "container")) => {
                let vehicle = self.vehicle(element, tag)?;
                if let Some(step) = step.as_mut().filter(|step| !is_aboard(&vehicle, tag, step)) {
                    step.vehicles.push(vehicle);
                }
            }
            // Elements of later versions.
            _ => {}
        }
        Ok(())
    }

    /// What an element states.
    fn vehicle(&self, element: &BytesStart<'_>, tag: &str) -> Result<FcdVehicle, SceneError> {
        let number = |name: &str| self.file.number(element, name);
        let id = self.file.text(element, "id")?.ok_or_else(|| self.fail(format!("<{tag}> without \"id\"")))?;
        let speed = match self.file.text(element, "speed")? {
            Some(_) => Some(number("speed")?),
            None => None,
        };
        let kind = self.file.text(element, "type")?.unwrap_or_default();
        let class = match self.file.text(element, "vClass")? {
            Some(name) => Some(VehicleClass::named(&name).ok_or_else(|| {
                self.fail(format!("the \"vClass\" of <{tag}> {id:?} is {name:?}, which SUMO does not have"))
            })?),
            // Persons and containers have a type in later versions only.
            None if kind.is_empty() && tag == "person" => VehicleClass::named("pedestrian"),
            None if kind.is_empty() && tag == "container" => VehicleClass::named("container"),
            None => None,
        };
        let id = if tag == "vehicle" { id } else { format!("{tag} {id}") };
        let (east, north, angle) = (number("x")?, number("y")?, number("angle")? as f32);
        Ok(FcdVehicle { id, kind, class, east, north, angle, speed })
    }
}

/// Whether a person or a container is aboard a vehicle. SUMO writes those after their vehicle, with
/// its position.
fn is_aboard(carried: &FcdVehicle, tag: &str, step: &Timestep) -> bool {
    let carrier = step.vehicles.last().filter(|_| tag != "vehicle");
    carrier.is_some_and(|carrier| (carrier.east, carrier.north) == (carried.east, carried.north))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steps(text: &str) -> Result<Vec<Timestep>, SceneError> {
        let mut reader = FcdReader::new(XmlFile::new(text.as_bytes(), "test.xml".into()));
        let mut steps = Vec::new();
        while let Some(step) = reader.next_step()? {
            steps.push(step);
        }
        Ok(steps)
    }

    #[test]
    fn time_steps_are_read_one_by_one() {
        let text = r#"<?xml version="1.0"?><!-- a comment --><fcd-export>
            <timestep time="0.00"/>
            <timestep time="1.00"><vehicle id="a&amp;b" x="1.5" y="-2" angle="90" type="bus" speed="3" lane="e_0"/>
                </timestep></fcd-export>"#;
        let steps = steps(text).unwrap();
        assert_eq!(steps.len(), 2);
        assert!(steps[0].vehicles.is_empty());
        let car = &steps[1].vehicles[0];
        assert_eq!(car.class, None);
        assert_eq!(
            (car.id.as_str(), car.kind.as_str(), car.east, car.north, car.angle),
            ("a&b", "bus", 1.5, -2.0, 90.0)
        );
    }

    #[test]
    fn persons_and_containers_are_read_unless_they_are_aboard_a_vehicle() {
        let text = r#"<fcd-export><timestep time="0">
            <vehicle id="a" x="1" y="2" angle="0" type="t" vClass="tram"/>
            <person id="rider" x="1" y="2" angle="0" type="DEFAULT_PEDTYPE"/>
            <person id="a" x="5" y="2" angle="0"/><container id="a" x="9" y="2" angle="0"/>
            <person id="b" x="6" y="2" angle="0" type="walker"/></timestep></fcd-export>"#;
        let steps = steps(text).unwrap();
        let read: Vec<_> = steps[0].vehicles.iter().map(|vehicle| (vehicle.id.as_str(), vehicle.class)).collect();
        let class = VehicleClass::named;
        let expected = [
            ("a", class("tram")),
            ("person a", class("pedestrian")),
            ("container a", class("container")),
            ("person b", None),
        ];
        assert_eq!(read, expected);
    }

    #[test]
    fn malformed_files_are_refused_with_one_line() {
        for (text, expected) in [
            (
                "<fcd-export><timestep time=\"0\"><vehicle id=\"a\" x=\"1\" y=\"1\" angle=\"0\" vClass=\"ufo\"/></timestep></fcd-export>",
                "<vehicle> \"a\" is \"ufo\"",
            ),
            (
                "<fcd-export><timestep time=\"0\"><person x=\"1\" y=\"1\" angle=\"0\"/></timestep></fcd-export>",
                "<person> without",
            ),
            ("", "no <fcd-export>"),
            ("<routes></routes>", "found <routes>"),
            ("<fcd-export><timestep time=\"0\">", "ends within"),
            ("<fcd-export><timestep time=\"0\">\n\n</fcd-export>", "line 3: "),
            ("<fcd-export><timestep time=\"x\"/></fcd-export>", "\"time\" of <timestep> is \"x\""),
            ("<fcd-export><timestep/></fcd-export>", "<timestep> without \"time\""),
            ("<fcd-export><timestep time=\"2\"/><timestep time=\"1\"/></fcd-export>", "does not follow"),
            (
                "<fcd-export><timestep time=\"0\"><vehicle x=\"1\" y=\"1\" angle=\"0\"/></timestep></fcd-export>",
                "\"id\"",
            ),
            (
                "<fcd-export><timestep time=\"0\"><vehicle id=\"a\" x=\"NaN\" y=\"1\" angle=\"0\"/></timestep></fcd-export>",
                "NaN",
            ),
            ("<fcd-export>\n<timestep time=\"0\"><vehicle id=\"a\"\n x=\"1\" y=\"1\" angle=\"0\"\n", "line 2: "),
            ("<fcd-export>\n<!-- \n -->\n <timestep\n time=\"x\"/></fcd-export>", "line 4: \"time\" of <timestep>"),
        ] {
            let SceneError(message) = steps(text).expect_err(text);
            assert!(message.contains(expected) && !message.contains('\n'), "{text}: {message}");
        }
    }

    #[test]
    fn compressed_files_are_read_as_others() {
        use std::io::Write;
        let plain = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/fcd_small.xml");
        let path = std::env::temp_dir().join(format!("girandole_fcd_{}.xml.gz", std::process::id()));
        let mut encoder = flate2::write::GzEncoder::new(std::fs::File::create(&path).unwrap(), Default::default());
        encoder.write_all(&std::fs::read(plain).unwrap()).unwrap();
        encoder.finish().unwrap();
        let all = |path: &Path| {
            let mut reader = FcdReader::open(path).unwrap();
            std::iter::from_fn(|| reader.next_step().unwrap()).collect::<Vec<_>>()
        };
        let (compressed, expected) = (all(&path), all(Path::new(plain)));
        // A file that ends too early is refused.
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        let mut cut = FcdReader::open(&path).unwrap();
        let refused = loop {
            match cut.next_step() {
                Ok(Some(_)) => {}
                Ok(None) => panic!("half of a file is no file"),
                Err(SceneError(message)) => break message,
            }
        };
        std::fs::remove_file(&path).unwrap();
        assert_eq!(compressed, expected);
        assert!(!refused.contains('\n'), "{refused}");
    }

    #[test]
    fn the_sample_file_is_read() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/fcd_small.xml");
        let mut reader = FcdReader::open(Path::new(path)).unwrap();
        let mut counts = Vec::new();
        while let Some(step) = reader.next_step().unwrap() {
            counts.push(step.vehicles.len());
        }
        assert_eq!(counts.iter().max(), Some(&3));
        assert!(counts.contains(&0) && counts.contains(&1));
    }
}
