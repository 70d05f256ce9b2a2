//! The materials and textures of a file, as the renderer uses them.

use girandole::glam::Vec3;
use girandole_assets::gltf::gltf::json::{Value, deserialize};
use girandole_assets::gltf::gltf::material::AlphaMode;
use girandole_assets::gltf::gltf::texture::Info;
use girandole_assets::gltf::gltf::{Document, Material as GltfMaterial};
use girandole_assets::gltf::{TextureUse, material_emission};

use super::images::Images;
use super::notes::Notes;
use super::texture::Texture;
use super::{Alpha, Material};

/// The opacity at which a mask cuts where the file does not state it.
const DEFAULT_CUTOFF: f32 = 0.5;

/// All materials of the file in its order, then that of primitives without one; and their textures.
pub fn convert_all(document: &Document, images: &Images, notes: &mut Notes) -> (Vec<Material>, Vec<Texture>) {
    let mut textures = Vec::new();
    let mut use_texture = |info: Option<Info<'_>>, is_srgb: bool| {
        let TextureUse { image, tex_coord: coordinates, transform, wrap, is_nearest, .. } = TextureUse::of(&info?);
        notes.add(coordinates > 1, "textures with texture coordinates beyond the second set are not used");
        let pixels = images.0.get(image)?.clone().filter(|_| coordinates < 2 && transform.is_finite())?;
        textures.push(Texture { pixels, coordinates, transform, wrap, is_nearest, is_srgb });
        Some(textures.len() as u32 - 1)
    };
    let with_textures = |material: GltfMaterial<'_>| {
        let surface = material.pbr_metallic_roughness();
        Material {
            base_color_texture: use_texture(surface.base_color_texture(), true),
            emission_texture: use_texture(material.emissive_texture(), true),
            roughness_texture: use_texture(surface.metallic_roughness_texture(), false),
            ..convert(&material)
        }
    };
    let mut materials: Vec<Material> = document.materials().map(with_textures).collect();
    // What glTF states for primitives without a material.
    materials.push(Material { base_color: Vec3::ONE, roughness: 1.0, metallic: 1.0, ..Material::default() });
    (materials, textures)
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
