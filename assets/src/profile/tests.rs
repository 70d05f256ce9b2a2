use std::fmt::Write as _;

use girandole::Profile;
use glam::Vec3;

use super::measured::{Coordinates, Measured};
use super::text::Number;
use super::{eulumdat, ies};
use crate::AssetError;
use testbed::testing::support::Rng;

/// A profile of type C.
fn of_table(vertical: &[f32], horizontal: &[f32], candela: &[f32]) -> Result<Profile, AssetError> {
    let number = |value: &f32| Number { value: f64::from(*value), line: 1, what: "a number" };
    let [vertical, horizontal, candela] = [vertical, horizontal, candela].map(|list| list.iter().map(number).collect());
    Measured { coordinates: Coordinates::C, vertical, horizontal, candela, factor: 1.0 }.profile()
}

/// The direction of a vertical and a horizontal angle of type C, in degrees.
fn of_type_c(vertical: f32, horizontal: f32) -> Vec3 {
    let [v, h] = [vertical, horizontal].map(f32::to_radians);
    Vec3::new(v.sin() * h.cos(), v.sin() * h.sin(), -v.cos())
}

fn close(a: f32, b: f32, tolerance: f32) -> bool {
    (a - b).abs() <= tolerance * a.abs().max(b.abs())
}

#[test]
fn symmetry_completes_planes() {
    let vertical = [0.0, 45.0, 90.0];
    let column = |k: usize| [10.0, 20.0 + k as f32, k as f32 * k as f32];
    let profile = |planes: &[f32], columns: &[usize]| {
        let candela: Vec<f32> = columns.iter().flat_map(|k| column(*k)).collect();
        of_table(&vertical, planes, &candela).unwrap()
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
    let with = |planes: &[f32]| of_table(&[0.0, 90.0], planes, &vec![1.0; 2 * planes.len()]);
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
    let nearly = ies(file).expect("all planes");
    assert!((nearly.candela(Vec3::new(1.0, -1.0e-8, -1.0)) - 1.0).abs() < 1.0e-5);
    let refused: [&[f32]; 5] =
        [&[0.0, 95.0, 190.0], &[-360.0, -180.0, 0.0], &[-180.0, 0.0, 181.0], &[0.0, 100.0], &[0.0, 90.0, 360.5]];
    for planes in refused {
        let error = with(planes).expect_err("no turn").to_string();
        assert!(error.contains("are no turn") || error.contains("outside"), "{planes:?}: {error}");
    }
}

/// A table with a single lit number, at some angles of these coordinates.
fn beam(coordinates: Coordinates, [vertical, horizontal]: [f64; 2], is_half: [bool; 2]) -> Profile {
    let angles =
        |is_half: bool| -> Vec<f64> { (if is_half { 0 } else { -9 }..=9).map(|i| f64::from(i) * 10.0).collect() };
    let number = |value: f64| Number { value, line: 1, what: "a number" };
    let [v, h] = is_half.map(angles);
    let candela = h.iter().flat_map(|h| v.iter().map(|v| if [*v, *h] == [vertical, horizontal] { 1.0 } else { 0.0 }));
    let candela = candela.map(number).collect();
    let [vertical, horizontal] = [v, h].map(|angles| angles.into_iter().map(number).collect());
    Measured { coordinates, vertical, horizontal, candela, factor: 1.0 }.profile().expect("a sound table")
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
            let profile = beam(coordinates, [40.0, 30.0], is_half);
            let candela = |direction: Vec3| profile.candela(direction);
            for (v, h, is_mirrored) in [(v, h, [false; 2]), (v, -h, [false, true]), (-v, h, [true, false])] {
                let is_lit = (0..2).all(|k| is_half[k] || !is_mirrored[k]);
                let expected = if is_lit { 1.0 } else { 0.0 };
                assert!((candela(direction(v, h)) - expected).abs() < 1.0e-4, "{coordinates:?} {is_half:?}");
            }
            assert_eq!(candela(Vec3::Z), 0.0);
        }
        assert_eq!(beam(coordinates, [0.0, 0.0], [true; 2]).candela(Vec3::NEG_Z), 1.0);
    }
}

#[test]
fn what_ies_files_of_all_versions_say_is_read() {
    let body = "1 1000 2 3 2 1 1 0.1 0.2 0\n1.5 3 100\n0 45\n90\n0 180\n10 20 30\n 40,50 60\n";
    let read = |head: &str| ies(format!("{head}{body}").as_bytes());
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
        assert_eq!(ies(format!("{head}{body}").as_bytes()).unwrap().greatest_candela(), 600.0);
    }
    // Files of the earlier versions name none, or name one in a later line.
    for head in ["\n", "\n[OTHER] as\nLM-63-2002\n"] {
        let early = ies(format!("{head}{body}").as_bytes()).unwrap();
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
        eulumdat(eulumdat_file(symmetry, planes, &columns).as_bytes()).expect("a sound file")
    };
    let expected = |planes: &[usize]| {
        let candela: Vec<f32> = planes.iter().flat_map(|k| column(*k).map(|value| 3.0 * value)).collect();
        let horizontal: Vec<f32> = (0..planes.len()).map(|plane| 90.0 * plane as f32).collect();
        of_table(&[0.0, 45.0, 90.0], &horizontal, &candela).unwrap()
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
        ies(IES.replacen(from, to, 1).as_bytes()).expect_err("a flaw").to_string()
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
        assert!(ies(format!("{IES}{text}").as_bytes()).is_ok(), "{text:?}");
    }
    // What symmetry adds counts as well, against the greatest size.
    let vertical: Vec<f32> = (0..512).map(|i| i as f32 * 0.35).collect();
    let planes = |count: usize| (0..count).map(|i| 90.0 * i as f32 / (count - 1) as f32).collect::<Vec<f32>>();
    let quarter = |count: usize| of_table(&vertical, &planes(count), &vec![1.0; 512 * count]);
    assert!(quarter(128).is_ok());
    assert!(quarter(129).expect_err("too large").to_string().starts_with("262656 intensities for 512"));
}

#[test]
fn files_in_utf16_are_refused_by_their_encoding() {
    let lamp = eulumdat_file(1, 4, &[[100.0, 50.0, 0.0]]);
    type Reader = fn(&[u8]) -> Result<Profile, AssetError>;
    for (text, read) in [(IES, ies as Reader), (&lamp, eulumdat)] {
        let of = |mark: &str, bytes: fn(u16) -> [u8; 2]| -> Vec<u8> {
            format!("{mark}{text}").encode_utf16().flat_map(bytes).collect()
        };
        for mark in ["", "\u{feff}"] {
            for file in [of(mark, u16::to_le_bytes), of(mark, u16::to_be_bytes)] {
                let error = read(&file).expect_err("UTF-16");
                assert!(error.to_string().contains("UTF-16"), "{error}");
            }
        }
        assert!(read(format!("\u{feff}{text}").as_bytes()).is_ok());
    }
}

#[test]
fn broken_files_are_refused_or_read_and_never_more() {
    let lamp = eulumdat_file(4, 4, &[[100.0, 50.0, 0.0], [90.0, 40.0, 1.0]]);
    type Reader = fn(&[u8]) -> Result<Profile, AssetError>;
    let readers: [(&str, Reader); 2] = [(IES, ies), (&lamp, eulumdat)];
    for (file, read) in readers {
        // Every beginning: what ends before the last number is an error.
        let numbers_end = file.trim_end().len();
        for end in 0..numbers_end - 5 {
            let result = read(&file.as_bytes()[..end]);
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
            match read(&bytes) {
                Ok(profile) => assert!((0.0..=1.0e15).contains(&profile.greatest_candela())),
                Err(error) => {
                    refused += 1;
                    longest = longest.max(error.to_string().len());
                }
            }
        }
        assert!((5_000..45_000).contains(&refused) && longest < 160, "{refused} {longest}");
    }
}
