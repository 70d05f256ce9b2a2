//! Checks what is in a file: its checksum, and the records of its lights.
//!
//! The file is divided into pieces, which threads check independently. A piece of lights is summed
//! and checked in turn, block by block, so that the check finds the block in the cache.

use std::ops::Range;

use crc32fast::Hasher;

use super::error::BakeError;
use super::header::{CHECKSUM, HEADER_BYTES};
use super::light_check::{self, KINDS};
use super::light_record::{self, LIGHT_BYTES, PROFILE, REMOVED, WORDS};
use super::words;
use crate::effects::{EffectCounts, Effects};
use crate::light::PROFILE_EFFECTS;

/// Lights that are checked right after their bytes were summed: 56 KiB, which fit into the
/// second-level cache of any machine.
const BLOCK_LIGHTS: usize = 1024;

/// Bytes of a piece, about a tenth of a millisecond of work. To join the checksums of two pieces
/// takes microseconds.
const PIECE_BYTES: usize = 16 * BLOCK_LIGHTS * LIGHT_BYTES;

/// The range of a light that has none.
const NO_RANGE: u32 = f32::INFINITY.to_bits();

/// The numbers of lights of each kind, without a range and with one.
type Histogram = [[u64; 2]; KINDS.len()];

/// A piece of the file after the header.
#[derive(Clone, Copy)]
struct Piece<'a> {
    bytes: &'a [u8],
    /// The index of the first light, if these are the records of lights.
    first_light: Option<usize>,
}

/// What was found in some pieces that follow one another.
struct Findings {
    sum: Hasher,
    lights: Histogram,
    /// The records of removed lights.
    removed: usize,
    /// What is wrong with the first invalid light.
    fault: Option<BakeError>,
}

/// Checks a file of the length that its header requires. `lights` is the place of the section of its
/// lights. Returns the effects of the lights, and the number of lights that were removed.
///
/// A wrong checksum is reported before anything else that is wrong: the file is then damaged, and
/// everything else follows from it. Of several invalid lights the first is reported.
pub(super) fn check(bytes: &[u8], lights: Range<usize>) -> Result<(EffectCounts, usize), BakeError> {
    let Findings { sum, lights, removed, fault } = findings(bytes, lights);
    let [stored] = words::read_array(&bytes[CHECKSUM]);
    let computed = sum.finalize();
    if stored != computed {
        return Err(BakeError::Checksum { stored, computed });
    }
    if let Some(fault) = fault {
        return Err(fault);
    }
    let mut effects = EffectCounts::default();
    for (kind, counts) in KINDS.into_iter().zip(lights) {
        for (range, count) in [f32::INFINITY, 1.0].into_iter().zip(counts) {
            effects.add_several(effects_of(kind, range), count);
        }
    }
    Ok((effects, removed))
}

/// Writes the checksum of a file into its header.
pub(super) fn seal(bytes: &mut [u8]) {
    let mut sum = sum_of_header(bytes);
    sum.update(&bytes[HEADER_BYTES..]);
    bytes[CHECKSUM].copy_from_slice(&sum.finalize().to_le_bytes());
}

/// The checksum of the header but for the checksum in it.
fn sum_of_header(bytes: &[u8]) -> Hasher {
    let mut sum = Hasher::new();
    sum.update(&bytes[..CHECKSUM.start]);
    sum.update(&bytes[CHECKSUM.end..HEADER_BYTES]);
    sum
}

/// The pieces of a file, in order. Pieces of lights hold whole records.
fn pieces(bytes: &[u8], lights: Range<usize>) -> impl Iterator<Item = Piece<'_>> {
    let plain = |range: Range<usize>| bytes[range].chunks(PIECE_BYTES).map(|bytes| Piece { bytes, first_light: None });
    let (before, after) = (plain(HEADER_BYTES..lights.start), plain(lights.end..bytes.len()));
    let of_lights = bytes[lights]
        .chunks(PIECE_BYTES)
        .enumerate()
        .map(|(index, bytes)| Piece { bytes, first_light: Some(index * (PIECE_BYTES / LIGHT_BYTES)) });
    before.chain(of_lights).chain(after)
}

/// What is found in a file. Small ones are left to one thread.
fn findings(bytes: &[u8], lights: Range<usize>) -> Findings {
    let mut all = Findings::after(sum_of_header(bytes));
    #[cfg(feature = "parallel")]
    if bytes.len() > 2 * PIECE_BYTES {
        use rayon::prelude::*;
        let pieces: Vec<_> = pieces(bytes, lights).collect();
        let of_piece = |piece: &Piece<'_>| {
            let mut findings = Findings::after(Hasher::new());
            findings.examine(piece);
            findings
        };
        let findings: Vec<_> = pieces.par_iter().map(of_piece).collect();
        findings.into_iter().for_each(|findings| all.append(findings));
        return all;
    }
    pieces(bytes, lights).for_each(|piece| all.examine(&piece));
    all
}

impl Findings {
    /// Nothing yet, after what `sum` has summed.
    fn after(sum: Hasher) -> Self {
        Self { sum, lights: Histogram::default(), removed: 0, fault: None }
    }

    /// Adds the next piece.
    fn examine(&mut self, piece: &Piece<'_>) {
        let Some(first) = piece.first_light else { return self.sum.update(piece.bytes) };
        for (block, bytes) in piece.bytes.chunks(BLOCK_LIGHTS * LIGHT_BYTES).enumerate() {
            self.sum.update(bytes);
            if self.fault.is_none() {
                self.fault =
                    check_lights(first + block * BLOCK_LIGHTS, bytes, &mut self.lights, &mut self.removed).err();
            }
        }
    }

    /// Adds what was found in the pieces that follow.
    #[cfg(feature = "parallel")]
    fn append(&mut self, next: Self) {
        self.sum.combine(&next.sum);
        self.lights
            .as_flattened_mut()
            .iter_mut()
            .zip(next.lights.as_flattened())
            .for_each(|(sum, count)| *sum += count);
        self.removed += next.removed;
        self.fault = self.fault.take().or(next.fault);
    }
}

/// Checks and counts the lights in some records. `first` is the index of the first.
fn check_lights(first: usize, records: &[u8], counts: &mut Histogram, removed: &mut usize) -> Result<(), BakeError> {
    for (index, record) in (first..).zip(records.chunks_exact(LIGHT_BYTES)) {
        let record = light_record::read(record);
        let kind = light_check::kind_of(&record).filter(|kind| light_check::is_certainly_valid(&record, *kind));
        let kind = match kind {
            Some(kind) => kind,
            None if record == REMOVED => {
                *removed += 1;
                continue;
            }
            None => {
                let light = light_record::decode(&record, index)?;
                // The kind of a valid light is known.
                light_check::kind_of(&light_record::encode(&light)).unwrap_or_default()
            }
        };
        counts[kind][usize::from(record[WORDS - 1] != NO_RANGE)] += 1;
    }
    Ok(())
}

/// The effects of the lights of a kind that have this range.
fn effects_of(kind: u32, range: f32) -> Effects {
    let mut record = [0; WORDS];
    record[0] = kind;
    // Which profile it is does not matter.
    let of_shape = if kind == PROFILE { PROFILE_EFFECTS } else { Effects::empty() };
    of_shape | light_record::decode_accepted(&record).with_range(range).effects()
}
