//! Files of this library: the mark of a format, a version, values as they lie in memory, and a checksum.
//!
//! | bytes | content |
//! |---:|---|
//! | 8 | the mark of the format |
//! | 4 | the version |
//! | any | values, one after the other |
//! | 4 | CRC-32 of all other bytes |
//!
//! Values are plain data without padding, so they are copied and not encoded. Numbers have the least
//! significant byte first, as on every machine that the feature `bake` compiles for.

use std::io::{self, Write};

use bytemuck::{AnyBitPattern, NoUninit};
use crc32fast::Hasher;

use crate::error::LoadError;

#[cfg(target_endian = "big")]
compile_error!("the feature `bake` is for machines that store the least significant byte of a number first");

/// The first bytes of the files of a format. The first is not ASCII and the last two are a line
/// end, so that a transfer as text is noticed at once.
pub(crate) type Mark = [u8; 8];

/// The version of all formats. It rises with every change of a value or of what it means: `Node` and
/// what packs and samples it, `Cluster`, `Attributes`, `Light`, the headers of trees and dumps.
pub(crate) const VERSION: u32 = 6;

/// Bytes of a version and of a checksum.
const WORD: usize = size_of::<u32>();

/// Bytes before the first value.
#[cfg(test)]
pub(crate) const PREFIX_BYTES: usize = size_of::<Mark>() + WORD;

/// Bytes that one thread sums in turn, about a tenth of a millisecond of work. To join the checksums of
/// two pieces takes microseconds.
const PIECE_BYTES: usize = 1 << 20;

/// A file that is being written.
pub(crate) struct FileWriter<W> {
    out: W,
    sum: Hasher,
}

impl<W: Write> FileWriter<W> {
    pub fn new(mark: &Mark, out: W) -> io::Result<Self> {
        let mut file = Self { out, sum: Hasher::new() };
        file.list(mark)?;
        file.value(&VERSION)?;
        Ok(file)
    }

    pub fn value<T: NoUninit>(&mut self, value: &T) -> io::Result<()> {
        self.list(std::slice::from_ref(value))
    }

    pub fn list<T: NoUninit>(&mut self, values: &[T]) -> io::Result<()> {
        let bytes = bytemuck::cast_slice(values);
        self.sum.update(bytes);
        self.out.write_all(bytes)
    }

    /// Writes the checksum. Returns where the file was written.
    pub fn finish(mut self) -> io::Result<W> {
        self.out.write_all(&self.sum.finalize().to_le_bytes())?;
        Ok(self.out)
    }
}

/// The rest of a file that is being read.
pub(crate) struct FileReader<'a> {
    rest: &'a [u8],
}

impl<'a> FileReader<'a> {
    /// Checks that some bytes are a file of this format and version, whole and undamaged.
    pub fn open(expected: &'static str, mark: &Mark, bytes: &'a [u8]) -> Result<Self, LoadError> {
        let content = bytes.strip_prefix(mark).ok_or(LoadError::Format { expected })?;
        let damaged = LoadError::Damaged { bytes: bytes.len() };
        let (version, content) = content.split_first_chunk().ok_or(damaged.clone())?;
        let version = u32::from_le_bytes(*version);
        // Other versions may be sealed in another way.
        if version != VERSION {
            return Err(LoadError::Version { given: version, supported: VERSION });
        }
        let (content, stored) = content.split_last_chunk::<WORD>().ok_or(damaged.clone())?;
        let summed = &bytes[..bytes.len() - WORD];
        if checksum(summed) == u32::from_le_bytes(*stored) { Ok(Self { rest: content }) } else { Err(damaged) }
    }

    /// The next `count` values, as bytes.
    pub fn section<T>(&mut self, count: usize) -> Result<&'a [u8], LoadError> {
        let section = count.checked_mul(size_of::<T>()).and_then(|bytes| self.rest.split_at_checked(bytes));
        let (section, rest) = section.ok_or_else(|| {
            let left = self.rest.len();
            LoadError::content("the length", format_args!("{count} values do not fit into the {left} bytes left"))
        })?;
        self.rest = rest;
        Ok(section)
    }

    pub fn value<T: AnyBitPattern>(&mut self) -> Result<T, LoadError> {
        self.section::<T>(1).map(bytemuck::pod_read_unaligned)
    }

    /// The next `count` values. Nothing is allocated if there are fewer.
    pub fn list<T: AnyBitPattern + Send>(&mut self, count: usize) -> Result<Vec<T>, LoadError> {
        Ok(map(self.section::<T>(count)?, |value| value))
    }

    /// Checks that nothing follows.
    pub fn finish(self) -> Result<(), LoadError> {
        match self.rest.len() {
            0 => Ok(()),
            bytes => Err(LoadError::content("the length", format_args!("{bytes} bytes follow the last value"))),
        }
    }
}

/// What a function makes of each value of a section, in parallel.
pub(crate) fn map<T: AnyBitPattern, U: Send>(section: &[u8], of: impl Fn(T) -> U + Sync) -> Vec<U> {
    let of = |bytes: &[u8]| of(bytemuck::pod_read_unaligned(bytes));
    #[cfg(feature = "parallel")]
    if section.len() > PIECE_BYTES {
        use rayon::prelude::*;
        let values = section.par_chunks_exact(size_of::<T>());
        return values.with_min_len(PIECE_BYTES / size_of::<T>()).map(of).collect();
    }
    section.chunks_exact(size_of::<T>()).map(of).collect()
}

/// What a function makes of each piece of some bytes, in parallel. Pieces have whole values, and are given
/// with the index of the first.
pub(crate) fn map_pieces<T, U: Send>(bytes: &[u8], of: impl Fn(usize, &[u8]) -> U + Sync) -> Vec<U> {
    let values = PIECE_BYTES / size_of::<T>();
    let of = |(piece, bytes): (usize, &[u8])| of(piece * values, bytes);
    #[cfg(feature = "parallel")]
    if bytes.len() > PIECE_BYTES {
        use rayon::prelude::*;
        return bytes.par_chunks(values * size_of::<T>()).enumerate().map(of).collect();
    }
    bytes.chunks(values * size_of::<T>()).enumerate().map(of).collect()
}

/// CRC-32, in parallel.
fn checksum(bytes: &[u8]) -> u32 {
    let sums = map_pieces::<u8, _>(bytes, |_, piece| {
        let mut sum = Hasher::new();
        sum.update(piece);
        sum
    });
    let mut all = Hasher::new();
    sums.iter().for_each(|sum| all.combine(sum));
    all.finalize()
}

/// Writes the right checksum at the end of a file that was changed.
#[cfg(test)]
pub(crate) fn seal(bytes: &mut [u8]) {
    let (content, sum) = bytes.split_last_chunk_mut::<WORD>().expect("a file");
    *sum = checksum(content).to_le_bytes();
}
