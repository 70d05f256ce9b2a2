//! Random numbers, camera rays, sky and BRDF. `render.wgsl` has the same functions;
//! `tests/all/city_images.rs` compares the pictures of both.
//!
//! The hash is pcg4d of Jarzynski and Olano, "Hash Functions for GPU Rendering" (JCGT 2020). It
//! shifts Roberts' R sequences (2018): each sample is uniform, and the samples of a pixel are
//! evenly distributed, which lowers the noise without bias.

use super::scene::{Camera, Material, Sky};
use girandole::glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// What random numbers are used for. Those of different dimensions are independent.
#[derive(Clone, Copy, Debug)]
#[repr(u32)]
pub enum Dimension {
    /// The choice of a light (x, y) and of a point on it (z, w).
    Light = 0,
    /// The position within the pixel (x, y), and whether the chosen light is counted (z).
    Pixel = 1,
}

/// Fractional parts of the powers of 1/phi_4 times 2^32, where phi_d is the root of x^(d+1) = x +
/// 1.
const R4: [u32; 4] = [0xdb4f_0b91, 0xbbe0_5633, 0xa0f2_ec76, 0x89e1_8285];
/// The same for phi_2, twice.
const R2: [u32; 4] = [0xc13f_a9a9, 0x91e1_0da6, 0xc13f_a9a9, 0x91e1_0da6];

/// Reflectance of dielectrics at normal incidence.
const DIELECTRIC_F0: f32 = 0.04;
/// With a smaller GGX alpha, highlights are too narrow for f32.
const MIN_ALPHA: f32 = 1e-3;

/// A hash of four numbers.
pub fn pcg4d(mut v: [u32; 4]) -> [u32; 4] {
    for x in &mut v {
        *x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    }
    let mix = |v: &mut [u32; 4]| {
        v[0] = v[0].wrapping_add(v[1].wrapping_mul(v[3]));
        v[1] = v[1].wrapping_add(v[2].wrapping_mul(v[0]));
        v[2] = v[2].wrapping_add(v[0].wrapping_mul(v[1]));
        v[3] = v[3].wrapping_add(v[1].wrapping_mul(v[2]));
    };
    mix(&mut v);
    for x in &mut v {
        *x ^= *x >> 16;
    }
    mix(&mut v);
    v
}

/// Four random numbers in [0, 1), which depend on the arguments only.
pub fn random(pixel: u32, sample: u32, seed: u32, dimension: Dimension) -> [f32; 4] {
    let shift = pcg4d([pixel, seed, dimension as u32, 0x9e37_79b9]);
    let steps = if matches!(dimension, Dimension::Light) { R4 } else { R2 };
    // 24 bits are exact in a float, so that the result is below 1.
    std::array::from_fn(|i| (shift[i].wrapping_add(sample.wrapping_mul(steps[i])) >> 8) as f32 * (1.0 / 16_777_216.0))
}

/// The seed of a frame, from the seed of the run.
pub fn frame_seed(seed: u64, frame: u32) -> u32 {
    pcg4d([seed as u32, (seed >> 32) as u32, frame, 0x51ed_270b])[3]
}

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
        let right = forward.cross(Vec3::Y).try_normalize().unwrap_or(Vec3::X);
        let half_height = (camera.vertical_fov * 0.5).tan();
        let half_width = half_height * width as f32 / height as f32;
        Self { eye: camera.eye, right: right * half_width, up: right.cross(forward) * half_height, forward }
    }

    /// The unit direction through a position in the picture, in pixels from its upper left corner.
    pub fn direction(&self, position: Vec2, size: Vec2) -> Vec3 {
        let across = position / size * 2.0 - Vec2::ONE;
        (self.forward + self.right * across.x - self.up * across.y).normalize()
    }
}

/// Radiance of the sky in a direction. Below the horizon it is that of the horizon.
pub fn sky_radiance(sky: &Sky, direction: Vec3) -> Vec3 {
    sky.horizon.lerp(sky.zenith, direction.y.max(0.0).sqrt())
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

/// The distance of the origin of shadow rays from the surface. It exceeds the rounding of a hit at
/// `position` that is `distance` along a ray.
pub fn shadow_offset(position: Vec3, distance: f32) -> f32 {
    position.abs().max_element().max(distance).max(1.0) * 2e-5
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn random_numbers_are_below_one_and_uniform_in_the_mean() {
        let mut mean = [0.0f64; 4];
        for pixel in 0..1000 {
            for sample in 0..16 {
                let u = random(pixel, sample, 3, Dimension::Light);
                for (m, x) in mean.iter_mut().zip(u) {
                    assert!((0.0..1.0).contains(&x));
                    *m += f64::from(x) / 16_000.0;
                }
            }
        }
        for m in mean {
            // 1000 independent shifts: the mean's deviation is at most sqrt(1/12/1000) = 0.009.
            assert!((m - 0.5).abs() < 0.04, "{mean:?}");
        }
    }
}
