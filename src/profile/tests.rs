use std::f32::consts::PI;
use std::fmt::Write as _;

use glam::{DVec3, Quat, Vec3};

use super::grid::MAX_VALUES;
use super::measured::{Coordinates, Measured};
use super::text::Number;
use super::{Profile, eulumdat, ies};
use crate::error::ProfileError;
use crate::light::Light;
use crate::tree::testing::Rng;

/// A profile of random intensities, some of them 0, whose half of planes is symmetric.
pub(crate) fn street_lamp(seed: u64) -> Profile {
    let mut rng = Rng(seed);
    let vertical = [0.0, 7.5, 20.0, 35.0, 50.0, 62.5, 75.0, 90.0];
    let horizontal = [0.0, 22.5, 50.0, 90.0, 140.0, 180.0];
    let candela: Vec<f32> = (0..48).map(|_| (rng.unit() * 1500.0 - 300.0).max(0.0)).collect();
    Profile::new(&vertical, &horizontal, &candela).expect("a sound table")
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
    let even = Profile::new(&[0.0, 180.0], &[0.0], &[3.0, 3.0]).unwrap();
    assert!(close(even.flux(), 12.0 * PI, 1.0e-6) && even.mean().length() < 1.0e-6);
    // Intensity that grows with the angle: 2 pi times the integrals of t sin t and of t sin t cos t.
    let growing = Profile::new(&[0.0, 180.0], &[0.0], &[0.0, PI]).unwrap();
    assert!(close(growing.flux(), 2.0 * PI * PI, 1.0e-6), "{}", growing.flux());
    assert!((growing.mean() - Vec3::new(0.0, 0.0, 0.25)).length() < 1.0e-6, "{}", growing.mean());
    // Lambert's law in tenths of degrees.
    let vertical: Vec<f32> = (0..=900).map(|i| i as f32 / 10.0).collect();
    let candela: Vec<f32> = vertical.iter().map(|angle| 100.0 * angle.to_radians().cos().max(0.0)).collect();
    let lambertian = Profile::new(&vertical, &[0.0], &candela).unwrap();
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
        let mut candela = [0.0; 48];
        (0..2).for_each(|i| candela[8 * rng.below(6) + first + i] = 100.0);
        let vertical = [0.0, 7.5, 20.0, 35.0, 50.0, 62.5, 75.0, 90.0];
        let horizontal = [0.0, 60.0, 120.0, 180.0, 240.0, 300.0];
        let profile = Profile::new(&vertical, &horizontal, &candela).unwrap();
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
    let dark = Profile::new(&[0.0, 90.0], &[0.0], &[0.0, 0.0]).unwrap();
    assert_eq!((dark.flux(), dark.half_angle()), (0.0, PI));
}

#[test]
fn angles_of_the_table_have_its_intensities_and_what_lies_between_is_linear() {
    let profile = Profile::new(
        &[10.0, 30.0, 100.0],
        &[0.0, 90.0, 200.0, 270.0],
        &[1.0, 2.0, 4.0, 5.0, 6.0, 9.0, 0.0, 3.0, 8.0, 7.0, 7.0, 7.0],
    )
    .unwrap();
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
fn symmetry_completes_planes() {
    let vertical = [0.0, 45.0, 90.0];
    let column = |k: usize| [10.0, 20.0 + k as f32, k as f32 * k as f32];
    let profile = |planes: &[f32], columns: &[usize]| {
        let candela: Vec<f32> = columns.iter().flat_map(|k| column(*k)).collect();
        Profile::new(&vertical, planes, &candela).unwrap()
    };
    let whole = [0.0, 30.0, 90.0, 150.0, 180.0, 210.0, 270.0, 330.0, 360.0];
    let quarter = profile(&[0.0, 30.0, 90.0], &[1, 2, 3]);
    assert_eq!(quarter, profile(&whole, &[1, 2, 3, 2, 1, 2, 3, 2, 1]));
    let half = profile(&[0.0, 30.0, 90.0, 150.0, 180.0], &[1, 2, 3, 4, 5]);
    assert_eq!(half, profile(&whole, &[1, 2, 3, 4, 5, 4, 3, 2, 1]));
    // Without the last plane, which is the first.
    assert_eq!(half, profile(&whole[..8], &[1, 2, 3, 4, 5, 4, 3, 2]));
    // Symmetric about C90 to C270, from either of both.
    let turned = [
        profile(&[90.0, 120.0, 180.0, 240.0, 270.0], &[1, 2, 3, 4, 5]),
        profile(&[-90.0, -60.0, 0.0, 60.0, 90.0], &[5, 4, 3, 2, 1]),
    ];
    for k in 0..200 {
        let (v, h) = (k as f32 * 0.45, k as f32 * 17.3);
        let [a, b, c] =
            [(turned[0], h), (turned[1], h), (half, h - 90.0)].map(|(profile, h)| profile.candela(of_type_c(v, h)));
        assert!((a - b).abs() < 2.0e-3 && (a - c).abs() < 2.0e-3, "{v} {h}: {a} {b} {c}");
    }
    // A single plane stands for all.
    assert_eq!(
        profile(&[0.0], &[2]).candela(of_type_c(45.0, 123.0)),
        profile(&[0.0], &[2]).candela(of_type_c(45.0, -20.0))
    );
}

#[test]
fn planes_that_go_around_leave_no_dark_wedge_and_others_are_refused() {
    let with = |planes: &[f32]| Profile::new(&[0.0, 90.0], planes, &vec![1.0; 2 * planes.len()]);
    let all_around: [&[f32]; 5] = [
        &[0.0, 120.0, 240.0],
        &[0.0, 90.0, 180.0, 270.0, 360.0],
        &[-180.0, -90.0, 0.0, 90.0, 180.0],
        &[0.0, 180.0, 359.9999],
        &[90.0, 180.0, 270.0],
    ];
    for planes in all_around {
        let profile = with(planes).expect("all planes");
        for k in 0..3600 {
            let candela = profile.candela(of_type_c(60.0, 0.1 * k as f32 - 180.0));
            assert!((candela - 1.0).abs() < 1.0e-5, "{planes:?}, {k}: {candela}");
        }
        let before = Vec3::new(1.0, -1.0e-8, -1.0);
        assert!((profile.candela(before) - 1.0).abs() < 1.0e-5, "{planes:?}");
    }
    // Nearer to a turn than f32 tells.
    let file = b"TILT=NONE\n1 -1 1 2 3 1 1 0 0 0 1 1 0\n0 90\n0 180 359.9999999\n1 1\n1 1\n1 1\n";
    let nearly = Profile::ies(file).expect("all planes");
    assert!((nearly.candela(Vec3::new(1.0, -1.0e-8, -1.0)) - 1.0).abs() < 1.0e-5);
    let refused: [&[f32]; 5] =
        [&[0.0, 95.0, 190.0], &[-360.0, -180.0, 0.0], &[-180.0, 0.0, 181.0], &[0.0, 100.0], &[0.0, 90.0, 360.5]];
    for planes in refused {
        let code = with(planes).expect_err("no turn").code();
        assert!([1402, 1404].contains(&code), "{planes:?}: {code}");
    }
}

#[test]
fn zeros_of_either_sign_make_equal_profiles() {
    let with = |zero: f32| {
        Profile::new(&[zero, 45.0, 90.0], &[zero, 90.0, 180.0], &[3.0, zero, 1.0, 2.0, 2.0, 2.0, 5.0, 5.0, zero])
    };
    let [positive, negative] = [0.0, -0.0].map(|zero| with(zero).expect("a sound table"));
    assert_eq!((positive, positive.id()), (negative, negative.id()));
    assert_eq!(Profile::of_id(positive.id()), Some(positive));
}

/// A table with a single lit number, at some angles of these coordinates.
fn beam(coordinates: Coordinates, [vertical, horizontal]: [f64; 2], is_half: [bool; 2]) -> super::grid::Grid {
    let angles =
        |is_half: bool| -> Vec<f64> { (if is_half { 0 } else { -9 }..=9).map(|i| f64::from(i) * 10.0).collect() };
    let number = |value: f64| Number { value, line: 1, what: "a number" };
    let [v, h] = is_half.map(angles);
    let candela = h.iter().flat_map(|h| v.iter().map(|v| if [*v, *h] == [vertical, horizontal] { 1.0 } else { 0.0 }));
    let candela = candela.map(number).collect();
    let [vertical, horizontal] = [v, h].map(|angles| angles.into_iter().map(number).collect());
    Measured { coordinates, vertical, horizontal, candela, factor: 1.0 }.grid().expect("a sound table")
}

#[test]
fn types_a_and_b_turn_about_the_vertical_and_the_horizontal_axis() {
    let (v, h) = (40.0_f32.to_radians(), 30.0_f32.to_radians());
    // Up is +X, and right is -Y.
    let of_a = |v: f32, h: f32| Vec3::new(v.sin(), -v.cos() * h.sin(), -v.cos() * h.cos());
    let of_b = |v: f32, h: f32| Vec3::new(h.cos() * v.sin(), -h.sin(), -h.cos() * v.cos());
    type Direction = fn(f32, f32) -> Vec3;
    let directions: [(Coordinates, Direction); 2] = [(Coordinates::A, of_a), (Coordinates::B, of_b)];
    for (coordinates, direction) in directions {
        for is_half in [[false; 2], [true; 2], [true, false]] {
            let grid = beam(coordinates, [40.0, 30.0], is_half);
            let candela = |direction: Vec3| grid.candela(grid.axes.transpose() * direction);
            for (v, h, is_mirrored) in [(v, h, [false; 2]), (v, -h, [false, true]), (-v, h, [true, false])] {
                let is_lit = (0..2).all(|k| is_half[k] || !is_mirrored[k]);
                let expected = if is_lit { 1.0 } else { 0.0 };
                assert!((candela(direction(v, h)) - expected).abs() < 1.0e-4, "{coordinates:?} {is_half:?}");
            }
            assert_eq!(candela(Vec3::Z), 0.0);
        }
        let forward = beam(coordinates, [0.0, 0.0], [true; 2]);
        assert!((forward.lobe().mean.normalize() - Vec3::NEG_Z).length() < 1.0e-5);
    }
}

#[test]
fn what_ies_files_of_all_versions_say_is_read() {
    let body = "1 1000 2 3 2 1 1 0.1 0.2 0\n1.5 3 100\n0 45\n90\n0 180\n10 20 30\n 40,50 60\n";
    let read = |head: &str| Profile::ies(format!("{head}{body}").as_bytes());
    let early = read("TILT=NONE\n").expect("the version of 1986");
    assert_eq!(early, read("IESNA91\n[TEST] 7\n[MANUFAC] \u{fc}\nTILT=INCLUDE\n1\n2\n0 90\n1 0.9\n").unwrap());
    assert_eq!(early, read("\u{feff}[TEST]\r\nTILT=lamp.tlt\r\n").unwrap());
    assert!((early.candela(Vec3::NEG_Z) / (10.0 * 2.0 * 1.5 * 3.0) - 1.0).abs() < 1.0e-6);
    assert!((early.candela(of_type_c(45.0, 180.0)) / (50.0 * 9.0) - 1.0).abs() < 1.0e-4);
    // Later versions have another number after the ballast factor.
    for version in ["IESNA:LM-63-1995", "IESNA:LM-63-2002", "IES:LM-63-2019"] {
        let late = read(&format!("{version}\nTILT=NONE\n")).unwrap();
        assert!((late.candela(Vec3::NEG_Z) / (10.0 * 2.0 * 1.5) - 1.0).abs() < 1.0e-6);
    }
}

#[test]
fn blank_lines_before_the_version_of_an_ies_file_are_passed_over() {
    let body = "TILT=NONE\n1 -1 1 4 1 1 2 0 0 0\n1 1.10001 10\n0 30 60 90\n0\n500 600 300 0\n";
    for head in ["\nIESNA:LM-63-2019\n", "\u{feff} \r\n\r\n\tIESNA:LM-63-1995 \r\n"] {
        assert_eq!(Profile::ies(format!("{head}{body}").as_bytes()).unwrap().greatest_candela(), 600.0);
    }
    // Files of the earlier versions name none, or name one in a later line.
    for head in ["\n", "\n[OTHER] as\nLM-63-2002\n"] {
        let early = Profile::ies(format!("{head}{body}").as_bytes()).unwrap();
        assert!(close(early.greatest_candela(), 660.006, 1.0e-6));
    }
}

/// A EULUMDAT file of planes at multiples of 90 degrees.
fn eulumdat_file(symmetry: usize, planes: usize, columns: &[[f32; 3]]) -> String {
    let mut file = format!("A maker\n1\n{symmetry}\n{planes}\n90\n3\n45\n");
    file += &"x\n".repeat(16);
    file += "1,5\n0\n2\n1\nLED\n2000\n3000\n80\n20\n1\nLED\n4000\n3000\n80\n20\n";
    file += &"0.5\n".repeat(10);
    (0..planes).for_each(|plane| writeln!(file, "{}", 90 * plane).unwrap());
    file += "0\n45\n90\n";
    columns.iter().flatten().for_each(|value| writeln!(file, "{value}").unwrap());
    file
}

#[test]
fn what_eulumdat_files_of_all_symmetries_say_is_read() {
    let column = |k: usize| [100.0, 10.0 * k as f32, k as f32];
    let read = |symmetry, planes, columns: &[usize]| {
        let columns: Vec<_> = columns.iter().map(|k| column(*k)).collect();
        Profile::eulumdat(eulumdat_file(symmetry, planes, &columns).as_bytes()).expect("a sound file")
    };
    let expected = |planes: &[usize]| {
        let candela: Vec<f32> = planes.iter().flat_map(|k| column(*k).map(|value| 3.0 * value)).collect();
        let horizontal: Vec<f32> = (0..planes.len()).map(|plane| 90.0 * plane as f32).collect();
        Profile::new(&[0.0, 45.0, 90.0], &horizontal, &candela).unwrap()
    };
    assert_eq!(read(0, 4, &[1, 2, 3, 4]), expected(&[1, 2, 3, 4, 1]));
    assert_eq!(read(1, 4, &[2]), expected(&[2]));
    assert_eq!(read(2, 4, &[1, 2, 3]), expected(&[1, 2, 3, 2, 1]));
    assert_eq!(read(4, 4, &[1, 2]), expected(&[1, 2, 1, 2, 1]));
    // From C270 over C0 to C90.
    let (ours, theirs) = (read(3, 4, &[1, 2, 3]), expected(&[2, 3, 2, 1, 2]));
    for k in 0..100 {
        let direction = of_type_c(k as f32 * 0.9, k as f32 * 7.7);
        assert!((ours.candela(direction) - theirs.candela(direction)).abs() < 1.0e-3, "{k}");
    }
}

const IES: &str = "IESNA:LM-63-2002\n[TEST] none\nTILT=NONE\n1 -1 1 3 2 1 2 0.3 0.3 0\n1 1 60\n0 45 90\n0 90\n100 80 0\n100 60.5 1e-3\n";

#[test]
fn errors_name_the_line_and_what_is_wrong() {
    let error = |from: &str, to: &str| {
        assert!(IES.contains(from));
        Profile::ies(IES.replacen(from, to, 1).as_bytes()).expect_err("a flaw").to_string()
    };
    assert_eq!(error("80 0", "8o 0"), "line 8: a candela value is \"8o\", not a finite number");
    assert_eq!(error("80 0", "inf 0"), "line 8: a candela value is \"inf\", not a finite number");
    assert_eq!(error("80 0", "-80 0"), "line 8: a candela value is -80.0, outside 0.0 to 1000000000000000.0");
    assert_eq!(error(" 1e-3", ""), "line 10: a candela value is missing");
    assert_eq!(error("0 45 90", "0 45 45"), "line 6: a vertical angle is 45.0, outside 45.001 to 180.0");
    assert_eq!(error("0 45 90", "0 45 190"), "line 6: a vertical angle is 190.0, outside 45.001 to 180.0");
    assert_eq!(
        error("0 90\n", "0 80\n"),
        "line 7: planes from 0.0 to 80.0 degrees are no turn, and no half or quarter of one"
    );
    assert_eq!(error("1 3 2 1", "1 3 2 4"), "line 4: the photometric type is 4.0, outside 1.0 to 3.0");
    assert_eq!(error("1 3 2 1", "1 3.5 2 1"), "line 4: the number of vertical angles is 3.5, not a whole number");
    assert_eq!(error("1 3 2 1", "1 1 2 1"), "line 4: the number of vertical angles is 1.0, outside 2.0 to 4096.0");
    assert_eq!(error("1 3 2 1", "1 4096 4096 1"), "line 10: a vertical angle is missing");
    assert_eq!(error("TILT=NONE", "NONE"), "line 1: a line that begins with TILT= is missing");
    // Decimal commas make two numbers of one.
    let left = |value| {
        format!("line 9: {value} follows the last number (commas separate numbers, so a decimal comma makes two)")
    };
    assert_eq!(error("60.5", "60,5"), left("0.001"));
    assert_eq!(error("60.5 1e-3\n", "60.5 1e-3\n7,5"), left("7.0").replace("line 9", "line 10"));
    for text in ["\u{1a}", "\0\0", "END 5", "\n , \n"] {
        assert!(Profile::ies(format!("{IES}{text}").as_bytes()).is_ok(), "{text:?}");
    }
    let mut codes = Vec::new();
    for (from, to) in
        [("90\n0", "90\n"), ("60.5", "six"), ("-1 1", "-1 -1"), ("1 3 2", "1 3 1.5"), ("0 90\n", "0 80\n")]
    {
        codes.push(Profile::ies(IES.replacen(from, to, 1).as_bytes()).expect_err("a flaw").code());
    }
    assert_eq!(codes, [1400, 1401, 1402, 1403, 1404]);
    assert_eq!(
        Profile::new(&[0.0], &[0.0], &[1.0]),
        Err(ProfileError::Missing { line: 2, what: "a second vertical angle" })
    );
    assert_eq!(Profile::new(&[0.0, 1.0], &[], &[]), Err(ProfileError::Missing { line: 1, what: "a plane" }));
    assert_eq!(Profile::new(&[0.0, 1.0], &[0.0], &[1.0]), Err(ProfileError::Candela { found: 1, expected: 2 }));
}

#[test]
fn files_in_utf16_are_refused_by_their_encoding() {
    let lamp = eulumdat_file(1, 4, &[[100.0, 50.0, 0.0]]);
    type Reader = fn(&[u8]) -> Result<Profile, ProfileError>;
    for (text, read) in [(IES, Profile::ies as Reader), (&lamp, Profile::eulumdat)] {
        let of = |mark: &str, bytes: fn(u16) -> [u8; 2]| -> Vec<u8> {
            format!("{mark}{text}").encode_utf16().flat_map(bytes).collect()
        };
        for mark in ["", "\u{feff}"] {
            for file in [of(mark, u16::to_le_bytes), of(mark, u16::to_be_bytes)] {
                let error = read(&file).expect_err("UTF-16");
                assert_eq!((error.code(), error.to_string().contains("UTF-16")), (1408, true), "{error}");
            }
        }
        assert!(read(format!("\u{feff}{text}").as_bytes()).is_ok());
    }
}

#[test]
fn tables_up_to_the_greatest_size_are_read() {
    let table = |rows: usize, columns: usize| {
        let vertical: Vec<f32> = (0..rows).map(|i| 180.0 * i as f32 / (rows - 1) as f32).collect();
        let horizontal: Vec<f32> = (0..columns).map(|i| 360.0 * i as f32 / (columns - 1) as f32).collect();
        Profile::new(&vertical, &horizontal, &vec![1.0; rows * columns])
    };
    let most = table(512, 512).expect("the greatest size");
    assert!(close(most.flux(), 4.0 * PI, 1.0e-4));
    for (rows, columns) in [(513, 512), (512, 5121)] {
        let (found, most) = (rows * columns, MAX_VALUES);
        assert_eq!(table(rows, columns), Err(ProfileError::Size { line: columns, found, most }));
    }
    // What symmetry adds counts as well.
    let vertical: Vec<f32> = (0..512).map(|i| i as f32 * 0.35).collect();
    let planes = |count: usize| (0..count).map(|i| 90.0 * i as f32 / (count - 1) as f32).collect::<Vec<f32>>();
    let quarter = |count: usize| Profile::new(&vertical, &planes(count), &vec![1.0; 512 * count]);
    assert!(quarter(128).is_ok());
    assert!(matches!(quarter(129), Err(ProfileError::Size { found: 262_656, .. })));
}

#[test]
fn broken_files_are_refused_or_read_and_never_more() {
    let lamp = eulumdat_file(4, 4, &[[100.0, 50.0, 0.0], [90.0, 40.0, 1.0]]);
    type Reader = fn(&[u8]) -> Result<Measured, ProfileError>;
    let readers: [(&str, Reader); 2] = [(IES, ies::read), (&lamp, eulumdat::read)];
    for (file, read) in readers {
        // Every beginning: what ends before the last number is an error.
        let numbers_end = file.trim_end().len();
        for end in 0..numbers_end - 5 {
            let result = read(&file.as_bytes()[..end]).and_then(Measured::grid);
            assert!(result.is_err(), "{}", &file[..end]);
        }
        let mut rng = Rng(9);
        let (mut refused, mut longest) = (0, 0);
        for _ in 0..50_000 {
            let mut bytes = file.as_bytes().to_vec();
            for _ in 0..1 + rng.below(4) {
                let at = rng.below(bytes.len());
                match rng.below(4) {
                    0 => bytes[at] = rng.bits() as u8,
                    1 => bytes[at] = b"0123456789.-eE, \n\r"[rng.below(18)],
                    2 => drop(bytes.remove(at)),
                    _ => bytes.insert(at, b"0123456789.-eE, \n\r"[rng.below(18)]),
                }
            }
            match read(&bytes).and_then(Measured::grid) {
                Ok(grid) => assert!(grid.candela.iter().all(|candela| (0.0..=1.0e15).contains(candela))),
                Err(error) => {
                    refused += 1;
                    longest = longest.max(error.to_string().len());
                    assert!((1400..=1408).contains(&error.code()));
                }
            }
        }
        assert!((5_000..45_000).contains(&refused) && longest < 160, "{refused} {longest}");
    }
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
    refused(Light::profile(Vec3::ONE, turn * 2.0, profile, Vec3::ONE), "rotation has length 2");
    refused(Light::profile(Vec3::ONE, Quat::from_array([0.0; 4]), profile, Vec3::ONE), "rotation has no direction");
    let (brightest, most) = (profile.greatest_candela(), crate::light::MAX_EMISSION);
    let factor = |factor: f32| Light::profile(Vec3::ONE, turn, profile, Vec3::splat(factor));
    assert_eq!(factor(0.999 * most / brightest).validate(), Ok(()));
    refused(factor(1.001 * most / brightest), "emission times the profile is");
    refused(factor(10.0 * most / brightest), "emission times the profile is");
}
