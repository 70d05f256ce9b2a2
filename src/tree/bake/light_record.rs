//! The record of a light: 14 numbers of 32 bits, whatever the shape.
//!
//! | numbers | content |
//! |---|---|
//! | 1 | the kind of the shape, plus [`TWO_SIDED`] |
//! | 9 | the fields of the shape in the order in which [`Shape`] lists them, then zeros; of a profile its number |
//! | 3 | the emission |
//! | 1 | the range |

use std::fmt::Display;

use glam::Vec3;

use crate::effects::EffectCounts;
use crate::error::LoadError;
use crate::file;
use crate::light::{Light, Shape};
use crate::profile::Profile;

/// Numbers of a record.
const WORDS: usize = 14;

const POINT: u32 = 0;
const SPOT: u32 = 1;
const RECTANGLE: u32 = 2;
const TRIANGLE: u32 = 3;
const SPHERE: u32 = 4;
const PROFILE: u32 = 5;

/// This bit is set in the kind of a rectangle or a triangle that emits from both sides.
const TWO_SIDED: u32 = 1 << 8;

/// The numbers of a record.
pub(super) type Record = [u32; WORDS];

/// The record of a light.
pub(super) fn encode(light: &Light) -> Record {
    let sided = |kind: u32, two_sided: bool| if two_sided { kind | TWO_SIDED } else { kind };
    let zero = Vec3::ZERO;
    let (kind, [a, b, c]) = match light.shape {
        Shape::Point { position } => (POINT, [position, zero, zero]),
        Shape::Spot { position, direction, inner_angle, outer_angle } => {
            (SPOT, [position, direction, Vec3::new(inner_angle, outer_angle, 0.0)])
        }
        Shape::Rectangle { center, half_u, half_v, two_sided } => {
            (sided(RECTANGLE, two_sided), [center, half_u, half_v])
        }
        Shape::Triangle { vertices, two_sided } => (sided(TRIANGLE, two_sided), vertices),
        Shape::Sphere { center, radius } => (SPHERE, [center, Vec3::new(radius, 0.0, 0.0), zero]),
        Shape::Profile { position, rotation: [x, y, z, w], .. } => {
            (PROFILE, [position, Vec3::new(x, y, z), Vec3::new(w, 0.0, 0.0)])
        }
    };
    let Light { emission, range, .. } = *light;
    let [a, b, c, emission] = [a, b, c, emission].map(|v| v.to_array().map(f32::to_bits));
    let [low, high] = match light.shape {
        Shape::Profile { profile, .. } => [profile.id() as u32, (profile.id() >> 32) as u32],
        _ => [c[1], c[2]],
    };
    [kind, a[0], a[1], a[2], b[0], b[1], b[2], c[0], low, high, emission[0], emission[1], emission[2], range.to_bits()]
}

/// The record of [`Light::REMOVED`].
const REMOVED: Record = [0; WORDS];

/// Checks that a tree accepts the [decoded](decode) lights of some records, or that they were removed. Returns their
/// effects and the number of removed lights.
///
/// # Errors
/// [`LoadError`] for the first record that [`encode`] never makes: of an unknown kind, with numbers other
/// than zero where the kind has no fields, of an invalid light, or of one whose profile was not made in
/// this process.
pub(super) fn check(records: &[u8], lights: &[Light]) -> Result<(EffectCounts, usize), LoadError> {
    let pieces = file::map_pieces::<Record, _>(records, |first, piece| {
        let (mut effects, mut removed) = (EffectCounts::default(), 0);
        for (index, record) in (first..).zip(piece.chunks_exact(size_of::<Record>())) {
            let record: Record = bytemuck::pod_read_unaligned(record);
            if record == REMOVED {
                removed += 1;
            } else {
                check_light(&record, &lights[index], index)?;
                effects.add(lights[index].effects());
            }
        }
        Ok((effects, removed))
    });
    let (mut effects, mut removed) = (EffectCounts::default(), 0);
    for piece in pieces {
        let (more_effects, more_removed) = piece?;
        effects.add_all(&more_effects);
        removed += more_removed;
    }
    Ok((effects, removed))
}

/// Checks that a tree accepts the light of a record. `index` is that of the light.
fn check_light(record: &Record, light: &Light, index: usize) -> Result<(), LoadError> {
    let id = id_of(record);
    if record[0] == PROFILE && Profile::of_id(id).is_none() {
        return Err(LoadError::Profile { light: index, id });
    }
    let refused = |why: &dyn Display| LoadError::content(format_args!("light {index}"), why);
    if encode(light) != *record {
        return Err(refused(&"a field has a value that is never written"));
    }
    light.validate().map_err(|error| refused(&error))
}

/// The light of a record that [`check`] accepts; some light for any other.
#[inline(always)]
pub(super) fn decode(record: Record) -> Light {
    let number = |at: usize| f32::from_bits(record[at]);
    let point = |first: usize| Vec3::new(number(first), number(first + 1), number(first + 2));
    let two_sided = record[0] & TWO_SIDED != 0;
    let shape = match record[0] & !TWO_SIDED {
        SPOT => Shape::Spot { position: point(1), direction: point(4), inner_angle: number(7), outer_angle: number(8) },
        RECTANGLE => Shape::Rectangle { center: point(1), half_u: point(4), half_v: point(7), two_sided },
        TRIANGLE => Shape::Triangle { vertices: [point(1), point(4), point(7)], two_sided },
        SPHERE => Shape::Sphere { center: point(1), radius: number(4) },
        PROFILE => match Profile::of_id(id_of(&record)) {
            Some(profile) => Shape::Profile { position: point(1), rotation: [4, 5, 6, 7].map(number), profile },
            None => Shape::Point { position: point(1) },
        },
        _ => Shape::Point { position: point(1) },
    };
    Light { shape, emission: point(10), range: number(13) }
}

/// The number of the profile of a record.
fn id_of(record: &Record) -> u64 {
    u64::from(record[8]) | u64::from(record[9]) << 32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::profile::tests::{of_degrees, street_lamp};

    fn bits(light: &Light) -> String {
        // Distinguishes the zeros, and shows NaN payloads as they are.
        format!("{light:?} {:?}", encode(light))
    }

    fn check_record(record: &Record, index: usize) -> Result<(), LoadError> {
        check_light(record, &decode(*record), index)
    }

    #[test]
    fn every_field_of_every_shape_keeps_its_bits() {
        // No two fields are equal, and some values are rare.
        let mut next = 0;
        let mut number = || {
            next += 1;
            [f32::from_bits(next), -0.0, f32::MAX, -1.5 * next as f32][next as usize % 4]
        };
        let mut vector = || Vec3::new(number(), number(), number());
        let mut shapes = vec![Shape::Point { position: vector() }];
        for two_sided in [false, true] {
            shapes.push(Shape::Rectangle { center: vector(), half_u: vector(), half_v: vector(), two_sided });
            shapes.push(Shape::Triangle { vertices: [vector(), vector(), vector()], two_sided });
        }
        let angles = vector();
        shapes.push(Shape::Spot {
            position: vector(),
            direction: vector(),
            inner_angle: angles.x,
            outer_angle: angles.y,
        });
        shapes.push(Shape::Sphere { center: vector(), radius: angles.z });
        for shape in shapes {
            for range in [f32::INFINITY, 7.0] {
                let light = Light { shape, emission: vector(), range };
                let back = decode(encode(&light));
                assert_eq!(bits(&back), bits(&light));
            }
        }
    }

    #[test]
    fn a_profile_is_found_by_its_number_and_refused_if_no_one_has_made_it() {
        let turn = glam::Quat::from_rotation_x(0.7);
        let lamp = Light::profile(Vec3::ONE, turn, street_lamp(33), Vec3::splat(0.5)).with_range(9.0);
        let record = encode(&lamp);
        assert_eq!((check_record(&record, 0), decode(record)), (Ok(()), lamp));
        let mut unknown = record;
        unknown[9] ^= 1;
        let id = id_of(&unknown);
        assert_eq!(check_record(&unknown, 7), Err(LoadError::Profile { light: 7, id }));
        // The same number in all versions, or files would not find their profiles.
        let known = of_degrees(&[0.0, 90.0], &[0.0], &[1.0, 2.0]);
        assert_eq!(known.id(), 0xb4b2_8028_0871_1fa7);
        let bright = encode(&Light::profile(Vec3::ONE, turn, known, Vec3::splat(0.6 * crate::light::MAX_EMISSION)));
        let error = check_record(&bright, 7).expect_err("too bright").to_string();
        assert!(error.starts_with("light 7: emission times the profile is "), "{error}");
    }

    #[test]
    fn the_record_of_a_removed_light_is_no_light() {
        assert_eq!(encode(&Light::REMOVED), REMOVED);
        assert!(decode(REMOVED).is_removed() && check_record(&REMOVED, 0).is_err());
        let records = [encode(&Light::point(Vec3::ONE, Vec3::ONE).with_range(2.0)), REMOVED, REMOVED];
        let effects = EffectCounts::one(crate::effects::Effects::RANGES);
        assert_eq!(check(bytemuck::cast_slice(&records)), Ok((effects, 2)));
    }

    #[test]
    fn records_that_are_never_written_are_refused() {
        let record = encode(&Light::point(Vec3::ONE, Vec3::ONE));
        assert!(check_record(&record, 0).is_ok());
        let refused = |record: &Record| check_record(record, 7).err();
        let expected = Some(LoadError::content("light 7", "a field has a value that is never written"));
        for (place, value) in [(0, 6), (0, u32::MAX), (0, TWO_SIDED), (4, 1), (9, 1 << 31)] {
            let mut wrong = record;
            wrong[place] = value;
            assert_eq!(refused(&wrong), expected, "{place} {value}");
        }
        let mut sphere = encode(&Light::sphere(Vec3::ONE, 1.0, Vec3::ONE));
        sphere[0] |= TWO_SIDED;
        assert_eq!(refused(&sphere), expected);
        let dim = encode(&Light::point(Vec3::ONE, -Vec3::ONE));
        let error = refused(&dim).expect("a light does not take light away").to_string();
        assert!(error.starts_with("light 7: emission.r is -1; it must be from 0 to "), "{error}");
    }
}
