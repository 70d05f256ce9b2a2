//! Lights that pixels keep from frame to frame and share with neighbours: the pass of docs/reuse.md, on the CPU.
//!
//! `gpu/reuse.wgsl` is its twin. Shadow rays of the last frame meet the scene of the present one, so light that comes
//! out of a shadow fades in. A surface that moves finds the pixel that showed the same place.

use super::scene::Material;
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

/// A frame as its pixels have kept it.
pub struct LastFrame {
    size: (u32, u32),
    view: View,
    lights: LightSnapshot,
    /// Row by row from the top; `None` for what reflects no light.
    pixels: Vec<Option<Kept>>,
}

impl LastFrame {
    /// Keeps a frame of this width.
    pub fn new(width: u32, view: View, world: &LightWorld, pixels: Vec<Option<Kept>>) -> Self {
        let size = (width, pixels.len() as u32 / width);
        Self { size, view, lights: world.snapshot(), pixels }
    }

    /// The lights as they were.
    pub fn lights(&self) -> &LightSnapshot {
        &self.lights
    }

    /// Whether the next frame has the same size.
    pub fn has_size(&self, width: u32, height: u32) -> bool {
        self.size == (width, height)
    }

    /// What the `n`-th pixel of [`MERGES`] has kept, if it shows a surface that may share lights with one at `pixel`. The
    /// last number chooses between both lights.
    pub fn merged(&self, pixel: u32, surface: &Surface, n: u32, seed: u32) -> Option<(&Kept, f32)> {
        let [x, y, choice, _] = pcg4d([pixel, seed, n, 0x9e37_79b9]).map(|bits| (bits >> 8) as f32 / 16_777_216.0);
        let size = Vec2::new(self.size.0 as f32, self.size.1 as f32);
        let toward = surface.shading_point.position - self.view.eye;
        let depth = toward.dot(self.view.forward);
        let across = |axis: Vec3| toward.dot(axis) / (axis.length_squared() * depth);
        let place = ((Vec2::new(across(self.view.right), -across(self.view.up)) + 1.0) * 0.5 * size).floor().as_ivec2();
        let offset = if n == 0 { Vec2::ZERO } else { ((Vec2::new(x, y) * 2.0 - 1.0) * REACH).round() };
        let place = place + offset.as_ivec2();
        let (width, height) = (self.size.0 as i32, self.size.1 as i32);
        if depth <= 0.0 || place.cmplt(IVec2::ZERO).any() || place.x >= width || place.y >= height {
            return None;
        }
        let kept = self.pixels[(place.y * width + place.x) as usize].as_ref()?;
        are_alike(&surface.shading_point, &kept.surface.shading_point, depth).then_some((kept, choice))
    }
}

/// Normals within 25 degrees, and planes within 2 % of the depth.
fn are_alike(one: &ShadingPoint, other: &ShadingPoint, depth: f32) -> bool {
    let apart = other.position - one.position;
    let distance = one.normal.dot(apart).abs().max(other.normal.dot(apart).abs());
    one.normal.dot(other.normal) > 0.9 && distance < 0.02 * depth && apart.length() < 0.1 * depth
}
