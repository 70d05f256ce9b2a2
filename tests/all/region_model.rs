//! Regions, trees, instances and lights enter and leave a world in random order, and the world has
//! the same lights as a plain model.

use std::collections::BTreeMap;

use girandole::glam::{DVec3, Vec3};
use girandole::{
    FrameBudget, InstanceKey, Light, LightId, LightTree, LightWorld, Placement, Policy, Region, RegionInstance,
    RegionKey, ShadingPoint, TreeKey, WorldError,
};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use testbed::testing::support::{Rng, all_pmfs};

/// Rounding of a sum of some hundred products of about ten factors each.
const SUM_TOLERANCE: f32 = 1.0e-3;

/// The expected contents of a world.
#[derive(Clone, Debug, Default)]
struct Model {
    /// For each tree, the lights by index; `None` for one that was removed.
    trees: BTreeMap<TreeKey, Vec<Option<Light>>>,
    /// For each instance, its tree and the region that it was added with.
    instances: BTreeMap<InstanceKey, (TreeKey, Option<RegionKey>)>,
    /// For each region, the trees that it owns, copies included.
    regions: BTreeMap<RegionKey, Vec<TreeKey>>,
    /// Edits that take effect at the next update.
    edits: Vec<Edit>,
}

#[derive(Clone, Debug)]
struct Edit {
    tree: TreeKey,
    light: u32,
    to: Option<Light>,
}

impl Model {
    /// A region whose trees nothing else uses.
    fn unused_region(&self) -> Option<RegionKey> {
        let is_unused = |(key, own): &(&RegionKey, &Vec<TreeKey>)| {
            !self.instances.values().any(|(tree, by)| own.contains(tree) && *by != Some(**key))
        };
        self.regions.iter().find(is_unused).map(|(key, _)| *key)
    }
}

/// A world, its model and random numbers.
struct Run {
    world: LightWorld,
    model: Model,
    rng: Rng,
}

/// A light that every point in a volume receives.
fn lamp(rng: &mut Rng) -> Light {
    Light::point(rng.position(9.0), Vec3::splat(rng.between(0.5, 5.0)))
}

fn lamps(rng: &mut Rng, most: u64) -> Vec<Light> {
    let count = rng.bits() % most;
    (0..count).map(|_| lamp(rng)).collect()
}

fn present(lights: &[Light]) -> Vec<Option<Light>> {
    lights.iter().copied().map(Some).collect()
}

fn any_of<T: Copy>(rng: &mut Rng, mut items: impl ExactSizeIterator<Item = T>) -> Option<T> {
    let count = items.len();
    (count > 0).then(|| items.nth(rng.bits() as usize % count)).flatten()
}

impl Run {
    fn tree(&mut self) -> Option<TreeKey> {
        any_of(&mut self.rng, self.model.trees.keys().copied())
    }

    fn instance(&mut self) -> Option<InstanceKey> {
        any_of(&mut self.rng, self.model.instances.keys().copied())
    }

    fn place(&mut self) -> Placement {
        self.rng.affine(20.0).into()
    }

    fn policy(&mut self) -> Policy {
        // No tree is static as a whole, so that all edits are allowed.
        [Policy::Budgeted, Policy::RefitOnly, Policy::AlwaysRebuild][self.rng.bits() as usize % 3]
    }

    fn add_tree(&mut self) {
        let lights = lamps(&mut self.rng, 60);
        let key = self.world.add_tree(LightTree::new(lights.clone()).expect("valid"));
        self.model.trees.insert(key, present(&lights));
    }

    fn add_instance(&mut self) {
        let Some(tree) = self.tree() else { return };
        let (place, policy) = (self.place(), self.policy());
        let key = self.world.add_instance(tree, place, policy).expect("valid");
        self.model.instances.insert(key, (tree, None));
    }

    fn add_region(&mut self) {
        let mut region = Region::new();
        let (mut trees, mut lights) = (Vec::new(), Vec::new());
        for _ in 0..self.rng.bits() % 4 {
            let own = lamps(&mut self.rng, 40);
            let built = |lights: &[Light]| LightTree::new(lights.to_vec()).expect("valid");
            let of_world = self.tree();
            trees.push(match (self.rng.bits() % 3, of_world) {
                (0, _) => region.add_tree(LightTree::from_baked(&built(&own).bake()).expect("just written")),
                (1, Some(tree)) => {
                    lights.push(Err(tree));
                    trees.push(region.add_world_tree(tree));
                    continue;
                }
                _ => region.add_tree(built(&own)),
            });
            lights.push(Ok(own));
        }
        let mut instances = Vec::new();
        for _ in 0..self.rng.bits() % 6 {
            let Some(tree) = any_of(&mut self.rng, trees.iter().copied()) else { break };
            let (place, policy) = (self.place(), self.policy());
            region.add_instance(RegionInstance::new(tree, place, policy)).expect("valid");
            instances.push(tree.index());
        }
        if self.rng.bits().is_multiple_of(3) {
            // A region refuses an instance that is too far away; the world refuses the key of a tree that never was.
            if let Some(tree) = trees.first() {
                let far = RegionInstance::new(*tree, Placement::at(DVec3::splat(1.1e9)), Policy::Budgeted);
                region.add_instance(far).expect_err("refused");
            }
            region.add_world_tree(TreeKey::default());
            self.refuse(|world| drop(world.add_region(&mut region).expect_err("refused")));
            return;
        }
        let key = self.world.add_region(&mut region).expect("valid");
        let view = self.world.region(key).expect("it lives");
        assert_eq!((view.trees.len(), view.instances.len()), (trees.len(), instances.len()));
        let mut own = Vec::new();
        for (tree, lights) in view.trees.iter().zip(lights) {
            match lights {
                Ok(lights) => {
                    own.push(*tree);
                    self.model.trees.insert(*tree, present(&lights));
                }
                Err(of_world) => assert_eq!(*tree, of_world),
            }
        }
        for (instance, tree) in view.instances.iter().zip(instances) {
            self.model.instances.insert(*instance, (view.trees[tree], Some(key)));
        }
        self.model.regions.insert(key, own);
    }

    fn remove_region(&mut self) {
        let Some(key) = any_of(&mut self.rng, self.model.regions.keys().copied()) else { return };
        let own = self.model.regions[&key].clone();
        let is_outside = |tree: &TreeKey| self.model.instances.values().any(|(of, by)| of == tree && *by != Some(key));
        if own.iter().any(is_outside) {
            let in_use = |error| matches!(error, WorldError::RegionInUse { region, .. } if region == key);
            self.refuse(|world| assert!(in_use(world.remove_region(key).expect_err("it is in use"))));
            return;
        }
        let mut removed = self.world.remove_region(key).expect("it lives").into_iter();
        self.model.regions.remove(&key);
        self.model.instances.retain(|_, (_, region)| *region != Some(key));
        for tree in own {
            let Some(lights) = self.model.trees.remove(&tree) else { continue };
            let tree = removed.next().expect("it is handed back");
            tree.check().expect("sound");
            let held: Vec<_> = tree.lights().iter().filter(|light| !light.is_removed()).collect();
            assert!(held.into_iter().eq(lights.iter().flatten()));
        }
        assert!(removed.next().is_none());
        let trees = &self.model.trees;
        self.model.edits.retain(|edit| trees.contains_key(&edit.tree));
        assert_eq!(self.world.remove_region(key).err(), Some(WorldError::NoSuchRegion(key)));
    }

    fn remove_instance(&mut self) {
        let Some(key) = self.instance() else { return };
        self.world.remove_instance(key).expect("it lives");
        self.model.instances.remove(&key);
    }

    fn remove_tree(&mut self) {
        let Some(key) = self.tree() else { return };
        if self.model.instances.values().any(|(tree, _)| *tree == key) {
            self.refuse(|world| assert!(world.remove_tree(key).is_err()));
            return;
        }
        self.world.remove_tree(key).expect("unused");
        self.model.trees.remove(&key);
        self.model.edits.retain(|edit| edit.tree != key);
    }

    fn make_unique(&mut self) {
        let Some(key) = self.instance() else { return };
        let (tree, region) = self.model.instances[&key];
        let own = self.world.make_unique(key).expect("it lives");
        let sharers = self.model.instances.values().filter(|(of, _)| *of == tree).count();
        assert_eq!(own == tree, sharers == 1);
        if own != tree {
            let lights = self.model.trees[&tree].clone();
            self.model.trees.insert(own, lights);
            let copied: Vec<Edit> = self.model.edits.iter().filter(|edit| edit.tree == tree).cloned().collect();
            self.model.edits.extend(copied.into_iter().map(|edit| Edit { tree: own, ..edit }));
            self.model.instances.insert(key, (own, region));
            if let Some(region) = region {
                self.model.regions.get_mut(&region).expect("it lives").push(own);
            }
        }
    }

    /// Changes, removes or adds a light.
    fn edit(&mut self) {
        let Some(tree) = self.tree() else { return };
        let waits = |light: u32| self.model.edits.iter().rev().find(|edit| (edit.tree, edit.light) == (tree, light));
        let lights = self.model.trees[&tree].iter().zip(0..);
        // Lights without a staged edit.
        let lights: Vec<u32> = lights
            .filter(|(light, index)| light.is_some() && waits(*index).is_none())
            .map(|(_, index)| index)
            .collect();
        let to = lamp(&mut self.rng);
        let light = any_of(&mut self.rng, lights.iter().copied());
        match (self.rng.bits() % 3, light) {
            (0, Some(light)) => {
                self.world.remove_lights(tree, &[light]).expect("a light");
                self.model.edits.push(Edit { tree, light, to: None });
            }
            (1, Some(light)) => {
                self.world.set_lights(tree, &[(light, to)]).expect("a light");
                self.model.edits.push(Edit { tree, light, to: Some(to) });
            }
            _ => {
                let light = self.world.add_lights(tree, &[to]).expect("valid")[0];
                self.model.edits.push(Edit { tree, light, to: Some(to) });
            }
        }
    }

    fn update(&mut self) {
        let micros = [0, 0, 1, 20, 300, 1_000_000][self.rng.bits() as usize % 6];
        self.world.update(FrameBudget::new(std::time::Duration::from_micros(micros)));
        for Edit { tree, light, to } in std::mem::take(&mut self.model.edits) {
            let lights = self.model.trees.get_mut(&tree).expect("edits of removed trees are dropped");
            lights.resize(lights.len().max(light as usize + 1), None);
            lights[light as usize] = to;
        }
        self.check();
    }

    /// Checks that a refused call changes nothing.
    fn refuse(&mut self, call: impl FnOnce(&mut LightWorld)) {
        let state = |world: &LightWorld| {
            let keys = (world.trees().collect::<Vec<_>>(), world.instances().collect::<Vec<_>>());
            let counts = (*world.effect_counts(), world.memory(), world.regions().collect::<Vec<_>>());
            (keys, counts, format!("{world:?}"), world.revision())
        };
        let before = state(&self.world);
        call(&mut self.world);
        assert_eq!(state(&self.world), before);
    }

    /// Checks the world after an update.
    fn check(&mut self) {
        let Self { world, model, rng } = self;
        assert!(world.trees().eq(model.trees.keys().copied()) || world.trees().len() == model.trees.len());
        for (key, lights) in &model.trees {
            let tree = world.tree(*key).expect("it lives");
            tree.check().expect("sound");
            let has = tree.lights().iter().map(|light| (!light.is_removed()).then_some(*light));
            let mut has: Vec<_> = has.collect();
            // Indices whose light was added and removed before an update are vacant.
            has.truncate(lights.len().max(has.iter().rposition(Option::is_some).map_or(0, |last| last + 1)));
            has.resize(lights.len(), None);
            assert_eq!(&has, lights);
        }
        assert!(model.instances.iter().all(|(key, (tree, _))| world.instance(*key).map(|i| i.tree) == Some(*tree)));
        assert_eq!(world.instances().len(), model.instances.len());
        assert!(world.regions().collect::<Vec<_>>().len() == model.regions.len());
        let expected: usize =
            model.instances.values().map(|(tree, _)| model.trees[tree].iter().flatten().count()).sum();
        assert_eq!(world.light_count(), expected);
        let bytes: usize = world.trees().map(|key| world.tree(key).expect("it lives").memory_bytes()).sum();
        assert_eq!(world.memory().trees.total(), bytes);
        let at = ShadingPoint::volume(rng.position(30.0));
        let (mut sum, mut live) = (0.0, 0);
        for (light, pmf) in all_pmfs(&world.sampler(), &at) {
            let LightId::Local { instance, light } = light else { panic!("there is no directional light") };
            let (tree, _) = model.instances[&instance];
            let is_live = model.trees[&tree].get(light as usize).copied().flatten().is_some();
            assert_eq!(pmf > 0.0, is_live, "light {light} of {instance:?}");
            sum += pmf;
            live += usize::from(is_live);
        }
        assert_eq!(live, expected);
        assert!(live == 0 || (sum - 1.0).abs() < SUM_TOLERANCE, "{sum}");
        world.update(FrameBudget::NONE);
    }

    /// Removes everything, and checks that nothing is left.
    fn empty(&mut self) {
        for key in self.model.instances.keys() {
            if self.model.instances[key].1.is_none() {
                self.world.remove_instance(*key).expect("it lives");
            }
        }
        self.model.instances.retain(|_, (_, region)| region.is_some());
        // Regions may use trees of other regions.
        while let Some(key) = self.model.unused_region() {
            drop(self.world.remove_region(key).expect("nothing else uses it"));
            for tree in self.model.regions.remove(&key).expect("it lives") {
                self.model.trees.remove(&tree);
            }
            self.model.instances.retain(|_, (_, region)| *region != Some(key));
        }
        // Two regions may use each other's trees.
        for key in std::mem::take(&mut self.model.instances).into_keys() {
            self.world.remove_instance(key).expect("it lives");
        }
        for (key, own) in std::mem::take(&mut self.model.regions) {
            drop(self.world.remove_region(key).expect("nothing uses it"));
            own.iter().for_each(|tree| drop(self.model.trees.remove(tree)));
        }
        for key in std::mem::take(&mut self.model.trees).into_keys() {
            self.world.remove_tree(key).expect("unused");
        }
        let memory = self.world.memory();
        assert_eq!(memory.total(), memory.tables, "{memory:?}");
        let world = &self.world;
        assert_eq!(
            (world.light_count(), world.trees().len(), world.instances().len(), world.regions().len()),
            (0, 0, 0, 0)
        );
        assert_eq!(*world.effect_counts(), LightWorld::new().effect_counts().to_owned());
        let report = self.world.update(FrameBudget::UNLIMITED);
        assert_eq!((report.waiting_trees, report.rebuilt_trees), (0, 0));
    }

    fn step(&mut self, step: u8) {
        match step {
            0 | 1 => self.add_region(),
            2 => self.remove_region(),
            3 => self.add_tree(),
            4 | 5 => self.add_instance(),
            6 => self.remove_instance(),
            7 => self.remove_tree(),
            8 => self.make_unique(),
            9..12 => self.edit(),
            _ => self.update(),
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 300,
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(59),
        ..ProptestConfig::default()
    })]

    #[test]
    fn a_world_holds_the_lights_of_a_plain_model_whatever_comes_and_goes(
        seed in 0_u64..1_000_000,
        is_background in any::<bool>(),
        steps in proptest::collection::vec(0_u8..14, 1..120),
    ) {
        let mut run = Run { world: LightWorld::new(), model: Model::default(), rng: Rng(seed) };
        run.world.set_background_builds(is_background);
        steps.into_iter().for_each(|step| run.step(step));
        run.update();
        run.empty();
    }
}
