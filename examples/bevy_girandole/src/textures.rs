//! Emissive textures: meshes that are cut into parts, each of which emits the average of its texels.

use bevy::app::App;
use bevy::asset::AssetId;
use bevy::ecs::resource::Resource;
use bevy::image::{Image, ImageAddressMode, ImagePlugin, ImageSampler, ImageSamplerDescriptor};
use bevy::log::warn_once;
use bevy::math::{Affine2, Vec3};
use bevy::mesh::{Mesh, UvChannel};
use bevy::prelude::{AlphaMode, StandardMaterial};
use girandole::Light;
use girandole_assets::AssetError;
use girandole_assets::texture::{Texture, TextureWrap, TexturedSurface};

use crate::kinds::Sources;
use crate::texels::Texels;
use crate::triangles::{has_tex_coords, tex_coords};
use crate::units::UNIT;

/// The relative noise that the texels within parts may add to a sample of a mesh.
const NOISE: f32 = 0.3;
/// Parts beyond one for each triangle.
const MAX_ADDED_PARTS: usize = 1024;

/// What a texture without a sampler of its own shows beyond its sides.
#[derive(Resource, Clone, Copy, Debug)]
pub struct DefaultWrap([TextureWrap; 2]);

impl DefaultWrap {
    /// As the application has told Bevy.
    pub fn of(app: &App) -> Self {
        let sampler = app.get_added_plugins::<ImagePlugin>().first().map(|plugin| wrap(&plugin.default_sampler));
        Self(sampler.unwrap_or([TextureWrap::Clamp; 2]))
    }
}

fn wrap(sampler: &ImageSamplerDescriptor) -> [TextureWrap; 2] {
    [sampler.address_mode_u, sampler.address_mode_v].map(|mode| match mode {
        ImageAddressMode::Repeat => TextureWrap::Repeat,
        ImageAddressMode::MirrorRepeat => TextureWrap::Mirror,
        ImageAddressMode::ClampToEdge | ImageAddressMode::ClampToBorder => TextureWrap::Clamp,
    })
}

/// What the material does to its emissive colour, and where. Floats are compared by their bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TextureKey {
    image: AssetId<Image>,
    /// Whether the second texture coordinates of the mesh are used.
    is_second: bool,
    uv_transform: [u32; 6],
    mask: Option<Mask>,
}

/// What cuts texels out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Mask {
    image: AssetId<Image>,
    /// The alpha of the texture below which nothing is seen.
    min_alpha: u32,
}

impl TextureKey {
    /// The emissive texture of a material, with its mask.
    pub fn of(material: &StandardMaterial) -> Option<Self> {
        let image = material.emissive_texture.as_ref()?.id();
        let has_same_coords = material.base_color_channel == material.emissive_channel;
        let mask = match (material.alpha_mode, &material.base_color_texture) {
            (AlphaMode::Mask(cutoff), Some(texture)) if has_same_coords => {
                let min_alpha = cutoff / material.base_color.to_linear().alpha;
                Some(Mask { image: texture.id(), min_alpha: min_alpha.to_bits() })
            }
            _ => None,
        };
        Some(Self {
            image,
            is_second: material.emissive_channel == UvChannel::Uv1,
            uv_transform: material.uv_transform.to_cols_array().map(f32::to_bits),
            mask,
        })
    }

    /// The images that count.
    pub fn images(self) -> impl Iterator<Item = AssetId<Image>> {
        [Some(self.image), self.mask.map(|mask| mask.image)].into_iter().flatten()
    }

    /// Whether Bevy shows the texture on a mesh.
    pub fn is_shown_on(self, mesh: &Mesh) -> bool {
        has_tex_coords(mesh, self.is_second)
    }

    /// The parts of a mesh as lights, for a material whose emissive colour is [`UNIT`]; with `is_cut` false, its
    /// triangles. `None` while an image is not loaded, and for what cannot be read.
    pub fn lights(
        self,
        mesh: &Mesh,
        corners: &[[Vec3; 3]],
        (two_sided, is_cut): (bool, bool),
        sources: &Sources,
    ) -> Option<Vec<Light>> {
        let Some(coords) = tex_coords(mesh, self.is_second) else {
            warn_once!("girandole: a mesh whose texture coordinates are not floats is not sampled as a light");
            return None;
        };
        let image = sources.images.get(self.image)?;
        let mask = match self.mask {
            Some(mask) => Some((sources.images.get(mask.image)?, f32::from_bits(mask.min_alpha))),
            None => None,
        };
        let Some(emission) = Emission::new(image, mask) else {
            warn_once!("girandole: a material with an emissive texture or a mask that cannot be read is not sampled");
            return None;
        };
        let transform = Affine2::from_cols_array(&self.uv_transform.map(f32::from_bits));
        let surface = |(corners, coords): (&[Vec3; 3], [_; 3])| {
            let coords = coords.map(|at| transform.transform_point2(at));
            let surface = TexturedSurface::triangle(*corners, coords, Vec3::splat(UNIT))?;
            Ok(if two_sided { surface.two_sided() } else { surface })
        };
        let lights = || -> Result<Vec<Light>, AssetError> {
            let surfaces = corners.iter().zip(coords).map(surface).collect::<Result<Vec<_>, AssetError>>()?;
            let wrap = match &image.sampler {
                ImageSampler::Default => sources.default_wrap.0,
                ImageSampler::Descriptor(sampler) => wrap(sampler),
            };
            let mut texture = emission.texture()?.with_wrap(wrap);
            let added = if is_cut { MAX_ADDED_PARTS } else { 0 };
            let parts = texture.split(&surfaces, NOISE, surfaces.len() + added);
            Ok(parts.iter().map(|part| texture.light(part)).collect())
        };
        match lights() {
            Ok(lights) => Some(lights),
            Err(error) => {
                warn_once!("girandole: a mesh with an emissive texture is not sampled as a light: {error}");
                None
            }
        }
    }
}

/// The texels that emit.
enum Emission<'a> {
    /// Texels as they are stored.
    Srgb { width: usize, rgba: &'a [u8] },
    /// Linear colours.
    Linear { width: usize, texels: Vec<Vec3> },
}

impl<'a> Emission<'a> {
    /// The texels of an image. What the alpha of a second image cuts out is black: each image has as many texels as
    /// the larger one of both. `None` if an image cannot be read.
    fn new(image: &'a Image, mask: Option<(&Image, f32)>) -> Option<Self> {
        let texels = Texels::new(image)?;
        let mask = match mask {
            Some((image, min_alpha)) => Some((Texels::new(image)?, min_alpha)),
            None => None,
        };
        if let (Some(rgba), None) = (texels.srgb(), &mask) {
            return Some(Self::Srgb { width: texels.size[0], rgba });
        }
        let mask_size = mask.as_ref().map_or([1, 1], |(mask, _)| mask.size);
        let [width, height] = [0, 1].map(|k| texels.size[k].max(mask_size[k]));
        // The texel of an image at the middle of one of the result.
        let at = |size: [usize; 2], x: usize, y: usize| {
            [(2 * x + 1) * size[0] / (2 * width), (2 * y + 1) * size[1] / (2 * height)]
        };
        let texel = |x: usize, y: usize| {
            let is_cut_out = |(mask, min_alpha): &(Texels, f32)| mask.texel(0, at(mask.size, x, y)).w < *min_alpha;
            match mask.as_ref().is_some_and(is_cut_out) {
                true => Vec3::ZERO,
                false => texels.texel(0, at(texels.size, x, y)).truncate(),
            }
        };
        let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| texel(x, y)).collect();
        Some(Self::Linear { width, texels })
    }

    fn texture(&self) -> Result<Texture<'_>, AssetError> {
        match self {
            Self::Srgb { width, rgba } => Texture::srgb(*width, *rgba),
            Self::Linear { width, texels } => Texture::linear(*width, texels.as_slice()),
        }
    }
}

#[cfg(test)]
mod tests;
