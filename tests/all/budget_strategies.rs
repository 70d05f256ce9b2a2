//! The example that measures what a budget for rebuilds buys: its ends are where they belong, and it repeats.

use crate::city::scene;
use crate::variance::{lights, sigma};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

#[path = "../../examples/tools/budget/modules.rs"]
#[allow(dead_code, missing_docs, reason = "a program")]
pub mod program;

use program::costs::Costs;
use program::motion::Motion;
use program::options::{Options, run};
use program::run::{Plan, measure};
use program::stage::SceneKind;
use program::strategies::Strategy;

fn folder(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("girandole_budget_{name}_{}", std::process::id()))
}

fn plan(strategies: &[Strategy], shares: &[f64]) -> Plan {
    let [shares, ss_shares] = [shares.to_vec(), shares.to_vec()];
    Plan { strategies: strategies.to_vec(), shares, ss_shares, frames: 12, every: 6, shading_points: 6 }
}

/// A table's lines by the names of its columns.
fn table(path: &Path) -> Vec<HashMap<String, String>> {
    let mut reader = csv::Reader::from_path(path).expect("a table");
    reader.deserialize().map(|line| line.expect("a line of text")).collect()
}

#[test]
fn the_tables_have_every_column_and_row_and_the_plots_are_drawn() {
    let out = folder("tables");
    std::fs::create_dir_all(&out).expect("a folder");
    let costs = out.join("plain.csv");
    Costs::plain().write(&costs).expect("written");
    let options = Options {
        out: Some(out.clone()),
        quick: true,
        costs: Some(costs.clone()),
        scene: vec!["S10".into()],
        motion: vec!["smooth".into()],
        strategies: vec!["round".into(), "SS 2 overlap".into()],
        frames: Some(12),
        shading_points: Some(4),
        fit: false,
        stages: None,
    };
    run(&options).expect("it runs");
    let rows = table(&out.join("budget.csv"));
    // Both ends, three budgets for the one, none and one for the other.
    assert_eq!(rows.len(), 2 + 3 + 2);
    let columns = "scene,motion,strategy,budget_share,gap_recovered,cost_share,within_budget,worst_overrun_us,longest_wait_frames";
    let text = std::fs::read_to_string(out.join("budget.csv")).expect("it has written");
    assert_eq!(text.lines().next(), Some(columns));
    assert!(table(&out.join("over_time.csv")).len() >= rows.len());
    assert_eq!(table(&out.join("scenes.csv")).len(), 1);
    assert_eq!(Costs::read(&out.join("costs.csv")).expect("costs"), Costs::read(&costs).expect("costs"));
    for plot in ["gap_S10.svg", "noise_S10.svg"] {
        let text = std::fs::read_to_string(out.join(plot)).expect("it has drawn");
        assert!(text.contains("round robin") && text.contains("<polyline"), "{plot}");
    }
    std::fs::remove_dir_all(&out).expect("it is ours");
}

#[test]
fn strategies_lie_between_both_ends_keep_to_their_budgets_and_repeat() {
    let costs = Arc::new(Costs::plain());
    let strategies = [Strategy::RoundRobin, Strategy::OldestFirst, Strategy::GirandoleUsage, Strategy::Oracle];
    let plan = plan(&strategies, &[0.0, 0.5]);
    let first = measure(SceneKind::S10, Motion::Smooth, &plan, &costs).expect("it runs");
    assert_eq!(first, measure(SceneKind::S10, Motion::Smooth, &plan, &costs).expect("it runs"));
    let (scene, rows) = first;
    // Every light of a tree takes a microsecond, and all trees move in every frame.
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
        // Large trees are built on the side, as much time again for those of the library; the last is paid for later.
        assert!(row.cost_share > 0.0 && row.cost_share < 1.5, "{name}: {}", row.cost_share);
        assert!(row.gap_recovered != 0.0 && row.gap_recovered.is_finite(), "{name}");
        if name != "girandole usage" {
            // They know the costs, which do not vary.
            assert_eq!((row.within_budget, row.worst_overrun_us), (1.0, 0.0), "{name}");
        }
    }
}

#[test]
fn names_that_nothing_has_are_refused() {
    let out = folder("refusals");
    let options = Options {
        out: Some(out),
        quick: true,
        costs: None,
        scene: vec!["XXL".into()],
        motion: Vec::new(),
        strategies: Vec::new(),
        frames: None,
        shading_points: None,
        fit: false,
        stages: None,
    };
    let error = run(&options).expect_err("there is none").to_string();
    assert!(error.contains("XXL") && error.contains("S10"), "{error}");
    let options = Options { scene: Vec::new(), costs: Some("/nowhere/at/all.csv".into()), ..options };
    let error = run(&options).expect_err("there is none").to_string();
    assert!(error.contains("/nowhere/at/all.csv"), "{error}");
}
