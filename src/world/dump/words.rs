//! Numbers of 32 bits in a stream of bytes, with its checksum.

use std::io::{self, Write};

use crc32fast::Hasher;
use glam::{DVec3, Vec3};

/// Bytes of a number.
pub(super) const WORD: usize = size_of::<u32>();

/// Where a dump is written.
pub(super) struct Sink<'a, W: Write> {
    out: &'a mut W,
    sum: Hasher,
}

impl<'a, W: Write> Sink<'a, W> {
    pub fn new(out: &'a mut W) -> Self {
        Self { out, sum: Hasher::new() }
    }

    pub fn bytes(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.sum.update(bytes);
        self.out.write_all(bytes)
    }

    pub fn words(&mut self, words: &[u32]) -> io::Result<()> {
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        self.bytes(&bytes)
    }

    /// Writes the checksum of all that was written.
    pub fn finish(self) -> io::Result<()> {
        self.out.write_all(&self.sum.finalize().to_le_bytes())
    }
}

/// The rest of a dump that is read.
pub(super) struct Rest<'a>(pub &'a [u8]);

impl<'a> Rest<'a> {
    /// The next bytes; `None` if there are fewer.
    pub fn bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let (bytes, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(bytes)
    }

    /// The next `count` numbers; `None` if there are fewer, and then nothing is allocated.
    pub fn list(&mut self, count: usize) -> Option<Vec<u32>> {
        let bytes = self.bytes(count.checked_mul(WORD)?)?;
        Some(bytes.chunks_exact(WORD).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]])).collect())
    }

    /// The next `N` numbers; `None` if there are fewer.
    pub fn words<const N: usize>(&mut self) -> Option<[u32; N]> {
        self.list(N)?.try_into().ok()
    }
}

/// The numbers of a point in f64, each the lower half first.
pub(super) fn of_point(point: DVec3) -> [u32; 6] {
    let [x, y, z] = point.to_array().map(f64::to_bits).map(|bits| [bits as u32, (bits >> 32) as u32]);
    [x[0], x[1], y[0], y[1], z[0], z[1]]
}

pub(super) fn to_point(words: [u32; 6]) -> DVec3 {
    DVec3::from_array([0, 2, 4].map(|at| f64::from_bits(u64::from(words[at]) | u64::from(words[at + 1]) << 32)))
}

pub(super) fn of_vector(vector: Vec3) -> [u32; 3] {
    vector.to_array().map(f32::to_bits)
}

pub(super) fn to_vector(words: [u32; 3]) -> Vec3 {
    Vec3::from_array(words.map(f32::from_bits))
}
