//! What the camera sees. The surfaces behind each pixel are found once, so that pictures spend
//! their time on lights only.

use crate::render::geometry::Geometry;
use crate::render::rays::Hit;
use crate::render::shading::{View as Frame, shadow_offset, sky_radiance};
use crate::scene::{Camera, Scene};
use girandole::ShadingPoint;
use girandole::glam::{IVec2, Vec2, Vec3};
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
    /// Index into the scene's objects.
    pub object: u32,
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

/// A square of a picture.
#[derive(Clone, Copy, Debug)]
pub struct Square {
    /// The size of the picture, in pixels.
    pub picture: (u32, u32),
    /// Its upper left pixel.
    pub corner: (u32, u32),
    pub edge: u32,
}

impl Square {
    /// What the middle of each pixel shows, without background.
    pub fn view(&self, scene: &Scene, geometry: &Geometry) -> View {
        let (frame, size) = self.frame(&scene.camera);
        let pixel = |index: u32| {
            let place =
                Vec2::new((self.corner.0 + index % self.edge) as f32, (self.corner.1 + index / self.edge) as f32);
            let surface = first_surface(geometry, frame.eye, frame.direction(place + 0.5, size));
            Pixel { surfaces: [surface; SUBPIXELS], background: Vec3::ZERO }
        };
        View { width: self.edge as usize, pixels: (0..self.edge * self.edge).into_par_iter().map(pixel).collect() }
    }

    /// The pixel of the square that shows a position, if nothing is in the way. It may lie outside.
    pub fn pixel(&self, camera: &Camera, position: Vec3) -> Option<IVec2> {
        let (frame, size) = self.frame(camera);
        let (place, _) = frame.place(position - frame.eye, size)?;
        Some(place.floor().as_ivec2() - IVec2::new(self.corner.0 as i32, self.corner.1 as i32))
    }

    fn frame(&self, camera: &Camera) -> (Frame, Vec2) {
        let (width, height) = self.picture;
        (Frame::new(camera, width, height), Vec2::new(width as f32, height as f32))
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
    let shading_point = ShadingPoint::surface(position, normal);
    (Surface { shading_point, toward_eye: -direction, material, object: hit.object }, is_front)
}
