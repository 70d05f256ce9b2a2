//! Bevy's lights in Girandole's units.
//!
//! Bevy divides the lumens of points and of spots alike by 4π (`extract_lights` in
//! `bevy_pbr::render::light`), ignores their scale, and takes the direction of spots and directional
//! lights from the third column of the transform. This file does the same.

use std::f32::consts::{FRAC_PI_2, PI};

use bevy::asset::AssetId;
use bevy::camera::Exposure;
use bevy::light::{DirectionalLight, PointLight, SpotLight};
use bevy::math::{Mat3, Vec3};
use bevy::mesh::Mesh;
use bevy::pbr::StandardMaterial;
use bevy::prelude::{Color, GlobalTransform};
use girandole::Placement;

use crate::kinds::KindKey;
use crate::rigs::Rig;
use crate::settings::RayTraced;
use crate::textures::TextureKey;

/// The emission of every light in a tree, in candela or nits. The factor of an instance, which is
/// at most 10⁴, scales it to the emission of the light: up to 10⁸ candela, which is 1.26 · 10⁹
/// lumens.
pub const UNIT: f32 = 1.0e4;

/// The outer angle to which Bevy reduces any outer angle of a right angle or more.
const MAX_OUTER_ANGLE: f32 = FRAC_PI_2 - 1.0e-4;

/// The kind of a light, and the factor between its emission and that of the kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Emitted {
    pub key: KindKey,
    pub factor: Vec3,
}

/// The linear colour in the primaries of Rec. 709.
fn linear(color: Color) -> Vec3 {
    let color = color.to_linear();
    Vec3::new(color.red, color.green, color.blue)
}

fn candela_factor(color: Color, lumens: f32) -> Vec3 {
    linear(color) * (lumens / (4.0 * PI) / UNIT)
}

pub fn point(light: &PointLight) -> Emitted {
    Emitted {
        key: KindKey::Point { range: light.range.to_bits(), radius: light.radius.to_bits() },
        factor: candela_factor(light.color, light.intensity),
    }
}

pub fn spot(light: &SpotLight) -> Emitted {
    let outer = if light.outer_angle >= FRAC_PI_2 { MAX_OUTER_ANGLE } else { light.outer_angle };
    let key = KindKey::Spot {
        range: light.range.to_bits(),
        radius: light.radius.to_bits(),
        inner: light.inner_angle.min(outer).to_bits(),
        outer: outer.to_bits(),
    };
    Emitted { key, factor: candela_factor(light.color, light.intensity) }
}

/// The light of a material on a mesh, which a rig may move; `None` if it emits nothing that can be
/// sampled.
///
/// Bevy's camera shows `emissive * mix(1, exposure, weight)` (`apply_pbr_lighting`), and a radiance of
/// L nits as `exposure * L`. So the material emits the first divided by the exposure. Ray tracing has a weight of 1.
pub fn emissive(
    (mesh, rig): (AssetId<Mesh>, Rig),
    material: &StandardMaterial,
    exposure: Exposure,
    ray_traced: RayTraced,
) -> Option<Emitted> {
    let emissive = Vec3::new(material.emissive.red, material.emissive.green, material.emissive.blue);
    if emissive.max_element() <= 0.0 || material.unlit {
        return None;
    }
    let weight = if ray_traced.0 { 1.0 } else { material.emissive_exposure_weight };
    let key = KindKey::Mesh {
        mesh,
        texture: TextureKey::of(material),
        two_sided: material.cull_mode.is_none(),
        weight: weight.to_bits(),
        ev100: exposure.ev100.to_bits(),
        rig,
    };
    Some(Emitted { key, factor: emissive * (nits(exposure, weight) / UNIT) })
}

/// What an emissive colour of 1 emits, in nits.
pub fn nits(exposure: Exposure, weight: f32) -> f32 {
    let exposure = exposure.exposure();
    (1.0 + (exposure - 1.0) * weight) / exposure
}

pub fn directional(light: &DirectionalLight, transform: &GlobalTransform) -> girandole::DirectionalLight {
    girandole::DirectionalLight {
        direction: transform.forward().into(),
        illuminance: linear(light.color) * light.illuminance,
    }
}

/// The place of a point light: its transform without rotation and scale.
pub fn point_placement(transform: &GlobalTransform) -> Placement {
    Placement::at(transform.translation().as_dvec3())
}

/// The place and rotation of a spot: its transform without scale.
pub fn spot_placement(transform: &GlobalTransform) -> Placement {
    let back: Vec3 = transform.back().into();
    let right = back.any_orthonormal_vector();
    let linear = Mat3::from_cols(right, back.cross(right), back);
    Placement { linear, translation: transform.translation().as_dvec3() }
}

/// The whole transform of a mesh.
pub fn mesh_placement(transform: &GlobalTransform) -> Placement {
    transform.affine().into()
}
