//! Camera rays, sky and BRDF. `render.wgsl` has the same functions; `examples/city/tests/all/images.rs`
//! compares the pictures of both.

use super::scene::{Camera, Material, Sky};
use girandole::Gloss;
use girandole::glam::{Vec2, Vec3};
use girandole::light::luminance;
use std::f32::consts::PI;

/// Reflectance of dielectrics at normal incidence.
const DIELECTRIC_F0: f32 = 0.04;
/// With a smaller GGX alpha, highlights are too narrow for f32.
const MIN_ALPHA: f32 = 1e-3;

/// A camera's position and axes.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// The origin of camera rays.
    pub eye: Vec3,
    /// Half the width of the picture at a distance of 1.
    pub right: Vec3,
    /// Half the height of the picture at a distance of 1.
    pub up: Vec3,
    /// A unit vector.
    pub forward: Vec3,
}

impl View {
    /// The view of a camera whose eye and target differ.
    pub fn new(camera: &Camera, width: u32, height: u32) -> Self {
        let forward = (camera.target - camera.eye).normalize_or(Vec3::NEG_Z);
        let right = forward.cross(camera.up).try_normalize().unwrap_or(Vec3::X);
        let half_height = (camera.vertical_fov * 0.5).tan();
        let half_width = half_height * width as f32 / height as f32;
        Self { eye: camera.eye, right: right * half_width, up: right.cross(forward) * half_height, forward }
    }

    /// The unit direction through a position in the picture, in pixels from its upper left corner.
    pub fn direction(&self, position: Vec2, size: Vec2) -> Vec3 {
        let across = position / size * 2.0 - Vec2::ONE;
        (self.forward + self.right * across.x - self.up * across.y).normalize()
    }

    /// The position in the picture that shows what lies in a direction from the eye, and the depth of its end; `None`
    /// behind the eye. The inverse of [`View::direction`].
    pub fn place(&self, toward: Vec3, size: Vec2) -> Option<(Vec2, f32)> {
        let depth = toward.dot(self.forward);
        let across = |axis: Vec3| toward.dot(axis) / (axis.length_squared() * depth);
        (depth > 0.0).then(|| ((Vec2::new(across(self.right), -across(self.up)) + 1.0) * 0.5 * size, depth))
    }
}

/// Radiance of the sky in a direction. Below the horizon it is that of the horizon.
pub fn sky_radiance(sky: &Sky, direction: Vec3) -> Vec3 {
    let glow = direction.dot(sky.sun).max(0.0).powi(8);
    sky.horizon.lerp(sky.zenith, direction.y.max(0.0).sqrt()) + sky.glow * glow
}

/// What arrives of the radiance of a surface at `distance` metres through haze, which shines like the
/// horizon.
pub fn through_haze(sky: &Sky, radiance: Vec3, distance: f32) -> Vec3 {
    let clear = (-distance * sky.haze).exp();
    radiance * clear + sky.horizon * (1.0 - clear)
}

/// The BRDF, per steradian: a Lambertian base under GGX with Smith's height-correlated masking and
/// Schlick's Fresnel term, combined as in appendix B of glTF 2.0. Directions are unit vectors that
/// point away from the surface.
pub fn brdf(material: &Material, normal: Vec3, view: Vec3, light: Vec3) -> Vec3 {
    let half = (view + light).normalize_or_zero();
    let n_dot_l = normal.dot(light).max(0.0);
    let n_dot_v = normal.dot(view).max(1e-4);
    let n_dot_h = normal.dot(half);
    let v_dot_h = view.dot(half).clamp(0.0, 1.0);

    let alpha = (material.roughness * material.roughness).max(MIN_ALPHA);
    let alpha_sq = alpha * alpha;
    // 1 - (n.h)^2 without cancellation, as Filament computes it.
    let n_cross_h = normal.cross(half);
    let scaled = n_dot_h * alpha;
    let k = alpha / (n_cross_h.length_squared() + scaled * scaled);
    let distribution = k * k / PI;
    let lambda_v = n_dot_l * (n_dot_v * n_dot_v * (1.0 - alpha_sq) + alpha_sq).sqrt();
    let lambda_l = n_dot_v * (n_dot_l * n_dot_l * (1.0 - alpha_sq) + alpha_sq).sqrt();
    let visibility = 0.5 / (lambda_v + lambda_l).max(1e-12);

    let f0 = specular_reflectance(material);
    let grazing = 1.0 - v_dot_h;
    let grazing_sq = grazing * grazing;
    let fresnel = f0 + (Vec3::ONE - f0) * (grazing_sq * grazing_sq * grazing);
    let diffuse = material.base_color * ((1.0 - material.metallic) / PI);
    (Vec3::ONE - fresnel) * diffuse + fresnel * (distribution * visibility)
}

/// The specular reflectance at normal incidence.
pub fn specular_reflectance(material: &Material) -> Vec3 {
    Vec3::splat(DIELECTRIC_F0).lerp(material.base_color, material.metallic)
}

/// How the surface reflects toward the viewer, for the choice of lights.
pub fn gloss(material: &Material, view: Vec3) -> Gloss {
    Gloss {
        view,
        roughness: material.roughness,
        specular: luminance(specular_reflectance(material)),
        diffuse: luminance(material.base_color) * (1.0 - material.metallic),
    }
}

/// The distance of the origin of shadow rays from the surface. It exceeds the rounding of a hit at
/// `position` that is `distance` along a ray.
pub fn shadow_offset(position: Vec3, distance: f32) -> f32 {
    position.abs().max_element().max(distance).max(1.0) * 2e-5
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common::lattice::{Dimension, random};

    #[test]
    fn a_white_dielectric_reflects_at_most_what_it_receives_except_at_grazing_angles() {
        for roughness in [0.35f32, 0.6, 1.0] {
            for view_angle in [0.1f32, 0.5, 0.9] {
                let material = Material { base_color: Vec3::ONE, roughness, ..Default::default() };
                let view = Vec3::new(view_angle.sin(), view_angle.cos(), 0.0);
                let mut sum = 0.0;
                let count = 20_000;
                for i in 0..count {
                    let [x, y, ..] = random(7, i, 1, Dimension::Light);
                    let (y_dir, phi) = (x.max(1e-6), y * 2.0 * PI);
                    let ring = (1.0 - y_dir * y_dir).sqrt();
                    let light = Vec3::new(ring * phi.cos(), y_dir, ring * phi.sin());
                    sum += brdf(&material, Vec3::Y, view, light).x * y_dir * 2.0 * PI;
                }
                assert!(
                    sum / (count as f32) < 1.06,
                    "roughness {roughness}, view {view_angle}: {}",
                    sum / count as f32
                );
            }
        }
    }

    #[test]
    fn haze_hides_what_is_far_and_clear_air_nothing() {
        let horizon = Vec3::new(0.2, 0.14, 0.17);
        let sky = |haze| Sky { horizon, haze, ..Sky::default() };
        let radiance = Vec3::new(3.0, 0.1, 1.0);
        assert_eq!(through_haze(&sky(0.0), radiance, 1e8), radiance);
        let half = through_haze(&sky(1e-3), radiance, 1e3 * std::f32::consts::LN_2);
        assert!(half.abs_diff_eq(0.5 * (radiance + horizon), 1e-5), "{half}");
        assert!(through_haze(&sky(1e-3), radiance, 1e5).abs_diff_eq(horizon, 1e-6));
    }
}
