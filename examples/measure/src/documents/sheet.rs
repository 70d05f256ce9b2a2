//! What a program measured, as a table of texts: from CSV, from Markdown, from JSON and from Criterion's folders.

use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

/// Rows of texts under named columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sheet {
    pub columns: Vec<String>,
    pub rows: Vec<Vec<String>>,
}

impl Sheet {
    /// Reads a file: `*.csv`; `*.md`, its first table; `FILE.json#/POINTER`, an array of objects; and any
    /// other path as the folder of Criterion. An error is one line.
    pub fn read(out: &Path, name: &str) -> Result<Self, String> {
        let (file, pointer) = name.split_once('#').unwrap_or((name, ""));
        let path = out.join(file);
        let text = || fs::read_to_string(&path).map_err(|error| format!("cannot read {}: {error}", path.display()));
        let sheet = match path.extension().and_then(|end| end.to_str()) {
            Some("csv") => Self::from_csv(&text()?),
            Some("md") => Some(Self::from_markdown(&text()?)),
            Some("json") => Self::from_json(&text()?, pointer),
            _ => Self::from_criterion(&path),
        };
        sheet.filter(|sheet| !sheet.rows.is_empty()).ok_or_else(|| format!("{} holds no rows", path.display()))
    }

    /// Lines that begin with `#` are left out.
    pub fn from_csv(text: &str) -> Option<Self> {
        let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(text.as_bytes());
        let texts = |record: &csv::StringRecord| record.iter().map(str::to_owned).collect();
        let columns = texts(reader.headers().ok()?);
        let rows = reader.records().map(|record| record.map(|record| texts(&record))).collect::<Result<_, _>>().ok()?;
        Some(Self { columns, rows })
    }

    /// The first table of a text; an empty sheet if there is none. Emphasis of cells is left out.
    pub fn from_markdown(text: &str) -> Self {
        let lines = text.lines().skip_while(|line| !line.starts_with('|')).take_while(|line| line.starts_with('|'));
        let cells = |line: &str| -> Vec<String> {
            let line = line.trim().trim_start_matches('|').trim_end_matches('|');
            line.split('|').map(|cell| cell.trim().trim_matches('*').to_owned()).collect()
        };
        let mut lines = lines.map(cells);
        let columns = lines.next().unwrap_or_default();
        Self { columns, rows: lines.skip(1).collect() }
    }

    /// Nested values have the names of all levels; an object in an array is named by its `name`.
    fn from_json(text: &str, pointer: &str) -> Option<Self> {
        let value: Value = serde_json::from_str(text).ok()?;
        let mut sheet = Self::default();
        for object in value.pointer(pointer)?.as_array()? {
            let mut fields = Vec::new();
            flatten(object, "", &mut fields);
            let mut row = vec![String::new(); sheet.columns.len()];
            for (name, value) in fields {
                match sheet.columns.iter().position(|column| *column == name) {
                    Some(at) => row[at] = value,
                    None => {
                        sheet.columns.push(name);
                        row.push(value);
                    }
                }
            }
            sheet.rows.push(row);
        }
        let width = sheet.columns.len();
        sheet.rows.iter_mut().for_each(|row| row.resize(width, String::new()));
        Some(sheet)
    }

    /// Medians in nanoseconds, by group, function and parameter, in the order in which they were measured;
    /// `elements` is the number that Criterion divides by.
    fn from_criterion(folder: &Path) -> Option<Self> {
        let json = |path: PathBuf| serde_json::from_str::<Value>(&fs::read_to_string(path).ok()?).ok();
        let mut found = Vec::new();
        for new in folders_named_new(folder) {
            let (id, estimates) = (json(new.join("benchmark.json"))?, json(new.join("estimates.json"))?);
            let text = |name: &str| id.get(name).and_then(Value::as_str).unwrap_or_default().to_owned();
            let elements = id.pointer("/throughput/Elements").map_or("1".into(), Value::to_string);
            let ns = estimates.pointer("/median/point_estimate")?.to_string();
            let measured = fs::metadata(new.join("estimates.json")).and_then(|data| data.modified()).ok()?;
            found.push((measured, vec![text("group_id"), text("function_id"), text("value_str"), elements, ns]));
        }
        found.sort();
        let columns = ["group", "function", "parameter", "elements", "ns"].map(String::from).to_vec();
        Some(Self { columns, rows: found.into_iter().map(|(_, row)| row).collect() })
    }
}

fn flatten(value: &Value, name: &str, fields: &mut Vec<(String, String)>) {
    let below = |key: &str| if name.is_empty() { key.to_owned() } else { format!("{name}.{key}") };
    match value {
        Value::Object(object) => object.iter().for_each(|(key, value)| flatten(value, &below(key), fields)),
        Value::Array(array) => {
            for (index, value) in array.iter().enumerate() {
                let key = value.get("name").and_then(Value::as_str).map_or(index.to_string(), str::to_owned);
                flatten(value, &below(&key), fields);
            }
        }
        Value::Null => fields.push((name.to_owned(), String::new())),
        Value::String(text) => fields.push((name.to_owned(), text.clone())),
        other => fields.push((name.to_owned(), other.to_string())),
    }
}

/// The folders `new` below a folder.
fn folders_named_new(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let folders = entries.filter(|path| path.is_dir());
    folders.flat_map(|path| if path.ends_with("new") { vec![path] } else { folders_named_new(&path) }).collect()
}

#[cfg(test)]
mod tests {
    use super::Sheet;

    fn sheet(columns: &[&str], rows: &[&[&str]]) -> Sheet {
        let texts = |cells: &[&str]| cells.iter().map(|cell| (*cell).to_owned()).collect();
        Sheet { columns: texts(columns), rows: rows.iter().map(|row| texts(row)).collect() }
    }

    #[test]
    fn all_forms_give_the_same_rows() {
        let expected = sheet(&["scene", "sigma"], &[&["city S", "0.8"], &["a, b", "1"]]);
        assert_eq!(Sheet::from_csv("scene,sigma\ncity S,0.8\n\"a, b\",1\n"), Some(expected.clone()));
        let markdown = "text\n\n| scene | sigma |\n|---|---:|\n| city S | **0.8** |\n| a, b | 1 |\n\n| other |\n";
        assert_eq!(Sheet::from_markdown(markdown), expected);
        assert_eq!(Sheet::from_csv("a,b\n1\n"), None, "a row is short");
    }

    #[test]
    fn nested_json_has_the_names_of_all_levels() {
        let text =
            r#"{"rows": [{"n": 1, "stages": [{"name": "sort", "time": {"median": 0.5}}]}, {"n": 2, "refused": "no"}]}"#;
        let read = Sheet::from_json(text, "/rows").expect("an array");
        let columns = ["n", "stages.sort.name", "stages.sort.time.median", "refused"];
        assert_eq!(read, sheet(&columns, &[&["1", "sort", "0.5", ""], &["2", "", "", "no"]]));
        assert_eq!(Sheet::from_json(text, "/none"), None);
    }
}
