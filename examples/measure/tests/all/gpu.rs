//! The tool that times a GPU writes all rows, and counts bytes, dispatches and nodes. Times are not
//! tested.

use serde_json::Value;
use testbed::common::batch::SampleRequest;

use measure::gpu::goals::{self, Outcome, Verdict};
use measure::gpu::run::{Options, run};

fn number(row: &Value, name: &str) -> f64 {
    row[name].as_f64().unwrap_or_else(|| panic!("no {name} in {row}"))
}

/// Asserts that each row has all of `names`, with values above 0.
fn assert_positive(rows: &[Value], names: &[&str]) {
    for (row, name) in rows.iter().flat_map(|row| names.iter().map(move |name| (row, name))) {
        assert!(number(row, name) > 0.0, "{name} in {row}");
    }
}

/// Whether a measurement has its least, median and greatest time in rising order.
fn is_time(time: &Value) -> bool {
    ["least_ms", "median_ms", "greatest_ms"].map(|name| number(time, name)).is_sorted()
}

#[test]
fn the_timings_have_every_row_and_count_bytes_dispatches_and_nodes() {
    let out = std::env::temp_dir().join(format!("girandole_gpu_timings_{}.json", std::process::id()));
    run(&Options { out: out.clone(), quick: true, only: Vec::new(), adapter: None }).expect("the tool runs");
    let text = std::fs::read_to_string(&out).expect("the tool has written the file");
    std::fs::remove_file(&out).expect("the test made the file");
    let all: Value = serde_json::from_str(&text).expect("the file is JSON");
    let rows = |name: &str| all[name].as_array().unwrap_or_else(|| panic!("no {name}")).as_slice();

    let said = |name: &str| all[name].as_str().unwrap_or_else(|| panic!("no {name}"));
    assert!(said("date").len() == 10 && !said("commit").is_empty(), "{} {}", said("date"), said("commit"));

    let checks = rows("checks");
    assert!(checks.len() >= 3 && checks.iter().all(|check| check["passed"] == true), "{checks:?}");

    let uploads = rows("upload");
    assert_positive(uploads, &["instances", "percent_moved", "moved", "bytes"]);
    let moved: Vec<_> = uploads.iter().map(|row| number(row, "moved")).collect();
    assert_eq!(moved, [10.0, 100.0, 1000.0]);
    // One record for each moved instance, and its place where many are scattered. An instance that turns up elsewhere
    // may change two nodes of the top level, of 112 bytes.
    for row in uploads {
        let bytes = number(row, "bytes") / number(row, "moved");
        assert!((160.0..=160.0 + 4.0 + 2.0 * 112.0).contains(&bytes), "{row}");
    }
    assert!(uploads.iter().all(|row| is_time(&row["upload_call"]) && is_time(&row["submit_and_wait"])));

    let tops = rows("top_level");
    assert_positive(tops, &["instances", "dispatches"]);
    assert_eq!(tops.len(), 2);
    for top in tops {
        let stages = top["stages"].as_array().expect("stages");
        assert_positive(stages, &["dispatches"]);
        let sum: f64 = stages.iter().map(|stage| number(stage, "dispatches")).sum();
        assert_eq!(sum, number(top, "dispatches"));
        let names: Vec<_> = stages.iter().filter_map(|stage| stage["name"].as_str()).collect();
        assert!(names.len() >= 4 && names.contains(&"sort"), "{names:?}");
        assert!(is_time(&top["total"]));
    }

    let samplings = rows("sampling");
    assert_positive(samplings, &["lights", "instances", "width", "height"]);
    let candidates: Vec<_> = samplings.iter().map(|row| number(row, "candidates")).collect();
    assert_eq!(candidates, [1.0, 8.0]);
    assert!(samplings.iter().all(|row| is_time(&row["picture"])));
}

#[test]
fn goals_are_met_up_to_their_limit_and_times_are_not_judged_on_software() {
    let verdict = |measured, is_time| Verdict { goal: String::new(), most: 2.0, measured, is_time };
    assert_eq!(verdict(Some(2.0), true).outcome(false), Outcome::Met);
    assert_eq!(verdict(Some(2.1), true).outcome(false), Outcome::Missed);
    assert_eq!(verdict(Some(2.1), true).outcome(true), Outcome::Software);
    assert_eq!(verdict(Some(2.1), false).outcome(true), Outcome::Missed);
    assert_eq!(verdict(None, true).outcome(false), Outcome::NotMeasured);
    assert!(goals::verdicts(&[], &[]).iter().all(|verdict| verdict.measured.is_none()));
}

#[test]
fn an_adapter_that_does_not_exist_is_refused_by_name() {
    let out = std::env::temp_dir().join(format!("girandole_no_adapter_{}.json", std::process::id()));
    let error =
        run(&Options { out: out.clone(), quick: true, only: Vec::new(), adapter: Some("no such thing".into()) });
    std::fs::remove_file(&out).expect("the test made the file");
    assert!(error.expect_err("there is no such adapter").0.starts_with("no adapter named no such thing"));
}

#[test]
fn the_shader_and_the_host_agree_on_sizes() {
    let text = girandole::gpu::wgsl(1, girandole::Effects::all())
        + "const CANDIDATES = 8u;\n"
        + include_str!("../../../testbed/src/common/request.wgsl")
        + include_str!("../../src/gpu/sample.wgsl");
    let module = naga::front::wgsl::parse_str(&text).map_err(|e| e.emit_to_string(&text)).expect("the shader parses");
    assert_eq!(module.entry_points[0].workgroup_size, [measure::gpu::sampling::LANES, 1, 1]);
    let (_, request) =
        module.types.iter().find(|(_, t)| t.name.as_deref() == Some("Request")).expect("the shader has requests");
    let naga::TypeInner::Struct { span, .. } = &request.inner else { panic!("Request is a struct") };
    assert_eq!(*span as usize, size_of::<SampleRequest>());
}
