//! What follows from a change of the world. Every edit states once, as a [`Delta`], what it has changed. The sums, the
//! counts of effects, the log of changes, the crowds and the top level follow that here, and nowhere else.

use super::log::InstanceChange;
use super::{Instance, LightWorld, TreeEntry};
use crate::effects::{EffectCounts, Effects};
use crate::keys::{InstanceKey, TreeKey, slot_of};

/// A change that was made to the scene of a world.
pub(super) enum Delta<'a> {
    /// A tree is new, or some of its nodes, lights and openings changed, as its own log says. With the effects that its
    /// lights had.
    Tree(TreeKey, &'a EffectCounts),
    /// All nodes of a tree, which was built anew, or who writes its lights.
    WholeTree(TreeKey),
    /// Another tree is in the place of one whose lights had these effects.
    OtherTree(TreeKey, &'a EffectCounts),
    /// A tree without instances was removed.
    RemovedTree(TreeKey, &'a TreeEntry),
    /// What is counted of a tree: its instances, whether it moves, is built, or waits.
    Counts(TreeKey),
    Instance(InstanceKey, InstanceChange),
    RemovedInstance(InstanceKey, &'a Instance),
    /// A directional light was added, changed or removed.
    Directionals,
    /// The map of the sky, or the portals.
    Sky,
    /// An effect that only the world itself has was switched on or off.
    Switch(Effects, bool),
    /// The origin, or how it moves.
    Origin,
}

impl LightWorld {
    /// Lets all that follow the world follow a change.
    pub(super) fn record(&mut self, delta: Delta<'_>) {
        match delta {
            Delta::Tree(tree, former) => self.record_tree(tree, former),
            Delta::WholeTree(tree) => {
                let entry = &mut self.scene.trees[tree];
                entry.log.restart();
                let effects = *entry.tree.effects();
                self.record_tree(tree, &effects);
            }
            Delta::OtherTree(tree, former) => {
                let entry = &mut self.scene.trees[tree];
                entry.log.restart();
                entry.instances.iter().for_each(|key| self.log.instance(slot_of(*key), InstanceChange::Altered));
                self.record_tree(tree, former);
                self.crowds.look_at_soon(tree);
            }
            Delta::RemovedTree(tree, entry) => {
                self.sums.remove(&entry.counted);
                self.effects.set(Effects::MOVING, self.sums.moving);
                self.effects.replace(entry.tree.effects(), &EffectCounts::default());
                self.log.tree(slot_of(tree));
            }
            Delta::Counts(tree) => self.recount(tree),
            Delta::Instance(key, change) => {
                let instance = &mut self.scene.instances[key];
                let (tree, present) = (instance.tree, instance.effects());
                let former = std::mem::replace(&mut instance.counted, present);
                self.record_instance(key, change, [former, present]);
                if matches!(change, InstanceChange::Added | InstanceChange::Shown) {
                    self.recount(tree);
                }
            }
            Delta::RemovedInstance(key, instance) => {
                self.record_instance(key, InstanceChange::Removed, [instance.counted, Effects::empty()]);
                self.recount(instance.tree);
            }
            Delta::Directionals => {
                self.effects.set(Effects::DIRECTIONAL, self.scene.directionals.len());
                self.log.directionals();
            }
            Delta::Sky => {
                self.effects.set(Effects::PORTALS, usize::from(!self.scene.portals.is_empty()));
                self.log.sky();
            }
            Delta::Switch(effect, is_on) => self.effects.set(effect, usize::from(is_on)),
            Delta::Origin => {
                self.scene.place_portals();
                self.filing.partition.set_origin(self.scene.origin);
                self.top.clear();
            }
        }
    }

    fn record_tree(&mut self, tree: TreeKey, former: &EffectCounts) {
        let entry = &self.scene.trees[tree];
        self.effects.replace(former, entry.tree.effects());
        self.log.tree(slot_of(tree));
        if !entry.instances.is_empty() {
            self.top.clear();
        }
        self.recount(tree);
    }

    fn record_instance(&mut self, key: InstanceKey, change: InstanceChange, effects: [Effects; 2]) {
        if effects[0] != effects[1] {
            let [former, present] = effects.map(EffectCounts::one);
            self.effects.replace(&former, &present);
        }
        self.log.instance(slot_of(key), change);
        // The top level holds no user data.
        if change != InstanceChange::UserData {
            self.top.clear();
        }
    }

    /// Brings the sums over all trees up to date with one.
    fn recount(&mut self, tree: TreeKey) {
        let entry = &mut self.scene.trees[tree];
        let present = entry.terms();
        let former = std::mem::replace(&mut entry.counted, present);
        if former == present {
            return;
        }
        self.sums.remove(&former);
        self.sums.add(&present);
        if former.moving != present.moving {
            self.effects.set(Effects::MOVING, self.sums.moving);
        }
        let has_instances = former.instances + present.instances > 0;
        if has_instances && [former.lights, former.instances] != [present.lights, present.instances] {
            self.crowds.look_at_soon(tree);
        }
    }
}
