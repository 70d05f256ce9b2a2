//! The strategies and the tables of the budget example, which measures how much noise rebuilds
//! within a time budget remove.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use measure::rebuilds::costs::Costs;
use measure::rebuilds::motion::Motion;
use measure::rebuilds::options::{Options, run};
use measure::rebuilds::run::{Plan, measure};
use measure::rebuilds::stage::SceneKind;
use measure::rebuilds::strategies::Strategy;

fn folder(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("girandole_budget_{name}_{}", std::process::id()))
}

fn plan(strategies: &[Strategy], shares: &[f64]) -> Plan {
    let [shares, ss_shares] = [shares.to_vec(), shares.to_vec()];
    Plan { strategies: strategies.to_vec(), shares, ss_shares, frames: 12, every: 6, shading_points: 6, seed: 1 }
}

/// The rows of a CSV file, by the names of its columns.
fn table(path: &Path) -> Vec<HashMap<String, String>> {
    let mut reader = csv::Reader::from_path(path).expect("a CSV file");
    reader.deserialize().map(|line| line.expect("a valid row")).collect()
}

#[test]
fn the_tables_have_every_column_and_row_and_the_plot_is_drawn() {
    let out = folder("tables");
    std::fs::create_dir_all(&out).expect("a folder");
    let costs = out.join("plain.csv");
    Costs::plain().write(&costs).expect("written");
    let options = Options {
        out: out.clone(),
        cases: false,
        quick: true,
        costs: Some(costs.clone()),
        scene: vec!["S10".into()],
        motion: vec!["smooth".into()],
        strategies: vec!["round".into(), "SS 2 overlap".into()],
        shares: vec![0.2],
        seed: 1,
        frames: Some(12),
        shading_points: Some(4),
    };
    run(&options).expect("the example runs");
    let rows = table(&out.join("budget.csv"));
    // The two ends of the gap, one budget of round robin, and two of the algorithm of SS: one and
    // none.
    let shares: Vec<&str> = rows.iter().map(|row| row["budget_share"].as_str()).collect();
    assert_eq!(shares, ["0", "inf", "0.2", "inf", "0.2"]);
    let columns = "scene,motion,strategy,budget_share,gap_recovered,cost_share,within_budget,worst_overrun_us,longest_wait_frames";
    let text = std::fs::read_to_string(out.join("budget.csv")).expect("the table was written");
    assert_eq!(text.lines().next(), Some(columns));
    assert_eq!(table(&out.join("scenes.csv")).len(), 1);
    assert_eq!(Costs::read(&out.join("costs.csv")).expect("costs"), Costs::read(&costs).expect("costs"));
    let plot = std::fs::read_to_string(out.join("gap_S10.svg")).expect("the plot was drawn");
    assert!(plot.contains("round robin") && plot.contains("<polyline"), "{plot}");
    std::fs::remove_dir_all(&out).expect("the folder of the test");
}

#[test]
fn rows_of_unknown_kinds_of_work_are_skipped_and_missing_kinds_are_an_error() {
    let out = folder("kinds");
    std::fs::create_dir_all(&out).expect("a folder");
    let path = out.join("costs.csv");
    Costs::plain().write(&path).expect("written");
    let text = std::fs::read_to_string(&path).expect("readable text");
    std::fs::write(&path, format!("{text}part,64,12\nsnapshot,64,3\n")).expect("written");
    assert_eq!(Costs::read(&path).expect("costs"), Costs::plain());
    let builds: Vec<&str> = text.lines().filter(|line| !line.starts_with("refit")).collect();
    std::fs::write(&path, builds.join("\n")).expect("written");
    let error = Costs::read(&path).expect_err("no costs of refits").to_string();
    assert!(error.contains("refit"), "{error}");
    std::fs::remove_dir_all(&out).expect("the folder of the test");
}

#[test]
fn strategies_keep_to_their_budgets_and_repeat_exactly() {
    let costs = Arc::new(Costs::plain());
    let strategies = [
        Strategy::RoundRobin,
        Strategy::OldestFirst,
        Strategy::Girandole,
        Strategy::GirandoleInFrames,
        Strategy::Oracle,
    ];
    let plan = plan(&strategies, &[0.0, 0.5]);
    let first = measure(SceneKind::S10, Motion::Smooth, &plan, &costs).expect("the example runs");
    assert_eq!(first, measure(SceneKind::S10, Motion::Smooth, &plan, &costs).expect("the example runs"));
    let (scene, rows) = first;
    // A rebuild takes a microsecond per light, and all trees move in every frame.
    assert_eq!(scene.always_rebuild_us, scene.deforming_lights as f64);
    let [update, rebuild] = [&rows[0], &rows[1]];
    assert_eq!((update.gap_recovered, update.cost_share), (0.0, 0.0));
    assert_eq!((rebuild.gap_recovered, rebuild.cost_share, rebuild.longest_wait_frames), (1.0, 1.0, 0));
    for row in &rows[2..] {
        let name = &row.strategy;
        if row.budget_share == 0.0 {
            assert_eq!((row.gap_recovered, row.cost_share), (0.0, 0.0), "{name}");
            continue;
        }
        // Builds in the background add to the cost, and the last of them is paid for after the run.
        assert!(row.cost_share > 0.0 && row.cost_share < 1.5, "{name}: {}", row.cost_share);
        assert!(row.gap_recovered != 0.0 && row.gap_recovered.is_finite(), "{name}");
        if ![Strategy::Girandole, Strategy::GirandoleInFrames].iter().any(|strategy| *name == strategy.name()) {
            // These strategies know the costs, which are constant.
            assert_eq!((row.within_budget, row.worst_overrun_us), (1.0, 0.0), "{name}");
        }
    }
}

#[test]
fn unknown_scenes_and_missing_files_are_errors_that_name_them() {
    let out = folder("refusals");
    let options = Options {
        out,
        cases: false,
        quick: true,
        costs: None,
        scene: vec!["XXL".into()],
        motion: Vec::new(),
        strategies: Vec::new(),
        shares: Vec::new(),
        seed: 1,
        frames: None,
        shading_points: None,
    };
    let error = run(&options).expect_err("no such scene").to_string();
    assert!(error.contains("XXL") && error.contains("S10"), "{error}");
    let options = Options { scene: Vec::new(), costs: Some("/nowhere/at/all.csv".into()), ..options };
    let error = run(&options).expect_err("no such file").to_string();
    assert!(error.contains("/nowhere/at/all.csv"), "{error}");
}
