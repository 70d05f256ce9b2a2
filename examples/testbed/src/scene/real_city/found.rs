//! What the user should know about several records of a file, in one line.

use std::fmt::Display;

/// How many records have something in common, and the first of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Found {
    count: usize,
    first: String,
}

impl Found {
    /// Counts a record, such as `feature 3`.
    pub fn add(&mut self, record: impl Display) {
        if self.count == 0 {
            self.first = record.to_string();
        }
        self.count += 1;
    }

    /// The number of records.
    pub fn count(&self) -> usize {
        self.count
    }

    /// A warning about them, if there are any: `3 lamp(s) are dark (the first is line 7)`.
    pub fn told(&self, name: &str, what: &str) -> Option<String> {
        let Self { count, first } = self;
        (*count > 0).then(|| format!("{count} {name}(s) {what} (the first is {first})"))
    }
}
