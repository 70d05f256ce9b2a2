//! The program that shows what accuracy costs in time.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use clap::Parser;

use measure::pictures::options::Options;
use measure::pictures::run::run;
use measure::pictures::settings::Sampler;

fn options(out: &Path, more: &[&str]) -> Options {
    let out = out.to_string_lossy();
    let arguments = ["pictures", "--quick", "--out", &out].into_iter().chain(more.iter().copied());
    Options::try_parse_from(arguments).expect("valid arguments")
}

fn folder(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("girandole_pictures_{name}_{}", std::process::id()))
}

/// The rows of a table by the value of its first column.
fn table(path: &Path) -> (Vec<String>, HashMap<String, Vec<String>>) {
    let mut reader = csv::Reader::from_path(path).expect("a table");
    let columns = reader.headers().expect("a line of names").iter().map(str::to_owned).collect();
    let rows = reader.records().map(|row| row.expect("a row").iter().map(str::to_owned).collect::<Vec<_>>());
    (columns, rows.map(|row| (row[0].clone(), row)).collect())
}

#[test]
fn a_quick_run_writes_tables_and_plots() {
    let out = folder("quick");
    let measured = run(&options(&out, &[])).expect("it runs");
    let (columns, rows) = table(&out.join("accuracy.csv"));
    let expected = "setting time_ms update_ms upload_ms top_level_ms choosing_ms shadow_rays_ms shading_ms sigma \
                    sigma_visible dead rel_mse rel_mse_low rel_mse_high mape mape_low mape_high memory_bytes on_front";
    assert_eq!(columns.join(" "), expected);
    assert_eq!(rows.len(), measured.rows.len(), "settings have names of their own");
    let number = |name: &str, column: &str| -> f64 {
        let index = columns.iter().position(|own| own == column).expect("a column");
        rows[name][index].parse().unwrap_or_else(|_| panic!("{name}: {column} is {:?}", rows[name][index]))
    };
    for name in rows.keys() {
        let stages = ["update_ms", "top_level_ms", "choosing_ms", "shadow_rays_ms", "shading_ms"];
        let upload = if rows[name][3].is_empty() { 0.0 } else { number(name, "upload_ms") };
        let sum: f64 = stages.iter().map(|stage| number(name, stage)).sum::<f64>() + upload;
        let time = number(name, "time_ms");
        // Numbers have four digits after the point.
        assert!((sum - time).abs() < 5.0e-4 && time > 0.0, "{name}: {sum}, {time}");
        for error in ["rel_mse", "mape"] {
            let [low, high] = ["low", "high"].map(|end| number(name, &format!("{error}_{end}")));
            let mean = number(name, error);
            assert!(0.0 < low && low <= mean && mean <= high, "{name}: {error}");
        }
    }
    // The exact noise does not depend on random numbers: with shadows there is more of it, and
    // splits lower it.
    let [default, no_splits] =
        ["Girandole / 6 splits / 1 candidate / 1 spp", "Girandole / 0 splits / 1 candidate / 1 spp"];
    assert!(number(default, "sigma") < number(default, "sigma_visible"));
    assert!(number(default, "sigma") < number(no_splits, "sigma"));
    assert!(number(default, "sigma") < 0.5 * number("pbrt-v4's formula, opaque / 1 spp", "sigma"));
    assert!((0.0..0.5).contains(&number(default, "dead")) && number("uniform / 1 spp", "dead") < 1.0e-3);

    // Instances share their trees. The lights alone have 64 bytes each.
    let [two, one] =
        [default, "Girandole, one tree / 6 splits / 1 candidate / 1 spp"].map(|name| number(name, "memory_bytes"));
    assert!(two < one && number("uniform / 1 spp", "memory_bytes") == 64.0 * measured.lights as f64);

    // A setting that is off by default changes the picture.
    let [off, solid_angles] =
        ["", " / solid angles"].map(|switch| format!("Girandole / 6 splits / 1 candidate / 4 spp{switch}"));
    assert_ne!(number(&off, "rel_mse"), number(&solid_angles, "rel_mse"));

    // Shared cuts have less noise, and take memory for their cells.
    let shared = "Girandole, shared cuts / 1 candidate / 1 spp";
    assert!(number(shared, "sigma") < number(default, "sigma"));
    assert!(number(shared, "memory_bytes") > two);
    // What is learnt lowers the noise with shadows, and takes memory.
    let [without, with] = ["shared", "learnt"].map(|cuts| format!("Girandole, {cuts} cuts / 1 candidate / 1 spp"));
    assert!(number(&with, "sigma_visible") < number(&without, "sigma_visible"));
    assert!(number(&with, "memory_bytes") > number(&without, "memory_bytes"));

    let front: Vec<_> = measured.rows.iter().filter(|row| row.on_front).collect();
    assert!(!front.is_empty());
    for row in &front {
        let is_better = |other: &&measure::pictures::table::Row| {
            let is_fair = !other.setting.change.is_biased() && other.time_ms() <= row.time_ms();
            is_fair && other.errors.rel_mse.mean < row.errors.rel_mse.mean
        };
        assert!(!measured.rows.iter().any(|other| is_better(&other)), "{:?}", row.setting);
    }
    for panel in &measured.equal_time {
        let times = [panel, &measured.equal_time[0]].map(|panel| panel.row.samples.total());
        let is_equal = (times[0] / times[1] - 1.0).abs() < 1.0e-6;
        assert!(is_equal || panel.row.setting.samples == 1.0, "{:?}: {times:?}", panel.row.setting);
    }
    let has = |sampler| measured.equal_time.iter().any(|panel| panel.row.setting.sampler == sampler);
    assert!(has(Sampler::Rival("regir")) && has(measure::pictures::settings::DEFAULT));
    // The panels are those of the best other samplers, worst first.
    let errors: Vec<f64> = measured.equal_time.iter().map(|panel| panel.row.errors.rel_mse.mean).collect();
    assert!(errors.len() == 10 && errors[..6].is_sorted_by(|a, b| a >= b), "{errors:?}");

    // The sum over all lights takes a hundred times the time of any other row. The plot names it
    // instead of stretching its axis.
    let all_lights = front.iter().any(|row| row.setting.sampler == Sampler::AllLights);
    let plot = fs::read_to_string(out.join("error_over_time.svg")).expect("a plot");
    assert!(all_lights && plot.contains("all lights: relMSE") && !plot.contains("\n100\n"));
    assert_eq!(fs::read_to_string(out.join("equal_time.svg")).expect("a figure").matches("<image").count(), 11);
    fs::remove_dir_all(&out).expect("the test made it");
}

#[test]
fn bad_arguments_and_scenes_are_refused_in_one_line() {
    for bad in [
        &["--out", "x", "--size", "8x8"][..],
        &["--out", "x", "--size", "huge"],
        &["--out", "x", "--pictures", "1"],
        &["--out", "x", "--passes", "0"],
        &["--out", "x", "--world", "XL"],
        &["--out", "x", "--gltf", "a.glb", "--lamps", "b.csv"],
        &[],
    ] {
        let error = Options::try_parse_from(["pictures"].iter().chain(bad)).expect_err("it is refused");
        let line = testbed::common::exit::one_line(&error);
        assert!(!line.is_empty() && !line.contains('\n'), "{line}");
    }
    let out = folder("refused");
    fs::create_dir_all(&out).expect("a writable folder");
    fs::write(out.join("accuracy.csv"), "of an earlier run").expect("a writable folder");
    for (more, cause) in [
        (&["--gltf", "/nowhere/at/all.glb"][..], "/nowhere/at/all.glb"),
        // From above the clouds, away from the ground.
        (&["--camera", "0,9000,0,0,9999,1"], "no surface"),
    ] {
        let error = run(&options(&out, more)).err().expect("it is refused").to_string();
        assert!(error.contains(cause) && !error.contains('\n'), "{error}");
    }
    assert_eq!(fs::read_to_string(out.join("accuracy.csv")).expect("it is still there"), "of an earlier run");
    fs::remove_dir_all(&out).expect("the test made it");
}
