//! How the rows that programs wrote become a table of a document.

use super::number::{Format, NONE, digits, evaluate, fixed};
use super::sheet::Sheet;

/// A table as data. Rows come in the order of the program, or of `keep`.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// The files, below the folder of raw files. Their rows follow each other.
    pub from: &'static [&'static str],
    /// Only these values of a column, in this order.
    pub keep: &'static [(&'static str, &'static [&'static str])],
    /// No rows in which the value of a column begins so.
    pub drop: &'static [(&'static str, &'static str)],
    /// Columns that name a row, with their headings.
    pub keys: &'static [(&'static str, &'static str)],
    /// Each value of this column becomes a column of the table.
    pub across: Option<&'static str>,
    pub cells: &'static [Cell],
    /// Each of `cells` becomes rows, and not columns.
    pub is_stacked: bool,
    pub derived: &'static [Derived],
    /// Only these columns besides the keys; all if there are none.
    pub show: &'static [&'static str],
    /// Only rows in which the value of this column exceeds a limit.
    pub above: Option<(&'static str, f64)>,
    /// Names of values and of columns in the document.
    pub labels: &'static [(&'static str, &'static str)],
}

/// A view of nothing, to be completed.
pub const VIEW: View = View {
    from: &[],
    keep: &[],
    drop: &[],
    keys: &[],
    across: None,
    cells: &[],
    is_stacked: false,
    derived: &[],
    show: &[],
    above: None,
    labels: &[],
};

/// A value of the table.
#[derive(Clone, Copy, Debug)]
pub struct Cell {
    /// Follows the name of the column of [`View::across`], if there is one.
    pub heading: &'static str,
    /// A formula over columns ([`evaluate`]). Where several rows meet, the mean counts.
    pub value: &'static str,
    pub format: Format,
    /// Only for this value of [`View::across`].
    pub only: Option<&'static str>,
}

/// A value of a row.
pub const fn cell(heading: &'static str, value: &'static str, format: Format) -> Cell {
    Cell { heading, value, format, only: None }
}

impl Cell {
    /// Only for one value of [`View::across`].
    pub const fn only(self, value: &'static str) -> Self {
        Self { only: Some(value), ..self }
    }
}

/// A column that follows from others of the row, which are called by their headings.
#[derive(Clone, Copy, Debug)]
pub enum Derived {
    /// A column over the least of all but these.
    OfBest(&'static str, &'static str, &'static [&'static str]),
    /// The name of the least of all columns but these, and its value.
    Best(&'static str, &'static [&'static str]),
}

/// Names in all documents.
const LABELS: [(&str, &str); 3] =
    [("bistro_exterior_lite", "Bistro"), ("girandole", "two levels"), ("girandole flat", "one tree")];

/// A finished table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rendered {
    /// How many columns name a row.
    pub keys: usize,
    pub head: Vec<String>,
    pub rows: Vec<Vec<String>>,
}

/// One value and its text.
type Value = (String, Option<f64>);

/// A record of any of the files.
type Record<'a> = (&'a Sheet, &'a [String]);

fn field<'a>((sheet, row): &Record<'a>, name: &str) -> Option<&'a str> {
    let at = sheet.columns.iter().position(|column| column == name)?;
    row.get(at).map(String::as_str)
}

impl View {
    /// The table over what the programs wrote. An error is one line.
    pub fn render(&self, sheets: &[Sheet]) -> Result<Rendered, String> {
        let records = self.records(sheets);
        let names = |record: &Record<'_>| -> Vec<String> {
            self.keys.iter().map(|(column, _)| self.label(field(record, column).unwrap_or_default())).collect()
        };
        let across: Vec<Option<&str>> = match self.across {
            None => vec![None],
            Some(column) => distinct(records.iter().map(|record| field(record, column))),
        };
        let names_of_rows = distinct(records.iter().map(names));
        let is_at = |record: &Record<'_>, row: &[String], column: Option<&str>| {
            names(record) == row && self.across.is_none_or(|name| field(record, name) == column)
        };
        let value = |cell: &Cell, row: &[String], column: Option<&str>| {
            let met: Vec<&Record<'_>> = records.iter().filter(|record| is_at(record, row, column)).collect();
            cell.of(&met)
        };
        let mut head: Vec<String> = Vec::new();
        let mut grid: Vec<(Vec<String>, Vec<Value>)> = Vec::new();
        if self.is_stacked {
            head.extend(across.iter().map(|column| self.label(column.unwrap_or("value"))));
            for cell in self.cells {
                for row in &names_of_rows {
                    let key = [cell.heading.to_owned()].into_iter().chain(row.clone()).collect();
                    grid.push((key, across.iter().map(|column| value(cell, row, *column)).collect()));
                }
            }
        } else {
            grid.extend(names_of_rows.iter().map(|row| (row.clone(), Vec::new())));
            for cell in self.cells {
                for column in across.iter().filter(|column| cell.only.is_none() || cell.only == **column) {
                    let heading = match (cell.only.or(*column), cell.heading) {
                        (Some(name), "") => self.label(name),
                        (Some(name), heading) if cell.only.is_none() => format!("{}, {heading}", self.label(name)),
                        (_, heading) => heading.to_owned(),
                    };
                    head.push(heading);
                    let values = names_of_rows.iter().map(|row| value(cell, row, *column));
                    grid.iter_mut().zip(values).for_each(|(row, value)| row.1.push(value));
                }
            }
        }
        grid.retain(|(_, values)| values.iter().any(|(text, _)| text != NONE));
        self.finish(head, grid)
    }

    /// The rows that are kept, in order.
    fn records<'a>(&self, sheets: &'a [Sheet]) -> Vec<Record<'a>> {
        let all = sheets.iter().flat_map(|sheet| sheet.rows.iter().map(move |row| (sheet, row.as_slice())));
        let place = |record: &Record<'_>| -> Option<Vec<usize>> {
            let of = |(column, values): &(&str, &[&str])| {
                field(record, column).and_then(|own| values.iter().position(|value| *value == own))
            };
            self.keep.iter().map(of).collect()
        };
        let is_dropped = |record: &Record<'_>| {
            self.drop.iter().any(|(column, start)| field(record, column).is_some_and(|own| own.starts_with(start)))
        };
        let mut kept: Vec<_> = all.filter(|record| !is_dropped(record)).collect();
        kept.retain(|record| place(record).is_some());
        kept.sort_by_key(&place);
        kept
    }

    /// Adds the derived columns and removes what is not shown.
    fn finish(&self, mut head: Vec<String>, mut grid: Vec<(Vec<String>, Vec<Value>)>) -> Result<Rendered, String> {
        let measured = head.len();
        for derived in self.derived {
            let (Derived::OfBest(heading, ..) | Derived::Best(heading, ..)) = derived;
            head.push((*heading).to_owned());
            for (_, values) in &mut grid {
                values.push(derived.of(&head[..measured], &values[..measured]));
            }
        }
        let find =
            |name: &str| head.iter().position(|heading| heading == name).ok_or(format!("there is no \"{name}\""));
        if let Some((name, limit)) = self.above {
            let at = find(name)?;
            grid.retain(|(_, values)| values[at].1.is_some_and(|value| value > limit));
        }
        let shown: Vec<usize> = match self.show {
            [] => (0..head.len()).collect(),
            names => names.iter().map(|name| find(name)).collect::<Result<_, _>>()?,
        };
        let stacked = self.is_stacked.then_some("");
        let keys: Vec<&str> = stacked.into_iter().chain(self.keys.iter().map(|(_, heading)| *heading)).collect();
        let texts = |(row, values): (Vec<String>, Vec<Value>)| -> Vec<String> {
            row.into_iter().chain(shown.iter().map(|at| values[*at].0.clone())).collect()
        };
        Ok(Rendered {
            keys: keys.len(),
            head: keys
                .iter()
                .map(|heading| (*heading).to_owned())
                .chain(shown.iter().map(|at| head[*at].clone()))
                .collect(),
            rows: grid.into_iter().map(texts).collect(),
        })
    }

    fn label(&self, name: &str) -> String {
        let label = self.labels.iter().chain(&LABELS).find(|(own, _)| *own == name);
        // Standard deviations differ from run to run, so they name no row.
        let plain =
            name.split_once(", SD ").and_then(|(start, rest)| Some(format!("{start}, {}", rest.split_once(", ")?.1)));
        label.map_or_else(|| plain.unwrap_or_else(|| name.to_owned()), |(_, label)| (*label).to_owned())
    }
}

impl Cell {
    /// The mean over the rows that meet here.
    fn of(&self, met: &[&Record<'_>]) -> Value {
        let mean = |formula: &str| {
            let of = |record: &&Record<'_>| evaluate(formula, |name| field(record, name)?.parse().ok());
            let values: Vec<f64> = met.iter().filter_map(of).collect();
            (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
        };
        let text = met.first().and_then(|record| field(record, self.value)).filter(|text| !text.is_empty());
        let value = mean(self.value);
        let shown = match (self.format, value) {
            (Format::Text, _) | (_, None) => text.unwrap_or(NONE).to_owned(),
            (Format::Within(low, high, count), Some(value)) => {
                let [low, high] = [low, high].map(|end| digits(mean(end).unwrap_or(f64::NAN), count));
                format!("{} ({low} to {high})", digits(value, count))
            }
            (format, Some(value)) => format.text(value),
        };
        (shown, value)
    }
}

impl Format {
    fn text(self, value: f64) -> String {
        match self {
            Self::Text => value.to_string(),
            Self::Fixed(count) => fixed(value, count),
            Self::Digits(count) | Self::Within(_, _, count) => digits(value, count),
            Self::Percent(count) => fixed(100.0 * value, count) + " %",
        }
    }
}

impl Derived {
    fn of(&self, head: &[String], values: &[Value]) -> Value {
        let named = |name: &str| head.iter().position(|heading| heading == name).and_then(|at| values[at].1);
        let best = |own: &[&str]| {
            let others = head.iter().zip(values).filter(|(heading, _)| !own.contains(&heading.as_str()));
            others.filter_map(|(heading, value)| Some((heading, value, value.1?))).min_by(|a, b| a.2.total_cmp(&b.2))
        };
        let ratio = |of: &str, to: Option<f64>| named(of).zip(to).map(|(of, to)| of / to);
        let shown = |ratio: Option<f64>| (ratio.map_or(NONE.into(), |ratio| digits(ratio, 2)), ratio);
        match self {
            Self::OfBest(_, of, own) => shown(ratio(of, best(own).map(|(.., value)| value))),
            Self::Best(_, own) => best(own)
                .map_or((NONE.into(), None), |(heading, (text, _), value)| (format!("{heading}: {text}"), Some(value))),
        }
    }
}

fn distinct<T: PartialEq>(all: impl Iterator<Item = T>) -> Vec<T> {
    all.fold(Vec::new(), |mut seen, value| {
        if !seen.contains(&value) {
            seen.push(value);
        }
        seen
    })
}

impl Rendered {
    /// All rows of a sheet.
    pub fn of(sheet: Sheet) -> Self {
        Self { keys: 0, head: sheet.columns, rows: sheet.rows }
    }

    /// Adds the rows of a table with the same columns.
    pub fn append(&mut self, other: Self) -> Result<(), String> {
        if self.head != other.head {
            return Err(format!("{:?} are not the columns {:?}", other.head, self.head));
        }
        self.rows.extend(other.rows);
        Ok(())
    }

    /// The table as Markdown.
    pub fn markdown(&self) -> String {
        let rules = (0..self.head.len()).map(|at| if at < self.keys { "---|" } else { "---:|" });
        let mut text = format!("| {} |\n|{}\n", self.head.join(" | "), rules.collect::<String>());
        self.rows.iter().for_each(|row| text += &format!("| {} |\n", row.join(" | ")));
        text
    }

    /// The table as CSV, below a comment.
    pub fn csv(&self, comment: &str) -> String {
        let line = |cells: &[String]| {
            let quoted =
                cells.iter().map(|cell| if cell.contains([',', '"']) { format!("{cell:?}") } else { cell.clone() });
            quoted.collect::<Vec<_>>().join(",") + "\n"
        };
        format!("# {comment}\n{}{}", line(&self.head), self.rows.iter().map(|row| line(row)).collect::<String>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise() -> Sheet {
        let text = "| scene | sampler | sigma | ns |\n|---|---|---|---|\n| S | pbrt | 4 | 800 |\n| S | flat, 2 | 9 | 1 |\n\
                    | S | girandole | 0.8 | 1000 |\n| M | pbrt | 1 | 900 |\n| M | girandole | 1.5 | 1200 |";
        Sheet::from_markdown(text)
    }

    #[test]
    fn values_of_a_column_become_columns_and_rows_follow_from_others() {
        const ACROSS: View = View {
            drop: &[("sampler", "flat,")],
            keys: &[("scene", "scene")],
            across: Some("sampler"),
            cells: &[cell("", "sigma", Format::Digits(2)), cell("ns", "ns", Format::Digits(2)).only("girandole")],
            derived: &[Derived::OfBest("of the best", "two levels", &["two levels", "ns"])],
            ..VIEW
        };
        let expected = "| scene | pbrt | two levels | ns | of the best |\n|---|---:|---:|---:|---:|\n\
                        | S | 4.0 | 0.80 | 1,000 | 0.20 |\n| M | 1.0 | 1.5 | 1,200 | 1.5 |\n";
        assert_eq!(ACROSS.render(&[noise()]).expect("a table").markdown(), expected);
        let lost = View { above: Some(("of the best", 1.0)), show: &["of the best"], ..ACROSS };
        let rendered = lost.render(&[noise()]).expect("a table");
        assert_eq!(rendered.rows, [["M", "1.5"]]);
    }

    #[test]
    fn cells_become_rows_in_the_order_that_is_kept() {
        const STACKED: View = View {
            keep: &[("sampler", &["girandole", "pbrt"])],
            keys: &[("scene", "scene")],
            across: Some("sampler"),
            cells: &[cell("σ", "sigma", Format::Fixed(1)), cell("µs", "ns / 1000", Format::Fixed(1))],
            is_stacked: true,
            labels: &[("pbrt", "pbrt-v4")],
            ..VIEW
        };
        let rendered = STACKED.render(&[noise()]).expect("a table");
        assert_eq!(rendered.head, ["", "scene", "two levels", "pbrt-v4"]);
        assert_eq!(rendered.rows[0], ["σ", "S", "0.8", "4.0"]);
        assert_eq!(rendered.rows[3], ["µs", "M", "1.2", "0.9"]);
    }
}
