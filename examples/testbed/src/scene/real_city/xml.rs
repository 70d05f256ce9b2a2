//! XML files that are read as a stream, compressed with gzip or not.

use std::fmt::Display;
use std::io::{self, BufRead, Read};
use std::path::Path;

use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;

use super::SceneError;
use super::source::{self, Source};

/// The greatest coordinate, in metres or degrees.
const MOST: f64 = 1e8;

/// A reader whose errors are one line, with the name of the file and the line.
pub struct XmlFile<R> {
    reader: Reader<Lines<R>>,
    name: String,
    /// The line in which the last event starts.
    line: u64,
}

/// A source that counts the ends of lines.
struct Lines<R> {
    source: R,
    ends: u64,
}

impl<R: BufRead> Read for Lines<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.fill_buf()?.read(buffer)?;
        self.consume(count);
        Ok(count)
    }
}

impl<R: BufRead> BufRead for Lines<R> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        self.source.fill_buf()
    }

    fn consume(&mut self, count: usize) {
        // What is consumed is in the buffer, so that this reads nothing.
        let consumed = self.source.fill_buf().ok().and_then(|buffer| buffer.get(..count));
        self.ends += consumed.map_or(0, |bytes| bytes.iter().filter(|byte| **byte == b'\n').count() as u64);
        self.source.consume(count);
    }
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
        let mut reader = Reader::from_reader(Lines { source, ends: 0 });
        reader.config_mut().check_end_names = true;
        Self { reader, name, line: 1 }
    }

    /// The next event, in a buffer of the caller.
    pub fn next<'b>(&mut self, buffer: &'b mut Vec<u8>) -> Result<Event<'b>, SceneError> {
        buffer.clear();
        self.line = self.reader.get_ref().ends + 1;
        self.reader.read_event_into(buffer).map_err(|error| fail(&self.name, self.line, error))
    }

    /// An error in the last event.
    pub fn fail(&self, what: impl Display) -> SceneError {
        fail(&self.name, self.line, what)
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

fn fail(name: &str, line: u64, what: impl Display) -> SceneError {
    SceneError(format!("{name}: line {line}: {}", what.to_string().replace('\n', " ")))
}

/// A number of at most 1e8.
pub fn parse_number(text: &str) -> Option<f64> {
    text.trim().parse::<f64>().ok().filter(|number| number.is_finite() && number.abs() <= MOST)
}
