//! The measurements of `examples/measure/src/stability` in a quick run: what this library promises over scale,
//! distance from the origin and contrast, and that the program sees what breaks such a promise.

use std::path::Path;

use measure::stability::measure::{Measured, measure};
use measure::stability::options::{Options, measure_all};
use measure::stability::record::COLUMNS;
use measure::stability::sweep::Sweep;
use testbed::measuring::irradiance::exact_irradiance;
use testbed::measuring::sigma::Noise;
use testbed::measuring::street::Street;
use testbed::measuring::street_samplers::Subject;

/// The most by which sigma of this library may depend on the scale of a scene or on its distance
/// from the origin. Nodes and the curve of the top level use grids whose steps are powers of two, so
/// the same scene at another scale becomes another tree. A whole run has one scale with 5 %.
const MOST_CHANGE: f64 = 0.02;

/// The most by which sigma may change with a scale that is a power of two: only constants in metres
/// and coordinates of 1e-7 m and less, which turn into denormals as squares, make a difference.
const MOST_CHANGE_BY_TWO: f64 = 1.0e-5;

/// The most by which the probabilities of this library may differ from those of its formulas in f64,
/// in the mean over all lights that contribute. A whole run has up to 7.7e-6, at a distance of
/// 1,000 m: the origin does not follow the scene until it is farther away. At 0 m it is 5e-7.
const MOST_ERROR: f64 = 1.0e-5;

/// All rows of a quick run, after checks of its files.
fn quick_run() -> Vec<Measured> {
    let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join("stability");
    let rows = measure_all(&Options { out: out.clone(), quick: true, seed: 1 }).expect("a valid scene");
    let mut table = csv::Reader::from_path(out.join("stability.csv")).expect("the table was written");
    assert_eq!(table.headers().expect("a head"), COLUMNS.as_slice());
    let records: Vec<csv::StringRecord> = table.records().map(|record| record.expect("a whole row")).collect();
    assert_eq!(records.len(), rows.len());
    for (record, row) in records.iter().zip(&rows) {
        assert_eq!([&record[0], &record[2]], [row.sweep.name(), row.sampler]);
        if row.sampler == "girandole" {
            let sigma: f64 = record[3].parse().expect("a number");
            assert!(sigma.is_finite() && sigma > 0.0, "{record:?}");
            assert_eq!([&record[4], &record[5], &record[6]], ["0.0000"; 3], "{record:?}");
        }
    }
    rows
}

#[test]
fn noise_does_not_depend_on_scale_or_distance_and_no_light_is_lost() {
    let rows = quick_run();
    let of = |sweep: Sweep, sampler: &'static str| {
        rows.iter().filter(move |row| (row.sweep, row.sampler) == (sweep, sampler)).collect::<Vec<_>>()
    };
    let sigma = |row: &Measured| row.sigma.expect("finite at some shading point");
    for sweep in Sweep::ALL {
        let steps = sweep.values(true).len();
        assert!(steps >= 4, "{sweep:?}");
        for sampler in ["girandole", "girandole flat"] {
            assert_eq!(of(sweep, sampler).len(), steps, "{sweep:?} {sampler}");
        }
        let own = of(sweep, "girandole");
        assert!(own.iter().all(|row| row.unreached + row.infinite + row.nan == 0.0), "{own:?}");
        for row in own {
            let error = row.error.expect("it is evaluated in f64");
            assert!(error.mean > 0.0 && error.mean < MOST_ERROR, "{row:?}");
        }
    }

    for (sweep, sampler) in
        [(Sweep::Scale, "girandole"), (Sweep::Scale, "girandole flat"), (Sweep::Distance, "girandole")]
    {
        let own = of(sweep, sampler);
        let base =
            own.iter().find(|row| row.value == sweep.base()).map(|row| sigma(row)).expect("a step without change");
        for row in own {
            assert!((sigma(row) / base - 1.0).abs() < MOST_CHANGE, "{row:?}, and {base} without change");
        }
    }
    // Lights that are far from equal are no harder to choose.
    let own = of(Sweep::Contrast, "girandole");
    assert!(own.iter().all(|row| sigma(row) < (1.0 + MOST_CHANGE) * sigma(own[0])), "{own:?}");
    check_damage(&rows);
}

#[test]
fn noise_is_the_same_at_scales_that_are_powers_of_two() {
    let street = Street::new(2, 40);
    let at = |scale: f64| {
        let rows = measure(&street, Sweep::Scale, scale).expect("a valid scene");
        let own = rows.iter().filter(|row| row.sampler.starts_with("girandole"));
        own.map(|row| row.sigma.expect("finite")).collect::<Vec<f64>>()
    };
    let base = at(1.0);
    assert_eq!(base.len(), 2);
    for scale in [2.0_f64.powi(-20), 0.5, 2.0_f64.powi(19)] {
        for (sigma, base) in at(scale).iter().zip(&base) {
            assert!((sigma / base - 1.0).abs() < MOST_CHANGE_BY_TWO, "{sigma} at {scale}, {base} at 1");
        }
    }
}

#[test]
fn probabilities_in_f64_are_those_of_lights_that_were_not_rounded() {
    let street = Street::new(3, 20);
    let lights = street.lights();
    // Here all rounded lights are at few places, and the formulas lose most of them.
    let (_, shift) = Sweep::Distance.at(&street, 1.0e9);
    let mut compared = 0;
    for subject in Subject::both(&street, shift).expect("a valid scene") {
        for at in &street.receivers {
            let lux: Vec<f64> = lights.iter().map(|light| exact_irradiance(light, at)).collect();
            let Some(exact) = subject.exact_pmfs(at) else { continue };
            let sum: f64 = exact.iter().sum();
            assert!(sum < 1.0 + 1.0e-9, "{} {sum}", subject.name());
            let pmfs: Vec<f32> = exact.iter().map(|pmf| *pmf as f32).collect();
            let noise = Noise::of(&lux, &pmfs).expect("a lit shading point");
            assert!(noise.sigma.is_finite(), "{} loses a light at {at:?}", subject.name());
            compared += 1;
        }
    }
    assert_eq!(compared, street.receivers.len(), "two levels have such probabilities");
}

/// That the measurements see what rounding does to one tree in the space of the world.
fn check_damage(rows: &[Measured]) {
    // Powers of ten are computed.
    let is_near = |a: f64, b: f64| (a - b).abs() <= 1.0e-9 * b;
    let at = |sweep: Sweep, value: f64, sampler: &str| {
        let found = rows.iter().find(|row| (row.sweep, row.sampler) == (sweep, sampler) && is_near(row.value, value));
        *found.expect("the step was measured")
    };
    // Coordinates of 5e8 m are multiples of 32 m or more.
    let far = at(Sweep::Distance, 1.0e9, "girandole flat");
    assert!(far.infinite > 0.5 && far.unreached >= far.infinite, "{far:?}");
}
