//! Edits of a world. Every call checks first and changes after.

use glam::DVec3;

use super::{Instance, LightWorld, TreeEntry, set_slot};
use crate::effects::Effects;
use crate::error::WorldError;
use crate::keys::{DirectionalKey, InstanceKey, TreeKey, slot_of};
use crate::light::{DirectionalLight, Light};
use crate::placement::{Placed, Placement};
use crate::policy::{AttributeHistory, Policy};
use crate::scheduler::TreeFeatures;
use crate::tree::LightTree;

impl LightWorld {
    /// Builds a tree over lights. It shines nowhere until it has an instance.
    ///
    /// # Errors
    /// [`WorldError::Light`], [`WorldError::TooManyLights`]. O(n log n), on the calling thread and rayon's.
    pub fn add_tree(&mut self, lights: Vec<Light>) -> Result<TreeKey, WorldError> {
        let tree = LightTree::new(lights)?;
        Ok(self.insert_tree(tree))
    }

    fn insert_tree(&mut self, tree: LightTree) -> TreeKey {
        self.effects.change(|counts| counts.add_all(tree.effects()));
        let key = self.trees.insert(TreeEntry::new(tree, self.schedule.frame));
        self.wake(key);
        set_slot(&mut self.tree_slots, slot_of(key), Some(key));
        self.changes.tree(slot_of(key));
        key
    }

    /// Removes a tree that has no instances.
    ///
    /// # Errors
    /// [`WorldError::NoSuchTree`], [`WorldError::TreeInUse`].
    pub fn remove_tree(&mut self, tree: TreeKey) -> Result<(), WorldError> {
        let instances = self.entry(tree)?.instances.len();
        if instances > 0 {
            return Err(WorldError::TreeInUse { tree, instances });
        }
        self.let_rest(tree);
        self.withdraw_request(tree);
        self.remove_weight(tree);
        if let Some(entry) = self.trees.remove(tree) {
            self.effects.change(|counts| counts.remove_all(entry.tree.effects()));
        }
        self.edited.retain(|k| *k != tree);
        set_slot(&mut self.tree_slots, slot_of(tree), None);
        self.changes.tree(slot_of(tree));
        Ok(())
    }

    /// Changes some lights of a tree, for all its instances, at the next [`LightWorld::update`].
    ///
    /// # Errors
    /// [`WorldError::NoSuchTree`], [`WorldError::StaticTree`], [`WorldError::NoSuchLight`], [`WorldError::Light`].
    pub fn set_lights(&mut self, tree: TreeKey, changes: &[(u32, Light)]) -> Result<(), WorldError> {
        let entry = self.trees.get_mut(tree).ok_or(WorldError::NoSuchTree(tree))?;
        entry.tree.check_changes(changes)?;
        if entry.is_static() {
            return Err(WorldError::StaticTree(tree));
        }
        if changes.is_empty() {
            return Ok(());
        }
        entry.staged.extend_from_slice(changes);
        if !entry.is_edited {
            entry.is_edited = true;
            self.edited.push(tree);
        }
        Ok(())
    }

    /// Gives a tree other lights, any number of them, and builds it at once. Staged changes are dropped.
    ///
    /// # Errors
    /// As [`LightWorld::add_tree`], [`WorldError::NoSuchTree`], [`WorldError::StaticTree`].
    pub fn replace_lights(&mut self, tree: TreeKey, lights: Vec<Light>) -> Result<(), WorldError> {
        if self.entry(tree)?.is_static() {
            return Err(WorldError::StaticTree(tree));
        }
        let built = LightTree::new(lights)?;
        let entry = &mut self.trees[tree];
        self.light_count -= entry.tree.lights().len() * entry.instances.len();
        self.light_count += built.lights().len() * entry.instances.len();
        self.effects.change(|counts| {
            counts.add_all(built.effects());
            counts.remove_all(entry.tree.effects());
        });
        entry.history = AttributeHistory::start(built.attributes());
        entry.rebuild_state.start(TreeFeatures::of(&built), self.schedule.frame);
        entry.tree = built;
        entry.staged.clear();
        if std::mem::take(&mut entry.is_edited) {
            self.edited.retain(|key| *key != tree);
        }
        self.withdraw_request(tree);
        self.cancel_build(tree);
        self.has_moved(tree);
        self.changes.tree(slot_of(tree));
        self.top.take();
        Ok(())
    }

    /// Places a tree in the world.
    ///
    /// # Errors
    /// [`WorldError::NoSuchTree`], [`WorldError::Placement`], [`WorldError::Policy`].
    pub fn add_instance(
        &mut self,
        tree: TreeKey,
        placement: impl Into<Placement>,
        policy: Policy,
    ) -> Result<InstanceKey, WorldError> {
        self.entry(tree)?;
        policy.validate()?;
        let placement = placement.into();
        let placed = Placed::new(&placement, self.origin)?;
        self.effects.change(|counts| counts.add(placed.effects()));
        let key = self.instances.insert(Instance { tree, placement, policy, placed, place: 0 });
        set_slot(&mut self.slots, slot_of(key), Some(key));
        self.attach(key, tree, policy);
        self.instance_changed(key);
        Ok(key)
    }

    /// Moves an instance.
    ///
    /// # Errors
    /// [`WorldError::NoSuchInstance`], [`WorldError::Placement`].
    pub fn move_instance(&mut self, key: InstanceKey, placement: impl Into<Placement>) -> Result<(), WorldError> {
        let origin = self.origin;
        let instance = self.instances.get_mut(key).ok_or(WorldError::NoSuchInstance(key))?;
        let placement = placement.into();
        if placement == instance.placement {
            return Ok(());
        }
        let former = std::mem::replace(&mut instance.placed, Placed::new(&placement, origin)?).effects();
        let present = instance.placed.effects();
        instance.placement = placement;
        if former != present {
            self.effects.change(|counts| {
                counts.add(present);
                counts.remove(former);
            });
        }
        self.instance_changed(key);
        Ok(())
    }

    /// Removes an instance; its tree stays.
    ///
    /// # Errors
    /// [`WorldError::NoSuchInstance`].
    pub fn remove_instance(&mut self, key: InstanceKey) -> Result<(), WorldError> {
        let instance = self.instances.remove(key).ok_or(WorldError::NoSuchInstance(key))?;
        self.effects.change(|counts| counts.remove(instance.placed.effects()));
        set_slot(&mut self.slots, slot_of(key), None);
        self.detach(instance.tree, instance.place, instance.policy);
        self.instance_changed(key);
        Ok(())
    }

    /// Changes what an instance wants for its tree.
    ///
    /// # Errors
    /// [`WorldError::NoSuchInstance`], [`WorldError::Policy`].
    pub fn set_policy(&mut self, key: InstanceKey, policy: Policy) -> Result<(), WorldError> {
        policy.validate()?;
        let instance = self.instances.get_mut(key).ok_or(WorldError::NoSuchInstance(key))?;
        let former = std::mem::replace(&mut instance.policy, policy);
        let tree = instance.tree;
        let entry = &mut self.trees[tree];
        entry.remove_policy(former);
        entry.add_policy(policy);
        // It may be worse than the new policy allows. Those that always rebuild wait for their lights to change.
        if policy.may_rebuild() && policy != Policy::AlwaysRebuild && !entry.is_edited {
            entry.is_edited = true;
            self.edited.push(tree);
        }
        Ok(())
    }

    /// Gives an instance a tree of its own, a copy of the one it shares; does nothing if it shares it with no other.
    ///
    /// # Errors
    /// [`WorldError::NoSuchInstance`].
    pub fn make_unique(&mut self, key: InstanceKey) -> Result<TreeKey, WorldError> {
        let instance = self.instances.get(key).ok_or(WorldError::NoSuchInstance(key))?;
        let (shared, place, policy) = (instance.tree, instance.place, instance.policy);
        let entry = &self.trees[shared];
        if entry.instances.len() == 1 {
            return Ok(shared);
        }
        let copy = entry.tree.clone();
        let (history, staged, rebuild_state) = (entry.history, entry.staged.clone(), entry.rebuild_state.for_copy());
        let own = self.insert_tree(copy);
        if !staged.is_empty() {
            self.edited.push(own);
        }
        let entry = &mut self.trees[own];
        entry.history = history;
        entry.rebuild_state = rebuild_state;
        entry.is_edited = !staged.is_empty();
        entry.staged = staged;
        self.detach(shared, place, policy);
        self.attach(key, own, policy);
        self.instances[key].tree = own;
        self.instance_changed(key);
        let rebuild_state = &self.trees[shared].rebuild_state;
        if rebuild_state.waiting.is_some() || rebuild_state.build_id.is_some() {
            // It is as bad as the one that it was copied from.
            self.update_request(own);
        }
        Ok(own)
    }

    /// Adds a light at infinity.
    ///
    /// # Errors
    /// [`WorldError::Light`].
    pub fn add_directional(&mut self, light: DirectionalLight) -> Result<DirectionalKey, WorldError> {
        check_directional(&light)?;
        self.changes.directionals = true;
        self.effects.change(|counts| counts.add(Effects::DIRECTIONAL));
        Ok(self.directionals.insert(light))
    }

    /// Changes a light at infinity.
    ///
    /// # Errors
    /// [`WorldError::NoSuchDirectional`], [`WorldError::Light`].
    pub fn set_directional(&mut self, key: DirectionalKey, light: DirectionalLight) -> Result<(), WorldError> {
        check_directional(&light)?;
        let present = self.directionals.get_mut(key).ok_or(WorldError::NoSuchDirectional(key))?;
        if *present != light {
            *present = light;
            self.changes.directionals = true;
        }
        Ok(())
    }

    /// Removes a light at infinity.
    ///
    /// # Errors
    /// [`WorldError::NoSuchDirectional`].
    pub fn remove_directional(&mut self, key: DirectionalKey) -> Result<(), WorldError> {
        self.directionals.remove(key).ok_or(WorldError::NoSuchDirectional(key))?;
        self.changes.directionals = true;
        self.effects.change(|counts| counts.remove(Effects::DIRECTIONAL));
        Ok(())
    }

    /// Moves the point that sampling coordinates are relative to, say to where the camera is by now. Instances stay
    /// where they are in the world. O(instances), and every instance is uploaded anew: once a kilometre, not once a
    /// frame.
    ///
    /// # Errors
    /// [`WorldError::Placement`] if an instance would be too far from the new origin.
    pub fn set_origin(&mut self, origin: DVec3) -> Result<(), WorldError> {
        if origin == self.origin {
            return Ok(());
        }
        let placed: Vec<Placed> =
            self.instances.values().map(|i| Placed::new(&i.placement, origin)).collect::<Result<_, _>>()?;
        for (instance, placed) in self.instances.values_mut().zip(placed) {
            instance.placed = placed;
        }
        self.origin = origin;
        for key in self.instances.keys() {
            self.changes.instance(slot_of(key));
        }
        self.top.take();
        Ok(())
    }

    pub(super) fn entry(&self, tree: TreeKey) -> Result<&TreeEntry, WorldError> {
        self.trees.get(tree).ok_or(WorldError::NoSuchTree(tree))
    }

    fn attach(&mut self, key: InstanceKey, tree: TreeKey, policy: Policy) {
        let entry = &mut self.trees[tree];
        self.instances[key].place = entry.instances.len();
        entry.instances.push(key);
        entry.add_policy(policy);
        self.light_count += entry.tree.lights().len();
    }

    /// Takes the instance at `place` off its tree's list, in O(1): the last of the list takes the place.
    fn detach(&mut self, tree: TreeKey, place: usize, policy: Policy) {
        let entry = &mut self.trees[tree];
        entry.instances.swap_remove(place);
        if let Some(moved) = entry.instances.get(place) {
            self.instances[*moved].place = place;
        }
        entry.remove_policy(policy);
        self.light_count -= entry.tree.lights().len();
    }

    fn instance_changed(&mut self, key: InstanceKey) {
        self.changes.moved(slot_of(key));
        self.top.take();
    }
}

fn check_directional(light: &DirectionalLight) -> Result<(), WorldError> {
    light.validate().map_err(|source| WorldError::Light { index: 0, source })
}
