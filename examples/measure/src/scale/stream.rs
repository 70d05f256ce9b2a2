//! Which blocks arrive and leave.

use super::blocks::Block;
use super::settings::Settings;
use girandole::RegionKey;
use girandole::glam::DVec3;
use std::collections::{HashMap, HashSet, VecDeque};

/// The blocks that are resident, and those that were requested.
#[derive(Debug)]
pub struct Stream {
    blocks: u32,
    size: f64,
    radius: f64,
    latency: u32,
    /// The most blocks that are requested, and the most that leave, in one frame.
    most: usize,
    pub resident: HashMap<Block, RegionKey>,
    requested: HashSet<Block>,
    /// The frames in which requested blocks arrive, in order.
    coming: VecDeque<(u32, Block)>,
}

impl Stream {
    pub fn new(settings: &Settings) -> Self {
        Self {
            blocks: settings.blocks,
            size: settings.block_size,
            radius: settings.radius,
            latency: settings.latency,
            most: settings.blocks_per_frame,
            resident: HashMap::new(),
            requested: HashSet::new(),
            coming: VecDeque::new(),
        }
    }

    /// The wanted blocks that are neither resident nor requested, the nearest first.
    pub fn missing(&self, camera: DVec3) -> Vec<Block> {
        let column = |at: f64| ((at / self.size).floor() as i32).clamp(0, self.blocks as i32 - 1);
        let columns = |at: f64| column(at - self.radius)..=column(at + self.radius);
        let mut missing: Vec<Block> = columns(camera.x)
            .flat_map(|x| columns(camera.z).map(move |z| Block { x, z }))
            .filter(|block| block.distance(self.size, camera) <= self.radius)
            .filter(|block| !self.resident.contains_key(block) && !self.requested.contains(block))
            .collect();
        missing.sort_by(|a, b| self.order(*a, *b, camera));
        missing
    }

    fn order(&self, a: Block, b: Block, camera: DVec3) -> std::cmp::Ordering {
        let [near, far] = [a, b].map(|block| block.distance(self.size, camera));
        near.total_cmp(&far).then(a.cmp(&b))
    }

    /// Chooses the blocks to request in a frame.
    pub fn request(&mut self, frame: u32, camera: DVec3) -> Vec<Block> {
        let mut blocks = self.missing(camera);
        blocks.truncate(self.most);
        for block in &blocks {
            self.requested.insert(*block);
            self.coming.push_back((frame + self.latency, *block));
        }
        blocks
    }

    /// The blocks that arrive in this frame.
    pub fn arrivals(&mut self, frame: u32) -> Vec<Block> {
        let count = self.coming.iter().take_while(|(at, _)| *at <= frame).count();
        let blocks: Vec<Block> = self.coming.drain(..count).map(|(_, block)| block).collect();
        blocks.iter().for_each(|block| _ = self.requested.remove(block));
        blocks
    }

    /// The blocks that leave in this frame, the farthest first. They are farther away than the
    /// radius by `margin`, in metres, so that none arrives and leaves in turn.
    pub fn departures(&self, camera: DVec3, margin: f64) -> Vec<Block> {
        let is_far = |block: &&Block| block.distance(self.size, camera) > self.radius + margin;
        let mut far: Vec<Block> = self.resident.keys().filter(is_far).copied().collect();
        far.sort_by(|a, b| self.order(*b, *a, camera));
        far.truncate(self.most);
        far
    }

    /// The resident blocks of a square around the camera, with `side` blocks along each side.
    pub fn around(&self, camera: DVec3, side: i32) -> Vec<(Block, RegionKey)> {
        let first = |at: f64| (at / self.size).round() as i32 - side / 2;
        let (x, z) = (first(camera.x), first(camera.z));
        let blocks = (x..x + side).flat_map(|x| (z..z + side).map(move |z| Block { x, z }));
        blocks.filter_map(|block| self.resident.get(&block).map(|region| (block, *region))).collect()
    }
}
