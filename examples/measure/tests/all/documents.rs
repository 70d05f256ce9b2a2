//! The program on copies of the documents, with raw files that no program wrote.

use measure::documents::document::{block, replaced};
use measure::documents::list::FIGURES;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A folder that holds copies of all documents, and is removed in the end.
struct Copies(PathBuf);

impl Copies {
    fn new(name: &str) -> Self {
        let root = std::env::temp_dir().join(format!("girandole_figures_{name}_{}", std::process::id()));
        for page in FIGURES.iter().filter(|figure| !figure.is_file()).map(|figure| figure.page) {
            let to = root.join(page);
            fs::create_dir_all(to.parent().expect("a folder")).expect("a folder to write to");
            fs::copy(Path::new("../..").join(page), to).expect("a page of the repository");
        }
        Self(root)
    }

    fn page(&self) -> String {
        fs::read_to_string(self.0.join("docs/benchmarks.md")).expect("a document")
    }

    fn raw(&self, file: &str, text: &str) {
        let path = self.0.join("raw").join(file);
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder to write to");
        fs::write(path, text).expect("a file to write to");
    }

    fn run(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_measure"));
        command.arg("documents").arg("--root").arg(&self.0).arg("--out").arg(self.0.join("raw")).args(arguments);
        command.output().expect("the program starts")
    }
}

impl Drop for Copies {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn texts(output: &Output) -> [String; 2] {
    [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned())
}

#[test]
fn a_block_is_replaced_and_figures_without_raw_files_keep_theirs() {
    let copies = Copies::new("replaced");
    copies.raw(
        "cliffs/cliffs.csv",
        "scene,sampler,sigma_mean\n\"a hill, or two\",girandole,0.5\n\"a hill, or two\",girandole flat,0.25\n",
    );
    copies.raw("budget/gap_S10.svg", "<svg/>");
    for run in ["cliffs", "budget"] {
        let origin = r#"{"machine": "a machine", "date": "2026-01-02", "commit": "abc"}"#;
        copies.raw(&format!("{run}/origin.json"), origin);
    }
    let before = copies.page();
    let output = copies.run(&["--draw", "--only", "cliffs,budget-plot,torture"]);
    let [stdout, stderr] = texts(&output);
    assert!(output.status.success() && stderr.is_empty(), "{stderr}");
    assert_eq!(stdout, "torture: kept, for the run \"torture\" is missing\n");
    let table = "# `measure noise cliffs` on a machine, 2026-01-02, commit abc.\n\
                 scene,sampler,sigma_mean\n\"a hill, or two\",girandole,0.5\n\"a hill, or two\",girandole flat,0.25\n";
    assert_eq!(fs::read_to_string(copies.0.join("docs/data/cliffs.csv")).expect("a table"), table);
    let expected = "![Gap recovered over time spent for five motions, by strategy: the library's scheduler is ahead of\n\
                    round robin where time is short](budget.svg)\n\n";
    let page = copies.page();
    let block = block(&page, "budget-plot").expect("a block");
    assert!(block.starts_with(expected) && block.ends_with(" on a machine, 2026-01-02, commit abc.\n"), "{block}");
    assert_eq!(page, replaced(&before, "budget-plot", block).expect("a block"));
}

#[test]
fn what_does_not_fit_is_one_error_line() {
    let copies = Copies::new("misfits");
    let page = copies.0.join("docs/benchmarks.md");
    let refused = |arguments: &[&str], reason: &str| {
        let output = copies.run(arguments);
        let [_, stderr] = texts(&output);
        assert_eq!(output.status.code(), Some(2), "{stderr}");
        assert!(stderr.contains(reason) && stderr.lines().count() == 1, "{stderr}");
    };
    refused(&["--only", "nothing"], "there is no figure \"nothing\"");
    let gpu = copies.0.join("gpu.json");
    fs::write(&gpu, r#"{"adapter": {"name": "a GPU", "driver_info": "1"}, "date": "2026-01-02"}"#).expect("a file");
    refused(&["--draw", "--gpu", gpu.to_str().expect("a plain path")], "does not say /commit");
    let text = copies.page();
    fs::write(&page, format!("{text}\n<!-- figure: stray -->\n<!-- end -->\n")).expect("a file");
    refused(&["--draw"], "the block \"stray\" has no figure");
    fs::write(&page, text.replace("<!-- figure: summary -->", "")).expect("a file");
    refused(&["--draw"], "the figure \"summary\" has no block");
}

#[test]
fn a_program_that_is_missing_is_one_error_line() {
    let copies = Copies::new("missing");
    let nowhere = copies.0.join("nowhere");
    let output = copies.run(&["--only", "cliffs", "--programs", nowhere.to_str().expect("a plain path")]);
    let [_, stderr] = texts(&output);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr.contains("cliffs: cannot start") && stderr.lines().count() == 1, "{stderr}");
}
