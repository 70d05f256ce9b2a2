//! Parts: triangles and the lights of their emissive faces, built together so that they match.

use std::f32::consts::TAU;

use girandole::Light;
use girandole::glam::{Affine3A, Vec3, vec3};

use super::palette::Glow;
use super::{Mesh, Triangle};

/// A mesh under construction and its lights, in the same space.
#[derive(Clone, Debug, Default)]
pub struct Part {
    /// All faces, emissive or not.
    pub mesh: Mesh,
    /// One light for each emissive rectangle or ball.
    pub lights: Vec<Light>,
}

impl Part {
    /// One triangle, counter-clockwise from the front.
    pub fn triangle(&mut self, vertices: [Vec3; 3], material: u32) {
        self.mesh.triangles.push(Triangle { vertices, material });
    }

    /// A flat quadrilateral, counter-clockwise from the front.
    pub fn quad(&mut self, [a, b, c, d]: [Vec3; 4], material: u32) {
        self.triangle([a, b, c], material);
        self.triangle([a, c, d], material);
    }

    /// A horizontal rectangle that faces up.
    pub fn floor(&mut self, min: [f32; 2], max: [f32; 2], y: f32, material: u32) {
        let at = |x: f32, z: f32| vec3(x, y, z);
        self.quad([at(min[0], max[1]), at(max[0], max[1]), at(max[0], min[1]), at(min[0], min[1])], material);
    }

    /// An emissive parallelogram and its rectangle light; the front is the side of `half_u` x
    /// `half_v`.
    pub fn glow(&mut self, center: Vec3, half_u: Vec3, half_v: Vec3, glow: Glow) {
        let corners = [-half_u - half_v, half_u - half_v, half_u + half_v, half_v - half_u];
        self.quad(corners.map(|corner| center + corner), glow.material);
        self.lights.push(Light::rectangle(center, half_u, half_v, glow.radiance));
    }

    /// The six faces of an axis-aligned box.
    pub fn cuboid(&mut self, min: Vec3, max: Vec3, material: u32) {
        let (center, half) = ((min + max) * 0.5, (max - min) * 0.5);
        self.oriented_box(center, vec3(half.x, 0.0, 0.0), vec3(0.0, half.y, 0.0), vec3(0.0, 0.0, half.z), material);
    }

    /// A box with the given centre and half axes, which must be right-handed.
    pub fn oriented_box(&mut self, center: Vec3, u: Vec3, v: Vec3, w: Vec3, material: u32) {
        for (u, v, w) in [(u, v, w), (v, w, u), (w, u, v), (v, u, -w), (w, v, -u), (u, w, -v)] {
            self.quad([w - u - v, w + u - v, w + u + v, w - u + v].map(|corner| center + corner), material);
        }
    }

    /// A box of square section around the line from `from` to `to`.
    pub fn beam(&mut self, from: Vec3, to: Vec3, half_width: f32, material: u32) {
        let half = (to - from) * 0.5;
        let (u, v) = half.normalize_or(Vec3::Y).any_orthonormal_pair();
        self.oriented_box((from + to) * 0.5, u * half_width, v * half_width, half, material);
    }

    /// An upright frustum of a cone, closed on top. `radius` is that of the bottom and the top.
    pub fn column(&mut self, base: Vec3, height: f32, radius: [f32; 2], sides: usize, material: u32) {
        let rim = |side: usize, level: usize| {
            let (sin, cos) = (side as f32 / sides as f32 * TAU).sin_cos();
            base + vec3(cos * radius[level], height * level as f32, -sin * radius[level])
        };
        let top = base + Vec3::Y * height;
        for side in 0..sides {
            self.quad([rim(side, 0), rim(side + 1, 0), rim(side + 1, 1), rim(side, 1)], material);
            self.triangle([rim(side, 1), rim(side + 1, 1), top], material);
        }
    }

    /// A polyhedron inscribed in an ellipsoid, so that it never occludes the sphere light of the
    /// same radius.
    pub fn ball(&mut self, center: Vec3, radius: Vec3, sides: usize, material: u32) {
        let rings = sides / 2;
        let at = |ring: usize, side: usize| {
            let (sin_y, cos_y) = (ring as f32 / rings as f32 * TAU * 0.5).sin_cos();
            let (sin, cos) = (side as f32 / sides as f32 * TAU).sin_cos();
            center + vec3(sin_y * cos, cos_y, -sin_y * sin) * radius
        };
        for ring in 0..rings {
            for side in 0..sides {
                let [a, b] = [at(ring, side), at(ring, side + 1)];
                let [c, d] = [at(ring + 1, side + 1), at(ring + 1, side)];
                if ring > 0 {
                    self.triangle([a, c, b], material);
                }
                if ring + 1 < rings {
                    self.triangle([a, d, c], material);
                }
            }
        }
    }

    /// An emissive ball and its sphere light.
    pub fn bulb(&mut self, center: Vec3, radius: f32, sides: usize, glow: Glow) {
        self.ball(center, Vec3::splat(radius), sides, glow.material);
        self.lights.push(Light::sphere(center, radius, glow.radiance));
    }

    /// Adds the transformed triangles of a part that has no lights.
    pub fn add_moved(&mut self, other: &Part, transform: Affine3A) {
        let moved = other.mesh.triangles.iter().map(|triangle| Triangle {
            vertices: triangle.vertices.map(|vertex| transform.transform_point3(vertex)),
            material: triangle.material,
        });
        self.mesh.triangles.extend(moved);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn volume(part: &Part) -> f32 {
        let signed = |t: &Triangle| t.vertices[0].dot(t.vertices[1].cross(t.vertices[2])) / 6.0;
        part.mesh.triangles.iter().map(signed).sum()
    }

    #[test]
    fn closed_parts_face_outward_and_have_the_right_volume() {
        let mut cuboid = Part::default();
        cuboid.cuboid(vec3(1.0, 2.0, 3.0), vec3(2.0, 4.0, 6.0), 0);
        assert!((volume(&cuboid) - 6.0).abs() < 1e-4);
        let mut ball = Part::default();
        ball.ball(vec3(3.0, 1.0, 0.0), Vec3::ONE, 16, 0);
        assert!((volume(&ball) - TAU * 2.0 / 3.0).abs() < 0.4, "{}", volume(&ball));
        let mut beam = Part::default();
        beam.beam(Vec3::ZERO, vec3(1.0, 2.0, 2.0), 0.5, 0);
        assert!((volume(&beam) - 3.0).abs() < 1e-4);
    }
}
