//! The contents of blocks: each has a street, two towers and a market of its own, and four houses
//! whose trees the whole world shares.
//!
//! A block is a region. Its contents depend only on the seed and its place, so a block that comes
//! back is the same. The loader thread builds its trees, in place of loading baked ones.

use super::settings::Settings;
use girandole::glam::{DVec3, Vec3};
use girandole::{Light, LightTree, LightWorld, Placement, Policy, Region, RegionInstance, TreeKey, WorldError};
use testbed::common::pcg::Rng;

/// Houses of a block.
const HOUSES: usize = 4;
/// Lights of a house.
const HOUSE_LIGHTS: usize = 16;
/// Kinds of houses.
pub const KINDS: usize = 4;

/// The index of the market among the trees of a block.
pub const MARKET: usize = 1;

/// A block by its column and row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Block {
    pub x: i32,
    pub z: i32,
}

impl Block {
    /// The middle of the block, on the ground.
    pub fn middle(self, size: f64) -> DVec3 {
        DVec3::new((f64::from(self.x) + 0.5) * size, 0.0, (f64::from(self.z) + 0.5) * size)
    }

    /// The horizontal distance from the camera to the middle, in metres.
    pub fn distance(self, size: f64, camera: DVec3) -> f64 {
        let away = self.middle(size) - camera;
        away.x.hypot(away.z)
    }
}

/// Numbers of lights of a block.
#[derive(Clone, Copy, Debug)]
struct Counts {
    street: usize,
    market: usize,
    tower: usize,
}

/// Fills blocks. Each thread may have one.
#[derive(Clone, Debug)]
pub struct Builder {
    seed: u64,
    blocks: u32,
    size: f64,
    lights_per_block: f32,
    is_plain: bool,
    houses: Vec<TreeKey>,
}

impl Builder {
    /// Adds the houses that all blocks share to the world.
    pub fn new(settings: &Settings, world: &mut LightWorld) -> Result<Self, WorldError> {
        let mut builder = Self {
            seed: settings.seed,
            blocks: settings.blocks,
            size: settings.block_size,
            lights_per_block: settings.lights_per_block,
            is_plain: settings.is_plain,
            houses: Vec::new(),
        };
        let mut rng = Rng::new(settings.seed, u64::MAX);
        for _ in 0..KINDS {
            let windows = builder.windows(&mut rng, HOUSE_LIGHTS, 8.0, 6.0);
            builder.houses.push(world.add_tree(LightTree::new(windows)?));
        }
        Ok(builder)
    }

    /// The number of lights per area at a block, relative to the mean: 0.5 to 1.5.
    pub fn density(&self, block: Block) -> f32 {
        let place = block.middle(self.size) * 1.0e-3;
        1.0 + 0.5 * ((place.x * 1.9).sin() * (place.z * 2.3).cos()) as f32
    }

    fn counts(&self, block: Block) -> Counts {
        let shared = (HOUSES * HOUSE_LIGHTS) as f32;
        let own = (self.lights_per_block - shared).max(24.0) * self.density(block);
        let part = |share: f32| (own * share).round().max(1.0) as usize;
        Counts { street: part(0.3), market: part(0.3), tower: part(0.2) }
    }

    /// The number of lights of a block.
    pub fn light_count(&self, block: Block) -> usize {
        let Counts { street, market, tower } = self.counts(block);
        street + market + 2 * tower + HOUSES * HOUSE_LIGHTS
    }

    /// The number of lights of the whole world.
    pub fn world_light_count(&self) -> usize {
        let side = self.blocks as i32;
        (0..side).flat_map(|x| (0..side).map(move |z| Block { x, z })).map(|block| self.light_count(block)).sum()
    }

    /// The lights of the market of a block, before they flicker.
    pub fn market(&self, block: Block) -> Vec<Light> {
        let mut rng = Rng::new(self.seed, self.stream(block) + 1);
        let half = 0.2 * self.size as f32;
        let place = |rng: &mut Rng| Vec3::new(rng.range(-half, half), rng.range(2.0, 4.0), rng.range(-half, half));
        let light = |rng: &mut Rng| Light::point(place(rng), self.color(rng) * rng.range(20.0, 80.0));
        (0..self.counts(block).market).map(|_| light(&mut rng)).collect()
    }

    /// The whole block as a region.
    pub fn fill(&self, block: Block) -> Result<Region, WorldError> {
        let mut rng = Rng::new(self.seed, self.stream(block));
        let counts = self.counts(block);
        let mut region = Region::new();
        let street = region.add_tree(LightTree::new(self.street(&mut rng, counts.street))?);
        let market = region.add_tree(LightTree::new(self.market(block))?);
        let middle = block.middle(self.size);
        let add = |region: &mut Region, tree, offset: Vec3, policy| {
            let placement = Placement::at(middle + offset.as_dvec3());
            region.add_instance(RegionInstance::new(tree, placement, policy))
        };
        add(&mut region, street, Vec3::ZERO, Policy::Static)?;
        add(&mut region, market, Vec3::ZERO, Policy::Budgeted)?;
        let quarter = 0.25 * self.size as f32;
        for side in [-1.0, 1.0] {
            let tower = LightTree::new(self.windows(&mut rng, counts.tower, 12.0, 60.0))?;
            let tower = region.add_tree(tower);
            add(&mut region, tower, Vec3::new(side * quarter, 0.0, side * quarter), Policy::Static)?;
        }
        for i in 0..HOUSES {
            let house = region.add_world_tree(rng.pick(&self.houses));
            let along = (i as f32 - 1.5) * 0.15 * self.size as f32;
            add(&mut region, house, Vec3::new(along, 0.0, -along), Policy::Static)?;
        }
        Ok(region)
    }

    /// The random numbers of a block: an even stream for its trees, an odd one for its market.
    fn stream(&self, block: Block) -> u64 {
        2 * (u64::from(self.blocks) * block.z as u64 + block.x as u64)
    }

    fn color(&self, rng: &mut Rng) -> Vec3 {
        Vec3::new(1.0, rng.range(0.6, 1.0), rng.range(0.3, 1.0))
    }

    /// Lamps along both streets through the middle of a block.
    fn street(&self, rng: &mut Rng, count: usize) -> Vec<Light> {
        let half = 0.5 * self.size as f32;
        let lamp = |i: usize| {
            let along = half * (2.0 * (i as f32 + 0.5) / count as f32 - 1.0);
            let place = if i.is_multiple_of(2) { Vec3::new(along, 8.0, 5.0) } else { Vec3::new(5.0, 8.0, along) };
            let candela = self.color(rng) * 900.0;
            if self.is_plain { Light::point(place, candela) } else { Light::spot(place, -Vec3::Y, 0.6, 1.2, candela) }
        };
        (0..count).map(lamp).collect()
    }

    /// Windows on the four walls of a house of this width and height.
    fn windows(&self, rng: &mut Rng, count: usize, width: f32, height: f32) -> Vec<Light> {
        let window = |i: usize| {
            let outward = [Vec3::X, Vec3::Z, -Vec3::X, -Vec3::Z][i % 4];
            let along = outward.cross(Vec3::Y);
            let half = 0.5 * width;
            let place = outward * half + along * rng.range(-half, half) + Vec3::Y * rng.range(1.0, height);
            let emission = self.color(rng) * rng.range(30.0, 90.0);
            match self.is_plain {
                true => Light::point(place, emission),
                false => Light::rectangle(place, along * 0.6, Vec3::Y * 0.8, emission),
            }
        };
        (0..count).map(window).collect()
    }
}
