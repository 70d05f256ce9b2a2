//! The changes of every frame: vehicles drive along streets near the camera, and lights of the
//! markets near it flicker.

use super::blocks::{Block, Builder, MARKET};
use super::settings::Settings;
use girandole::glam::{DVec3, Mat3, Vec3};
use girandole::{InstanceKey, Light, LightTree, LightWorld, Placement, Policy, RegionKey, TreeKey, WorldError};
use std::collections::HashMap;
use testbed::common::pcg::Rng;

/// Vehicles are within this of the camera along x and z, in blocks.
const REACH: f64 = 8.0;
/// Lights of a market that change in one frame.
const FLICKERING: usize = 4;

/// Where a vehicle drives.
#[derive(Clone, Copy, Debug)]
struct Drive {
    key: InstanceKey,
    along_x: bool,
    /// The number of the street.
    street: f64,
    /// Metres along the street at the start, and metres per frame.
    start: f64,
    speed: f64,
}

/// All vehicles, and the markets that flicker.
#[derive(Debug)]
pub struct Traffic {
    size: f64,
    drives: Vec<Drive>,
    /// The moves of a frame.
    pub moves: Vec<(InstanceKey, Placement)>,
    /// The edits of a frame.
    pub edits: Vec<(TreeKey, Vec<(u32, Light)>)>,
    /// The lights of these markets, before they flicker.
    markets: HashMap<Block, Vec<Light>>,
}

impl Traffic {
    pub fn new(settings: &Settings, world: &mut LightWorld) -> Result<Self, WorldError> {
        let mut rng = Rng::new(settings.seed, u64::MAX - 1);
        let head = |side: f32| {
            let place = Vec3::new(side, 0.7, 2.0);
            match settings.is_plain {
                true => Light::point(place, Vec3::splat(300.0)),
                false => Light::spot(place, Vec3::Z, 0.2, 0.5, Vec3::splat(3000.0)),
            }
        };
        let tail = |side: f32| Light::point(Vec3::new(side, 0.8, -2.0), Vec3::X * 20.0);
        let car = world.add_tree(LightTree::new(vec![head(-0.7), head(0.7), tail(-0.7), tail(0.7)])?);
        let mut drives = Vec::new();
        for _ in 0..settings.vehicles {
            let key = world.add_instance(car, Placement::IDENTITY, Policy::Static)?;
            let start = f64::from(rng.range(0.0, 1.0)) * 2.0 * REACH * settings.block_size;
            let street = rng.below(2 * REACH as usize) as f64;
            let speed = f64::from(rng.range(8.0, 20.0)) / 60.0 * if rng.chance(0.5) { 1.0 } else { -1.0 };
            drives.push(Drive { key, along_x: rng.chance(0.5), street, start, speed });
        }
        let size = settings.block_size;
        Ok(Self { size, drives, moves: Vec::new(), edits: Vec::new(), markets: HashMap::new() })
    }

    /// Computes the moves and edits of a frame. `around` are the blocks that flicker.
    pub fn advance(
        &mut self,
        frame: u32,
        camera: DVec3,
        around: &[(Block, RegionKey)],
        (world, builder): (&LightWorld, &Builder),
    ) {
        let reach = REACH * self.size;
        // Streets repeat every two reaches: the coordinate nearest to the camera.
        let wrap = |at: f64, camera: f64| camera - reach + (at - camera + reach).rem_euclid(2.0 * reach);
        self.moves.clear();
        for drive in &self.drives {
            let along = drive.start + drive.speed * f64::from(frame);
            let across = drive.street * self.size;
            let (x, z) = if drive.along_x { (along, across) } else { (across, along) };
            let translation = DVec3::new(wrap(x, camera.x), 0.0, wrap(z, camera.z));
            let heading = drive.speed.signum() as f32 * if drive.along_x { Vec3::X } else { Vec3::Z };
            let linear = Mat3::from_cols(Vec3::Y.cross(heading), Vec3::Y, heading);
            self.moves.push((drive.key, Placement { linear, translation }));
        }
        self.edits.clear();
        self.markets.retain(|block, _| around.iter().any(|(other, _)| other == block));
        for (block, region) in around {
            let Some(tree) = world.region(*region).map(|region| region.trees[MARKET]) else { continue };
            let lights = self.markets.entry(*block).or_insert_with(|| builder.market(*block));
            let mut rng = Rng::new(u64::from(frame), (block.x as u64) << 32 | block.z as u64);
            let flicker = |i: usize| {
                let index = (frame as usize * FLICKERING + i) % lights.len();
                let light = lights[index];
                (index as u32, light.with_emission(light.emission * rng.range(0.5, 1.5)))
            };
            let count = FLICKERING.min(lights.len());
            self.edits.push((tree, (0..count).map(flicker).collect()));
        }
    }
}
