//! Comments and documents cite records of decisions by numbers that exist.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use super::references::files;

/// The number that a text begins with.
fn leading_number(text: &str) -> Option<u32> {
    text[..text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len())].parse().ok()
}

/// The numbers that begin titles of a page in `docs`. No number begins two of them.
fn records(page: &str) -> BTreeSet<u32> {
    let titles = page.lines().filter(|line| line.starts_with('#')).map(|line| line.trim_start_matches('#').trim());
    let mut records = BTreeSet::new();
    for number in titles.filter_map(leading_number) {
        assert!(records.insert(number), "two records have the number {number}");
    }
    records
}

/// The numbers that the archive's table says no longer name a record.
fn former_records(archive: &str) -> BTreeSet<u32> {
    let (_, table) = archive.split_once("## Numbers that are no longer records").expect("the table");
    let rows = table.lines().skip_while(|line| !line.starts_with('|')).take_while(|line| line.starts_with('|')).skip(2);
    let cells = rows.map(|row| row.split('|').nth(1).expect("a first cell"));
    cells.flat_map(|cell| cell.split(',').map(|number| number.trim().parse().expect("a number"))).collect()
}

/// A text without breaks of lines and marks of comments, so that no citation is divided.
fn in_one_line(text: &str) -> String {
    let lines = text.lines().map(|line| line.trim_start().trim_start_matches(['/', '!', '#']).trim());
    lines.collect::<Vec<_>>().join(" ")
}

/// The texts of all files in these folders, with their names.
fn texts(folders: &[&str]) -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let paths = folders.iter().flat_map(|folder| files(&root.join(folder)));
    // Pictures and data are no text.
    let texts = paths.filter_map(|path| Some((path.display().to_string(), fs::read_to_string(path).ok()?)));
    texts.collect()
}

/// The text of a page in `docs`.
fn page(name: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs").join(name)).expect("a page")
}

#[test]
fn every_record_that_a_source_cites_holds() {
    let (holding, archived) = (records(&page("decisions.md")), records(&page("decisions-archive.md")));
    let mut count = 0;
    let mut wrong = Vec::new();
    for (name, text) in texts(&["src", "shaders", "tests", "benches", "examples"]) {
        let text = in_one_line(&text);
        for (page, known) in [("decisions.md, ", &holding), ("decisions-archive.md, ", &archived)] {
            for number in text.split(page).skip(1).filter_map(leading_number) {
                count += 1;
                if !known.contains(&number) {
                    wrong.push(format!("{name} cites {page}{number}"));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(count > 15, "only {count} citations were found");
}

#[test]
fn every_number_that_a_document_cites_is_that_of_a_record_or_in_the_table_of_the_archive() {
    let (holding, former) = (records(&page("decisions.md")), former_records(&page("decisions-archive.md")));
    assert!(holding.is_disjoint(&former), "records that hold are in the table: {former:?}");
    let known = &holding | &former;
    let mut count = 0;
    let mut wrong = Vec::new();
    for (name, text) in texts(&["docs"]).into_iter().filter(|(name, _)| name.ends_with(".md")) {
        for number in in_one_line(&text).to_lowercase().split("decision ").skip(1).filter_map(leading_number) {
            count += 1;
            if !known.contains(&number) {
                wrong.push(format!("{name} cites decision {number}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(count > 15, "only {count} citations were found");
}
