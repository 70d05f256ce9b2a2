//! Decodes the images of glTF files: PNG, JPEG and WebP.

use std::io::Cursor;
use std::sync::Arc;

use girandole_assets::gltf::gltf::Document;
use girandole_assets::gltf::gltf::image::Source;
use girandole_assets::gltf::{GltfFile, GltfOptions, TextureImage, TextureUse, read_image};
use image_webp::WebPDecoder;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::SceneError;
use super::notes::shown;
use super::texture::{MAX_IMAGE_SIDE, Pixels, srgb_to_linear};

/// Longest side of an image before it is reduced, pixels.
const MAX_STORED_SIDE: u32 = 16_384;
/// Most pixels of all images together, after they are reduced.
const MAX_PIXELS: usize = 1 << 28;

/// The images of a file that its materials use, and what the user should know about them.
pub struct Images {
    /// By the index of the image; `None` for images that no material uses or that are not decoded.
    pub pixels: Vec<Option<Arc<Pixels>>>,
    /// One line each.
    pub warnings: Vec<String>,
}

/// Decodes all images that materials use. An image of another format is left out, with a warning.
pub fn load(file: &GltfFile) -> Result<Images, SceneError> {
    let count = file.document.images().len();
    let mut images = Images { pixels: vec![None; count], warnings: Vec::new() };
    // Whether each image is used, and shows colours.
    let mut uses: Vec<Option<bool>> = vec![None; count];
    for material in file.document.materials() {
        let surface = material.pbr_metallic_roughness();
        let colors = [surface.base_color_texture(), material.emissive_texture()].into_iter().flatten();
        for info in colors {
            uses[TextureUse::of(&info).image] = Some(true);
        }
        if let Some(info) = surface.metallic_roughness_texture() {
            uses[TextureUse::of(&info).image].get_or_insert(false);
        }
    }
    let mut total = 0;
    for (index, is_color) in uses.into_iter().enumerate() {
        let Some(is_color) = is_color else { continue };
        let bytes = read_image(file, index, &GltfOptions::default()).map_err(|error| SceneError(error.to_string()))?;
        let label = label(&file.document, index);
        let Some(pixels) = decode(&bytes).map_err(|what| SceneError(format!("{label}: {what}")))? else {
            images.warnings.push(format!("{label} is not PNG, JPEG or WebP; its surfaces show their plain colours"));
            continue;
        };
        let pixels = reduced(pixels, is_color);
        total += pixels.rgba.len();
        if total > MAX_PIXELS {
            return Err(SceneError(format!("its images have more than {MAX_PIXELS} pixels in total")));
        }
        images.pixels[index] = Some(Arc::new(pixels));
    }
    Ok(images)
}

impl Images {
    /// The images as the library averages them.
    pub fn for_lights(&self) -> Vec<Option<TextureImage<'_>>> {
        let decoded = self.pixels.iter().map(Option::as_deref);
        decoded.map(|pixels| pixels.map(as_texture_image)).collect()
    }
}

/// How messages name an image: by its index, and by its file or its name.
fn label(document: &Document, index: usize) -> String {
    let Some(image) = document.images().nth(index) else { return format!("image {index}") };
    let file = match image.source() {
        Source::Uri { uri, .. } => Some(uri).filter(|uri| !uri.starts_with("data:")),
        Source::View { .. } => None,
    };
    file.or(image.name()).map_or_else(|| format!("image {index}"), |name| format!("image {index} ({})", shown(name)))
}

/// An image as the library averages it.
fn as_texture_image(pixels: &Pixels) -> TextureImage<'_> {
    TextureImage { width: pixels.width, height: pixels.height, rgba: pixels.rgba.as_flattened() }
}

/// The pixels of an image file, whatever its size; `None` if the format is not one that is decoded.
fn decode(bytes: &[u8]) -> Result<Option<Pixels>, String> {
    if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        decode_png(bytes).map(Some).map_err(|error| one_line("PNG", error))
    } else if bytes.starts_with(b"\xff\xd8\xff") {
        decode_jpeg(bytes).map(Some).map_err(|error| one_line("JPEG", error))
    } else if bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP") {
        decode_webp(bytes).map(Some).map_err(|error| one_line("WebP", error))
    } else {
        Ok(None)
    }
}

/// An error of a decoder on one line.
fn one_line(format: &str, error: String) -> String {
    let words: Vec<&str> = error.split_whitespace().collect();
    format!("it is not a valid {format} file: {}", words.join(" "))
}

fn check_size(width: u32, height: u32) -> Result<(), String> {
    let sides = 1..=MAX_STORED_SIDE;
    if sides.contains(&width) && sides.contains(&height) {
        return Ok(());
    }
    Err(format!("{width} x {height} pixels; sides from 1 to {MAX_STORED_SIDE} are read"))
}

fn decode_png(bytes: &[u8]) -> Result<Pixels, String> {
    let mut decoder = png::Decoder::new(Cursor::new(bytes));
    decoder.set_transformations(png::Transformations::normalize_to_color8() | png::Transformations::ALPHA);
    let mut reader = decoder.read_info().map_err(|error| error.to_string())?;
    let (width, height) = (reader.info().width, reader.info().height);
    check_size(width, height)?;
    let size = reader.output_buffer_size().ok_or("it is too large")?;
    let mut data = vec![0; size];
    let info = reader.next_frame(&mut data).map_err(|error| error.to_string())?;
    let rgba = match info.color_type {
        png::ColorType::Rgba => data.as_chunks().0.to_vec(),
        png::ColorType::Rgb => opaque(&data),
        png::ColorType::GrayscaleAlpha => {
            data.as_chunks().0.iter().map(|[gray, a]| [*gray, *gray, *gray, *a]).collect()
        }
        png::ColorType::Grayscale => data.iter().map(|gray| [*gray, *gray, *gray, 255]).collect(),
        png::ColorType::Indexed => return Err("its palette is not expanded".into()),
    };
    with_all_pixels(Pixels { width, height, rgba })
}

fn decode_jpeg(bytes: &[u8]) -> Result<Pixels, String> {
    let side = MAX_STORED_SIDE as usize;
    let options =
        DecoderOptions::default().set_max_width(side).set_max_height(side).jpeg_set_out_colorspace(ColorSpace::RGBA);
    let mut decoder = JpegDecoder::new_with_options(Cursor::new(bytes), options);
    let data = decoder.decode().map_err(|error| error.to_string())?;
    let info = decoder.info().ok_or("it has no size")?;
    let (width, height) = (u32::from(info.width), u32::from(info.height));
    check_size(width, height)?;
    with_all_pixels(Pixels { width, height, rgba: data.as_chunks().0.to_vec() })
}

fn decode_webp(bytes: &[u8]) -> Result<Pixels, String> {
    let mut decoder = WebPDecoder::new(Cursor::new(bytes)).map_err(|error| error.to_string())?;
    let (width, height) = decoder.dimensions();
    check_size(width, height)?;
    let mut data = vec![0; decoder.output_buffer_size().ok_or("it is too large")?];
    decoder.read_image(&mut data).map_err(|error| error.to_string())?;
    let rgba = if decoder.has_alpha() { data.as_chunks().0.to_vec() } else { opaque(&data) };
    with_all_pixels(Pixels { width, height, rgba })
}

/// Pixels of red, green and blue.
fn opaque(data: &[u8]) -> Vec<[u8; 4]> {
    data.as_chunks().0.iter().map(|[r, g, b]| [*r, *g, *b, 255]).collect()
}

/// Checks that a decoder returned as many pixels as it stated.
fn with_all_pixels(mut pixels: Pixels) -> Result<Pixels, String> {
    let expected = pixels.width as usize * pixels.height as usize;
    if pixels.rgba.len() < expected {
        return Err(format!("{} of {expected} pixels", pixels.rgba.len()));
    }
    pixels.rgba.truncate(expected);
    Ok(pixels)
}

/// An image whose sides are at most [`MAX_IMAGE_SIDE`]: squares of pixels are averaged, in linear light
/// if they show colours.
fn reduced(pixels: Pixels, is_color: bool) -> Pixels {
    let step = pixels.width.max(pixels.height).div_ceil(MAX_IMAGE_SIDE);
    if step == 1 {
        return pixels;
    }
    let (width, height) = (pixels.width.div_ceil(step), pixels.height.div_ceil(step));
    let decode = |byte: u8| if is_color { srgb_to_linear(f32::from(byte) / 255.0) } else { f32::from(byte) / 255.0 };
    let decoded: Vec<f32> = (0..=255).map(decode).collect();
    let encode = |value: f32| {
        let byte = decoded.partition_point(|known| *known < value).min(255);
        // The nearer of two neighbours.
        if byte > 0 && value - decoded[byte - 1] < decoded[byte] - value { byte as u8 - 1 } else { byte as u8 }
    };
    let mut rgba = Vec::with_capacity(width as usize * height as usize);
    for y in 0..height {
        for x in 0..width {
            let (mut sum, mut count) = ([0.0; 4], 0.0);
            for row in y * step..((y + 1) * step).min(pixels.height) {
                for column in x * step..((x + 1) * step).min(pixels.width) {
                    let pixel = pixels.rgba[row as usize * pixels.width as usize + column as usize];
                    for channel in 0..3 {
                        sum[channel] += decoded[pixel[channel] as usize];
                    }
                    sum[3] += f32::from(pixel[3]);
                    count += 1.0;
                }
            }
            let [red, green, blue, alpha] = sum.map(|sum: f32| sum / count);
            rgba.push([encode(red), encode(green), encode(blue), alpha.round() as u8]);
        }
    }
    Pixels { width, height, rgba }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encoded(color: png::ColorType, depth: png::BitDepth, data: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 2, 1);
        encoder.set_color(color);
        encoder.set_depth(depth);
        if color == png::ColorType::Indexed {
            encoder.set_palette(vec![1, 2, 3, 40, 50, 60]);
            encoder.set_trns(vec![255, 7]);
        }
        encoder.write_header().unwrap().write_image_data(data).unwrap();
        bytes
    }

    #[test]
    fn png_files_of_every_colour_type_become_four_bytes_for_each_pixel() {
        use png::{BitDepth, ColorType};
        let pixels = |color, depth, data: &[u8]| decode(&encoded(color, depth, data)).unwrap().unwrap().rgba;
        assert_eq!(pixels(ColorType::Grayscale, BitDepth::Eight, &[5, 6]), [[5, 5, 5, 255], [6, 6, 6, 255]]);
        assert_eq!(pixels(ColorType::Grayscale, BitDepth::One, &[0x40]), [[0, 0, 0, 255], [255; 4]]);
        assert_eq!(pixels(ColorType::GrayscaleAlpha, BitDepth::Eight, &[5, 9, 6, 8]), [[5, 5, 5, 9], [6, 6, 6, 8]]);
        assert_eq!(pixels(ColorType::Rgb, BitDepth::Eight, &[1, 2, 3, 4, 5, 6]), [[1, 2, 3, 255], [4, 5, 6, 255]]);
        assert_eq!(pixels(ColorType::Rgba, BitDepth::Eight, &[1, 2, 3, 4, 5, 6, 7, 8]), [[1, 2, 3, 4], [5, 6, 7, 8]]);
        assert_eq!(pixels(ColorType::Rgb, BitDepth::Sixteen, &[9; 12]), [[9, 9, 9, 255]; 2]);
        assert_eq!(pixels(ColorType::Indexed, BitDepth::Eight, &[1, 0]), [[40, 50, 60, 7], [1, 2, 3, 255]]);
    }

    #[test]
    fn webp_files_are_read_with_and_without_alpha() {
        use image_webp::{ColorType, WebPEncoder};
        let pixels = |color, data: &[u8]| {
            let mut bytes = Vec::new();
            WebPEncoder::new(&mut bytes).encode(data, 2, 1, color).unwrap();
            assert!(decode(&bytes[..bytes.len() - 8]).err().unwrap().contains("is not a valid WebP file"));
            decode(&bytes).unwrap().unwrap().rgba
        };
        assert_eq!(pixels(ColorType::Rgb8, &[1, 2, 3, 4, 5, 6]), [[1, 2, 3, 255], [4, 5, 6, 255]]);
        assert_eq!(pixels(ColorType::Rgba8, &[1, 2, 3, 4, 5, 6, 7, 8]), [[1, 2, 3, 4], [5, 6, 7, 8]]);
    }

    #[test]
    fn damaged_images_are_refused_on_one_line() {
        let whole = encoded(png::ColorType::Rgb, png::BitDepth::Eight, &[1, 2, 3, 4, 5, 6]);
        for damaged in [&whole[..40], &whole[..20], b"\xff\xd8\xff\xe0\x00\x10JFIF", b"\xff\xd8\xff"] {
            let line = decode(damaged).err().unwrap();
            assert!(line.contains("is not a valid") && !line.contains('\n'), "{line}");
        }
        assert!(decode(b"RIFF\0\0\0\0WAVE").unwrap().is_none() && decode(b"").unwrap().is_none());
    }

    #[test]
    fn large_images_are_averaged_in_linear_light() {
        // Columns of black and white: their mean, 0.5, is 188 in sRGB and 127.5 as a number.
        let width = 2 * MAX_IMAGE_SIDE;
        let image = || Pixels {
            width,
            height: 1,
            rgba: (0..width).map(|x| [[0, 0, 0, 0], [255; 4]][x as usize % 2]).collect(),
        };
        let color = reduced(image(), true);
        assert_eq!((color.width, color.height, color.rgba[7]), (MAX_IMAGE_SIDE, 1, [188, 188, 188, 128]));
        assert!([127, 128].contains(&reduced(image(), false).rgba[7][0]));
    }
}
