//! The same part of the picture by several samplers in equal time.

use super::measured::{Measured, Panel};
use super::table::short;
use crate::city::app::tone_mapping::agx;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use girandole::glam::Vec3;
use girandole::light::luminance;

/// The part of a picture that is shown, in pixels, at most.
const CROP: (usize, usize) = (160, 100);
/// Pixels on the screen for each pixel of a crop, in the figure.
const ZOOM: usize = 2;
/// Crops side by side in the figure.
const COLUMNS: usize = 3;
/// Pixels between crops, and the height of two lines of text below each.
const GAP: usize = 10;
const LABEL: usize = 46;

/// A part of a picture, with what it shows.
pub struct Crop {
    pub title: String,
    pub caption: String,
    /// A PNG as data URI.
    pub image: String,
}

/// Crops of equal time, and the reference.
pub struct Crops {
    pub all: Vec<Crop>,
    /// The size of each in pixels.
    pub size: (usize, usize),
}

impl Crops {
    /// Cuts the part with the most contrast out of all pictures.
    pub fn new(measured: &Measured, exposure: f32) -> Result<Self, String> {
        let width = measured.view.view.width;
        let height = measured.reference.len() / width;
        let size = (CROP.0.min(width), CROP.1.min(height));
        let corner = most_contrast(&measured.reference, (width, height), size);
        let cut = |picture: &[Vec3]| -> Result<String, String> {
            let rows = (0..size.1).flat_map(|y| {
                let start = (corner.1 + y) * width + corner.0;
                &picture[start..start + size.0]
            });
            let bytes: Vec<u8> = rows
                .flat_map(|pixel| agx((*pixel * exposure).max(Vec3::ZERO)).to_array())
                .map(|value| (value * 255.0 + 0.5) as u8)
                .collect();
            Ok(format!("data:image/png;base64,{}", STANDARD.encode(png(&bytes, size).map_err(|e| e.to_string())?)))
        };
        let mut all = Vec::new();
        for Panel { row, picture } in &measured.equal_time {
            let error = row.errors.rel_mse;
            all.push(Crop {
                title: row.setting.sampler.name(),
                caption: format!("{:.1} samples, relMSE {}", row.setting.samples, short(error.mean)),
                image: cut(picture)?,
            });
        }
        let caption = format!("relMSE below {}", short(measured.reference_error.max(1.0e-6)));
        all.push(Crop { title: "Reference".into(), caption, image: cut(&measured.reference)? });
        Ok(Self { all, size })
    }

    /// The figure as SVG, with the images inside.
    pub fn svg(&self) -> String {
        let (width, height) = (self.size.0 * ZOOM, self.size.1 * ZOOM);
        let rows = self.all.len().div_ceil(COLUMNS);
        let all = (COLUMNS * (width + GAP) + GAP, rows * (height + LABEL + GAP) + GAP);
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\" \
             font-family=\"sans-serif\">\n<rect width=\"100%\" height=\"100%\" fill=\"#111317\"/>\n",
            all.0, all.1
        );
        for (i, crop) in self.all.iter().enumerate() {
            let (x, y) = (GAP + i % COLUMNS * (width + GAP), GAP + i / COLUMNS * (height + LABEL + GAP));
            let Crop { title, caption, image } = crop;
            svg += &format!(
                "<image x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" style=\"image-rendering:pixelated\" \
                 href=\"{image}\"/>\n<text x=\"{x}\" y=\"{}\" font-size=\"16\" fill=\"#f0f0f0\">{title}</text>\n\
                 <text x=\"{x}\" y=\"{}\" font-size=\"13\" fill=\"#a5aab2\">{caption}</text>\n",
                y + height + 20,
                y + height + 39,
            );
        }
        svg + "</svg>\n"
    }
}

/// The corner of the window of this size in which the logarithm of the luminance varies most.
fn most_contrast(picture: &[Vec3], (width, height): (usize, usize), size: (usize, usize)) -> (usize, usize) {
    let mean = crate::direct_light::score::mean(picture) as f32;
    let logarithm = |x: usize, y: usize| (luminance(picture[y * width + x]) + 0.01 * mean).ln();
    let contrast = |corner: (usize, usize)| {
        let (mut sum, mut squares) = (0.0, 0.0);
        for (x, y) in (0..size.1).flat_map(|y| (0..size.0).map(move |x| (corner.0 + x, corner.1 + y))) {
            let value = f64::from(logarithm(x, y));
            (sum, squares) = (sum + value, squares + value * value);
        }
        let count = (size.0 * size.1) as f64;
        squares / count - (sum / count).powi(2)
    };
    let starts = |all: usize, own: usize| (0..=all - own).step_by(((all - own) / 8).max(1));
    let corners = starts(height, size.1).flat_map(|y| starts(width, size.0).map(move |x| (x, y)));
    corners.max_by(|a, b| contrast(*a).total_cmp(&contrast(*b))).unwrap_or((0, 0))
}

fn png(bytes: &[u8], (width, height): (usize, usize)) -> Result<Vec<u8>, png::EncodingError> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width as u32, height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    encoder.set_compression(png::Compression::High);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(bytes)?;
    writer.finish()?;
    Ok(file)
}
