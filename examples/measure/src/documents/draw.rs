//! Draws figures from raw files, and compares them with those of a document.

use super::document::wrapped;
use super::figure::{Body, Figure, Run};
use super::measure::origin_of;
use super::sheet::Sheet;
use super::view::Rendered;
use std::path::Path;

/// A figure as it stands in a document.
pub struct Drawn {
    /// The content of the block.
    pub content: String,
    /// `None` for a picture.
    pub table: Option<Rendered>,
}

/// Draws a figure. An error is one line.
pub fn draw(figure: &Figure, out: &Path, runs: &[Run]) -> Result<Drawn, String> {
    let (content, table) = match figure.body {
        Body::Rows(from) => (String::new(), Some(Rendered::of(Sheet::read(out, from)?))),
        Body::Picture { to, text, .. } => (wrapped(&format!("![{text}]({to})")), None),
        Body::Table(views) => {
            let mut whole: Option<Rendered> = None;
            for view in views {
                let sheets = view.from.iter().map(|file| with_run(Sheet::read(out, file)?, file));
                let rendered = view.render(&sheets.collect::<Result<Vec<_>, String>>()?)?;
                match &mut whole {
                    Some(table) => table.append(rendered)?,
                    None => whole = Some(rendered),
                }
            }
            let table = whole.ok_or("it has no view")?;
            (table.markdown().trim_end().to_owned(), Some(table))
        }
    };
    let origin = origin(figure, out, runs)?;
    let content = match table.as_ref().filter(|_| figure.is_file()) {
        Some(table) => table.csv(&origin),
        None => format!("{content}\n\n{}\n", wrapped(&origin)),
    };
    Ok(Drawn { content, table })
}

/// Adds a column that names the run.
fn with_run(mut sheet: Sheet, file: &str) -> Result<Sheet, String> {
    let run = file.split('/').next().unwrap_or_default();
    sheet.columns.push("run".to_owned());
    sheet.rows.iter_mut().for_each(|row| row.push(run.to_owned()));
    Ok(sheet)
}

/// The sentences below a figure, or at the top of its file: where, when, from which commit and by which calls.
fn origin(figure: &Figure, out: &Path, runs: &[Run]) -> Result<String, String> {
    let mut said: Vec<(String, Vec<String>)> = Vec::new();
    for name in figure.runs() {
        let [machine, date, commit] = origin_of(out, name).ok_or_else(|| format!("there is no run \"{name}\""))?;
        let place = format!("{machine}, {date}, commit {commit}");
        let call = runs.iter().find(|run| run.name == name).map_or_else(|| name.to_owned(), Run::call);
        match said.iter_mut().find(|(own, _)| *own == place) {
            Some((_, calls)) => calls.push(format!("`{call}`")),
            None => said.push((place, vec![format!("`{call}`")])),
        }
    }
    let parts: Vec<String> = said.iter().map(|(place, calls)| format!("{} on {place}.", calls.join(", "))).collect();
    Ok(parts.join(" "))
}

/// What a small version of a figure shows of the one in a document: whether columns and names of rows are
/// the same. Columns and rows whose names contain `absent` are left out. An error is one line.
pub fn compare(old: &Sheet, new: &Rendered, absent: Option<&str>, has_all_rows: bool) -> Result<(), String> {
    let is_there = |text: &&String| absent.is_none_or(|absent| !text.contains(absent));
    let heads = [&old.columns, &new.head].map(|head| head.iter().filter(is_there).cloned().collect::<Vec<_>>());
    if heads[0] != heads[1] {
        return Err(format!("the document has the columns {:?}, the program {:?}", heads[0], heads[1]));
    }
    let names = |rows: &[Vec<String>]| -> Vec<String> {
        let names = rows.iter().map(|row| row[..new.keys.min(row.len())].join(", ").replace('*', ""));
        names.filter(|name| is_there(&name)).collect()
    };
    let [old, new] = [names(&old.rows), names(&new.rows)];
    let unknown: Vec<&String> = new.iter().filter(|name| !old.contains(name)).collect();
    let missing: Vec<&String> = old.iter().filter(|name| has_all_rows && !new.contains(name)).collect();
    match (&unknown[..], &missing[..]) {
        ([], []) => Ok(()),
        _ => Err(format!("the document lacks the rows {unknown:?}, and the program {missing:?}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(head: &[&str], names: &[&str]) -> Rendered {
        let texts = |all: &[&str]| all.iter().map(|text| (*text).to_owned()).collect::<Vec<_>>();
        Rendered { keys: 1, head: texts(head), rows: names.iter().map(|name| texts(&[name, "7"])).collect() }
    }

    #[test]
    fn other_columns_and_other_names_of_rows_are_found_but_not_other_values() {
        let old = "| scene | σ |\n|---|---:|\n| city S | **1** |\n| Bistro | 2 |\n";
        let compare = |new: &Rendered, absent, all| compare(&Sheet::from_markdown(old), new, absent, all);
        assert!(compare(&table(&["scene", "σ"], &["city S", "Bistro"]), None, true).is_ok());
        assert!(compare(&table(&["scene", "σ"], &["city S"]), Some("Bistro"), true).is_ok());
        assert!(compare(&table(&["scene", "σ"], &["city S"]), None, false).is_ok());
        assert!(compare(&table(&["scene", "σ"], &["city S"]), None, true).is_err());
        assert!(compare(&table(&["scene", "σ"], &["city S", "Bistro", "swarm"]), None, true).is_err());
        assert!(compare(&table(&["scene", "noise"], &["city S", "Bistro"]), None, true).is_err());
    }
}
