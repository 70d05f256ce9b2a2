//! The texels of images that the main world can read.

use std::sync::LazyLock;

use bevy::asset::RenderAssetUsages;
use bevy::color::Srgba;
use bevy::image::Image;
use bevy::math::{Vec3, Vec4};
use bevy::render::render_resource::{TextureDataOrder, TextureDimension, TextureFormat};

/// What stands for infinity: the largest finite half.
const LARGEST_HALF: f32 = 65504.0;
/// The largest width and height that the library takes.
const MAX_SIDE: usize = 1 << 15;

/// The linear value of each byte that is sRGB-encoded.
static LINEAR: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|byte| Srgba::gamma_function(byte as f32 / 255.0)));

/// How a texel is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Srgb,
    Unorm,
    SwappedSrgb,
    SwappedUnorm,
    Half,
    Float,
    /// Nine bits for each channel, and five for their exponent.
    SharedExponent,
}

impl Format {
    fn of(format: TextureFormat) -> Option<Self> {
        Some(match format {
            TextureFormat::Rgba8UnormSrgb => Self::Srgb,
            TextureFormat::Rgba8Unorm => Self::Unorm,
            TextureFormat::Bgra8UnormSrgb => Self::SwappedSrgb,
            TextureFormat::Bgra8Unorm => Self::SwappedUnorm,
            TextureFormat::Rgba16Float => Self::Half,
            TextureFormat::Rgba32Float => Self::Float,
            TextureFormat::Rgb9e5Ufloat => Self::SharedExponent,
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::Srgb | Self::Unorm | Self::SwappedSrgb | Self::SwappedUnorm | Self::SharedExponent => 4,
            Self::Half => 8,
            Self::Float => 16,
        }
    }

    /// A linear colour and alpha.
    fn read(self, bytes: &[u8]) -> Vec4 {
        let unorm = |i: usize| f32::from(bytes[i]) / 255.0;
        let srgb = |i: usize| LINEAR[usize::from(bytes[i])];
        let float = |i: usize| f32::from_le_bytes([0, 1, 2, 3].map(|k| bytes[4 * i + k]));
        let half = |i: usize| from_half(u16::from_le_bytes([bytes[2 * i], bytes[2 * i + 1]]));
        match self {
            Self::Srgb => Vec4::new(srgb(0), srgb(1), srgb(2), unorm(3)),
            Self::Unorm => Vec4::new(unorm(0), unorm(1), unorm(2), unorm(3)),
            Self::SwappedSrgb => Vec4::new(srgb(2), srgb(1), srgb(0), unorm(3)),
            Self::SwappedUnorm => Vec4::new(unorm(2), unorm(1), unorm(0), unorm(3)),
            Self::Half => Vec4::new(half(0), half(1), half(2), half(3)),
            Self::Float => Vec4::new(float(0), float(1), float(2), float(3)),
            Self::SharedExponent => {
                let bits = u32::from_le_bytes([0, 1, 2, 3].map(|k| bytes[k]));
                let scale = ((bits >> 27) as f32 - 24.0).exp2();
                Vec3::from([0, 9, 18].map(|shift| (bits >> shift & 511) as f32 * scale)).extend(1.0)
            }
        }
    }
}

/// The value of an IEEE half.
fn from_half(bits: u16) -> f32 {
    let sign = if bits & 0x8000 == 0 { 1.0 } else { -1.0 };
    let fraction = f32::from(bits & 1023);
    match i32::from(bits >> 10 & 31) {
        0 => sign * fraction * (-24f32).exp2(),
        31 if fraction > 0.0 => f32::NAN,
        31 => sign * f32::INFINITY,
        exponent => sign * (1.0 + fraction / 1024.0) * ((exponent - 15) as f32).exp2(),
    }
}

/// The largest mip level of an image.
pub struct Texels<'a> {
    bytes: &'a [u8],
    format: Format,
    /// Columns and rows.
    pub size: [usize; 2],
    pub layers: usize,
    /// Bytes from one layer to the next one.
    layer_bytes: usize,
}

impl<'a> Texels<'a> {
    /// The texels of an image; `None` for one that the main world does not keep, that has no texels, or whose format
    /// is compressed or has no three channels.
    pub fn new(image: &'a Image) -> Option<Self> {
        // Whether an image that only the render world keeps is still here is a matter of time.
        let bytes = image.data.as_deref().filter(|_| image.asset_usage.contains(RenderAssetUsages::MAIN_WORLD))?;
        let described = &image.texture_descriptor;
        let format = Format::of(described.format).filter(|_| described.dimension == TextureDimension::D2)?;
        let [width, height, layers] =
            [described.size.width, described.size.height, described.size.depth_or_array_layers].map(|n| n as usize);
        [width, height, layers].iter().all(|side| (1..=MAX_SIDE).contains(side)).then_some(())?;
        let level_bytes = |level: u32| {
            let [columns, rows] = [width, height].map(|side| (side >> level).max(1));
            columns * rows * format.bytes()
        };
        let layer_bytes = match image.data_order {
            TextureDataOrder::MipMajor => level_bytes(0),
            TextureDataOrder::LayerMajor => (0..described.mip_level_count.clamp(1, 32)).map(level_bytes).sum(),
        };
        let is_whole = bytes.len() >= layer_bytes * (layers - 1) + level_bytes(0);
        is_whole.then_some(Self { bytes, format, size: [width, height], layers, layer_bytes })
    }

    /// The bytes of the first layer, if a texel is red, green and blue that are sRGB-encoded, and alpha.
    pub fn srgb(&self) -> Option<&'a [u8]> {
        let [width, height] = self.size;
        (self.format == Format::Srgb).then(|| &self.bytes[..width * height * self.format.bytes()])
    }

    /// The linear colour of a texel, and alpha. Colours that are negative or NaN are black, and infinite ones are the
    /// largest half.
    pub fn texel(&self, layer: usize, [x, y]: [usize; 2]) -> Vec4 {
        let start = layer * self.layer_bytes + (y * self.size[0] + x) * self.format.bytes();
        let texel = self.format.read(&self.bytes[start..start + self.format.bytes()]);
        let sound = |value: f32| if value.is_infinite() { LARGEST_HALF } else { value };
        Vec4::from(texel.to_array().map(|value| sound(value.max(0.0))))
    }
}

#[cfg(test)]
mod tests {
    use bevy::render::render_resource::Extent3d;

    use super::*;

    fn image(format: TextureFormat, layers: u32, bytes: Vec<u8>) -> Image {
        let size = Extent3d { width: 1, height: 1, depth_or_array_layers: layers };
        Image::new(size, TextureDimension::D2, bytes, format, RenderAssetUsages::MAIN_WORLD)
    }

    fn texel(format: TextureFormat, bytes: &[u8]) -> Vec4 {
        Texels::new(&image(format, 1, bytes.to_vec())).expect("the format is read").texel(0, [0, 0])
    }

    #[test]
    fn formats_are_read_as_by_a_gpu() {
        let bytes = [255, 128, 0, 51];
        assert_eq!(texel(TextureFormat::Rgba8Unorm, &bytes), Vec4::new(1.0, 128.0 / 255.0, 0.0, 0.2));
        assert_eq!(texel(TextureFormat::Bgra8Unorm, &bytes), Vec4::new(0.0, 128.0 / 255.0, 1.0, 0.2));
        let srgb = texel(TextureFormat::Rgba8UnormSrgb, &bytes);
        assert!(srgb.abs_diff_eq(Vec4::new(1.0, 0.215_861, 0.0, 0.2), 1e-5), "{srgb}");
        assert_eq!(texel(TextureFormat::Bgra8UnormSrgb, &[0, 128, 255, 51]), srgb);
        // 1.5, the largest half, infinity and NaN.
        let halves = [0x3e00, 0x7bff, 0x7c00, 0x7e00].map(u16::to_le_bytes).concat();
        assert_eq!(texel(TextureFormat::Rgba16Float, &halves), Vec4::new(1.5, LARGEST_HALF, LARGEST_HALF, 0.0));
        let floats = [2.5, -1.0, 0.125, 1.0].map(f32::to_le_bytes).concat();
        assert_eq!(texel(TextureFormat::Rgba32Float, &floats), Vec4::new(2.5, 0.0, 0.125, 1.0));
        // An exponent of 16 over fractions of 1/512.
        let shared: u32 = 16 << 27 | 3 << 18 | 256 << 9 | 511;
        assert_eq!(
            texel(TextureFormat::Rgb9e5Ufloat, &shared.to_le_bytes()),
            Vec4::new(511.0 / 256.0, 1.0, 3.0 / 256.0, 1.0)
        );
    }

    #[test]
    fn layers_are_found_beside_their_mip_levels() {
        let byte = |value: u8| [value; 4];
        let size = Extent3d { width: 2, height: 1, depth_or_array_layers: 2 };
        let read = |order, levels: [u8; 6]| {
            let mut image = image(TextureFormat::Rgba8Unorm, 1, byte(0).to_vec());
            image.data = Some(levels.map(byte).concat());
            image.data_order = order;
            image.texture_descriptor.size = size;
            image.texture_descriptor.mip_level_count = 2;
            let texels = Texels::new(&image).expect("it is whole");
            [[0, 0], [0, 1], [1, 0], [1, 1]].map(|[layer, x]| (255.0 * texels.texel(layer, [x, 0]).x).round() as u8)
        };
        assert_eq!(read(TextureDataOrder::MipMajor, [1, 2, 3, 4, 9, 9]), [1, 2, 3, 4]);
        assert_eq!(read(TextureDataOrder::LayerMajor, [1, 2, 9, 3, 4, 9]), [1, 2, 3, 4]);
    }

    #[test]
    fn what_cannot_be_read_is_none() {
        let of = |change: fn(&mut Image)| {
            let mut image = image(TextureFormat::Rgba8Unorm, 1, vec![255; 4]);
            change(&mut image);
            Texels::new(&image).is_some()
        };
        assert!(of(|_| ()));
        assert!(!of(|image| image.asset_usage = RenderAssetUsages::RENDER_WORLD));
        assert!(!of(|image| image.data = None));
        assert!(!of(|image| image.data = Some(vec![255; 3])));
        assert!(!of(|image| image.texture_descriptor.format = TextureFormat::Bc7RgbaUnormSrgb));
        assert!(!of(|image| image.texture_descriptor.size.height = 0));
    }
}
