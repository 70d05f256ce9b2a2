//! What the camera sees. The surfaces behind each pixel are found once, so that pictures spend
//! their time on lights only.

use crate::render::geometry::Geometry;
use crate::render::rays::Hit;
use crate::render::shading::{View as Frame, shadow_offset, sky_radiance};
use crate::scene::Scene;
use girandole::ShadingPoint;
use girandole::glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Subpixels along each side of a pixel.
const GRID: usize = 2;
/// Subpixels of a pixel.
pub const SUBPIXELS: usize = GRID * GRID;

/// A surface behind a subpixel.
#[derive(Clone, Copy)]
pub struct Surface {
    pub shading_point: ShadingPoint,
    /// Unit vector towards the camera.
    pub toward_eye: Vec3,
    /// Index into the scene's materials.
    pub material: u32,
}

/// A pixel.
#[derive(Clone, Copy)]
pub struct Pixel {
    /// What each subpixel shows; `None` for the sky.
    pub surfaces: [Option<Surface>; SUBPIXELS],
    /// The mean radiance of the subpixels without the light of lamps: the sky, the surfaces' own
    /// emission, and ambient light.
    pub background: Vec3,
}

/// All pixels of a picture, row by row from the top.
pub struct View {
    /// Pixels of a row.
    pub width: usize,
    pub pixels: Vec<Pixel>,
}

impl View {
    /// Traces one camera ray per subpixel through the middle of the subpixel.
    pub fn new(scene: &Scene, geometry: &Geometry, (width, height): (u32, u32)) -> Self {
        let frame = Frame::new(&scene.camera, width, height);
        let size = Vec2::new(width as f32, height as f32);
        let pixel = |index: u32| {
            let corner = Vec2::new((index % width) as f32, (index / width) as f32);
            let mut pixel = Pixel { surfaces: [None; SUBPIXELS], background: Vec3::ZERO };
            for (i, surface) in pixel.surfaces.iter_mut().enumerate() {
                let offset = (Vec2::new((i % GRID) as f32, (i / GRID) as f32) + 0.5) / GRID as f32;
                let direction = frame.direction(corner + offset, size);
                let (found, radiance) = trace(scene, geometry, frame.eye, direction);
                *surface = found;
                pixel.background += radiance / SUBPIXELS as f32;
            }
            pixel
        };
        Self { width: width as usize, pixels: (0..width * height).into_par_iter().map(pixel).collect() }
    }
}

/// The surface that a ray meets, and the radiance along the ray without the light of lamps.
fn trace(scene: &Scene, geometry: &Geometry, eye: Vec3, direction: Vec3) -> (Option<Surface>, Vec3) {
    let Some(hit) = geometry.nearest(eye, direction) else {
        return (None, sky_radiance(&scene.sky, direction));
    };
    let (surface, is_front) = surface_at(geometry, eye, direction, &hit);
    let material = &scene.materials[surface.material as usize];
    let mut radiance = scene.sky.ambient * material.base_color;
    if is_front || material.two_sided_emission {
        radiance += material.emission * geometry.objects[hit.object as usize].emission_scale;
    }
    (Some(surface), radiance)
}

/// The surface that a ray from `eye` meets first; `None` for the sky. `direction` is a unit vector.
pub fn first_surface(geometry: &Geometry, eye: Vec3, direction: Vec3) -> Option<Surface> {
    geometry.nearest(eye, direction).map(|hit| surface_at(geometry, eye, direction, &hit).0)
}

/// The surface at a hit, with the normal on the side of the eye, and whether that is the front.
fn surface_at(geometry: &Geometry, eye: Vec3, direction: Vec3, hit: &Hit) -> (Surface, bool) {
    let front = geometry.normal(hit);
    let is_front = front.dot(direction) <= 0.0;
    let normal = if is_front { front } else { -front };
    let position = eye + direction * hit.distance;
    let position = position + normal * shadow_offset(position, hit.distance);
    let material = geometry.triangles[hit.triangle as usize].material;
    (Surface { shading_point: ShadingPoint::surface(position, normal), toward_eye: -direction, material }, is_front)
}
