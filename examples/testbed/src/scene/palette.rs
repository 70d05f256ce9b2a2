//! Materials that are collected while parts are built. Equal materials share an index.

use girandole::Profile;
use girandole::glam::{Vec3, vec3};

use super::Material;

/// An emissive material and the radiance of the lights that belong to it.
#[derive(Clone, Copy, Debug)]
pub struct Glow {
    /// Index into the scene's materials.
    pub material: u32,
    /// Nits.
    pub radiance: Vec3,
}

/// The materials so far.
#[derive(Clone, Debug, Default)]
pub struct Palette {
    /// These become [`super::Scene::materials`].
    pub materials: Vec<Material>,
    /// Street lamps shine as it says, if there is one.
    pub lamp_profile: Option<Profile>,
}

impl Palette {
    fn index_of(&mut self, material: Material) -> u32 {
        // A few hundred materials at most, so that a linear search costs little and floats need no
        // hash.
        let found = self.materials.iter().position(|known| *known == material);
        found.unwrap_or_else(|| {
            self.materials.push(material);
            self.materials.len() - 1
        }) as u32
    }

    /// A matte surface.
    pub fn matte(&mut self, red: f32, green: f32, blue: f32) -> u32 {
        self.glossy([red, green, blue], 0.85)
    }

    /// A matte surface that shadow rays pass: for flat ground, below which nothing is lit.
    pub fn shadowless(&mut self, color: [f32; 3]) -> u32 {
        let material = Material { base_color: color.into(), roughness: 0.85, ..Material::default() };
        self.index_of(Material { see_through: true, ..material })
    }

    /// A dielectric surface with the given perceptual roughness.
    pub fn glossy(&mut self, color: [f32; 3], roughness: f32) -> u32 {
        self.index_of(Material { base_color: color.into(), roughness, ..Material::default() })
    }

    /// A metal with the given perceptual roughness.
    pub fn metal(&mut self, color: [f32; 3], roughness: f32) -> u32 {
        self.index_of(Material { base_color: color.into(), roughness, metallic: 1.0, ..Material::default() })
    }

    /// A surface that emits `color`, scaled so that its largest channel is `nits`.
    pub fn glow(&mut self, color: Vec3, nits: f32) -> Glow {
        let radiance = color / color.max_element() * nits;
        let material = Material { base_color: Vec3::splat(0.1), emission: radiance, ..Material::default() };
        Glow { material: self.index_of(material), radiance }
    }
}

/// Linear colours of the walls of houses.
pub const WALLS: [[f32; 3]; 8] = [
    [0.30, 0.13, 0.09],
    [0.36, 0.19, 0.13],
    [0.42, 0.36, 0.28],
    [0.50, 0.45, 0.38],
    [0.34, 0.33, 0.32],
    [0.46, 0.42, 0.42],
    [0.25, 0.22, 0.21],
    [0.48, 0.38, 0.30],
];

/// Tungsten, about 2,700 K.
pub const WARM: Vec3 = vec3(1.0, 0.46, 0.13);
/// Halogen, about 3,300 K.
pub const SOFT: Vec3 = vec3(1.0, 0.58, 0.24);
/// Fluorescent tubes, about 4,500 K.
pub const NEUTRAL: Vec3 = vec3(1.0, 0.84, 0.62);
/// Screens and cold LEDs, about 7,000 K.
pub const COOL: Vec3 = vec3(0.55, 0.79, 1.0);
/// High-pressure sodium.
pub const SODIUM: Vec3 = vec3(1.0, 0.5, 0.14);
/// Saturated colours of signs: pink, cyan, amber, green, violet, red, blue.
pub const NEON: [Vec3; 7] = [
    vec3(1.0, 0.06, 0.42),
    vec3(0.05, 0.85, 1.0),
    vec3(1.0, 0.42, 0.03),
    vec3(0.12, 1.0, 0.25),
    vec3(0.5, 0.12, 1.0),
    vec3(1.0, 0.05, 0.04),
    vec3(0.08, 0.2, 1.0),
];
