//! The program that repeats the experiment of SS, on a small city and few frames.

use clap::Parser;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

use measure::paper::options::{Options, run};

fn folder(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("girandole_paper_{name}_{}", std::process::id()))
}

/// The rows of a CSV file, by the names of its columns.
fn table(path: &Path) -> Vec<HashMap<String, String>> {
    let mut reader = csv::Reader::from_path(path).expect("a CSV file");
    reader.deserialize().map(|line| line.expect("a valid row")).collect()
}

fn number(row: &HashMap<String, String>, column: &str) -> f64 {
    row[column].parse().expect("a number")
}

fn options(out: &Path, more: &[&str]) -> Result<Options, String> {
    let out = out.to_str().expect("a plain path");
    let arguments = ["paper", "--out", out, "--quick"].into_iter().chain(more.iter().copied());
    Options::try_parse_from(arguments).map_err(|error| testbed::common::exit::one_line(&error))
}

#[test]
fn the_experiment_writes_all_tables_and_plots_and_repeats_its_errors() {
    let out = folder("all");
    let options = options(&out, &["--frames", "3", "--size", "16x9"]).expect("valid options");
    run(&options).expect("the program runs");
    let rows = table(&out.join("paper.csv"));
    // 22 rules on each of two kinds of trees, 4 budgets, and 6 runs with two levels.
    assert_eq!(rows.len(), 2 * 22 + 4 + 6);
    let named = |trees: &str, strategy: &str| {
        rows.iter().find(|row| row["trees"] == trees && row["strategy"].starts_with(strategy)).expect("a row")
    };
    for trees in ["binary tree", "girandole, one tree"] {
        let [update, rebuild] = [named(trees, "always update"), named(trees, "always rebuild")];
        assert_eq!((number(update, "rebuilds"), number(rebuild, "rebuilds")), (1.0, 3.0));
        assert_eq!((number(update, "cost_share"), number(rebuild, "cost_share")), (0.0, 1.0));
        assert!(number(update, "update_ms") > 0.0 && number(rebuild, "update_ms") == 0.0);
        for row in rows.iter().filter(|row| row["trees"] == trees) {
            assert!((1.0..=3.0).contains(&number(row, "rebuilds")) && number(row, "mape") > 0.0, "{row:?}");
            // Rebuilds of the same frame are timed once for all strategies.
            let is_rule = !row["strategy"].starts_with("budget");
            assert!(!is_rule || number(row, "rebuild_ms") <= number(rebuild, "rebuild_ms") + 1.0e-4, "{row:?}");
        }
    }
    // The quick city hardly moves, so that some kind of tree has no gap to recover.
    assert!(rows.iter().any(|row| row["gap_recovered"].is_empty()));
    for row in &rows {
        assert!(row.values().all(|field| field != "NaN"), "{row:?}");
        assert_eq!(row["gap_recovered"].is_empty(), row["gap_half_width"].is_empty(), "{row:?}");
    }
    assert_eq!(table(&out.join("frames.csv")).len(), 3 * rows.len());
    let text = std::fs::read_to_string(out.join("paper.md")).expect("the tables were written");
    assert!(text.contains("### city_S, binary tree") && text.contains("overlap, alg 1, SD "), "{text}");
    for trees in ["binary", "girandole"] {
        for attribute in ["distance", "overlap", "variance_of_lights", "splitting_cost"] {
            let plot = format!("frames_city_S_{trees}_{attribute}.svg");
            let text = std::fs::read_to_string(out.join(&plot)).expect("the plot was drawn");
            assert!(text.contains("MAPE") && text.contains("always rebuilt") && text.contains("<polyline"), "{plot}");
        }
    }
    // A logarithmic axis has no place for runs that never rebuild.
    let cost = std::fs::read_to_string(out.join("cost_city_S.svg")).expect("the plot was drawn");
    for trees in ["binary tree", "girandole, one tree"] {
        let free = |row: &&HashMap<String, String>| {
            row["trees"] == trees && row["strategy"] != "always update" && number(row, "cost_share") == 0.0
        };
        let count = rows.iter().filter(free).count();
        let note = format!("not shown: {count} run");
        assert!(count > 0 && cost.contains(&note), "{trees}: {count}");
    }
    run(&options).expect("the program runs");
    let again = table(&out.join("paper.csv"));
    for (row, again) in rows.iter().zip(&again).filter(|(row, _)| !row["strategy"].starts_with("budget")) {
        assert_eq!((&row["mape"], &row["rebuilds"]), (&again["mape"], &again["rebuilds"]));
    }
    // The budgets alone give the same errors for the same strategies.
    let options = Options { budgets: true, ..options };
    run(&options).expect("the program runs");
    let budgets = table(&out.join("paper.csv"));
    assert_eq!(budgets.len(), 2 + 4 + 6);
    for end in ["always update", "always rebuild"] {
        let end = budgets.iter().find(|row| row["trees"] == "girandole, one tree" && row["strategy"] == end);
        let end = end.expect("both ends");
        assert_eq!(end["mape"], named(&end["trees"], &end["strategy"])["mape"]);
    }
    std::fs::remove_dir_all(&out).expect("the folder of the test");
}

#[test]
fn bad_arguments_are_refused_in_one_line() {
    let out = folder("refusals");
    for (more, part) in [
        (&["--size", "4x9"][..], "from 8 to 4096 pixels"),
        (&["--size", "9"], "a width and a height"),
        (&["--fps", "0"], "0.01"),
        (&["--start", "-1"], "from 0 to 10000"),
        (&["--frames", "1"], "1 is not in 2"),
        (&["--seeds", "1"], "1 is not in 2"),
        (&["--path", "1,2,3"], "six numbers"),
        (&["--no-city"], "--gltf"),
    ] {
        let error = options(&out, more).expect_err("a bad argument");
        assert!(error.contains(part) && !error.contains('\n'), "{more:?}: {error}");
    }
    // Before the city plays, and before the tables of an earlier run are lost.
    std::fs::create_dir_all(&out).expect("a writable folder");
    std::fs::write(out.join("paper.csv"), "of an earlier run").expect("a writable folder");
    let missing = options(&out, &["--gltf", "/nowhere/at/all.glb"]).expect("valid options");
    let error = run(&missing).expect_err("no such file").to_string();
    assert!(error.contains("/nowhere/at/all.glb") && !error.contains('\n'), "{error}");
    assert_eq!(std::fs::read_to_string(out.join("paper.csv")).expect("it is still there"), "of an earlier run");
    std::fs::remove_dir_all(&out).expect("the folder of the test");
}
