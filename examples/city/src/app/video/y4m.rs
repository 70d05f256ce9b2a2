//! YUV4MPEG2: a line of text, then the frames without compression.
//!
//! Frames have 8 bits per channel, the matrix of BT.709, limited range and full resolution of
//! colours (C444), so that every size is possible. The format has no field for the matrix.

use std::io::{self, Write};

/// Red, green and blue to luma: BT.709.
const LUMA: [f32; 3] = [0.2126, 0.7152, 0.0722];
/// The largest denominator of a frame rate.
const MAX_DENOMINATOR: u32 = 10_000;

/// A stream of frames of one size.
pub struct Y4m<W> {
    out: W,
    /// The planes of one frame: luma, blue difference and red difference.
    planes: [Vec<u8>; 3],
}

impl<W: Write> Y4m<W> {
    /// Writes the header. `fps` is positive and at most a million.
    pub fn new(mut out: W, (width, height): (u32, u32), fps: f64) -> io::Result<Self> {
        let [frames, seconds] = ratio(fps);
        writeln!(out, "YUV4MPEG2 W{width} H{height} F{frames}:{seconds} Ip A1:1 C444 XCOLORRANGE=LIMITED")?;
        let plane = vec![0; width as usize * height as usize];
        Ok(Self { out, planes: [plane.clone(), plane.clone(), plane] })
    }

    /// Adds a frame: three bytes of sRGB per pixel, row by row from the top.
    pub fn add(&mut self, rgb: &[u8]) -> io::Result<()> {
        let [luma, blue, red] = &mut self.planes;
        let pixels = luma.iter_mut().zip(blue).zip(red);
        for (((luma, blue), red), rgb) in pixels.zip(rgb.chunks_exact(3)) {
            [*luma, *blue, *red] = limited_yuv([rgb[0], rgb[1], rgb[2]]);
        }
        self.out.write_all(b"FRAME\n")?;
        self.planes.iter().try_for_each(|plane| self.out.write_all(plane))
    }

    /// Ends the stream, and returns what it was written to.
    pub fn finish(mut self) -> io::Result<W> {
        self.out.flush()?;
        Ok(self.out)
    }
}

/// BT.709 in limited range: luma from 16 to 235, and colour differences from 16 to 240.
fn limited_yuv(rgb: [u8; 3]) -> [u8; 3] {
    let [red, green, blue] = rgb.map(|value| f32::from(value) / 255.0);
    let luma = LUMA[0] * red + LUMA[1] * green + LUMA[2] * blue;
    let blue_difference = (blue - luma) / (2.0 * (1.0 - LUMA[2]));
    let red_difference = (red - luma) / (2.0 * (1.0 - LUMA[0]));
    [16.0 + 219.0 * luma, 128.0 + 224.0 * blue_difference, 128.0 + 224.0 * red_difference].map(|x| x.round() as u8)
}

/// A frame rate as numerator and denominator: the fraction with the least denominator that is exact,
/// or else the best one.
fn ratio(fps: f64) -> [u32; 2] {
    // The relative rounding of a number that was written with few digits.
    const EXACT: f64 = 1e-12;
    let (mut best, mut best_error) = ([1, 1], f64::INFINITY);
    for denominator in 1..=MAX_DENOMINATOR {
        let numerator = (fps * f64::from(denominator)).round();
        // Readers use signed numbers.
        if numerator > f64::from(i32::MAX) {
            break;
        }
        let error = (numerator / f64::from(denominator) / fps - 1.0).abs();
        if numerator >= 1.0 && error < best_error {
            (best, best_error) = ([numerator as u32, denominator], error);
        }
        if best_error < EXACT {
            break;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads a stream back: its parameters, and the planes of each frame.
    fn read(bytes: &[u8]) -> (Vec<String>, Vec<[Vec<u8>; 3]>) {
        let line_end = bytes.iter().position(|byte| *byte == b'\n').expect("a header");
        let header = std::str::from_utf8(&bytes[..line_end]).expect("ASCII");
        let mut fields = header.split(' ').map(str::to_owned);
        assert_eq!(fields.next().as_deref(), Some("YUV4MPEG2"));
        let fields: Vec<String> = fields.collect();
        let number = |tag: char| -> usize {
            let field = fields.iter().find_map(|field| field.strip_prefix(tag)).expect("a field");
            field.parse().expect("a number")
        };
        let plane = number('W') * number('H');
        let mut rest = &bytes[line_end + 1..];
        let mut frames = Vec::new();
        while !rest.is_empty() {
            rest = rest.strip_prefix(b"FRAME\n").expect("the head of a frame");
            let (frame, after) = rest.split_at(3 * plane);
            frames.push(std::array::from_fn(|i| frame[i * plane..(i + 1) * plane].to_vec()));
            rest = after;
        }
        (fields, frames)
    }

    /// BT.709 in limited range to red, green and blue from 0 to 255.
    fn rgb([y, cb, cr]: [u8; 3]) -> [f64; 3] {
        let (y, cb, cr) =
            ((f64::from(y) - 16.0) / 219.0, (f64::from(cb) - 128.0) / 224.0, (f64::from(cr) - 128.0) / 224.0);
        let (red, blue) = (y + 1.5748 * cr, y + 1.8556 * cb);
        let green = y - 0.1873 * cb - 0.4681 * cr;
        [red, green, blue].map(|value| 255.0 * value)
    }

    #[test]
    fn a_stream_has_its_header_all_frames_and_the_same_colours() {
        let colors =
            [[0, 0, 0], [255, 255, 255], [255, 0, 0], [0, 255, 0], [0, 0, 255], [18, 120, 240], [200, 100, 50]];
        // An odd width and two rows of the same pixels.
        let row: Vec<u8> = colors.iter().flatten().copied().collect();
        let picture = [row.clone(), row].concat();
        let mut stream = Y4m::new(Vec::new(), (7, 2), 24.0).expect("a vector takes everything");
        stream.add(&picture).expect("a vector takes everything");
        stream.add(&vec![0; picture.len()]).expect("a vector takes everything");
        let (fields, frames) = read(&stream.finish().expect("a vector takes everything"));
        assert_eq!(fields, ["W7", "H2", "F24:1", "Ip", "A1:1", "C444", "XCOLORRANGE=LIMITED"]);
        assert_eq!(frames.len(), 2);
        assert!(frames[1][0].iter().all(|luma| *luma == 16) && frames[1][1].iter().all(|blue| *blue == 128));
        assert_eq!([frames[0][0][1], frames[0][1][1], frames[0][2][1]], [235, 128, 128], "white");
        for (place, color) in colors.iter().chain(&colors).enumerate() {
            let read = rgb([frames[0][0][place], frames[0][1][place], frames[0][2][place]]);
            for (read, color) in read.iter().zip(color) {
                // Each channel is off by half a step at most: 0.5 * 255 * (1 / 219 + 1.8556 / 224).
                assert!((read - f64::from(*color)).abs() < 1.7, "{read} instead of {color} at {place}");
            }
        }
    }

    #[test]
    fn frame_rates_are_ratios() {
        for (fps, expected) in [
            (24.0, [24, 1]),
            (29.97, [2997, 100]),
            (30_000.0 / 1001.0, [30_000, 1001]),
            (12.5, [25, 2]),
            (0.001, [1, 1000]),
            (1e6, [1_000_000, 1]),
        ] {
            assert_eq!(ratio(fps), expected, "{fps}");
        }
        let [frames, seconds] = ratio(999_999.987_654_321);
        assert!(frames <= i32::MAX as u32 && (f64::from(frames) / f64::from(seconds) - 999_999.99).abs() < 1.0);
    }
}
