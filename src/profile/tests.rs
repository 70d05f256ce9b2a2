use std::f32::consts::PI;

use glam::{DVec3, Mat3, Quat, Vec3};

use super::Profile;
use super::grid::MAX_VALUES;
use crate::error::ProfileError;
use crate::light::Light;
use crate::tree::testing::Rng;

/// The profile of angles in degrees: vertical ones from straight down, and those of planes.
pub(crate) fn of_degrees(vertical: &[f32], planes: &[f32], candela: &[f32]) -> Profile {
    made(vertical, planes, candela).expect("a sound table")
}

fn made(vertical: &[f32], planes: &[f32], candela: &[f32]) -> Result<Profile, ProfileError> {
    let radians = |degrees: &[f32]| degrees.iter().map(|d| f64::from(*d).to_radians() as f32).collect::<Vec<f32>>();
    Profile::new(&radians(vertical), &radians(planes), candela, DOWN)
}

/// The axes of lamps that are measured from straight down.
const DOWN: Mat3 = Mat3::from_cols(Vec3::X, Vec3::Y, Vec3::NEG_Z);

/// A profile of random intensities, some of them 0, whose half of planes is symmetric.
pub(crate) fn street_lamp(seed: u64) -> Profile {
    let mut rng = Rng(seed);
    let vertical = [0.0, 7.5, 20.0, 35.0, 50.0, 62.5, 75.0, 90.0];
    let horizontal = [0.0, 22.5, 50.0, 90.0, 140.0, 180.0];
    let mut candela: Vec<f32> = (0..48).map(|_| (rng.unit() * 1500.0 - 300.0).max(0.0)).collect();
    let mirrored = horizontal.iter().rev().skip(1).map(|plane| 360.0 - plane);
    let planes: Vec<f32> = horizontal.iter().copied().chain(mirrored).collect();
    (0..5).rev().for_each(|column| candela.extend_from_within(8 * column..8 * (column + 1)));
    of_degrees(&vertical, &planes, &candela)
}

/// The direction of a vertical and a horizontal angle of type C, in degrees.
fn of_type_c(vertical: f32, horizontal: f32) -> Vec3 {
    let [v, h] = [vertical, horizontal].map(f32::to_radians);
    Vec3::new(v.sin() * h.cos(), v.sin() * h.sin(), -v.cos())
}

/// The flux and the mean direction times it, by midpoints of small squares.
fn quadrature(profile: Profile) -> (f64, DVec3) {
    let (rows, columns) = (1440, 1440);
    let (mut flux, mut moment) = (0.0, DVec3::ZERO);
    for row in 0..rows {
        let vertical = 180.0 * (row as f32 + 0.5) / rows as f32;
        let angle = f64::from(vertical.to_radians().sin() * PI / rows as f32 * 2.0 * PI / columns as f32);
        for column in 0..columns {
            let direction = of_type_c(vertical, 360.0 * (column as f32 + 0.5) / columns as f32);
            let light = f64::from(profile.candela(direction)) * angle;
            flux += light;
            moment += direction.as_dvec3() * light;
        }
    }
    (flux, moment)
}

fn close(a: f32, b: f32, tolerance: f32) -> bool {
    (a - b).abs() <= tolerance * a.abs().max(b.abs())
}

#[test]
fn flux_and_mean_direction_of_simple_lobes_are_their_closed_forms() {
    let even = of_degrees(&[0.0, 180.0], &[0.0], &[3.0, 3.0]);
    assert!(close(even.flux(), 12.0 * PI, 1.0e-6) && even.mean().length() < 1.0e-6);
    // Intensity that grows with the angle: 2 pi times the integrals of t sin t and of t sin t cos t.
    let growing = of_degrees(&[0.0, 180.0], &[0.0], &[0.0, PI]);
    assert!(close(growing.flux(), 2.0 * PI * PI, 1.0e-6), "{}", growing.flux());
    assert!((growing.mean() - Vec3::new(0.0, 0.0, 0.25)).length() < 1.0e-6, "{}", growing.mean());
    // Lambert's law in tenths of degrees.
    let vertical: Vec<f32> = (0..=900).map(|i| i as f32 / 10.0).collect();
    let candela: Vec<f32> = vertical.iter().map(|angle| 100.0 * angle.to_radians().cos().max(0.0)).collect();
    let lambertian = of_degrees(&vertical, &[0.0], &candela);
    assert!(close(lambertian.flux(), 100.0 * PI, 1.0e-5));
    assert!((lambertian.mean() - Vec3::NEG_Z * 2.0 / 3.0).length() < 1.0e-5);
    assert!(close(lambertian.half_angle(), 0.5 * PI, 0.03));
}

#[test]
fn flux_and_mean_direction_are_the_integrals_of_what_is_interpolated() {
    for seed in 0..3 {
        let profile = street_lamp(seed);
        let (flux, moment) = quadrature(profile);
        assert!((f64::from(profile.flux()) / flux - 1.0).abs() < 1.0e-4, "{} {flux}", profile.flux());
        assert!((profile.mean().as_dvec3() - moment / flux).length() < 1.0e-4);
    }
}

#[test]
fn all_light_leaves_within_the_cone() {
    let mut rng = Rng(5);
    for seed in 0..30 {
        // A beam somewhere.
        let first = rng.below(6);
        let mut candela = vec![0.0; 48];
        (0..2).for_each(|i| candela[8 * rng.below(6) + first + i] = 100.0);
        candela.extend_from_within(..8);
        let vertical = [0.0, 7.5, 20.0, 35.0, 50.0, 62.5, 75.0, 90.0];
        let horizontal = [0.0, 60.0, 120.0, 180.0, 240.0, 300.0, 360.0];
        let profile = of_degrees(&vertical, &horizontal, &candela);
        let axis = profile.mean().normalize();
        let (mut widest, mut lit) = (0.0_f32, 0);
        for _ in 0..20_000 {
            let direction = rng.position(1.0).normalize_or(Vec3::Z);
            if profile.candela(direction) > 0.0 {
                widest = widest.max(direction.angle_between(axis));
                lit += 1;
            }
        }
        assert!(lit > 50 && widest <= profile.half_angle(), "{seed}: {widest} {}", profile.half_angle());
        // As tight as the squares in which it is looked for, and the samples.
        assert!(profile.half_angle() < widest + 0.2, "{seed}: {widest} {}", profile.half_angle());
    }
    let dark = of_degrees(&[0.0, 90.0], &[0.0], &[0.0, 0.0]);
    assert_eq!((dark.flux(), dark.half_angle()), (0.0, PI));
}

#[test]
fn angles_of_the_table_have_its_intensities_and_what_lies_between_is_linear() {
    let profile = of_degrees(
        &[10.0, 30.0, 100.0],
        &[0.0, 90.0, 200.0, 270.0, 360.0],
        &[1.0, 2.0, 4.0, 5.0, 6.0, 9.0, 0.0, 3.0, 8.0, 7.0, 7.0, 7.0, 1.0, 2.0, 4.0],
    );
    let at = |v, h| profile.candela(of_type_c(v, h) * 5.0);
    for (vertical, horizontal, expected) in [
        (30.0, 0.0, 2.0),
        (10.001, 90.0, 5.0),
        (99.999, 200.0, 8.0),
        (20.0, 90.0, 5.5),
        (65.0, 45.0, 5.25),
        // From 270 degrees to the first plane, a turn later.
        (30.0, 315.0, 4.5),
        (30.0, -45.0, 4.5),
        (9.9, 0.0, 0.0),
        (100.1, 0.0, 0.0),
    ] {
        assert!(
            (at(vertical, horizontal) - expected).abs() < 2.0e-3,
            "{vertical} {horizontal}: {}",
            at(vertical, horizontal)
        );
    }
    assert_eq!(profile.candela(Vec3::ZERO), 0.0);
    assert_eq!(profile.candela(Vec3::NAN), 0.0);
    assert_eq!(profile.greatest_candela(), 9.0);
}

#[test]
fn zeros_of_either_sign_make_equal_profiles() {
    let with = |zero: f32| {
        of_degrees(&[zero, 45.0, 90.0], &[zero, 90.0, 180.0], &[3.0, zero, 1.0, 2.0, 2.0, 2.0, 5.0, 5.0, zero])
    };
    let [positive, negative] = [0.0, -0.0].map(with);
    assert_eq!((positive, positive.id()), (negative, negative.id()));
    assert_eq!(Profile::of_id(positive.id()), Some(positive));
}

#[test]
fn what_is_no_table_is_refused() {
    let error = |polar: &[f32], around: &[f32], candela: &[f32], axes: Mat3| {
        let error = Profile::new(polar, around, candela, axes).expect_err("a flaw");
        assert_eq!(error.code(), 1400);
        error.to_string()
    };
    let counts = "there must be one for each pair, 262144 at most, of two angles or more and one or more";
    let count = |given: &str| format!("{given}; {counts}");
    assert_eq!(error(&[0.0], &[0.0], &[1.0], DOWN), count("1 intensities for 1 angles from the pole and 1 around it"));
    assert_eq!(error(&[0.0, 1.0], &[], &[], DOWN), count("0 intensities for 2 angles from the pole and 0 around it"));
    assert_eq!(
        error(&[0.0, 1.0], &[0.0], &[1.0], DOWN),
        count("1 intensities for 2 angles from the pole and 1 around it")
    );
    let pair = [1.0; 2];
    assert_eq!(error(&[0.5, 0.5], &[0.0], &pair, DOWN), "angle from the pole 1 is 0.5, outside 0.50001 to 3.1415927");
    assert!(error(&[0.0, 3.2], &[0.0], &pair, DOWN).starts_with("angle from the pole 1 is 3.2, outside 1e-5"));
    assert!(error(&[0.0, f32::NAN], &[0.0], &pair, DOWN).starts_with("angle from the pole 1 is NaN"));
    assert!(
        error(&[0.0, 1.0], &[1.0, 7.4], &[1.0; 4], DOWN).starts_with("angle around the pole 1 is 7.4, outside 1.00001")
    );
    for bad in [-1.0, f32::INFINITY, 1.1e15] {
        assert!(error(&[0.0, 1.0], &[0.0], &[0.0, bad], DOWN).starts_with("intensity 1 is "), "{bad}");
    }
    for axes in [Mat3::ZERO, Mat3::from_rotation_z(0.5), Mat3::from_cols(Vec3::X, Vec3::X, Vec3::Z)] {
        assert!(error(&[0.0, 1.0], &[0.0], &pair, axes).ends_with("are not those of the lamp in any order"), "{axes}");
    }
}

#[test]
fn tables_up_to_the_greatest_size_are_made() {
    let table = |rows: usize, columns: usize| {
        let vertical: Vec<f32> = (0..rows).map(|i| 180.0 * i as f32 / (rows - 1) as f32).collect();
        let horizontal: Vec<f32> = (0..columns).map(|i| 360.0 * i as f32 / (columns - 1) as f32).collect();
        made(&vertical, &horizontal, &vec![1.0; rows * columns])
    };
    assert_eq!(512 * 512, MAX_VALUES);
    assert!(close(table(512, 512).expect("the greatest size").flux(), 4.0 * PI, 1.0e-4));
    assert!(table(513, 512).is_err() && table(512, 5121).is_err());
}

#[test]
fn lamps_have_the_flux_and_the_cone_of_their_profiles() {
    let profile = street_lamp(1);
    let turn = Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 1.1);
    let lamp = Light::profile(Vec3::ONE, turn, profile, Vec3::new(0.5, 1.0, 2.0));
    assert!(close(lamp.flux(), profile.flux() * (0.2126 * 0.5 + 0.7152 + 0.0722 * 2.0), 1.0e-6));
    let cluster = lamp.cluster();
    assert!((cluster.axis - turn * profile.mean()).length() < 1.0e-5);
    assert_eq!(cluster.punctual_flux, cluster.flux);
    assert_eq!(lamp.validate(), Ok(()));
    let refused =
        |light: Light, what: &str| assert!(light.validate().expect_err("a flaw").to_string().starts_with(what));
    refused(Light::profile(Vec3::NAN, turn, profile, Vec3::ONE), "position is");
    refused(Light::profile(Vec3::ONE, turn * 2.0, profile, Vec3::ONE), "the length of rotation is 2");
    refused(Light::profile(Vec3::ONE, Quat::from_array([0.0; 4]), profile, Vec3::ONE), "the length of rotation is 0");
    let (brightest, most) = (profile.greatest_candela(), crate::light::MAX_EMISSION);
    let factor = |factor: f32| Light::profile(Vec3::ONE, turn, profile, Vec3::splat(factor));
    assert_eq!(factor(0.999 * most / brightest).validate(), Ok(()));
    refused(factor(1.001 * most / brightest), "emission times the profile is");
    refused(factor(10.0 * most / brightest), "emission times the profile is");
}
