//! Lights that pixels keep from frame to frame and share with neighbours: the pass of docs/reuse.md, on the CPU.
//!
//! `gpu/reuse.wgsl` is its twin. A surface that moves finds the pixel that showed the same place.

use super::geometry::Geometry;
use super::scene::{Material, Scene, SceneError};
use super::shading::View;
use crate::common::hash::pcg4d;
use girandole::glam::{IVec2, Vec2, Vec3};
use girandole::{LightSnapshot, LightWorld, Reservoir, ShadingPoint};

/// How far away a neighbour is, in pixels along each axis, at most.
const REACH: f32 = 3.0;
/// The reservoirs of the last frame that a pixel merges: of its place, and of a neighbour.
pub const MERGES: u32 = 2;

/// A point that a camera ray met.
#[derive(Clone, Copy)]
pub struct Surface {
    pub material: Material,
    pub shading_point: ShadingPoint,
    /// The unit direction to the camera.
    pub view: Vec3,
}

/// What a pixel keeps.
#[derive(Clone, Copy)]
pub struct Kept {
    pub surface: Surface,
    pub reservoir: Reservoir,
}

/// What is left of the frame before.
pub struct History {
    geometry: Geometry,
    last: Option<LastFrame>,
}

/// A frame as its pixels have kept it.
struct LastFrame {
    size: (u32, u32),
    view: View,
    lights: LightSnapshot,
    /// Row by row from the top; `None` for what reflects no light.
    pixels: Vec<Option<Kept>>,
}

impl History {
    /// Nothing is kept yet.
    pub fn new(scene: &Scene) -> Result<Self, SceneError> {
        Ok(Self { geometry: Geometry::new(scene)?, last: None })
    }

    /// Takes over where things are, before they move to the next frame.
    pub fn follow(&mut self, scene: &Scene) -> Result<(), SceneError> {
        self.geometry.update(scene).map(drop)
    }

    /// Keeps a frame of this width.
    pub fn keep(&mut self, width: u32, view: View, world: &LightWorld, pixels: Vec<Option<Kept>>) {
        let size = (width, pixels.len() as u32 / width);
        self.last = Some(LastFrame { size, view, lights: world.snapshot(), pixels });
    }

    /// Forgets what pixels have kept.
    pub fn forget(&mut self) {
        self.last = None;
    }

    /// The frame before, if it has the same size.
    pub fn before(&self, width: u32, height: u32) -> Option<Before<'_>> {
        let last = self.last.as_ref().filter(|last| last.size == (width, height))?;
        Some(Before { geometry: &self.geometry, last })
    }
}

/// The frame before.
#[derive(Clone, Copy)]
pub struct Before<'a> {
    /// Where things were.
    pub geometry: &'a Geometry,
    last: &'a LastFrame,
}

impl<'a> Before<'a> {
    /// The lights as they were.
    pub fn lights(self) -> &'a LightSnapshot {
        &self.last.lights
    }

    /// What the `n`-th pixel of [`MERGES`] has kept, if it shows a surface that may share lights with one at `pixel`. The
    /// last number chooses between both lights.
    pub fn merged(self, pixel: u32, surface: &Surface, n: u32, seed: u32) -> Option<(&'a Kept, f32)> {
        let LastFrame { size: (width, height), view, pixels, .. } = self.last;
        let [x, y, choice, _] = pcg4d([pixel, seed, n, 0x9e37_79b9]).map(|bits| (bits >> 8) as f32 / 16_777_216.0);
        let size = Vec2::new(*width as f32, *height as f32);
        let (place, depth) = view.place(surface.shading_point.position - view.eye, size)?;
        let place = place.floor().as_ivec2();
        let offset = if n == 0 { Vec2::ZERO } else { ((Vec2::new(x, y) * 2.0 - 1.0) * REACH).round() };
        let place = place + offset.as_ivec2();
        let (width, height) = (*width as i32, *height as i32);
        if place.cmplt(IVec2::ZERO).any() || place.x >= width || place.y >= height {
            return None;
        }
        let kept = pixels[(place.y * width + place.x) as usize].as_ref()?;
        are_alike(&surface.shading_point, &kept.surface.shading_point, depth).then_some((kept, choice))
    }
}

/// Normals within 25 degrees, and planes within 2 % of the depth.
fn are_alike(one: &ShadingPoint, other: &ShadingPoint, depth: f32) -> bool {
    let apart = other.position - one.position;
    let distance = one.normal.dot(apart).abs().max(other.normal.dot(apart).abs());
    one.normal.dot(other.normal) > 0.9 && distance < 0.02 * depth && apart.length() < 0.1 * depth
}
