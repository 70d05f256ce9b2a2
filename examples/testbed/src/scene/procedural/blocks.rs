//! Places the buildings, lamps, signs and trees of a block. All four sides of a block follow the
//! same rules.

use std::f32::consts::{FRAC_PI_2, TAU};

use girandole::glam::{Affine3A, Quat, Vec2, Vec3, vec3};
use girandole::{Light, Policy};

use super::SceneError;
use super::assembly::{Assembly, Design};
use super::buildings::{self, Lot};
use super::furniture::{self, Lamp};
use super::ground::{self, FRONT, KERB, LandUse, PAVEMENT};
use super::palette::Palette;
use super::part::Part;
use super::rng::Rng;
use super::signs;

/// A design of a building.
struct House {
    lot: Lot,
    floors: usize,
    design: Design,
}

/// A kind of neon sign and its copies.
pub struct Sign {
    /// Mesh and light tree.
    pub design: Design,
    /// The objects of its copies.
    pub objects: Vec<usize>,
    /// Its lights at full power.
    pub lights: Vec<Light>,
    /// Whether it sticks out from the wall.
    is_blade: bool,
}

impl Sign {
    fn new(part: Part, is_blade: bool, assembly: &mut Assembly) -> Result<Self, SceneError> {
        let lights = part.lights.clone();
        Ok(Self { design: assembly.design(part)?, objects: Vec::new(), lights, is_blade })
    }
}

/// The designs of everything that stands still.
pub struct Kit {
    houses: Vec<House>,
    tiles: Vec<(LandUse, Design)>,
    /// Blades, then boards, each in the order of [`signs::WORDS`].
    pub signs: Vec<Sign>,
    lamps: [Design; 3],
    trees: Vec<Design>,
    bench: Design,
    stalls: Vec<Design>,
}

impl Kit {
    /// Builds all designs from a seed.
    pub fn new(assembly: &mut Assembly, palette: &mut Palette, seed: u64) -> Result<Self, SceneError> {
        let mut houses = Vec::new();
        let plans: [(Lot, &[usize]); 3] = [
            (Lot::Corner, &[3, 4, 5, 6, 7, 8, 9, 12, 15, 18, 22, 26]),
            (Lot::Narrow, &[2, 3, 4, 4, 5, 5, 6, 6, 7, 8, 9, 13, 16, 20]),
            (Lot::Wide, &[3, 4, 4, 5, 5, 6, 6, 7, 8, 9, 12, 15, 19, 24]),
        ];
        for (lot, heights) in plans {
            for (index, &floors) in heights.iter().enumerate() {
                let mut rng = Rng::new(seed, 0x8000 + index as u64 + 64 * lot as u64);
                let design = assembly.design(buildings::building(lot, floors, palette, &mut rng))?;
                houses.push(House { lot, floors, design });
            }
        }
        let mut rng = Rng::new(seed, 0x9000);
        let mut tiles = Vec::new();
        for land_use in [LandUse::Houses, LandUse::Houses, LandUse::Houses, LandUse::Park, LandUse::Market] {
            tiles.push((land_use, assembly.design(ground::tile(land_use, palette, &mut rng))?));
        }
        let mut kinds = Vec::new();
        for word in signs::WORDS {
            let part = signs::blade(word, palette, &mut rng);
            kinds.push(Sign::new(part, true, assembly)?);
        }
        for word in signs::WORDS {
            let part = signs::board(word, palette, &mut rng);
            kinds.push(Sign::new(part, false, assembly)?);
        }
        let lamp = |kind: Lamp, height: f32, lumens: f32, assembly: &mut Assembly, palette: &mut Palette| {
            assembly.design(furniture::lamp(kind, height, lumens, palette))
        };
        let lamps = [
            lamp(Lamp::Sodium, furniture::LAMP_HEIGHT, 11_000.0, assembly, palette)?,
            lamp(Lamp::Led, furniture::LAMP_HEIGHT, 9_000.0, assembly, palette)?,
            lamp(Lamp::Globe, 3.6, 3_500.0, assembly, palette)?,
        ];
        let mut trees = Vec::new();
        for _ in 0..4 {
            trees.push(assembly.design(furniture::tree(palette, &mut rng))?);
        }
        let bench = assembly.design(furniture::bench(palette))?;
        let mut stalls = Vec::new();
        for _ in 0..4 {
            stalls.push(assembly.design(furniture::stall(palette, &mut rng))?);
        }
        Ok(Self { houses, tiles, signs: kinds, lamps, trees, bench, stalls })
    }

    /// Places a tile and what stands on it. `tower_share` is the probability that a building is a
    /// tower.
    pub fn block(
        &mut self,
        assembly: &mut Assembly,
        center: Vec2,
        land_use: LandUse,
        tower_share: f32,
        rng: &mut Rng,
    ) -> Result<(), SceneError> {
        let center = vec3(center.x, 0.0, center.y);
        let tiles: Vec<Design> = self.tiles.iter().filter(|tile| tile.0 == land_use).map(|tile| tile.1).collect();
        assembly.place(rng.pick(&tiles), Affine3A::from_translation(center), Policy::Static)?;
        // All street lamps of a block are alike.
        let lamp = self.lamps[usize::from(rng.chance(0.4))];
        for quarter in 0..4 {
            let turn = Quat::from_rotation_y(quarter as f32 * FRAC_PI_2);
            let frame = Affine3A::from_rotation_translation(turn, center);
            if land_use == LandUse::Houses {
                self.row(assembly, frame, tower_share, rng)?;
            }
            for x in [-26.0, 0.0, 26.0] {
                let post = frame * Affine3A::from_translation(vec3(x, PAVEMENT, KERB - 0.6));
                assembly.place(lamp, post, Policy::Static)?;
            }
            for x in [-33.0, -19.5, -8.0, 7.0, 18.5, 33.5] {
                if rng.chance(0.42) {
                    self.plant(assembly, frame, vec3(x + rng.range(-1.0, 1.0), PAVEMENT, KERB - 1.0), rng)?;
                }
            }
            if rng.chance(0.5) {
                let seat = Affine3A::from_translation(vec3(rng.pick(&[-14.0, 3.5, 13.0]), PAVEMENT, KERB - 2.2));
                assembly.place(self.bench, frame * seat, Policy::Static)?;
            }
            match land_use {
                LandUse::Houses => {}
                LandUse::Park => self.park(assembly, frame, rng)?,
                LandUse::Market => self.market(assembly, frame, rng)?,
            }
        }
        Ok(())
    }

    fn plant(&self, assembly: &mut Assembly, frame: Affine3A, at: Vec3, rng: &mut Rng) -> Result<(), SceneError> {
        let turn = Quat::from_rotation_y(rng.range(0.0, TAU));
        let size = Vec3::splat(rng.range(0.85, 1.25));
        let place = frame * Affine3A::from_scale_rotation_translation(size, turn, at);
        assembly.place(rng.pick(&self.trees), place, Policy::Static).map(drop)
    }

    /// The corner house, the houses beside it and the signs along the +Z side of a block.
    fn row(
        &mut self,
        assembly: &mut Assembly,
        frame: Affine3A,
        tower_share: f32,
        rng: &mut Rng,
    ) -> Result<(), SceneError> {
        self.house(assembly, frame, Lot::Corner, vec3(FRONT, PAVEMENT, FRONT), tower_share, rng)?;
        if rng.chance(0.45) {
            self.house(assembly, frame, Lot::Wide, vec3(0.0, PAVEMENT, FRONT), tower_share, rng)?;
        } else {
            for x in [-8.0, 8.0] {
                self.house(assembly, frame, Lot::Narrow, vec3(x, PAVEMENT, FRONT), tower_share, rng)?;
            }
        }
        // A sign every 7 to 60 m.
        let mut x = -FRONT + 2.0;
        loop {
            x += rng.range(7.0, 60.0);
            if x > FRONT - 2.0 {
                return Ok(());
            }
            let kind = rng.below(self.signs.len());
            let sign = &mut self.signs[kind];
            let height = if sign.is_blade { 5.6 } else { 4.95 };
            let turn = if sign.is_blade { Quat::from_rotation_y(-FRAC_PI_2) } else { Quat::IDENTITY };
            let place = Affine3A::from_rotation_translation(turn, vec3(x, height, FRONT));
            let placed = assembly.place(sign.design, frame * place, Policy::RefitOnly)?;
            sign.objects.push(placed.object);
        }
    }

    fn house(
        &self,
        assembly: &mut Assembly,
        frame: Affine3A,
        lot: Lot,
        at: Vec3,
        tower_share: f32,
        rng: &mut Rng,
    ) -> Result<(), SceneError> {
        let tall = rng.chance(tower_share);
        let fitting = |house: &&House| house.lot == lot && (house.floors > 10) == tall;
        let designs: Vec<Design> = self.houses.iter().filter(fitting).map(|house| house.design).collect();
        assembly.place(rng.pick(&designs), frame * Affine3A::from_translation(at), Policy::Static).map(drop)
    }

    fn park(&self, assembly: &mut Assembly, frame: Affine3A, rng: &mut Rng) -> Result<(), SceneError> {
        for z in [8.0, 22.0, 36.0] {
            let post = Affine3A::from_translation(vec3(3.0, PAVEMENT, z));
            assembly.place(self.lamps[2], frame * post, Policy::Static)?;
            let seat =
                Affine3A::from_rotation_translation(Quat::from_rotation_y(FRAC_PI_2), vec3(-2.8, PAVEMENT, z + 4.0));
            assembly.place(self.bench, frame * seat, Policy::Static)?;
        }
        for _ in 0..9 {
            let at = vec3(rng.range(6.0, 37.0), PAVEMENT, rng.range(6.0, 37.0));
            self.plant(assembly, frame, at, rng)?;
        }
        Ok(())
    }

    fn market(&self, assembly: &mut Assembly, frame: Affine3A, rng: &mut Rng) -> Result<(), SceneError> {
        for (x, z) in [(12.0, 12.0), (20.0, 12.0), (28.0, 12.0), (12.0, 24.0), (20.0, 24.0), (28.0, 24.0)] {
            let at = vec3(x + rng.range(-0.8, 0.8), PAVEMENT, z + rng.range(-0.8, 0.8));
            let turn = Quat::from_rotation_y(rng.pick(&[0.0, FRAC_PI_2, -FRAC_PI_2]) + rng.range(-0.1, 0.1));
            let place = frame * Affine3A::from_rotation_translation(turn, at);
            assembly.place(rng.pick(&self.stalls), place, Policy::Static)?;
        }
        for x in [8.0, 34.0] {
            let post = Affine3A::from_translation(vec3(x, PAVEMENT, 34.0));
            assembly.place(self.lamps[2], frame * post, Policy::Static)?;
        }
        Ok(())
    }
}
