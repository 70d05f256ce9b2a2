//! Stochastic lightcuts with a cut for each block of pixels.
//!
//! Source: Lin and Yuksel, Real-Time Stochastic Lightcuts (I3D 2020): blocks of 8 x 8 pixels share a cut,
//! which is made for a random pixel of the block, and each pixel takes one sample from every node of the
//! cut. Here, these are the samples of [`CUT`] frames, for which the cut stays.

use super::candidates::{LightList, Random};
use crate::direct_light::draw::{Draw, Drawn, Frame, Sample};
use crate::direct_light::view::{Surface, View};
use crate::measuring::baselines::lightcuts::{CUT, LightcutTree};
use crate::measuring::samplers::wide;
use crate::scene::Material;
use rayon::prelude::*;

/// Pixels along each side of a block.
const BLOCK: u32 = 8;

/// Draws from the nodes of cuts in turn.
pub struct SharedCuts<'a> {
    lights: LightList<'a>,
    tree: LightcutTree,
    view: &'a View,
    /// A cut for each block, row by row.
    cuts: Vec<Vec<u32>>,
    /// Seeds the order of the nodes.
    seed: u32,
}

impl<'a> SharedCuts<'a> {
    pub fn new(lights: LightList<'a>, view: &'a View) -> Self {
        let tree = LightcutTree::new(lights.lights);
        let [columns, rows] = size(view).map(|pixels| pixels.div_ceil(BLOCK));
        Self { lights, tree, view, cuts: vec![Vec::new(); (columns * rows) as usize], seed: 0 }
    }
}

/// The pixels of a row and of a column.
fn size(view: &View) -> [u32; 2] {
    [view.width as u32, (view.pixels.len() / view.width) as u32]
}

impl Draw for SharedCuts<'_> {
    fn prepare(&mut self, frame: &Frame<'_>) {
        if !frame.number.is_multiple_of(CUT as u32) {
            return;
        }
        self.seed = frame.seed;
        let Self { tree, view, cuts, .. } = self;
        let [width, height] = size(view);
        let columns = width.div_ceil(BLOCK);
        cuts.par_iter_mut().enumerate().for_each(|(index, cut)| {
            let mut random = Random::new(&[frame.seed, frame.number, index as u32]);
            let corner = [index as u32 % columns * BLOCK, index as u32 / columns * BLOCK];
            let (wide, high) = (BLOCK.min(width - corner[0]), BLOCK.min(height - corner[1]));
            let (count, first) = ((wide * high) as usize, random.below((wide * high) as usize));
            // The first pixel from a random one on that shows a surface.
            let surface = (0..count).find_map(|step| {
                let place = ((first + step) % count) as u32;
                let pixel = (corner[1] + place / wide) * width + corner[0] + place % wide;
                view.pixels[pixel as usize].surfaces.iter().flatten().next()
            });
            if let Some(surface) = surface {
                tree.cut(&surface.shading_point, cut);
            }
        });
    }

    fn draw(&self, surface: &Surface, _: &Material, sample: &Sample) -> Option<Drawn> {
        let [width, _] = size(self.view);
        let [x, y] = [sample.pixel % width, sample.pixel / width];
        let cut = &self.cuts[(y / BLOCK * width.div_ceil(BLOCK) + x / BLOCK) as usize];
        // Each pixel starts with a random node.
        let first = Random::new(&[self.seed, sample.pixel, sample.frame / CUT as u32]).below(cut.len());
        let node = *cut.get((first + sample.frame as usize) % cut.len().max(1))?;
        let [a, b, x, y, _] = sample.u;
        let (light, pmf) = self.tree.pick(node, &surface.shading_point, wide([a, b]))?;
        let (id, numbers) = (self.lights.ids[light as usize], [x, y]);
        let incident = self.lights.sampler.sample_light(&surface.shading_point, id, numbers)?;
        Some(Drawn { incident, weight: cut.len() as f32 / (incident.pdf * pmf), light, id, numbers })
    }

    fn samples_per_preparation(&self, pixels: f64) -> f64 {
        pixels * CUT as f64
    }

    fn prepared_bytes(&self) -> usize {
        self.tree.bytes() + self.cuts.len() * CUT * size_of::<u32>()
    }
}
