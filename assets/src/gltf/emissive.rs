//! The emissive textures of primitives, with what the alpha of the base colour cuts out of them.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use ::gltf::material::AlphaMode;
use ::gltf::{Material, Primitive, Semantic};
use glam::{DAffine2, DVec2, Vec2, Vec3};

use super::read::{Triangles, Vectors};
use super::texture::{TextureImage, TextureUse};
use crate::error::{AssetError, invalid};
use crate::texture::{MAX_SIZE, Texture, TextureWrap};

/// How many times as many texels as two images an image of both may have.
const MAX_WASTE: u64 = 4;

/// Once textures of more texels than these are kept, all are dropped before the next. A texture takes up to 20 bytes a
/// texel, with its reduced copies.
const MAX_HELD: usize = 1 << 24;

/// What a texture shows: textures with equal contents are equal. There is an image or a mask.
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
    /// The accessor of the coordinates.
    coordinates: usize,
    /// Bits of the transform.
    transform: [u64; 6],
}

/// A texture that a primitive emits, whose images and coordinates are there.
pub(super) struct EmissiveTexture<'a> {
    content: Content,
    coordinates: Vectors<'a, 2>,
    transform: DAffine2,
}

impl<'a> EmissiveTexture<'a> {
    /// The texture of a primitive; `None` if there is none, or its image or its coordinates are not there.
    pub fn of(
        primitive: &Primitive<'_>,
        images: &[Option<TextureImage<'_>>],
        buffers: &'a [Vec<u8>],
    ) -> Result<Option<Self>, AssetError> {
        let material = primitive.material();
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
        for (found, image) in [emissive, mask].into_iter().flatten() {
            image.check(found.image)?;
            if !found.transform.is_finite() {
                return Err(invalid(format!("image {}: the transform of its texture is not finite", found.image)));
            }
        }
        let Some((texture, _)) = emissive.or(mask) else { return Ok(None) };
        let Some(coordinates) = primitive.get(&Semantic::TexCoords(texture.tex_coord)) else { return Ok(None) };
        let (matrix, translation) = (texture.transform.matrix2.as_dmat2(), texture.transform.translation.as_dvec2());
        let mask = mask.map(|(found, _)| Mask {
            image: found.image,
            alpha: alpha_of(&material).to_bits(),
            cutoff: cutoff_of(&material).map(f32::to_bits),
        });
        let content = Content { emissive: emissive.map(|(found, _)| found.image), mask, wrap: texture.wrap };
        let coordinates = Vectors::new(&coordinates, buffers)?;
        let transform = DAffine2::from_mat2_translation(matrix, translation);
        Ok(Some(Self { content, coordinates, transform }))
    }

    pub fn key(&self) -> TextureKey {
        let transform = self.transform.to_cols_array().map(f64::to_bits);
        TextureKey { content: self.content, coordinates: self.coordinates.accessor, transform }
    }

    /// Whether the alpha of a base colour counts in it.
    pub fn is_masked(&self) -> bool {
        self.content.mask.is_some()
    }

    /// The coordinates of triangles' corners on the image. In f64, where the products of finite numbers of f32 are finite.
    pub fn on_image(&self, triangles: &Triangles<'_>) -> impl Iterator<Item = Result<[DVec2; 3], AssetError>> {
        triangles.corners(&self.coordinates).map(|corners| {
            let corners = corners?.map(Vec2::from);
            if corners.iter().all(|corner| corner.is_finite()) {
                return Ok(corners.map(|corner| self.transform.transform_point2(corner.as_dvec2())));
            }
            let accessor = self.coordinates.accessor;
            Err(invalid(format!("accessor {accessor}: a texture coordinate is not a finite number")))
        })
    }
}

/// How much of a material is there, where no texture says it.
pub(super) fn coverage(material: &Material<'_>) -> f32 {
    let alpha = alpha_of(material);
    match (material.alpha_mode(), cutoff_of(material)) {
        (AlphaMode::Blend, _) => alpha,
        (_, Some(cutoff)) if alpha < cutoff => 0.0,
        _ => 1.0,
    }
}

/// The base colour's alpha.
fn alpha_of(material: &Material<'_>) -> f32 {
    material.pbr_metallic_roughness().base_color_factor()[3].clamp(0.0, 1.0)
}

/// The alpha at which a mask cuts.
fn cutoff_of(material: &Material<'_>) -> Option<f32> {
    (material.alpha_mode() == AlphaMode::Mask).then(|| material.alpha_cutoff().unwrap_or(0.5))
}

/// The textures of a document, made when they are met. The last ones are kept.
pub(super) struct Textures<'a> {
    images: &'a [Option<TextureImage<'a>>],
    made: BTreeMap<Content, Texture<'a>>,
    /// Texels of all of them.
    held: usize,
}

impl<'a> Textures<'a> {
    pub fn new(images: &'a [Option<TextureImage<'a>>]) -> Self {
        Self { images, made: BTreeMap::new(), held: 0 }
    }

    pub fn get(&mut self, texture: &EmissiveTexture<'_>) -> Result<&mut Texture<'a>, AssetError> {
        let (content, images) = (texture.content, self.images);
        if self.held > MAX_HELD && !self.made.contains_key(&content) {
            self.made.clear();
            self.held = 0;
        }
        Ok(match self.made.entry(content) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(place) => {
                let texture = content.texture(images)?;
                self.held += texture.size().into_iter().product::<usize>();
                place.insert(texture)
            }
        })
    }
}

impl Content {
    fn texture<'a>(&self, images: &[Option<TextureImage<'a>>]) -> Result<Texture<'a>, AssetError> {
        let image = |index: usize| images.get(index).copied().flatten();
        let refused = |error: AssetError| {
            let image = self.emissive.or(self.mask.map(|mask| mask.image)).unwrap_or(0);
            invalid(format!("image {image}: {error}"))
        };
        let plain = |image: TextureImage<'a>| Texture::srgb(image.width as usize, image.rgba).map_err(refused);
        let emissive = self.emissive.and_then(image).map(plain).transpose()?;
        let Some((mask, pixels)) = self.mask.and_then(|mask| Some((mask, image(mask.image)?))) else {
            return Ok(emissive.ok_or_else(|| refused(invalid("it is missing")))?.with_wrap(self.wrap));
        };
        // Of images of two sizes, the finer one decides along each axis.
        let of_mask = [pixels.width as usize, pixels.height as usize];
        let size = emissive.as_ref().map_or(of_mask, |found| [0, 1].map(|k| found.size()[k].max(of_mask[k])));
        let covered = |at: [usize; 2]| {
            let [x, y] = [0, 1].map(|k| (2 * at[k] + 1) * of_mask[k] / (2 * size[k]));
            let alpha = f32::from(pixels.rgba[4 * (y * of_mask[0] + x) + 3]) / 255.0 * f32::from_bits(mask.alpha);
            mask.cutoff.map_or(alpha, |cutoff| if alpha >= f32::from_bits(cutoff) { 1.0 } else { 0.0 })
        };
        let texel = |x: usize, y: usize| {
            let at = Vec2::new((x as f32 + 0.5) / size[0] as f32, (y as f32 + 0.5) / size[1] as f32);
            emissive.as_ref().map_or(Vec3::ONE, |found| found.color(at)) * covered([x, y])
        };
        let texels: Vec<Vec3> =
            (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| (x, y))).map(|(x, y)| texel(x, y)).collect();
        Ok(Texture::linear(size[0], texels).map_err(refused)?.with_wrap(self.wrap))
    }
}
