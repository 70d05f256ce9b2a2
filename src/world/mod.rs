//! Trees, instances of them, directional lights: edits in, one [`FrameDelta`] out.

mod attention;
mod background_builds;
mod delta;
mod edit;
mod jobs;
mod refit;
mod requests;
mod rest;
mod schedule;
mod update;

use std::sync::{Arc, OnceLock};

use glam::DVec3;
use slotmap::SlotMap;

pub(crate) use delta::Changes;
pub use delta::FrameDelta;
pub use schedule::JobReport;
pub use update::{BackgroundReport, FrameReport};

use crate::cluster::Cluster;
use crate::effects::{Damped, EffectCounts, Effects};
use crate::keys::{DirectionalKey, InstanceKey, TreeKey, slot_of};
use crate::light::{DirectionalLight, Light, MIN_FLUX};
use crate::placement::{Placed, Placement};
use crate::policy::{AttributeHistory, Policy};
use crate::scheduler::{Clock, SystemClock, TreeFeatures};
use crate::top::TopLevel;
use crate::tree::LightTree;

/// Everything that shines: light trees, instances of them, directional lights.
///
/// Calls that fail change nothing. Edits of lights take effect at [`LightWorld::update`]; moves, additions and removals at
/// once.
pub struct LightWorld {
    trees: SlotMap<TreeKey, TreeEntry>,
    instances: SlotMap<InstanceKey, Instance>,
    directionals: SlotMap<DirectionalKey, DirectionalLight>,
    /// The live instance of each slot; an instance keeps its slot while it lives.
    slots: Vec<Option<InstanceKey>>,
    /// The live tree of each slot.
    tree_slots: Vec<Option<TreeKey>>,
    origin: DVec3,
    light_count: usize,
    effects: Damped,
    /// Trees that are not frozen, each once.
    awake: Vec<TreeKey>,
    /// Trees with staged lights, each once.
    edited: Vec<TreeKey>,
    changes: Changes,
    schedule: schedule::Schedule,
    view_weights: attention::ViewWeights,
    clock: Arc<dyn Clock>,
    top: OnceLock<TopLevel>,
}

pub(crate) struct TreeEntry {
    pub tree: LightTree,
    pub instances: Vec<InstanceKey>,
    /// The instances' distinct policies and how many want each.
    policies: Vec<(Policy, u32)>,
    history: AttributeHistory,
    staged: Vec<(u32, Light)>,
    is_edited: bool,
    rebuild_state: schedule::RebuildState,
    rest: rest::Rest,
}

pub(crate) struct Instance {
    pub tree: TreeKey,
    pub placement: Placement,
    pub policy: Policy,
    pub placed: Placed,
    /// Its place in its tree's list of instances.
    place: usize,
}

impl TreeEntry {
    fn new(tree: LightTree, frame: u64) -> Self {
        let mut rebuild_state = schedule::RebuildState::default();
        rebuild_state.start(TreeFeatures::of(&tree), frame);
        Self {
            history: AttributeHistory::start(tree.attributes()),
            tree,
            instances: Vec::new(),
            policies: Vec::new(),
            staged: Vec::new(),
            is_edited: false,
            rebuild_state,
            rest: rest::Rest::default(),
        }
    }

    fn add_policy(&mut self, policy: Policy) {
        match self.policies.iter_mut().find(|(p, _)| *p == policy) {
            Some((_, count)) => *count += 1,
            None => self.policies.push((policy, 1)),
        }
    }

    fn remove_policy(&mut self, policy: Policy) {
        if let Some(place) = self.policies.iter().position(|(p, _)| *p == policy) {
            self.policies[place].1 -= 1;
            if self.policies[place].1 == 0 {
                self.policies.remove(place);
            }
        }
    }

    /// Some instance has a policy that can lead to a rebuild.
    fn may_rebuild(&self) -> bool {
        self.policies.iter().any(|(policy, _)| policy.may_rebuild())
    }

    /// All instances promised that the lights do not change.
    fn is_static(&self) -> bool {
        !self.policies.is_empty() && self.policies.iter().all(|(p, _)| *p == Policy::Static)
    }
}

impl Default for LightWorld {
    fn default() -> Self {
        Self::new()
    }
}

impl LightWorld {
    /// An empty world that measures rebuilds with the machine's clock.
    pub fn new() -> Self {
        Self::with_clock(Arc::new(SystemClock::default()))
    }

    /// An empty world with a clock of your own, for tests and replays.
    pub fn with_clock(clock: Arc<dyn Clock>) -> Self {
        Self {
            trees: SlotMap::with_key(),
            instances: SlotMap::with_key(),
            directionals: SlotMap::with_key(),
            slots: Vec::new(),
            tree_slots: Vec::new(),
            origin: DVec3::ZERO,
            light_count: 0,
            effects: Damped::default(),
            awake: Vec::new(),
            edited: Vec::new(),
            changes: Changes::default(),
            schedule: schedule::Schedule::default(),
            view_weights: attention::ViewWeights::default(),
            clock,
            top: OnceLock::new(),
        }
    }

    /// Trees, with or without instances.
    pub fn tree_count(&self) -> usize {
        self.trees.len()
    }

    /// Instances.
    pub fn instance_count(&self) -> usize {
        self.instances.len()
    }

    /// Lights that can be sampled: those of a tree once per instance, and directional lights.
    pub fn light_count(&self) -> usize {
        self.light_count + self.directionals.len()
    }

    /// How many lights (of trees, each once, with instances or without), instances and trees have each effect, now.
    /// O(1).
    pub fn effect_counts(&self) -> &EffectCounts {
        self.effects.counts()
    }

    /// The effects of what the world holds now; staged edits count from [`LightWorld::update`] on. O(1).
    pub fn active_effects(&self) -> Effects {
        self.effects.counts().effects()
    }

    /// What shaders and layouts should be made for: all that [`LightWorld::active_effects`] has, at once, and what it had within
    /// the last [`EFFECT_HOLD_UPDATES`](crate::EFFECT_HOLD_UPDATES) calls of [`LightWorld::update`], so that flicker changes nothing. O(1).
    pub fn effects(&self) -> Effects {
        self.effects.effects()
    }

    /// The point that sampling coordinates are relative to, in metres.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// A tree as of the last update; `None` for a stale key.
    pub fn tree(&self, tree: TreeKey) -> Option<&LightTree> {
        self.trees.get(tree).map(|entry| &entry.tree)
    }

    /// The keys of all trees.
    pub fn trees(&self) -> impl Iterator<Item = TreeKey> {
        self.trees.keys()
    }

    /// The keys of all instances.
    pub fn instances(&self) -> impl Iterator<Item = InstanceKey> {
        self.instances.keys()
    }

    /// A directional light; `None` for a stale key.
    pub fn directional(&self, key: DirectionalKey) -> Option<&DirectionalLight> {
        self.directionals.get(key)
    }

    /// All directional lights.
    pub fn directionals(&self) -> impl Iterator<Item = (DirectionalKey, &DirectionalLight)> {
        self.directionals.iter()
    }

    /// Where an instance stands; `None` for a stale key.
    pub fn placement(&self, instance: InstanceKey) -> Option<Placement> {
        self.instances.get(instance).map(|i| i.placement)
    }

    /// Which tree an instance shows; `None` for a stale key.
    pub fn instance_tree(&self, instance: InstanceKey) -> Option<TreeKey> {
        self.instances.get(instance).map(|i| i.tree)
    }

    /// What an instance wants for its tree; `None` for a stale key.
    pub fn policy(&self, instance: InstanceKey) -> Option<Policy> {
        self.instances.get(instance).map(|i| i.policy)
    }

    /// The number by which shaders know an instance; `None` for a stale key.
    pub fn slot(&self, instance: InstanceKey) -> Option<u32> {
        self.instances.contains_key(instance).then(|| slot_of(instance))
    }

    /// The live instance that shaders know by this number.
    pub fn instance_at(&self, slot: u32) -> Option<InstanceKey> {
        self.slots.get(slot as usize).copied().flatten()
    }

    /// Slots that are or were in use.
    #[cfg(feature = "gpu")]
    pub(crate) fn slot_count(&self) -> usize {
        self.slots.len()
    }

    /// The live tree of a slot.
    #[cfg(feature = "gpu")]
    pub(crate) fn tree_at(&self, slot: u32) -> Option<TreeKey> {
        self.tree_slots.get(slot as usize).copied().flatten()
    }

    #[cfg(feature = "gpu")]
    pub(crate) fn tree_entry(&self, tree: TreeKey) -> Option<&TreeEntry> {
        self.trees.get(tree)
    }

    pub(crate) fn instance(&self, instance: InstanceKey) -> Option<&Instance> {
        self.instances.get(instance)
    }

    /// The CPU's top level, built when first asked for after a change.
    pub(crate) fn top_level(&self) -> &TopLevel {
        self.top.get_or_init(|| TopLevel::build(&self.clusters()))
    }

    /// What the top level is built over: the instance of each slot.
    pub(crate) fn clusters(&self) -> Vec<Cluster> {
        let cluster = |slot: u32| self.instance_at(slot).map_or(Cluster::EMPTY, |key| self.cluster(key));
        (0..self.slots.len() as u32).map(cluster).collect()
    }

    /// An instance as the top level sees it.
    pub(crate) fn cluster(&self, key: InstanceKey) -> Cluster {
        let instance = &self.instances[key];
        let tree = &self.trees[instance.tree].tree;
        let cluster = tree.cluster();
        if cluster.flux <= 0.0 {
            return Cluster::EMPTY;
        }
        let linear = &instance.placed.linear;
        let flux = linear.flux(tree.flux().punctual, tree.flux().area, cluster.axis);
        // Scaled down far enough, what shines would round to dark.
        cluster.transformed(linear, instance.placed.frame.translation, flux.max(MIN_FLUX))
    }
}

/// Notes who lives in a slot now.
fn set_slot<K: Copy>(slots: &mut Vec<Option<K>>, slot: u32, owner: Option<K>) {
    if slots.len() <= slot as usize {
        slots.resize(slot as usize + 1, None);
    }
    slots[slot as usize] = owner;
}
