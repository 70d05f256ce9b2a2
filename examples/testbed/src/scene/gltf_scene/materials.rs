//! The materials and textures of a file, as the renderer uses them.

use std::collections::BTreeMap;

use girandole::glam::Vec3;
use girandole_assets::gltf::gltf::json::{Value, deserialize};
use girandole_assets::gltf::gltf::material::AlphaMode;
use girandole_assets::gltf::gltf::texture::Info;
use girandole_assets::gltf::gltf::{Document, Material as GltfMaterial, Primitive, Semantic};
use girandole_assets::gltf::{TextureUse, material_emission};
use girandole_assets::texture::TextureWrap;

use super::images::Images;
use super::texture::{Texture, Wrap};
use super::{Alpha, Material};

/// The opacity at which a mask cuts where the file does not state it.
const DEFAULT_CUTOFF: f32 = 0.5;

/// The index of a material in the scene, and the two sets of texture coordinates that it uses.
type Made = (u32, [Option<u32>; 2]);

/// The materials of a scene, made when a primitive needs them.
pub struct Materials<'a> {
    images: &'a Images,
    /// The materials so far.
    pub materials: Vec<Material>,
    /// The textures so far.
    pub textures: Vec<Texture>,
    /// Materials that were made, by the index in the file and the sets of coordinates that the primitive
    /// lacks.
    known: BTreeMap<(Option<usize>, Vec<u32>), Made>,
    /// What the user should know: one line each.
    pub warnings: Vec<String>,
}

impl<'a> Materials<'a> {
    /// No materials yet.
    pub fn new(images: &'a Images) -> Self {
        let (materials, textures) = (Vec::new(), Vec::new());
        Self { images, materials, textures, known: BTreeMap::new(), warnings: Vec::new() }
    }

    /// Makes all materials of the file, in its order, so that they have the same indices.
    pub fn add_all(&mut self, document: &Document) {
        for material in document.materials() {
            self.add(&material, &[]);
        }
    }

    /// The material of a primitive. Textures whose coordinates the primitive lacks are left out.
    pub fn of(&mut self, primitive: &Primitive<'_>) -> Made {
        let material = primitive.material();
        let sets = infos(&material).into_iter().flatten().map(|info| TextureUse::of(&info).tex_coord);
        let mut lacking: Vec<u32> = sets.filter(|&set| primitive.get(&Semantic::TexCoords(set)).is_none()).collect();
        lacking.sort_unstable();
        lacking.dedup();
        self.add(&material, &lacking)
    }

    fn add(&mut self, material: &GltfMaterial<'_>, lacking: &[u32]) -> Made {
        let key = (material.index(), lacking.to_vec());
        if let Some(&known) = self.known.get(&key) {
            return known;
        }
        let (mut converted, mut sets) = (convert(material), [None; 2]);
        let is_color = [true, true, false];
        let mut slots = infos(material).into_iter().zip(is_color).map(|(info, is_srgb)| {
            let texture = TextureUse::of(&info?);
            if lacking.contains(&texture.tex_coord) || !texture.transform.is_finite() {
                return None;
            }
            let pixels = self.images.pixels.get(texture.image)?.clone()?;
            let Some(coordinates) = slot_of(&mut sets, texture.tex_coord) else {
                let number = material.index().unwrap_or_default();
                self.warnings.push(format!(
                    "material {number} uses more than two sets of texture coordinates; one texture is left out"
                ));
                return None;
            };
            let TextureUse { transform, wrap, is_nearest, .. } = texture;
            let wrap = wrap.map(wrap_of);
            self.textures.push(Texture { pixels, coordinates, transform, wrap, is_nearest, is_srgb });
            Some(self.textures.len() as u32 - 1)
        });
        converted.base_color_texture = slots.next().flatten();
        converted.emission_texture = slots.next().flatten();
        converted.roughness_texture = slots.next().flatten();
        drop(slots);
        self.materials.push(converted);
        let made = (self.materials.len() as u32 - 1, sets);
        self.known.insert(key, made);
        made
    }
}

/// The textures of base colour, emission and roughness.
fn infos<'a>(material: &GltfMaterial<'a>) -> [Option<Info<'a>>; 3] {
    let surface = material.pbr_metallic_roughness();
    [surface.base_color_texture(), material.emissive_texture(), surface.metallic_roughness_texture()]
}

fn wrap_of(wrap: TextureWrap) -> Wrap {
    match wrap {
        TextureWrap::Repeat => Wrap::Repeat,
        TextureWrap::Mirror => Wrap::Mirror,
        TextureWrap::Clamp => Wrap::Clamp,
    }
}

/// The place of a set of texture coordinates among the two of a material.
fn slot_of(sets: &mut [Option<u32>; 2], set: u32) -> Option<u32> {
    let place = sets.iter().position(|known| known.is_none_or(|known| known == set))?;
    sets[place] = Some(set);
    Some(place as u32)
}

fn convert(material: &GltfMaterial<'_>) -> Material {
    let surface = material.pbr_metallic_roughness();
    let [red, green, blue, opacity] = surface.base_color_factor();
    let alpha = match material.alpha_mode() {
        AlphaMode::Opaque => Alpha::Opaque,
        AlphaMode::Mask => Alpha::Mask(material.alpha_cutoff().unwrap_or(DEFAULT_CUTOFF)),
        AlphaMode::Blend => Alpha::Blend,
    };
    let transmission = transmission(material);
    let is_unlit = material.extension_value("KHR_materials_unlit").is_some();
    let mut converted = Material {
        base_color: Vec3::new(red, green, blue).clamp(Vec3::ZERO, Vec3::ONE),
        roughness: surface.roughness_factor().clamp(0.0, 1.0),
        metallic: surface.metallic_factor().clamp(0.0, 1.0),
        emission: material_emission(material),
        two_sided_emission: material.double_sided() || is_unlit,
        is_unlit,
        see_through: see_through(material),
        alpha,
        opacity: opacity.clamp(0.0, 1.0),
        ..Material::default()
    };
    // Light that is transmitted passes straight on. A mask has no room for another opacity.
    if transmission > 0.0 && !matches!(alpha, Alpha::Mask(_)) {
        let covered = if alpha == Alpha::Blend { converted.opacity } else { 1.0 };
        converted.alpha = Alpha::Blend;
        converted.opacity = covered * (1.0 - transmission);
    }
    converted
}

/// The factor of KHR_materials_transmission, from 0 to 1.
fn transmission(material: &GltfMaterial<'_>) -> f32 {
    let factor =
        material.extension_value("KHR_materials_transmission").and_then(|value| value.get("transmissionFactor"));
    factor.and_then(Value::as_f64).map_or(0.0, |factor| factor as f32).clamp(0.0, 1.0)
}

/// Whether the material's extras contain `"see_through": true`.
fn see_through(material: &GltfMaterial<'_>) -> bool {
    let extras = material.extras().as_ref().and_then(|raw| deserialize::from_str::<Value>(raw.get()).ok());
    extras.and_then(|extras| extras.get("see_through")?.as_bool()).unwrap_or(false)
}
