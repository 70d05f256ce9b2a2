//! Next event estimation that adapts over time: lights that recent frames have used near a pixel, beside
//! lights that all pixels have used and lights by flux.
//!
//! Source: the published shaders of NVIDIA's RTX Path Tracing 1.5 to 1.7 (NEE-AT). A sample resamples
//! five candidates by the BRDF: three from the list of its tile and two from the global list, weighed
//! together by the balance heuristic. Each pixel keeps the light whose visible contribution it has found,
//! in proportion to that. A tile's list of 128 holds the lights of the pixels in its window, those of a
//! coarser grid around it and some of the tile's last list, so a light that many pixels use is in it many
//! times. Three quarters of the global list are the lights that pixels have kept. Tiles are shifted in
//! every frame.
//!
//! Differs: nothing moves, so nothing is reprojected; probabilities of one sample of each kind have their
//! exact values; pixels keep what they found with a decay, which the source has as an option.

use super::candidates::{Candidate, LightList, Random, Reservoir};
use super::proxies::Proxies;
use crate::direct_light::draw::{Draw, Drawn, Found, Frame, Sample};
use crate::direct_light::view::{Surface, View};
use crate::scene::Material;
use rayon::prelude::*;

/// Candidates from the list of the tile, and from the global list.
const CANDIDATES: [u32; 2] = [3, 2];
/// Pixels along each side of a tile, and of the window whose lights its list holds.
const TILE: u32 = 8;
const WINDOW: u32 = 10;
/// Pixels along each side of a block of the coarse grid, and blocks along each side of its window.
const BLOCK: u32 = 4;
const BLOCK_WINDOW: u32 = 4;
/// Entries from the tile's last list.
const HISTORIC: u32 = 12;
/// The entries of a list.
const LIST: usize = (WINDOW * WINDOW + BLOCK_WINDOW * BLOCK_WINDOW + HISTORIC) as usize;
/// The share of the global list that is lights which pixels have kept.
const GLOBAL_FEEDBACK: f64 = 0.75;
/// What a pixel has found counts less by this factor in each frame.
const DECAY: f32 = 0.9;
/// What a pixel has found is divided by this power of the light's global probability, so that lights
/// which the global list rarely has are kept more often.
const RARE: f32 = 0.65;
/// The frames in which the lists fill before a picture begins.
const WARM_UP: u32 = 16;

/// The light that a pixel has kept, and the sum of the weights that it was kept from; 0 for none.
#[derive(Clone, Copy, Default)]
struct Kept {
    light: u32,
    total: f32,
}

impl Kept {
    fn merge(&mut self, other: Self, u: f32) {
        self.total += other.total;
        if u * self.total < other.total {
            self.light = other.light;
        }
    }
}

/// Draws from lists that follow what was found.
pub struct NeeAt<'a> {
    lights: LightList<'a>,
    /// Pixels of a row and of a column.
    size: [u32; 2],
    kept: Vec<Kept>,
    global: Proxies,
    /// How far tiles are shifted.
    shift: [u32; 2],
    /// The lists of all tiles, row by row. Each is sorted.
    lists: Vec<[u32; LIST]>,
}

impl<'a> NeeAt<'a> {
    pub fn new(lights: LightList<'a>, view: &View) -> Self {
        let size = [view.width as u32, (view.pixels.len() / view.width) as u32];
        Self { lights, size, kept: Vec::new(), global: Proxies::default(), shift: [0; 2], lists: Vec::new() }
    }

    /// The tiles of a row and of a column.
    fn tiles(&self) -> [u32; 2] {
        // One more for the shift.
        self.size.map(|pixels| pixels.div_ceil(TILE) + 1)
    }

    fn list(&self, pixel: u32) -> &[u32; LIST] {
        let [column, row] = [pixel % self.size[0], pixel / self.size[0]];
        let [x, y] = [(column + self.shift[0]) / TILE, (row + self.shift[1]) / TILE];
        &self.lists[(y * self.tiles()[0] + x) as usize]
    }

    /// Takes in what the samples of the last frame have found.
    fn keep(&mut self, frame: &Frame<'_>) {
        let Self { kept, global, .. } = self;
        kept.par_iter_mut().zip(frame.found).enumerate().for_each(|(pixel, (kept, found))| {
            kept.total *= DECAY;
            let Found { light, luminance } = *found;
            if luminance > 0.0 {
                let weight = luminance / global.probability(light).powf(RARE);
                let mut random = Random::new(&[frame.seed, frame.number, pixel as u32]);
                kept.merge(Kept { light, total: weight }, random.pair()[0]);
            }
        });
    }

    fn fill_global(&mut self) {
        let mut used = vec![0.0; self.lights.lights.len()];
        let mut count = 0.0;
        for kept in self.kept.iter().filter(|kept| kept.total > 0.0) {
            used[kept.light as usize] += 1.0;
            count += 1.0;
        }
        let feedback = if count > 0.0 { GLOBAL_FEEDBACK } else { 0.0 };
        for (light, used) in used.iter_mut().enumerate() {
            let by_flux = f64::from(self.lights.by_flux.probability(light));
            *used = (1.0 - feedback) * by_flux + feedback * *used / f64::max(count, 1.0);
        }
        self.global.fill(&used);
    }

    fn fill_lists(&mut self, frame: &Frame<'_>) {
        let mut random = Random::new(&[frame.seed, frame.number]);
        let last_shift = std::mem::replace(&mut self.shift, [(); 2].map(|()| random.below(TILE as usize) as u32));
        let blocks = self.blocks(frame);
        let last = std::mem::take(&mut self.lists);
        let [columns, rows] = self.tiles();
        let this = &*self;
        let list = |index: u32| {
            let mut random = Random::new(&[frame.seed, frame.number, index, 1]);
            let corner = [index % columns, index / columns].map(|tile| (tile * TILE) as i32);
            let corner = [corner[0] - this.shift[0] as i32, corner[1] - this.shift[1] as i32];
            let mut list = [0; LIST];
            let mut places = list.iter_mut();
            let mut add = |light: u32| {
                if let Some(place) = places.next() {
                    *place = light;
                }
            };
            let margin = ((WINDOW - TILE) / 2) as i32;
            for (x, y) in (0..WINDOW as i32).flat_map(|y| (0..WINDOW as i32).map(move |x| (x, y))) {
                let pixel = this.pixel([corner[0] + x - margin, corner[1] + y - margin]);
                add(this.light_of(&this.kept[pixel], &mut random));
            }
            let block_columns = this.size[0].div_ceil(BLOCK);
            let half = (BLOCK_WINDOW * BLOCK / 2) as i32 - (TILE / 2) as i32;
            for (x, y) in (0..BLOCK_WINDOW as i32).flat_map(|y| (0..BLOCK_WINDOW as i32).map(move |x| (x, y))) {
                let at = [corner[0] - half + x * BLOCK as i32, corner[1] - half + y * BLOCK as i32];
                let pixel = this.pixel(at) as u32;
                let block = pixel / this.size[0] / BLOCK * block_columns + pixel % this.size[0] / BLOCK;
                add(this.light_of(&blocks[block as usize], &mut random));
            }
            for _ in 0..HISTORIC {
                let offset = [random.below(TILE as usize) as i32, random.below(TILE as usize) as i32];
                let pixel = this.pixel([corner[0] + offset[0], corner[1] + offset[1]]) as u32;
                let [x, y] = [pixel % this.size[0] + last_shift[0], pixel / this.size[0] + last_shift[1]];
                let historic = last.get((y / TILE * columns + x / TILE) as usize);
                add(match historic {
                    Some(last) => last[random.below(LIST)],
                    None => this.global.draw(random.pair()[0]),
                });
            }
            list.sort_unstable();
            list
        };
        self.lists = (0..columns * rows).into_par_iter().map(list).collect();
    }

    /// What the blocks of the coarse grid have kept.
    fn blocks(&self, frame: &Frame<'_>) -> Vec<Kept> {
        let [width, height] = self.size;
        let columns = width.div_ceil(BLOCK);
        let block = |index: u32| {
            let mut random = Random::new(&[frame.seed, frame.number, index, 2]);
            let [left, top] = [index % columns * BLOCK, index / columns * BLOCK];
            let mut all = Kept::default();
            for y in top..(top + BLOCK).min(height) {
                for x in left..(left + BLOCK).min(width) {
                    all.merge(self.kept[(y * width + x) as usize], random.pair()[0]);
                }
            }
            all
        };
        (0..columns * height.div_ceil(BLOCK)).into_par_iter().map(block).collect()
    }

    /// The index of the pixel at a place, which is mirrored at the border.
    fn pixel(&self, [x, y]: [i32; 2]) -> usize {
        let mirrored = |at: i32, count: u32| {
            let last = count as i32 - 1;
            (if at < 0 {
                -at
            } else if at > last {
                2 * last - at
            } else {
                at
            })
            .clamp(0, last) as usize
        };
        mirrored(y, self.size[1]) * self.size[0] as usize + mirrored(x, self.size[0])
    }

    fn light_of(&self, kept: &Kept, random: &mut Random) -> u32 {
        if kept.total > 0.0 { kept.light } else { self.global.draw(random.pair()[0]) }
    }
}

/// The probability of a light in a sorted list.
fn probability(list: &[u32; LIST], light: u32) -> f32 {
    let first = list.partition_point(|own| *own < light);
    let count = list[first..].iter().take_while(|own| **own == light).count();
    count as f32 / LIST as f32
}

impl Draw for NeeAt<'_> {
    fn prepare(&mut self, frame: &Frame<'_>) {
        if frame.number == 0 {
            self.kept = vec![Kept::default(); (self.size[0] * self.size[1]) as usize];
            self.lists.clear();
        } else {
            self.keep(frame);
        }
        self.fill_global();
        self.fill_lists(frame);
    }

    fn draw(&self, surface: &Surface, material: &Material, sample: &Sample) -> Option<Drawn> {
        let list = self.list(sample.pixel);
        let mut random = Random::of_sample(sample);
        let [local, global] = CANDIDATES.map(|count| count as f32);
        let mut reservoir = Reservoir::<Candidate>::new();
        for index in 0..CANDIDATES[0] + CANDIDATES[1] {
            // The first two numbers of a sample are evenly spread over its candidates of each kind.
            let light = if index < CANDIDATES[0] {
                list[((index as f32 + sample.u[0]) / local * LIST as f32) as usize % LIST]
            } else {
                self.global.draw((index - CANDIDATES[0]) as f32 / global + sample.u[1] / global)
            };
            let pmf = local * probability(list, light) + global * self.global.probability(light);
            let candidate = self.lights.candidate(light as usize, random.pair(), 1.0 / pmf);
            let target = candidate.target(surface, material);
            reservoir.offer(candidate, target, candidate.weight, random.pair()[0]);
        }
        let (kept, weight) = reservoir.kept()?;
        self.lights.drawn(surface, &kept, weight)
    }

    fn warm_up(&self) -> u32 {
        WARM_UP
    }

    fn prepared_bytes(&self) -> usize {
        let [columns, rows] = self.tiles();
        let pixels = (self.size[0] * self.size[1]) as usize;
        (columns * rows) as usize * size_of::<[u32; LIST]>() + pixels * size_of::<Kept>() + self.global.bytes()
    }
}
