//! The same part of several pictures beside each other.

use super::score::mean;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use girandole::glam::Vec3;
use girandole::light::luminance;

/// Pixels on the screen for each pixel of a crop, in the figure, at least.
const ZOOM: usize = 2;
/// Crops side by side in the figure.
const COLUMNS: usize = 3;
/// Pixels between crops, and the height of two lines of text below each.
const GAP: usize = 10;
const LABEL: usize = 46;
/// The font sizes of the two lines.
const FONTS: [f32; 2] = [16.0, 13.0];
/// The width of a letter in font sizes, about: the mean of wide sans-serif fonts and some more.
const LETTER: f32 = 0.62;

/// A part of a picture, with what it shows.
pub struct Crop {
    pub title: String,
    pub caption: String,
    /// A PNG as data URI.
    pub image: String,
}

/// A rectangle in pictures that have all the same size, in pixels.
#[derive(Clone, Copy, Debug)]
pub struct Window {
    /// The width of the pictures.
    width: usize,
    corner: (usize, usize),
    /// The size of the rectangle.
    pub size: (usize, usize),
}

impl Window {
    /// The part of at most this size with the most contrast in a picture of a width.
    pub fn of_most_contrast(picture: &[Vec3], width: usize, most: (usize, usize)) -> Self {
        let height = picture.len() / width;
        let size = (most.0.min(width), most.1.min(height));
        Self { width, corner: most_contrast(picture, (width, height), size), size }
    }

    /// Cuts this part out of a picture. `to_screen` turns radiance into sRGB values in [0, 1]. An
    /// error is one line.
    pub fn cut(
        &self,
        picture: &[Vec3],
        to_screen: impl Fn(Vec3) -> Vec3,
        title: String,
        caption: String,
    ) -> Result<Crop, String> {
        let rows = (0..self.size.1).flat_map(|y| {
            let start = (self.corner.1 + y) * self.width + self.corner.0;
            &picture[start..start + self.size.0]
        });
        let bytes: Vec<u8> =
            rows.flat_map(|pixel| to_screen(*pixel).to_array()).map(|value| (value * 255.0 + 0.5) as u8).collect();
        let file = png(&bytes, self.size).map_err(|error| error.to_string())?;
        Ok(Crop { title, caption, image: format!("data:image/png;base64,{}", STANDARD.encode(file)) })
    }
}

/// Crops of the same window.
pub struct Crops {
    pub all: Vec<Crop>,
    /// The size of each in pixels.
    pub size: (usize, usize),
}

impl Crops {
    /// Pixels on the screen for each pixel of a crop, so that the lines below one do not reach those of the next.
    fn zoom(&self) -> usize {
        let lines = self.all.iter().flat_map(|crop| [&crop.title, &crop.caption].into_iter().zip(FONTS));
        let widths = lines.map(|(line, font)| (LETTER * font * line.chars().count() as f32) as usize);
        widths.max().unwrap_or(0).div_ceil(self.size.0.max(1)).max(ZOOM)
    }

    /// The figure as SVG, with the images inside.
    pub fn svg(&self) -> String {
        let zoom = self.zoom();
        let (width, height) = (self.size.0 * zoom, self.size.1 * zoom);
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
                 href=\"{image}\"/>\n<text x=\"{x}\" y=\"{}\" font-size=\"{}\" fill=\"#f0f0f0\">{title}</text>\n\
                 <text x=\"{x}\" y=\"{}\" font-size=\"{}\" fill=\"#a5aab2\">{caption}</text>\n",
                y + height + 20,
                FONTS[0],
                y + height + 39,
                FONTS[1],
            );
        }
        svg + "</svg>\n"
    }
}

/// The corner of the window of this size in which the logarithm of the luminance varies most.
fn most_contrast(picture: &[Vec3], (width, height): (usize, usize), size: (usize, usize)) -> (usize, usize) {
    let mean = mean(picture) as f32;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_of_narrow_crops_do_not_reach_the_next_crop() {
        let crop = || Crop {
            title: "Girandole, shared cuts, relMSE 0.28".into(),
            caption: "Girandole, 256 samples per pixel".into(),
            image: String::new(),
        };
        for (size, zoom) in [((32, 18), 11), ((96, 54), 4), ((160, 90), 3), ((240, 135), 2), ((1, 1), 347)] {
            let crops = Crops { all: vec![crop(), crop()], size };
            assert_eq!(crops.zoom(), zoom, "{size:?}");
            // Letters of DejaVu Sans, which is wide, have 0.59 of the font size on average in these lines.
            let next = GAP + zoom * size.0;
            assert!(0.59 * 16.0 * crop().title.len() as f32 <= next as f32, "{size:?}");
            let second = format!("<text x=\"{}\"", GAP + next);
            assert!(crops.svg().contains(&second), "{size:?}");
        }
    }
}
