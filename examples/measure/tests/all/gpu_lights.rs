//! The program as its users call it.

use std::process::Command;

fn call(arguments: &[&str], name: &str) -> (bool, String, String) {
    let out = std::env::temp_dir().join(format!("girandole_gpu_lights_{name}_{}.csv", std::process::id()));
    let output = Command::new(env!("CARGO_BIN_EXE_measure"))
        .args(["gpu-lights", "--out", &out.display().to_string()])
        .args(arguments)
        .output()
        .expect("the program runs");
    let csv = std::fs::read_to_string(&out).unwrap_or_default();
    let _ = std::fs::remove_file(&out);
    (output.status.success(), csv, String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn the_table_has_a_row_for_each_scene_and_rebuilds_and_leaves_are_near_fresh_builds() {
    let (is_fine, csv, errors) = call(&["--quick"], "noise");
    assert!(is_fine, "{errors}");
    let rows: Vec<Vec<&str>> = csv.lines().skip(1).map(|line| line.split(',').collect()).collect();
    let names: Vec<&str> = rows.iter().map(|row| row[0]).collect();
    assert_eq!(names, ["dancers", "dancers", "swirls", "swirls", "sparks", "sparks"]);
    let over_fresh: Vec<f64> = rows.iter().map(|row| row[4].parse().expect("a number")).collect();
    for scene in [0, 2] {
        // With rebuilds, trees are about as good as those that were built for the frame.
        assert!(over_fresh[scene + 1] < over_fresh[scene] && over_fresh[scene + 1] < 1.3, "{rows:?}");
    }
    assert!(over_fresh[4] < 1.6 && over_fresh[4] < over_fresh[5], "{rows:?}");
}

#[test]
fn a_refit_takes_few_dispatches_and_bytes() {
    let (is_fine, csv, errors) = call(&["--cost", "--quick"], "cost");
    assert!(is_fine, "{errors}");
    let row = csv.lines().nth(1).expect("a row").split(',').skip(1);
    let row: Vec<f64> = row.map(|number| number.parse().expect("a number")).collect();
    assert!(row[0] == 8.0 && row[2] <= 8.0 && row[3] < 3.0, "{row:?}");
    let (is_fine, _, errors) = call(&["--adapter", "no such adapter"], "refused");
    assert!(!is_fine && errors.lines().count() == 1, "{errors}");
}
