//! The header of a baked tree: what the file is, how much it holds, and the values of the tree as a
//! whole.
//!
//! The numbers of records are checked against the length of the file before anything is allocated.

use std::ops::Range;

use glam::Mat3;

use super::error::BakeError;
use super::light_record::LIGHT_BYTES;
use super::node_record::NODE_BYTES;
use super::words::{self, CLUSTER_WORDS, WORD};
use crate::cluster::{Cluster, Linear, MAX_SCALE};
use crate::tree::attributes::Attributes;
use crate::tree::node::{MAX_LIGHTS, WIDTH};

/// The first bytes of every version of the format. The first is not ASCII and the last two are a
/// line end, so that a transfer as text is noticed at once.
const MAGIC: [u8; 8] = *b"\x89GTREE\r\n";

/// Written as a number. Reads as [`SWAPPED_MARK`] if the bytes of all numbers were reversed.
const BYTE_ORDER_MARK: u32 = 0x0102_0304;

const SWAPPED_MARK: u32 = BYTE_ORDER_MARK.swap_bytes();

/// The version of the format. It rises with every change of a record or of what its values mean:
/// `Node` and what packs and samples it, `Cluster`, `Light`, the header.
pub(super) const VERSION: u32 = 4;

/// Bytes that have the same meaning in every version.
const IDENTITY_BYTES: usize = MAGIC.len() + 2 * WORD;

/// The place of the checksum, which is not part of what it sums.
pub(super) const CHECKSUM: Range<usize> = IDENTITY_BYTES..IDENTITY_BYTES + WORD;

/// Numbers after the checksum: flags, three counts, the cost, the attributes, the cluster, the
/// reference.
const VALUE_WORDS: usize = 1 + 3 + 1 + 4 + CLUSTER_WORDS + 9;

/// Bytes of the header.
pub(super) const HEADER_BYTES: usize = CHECKSUM.end + VALUE_WORDS * WORD;

/// A flag: some sums of attributes are older than the nodes.
const HAS_STALE_SUMS: u32 = 1;
/// A flag: the tree has a reference.
const HAS_REFERENCE: u32 = 2;

/// The largest number of nodes: the place of a child, `node * WIDTH + slot`, has 32 bits.
const MAX_NODES: u32 = u32::MAX / WIDTH as u32;

/// The values of a tree as a whole.
#[derive(Clone, Debug)]
pub(super) struct Header {
    pub counts: Counts,
    /// The cost of the tree as it was built.
    pub built_cost: f32,
    pub has_stale_sums: bool,
    pub attributes: Attributes,
    pub root: Cluster,
    /// The matrix of the reference, if there is one.
    pub reference: Option<Mat3>,
}

/// The numbers of records in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Counts {
    pub lights: usize,
    pub nodes: usize,
    pub sides: usize,
}

/// The parts of a file after the header, in this order.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sections<'a> {
    /// A cluster for each side.
    pub sides: &'a [u8],
    /// A record for each light.
    pub lights: &'a [u8],
    /// A record for each node.
    pub nodes: &'a [u8],
    /// A number for each light.
    pub leaves: &'a [u8],
    /// A number for each node.
    pub light_counts: &'a [u8],
}

impl Counts {
    /// The bytes of each section.
    fn sizes(&self) -> [u64; 5] {
        let size = |count: usize, bytes: usize| count as u64 * bytes as u64;
        let words = |count: usize| size(count, WORD);
        [
            words(self.sides * CLUSTER_WORDS),
            size(self.lights, LIGHT_BYTES),
            size(self.nodes, NODE_BYTES),
            words(self.lights),
            words(self.nodes),
        ]
    }

    /// The place of the lights in a file of the right length.
    pub fn place_of_lights(&self) -> Range<usize> {
        let [sides, lights, ..] = self.sizes().map(|size| size as usize);
        HEADER_BYTES + sides..HEADER_BYTES + sides + lights
    }

    /// The bytes of the file.
    pub fn file_bytes(&self) -> u64 {
        HEADER_BYTES as u64 + self.sizes().iter().sum::<u64>()
    }
}

impl<'a> Sections<'a> {
    /// Divides a file of the right length.
    fn of(bytes: &'a [u8], counts: &Counts) -> Self {
        let mut rest = &bytes[HEADER_BYTES..];
        let [sides, lights, nodes, leaves, light_counts] = counts.sizes().map(|size| {
            // The file is this long, so its parts fit into `usize`.
            let (section, others) = rest.split_at(size as usize);
            rest = others;
            section
        });
        Self { sides, lights, nodes, leaves, light_counts }
    }
}

impl Header {
    /// Appends the header, with a checksum of 0.
    pub fn write(&self, out: &mut Vec<u8>) {
        let Self { counts, built_cost, has_stale_sums, attributes, root, reference } = self;
        let Attributes { distance, overlap, variance, splitting_cost } = *attributes;
        let flag = |is_set: bool, bit: u32| if is_set { bit } else { 0 };
        let flags = flag(*has_stale_sums, HAS_STALE_SUMS) | flag(reference.is_some(), HAS_REFERENCE);
        out.extend_from_slice(&MAGIC);
        words::write([BYTE_ORDER_MARK, VERSION, 0, flags], out);
        words::write([counts.lights, counts.nodes, counts.sides].map(|count| count as u32), out);
        words::write([*built_cost, distance, overlap, variance, splitting_cost].map(f32::to_bits), out);
        words::write(words::of_cluster(root), out);
        words::write(reference.unwrap_or(Mat3::ZERO).to_cols_array().map(f32::to_bits), out);
    }

    /// Checks that a file is a baked tree of this version and of the length that its header requires.
    /// Returns the numbers of its records, and the parts after the header. Allocates nothing.
    pub fn measure(bytes: &[u8]) -> Result<(Counts, Sections<'_>), BakeError> {
        check_identity(bytes)?;
        let given = bytes.len() as u64;
        let Some(values) = bytes.get(CHECKSUM.end..HEADER_BYTES) else {
            return Err(BakeError::Length { given, expected: HEADER_BYTES as u64 });
        };
        let [_, lights, nodes, sides] = words::read_array(values);
        let counts = Counts {
            lights: limited("lights", lights, MAX_LIGHTS as u32)?,
            nodes: limited("nodes", nodes, MAX_NODES)?,
            sides: limited("sides", sides, WIDTH as u32)?,
        };
        let expected = counts.file_bytes();
        if given != expected {
            return Err(BakeError::Length { given, expected });
        }
        Ok((counts, Sections::of(bytes, &counts)))
    }

    /// Reads the header of a file with these numbers of records, whose checksum is right.
    pub fn read(bytes: &[u8], counts: Counts) -> Result<Self, BakeError> {
        let refuse = |what| Err(BakeError::Record { what, index: 0 });
        let mut words = words::read(&bytes[CHECKSUM.end..HEADER_BYTES]);
        let mut next = || words.next().unwrap_or_default();
        let [flags, _, _, _, built_cost] = [(); 5].map(|()| next());
        let attributes = [(); 4].map(|()| f32::from_bits(next()));
        let root = words::to_cluster([(); CLUSTER_WORDS].map(|()| next()));
        let matrix = [(); 9].map(|()| next());
        let built_cost = f32::from_bits(built_cost);
        if flags & !(HAS_STALE_SUMS | HAS_REFERENCE) != 0 {
            return refuse("the header: a flag");
        }
        if built_cost.is_nan() || built_cost < 0.0 {
            return refuse("the header: the cost of the tree");
        }
        if !attributes.iter().all(|attribute| *attribute >= 0.0) {
            return refuse("the header: an attribute");
        }
        let reference = (flags & HAS_REFERENCE != 0).then(|| Mat3::from_cols_array(&matrix.map(f32::from_bits)));
        if !reference.map_or(matrix == [0; 9], |matrix| is_usable(&matrix)) {
            return refuse("the header: the reference");
        }
        let [distance, overlap, variance, splitting_cost] = attributes;
        let attributes = Attributes { distance, overlap, variance, splitting_cost };
        let has_stale_sums = flags & HAS_STALE_SUMS != 0;
        Ok(Self { counts, built_cost, has_stale_sums, attributes, root, reference })
    }
}

/// Whether an instance can have this linear part.
fn is_usable(matrix: &Mat3) -> bool {
    matrix.to_cols_array().iter().all(|entry| entry.abs() <= MAX_SCALE)
        && Linear::new(*matrix).least_scale >= 1.0 / MAX_SCALE
}

/// Checks what is the same in all versions, and the version.
fn check_identity(bytes: &[u8]) -> Result<(), BakeError> {
    let swapped = |magic: &[u8]| magic.chunks(WORD).flat_map(|word| word.iter().rev().copied()).eq(MAGIC);
    let magic = &bytes[..bytes.len().min(MAGIC.len())];
    if !MAGIC.starts_with(magic) {
        return Err(if swapped(magic) { BakeError::ByteOrder } else { BakeError::NotBaked });
    }
    let Some(identity) = bytes.get(MAGIC.len()..IDENTITY_BYTES) else {
        return Err(BakeError::Length { given: bytes.len() as u64, expected: HEADER_BYTES as u64 });
    };
    match words::read_array(identity) {
        [BYTE_ORDER_MARK, VERSION] => Ok(()),
        [BYTE_ORDER_MARK, given] => Err(BakeError::Version { given, supported: VERSION }),
        [SWAPPED_MARK, _] => Err(BakeError::ByteOrder),
        _ => Err(BakeError::NotBaked),
    }
}

fn limited(what: &'static str, given: u32, limit: u32) -> Result<usize, BakeError> {
    if given > limit { Err(BakeError::TooMany { what, given, limit }) } else { Ok(given as usize) }
}
