//! Edits of a world. Every call checks its input first and changes the world after.

use glam::Vec3;

use super::delta::Delta;
use super::log::InstanceChange;
use super::rest::Rest;
use super::scene::Requests;
use super::{Instance, LightWorld, TreeEntry};
use crate::effects::{EffectCounts, Effects};
use crate::error::WorldError;
use crate::instance::placement::{Placed, Placement};
use crate::keys::{DirectionalKey, InstanceKey, TreeKey};
use crate::light::{DirectionalLight, Light};
use crate::policy::{AttributeHistory, Policy};
use crate::rare::Rare;
use crate::scheduler::TreeFeatures;
use crate::tree::{LightTree, check_distinct, check_light_count, check_lights};

impl LightWorld {
    /// Takes a tree, which contributes nothing until it has an instance.
    ///
    /// | how the tree was made | what it is |
    /// |---|---|
    /// | [`LightTree::new`] | built over lights, on the calling thread and rayon's |
    /// | [`LightTree::new_for`] | built for a first instance that is scaled |
    /// | `LightTree::from_baked` | loaded from bytes |
    /// | on another thread, or removed from another world | any of these |
    ///
    /// The tree is moved in and used as it is: nothing is built or copied. A clone that is added
    /// too is a second tree, which knows nothing of the first. The present attributes of the tree
    /// count as those of a fresh build, also if it has degraded over refits. If its lights have
    /// changed since its last refit, it is refitted at once.
    ///
    /// O(1), but for that refit. Adding its first instance may build it again if that instance is
    /// stretched: see [`LightTree::new_for`].
    pub fn add_tree(&mut self, mut tree: LightTree) -> TreeKey {
        tree.refit_changes();
        self.insert_tree(TreeEntry::new(tree))
    }

    /// Takes a tree whose nodes are up to date. O(1).
    fn insert_tree(&mut self, entry: TreeEntry) -> TreeKey {
        let (features, lights) = (TreeFeatures::of(&entry.tree), entry.tree.light_count());
        let key = self.scene.trees.insert(TreeEntry { rest: Rest::since(&self.rest), ..entry });
        self.rebuilds.scheduler.add(key, features, lights);
        self.record(Delta::Tree(key, &EffectCounts::default()));
        key
    }

    /// Removes a tree that has no instances. O(1), but for the memory that is freed.
    ///
    /// # Errors
    /// [`WorldError::NoSuchTree`], [`WorldError::TreeInUse`].
    pub fn remove_tree(&mut self, tree: TreeKey) -> Result<(), WorldError> {
        let instances = self.entry(tree)?.instances.len();
        if instances > 0 {
            return Err(WorldError::TreeInUse { tree, instances });
        }
        self.take_tree(tree);
        Ok(())
    }

    /// Takes a live tree without instances out of the world. O(1), but for small memory that is freed.
    pub(super) fn take_tree(&mut self, key: TreeKey) -> LightTree {
        let build = self.rebuilds.take_long_build(key);
        self.rebuilds.scheduler.remove(key);
        let mut entry = self.scene.trees.remove(key).expect("a live tree");
        self.rebuilds.weights.remove(&entry);
        if let Some(source) = &entry.source {
            self.scene.sources[source.number as usize] = None;
        }
        self.record(Delta::RemovedTree(key, &entry));
        let tree = std::mem::take(&mut entry.tree);
        self.rebuilds.long_builder.free((entry, build), tree.nodes().len());
        tree
    }

    /// Changes some lights of a tree, for all its instances, at the next [`LightWorld::update`].
    ///
    /// `changes` are pairs of a light's index and its new value. Of several values for one light,
    /// in one call or in several, the last one counts. A value that equals the light's present one
    /// changes nothing; if all do, the tree is neither refitted nor uploaded. O(changes). Memory:
    /// at most one value for each light of the tree.
    ///
    /// # Errors
    /// [`WorldError::NoSuchTree`], [`WorldError::StaticTree`], [`WorldError::NoSuchLight`],
    /// [`WorldError::RemovedLight`], [`WorldError::Entry`].
    pub fn set_lights(&mut self, tree: TreeKey, changes: &[(u32, Light)]) -> Result<(), WorldError> {
        self.stage_lights(tree, changes.iter().map(|(index, light)| (*index, light)))
    }

    /// [`LightWorld::set_lights`] for the consecutive lights from index `first` on.
    ///
    /// # Errors
    /// As [`LightWorld::set_lights`].
    pub fn set_light_range(&mut self, tree: TreeKey, first: u32, lights: &[Light]) -> Result<(), WorldError> {
        self.stage_lights(tree, lights.iter().zip(0..).map(|(light, i)| (first.saturating_add(i), light)))
    }

    /// Adds lights to a tree, for all its instances, at the next [`LightWorld::update`]. Returns
    /// their indices, in the order of the lights. They may be passed to the other calls at once.
    ///
    /// The indices of other lights never change. Indices of lights that were removed are used again,
    /// the least first, but never in the update that removes the light: see
    /// [`LightWorld::removed_lights`].
    ///
    /// Each light is put near others, and the nodes above it are refitted. The tree's policies judge by
    /// its attributes whether it needs a rebuild, as after changes of lights. These trees are built
    /// again in the update: those that are divided into sides, which have at most 256 lights; those of
    /// which more than a tenth comes and goes in one update; and those that have grown to twice their
    /// lights without a rebuild. O(lights); the update then takes O(depth) for
    /// each light, and amortised the build of O(log n) lights.
    ///
    /// # Errors
    /// [`WorldError::NoSuchTree`], [`WorldError::StaticTree`], [`WorldError::Entry`] with an index in
    /// `lights`, [`WorldError::Value`] for more than [`MAX_LIGHTS`](crate::tree::MAX_LIGHTS)
    /// indices.
    pub fn add_lights(&mut self, tree: TreeKey, lights: &[Light]) -> Result<Vec<u32>, WorldError> {
        self.editable(tree)?;
        check_lights(lights.iter().enumerate())?;
        let entry = &mut self.scene.trees[tree];
        check_light_count(entry.staged.index_count_with(lights.len(), &entry.tree))?;
        let indices = lights.iter().map(|light| entry.staged.add(*light, &entry.tree)).collect();
        self.await_update(tree);
        Ok(indices)
    }

    /// Removes lights of a tree, for all its instances, at the next [`LightWorld::update`]. Changes
    /// of these lights that wait for that update are dropped. A light that was added since the last
    /// update may be removed too; the tree never has it then.
    ///
    /// Until the update, calls refuse the indices, and sampling still finds the lights. After it
    /// their probability is 0. The indices of other lights never change. The nodes above a removed
    /// light are refitted; a tree that is divided into sides, which has at most 256 lights, is built
    /// again. O(lights); the update then takes O(depth) for each light.
    ///
    /// # Errors
    /// [`WorldError::NoSuchTree`], [`WorldError::StaticTree`], [`WorldError::NoSuchLight`],
    /// [`WorldError::RemovedLight`] for a light that was removed, or that occurs twice in `lights`.
    pub fn remove_lights(&mut self, tree: TreeKey, lights: &[u32]) -> Result<(), WorldError> {
        let removed = lights.iter().map(|index| (*index, &Light::REMOVED));
        let entry = self.editable(tree)?;
        entry.staged.check_indices(lights.iter().copied(), &entry.tree)?;
        check_distinct(lights)?;
        self.stage_checked_lights(tree, removed);
        Ok(())
    }

    /// The lights that the last [`LightWorld::update`] removed from trees, as
    /// [`LightWorld::remove_lights`] asked for.
    ///
    /// An index in this list is not used again before the next update. So a renderer that keeps
    /// lights over frames, for reservoirs or caches, drops those in this list after each update, and
    /// never takes a new light for an old one. Calls that replace or remove whole trees or instances
    /// are not listed.
    pub fn removed_lights(&self) -> &[(TreeKey, u32)] {
        &self.edits.removed
    }

    /// The lights that the last [`LightWorld::update`] added to trees, as
    /// [`LightWorld::add_lights`] asked for.
    pub fn added_lights(&self) -> &[(TreeKey, u32)] {
        &self.edits.added
    }

    /// Changes the emission of one light of a tree, in the unit of [`Light::emission`], for all
    /// instances of the tree, at the next [`LightWorld::update`]. A change of the same light that
    /// waits for that update keeps its other properties. O(1).
    ///
    /// # Errors
    /// As [`LightWorld::set_lights`].
    pub fn set_emission(&mut self, tree: TreeKey, light: u32, emission: Vec3) -> Result<(), WorldError> {
        let entry = self.entry(tree)?;
        let lights = entry.tree.lights();
        entry.staged.check_indices(std::iter::once(light), &entry.tree)?;
        let present = entry.staged.get(light).unwrap_or_else(|| &lights[light as usize]);
        let changed = Light { emission, ..*present };
        self.stage_lights(tree, std::iter::once((light, &changed)))
    }

    /// Checks changes of lights, and stages them.
    fn stage_lights<'a>(
        &mut self,
        tree: TreeKey,
        changes: impl Iterator<Item = (u32, &'a Light)> + Clone,
    ) -> Result<(), WorldError> {
        let entry = self.editable(tree)?;
        entry.staged.check_indices(changes.clone().map(|(index, _)| index), &entry.tree)?;
        check_lights(changes.clone().map(|(index, light)| (index as usize, light)))?;
        self.stage_checked_lights(tree, changes);
        Ok(())
    }

    /// Stages changes of lights that have been checked.
    fn stage_checked_lights<'a>(&mut self, tree: TreeKey, changes: impl Iterator<Item = (u32, &'a Light)>) {
        let entry = &mut self.scene.trees[tree];
        for (index, light) in changes {
            entry.staged.set(index, *light, entry.tree.lights());
        }
        self.await_update(tree);
    }

    /// Replaces all lights of a tree by any number of others, and builds the tree at once. Changes
    /// that wait for the next update are dropped, and so are lights that wait to be added. The new
    /// lights have the indices of the list. O(n log n).
    ///
    /// # Errors
    /// [`WorldError::NoSuchTree`], [`WorldError::StaticTree`], [`WorldError::Entry`],
    /// [`WorldError::Value`].
    pub fn replace_lights(&mut self, tree: TreeKey, lights: Vec<Light>) -> Result<(), WorldError> {
        let reference = self.editable(tree)?.tree.reference().copied();
        let built = LightTree::with_reference(lights, reference)?;
        self.exchange(tree, built);
        Ok(())
    }

    /// Replaces a tree by one that was made elsewhere, of any number of lights, and returns the
    /// former one. Changes that wait for the next update are dropped.
    ///
    /// The given tree is moved in as by [`LightWorld::add_tree`]: nothing is built. If it was not
    /// made for a scaled instance, later builds divide it as they would have divided the former
    /// tree. To free the memory of a large tree takes milliseconds: drop the former one on another
    /// thread.
    ///
    /// O(instances of the tree), but for a refit as in [`LightWorld::add_tree`].
    ///
    /// # Errors
    /// [`WorldError::NoSuchTree`], [`WorldError::StaticTree`]. The given tree is dropped.
    pub fn replace_tree(&mut self, tree: TreeKey, mut by: LightTree) -> Result<LightTree, WorldError> {
        let entry = self.editable(tree)?;
        if by.reference().is_none() {
            by.set_reference(entry.tree.reference().copied());
        }
        by.refit_changes();
        Ok(self.exchange(tree, by))
    }

    /// Puts a tree whose nodes are up to date in the place of another one, which is returned.
    pub(super) fn exchange(&mut self, tree: TreeKey, by: LightTree) -> LightTree {
        self.cancel_build(tree);
        let entry = &mut self.scene.trees[tree];
        entry.births.lights = Rare::default();
        entry.births.replaced = self.scene.births.next();
        entry.requests.history = AttributeHistory::start(by.attributes());
        entry.staged = Rare::default();
        entry.requests.has_new_policy = false;
        self.rebuilds.scheduler.was_replaced(tree, TreeFeatures::of(&by), by.light_count());
        let former = std::mem::replace(&mut entry.tree, by);
        self.has_moved(tree);
        self.record(Delta::OtherTree(tree, former.effects()));
        self.open_replaced(tree);
        former
    }

    /// Adds an instance of a tree to the world. A linear part without inverse hides it, see
    /// [`Placement::linear`].
    ///
    /// O(1), but for the only instance of a tree of more than eight lights if it is stretched, by a
    /// factor of 1.5 or more between two directions, or if it changes areas by 1.5 or more and the
    /// tree has both surfaces and lights without size. The tree is then built again, as its lights
    /// are in the world: O(n log n).
    ///
    /// # Errors
    /// [`WorldError::NoSuchTree`], [`WorldError::Value`].
    pub fn add_instance(
        &mut self,
        tree: TreeKey,
        placement: impl Into<Placement>,
        policy: Policy,
    ) -> Result<InstanceKey, WorldError> {
        self.entry(tree)?;
        policy.validate()?;
        let placement = placement.into();
        let placed = Placed::new(&placement)?;
        Ok(self.insert_instance(Instance::new(tree, placement, policy, placed)))
    }

    /// Adds an instance that has been checked. O(1), but for a build of its tree if it is the first
    /// one.
    pub(super) fn insert_instance(&mut self, instance: Instance) -> InstanceKey {
        let key = self.insert_as_is(instance);
        self.build_for_first(key);
        self.open_if_due(self.scene.instances[key].tree, false);
        key
    }

    /// Adds an instance that has been checked, and leaves its tree as it is: neither built for it nor
    /// opened. O(1).
    pub(super) fn insert_as_is(&mut self, mut instance: Instance) -> InstanceKey {
        instance.birth = self.scene.births.next();
        let tree = instance.tree;
        let key = self.scene.instances.insert(instance);
        self.attach(key, tree);
        self.record(Delta::Instance(key, InstanceChange::Added));
        key
    }

    /// Removes an instance; its tree stays. O(1).
    ///
    /// # Errors
    /// [`WorldError::NoSuchInstance`].
    pub fn remove_instance(&mut self, key: InstanceKey) -> Result<(), WorldError> {
        let instance = self.scene.instances.remove(key).ok_or(WorldError::NoSuchInstance(key))?;
        self.scene.sky.take_if(|(sky, _)| *sky == key);
        self.detach(&instance);
        self.record(Delta::RemovedInstance(key, &instance));
        Ok(())
    }

    /// Changes the policy of an instance. The next [`LightWorld::update`] decides by the new
    /// policy whether its tree requests a rebuild; nothing is refitted or uploaded for that. A
    /// policy that equals the present one changes nothing.
    ///
    /// A tree whose attributes were not measured before, because no policy could request a
    /// rebuild, is measured in that update: O(nodes), once. With [`Policy::AlwaysRebuild`] the tree
    /// waits for its lights to change.
    ///
    /// # Errors
    /// [`WorldError::NoSuchInstance`], [`WorldError::Value`].
    pub fn set_policy(&mut self, key: InstanceKey, policy: Policy) -> Result<(), WorldError> {
        policy.validate()?;
        let instance = self.scene.instances.get_mut(key).ok_or(WorldError::NoSuchInstance(key))?;
        if policy == instance.policy {
            return Ok(());
        }
        let former = std::mem::replace(&mut instance.policy, policy);
        let tree = instance.tree;
        let entry = &mut self.scene.trees[tree];
        entry.requests.policies.remove(former);
        entry.requests.policies.insert(policy);
        if policy.may_rebuild() && policy != Policy::AlwaysRebuild {
            entry.requests.has_new_policy = true;
            self.await_update(tree);
        }
        self.forget_requests_that_no_policy_allows(tree);
        Ok(())
    }

    /// Gives an instance a tree of its own, a copy of the tree that it shares, and returns the key
    /// of the copy. Returns the key of the present tree if the instance shares it with no other.
    /// Changes that wait for the next update are copied too. O(lights).
    ///
    /// # Errors
    /// [`WorldError::NoSuchInstance`].
    pub fn make_unique(&mut self, key: InstanceKey) -> Result<TreeKey, WorldError> {
        let instance = self.scene.instances.get(key).ok_or(WorldError::NoSuchInstance(key))?.clone();
        let shared = instance.tree;
        let entry = &self.scene.trees[shared];
        if entry.instances.len() == 1 {
            return Ok(shared);
        }
        let Requests { history, has_new_policy, .. } = entry.requests;
        let own = self.insert_tree(TreeEntry {
            births: entry.births.clone(),
            requests: Requests { history, has_new_policy, ..Requests::default() },
            staged: entry.staged.clone(),
            ..TreeEntry::new(entry.tree.clone())
        });
        self.await_update(own);
        self.rebuilds.scheduler.copy(shared, own);
        self.detach(&instance);
        self.record(Delta::Counts(shared));
        self.scene.instances[key].tree = own;
        self.attach(key, own);
        if let Some(region) = instance.region {
            self.regions[region].own_trees.push(own);
        }
        self.record(Delta::Instance(key, InstanceChange::Shown));
        self.open_if_due(own, false);
        if self.rebuilds.scheduler.waits(shared) || self.scene.trees[shared].successor.is_some() {
            // The copy needs a rebuild as much as the tree that it was copied from.
            self.rebuilds.update_request(own, &mut self.scene);
        }
        Ok(own)
    }

    /// Adds a directional light. A few are meant, such as sun and moon: each choice of a light weighs all of
    /// them, in linear time.
    ///
    /// # Errors
    /// [`WorldError::Value`].
    pub fn add_directional(&mut self, light: DirectionalLight) -> Result<DirectionalKey, WorldError> {
        check_directional(&light)?;
        let key = self.scene.directionals.insert(light);
        self.record(Delta::Directionals);
        Ok(key)
    }

    /// Changes a directional light, at once. A value that equals the present one changes nothing.
    ///
    /// # Errors
    /// [`WorldError::NoSuchDirectional`], [`WorldError::Value`].
    pub fn set_directional(&mut self, key: DirectionalKey, light: DirectionalLight) -> Result<(), WorldError> {
        check_directional(&light)?;
        let present = self.scene.directionals.get_mut(key).ok_or(WorldError::NoSuchDirectional(key))?;
        if *present != light {
            *present = light;
            self.record(Delta::Directionals);
        }
        Ok(())
    }

    /// Removes a directional light.
    ///
    /// # Errors
    /// [`WorldError::NoSuchDirectional`].
    pub fn remove_directional(&mut self, key: DirectionalKey) -> Result<(), WorldError> {
        self.scene.directionals.remove(key).ok_or(WorldError::NoSuchDirectional(key))?;
        self.record(Delta::Directionals);
        Ok(())
    }

    /// Sets whether rectangles and triangles that are large or near are sampled uniformly by the
    /// solid angle that they subtend, in steradians, instead of by area. Off at first.
    ///
    /// Turn it on for worlds in which panels, screens or windows light surfaces that are about as
    /// near as the panels are wide. There sampling by area is noisy: for a square of one metre and
    /// surfaces that face it, the relative variance of a sample falls from 0.03 to 0.002 at a
    /// distance of 1 m, from 0.95 to 0.04 at 0.3 m, and from 11 to 0.16 at 0.1 m. Where the horizon
    /// of the surface cuts the panel, it may rise by 15 %, or 35 % for a narrow strip. The choice
    /// follows from the shading point and the light: surfaces whose squared edges add up to less
    /// than half of the squared distance of their centre are sampled by area, with the same bits as
    /// when this is off.
    ///
    /// A point on a near surface takes 0.2 µs (triangle) or 0.3 µs (rectangle) more on the CPU. On
    /// the GPU only shaders that have [`Effects::SOLID_ANGLES`], which this setting adds to
    /// [`LightWorld::effects`], contain the code. Takes effect at once on the CPU and with the next
    /// upload on the GPU, which sends 64 bytes for it. Probabilities of lights do not change.
    /// `LightSampler::pdf` and `light_pdf` follow the setting.
    ///
    /// Source: Arvo, Stratified Sampling of Spherical Triangles (1995).
    pub fn set_solid_angle_sampling(&mut self, is_on: bool) {
        self.record(Delta::Switch(Effects::SOLID_ANGLES, is_on));
    }

    /// Sets whether shaders that are made for this world's [`LightWorld::effects`] choose lights by
    /// the [`Gloss`](crate::Gloss) of `light_glossy_point`. Off at first.
    ///
    /// Turn it on for scenes with wet streets, polished floors or metal, which reflect a few lights
    /// far more strongly than all others: there the noise of one sample falls to a fifth and less.
    /// It adds [`Effects::GLOSSY`]; nothing is uploaded. Shaders without that effect treat glossy
    /// points as matte ones. [`LightSampler`](crate::LightSampler) does not need the setting: it
    /// always follows [`ShadingPoint::gloss`](crate::ShadingPoint::gloss).
    pub fn set_glossy_sampling(&mut self, is_on: bool) {
        self.record(Delta::Switch(Effects::GLOSSY, is_on));
    }

    /// Sets whether shaders that are made for this world's [`LightWorld::effects`] choose lights
    /// for the segments of `light_segment`. Off at first.
    ///
    /// Turn it on for fog and other media that scatter light into camera rays. It adds
    /// [`Effects::SEGMENTS`]; nothing is uploaded. Shaders without that effect treat a segment as
    /// the point in its middle. [`LightSampler`](crate::LightSampler) does not need the setting: it
    /// always follows [`ShadingPoint::segment`](crate::ShadingPoint::segment).
    pub fn set_segment_sampling(&mut self, is_on: bool) {
        self.record(Delta::Switch(Effects::SEGMENTS, is_on));
    }

    pub(super) fn entry(&self, tree: TreeKey) -> Result<&TreeEntry, WorldError> {
        self.scene.trees.get(tree).ok_or(WorldError::NoSuchTree(tree))
    }

    /// A tree whose lights may change.
    fn editable(&self, tree: TreeKey) -> Result<&TreeEntry, WorldError> {
        let entry = self.entry(tree)?;
        if entry.is_static() { Err(WorldError::StaticTree(tree)) } else { Ok(entry) }
    }

    /// Lets the next update look at a tree, because edits of its lights, another policy or a build wait. O(1).
    pub(super) fn await_update(&mut self, tree: TreeKey) {
        if !std::mem::replace(&mut self.scene.trees[tree].is_pending, true) {
            self.edits.pending.push(tree);
        }
    }

    /// Puts an instance on the list of its tree.
    fn attach(&mut self, key: InstanceKey, tree: TreeKey) {
        let (entry, instance) = (&mut self.scene.trees[tree], &mut self.scene.instances[key]);
        instance.index_in_tree = entry.instances.len() as u32;
        if entry.instances.is_empty() {
            // Most trees of large worlds have one instance.
            entry.instances.reserve_exact(1);
        }
        entry.instances.push(key);
        entry.requests.policies.insert(instance.policy);
    }

    /// Removes an instance from the list of its tree; the last instance of the list takes its index. O(1).
    fn detach(&mut self, instance: &Instance) {
        let entry = &mut self.scene.trees[instance.tree];
        entry.instances.swap_remove(instance.index_in_tree as usize);
        if let Some(moved) = entry.instances.get(instance.index_in_tree as usize) {
            self.scene.instances[*moved].index_in_tree = instance.index_in_tree;
        }
        entry.requests.policies.remove(instance.policy);
        self.forget_requests_that_no_policy_allows(instance.tree);
    }

    /// Withdraws the request of a tree, and drops its long build, if none of its policies can
    /// request a rebuild any more.
    fn forget_requests_that_no_policy_allows(&mut self, tree: TreeKey) {
        if !self.scene.trees[tree].may_rebuild() {
            self.rebuilds.scheduler.withdraw(tree);
            self.cancel_build(tree);
        }
    }
}

fn check_directional(light: &DirectionalLight) -> Result<(), WorldError> {
    Ok(light.validate()?)
}
