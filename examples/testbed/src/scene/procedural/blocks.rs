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
use super::rng::Rng;
use super::signs;

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

/// The designs of everything that stands still.
pub struct Kit {
    /// With the lot that each fills, and whether it is a tower.
    houses: Vec<(Lot, bool, Design)>,
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
                houses.push((lot, floors > 10, design));
            }
        }
        let mut rng = Rng::new(seed, 0x9000);
        let mut tiles = Vec::new();
        for land_use in [LandUse::Houses, LandUse::Houses, LandUse::Houses, LandUse::Park, LandUse::Market] {
            tiles.push((land_use, assembly.design(ground::tile(land_use, palette, &mut rng))?));
        }
        let mut kinds = Vec::new();
        for (is_blade, word) in [true, false].into_iter().flat_map(|is_blade| signs::WORDS.map(|word| (is_blade, word)))
        {
            let make = if is_blade { signs::blade } else { signs::board };
            let part = make(word, palette, &mut rng);
            let lights = part.lights.clone();
            kinds.push(Sign { design: assembly.design(part)?, objects: Vec::new(), lights, is_blade });
        }
        let lamps = [
            furniture::lamp(Lamp::Sodium, furniture::LAMP_HEIGHT, 11_000.0, palette),
            furniture::lamp(Lamp::Led, furniture::LAMP_HEIGHT, 9_000.0, palette),
            furniture::lamp(Lamp::Globe, 3.6, 3_500.0, palette),
        ];
        let [sodium, led, globe] = lamps.map(|part| assembly.design(part));
        let lamps = [sodium?, led?, globe?];
        let trees = (0..4).map(|_| assembly.design(furniture::tree(palette, &mut rng))).collect::<Result<_, _>>()?;
        let bench = assembly.design(furniture::bench(palette))?;
        let stalls = (0..4).map(|_| assembly.design(furniture::stall(palette, &mut rng))).collect::<Result<_, _>>()?;
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
            let mut quarter = Quarter { assembly: &mut *assembly, rng: &mut *rng, frame };
            if land_use == LandUse::Houses {
                self.row(&mut quarter, tower_share)?;
            }
            for x in [-26.0, 0.0, 26.0] {
                quarter.put(lamp, vec3(x, PAVEMENT, KERB - 0.6), 0.0)?;
            }
            for x in [-33.0, -19.5, -8.0, 7.0, 18.5, 33.5] {
                if quarter.rng.chance(0.42) {
                    let x = x + quarter.rng.range(-1.0, 1.0);
                    quarter.plant(&self.trees, vec3(x, PAVEMENT, KERB - 1.0))?;
                }
            }
            if quarter.rng.chance(0.5) {
                let x = quarter.rng.pick(&[-14.0, 3.5, 13.0]);
                quarter.put(self.bench, vec3(x, PAVEMENT, KERB - 2.2), 0.0)?;
            }
            match land_use {
                LandUse::Houses => {}
                LandUse::Park => self.park(&mut quarter)?,
                LandUse::Market => self.market(&mut quarter)?,
            }
        }
        Ok(())
    }

    /// The corner house, the houses beside it and the signs along the +Z side of a block.
    fn row(&mut self, quarter: &mut Quarter<'_>, tower_share: f32) -> Result<(), SceneError> {
        self.house(quarter, Lot::Corner, FRONT, tower_share)?;
        if quarter.rng.chance(0.45) {
            self.house(quarter, Lot::Wide, 0.0, tower_share)?;
        } else {
            self.house(quarter, Lot::Narrow, -8.0, tower_share)?;
            self.house(quarter, Lot::Narrow, 8.0, tower_share)?;
        }
        // A sign every 7 to 60 m.
        let mut x = -FRONT + 2.0;
        loop {
            x += quarter.rng.range(7.0, 60.0);
            if x > FRONT - 2.0 {
                return Ok(());
            }
            let kind = quarter.rng.below(self.signs.len());
            let sign = &mut self.signs[kind];
            let (height, turn) = if sign.is_blade { (5.6, -FRAC_PI_2) } else { (4.95, 0.0) };
            let place = quarter.place(vec3(x, height, FRONT), turn);
            sign.objects.push(quarter.assembly.place(sign.design, place, Policy::RefitOnly)?.object);
        }
    }

    fn house(&self, quarter: &mut Quarter<'_>, lot: Lot, x: f32, tower_share: f32) -> Result<(), SceneError> {
        let tall = quarter.rng.chance(tower_share);
        let fitting = self.houses.iter().filter(|house| (house.0, house.1) == (lot, tall));
        let designs: Vec<Design> = fitting.map(|house| house.2).collect();
        let design = quarter.rng.pick(&designs);
        quarter.put(design, vec3(x, PAVEMENT, FRONT), 0.0)
    }

    fn park(&self, quarter: &mut Quarter<'_>) -> Result<(), SceneError> {
        for z in [8.0, 22.0, 36.0] {
            quarter.put(self.lamps[2], vec3(3.0, PAVEMENT, z), 0.0)?;
            quarter.put(self.bench, vec3(-2.8, PAVEMENT, z + 4.0), FRAC_PI_2)?;
        }
        for _ in 0..9 {
            let at = vec3(quarter.rng.range(6.0, 37.0), PAVEMENT, quarter.rng.range(6.0, 37.0));
            quarter.plant(&self.trees, at)?;
        }
        Ok(())
    }

    fn market(&self, quarter: &mut Quarter<'_>) -> Result<(), SceneError> {
        for (x, z) in [(12.0, 12.0), (20.0, 12.0), (28.0, 12.0), (12.0, 24.0), (20.0, 24.0), (28.0, 24.0)] {
            let rng = &mut *quarter.rng;
            let at = vec3(x + rng.range(-0.8, 0.8), PAVEMENT, z + rng.range(-0.8, 0.8));
            let turn = rng.pick(&[0.0, FRAC_PI_2, -FRAC_PI_2]) + rng.range(-0.1, 0.1);
            let stall = rng.pick(&self.stalls);
            quarter.put(stall, at, turn)?;
        }
        for x in [8.0, 34.0] {
            quarter.put(self.lamps[2], vec3(x, PAVEMENT, 34.0), 0.0)?;
        }
        Ok(())
    }
}

/// A quarter of a block.
struct Quarter<'a> {
    assembly: &'a mut Assembly,
    rng: &'a mut Rng,
    /// From a space in which the middle of the block is the origin and the street is at +Z.
    frame: Affine3A,
}

impl Quarter<'_> {
    /// The transform of what stands at a point of the quarter and is turned about +Y, in radians.
    fn place(&self, at: Vec3, turn: f32) -> Affine3A {
        self.frame * Affine3A::from_rotation_translation(Quat::from_rotation_y(turn), at)
    }

    fn put(&mut self, design: Design, at: Vec3, turn: f32) -> Result<(), SceneError> {
        self.assembly.place(design, self.place(at, turn), Policy::Static).map(drop)
    }

    fn plant(&mut self, trees: &[Design], at: Vec3) -> Result<(), SceneError> {
        let turn = Quat::from_rotation_y(self.rng.range(0.0, TAU));
        let size = Vec3::splat(self.rng.range(0.85, 1.25));
        let place = self.frame * Affine3A::from_scale_rotation_translation(size, turn, at);
        self.assembly.place(self.rng.pick(trees), place, Policy::Static).map(drop)
    }
}
