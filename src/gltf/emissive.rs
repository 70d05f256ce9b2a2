//! The emissive textures of primitives, with what the alpha of the base colour cuts out of them.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use ::gltf::material::AlphaMode;
use ::gltf::{Material, Primitive, Semantic};
use glam::{DAffine2, DVec2, Vec2, Vec3};

use super::error::GltfError;
use super::read::TexCoords;
use super::texture::{TextureImage, TextureUse};
use crate::error::TextureError;
use crate::texture::{MAX_SIZE, Texture, TextureWrap};

/// How many times as many texels as two images an image of both may have.
const MAX_WASTE: u64 = 4;

/// Once textures of more texels than these are kept, all are dropped before the next. A texture takes up to 20 bytes a
/// texel, with its reduced copies.
const MAX_HELD: usize = 1 << 24;

/// The images of a texture, and how it shows them: textures with equal ones are equal.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Content {
    emissive: Option<usize>,
    mask: Option<Mask>,
    wrap: [TextureWrap; 2],
}

/// How the alpha of an image cuts texels out.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Mask {
    image: usize,
    /// Bits of the base colour's alpha, which multiplies that of texels.
    alpha: u32,
    /// Bits of the alpha from which on a texel is there; without it, its alpha is how much of it is there.
    cutoff: Option<u32>,
}

/// What the texture of a primitive depends on.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct TextureKey {
    content: Content,
    coordinates: Option<usize>,
    /// Bits of the transform.
    transform: [u64; 6],
}

/// A texture that a primitive emits, whose images and coordinates are there.
pub(super) struct EmissiveTexture<'a> {
    pub key: TextureKey,
    pub coordinates: TexCoords<'a>,
    transform: DAffine2,
    source: Source<'a>,
}

#[derive(Clone, Copy)]
enum Source<'a> {
    Plain(TextureImage<'a>),
    Masked { emissive: Option<TextureImage<'a>>, mask: TextureImage<'a>, alpha: f32, cutoff: Option<f32> },
}

impl<'a> EmissiveTexture<'a> {
    /// Whether the alpha of a base colour counts in it.
    pub fn is_masked(&self) -> bool {
        matches!(self.source, Source::Masked { .. })
    }

    /// The texture of a primitive; `None` if there is none, or its image or its coordinates are not there.
    pub fn of<B: AsRef<[u8]>>(
        material: &Material<'_>,
        primitive: &Primitive<'_>,
        images: &[Option<TextureImage<'a>>],
        buffers: &'a [B],
    ) -> Result<Option<Self>, GltfError> {
        let base = material.pbr_metallic_roughness();
        let cut_out = base.base_color_texture().filter(|_| material.alpha_mode() != AlphaMode::Opaque);
        let [emissive, mask] = [material.emissive_texture(), cut_out].map(|info| {
            let found = TextureUse::of(&info?);
            Some((found, images.get(found.image).copied().flatten()?))
        });
        // Two images are one texture if they lie on the surface in the same way.
        let lies = |(found, _): (TextureUse, _)| (found.tex_coord, found.transform, found.wrap);
        let mask = mask.filter(|mask| emissive.is_none_or(|emissive| lies(emissive) == lies(*mask)));
        // An image as large as both along each axis holds them; a long one and a high one have a huge one.
        let of_both = |(_, mask): &(TextureUse, TextureImage<'_>)| {
            let [size, other] = [Some(*mask), emissive.map(|(_, image)| image)]
                .map(|image| image.map_or([0, 0], |image| [image.width, image.height].map(u64::from)));
            let both = [0, 1].map(|k| size[k].max(other[k]));
            both[0] * both[1] <= MAX_WASTE * (size[0] * size[1] + other[0] * other[1])
                && both.iter().all(|side| *side <= MAX_SIZE as u64)
        };
        let mask = mask.filter(of_both);
        let Some((texture, shown)) = emissive.or(mask) else { return Ok(None) };
        for (found, image) in [emissive, mask].into_iter().flatten() {
            image.check(found.image)?;
            if !found.transform.is_finite() {
                let message = "the transform of its texture is not finite".into();
                return Err(GltfError::Image { image: found.image, message });
            }
        }
        let Some(coordinates) = TexCoords::new(primitive, texture.tex_coord, buffers)? else { return Ok(None) };
        let alpha = alpha_of(material);
        let is_masked = material.alpha_mode() == AlphaMode::Mask;
        let cutoff = is_masked.then(|| material.alpha_cutoff().unwrap_or(0.5));
        let cuts = |(found, _): (TextureUse, _)| Mask {
            image: found.image,
            alpha: alpha.to_bits(),
            cutoff: cutoff.map(f32::to_bits),
        };
        let source = mask.map_or(Source::Plain(shown), |(_, mask)| Source::Masked {
            emissive: emissive.map(|(_, image)| image),
            mask,
            alpha,
            cutoff,
        });
        let transform = DAffine2::from_mat2_translation(
            texture.transform.matrix2.as_dmat2(),
            texture.transform.translation.as_dvec2(),
        );
        let emissive = emissive.map(|(found, _)| found.image);
        let key = TextureKey {
            content: Content { emissive, mask: mask.map(cuts), wrap: texture.wrap },
            coordinates: primitive.get(&Semantic::TexCoords(texture.tex_coord)).map(|accessor| accessor.index()),
            transform: transform.to_cols_array().map(f64::to_bits),
        };
        Ok(Some(Self { key, coordinates, transform, source }))
    }

    /// The coordinates of corners on the image. In f64, where the products of finite numbers of f32 are finite.
    pub fn on_image(&self, corners: [Vec2; 3]) -> [DVec2; 3] {
        corners.map(|corner| self.transform.transform_point2(corner.as_dvec2()))
    }
}

/// How much of a material is there, where no texture says it.
pub(super) fn coverage(material: &Material<'_>) -> f32 {
    match material.alpha_mode() {
        AlphaMode::Opaque => 1.0,
        AlphaMode::Mask if alpha_of(material) < material.alpha_cutoff().unwrap_or(0.5) => 0.0,
        AlphaMode::Mask => 1.0,
        AlphaMode::Blend => alpha_of(material),
    }
}

/// The base colour's alpha.
fn alpha_of(material: &Material<'_>) -> f32 {
    material.pbr_metallic_roughness().base_color_factor()[3].clamp(0.0, 1.0)
}

/// The textures of a document, made when they are met. The last ones are kept.
#[derive(Default)]
pub(super) struct Textures<'a> {
    made: BTreeMap<Content, Texture<'a>>,
    /// Texels of all of them.
    held: usize,
}

impl<'a> Textures<'a> {
    pub fn get(&mut self, texture: &EmissiveTexture<'a>) -> Result<&mut Texture<'a>, GltfError> {
        let content = texture.key.content;
        let image = content.emissive.or(content.mask.map(|mask| mask.image)).unwrap_or(0);
        let refused = |error: TextureError| GltfError::Image { image, message: error.to_string() };
        if self.held > MAX_HELD && !self.made.contains_key(&content) {
            self.made.clear();
            self.held = 0;
        }
        Ok(match self.made.entry(content) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(place) => {
                let texture = texture.source.texture().map_err(refused)?.with_wrap(content.wrap);
                self.held += texture.size().into_iter().product::<usize>();
                place.insert(texture)
            }
        })
    }
}

impl<'a> Source<'a> {
    fn texture(self) -> Result<Texture<'a>, TextureError> {
        let plain = |image: TextureImage<'a>| Texture::srgb(image.width as usize, image.rgba);
        let (emissive, mask, alpha, cutoff) = match self {
            Self::Plain(image) => return plain(image),
            Self::Masked { emissive, mask, alpha, cutoff } => (emissive.map(plain).transpose()?, mask, alpha, cutoff),
        };
        // Of images of two sizes, the finer one decides along each axis.
        let of_mask = [mask.width as usize, mask.height as usize];
        let size = emissive.as_ref().map_or(of_mask, |found| [0, 1].map(|k| found.size()[k].max(of_mask[k])));
        let covered = |at: [usize; 2]| {
            let [x, y] = [0, 1].map(|k| (2 * at[k] + 1) * of_mask[k] / (2 * size[k]));
            let there = f32::from(mask.rgba[4 * (y * of_mask[0] + x) + 3]) / 255.0 * alpha;
            cutoff.map_or(there, |cutoff| if there >= cutoff { 1.0 } else { 0.0 })
        };
        let texel = |x: usize, y: usize| {
            let at = Vec2::new((x as f32 + 0.5) / size[0] as f32, (y as f32 + 0.5) / size[1] as f32);
            emissive.as_ref().map_or(Vec3::ONE, |found| found.color(at)) * covered([x, y])
        };
        let texels: Vec<Vec3> =
            (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| (x, y))).map(|(x, y)| texel(x, y)).collect();
        Texture::linear(size[0], texels)
    }
}
