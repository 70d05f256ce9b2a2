//! What a camera sees: one shading point per pixel.

use girandole::glam::Vec2;
use rayon::prelude::*;
use testbed::common::batch::SampleRequest;
use testbed::common::lattice::{Dimension, random};
use testbed::render::geometry::Geometry;
use testbed::render::shading::{View, shadow_offset};
use testbed::scene::{Scene, SceneError};

/// Pixels along a side of a tile. The 64 invocations of a workgroup of `sample.wgsl` work on one
/// tile, as in renderers.
pub const TILE: u32 = 8;
/// Seeds the random numbers.
const SEED: u32 = 7;

/// Finds the surface behind each pixel, tile by tile; width and height are multiples of [`TILE`].
/// Pixels of the sky repeat the surface of the pixel before them, so that every pixel is a sample.
pub fn requests(scene: &Scene, (width, height): (u32, u32)) -> Result<Vec<SampleRequest>, SceneError> {
    let geometry = Geometry::new(scene)?;
    let view = View::new(&scene.camera, width, height);
    let size = Vec2::new(width as f32, height as f32);
    let mut requests: Vec<Option<SampleRequest>> = (0..width * height)
        .into_par_iter()
        .map(|index| {
            let (tile, inside) = (index / (TILE * TILE), index % (TILE * TILE));
            let x = tile % (width / TILE) * TILE + inside % TILE;
            let y = tile / (width / TILE) * TILE + inside / TILE;
            let middle = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            let direction = view.direction(middle, size);
            let hit = geometry.nearest(view.eye, direction)?;
            let front = geometry.normal(&hit);
            let normal = if front.dot(direction) <= 0.0 { front } else { -front };
            let surface = view.eye + direction * hit.distance;
            let position = surface + normal * shadow_offset(surface, hit.distance);
            let u = random(index, 0, SEED, Dimension::Light);
            let (position, normal) = (position.into(), normal.into());
            Some(SampleRequest { position, normal, u, ..Default::default() })
        })
        .collect();
    let mut last = requests.iter().flatten().next().copied();
    requests.iter_mut().for_each(|request| match request {
        Some(request) => last = Some(*request),
        None => *request = last,
    });
    requests.into_iter().collect::<Option<_>>().ok_or_else(|| SceneError("the camera sees only the sky".into()))
}
