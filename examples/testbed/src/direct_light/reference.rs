//! The converged picture that errors are measured against. It is computed in passes and saved after
//! each, so that a run that was interrupted continues, and another run with the same view starts
//! with what is there.

use girandole::glam::{DVec3, Vec3};
use girandole::light::luminance;
use std::fs;
use std::hash::{DefaultHasher, Hasher};
use std::path::{Path, PathBuf};

/// The first bytes of a file; the last digit is the version of the format.
const MAGIC: &[u8; 8] = b"girref_1";
/// Bytes before the first pixel: the magic number, the key, the number of passes and of pixels.
const HEADER: usize = 32;
/// Numbers of each pixel: the sums of three channels and of the squared luminance.
const CHANNELS: usize = 4;

/// Identifies what a reference shows: equal views of equal scenes have equal keys.
pub struct Key(DefaultHasher);

impl Key {
    /// The key of nothing.
    pub fn new() -> Self {
        Self(DefaultHasher::new())
    }

    /// Adds a part of what is shown.
    pub fn add(mut self, bytes: &[u8]) -> Self {
        self.0.write(bytes);
        self
    }
}

/// Passes of equal weight, summed up.
pub struct Reference {
    path: PathBuf,
    key: u64,
    passes: u64,
    sums: Vec<[f64; CHANNELS]>,
}

impl Reference {
    /// The reference in a file, or an empty one if the file does not exist, is damaged or shows
    /// something else.
    pub fn open(path: &Path, key: Key, pixels: usize) -> Self {
        let key = key.0.finish();
        let read = fs::read(path).ok().and_then(|bytes| parse(&bytes, key, pixels));
        let (passes, sums) = read.unwrap_or_else(|| (0, vec![[0.0; CHANNELS]; pixels]));
        Self { path: path.to_owned(), key, passes, sums }
    }

    /// The number of passes so far.
    pub fn passes(&self) -> u64 {
        self.passes
    }

    /// Adds a pass, which must be independent of all others, and saves the result. An interruption
    /// leaves the former file or the new one. An error is one line for the user.
    pub fn add(&mut self, pass: &[Vec3]) -> Result<(), String> {
        for (sum, pixel) in self.sums.iter_mut().zip(pass) {
            let DVec3 { x, y, z } = pixel.as_dvec3();
            for (sum, value) in sum.iter_mut().zip([x, y, z, f64::from(luminance(*pixel)).powi(2)]) {
                *sum += value;
            }
        }
        self.passes += 1;
        let mut bytes = Vec::with_capacity(HEADER + self.sums.len() * CHANNELS * 8);
        bytes.extend(MAGIC);
        [self.key, self.passes, self.sums.len() as u64].iter().for_each(|word| bytes.extend(word.to_le_bytes()));
        self.sums.iter().flatten().for_each(|value| bytes.extend(value.to_le_bytes()));
        let draft = self.path.with_extension("draft");
        let saved = fs::write(&draft, bytes).and_then(|()| fs::rename(&draft, &self.path));
        saved.map_err(|error| format!("cannot write {}: {error}", self.path.display()))
    }

    /// The mean of all passes; black without any.
    pub fn picture(&self) -> Vec<Vec3> {
        let per_pass = 1.0 / self.passes.max(1) as f64;
        self.sums.iter().map(|[x, y, z, _]| (DVec3::new(*x, *y, *z) * per_pass).as_vec3()).collect()
    }

    /// The squared standard error of the luminance of each pixel, as far as the passes show it.
    /// Infinite below two passes.
    pub fn variance(&self) -> Vec<f64> {
        let count = self.passes as f64;
        let of = |[x, y, z, squares]: &[f64; CHANNELS]| {
            let mean = f64::from(luminance((DVec3::new(*x, *y, *z) / count).as_vec3()));
            (squares / count - mean * mean).max(0.0) / (count - 1.0)
        };
        if self.passes < 2 { vec![f64::INFINITY; self.sums.len()] } else { self.sums.iter().map(of).collect() }
    }
}

/// The passes and sums of a file, if it has this key and this many pixels.
fn parse(bytes: &[u8], key: u64, pixels: usize) -> Option<(u64, Vec<[f64; CHANNELS]>)> {
    let (header, body) = bytes.split_at_checked(HEADER)?;
    let word = |index: usize| Some(u64::from_le_bytes(header[8 * index..8 * index + 8].try_into().ok()?));
    let is_same = &header[..8] == MAGIC && word(1)? == key && word(3)? == pixels as u64;
    if !is_same || body.len() != pixels * CHANNELS * 8 {
        return None;
    }
    let value = |bytes: &[u8]| f64::from_le_bytes(bytes.try_into().unwrap_or_default());
    let pixel = |bytes: &[u8]| std::array::from_fn(|i| value(&bytes[8 * i..8 * i + 8]));
    Some((word(2)?, body.chunks_exact(8 * CHANNELS).map(pixel).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reference_continues_where_it_stopped_and_ignores_files_of_other_views() {
        let path = std::env::temp_dir().join(format!("girandole_reference_{}.bin", std::process::id()));
        let key = |what: &[u8]| Key::new().add(what);
        let mut reference = Reference::open(&path, key(b"a"), 2);
        assert_eq!(reference.passes(), 0);
        reference.add(&[Vec3::ONE, Vec3::ZERO]).expect("a writable folder");
        reference.add(&[Vec3::splat(3.0), Vec3::ZERO]).expect("a writable folder");
        let again = Reference::open(&path, key(b"a"), 2);
        assert_eq!((again.passes(), again.picture()), (2, vec![Vec3::splat(2.0), Vec3::ZERO]));
        // Luminances 1 and 3: their variance is 2, that of their mean 1.
        assert!((again.variance()[0] - 1.0).abs() < 1e-6 && again.variance()[1] == 0.0);
        assert_eq!(Reference::open(&path, key(b"b"), 2).passes(), 0);
        assert_eq!(Reference::open(&path, key(b"a"), 3).passes(), 0);
        let bytes = fs::read(&path).expect("the file was written");
        fs::write(&path, &bytes[..bytes.len() - 1]).expect("a writable file");
        assert_eq!(Reference::open(&path, key(b"a"), 2).passes(), 0);
        fs::remove_file(&path).expect("the test made it");
    }
}
