//! Damaged files, at random: none loads, but for those that the damage has not changed.

use proptest::prelude::*;

use super::*;
use crate::tree::testing::Rng;

/// One damage to a file.
#[derive(Clone, Debug)]
enum Damage {
    /// Bits are flipped.
    Flip(Vec<(usize, u8)>),
    /// The end is missing.
    Truncate(usize),
    /// Bytes are missing in the middle.
    Cut(usize, usize),
    /// Bytes are copied over others.
    Copy(usize, usize, usize),
    /// A piece of another file is put in the place of as many bytes.
    Splice(usize, usize),
    /// A number is replaced.
    Number(usize, u32),
    /// Bytes are added.
    Append(Vec<u8>),
    /// The bytes of all numbers are reversed.
    Reverse,
}

fn damage() -> impl Strategy<Value = Damage> {
    let place = any::<usize>;
    let number = prop_oneof![Just(0), Just(u32::MAX), Just(1 << 31), Just(1 << 29), any::<u32>()];
    prop_oneof![
        4 => proptest::collection::vec((place(), any::<u8>()), 1..6).prop_map(Damage::Flip),
        2 => place().prop_map(Damage::Truncate),
        1 => (place(), 1_usize..500).prop_map(|(at, count)| Damage::Cut(at, count)),
        2 => (place(), place(), 1_usize..500).prop_map(|(from, to, count)| Damage::Copy(from, to, count)),
        2 => (place(), 1_usize..5000).prop_map(|(at, count)| Damage::Splice(at, count)),
        // The first forty numbers are the header.
        4 => (0_usize..40, number).prop_map(|(at, value)| Damage::Number(4 * at, value)),
        1 => proptest::collection::vec(any::<u8>(), 1..300).prop_map(Damage::Append),
        1 => Just(Damage::Reverse),
    ]
}

impl Damage {
    fn apply(&self, bytes: &mut Vec<u8>, other: &[u8]) {
        let length = bytes.len().max(1);
        match self {
            _ if bytes.is_empty() => {}
            Self::Flip(flips) => flips.iter().for_each(|(at, mask)| bytes[at % length] ^= mask),
            Self::Truncate(at) => bytes.truncate(at % length),
            Self::Cut(at, count) => {
                let at = at % length;
                bytes.drain(at..(at + count).min(length));
            }
            Self::Copy(from, to, count) => {
                let (from, to) = (from % length, to % length);
                let count = *count.min(&(length - from.max(to)));
                bytes.copy_within(from..from + count, to);
            }
            Self::Splice(at, count) => {
                let at = at % length.min(other.len());
                let end = (at + count).min(length).min(other.len());
                bytes[at..end].copy_from_slice(&other[at..end]);
            }
            Self::Number(at, value) if at + 4 <= length => {
                bytes[*at..at + 4].copy_from_slice(&value.to_le_bytes());
            }
            Self::Number(..) => {}
            Self::Append(more) => bytes.extend(more),
            Self::Reverse => bytes.chunks_mut(4).for_each(<[u8]>::reverse),
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    /// A damaged file passes the checksum by chance once in 2^32 files.
    #[test]
    fn a_damaged_file_is_refused_or_holds_the_tree_that_was_baked(
        seed in 0_u64..40,
        count in 0_usize..150,
        damages in proptest::collection::vec(damage(), 1..4),
    ) {
        let mut rng = Rng(seed);
        let tree = LightTree::build(any_lights(&mut rng, count));
        let whole = tree.bake();
        let other = LightTree::build(any_lights(&mut rng, count)).bake();
        let mut bytes = whole.clone();
        damages.iter().for_each(|damage| damage.apply(&mut bytes, &other));
        match LightTree::from_baked(&bytes) {
            Err(error) => {
                prop_assert!(bytes != whole, "{error}");
                prop_assert!(matches!(error.code(), 1100..=1102), "{error}");
            }
            Ok(loaded) => {
                let expected = [&whole, &other].into_iter().find(|written| **written == bytes);
                prop_assert!(expected.is_some(), "a damaged file was loaded");
                prop_assert!(loaded.check().is_ok());
                prop_assert_eq!(loaded.bake(), bytes);
            }
        }
    }
}
