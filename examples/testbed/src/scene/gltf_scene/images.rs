//! Decodes the images of glTF files: PNG, JPEG and WebP.

use std::collections::BTreeSet;
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
use super::notes::{Notes, shown};
use super::texture::{MAX_IMAGE_SIDE, Pixels, srgb_to_linear};

/// Longest side of an image before it is reduced, pixels.
const MAX_STORED_SIDE: u32 = 16_384;
/// Most pixels of all images together, after they are reduced.
const MAX_PIXELS: usize = 1 << 28;

/// The images of a file, by index; `None` for those that no material uses or that are not decoded.
pub struct Images(pub Vec<Option<Arc<Pixels>>>);

/// Decodes all images that materials use. An image of another format is left out, with a warning.
pub fn load(file: &GltfFile, notes: &mut Notes) -> Result<Images, SceneError> {
    let mut images = vec![None; file.document.images().len()];
    let used = file.document.materials().flat_map(|material| {
        let surface = material.pbr_metallic_roughness();
        [surface.base_color_texture(), material.emissive_texture(), surface.metallic_roughness_texture()]
    });
    let used: BTreeSet<usize> = used.flatten().map(|info| TextureUse::of(&info).image).collect();
    let mut total = 0;
    for index in used {
        let bytes = read_image(file, index, &GltfOptions::default())?;
        let label = label(&file.document, index);
        let Some(pixels) = decode(&bytes).map_err(|what| SceneError(format!("{label}: {what}")))? else {
            notes.add(true, "images that are not PNG, JPEG or WebP are not used");
            continue;
        };
        let pixels = reduced(pixels);
        total += pixels.rgba.len();
        if total > MAX_PIXELS {
            return Err(SceneError(format!("its images have more than {MAX_PIXELS} pixels in total")));
        }
        images[index] = Some(Arc::new(pixels));
    }
    Ok(Images(images))
}

impl Images {
    /// The images as the library averages them.
    pub fn for_lights(&self) -> Vec<Option<TextureImage<'_>>> {
        let decoded = self.0.iter().map(Option::as_deref);
        let image = decoded.map(|pixels| {
            let Pixels { width, height, rgba } = pixels?;
            Some(TextureImage { width: *width, height: *height, rgba: rgba.as_flattened() })
        });
        image.collect()
    }
}

/// How messages name an image: by its index, and by its file or its name.
fn label(document: &Document, index: usize) -> String {
    let image = document.images().nth(index);
    let name = image.and_then(|image| match image.source() {
        Source::Uri { uri, .. } if !uri.starts_with("data:") => Some(uri),
        _ => image.name(),
    });
    format!("image {index}{}", name.map_or(String::new(), |name| format!(" ({})", shown(name))))
}

/// Width, height and channels of an image file.
type Decoded = Result<(u32, u32, Vec<u8>), String>;

/// The pixels of an image file, whatever its size; `None` if the format is not one that is decoded.
fn decode(bytes: &[u8]) -> Result<Option<Pixels>, String> {
    let (format, decoded) = if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
        ("PNG", decode_png(bytes))
    } else if bytes.starts_with(b"\xff\xd8\xff") {
        ("JPEG", decode_jpeg(bytes))
    } else if bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP") {
        ("WebP", decode_webp(bytes))
    } else {
        return Ok(None);
    };
    decoded.and_then(with_all_pixels).map(Some).map_err(|error| {
        let words: Vec<&str> = error.split_whitespace().collect();
        format!("it is not a valid {format} file: {}", words.join(" "))
    })
}

fn check_size(width: u32, height: u32) -> Result<(), String> {
    let sides = 1..=MAX_STORED_SIDE;
    if sides.contains(&width) && sides.contains(&height) {
        return Ok(());
    }
    Err(format!("{width} x {height} pixels; sides from 1 to {MAX_STORED_SIDE} are read"))
}

fn decode_png(bytes: &[u8]) -> Decoded {
    let mut decoder = png::Decoder::new(Cursor::new(bytes));
    decoder.set_transformations(png::Transformations::normalize_to_color8() | png::Transformations::ALPHA);
    let mut reader = decoder.read_info().map_err(|error| error.to_string())?;
    let (width, height) = (reader.info().width, reader.info().height);
    check_size(width, height)?;
    let mut data = vec![0; reader.output_buffer_size().ok_or("it is too large")?];
    reader.next_frame(&mut data).map_err(|error| error.to_string())?;
    Ok((width, height, data))
}

fn decode_jpeg(bytes: &[u8]) -> Decoded {
    let side = MAX_STORED_SIDE as usize;
    let options =
        DecoderOptions::default().set_max_width(side).set_max_height(side).jpeg_set_out_colorspace(ColorSpace::RGBA);
    let mut decoder = JpegDecoder::new_with_options(Cursor::new(bytes), options);
    let data = decoder.decode().map_err(|error| error.to_string())?;
    let info = decoder.info().ok_or("it has no size")?;
    Ok((u32::from(info.width), u32::from(info.height), data))
}

fn decode_webp(bytes: &[u8]) -> Decoded {
    let mut decoder = WebPDecoder::new(Cursor::new(bytes)).map_err(|error| error.to_string())?;
    let (width, height) = decoder.dimensions();
    check_size(width, height)?;
    let mut data = vec![0; decoder.output_buffer_size().ok_or("it is too large")?];
    decoder.read_image(&mut data).map_err(|error| error.to_string())?;
    Ok((width, height, data))
}

/// Pixels of as many channels as a decoder returned: gray or colour, with alpha or without.
fn with_all_pixels((width, height, data): (u32, u32, Vec<u8>)) -> Result<Pixels, String> {
    check_size(width, height)?;
    let count = width as usize * height as usize;
    let rgba = match (data.len() % count, data.len() / count) {
        (0, 1) => data.iter().map(|gray| [*gray, *gray, *gray, 255]).collect(),
        (0, 2) => data.as_chunks().0.iter().map(|[gray, a]| [*gray, *gray, *gray, *a]).collect(),
        (0, 3) => data.as_chunks().0.iter().map(|[r, g, b]| [*r, *g, *b, 255]).collect(),
        (0, 4) => data.as_chunks().0.to_vec(),
        _ => return Err(format!("{} bytes for {count} pixels", data.len())),
    };
    Ok(Pixels { width, height, rgba })
}

/// An image whose sides are at most [`MAX_IMAGE_SIDE`]: squares of pixels are averaged, in linear light.
fn reduced(pixels: Pixels) -> Pixels {
    let step = pixels.width.max(pixels.height).div_ceil(MAX_IMAGE_SIDE);
    if step == 1 {
        return pixels;
    }
    let (width, height) = (pixels.width.div_ceil(step), pixels.height.div_ceil(step));
    let decoded: Vec<f32> = (0..=255).map(|byte| srgb_to_linear(byte as f32 / 255.0)).collect();
    let encode = |value: f32| {
        let encoded = if value <= 0.003_130_8 { 12.92 * value } else { 1.055 * value.powf(1.0 / 2.4) - 0.055 };
        (encoded * 255.0).round() as u8
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
        // Columns of black and white: their mean, 0.5, is 188 in sRGB.
        let width = 2 * MAX_IMAGE_SIDE;
        let image = || Pixels {
            width,
            height: 1,
            rgba: (0..width).map(|x| [[0, 0, 0, 0], [255; 4]][x as usize % 2]).collect(),
        };
        let color = reduced(image());
        assert_eq!((color.width, color.height, color.rgba[7]), (MAX_IMAGE_SIDE, 1, [188, 188, 188, 128]));
    }
}
