//! XML files that are read as a stream, compressed with gzip or not.

use std::io::BufRead;
use std::path::Path;

use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;

use super::SceneError;
use super::source::{self, Source};

/// The greatest coordinate, in metres or degrees.
const MOST: f64 = 1e8;

/// A reader whose errors are one line, with the name of the file and the byte.
pub struct XmlFile<R> {
    reader: Reader<R>,
    name: String,
}

impl XmlFile<Source> {
    /// Opens a file.
    pub fn open(path: &Path) -> Result<Self, SceneError> {
        Ok(Self::new(source::open(path)?, path.display().to_string()))
    }
}

impl<R: BufRead> XmlFile<R> {
    /// Reads from any source. Errors begin with `name`.
    pub fn new(source: R, name: String) -> Self {
        let mut reader = Reader::from_reader(source);
        reader.config_mut().check_end_names = true;
        Self { reader, name }
    }

    /// The next event, in a buffer of the caller.
    pub fn next<'b>(&mut self, buffer: &'b mut Vec<u8>) -> Result<Event<'b>, SceneError> {
        buffer.clear();
        self.reader.read_event_into(buffer).map_err(|error| {
            let what = error.to_string().replace('\n', " ");
            SceneError(format!("{}: byte {}: {what}", self.name, self.reader.error_position()))
        })
    }

    /// An error at the present place.
    pub fn fail(&self, what: impl std::fmt::Display) -> SceneError {
        let what = what.to_string().replace('\n', " ");
        SceneError(format!("{}: byte {}: {what}", self.name, self.reader.buffer_position()))
    }

    /// An attribute of an element; `None` if it has none of this name.
    pub fn text(&self, element: &BytesStart<'_>, name: &str) -> Result<Option<String>, SceneError> {
        let attribute = element.try_get_attribute(name).map_err(|error| self.fail(error))?;
        let Some(attribute) = attribute else { return Ok(None) };
        let value = attribute.normalized_value(XmlVersion::Implicit1_0).map_err(|error| self.fail(error))?;
        Ok(Some(value.into_owned()))
    }

    /// An attribute that must be there, and be a number of at most 1e8.
    pub fn number(&self, element: &BytesStart<'_>, name: &str) -> Result<f64, SceneError> {
        let tag = element.name();
        let text =
            self.text(element, name)?.ok_or_else(|| self.fail(format!("<{}> without \"{name}\"", tag.as_ref())))?;
        parse_number(&text).ok_or_else(|| {
            self.fail(format!("\"{name}\" of <{}> is {text:?}, not a number of at most 1e8", tag.as_ref()))
        })
    }
}

/// A number of at most 1e8.
pub fn parse_number(text: &str) -> Option<f64> {
    text.trim().parse::<f64>().ok().filter(|number| number.is_finite() && number.abs() <= MOST)
}
