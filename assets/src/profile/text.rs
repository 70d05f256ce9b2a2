//! Reads numbers from a text, line by line.

use std::fmt::Display;

use crate::error::{AssetError, invalid};

/// The most characters of a text that an error shows.
const MAX_SHOWN: usize = 24;

/// A text and the place up to which it was read.
pub(super) struct Reader<'a> {
    rest: &'a [u8],
    /// The number of the line of the next byte, from 1 on.
    line: usize,
}

impl<'a> Reader<'a> {
    /// The start of a text in ASCII or UTF-8.
    pub fn new(text: &'a [u8]) -> Result<Self, AssetError> {
        // UTF-16 begins with its byte order mark, or has a zero beside its first character.
        if matches!(text, [0xff, 0xfe, ..] | [0xfe, 0xff, ..] | [0, _, ..] | [_, 0, ..]) {
            return Err(invalid("the file is UTF-16; files in ASCII or UTF-8 are read"));
        }
        Ok(Self { rest: text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text), line: 1 })
    }

    /// The rest of the line without blanks around it, and its number; `None` at the end of the text.
    pub fn line(&mut self) -> Option<(usize, &'a [u8])> {
        if self.rest.is_empty() {
            return None;
        }
        let end = self.rest.iter().position(|byte| is_end(*byte)).unwrap_or(self.rest.len());
        let (line, text) = (self.line, self.rest[..end].trim_ascii());
        self.rest = &self.rest[end..];
        self.end_line();
        Some((line, text))
    }

    /// Passes the end of a line: a line feed, a carriage return, or both.
    fn end_line(&mut self) {
        let length = if self.rest.starts_with(b"\r\n") { 2 } else { self.rest.len().min(1) };
        self.rest = &self.rest[length..];
        self.line += 1;
    }

    /// The next number, on this line or a later one; blanks and commas separate numbers.
    pub fn number(&mut self, what: &'static str) -> Result<Number, AssetError> {
        while let Some(byte) = self.rest.first() {
            match byte {
                byte if is_end(*byte) => self.end_line(),
                byte if is_separator(*byte) => self.rest = &self.rest[1..],
                _ => break,
            }
        }
        let end = self.rest.iter().position(|byte| is_end(*byte) || is_separator(*byte));
        let (word, rest) = self.rest.split_at(end.unwrap_or(self.rest.len()));
        self.rest = rest;
        Number::new(word, self.line, what)
    }

    /// So many numbers.
    pub fn numbers(&mut self, count: usize, what: &'static str) -> Result<Vec<Number>, AssetError> {
        (0..count).map(|_| self.number(what)).collect()
    }

    /// Checks that no number follows. Other text may, such as the byte by which DOS ends a file.
    pub fn end(mut self) -> Result<(), AssetError> {
        let Ok(Number { line, value, .. }) = self.number("a number") else { return Ok(()) };
        let what = "follows the last number (commas separate numbers, so a decimal comma makes two)";
        Err(in_line(line, format_args!("{value:?} {what}")))
    }

    /// The number on the next line, on which there is nothing else. Its decimal point may be a comma.
    pub fn number_of_line(&mut self, what: &'static str) -> Result<Number, AssetError> {
        let (line, text) = self.line().unwrap_or((self.line, b""));
        let text: Vec<u8> = text.iter().map(|byte| if *byte == b',' { b'.' } else { *byte }).collect();
        Number::new(&text, line, what)
    }

    /// The numbers on so many lines.
    pub fn numbers_of_lines(&mut self, count: usize, what: &'static str) -> Result<Vec<Number>, AssetError> {
        (0..count).map(|_| self.number_of_line(what)).collect()
    }

    /// Passes lines.
    pub fn skip(&mut self, lines: usize, what: &'static str) -> Result<(), AssetError> {
        (0..lines).try_for_each(|_| self.line().map(drop).ok_or_else(|| missing(self.line, what)))
    }
}

/// An error that names its line.
pub(super) fn in_line(line: usize, fault: impl Display) -> AssetError {
    invalid(format!("line {line}: {fault}"))
}

/// The file ends, or a line is empty, where something is expected.
pub(super) fn missing(line: usize, what: &str) -> AssetError {
    in_line(line, format_args!("{what} is missing"))
}

fn is_end(byte: u8) -> bool {
    matches!(byte, b'\n' | b'\r')
}

fn is_separator(byte: u8) -> bool {
    byte.is_ascii_whitespace() || byte == b','
}

/// A number of a file, and where it is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Number {
    pub value: f64,
    pub line: usize,
    /// What it is for.
    pub what: &'static str,
}

impl Number {
    fn new(text: &[u8], line: usize, what: &'static str) -> Result<Self, AssetError> {
        if text.is_empty() {
            return Err(missing(line, what));
        }
        let value = std::str::from_utf8(text).ok().and_then(|text| text.parse::<f64>().ok());
        match value.filter(|value| value.is_finite()) {
            Some(value) => Ok(Self { value, line, what }),
            None => {
                let shown: String = text.escape_ascii().to_string().chars().take(MAX_SHOWN).collect();
                Err(in_line(line, format_args!("{what} is \"{shown}\", not a finite number")))
            }
        }
    }

    /// The number, if it is in a range.
    pub fn between(self, least: f64, most: f64) -> Result<f64, AssetError> {
        if (least..=most).contains(&self.value) {
            return Ok(self.value);
        }
        let Self { value, line, what } = self;
        Err(in_line(line, format_args!("{what} is {value:?}, outside {least:?} to {most:?}")))
    }

    /// The number as a count, if it is a whole number in a range.
    pub fn count(self, least: usize, most: usize) -> Result<usize, AssetError> {
        let count = self.between(least as f64, most as f64)?;
        if count.fract() == 0.0 {
            return Ok(count as usize);
        }
        let Self { value, line, what } = self;
        Err(in_line(line, format_args!("{what} is {value:?}, not a whole number")))
    }
}
