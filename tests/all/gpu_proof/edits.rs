//! Random edits of every kind to a world of any size, so that frames send all kinds of deltas.

use girandole::glam::{DVec3, Vec3};
use girandole::{
    DirectionalLight, FrameBudget, InstanceKey, Light, LightTree, LightWorld, Policy, Region, RegionKey, TreeKey,
};

use testbed::testing::support::Rng;

/// Half the size of the cube in metres that the instances are in.
pub const SIZE: f32 = 30.0;

/// Trees of a world beside those of its region.
const TREES: usize = 12;

/// A world that changes, and what an engine would keep to change it.
pub struct Edited {
    pub world: LightWorld,
    rng: Rng,
    trees: Vec<TreeKey>,
    instances: Vec<InstanceKey>,
    region: Option<RegionKey>,
}

impl Edited {
    /// A world of trees of 1 to 6 lights of all kinds, without instances.
    pub fn new(seed: u64) -> Self {
        let mut rng = Rng(seed);
        let mut world = LightWorld::new();
        let trees = (0..TREES)
            .map(|i| world.add_tree(LightTree::new(rng.lights(1 + i % 6, 1.0)).expect("valid lights")))
            .collect();
        Self { world, rng, trees, instances: Vec::new(), region: None }
    }

    /// Makes the edits of one frame. The number of instances goes toward `target`, which it reaches
    /// with the last of `frames_left` frames.
    pub fn step(&mut self, target: usize, frames_left: usize) {
        self.populate(target, frames_left);
        for _ in 0..1 + self.instances.len() / 50 {
            self.change_instance();
        }
        let tree = self.any_tree();
        let count = self.world.tree(tree).map_or(0, |tree| tree.lights().len()) as u64;
        let index = (self.rng.bits() % count) as u32;
        match self.rng.bits() % 8 {
            0 => self.world.set_emission(tree, index, Vec3::ZERO).expect("a live light"),
            1 => {
                let count = 1 + self.rng.bits() as usize % 9;
                self.world.replace_lights(tree, self.rng.lights(count, 1.0)).expect("a live tree");
            }
            2 => self.replace_tree(),
            3 => self.world.set_origin_near(self.rng.position(3000.0).as_dvec3()).expect("near"),
            4 => self.change_directionals(),
            5 => self.change_region(),
            _ => {
                let light = self.rng.light(1.0);
                self.world.set_lights(tree, &[(index, light)]).expect("a live light");
            }
        }
        // Rebuilds come in some frames only.
        self.world.update(if frames_left % 4 == 1 { FrameBudget::UNLIMITED } else { FrameBudget::NONE });
    }

    /// Removes one or two instances and adds as many as this frame has to.
    fn populate(&mut self, target: usize, frames_left: usize) {
        for _ in 0..(1 + self.rng.bits() as usize % 2).min(self.instances.len()) {
            self.remove_instance();
        }
        let missing = target as i64 - self.instances.len() as i64;
        let change = if frames_left <= 1 { missing } else { missing / frames_left as i64 + missing.signum() };
        for _ in 0..change {
            let (tree, place) = (self.any_tree(), self.rng.affine(SIZE));
            self.instances.push(self.world.add_instance(tree, place, Policy::Budgeted).expect("a valid placement"));
        }
        for _ in change..0 {
            self.remove_instance();
        }
    }

    fn remove_instance(&mut self) {
        if !self.instances.is_empty() {
            let index = self.rng.bits() as usize % self.instances.len();
            self.world.remove_instance(self.instances.swap_remove(index)).expect("a live instance");
        }
    }

    fn change_instance(&mut self) {
        if self.instances.is_empty() {
            return;
        }
        let key = self.instances[self.rng.bits() as usize % self.instances.len()];
        match self.rng.bits() % 8 {
            0 => self.world.set_appearance(key, |a| a.is_enabled = false),
            1 | 2 => self.world.set_appearance(key, |a| a.is_enabled = true),
            3 => {
                let factor = (self.rng.position(0.5) + 0.5) * 10.0_f32.powf(self.rng.between(-2.0, 2.0));
                self.world.set_appearance(key, |a| a.factor = factor)
            }
            4 => {
                self.world.set_appearance(key, |a| a.mask = [u32::MAX, 0b01, 0b10, 0b11][self.rng.bits() as usize % 4])
            }
            _ => self.world.move_instance(key, self.rng.affine(SIZE)),
        }
        .expect("a live instance and a valid value");
    }

    fn any_tree(&mut self) -> TreeKey {
        self.trees[self.rng.bits() as usize % self.trees.len()]
    }

    /// Removes a tree with its instances if these are few, and adds another tree.
    fn replace_tree(&mut self) {
        let index = self.rng.bits() as usize % self.trees.len();
        let tree = self.trees[index];
        let has_tree = |key: &InstanceKey| self.world.instance(*key).map(|i| i.tree) == Some(tree);
        let users: Vec<InstanceKey> = self.instances.iter().copied().filter(has_tree).collect();
        if users.len() > 20 {
            return;
        }
        for key in users {
            self.world.remove_instance(key).expect("a live instance");
            self.instances.retain(|other| *other != key);
        }
        self.world.remove_tree(tree).expect("nothing uses it any more");
        let count = 1 + self.rng.bits() as usize % 6;
        self.trees[index] = self.world.add_tree(LightTree::new(self.rng.lights(count, 1.0)).expect("valid lights"));
    }

    /// Adds a directional light, or removes one of two.
    fn change_directionals(&mut self) {
        let keys: Vec<_> = self.world.directionals().collect();
        if keys.len() < 2 {
            let light = DirectionalLight { direction: self.rng.direction(), illuminance: Vec3::splat(0.1) };
            self.world.add_directional(light).expect("a valid light");
        } else {
            self.world.remove_directional(keys[self.rng.bits() as usize % 2]).expect("a live light");
        }
    }

    /// Adds a region of three instances of one tree, or removes the one that is there.
    fn change_region(&mut self) {
        if let Some(region) = self.region.take() {
            drop(self.world.remove_region(region).expect("a live region"));
            return;
        }
        let mut region = Region::new();
        let lights: Vec<Light> = self.rng.lights(5, 1.0);
        let tree = region.add_tree(LightTree::new(lights).expect("valid lights"));
        for _ in 0..3 {
            let instance = girandole::RegionInstance::new(tree, self.rng.affine(SIZE), Policy::Budgeted);
            region.add_instance(instance).expect("a valid placement");
        }
        self.region = Some(self.world.add_region(&mut region).expect("a sound region"));
    }

    /// Shading points among the instances, relative to the origin, one of them with few bits in its mask.
    pub fn shading_points(&mut self, count: usize) -> Vec<girandole::ShadingPoint> {
        let mut points: Vec<_> = (0..count).map(|_| self.rng.shading_point(SIZE)).collect();
        points[0] = points[0].with_mask(0b01);
        let shift: DVec3 = self.world.origin();
        points.iter_mut().for_each(|point| point.position -= shift.as_vec3());
        points
    }

    pub fn rng(&mut self) -> &mut Rng {
        &mut self.rng
    }
}
