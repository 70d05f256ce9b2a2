//! How a node of the partition divides space among its children.

use glam::DVec3;

use super::super::stages::Stage;
use crate::instance::sector::{self, EDGE};
use crate::tree::{Planes, WIDTH};

/// A child that is not in use.
pub(super) const NO_CHILD: u32 = u32::MAX;

/// A part is far from the others once it lies farther from the middle of their box than this many times half of the
/// box.
const FAR: f64 = 2.0;

/// The same along an axis along which the box is short, relative to its longest edge.
const FAR_ASIDE: f64 = 0.5;

/// A part is set apart only if it is so many times farther, because that takes a level of nodes: after twenty seconds of
/// traffic to all sides of a city, each part that is far away by the measure above would have cost a level, and 1.3 times
/// the noise.
const FARTHER: f64 = 4.0;

/// See the module.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Divided {
    pub planes: Planes,
    /// The first of them are in use, one more than there are planes.
    pub children: [u32; WIDTH],
    /// The parts of each child when the planes were made.
    pub built: [u32; WIDTH],
    /// For each plane across an axis the sector from whose centre it is measured.
    pub sectors: [i32; WIDTH - 1],
    /// Where each plane is in the world, in metres.
    pub exact: [f64; WIDTH - 1],
    /// The middle of the parts' positions in the world when it was divided.
    pub center: DVec3,
    /// Half of their box.
    pub half: DVec3,
    /// When the GPU packs the node.
    pub stage: Stage,
}

impl Divided {
    /// Planes whose places are not set yet, for parts in a box: its middle and half of it.
    pub fn new(planes: Planes, (center, half): (DVec3, DVec3)) -> Self {
        Self {
            planes,
            children: [NO_CHILD; WIDTH],
            built: [0; WIDTH],
            sectors: [0; WIDTH - 1],
            exact: [0.0; WIDTH - 1],
            center,
            half,
            stage: Stage::default(),
        }
    }

    /// The children that are in use.
    pub fn children(&self) -> &[u32] {
        &self.children[..=self.planes.count]
    }

    /// The child in which a position relative to the origin lies. Twin of a part of `keys_cell` in `shaders/top_keys.wgsl`.
    pub fn child(&self, position: [f32; 3], home: [i32; 3], identity: u32) -> u32 {
        let is_below = |plane: usize| {
            let axis = self.planes.axes[plane] as usize;
            let Some(coordinate) = position.get(axis) else { return identity < self.planes.at[plane] };
            *coordinate < f32::from_bits(self.planes.at[plane]) + (self.sectors[plane] - home[axis]) as f32 * EDGE
        };
        self.children[self.planes.child(is_below)]
    }

    /// Measures the planes from the centres of sectors.
    pub fn measure(&mut self) {
        for plane in 0..self.planes.count {
            let axis = self.planes.axes[plane] as usize;
            if axis < 3 {
                let center = sector::nearest(DVec3::splat(self.exact[plane])).x;
                self.sectors[plane] = (center / f64::from(EDGE)) as i32;
                self.planes.at[plane] = ((self.exact[plane] - center) as f32).to_bits();
            }
        }
    }

    /// Whether a place is far from all that the node was divided for, in a large node far enough to be set apart.
    /// `rounding` is the error of the place.
    pub fn is_far(&self, place: DVec3, rounding: f64, is_large: bool) -> bool {
        let reach = (FAR * self.half).max(DVec3::splat(FAR_ASIDE * self.half.max_element()));
        let times = if is_large { FARTHER } else { 1.0 };
        (place - self.center).abs().cmpgt(times * reach + rounding).any()
    }
}
