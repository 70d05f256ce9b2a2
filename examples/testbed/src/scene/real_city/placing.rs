//! Places what stands still: lamps, houses beside roads, and parked cars.

use std::collections::{BTreeMap, BTreeSet};

use girandole::Policy;
use girandole::glam::{Affine3A, Quat, Vec2, vec2, vec3};

use super::SceneError;
use super::assembly::{Assembly, Design};
use super::buildings::{self, Lot};
use super::furniture::{self, Lamp};
use super::grid::Grid;
use super::ground::{self, RoadSegment};
use super::lamp_table::LampRecord;
use super::palette::Palette;
use super::rng::Rng;
use super::vehicles::body::Body;
use super::vehicles::fleet::car_transform;

/// Houses are placed within this distance of the middle of the view, metres.
const HOUSE_REACH: f32 = 420.0;

/// Places all lamps, each with its arm in the given direction.
pub fn place_lamps(
    assembly: &mut Assembly,
    palette: &mut Palette,
    lamps: &[LampRecord],
    positions: &[Vec2],
    arms: &[Vec2],
) -> Result<(), SceneError> {
    // Lamps with the same height and flux share a tree and a mesh; real tables have few kinds.
    let mut designs: BTreeMap<(u32, u32), Design> = BTreeMap::new();
    for ((lamp, position), arm) in lamps.iter().zip(positions).zip(arms) {
        let kind = match lamp.height {
            height if height < 5.5 => Lamp::Globe,
            _ if lamp.lumens > 12_000.0 => Lamp::Sodium,
            _ => Lamp::Led,
        };
        let design = match designs.get(&(lamp.height.to_bits(), lamp.lumens.to_bits())) {
            Some(&known) => known,
            None => {
                let design = assembly.design(furniture::lamp(kind, lamp.height, lamp.lumens, palette))?;
                designs.insert((lamp.height.to_bits(), lamp.lumens.to_bits()), design);
                design
            }
        };
        let turn = Quat::from_rotation_y(arm.x.atan2(arm.y));
        let place = Affine3A::from_rotation_translation(turn, vec3(position.x, 0.0, position.y));
        assembly.place(design, place, Policy::Static)?;
    }
    Ok(())
}

/// Places houses beside the roads near `middle`.
pub fn place_houses(
    assembly: &mut Assembly,
    palette: &mut Palette,
    lamps: &Grid,
    segments: &[RoadSegment],
    driven_cells: &BTreeSet<(i32, i32)>,
    middle: Vec2,
    seed: u64,
) -> Result<(), SceneError> {
    let places = ground::house_places(lamps, segments, driven_cells, middle, HOUSE_REACH, seed);
    let mut designs = Vec::new();
    for (index, floors) in [1, 1, 2, 2, 3, 4].into_iter().enumerate() {
        let mut rng = Rng::new(seed, 0x6000 + index as u64);
        designs.push(assembly.design(buildings::building(Lot::Detached, floors, palette, &mut rng))?);
    }
    let mut rng = Rng::new(seed, 0x6fff);
    for place in places {
        assembly.place(rng.pick(&designs), place, Policy::Static)?;
    }
    Ok(())
}

/// Parks `count` cars at the kerbs of the roads near the middle.
pub fn park_cars(
    assembly: &mut Assembly,
    kinds: &[(Body, Vec<Design>)],
    segments: &[RoadSegment],
    middle: Vec2,
    count: usize,
    seed: u64,
) -> Result<(), SceneError> {
    let mut rng = Rng::new(seed, 0x9a2c);
    let mut near: Vec<&RoadSegment> = segments.iter().collect();
    near.sort_by(|a, b| a.distance(middle).total_cmp(&b.distance(middle)));
    near.truncate(count.div_ceil(2));
    for car in 0..if near.is_empty() { 0 } else { count } {
        let segment = near[car % near.len()];
        let along = (segment.to - segment.from).normalize_or(vec2(1.0, 0.0));
        // After one car on each road, the next ones stand on the other side and face the other way.
        let along = if (car / near.len()).is_multiple_of(2) { along } else { -along };
        let at = segment.from.lerp(segment.to, rng.range(0.25, 0.75)) + vec2(-along.y, along.x) * 2.2;
        let kind = rng.below(3);
        let design = rng.pick(&kinds[kind].1);
        let angle = (-along.x).atan2(-along.y);
        assembly.place(design, car_transform(at, angle), Policy::RefitOnly)?;
    }
    Ok(())
}
