//! The comparison of samplers in the city example.

use city::app::compare::measure::{Plan, SAMPLERS, SampleTimes};
use city::app::compare::report::COLUMNS;
use city::app::compare::run::compare;
use city::app::options::{Options, Parsed};
use city::app::session::Session;
use std::fs;
use std::path::Path;
use std::time::Duration;
use testbed::render::backend;
use testbed::render::settings::LightChoice;

fn options(arguments: &str) -> Options {
    match Options::read(std::iter::once("city").chain(arguments.split_whitespace())) {
        Ok(Parsed::Run(options)) => *options,
        Ok(Parsed::Help(text)) => panic!("{text}"),
        Err(error) => panic!("{error}"),
    }
}

/// By how much the relMSE of uniform choices exceeds that of Girandole with these seeds, at least.
const LEAST_FACTOR: f64 = 4.0;

#[test]
fn girandole_has_less_error_than_uniform_choices_with_four_times_the_samples() {
    let options = options("--compare --size 64x36 --spp 4");
    let stage = options.scene.load(options.size).expect("the city");
    let plan = Plan::new(&options.settings(), stage.world.light_count());
    let mut session =
        Session::new(stage, options.settings(), options.pace(), backend::cpu("a test")).expect("a valid scene");
    session.advance().expect("a valid scene");
    // Fixed times, so that the numbers of samples do not depend on the machine.
    let times = SampleTimes { seconds: [0.25, 0.5, 0.6, 1.0, 1.0, 1.0], builds: [Duration::ZERO; SAMPLERS.len()] };
    let comparison = plan.run_with(&times, &mut session, &|_| {}).expect("a scene that is not black");
    let samples: Vec<u32> = comparison.rows.iter().map(|row| row.samples).collect();
    assert_eq!(samples, [4, 2, 1, 1, 1, 1, 8, 4, 3, 2, 2, 2, 16, 8, 6, 4, 4, 4]);
    let error = |sampler| {
        let row = comparison.rows.iter().rfind(|row| row.sampler == sampler).expect("a row for each sampler");
        row.score.rel_mse
    };
    let factor = error(LightChoice::Uniform) / error(LightChoice::Girandole);
    assert!(factor > LEAST_FACTOR, "a factor of {factor}");
    assert!(comparison.reference_error < error(LightChoice::Girandole) / 8.0, "{}", comparison.reference_error);
}

#[test]
fn a_comparison_writes_all_files() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("compare-{}", std::process::id()));
    let small = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/small.gltf");
    let mut lines = Vec::new();
    let arguments =
        format!("--compare --sum --size 32x18 --spp 2 --gltf {} --out {}", small.display(), folder.display());
    compare(&options(&arguments), &mut |line| lines.push(line.to_owned())).expect("a comparison that runs");
    assert!(lines.iter().any(|line| line.contains("sum over all lights, 2 samples per pixel")), "{lines:?}");
    let mut table = csv::Reader::from_path(folder.join("compare.csv")).expect("the table");
    assert_eq!(table.headers().expect("columns"), &COLUMNS[..]);
    let rows: Vec<csv::StringRecord> = table.records().map(|row| row.expect("a complete row")).collect();
    // Two times, and six samplers in each.
    assert_eq!(rows.len(), 12);
    for (row, sampler) in
        rows.iter().zip(["uniform", "flux", "pbrt", "sg-tree", "shared-cuts", "girandole"].iter().cycle())
    {
        assert_eq!(&row[0], *sampler);
        assert!(row.iter().skip(1).all(|field| field.parse::<f64>().is_ok_and(|value| value > 0.0)), "{row:?}");
    }
    let svg = |name: &str| fs::read_to_string(folder.join(name)).expect("an SVG file");
    assert_eq!(svg("compare.svg").matches("<image ").count(), 7);
    assert!(svg("compare.svg").contains("sum over all lights") && svg("compare.svg").contains("relMSE"));
    assert!(svg("compare_error.svg").contains("pbrt-v4"));
    for name in ["uniform", "flux", "pbrt", "sg-tree", "shared-cuts", "girandole", "reference"] {
        let file = fs::File::open(folder.join(format!("compare_{name}.png"))).expect("a picture");
        let png = png::Decoder::new(std::io::BufReader::new(file)).read_info().expect("a PNG");
        assert_eq!((png.info().width, png.info().height), (32, 18));
    }
    fs::remove_dir_all(&folder).expect("a folder that exists");
}
