//! Pictures side by side with a label under each, as one PNG.

use super::city::app::tone_mapping::agx;
use super::font::Text;
use girandole::glam::{Vec2, Vec3, vec2};
use rayon::prelude::*;
use std::io::Write;

/// Pixels between pictures.
const GAP: usize = 6;
/// The height of a label, in pixels.
const LABEL: usize = 50;
/// Of a label's two lines: the height of capitals and the baseline below the picture, in pixels,
/// and the colour.
const LINES: [(f32, f32, [u8; 3]); 2] = [(12.0, 20.5, [240, 240, 240]), (9.0, 40.5, [165, 170, 178])];
/// Behind labels and between pictures.
const BACKGROUND: [u8; 3] = [17, 19, 23];

/// A picture with its label.
pub struct Panel {
    /// Radiance, row by row from the top.
    pub pixels: Vec<Vec3>,
    pub lines: [String; 2],
}

/// Three bytes per pixel.
pub struct Sheet {
    pub width: usize,
    pub height: usize,
    bytes: Vec<u8>,
}

impl Sheet {
    /// Tone-maps pictures of one size, all alike, and puts them side by side.
    pub fn new(panels: &[Panel], (width, height): (usize, usize), exposure: f32) -> Self {
        let mut sheet = Self { width: panels.len() * (width + GAP) - GAP, height: height + LABEL, bytes: Vec::new() };
        sheet.bytes = BACKGROUND.repeat(sheet.width * sheet.height);
        for (i, panel) in panels.iter().enumerate() {
            let left = i * (width + GAP);
            for (y, row) in panel.pixels.chunks(width).enumerate() {
                for (x, pixel) in row.iter().enumerate() {
                    let encoded = agx((*pixel * exposure).max(Vec3::ZERO));
                    *sheet.pixel(left + x, y) = encoded.to_array().map(|value| (value * 255.0 + 0.5) as u8);
                }
            }
            for (line, (size, baseline, color)) in panel.lines.iter().zip(LINES) {
                let text = Text::new(line, size);
                let origin = vec2((0.5 * (width as f32 - text.width)).round() + left as f32, height as f32 + baseline);
                sheet.write(&text, origin, color, left..left + width, height);
            }
        }
        sheet
    }

    fn pixel(&mut self, x: usize, y: usize) -> &mut [u8; 3] {
        let start = 3 * (y * self.width + x);
        (&mut self.bytes[start..start + 3]).try_into().unwrap_or_else(|_| unreachable!("three bytes are three bytes"))
    }

    /// Draws a text into the label below a picture that takes these columns and ends above row
    /// `top`.
    fn write(&mut self, text: &Text, origin: Vec2, color: [u8; 3], columns: std::ops::Range<usize>, top: usize) {
        let width = self.width;
        self.bytes[3 * top * width..].par_chunks_mut(3 * width).enumerate().for_each(|(row, bytes)| {
            for x in columns.clone() {
                let center = vec2(x as f32 + 0.5, (top + row) as f32 + 0.5);
                let cover = text.coverage(center - origin);
                for (byte, color) in bytes[3 * x..3 * x + 3].iter_mut().zip(color) {
                    *byte = (f32::from(*byte) + cover * (f32::from(color) - f32::from(*byte))).round() as u8;
                }
            }
        });
    }

    /// Writes an sRGB PNG.
    pub fn write_png(&self, file: impl Write) -> Result<(), png::EncodingError> {
        let mut encoder = png::Encoder::new(file, self.width as u32, self.height as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        encoder.set_compression(png::Compression::High);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&self.bytes)?;
        writer.finish()
    }
}
