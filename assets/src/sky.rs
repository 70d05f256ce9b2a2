//! Skies from Radiance HDR files: pixels of three channels with a common exponent, which the crate `image` decodes.
//!
//! Two checks come before it. The pixels that a file states must be possible with its length, and few for a small file,
//! so that such files take little memory. And run lengths that follow each other are limited, which the decoder multiplies without a check.

use std::io::{Error, ErrorKind, Read, Result as IoResult};

use girandole::Sky;
use glam::Vec3;
use image::codecs::hdr::HdrDecoder;
use image::error::UnsupportedErrorKind;
use image::{ImageDecoder, ImageError};

use crate::error::{AssetError, invalid};

/// The largest width and height of a sky.
const MAX_SIDE: u32 = 1 << 15;

/// What files begin with. The second one is that of writers which name the kind of pixels instead.
const SIGNATURES: [&[u8]; 2] = [b"#?RADIANCE\n", b"#?RGBE\n"];

/// Pixels of maps that a file of any length may have, if its rows can have so many: 8,192 x 2,048. They take 200 MB.
const FREE_PIXELS: u64 = 1 << 24;

/// Pixels for each byte of a file with a larger map, at most. The longest run of the present format has 127 pixels and
/// takes two bytes in each of four channels.
const MAX_PIXELS_OF_BYTE: u64 = 16;

/// Run lengths of the first version of the format that may follow each other. Two stand for up to 65,535
/// pixels, which is more than a row has.
const MAX_RUNS: usize = 2;

/// Makes a sky of the bytes of a Radiance HDR file, whose map is [equirectangular](Sky::equirectangular). Its
/// numbers count as nits: a [factor](girandole::Appearance::factor) of the sky's instance scales those of files
/// that mean something else. The lines EXPOSURE, COLORCORR and PRIMARIES are not regarded.
///
/// No bytes make this function panic, and it takes at most some 400 bytes of memory for each byte of the file.
/// Pixels may be flat or in runs of either version of the format, in the orientation that nearly all files have
/// (`-Y height +X width`).
///
/// O(pixels).
///
/// # Errors
/// [`AssetError::Invalid`] for
///
/// - what is no such file, is damaged, or has pixels of another format (XYZE) or order;
/// - more pixels than the bytes can hold, and a map of more than 2^24 pixels with more than 16 for each byte, which only
///   the runs of the format's first version could hold;
/// - a width or height that is 0 or above 32,768;
/// - a pixel above [`MAX_EMISSION`](girandole::light::MAX_EMISSION).
///
/// ```
/// use girandole_assets::girandole::glam::Vec3;
/// // Usually `std::fs::read("dusk.hdr")?`; here two pixels of three channels with a common exponent.
/// let file = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x10\x20\x30\x88\x40\x50\x60\x88";
/// let sky = girandole_assets::sky::hdr(file)?;
/// assert_eq!(sky.size(), [2, 1]);
/// assert_eq!(sky.radiance(Vec3::NEG_Z), Vec3::new(16.0, 32.0, 48.0));
/// # Ok::<(), girandole_assets::AssetError>(())
/// ```
pub fn hdr(file: &[u8]) -> Result<Sky, AssetError> {
    let (width, pixels) = read(file)?;
    Sky::equirectangular(width, &pixels).map_err(invalid)
}

/// The width of a file's map, and its pixels.
fn read(file: &[u8]) -> Result<(usize, Vec<Vec3>), AssetError> {
    let refused = |what: &str| invalid(format!("the file cannot be read: {what}"));
    // A header ends with an empty line.
    let mut lines = file.split(|byte| *byte == b'\n').take_while(|line| !line.is_empty());
    let mut refused_header = |what: &str| match lines.any(|line| line.ends_with(b"\r")) {
        true => refused("its lines end in CR and LF, not in LF alone: it was changed as if it were text"),
        false => refused(what),
    };
    if !SIGNATURES.iter().any(|signature| file.starts_with(signature)) {
        return Err(refused_header("its first line is not that of a Radiance HDR file"));
    }
    // Strict decoding would refuse the second signature.
    let decoder = HdrDecoder::new_nonstrict(Limited { rest: file, runs: 0 });
    let decoder = decoder.map_err(|error| refused_header(reason(&error, "its header is malformed")))?;
    let (width, height) = decoder.dimensions();
    if ![width, height].iter().all(|side| (1..=MAX_SIDE).contains(side)) {
        return Err(invalid(format!(
            "a map of {width} x {height} pixels; its width and height must be 1 to {MAX_SIDE}"
        )));
    }
    let (bytes, least) = (file.len(), least_bytes(width, height));
    if least > bytes as u64 {
        return Err(invalid(format!(
            "a file of {bytes} bytes cannot hold {width} x {height} pixels, which take {least} or more"
        )));
    }
    let mut pixels = Vec::new();
    let count = width as usize * height as usize;
    pixels.try_reserve_exact(count).map_err(|_| refused("its pixels take more memory than there is"))?;
    pixels.resize(count, Vec3::ZERO);
    let decoded = decoder.read_image(bytemuck::cast_slice_mut(&mut pixels));
    decoded.map_err(|error| refused(reason(&error, "the runs of a row are not as long as the row")))?;
    Ok((width as usize, pixels))
}

/// The fewest bytes of a file that is read for a map of this size, which is not empty.
fn least_bytes(width: u32, height: u32) -> u64 {
    // Of the first version of the format: a pixel, a run of up to 255 more, and one of multiples of 256.
    let words = match width {
        1 => 1,
        2..=256 => 2,
        _ => 3,
    };
    let (rows, count) = (4 * words * u64::from(height), u64::from(width) * u64::from(height));
    if count <= FREE_PIXELS { rows } else { rows.max(count.div_ceil(MAX_PIXELS_OF_BYTE)) }
}

/// Why the decoder refused a file. `malformed` is what a malformed file has.
fn reason(error: &ImageError, malformed: &'static str) -> &'static str {
    match error {
        ImageError::Decoding(_) => malformed,
        ImageError::IoError(error) if error.kind() == ErrorKind::UnexpectedEof => "it ends too early",
        ImageError::IoError(_) => "a run of pixels is longer than a row may be",
        ImageError::Unsupported(error) if matches!(error.kind(), UnsupportedErrorKind::Format(_)) => {
            "its pixels are not of the format 32-bit_rle_rgbe"
        }
        ImageError::Unsupported(_) => "its rows do not run from the top down and to the right, or are too many",
        _ => "it cannot be decoded",
    }
}

/// The bytes of a file, up to run lengths that the decoder does not withstand.
struct Limited<'a> {
    rest: &'a [u8],
    /// Run lengths that have just been read.
    runs: usize,
}

impl Read for Limited<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> IoResult<usize> {
        let count = self.rest.read(buffer)?;
        // Pixels are read one by one, and the channels of later versions in other lengths in turn.
        let is_run = count == 4 && buffer.starts_with(&[1; 3]);
        self.runs = if is_run { self.runs + 1 } else { 0 };
        if self.runs > MAX_RUNS { Err(Error::from(ErrorKind::InvalidData)) } else { Ok(count) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use testbed::testing::support::Rng;

    const HEADER: &str = "#?RADIANCE\n# a comment\nEXPOSURE=2\nFORMAT=32-bit_rle_rgbe\n\n";

    /// A file of these bytes behind its header.
    fn file(width: usize, height: usize, bytes: &[u8]) -> Vec<u8> {
        let mut file = format!("{HEADER}-Y {height} +X {width}\n").into_bytes();
        file.extend(bytes);
        file
    }

    /// Rows of pixels as they are, which is possible for rows of fewer than eight.
    fn flat(width: usize, pixels: &[[u8; 4]]) -> Vec<u8> {
        file(width, pixels.len() / width, pixels.as_flattened())
    }

    /// Rows with the runs of each channel.
    fn in_runs(width: usize, pixels: &[[u8; 4]]) -> Vec<u8> {
        let mut bytes = Vec::new();
        for row in pixels.chunks(width) {
            bytes.extend([2, 2, (width >> 8) as u8, width as u8]);
            for channel in 0..4 {
                let mut rest = row;
                while let Some(first) = rest.first() {
                    let same = rest.iter().take(127).take_while(|pixel| pixel[channel] == first[channel]).count();
                    let (count, values) = if same > 2 { (same, 1) } else { (rest.len().min(2), rest.len().min(2)) };
                    bytes.push(if values == 1 && count > 1 { 128 + count as u8 } else { count as u8 });
                    bytes.extend(rest[..values].iter().map(|pixel| pixel[channel]));
                    rest = &rest[count..];
                }
            }
        }
        file(width, pixels.len() / width, &bytes)
    }

    /// Pixels with runs, of which none is a run length.
    fn pixels(count: usize, seed: u64) -> Vec<[u8; 4]> {
        let mut rng = Rng(seed);
        let mut last = [0; 4];
        (0..count)
            .map(|_| {
                if rng.below(3) == 0 {
                    last = [3 + rng.below(250) as u8, rng.below(256) as u8, 7, 120 + rng.below(20) as u8];
                }
                last
            })
            .collect()
    }

    fn nits([r, g, b, e]: [u8; 4]) -> Vec3 {
        Vec3::from([r, g, b].map(f32::from)) * 2.0_f32.powi(i32::from(e) - 136)
    }

    #[test]
    fn files_of_all_kinds_of_runs_are_read() {
        for (width, height) in [(1, 1), (7, 3), (8, 4), (300, 5)] {
            let pixels = pixels(width * height, width as u64);
            let expected: Vec<Vec3> = pixels.iter().copied().map(nits).collect();
            let mut files = vec![flat(width, &pixels)];
            if width >= 8 {
                files.push(in_runs(width, &pixels));
            }
            for bytes in files {
                assert_eq!(read(&bytes), Ok((width, expected.clone())), "{width}");
                let other = String::from_utf8_lossy(&bytes[..11]).replace("RADIANCE", "RGBE").into_bytes();
                let other = [&other, &bytes[11..]].concat();
                let sky = hdr(&other).expect("the other signature");
                assert_eq!(sky.size(), [width, height]);
            }
        }
        // Run lengths of the first version: of 3, and of 2 + 256.
        let bytes = [[9, 8, 7, 136], [1, 1, 1, 3], [5, 6, 7, 137], [1, 1, 1, 2], [1, 1, 1, 1]];
        let (_, pixels) = read(&file(263, 1, bytes.as_flattened())).expect("a sound file");
        assert!(pixels[..4].iter().all(|pixel| *pixel == Vec3::new(9.0, 8.0, 7.0)));
        assert!(pixels[4..].iter().all(|pixel| *pixel == Vec3::new(10.0, 12.0, 14.0)));
    }

    /// Rows of one pixel each, in the fewest bytes of the first version: a pixel and up to two run lengths.
    fn in_long_runs(width: usize, height: usize) -> Vec<u8> {
        let rest = width - 1;
        let mut row = vec![[9, 8, 7, 136]];
        let runs = [(rest > 0).then_some(rest & 255), (rest > 255).then_some(rest >> 8)];
        row.extend(runs.into_iter().flatten().map(|run| [1, 1, 1, run as u8]));
        file(width, height, row.repeat(height).as_flattened())
    }

    #[test]
    fn runs_of_the_first_version_of_any_length_are_read() {
        for (width, height) in [(255, 40), (256, 40), (300, 100), (32_768, 7), (2048, 1024)] {
            let bytes = in_long_runs(width, height);
            let (found, pixels) = read(&bytes).expect("a sound file");
            assert_eq!((found, pixels.len()), (width, width * height));
            assert!(pixels.iter().all(|pixel| *pixel == Vec3::new(9.0, 8.0, 7.0)), "{width}");
        }
    }

    #[test]
    fn files_that_are_refused_say_why() {
        let what = |bytes: &[u8]| match hdr(bytes) {
            Err(error) => error.to_string().replace("the file cannot be read: ", ""),
            Ok(sky) => panic!("{sky:?}"),
        };
        let sound = flat(2, &[[9, 8, 7, 136]; 2]);
        assert!(hdr(&sound).is_ok());
        let changed = |from: &str, to: &str| {
            let at = sound.windows(from.len()).position(|bytes| bytes == from.as_bytes()).expect("a part of the file");
            [&sound[..at], to.as_bytes(), &sound[at + from.len()..]].concat()
        };
        assert_eq!(what(b""), "its first line is not that of a Radiance HDR file");
        assert_eq!(what(&sound[..20]), "its header is malformed");
        assert_eq!(what(&sound[..sound.len() - 1]), "it ends too early");
        assert_eq!(what(&changed("rgbe", "xyze")), "its pixels are not of the format 32-bit_rle_rgbe");
        assert_eq!(what(&changed("+X 2", "+X two")), "its header is malformed");
        let crlf = "its lines end in CR and LF, not in LF alone: it was changed as if it were text";
        let as_text = String::from_utf8_lossy(&sound).replace('\n', "\r\n");
        assert_eq!(what(as_text.as_bytes()), crlf);
        assert_eq!(what(&changed("rgbe\n\n", "rgbe\r\n\r\n")), crlf);
        // One such line does no harm.
        assert!(hdr(&changed("rgbe\n", "rgbe\r\n")).is_ok());
        for orientation in ["+Y 1 +X 2", "-Y 1 -X 2", "+X 1 -Y 2"] {
            assert!(what(&changed("-Y 1 +X 2", orientation)).starts_with("its rows do not run"), "{orientation}");
        }
        let long = file(10, 1, &[2, 2, 0, 10, 128 + 11, 5]);
        assert_eq!(what(&long), "the runs of a row are not as long as the row");
        // Pixels that no sky has.
        let bright = hdr(&flat(1, &[[9, 0, 0, 255]])).expect_err("too bright");
        assert!(bright.to_string().starts_with("pixel 0 is "), "{bright}");
    }

    #[test]
    fn small_files_that_state_many_pixels_take_no_memory() {
        for (width, height) in [(32_768, 32_768), (32_768, 10), (1, 32_768)] {
            let error = hdr(&file(width, height, &[7; 40])).expect_err("too short");
            assert!(error.to_string().contains("cannot hold"), "{error}");
        }
        for (width, height) in [(32_769, 1), (1, 32_769), (0, 5), (5, 0), (4_000_000_000, 4_000_000_000)] {
            let error = hdr(&file(width, height, &[7; 40])).expect_err("no map");
            assert_eq!(error.code(), 700, "{error}");
        }
        // Small files may have maps up to a limit.
        let errors = [(8192, 2048), (8192, 2049), (8192, 20_480)].map(|(width, height)| {
            let error = hdr(&file(width, height, &vec![7; 12 * height])).expect_err("no rows");
            error.to_string().contains("cannot hold")
        });
        assert_eq!(errors, [false, true, true]);
        // The longest runs are possible.
        let row = [[9, 8, 7, 136]; 127 * 40];
        assert_eq!(hdr(&in_runs(127 * 40, &row)).expect("a sound file").size(), [127 * 40, 1]);
    }

    #[test]
    fn chains_of_run_lengths_are_refused_before_they_overflow() {
        for last in [0, 1, 255] {
            let mut bytes = vec![[9, 8, 7, 136]];
            bytes.extend([[1, 1, 1, 0]; 20]);
            bytes.push([1, 1, 1, last]);
            let error = hdr(&file(7, 1, bytes.as_flattened())).expect_err("too long");
            assert!(error.to_string().ends_with("a run of pixels is longer than a row may be"), "{error}");
        }
    }

    #[test]
    fn broken_files_are_refused_or_read_and_never_more() {
        let chain = [[9, 8, 7, 136], [1, 1, 1, 2], [4, 4, 4, 130], [1, 1, 1, 0], [1, 1, 1, 0], [6, 6, 6, 130]];
        let files = [flat(5, &pixels(15, 1)), in_runs(9, &pixels(36, 2)), file(5, 1, chain.as_flattened())];
        for file in &files {
            assert!(hdr(file).is_ok());
            for end in 0..file.len() {
                assert!(hdr(&file[..end]).is_err(), "{end}");
            }
        }
        let mut rng = Rng(3);
        let (mut refused, mut longest) = (0, 0);
        for _ in 0..100_000 {
            let mut bytes = files[rng.below(files.len())].clone();
            for _ in 0..1 + rng.below(4) {
                let at = rng.below(bytes.len());
                let any = [rng.bits() as u8, 1, 2, 0, 128, 255, b"0123456789\n =+-XY"[rng.below(17)]][rng.below(7)];
                match rng.below(8) {
                    0..=3 => bytes[at] = any,
                    4 if bytes.len() > 1 => drop(bytes.remove(at)),
                    5 => bytes.insert(at, any),
                    6 => drop(bytes.splice(at..at, [1, 1, 1, any].repeat(1 + rng.below(9)))),
                    _ => bytes.truncate(at + 1),
                }
            }
            match hdr(&bytes) {
                Ok(sky) => assert!(sky.size()[0] * sky.size()[1] <= 65_536 / 12 * bytes.len()),
                Err(error) => {
                    refused += 1;
                    longest = longest.max(error.to_string().len());
                }
            }
        }
        assert!((10_000..90_000).contains(&refused) && longest < 250, "{refused} {longest}");
    }
}
