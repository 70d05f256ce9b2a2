//! Accepts most records of lights quickly.
//!
//! The bits of floats without a sign are in the order of the floats, and those of infinity and NaN
//! come last. So most fields are checked by comparing whole numbers, all fields of a record at
//! once. A record that is not accepted here may still be valid: `light_record.rs` decides.

use std::f32::consts::PI;

use super::light_record::{POINT, PROFILE, RECTANGLE, Record, SPHERE, SPOT, TRIANGLE, TWO_SIDED, WORDS};
use crate::light::{MAX_COORDINATE, MAX_EMISSION};

/// All bits but the sign.
const MAGNITUDE: u32 = u32::MAX >> 1;

/// How far a squared length may be from 1 so that the length is certainly within the tolerance of
/// `Light::validate`, which is 0.001.
const UNIT_TOLERANCE_SQ: f32 = 1.9e-3;

/// The first numbers of the records of all kinds.
pub(super) const KINDS: [u32; 8] =
    [POINT, SPOT, RECTANGLE, TRIANGLE, SPHERE, PROFILE, RECTANGLE | TWO_SIDED, TRIANGLE | TWO_SIDED];

/// Limits of the numbers of a record.
struct Limits {
    /// The bits that are compared.
    masks: Record,
    /// The greatest value of these bits.
    most: Record,
}

/// The limits of each of [`KINDS`].
static LIMITS: [Limits; KINDS.len()] = [
    limits(POINT, b"ccc......"),
    limits(SPOT, b"cccuuuaa."),
    limits(RECTANGLE, b"ccccccccc"),
    limits(TRIANGLE, b"ccccccccc"),
    limits(SPHERE, b"cccr....."),
    // Profiles have to be looked up: no record of one is within these limits, which its first number exceeds.
    limits(POINT, b"........."),
    limits(RECTANGLE | TWO_SIDED, b"ccccccccc"),
    limits(TRIANGLE | TWO_SIDED, b"ccccccccc"),
];

/// The limits of a kind from the letters of its fields: a coordinate, a coordinate of a unit vector,
/// an angle, a radius, or none.
const fn limits(kind: u32, fields: &[u8; 9]) -> Limits {
    let mut limits = Limits { masks: [u32::MAX; WORDS], most: [0; WORDS] };
    limits.most[0] = kind;
    let mut field = 0;
    while field < fields.len() {
        let (mask, most) = match fields[field] {
            b'c' => (MAGNITUDE, MAX_COORDINATE),
            b'u' => (MAGNITUDE, 2.0),
            b'a' => (u32::MAX, PI),
            b'r' => (u32::MAX, MAX_COORDINATE),
            _ => (u32::MAX, 0.0),
        };
        limits.masks[1 + field] = mask;
        limits.most[1 + field] = most.to_bits();
        field += 1;
    }
    let mut channel = 10;
    while channel < 13 {
        limits.most[channel] = MAX_EMISSION.to_bits();
        channel += 1;
    }
    limits.most[13] = f32::INFINITY.to_bits();
    limits
}

/// The index in [`KINDS`] of the kind of a record. `None` for an unknown kind.
#[inline(always)]
pub(super) fn kind_of(record: &Record) -> Option<usize> {
    match record[0] {
        kind @ 0..=PROFILE => Some(kind as usize),
        kind if kind == KINDS[6] => Some(6),
        kind if kind == KINDS[7] => Some(7),
        _ => None,
    }
}

/// Whether a record of the kind `KINDS[kind]` is certainly one of a valid light. Has no branches:
/// kinds come in any order.
#[inline(always)]
pub(super) fn is_certainly_valid(record: &Record, kind: usize) -> bool {
    let Limits { masks, most } = &LIMITS[kind];
    let mut excess = 0;
    for i in 0..WORDS {
        excess |= (record[i] & masks[i]).saturating_sub(most[i]);
    }
    let has_range = record[WORDS - 1] != 0;
    (excess == 0) & has_range & ((record[0] != SPOT) | is_certainly_spot(record))
}

/// What else holds for a spot whose numbers are within the limits.
#[inline(always)]
fn is_certainly_spot(record: &Record) -> bool {
    let [x, y, z] = [4, 5, 6].map(|at| f32::from_bits(record[at]));
    let length_sq = x * x + y * y + z * z;
    ((length_sq - 1.0).abs() <= UNIT_TOLERANCE_SQ) & (record[7] <= record[8])
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::light::Light;
    use crate::tree::bake::light_record::{decode, encode};
    use crate::tree::testing::Rng;

    fn is_accepted(record: &Record) -> bool {
        kind_of(record).is_some_and(|kind| is_certainly_valid(record, kind))
    }

    fn ordinary() -> Vec<Light> {
        let (a, b, c) = (Vec3::new(-3.0, 0.0, 2.0e3), Vec3::new(0.5, -1.0e-3, 0.0), Vec3::new(0.0, 7.0, 1.0));
        let sides = [Light::rectangle(a, b, c, Vec3::ONE), Light::triangle([a, b, c], Vec3::ZERO)];
        let others = [
            Light::point(a, Vec3::splat(1.0e15)),
            Light::spot(a, Vec3::NEG_Y, 0.0, PI, Vec3::ONE).with_range(3.0),
            Light::sphere(a, 0.0, Vec3::X),
        ];
        sides.into_iter().flat_map(|light| [light, light.two_sided()]).chain(others).collect()
    }

    #[test]
    fn ordinary_lights_of_all_kinds_are_accepted() {
        let lights = ordinary();
        let mut kinds: Vec<_> = lights.iter().map(|light| encode(light)[0]).collect();
        kinds.sort_unstable();
        assert_eq!(kinds, [0, 1, 2, 3, 4, 0x102, 0x103]);
        assert!(lights.iter().all(|light| is_accepted(&encode(light))), "{lights:?}");
        assert!((0..).zip(KINDS).all(|(index, kind)| kind_of(&[kind; WORDS]) == Some(index)));
    }

    #[test]
    fn no_record_is_accepted_that_the_exact_check_refuses() {
        let mut rng = Rng(31);
        let numbers: Vec<f32> = [0.0, 1.0, 2.0, PI, 1.0e9, 1.0e15, f32::MAX, f32::INFINITY, f32::NAN, 1.0e-40, 1.001]
            .into_iter()
            .flat_map(|v| [v, -v, v.next_up(), v.next_down()])
            .collect();
        let (mut accepted, mut refused) = (0, 0);
        for light in ordinary() {
            for _ in 0..20_000 {
                let mut record = encode(&light);
                for _ in 0..1 + rng.below(3) {
                    let value =
                        if rng.below(4) == 0 { rng.bits() as u32 } else { numbers[rng.below(numbers.len())].to_bits() };
                    record[rng.below(WORDS)] = value;
                }
                let is_valid = decode(&record, 0).is_ok();
                assert!(is_valid || !is_accepted(&record), "{record:x?}");
                accepted += usize::from(is_accepted(&record));
                refused += usize::from(!is_valid);
            }
        }
        assert!(accepted > 5000 && refused > 50_000, "{accepted} {refused}");
    }
}
