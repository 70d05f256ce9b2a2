//! The light world: trees, instances of them and directional lights. Edits go in, one
//! [`FrameDelta`] a frame comes out.

mod appearance;
mod attention;
mod build_thread;
mod change_log;
mod delta;
mod edit;
mod instance_map;
mod key_set;
mod memory;
mod moves;
mod long_build;
mod origin;
mod overlap;
mod parts;
mod placeholders;
mod rebuild;
mod reference;
mod refit;
mod region;
mod region_table;
mod regions;
mod requests;
mod rest;
mod rest_timers;
mod sections;
mod slot_round;
mod slot_set;
mod staged;
mod neighbours;
mod update;

use std::fmt;
use std::sync::{Arc, OnceLock};

use slotmap::SlotMap;

#[cfg(feature = "gpu-plan")]
pub(crate) use change_log::TreeChanges;
use delta::Changes;
pub use delta::FrameDelta;
pub use memory::WorldMemory;
pub use origin::OriginMode;
pub use rebuild::{JobReport, RebuildState};
pub use region::{RefusedRegion, Region, RegionInstance, RegionTree};
pub use region_table::RegionView;
pub use regions::RemovedRegion;
pub use update::{BackgroundReport, FrameReport};

use crate::effects::{EffectCounts, Effects, HeldEffects};
use crate::instance::appearance::Appearance;
use crate::instance::placement::{Placed, Placement};
use crate::keys::{DirectionalKey, InstanceKey, RegionKey, TreeKey, generation_of, slot_of};
use crate::light::DirectionalLight;
use crate::policy::{AttributeHistory, Policy, PolicySet};
use crate::scheduler::{Clock, Scheduler, SystemClock};
use crate::top::TopLevel;
use crate::tree::{LightTree, Section};
use change_log::ChangeLog;
use instance_map::InstanceMap;
use key_set::KeySet;
use memory::Counted;
use region_table::Regions;
use rest_timers::RestTimers;
use staged::StagedLights;

/// All lights of a scene: light trees, instances of them, and directional lights.
///
/// A call that returns an error has changed nothing. Lights that are changed, added or removed follow
/// at the next [`LightWorld::update`]; moves, additions and removals of instances and trees take
/// effect at once.
pub struct LightWorld {
    trees: SlotMap<TreeKey, TreeEntry>,
    instances: InstanceMap<Instance>,
    directionals: SlotMap<DirectionalKey, DirectionalLight>,
    /// The live tree of each slot.
    tree_slots: Vec<Option<TreeKey>>,
    origin: origin::Origin,
    light_count: usize,
    effects: HeldEffects,
    solid_angle_sampling: bool,
    glossy_sampling: bool,
    segment_sampling: bool,
    /// When trees stop counting as moving, and when they are frozen.
    rest_timers: RestTimers,
    /// Trees that the next update refits, or whose rebuild request it updates.
    pending: KeySet<TreeKey>,
    /// What the last update added and removed.
    added_lights: Vec<(TreeKey, u32)>,
    removed_lights: Vec<(TreeKey, u32)>,
    changes: Changes,
    move_scratch: moves::MoveScratch,
    scheduler: Scheduler,
    long_builder: long_build::LongBuilder,
    /// The jobs of the last update.
    jobs: Vec<JobReport>,
    view_weights: attention::ViewWeights,
    overlaps: overlap::Overlaps,
    neighbours: neighbours::Neighbours,
    /// The number of sections of all instances.
    section_count: usize,
    regions: Regions,
    /// Placeholders that came since the last update.
    new_placeholders: Vec<TreeKey>,
    /// Sums over all trees, and over the lists of regions.
    counted: Counted,
    clock: Arc<dyn Clock>,
    top: OnceLock<TopLevel>,
}

pub(crate) struct TreeEntry {
    pub tree: LightTree,
    pub instances: Vec<InstanceKey>,
    /// The policies of all instances.
    policies: PolicySet,
    /// The nodes and lights that changed, for uploads.
    pub log: ChangeLog,
    history: AttributeHistory,
    staged: StagedLights,
    /// A policy changed since the last update, so that the tree may request a rebuild although no
    /// light changes.
    has_new_policy: bool,
    weight: attention::TreeWeight,
    /// The number of instances that lie within others.
    surrounded: u32,
    /// Each light is a leaf of the top level.
    has_light_parts: bool,
    /// The number of instances of a large tree that lie among others.
    among_others: u32,
    /// Enough of them do for the tree to have sections.
    is_among_others: bool,
    /// The sections that are leaves of the top level; none of a tree that has another division.
    pub sections: Vec<Section>,
    /// The tree that was built in slices or in the background. It replaces this one at the next
    /// refit.
    successor: Option<Box<LightTree>>,
    /// What the sums over all trees hold of this one.
    counted: Counted,
}

pub(crate) struct Instance {
    pub tree: TreeKey,
    pub placement: Placement,
    pub policy: Policy,
    pub appearance: Appearance,
    /// `None` while the instance is hidden by a scale of zero. [`Instance::shown`] tells whether
    /// its lights shine.
    placed: Option<Placed>,
    /// Its index in its tree's list of instances.
    index_in_tree: usize,
    /// The region that it was added with.
    region: Option<RegionKey>,
}

impl TreeEntry {
    fn new(tree: LightTree) -> Self {
        Self {
            history: AttributeHistory::start(tree.attributes()),
            tree,
            instances: Vec::new(),
            policies: PolicySet::default(),
            log: ChangeLog::default(),
            staged: StagedLights::default(),
            has_new_policy: false,
            weight: attention::TreeWeight::default(),
            surrounded: 0,
            has_light_parts: false,
            among_others: 0,
            is_among_others: false,
            sections: Vec::new(),
            successor: None,
            counted: Counted::default(),
        }
    }

    /// The tree has yet to be built, or some instance has a policy that can request a rebuild.
    fn may_rebuild(&self) -> bool {
        self.policies.may_rebuild() || self.tree.is_placeholder()
    }

    /// There are instances, and all of them promise that the lights do not change.
    fn is_static(&self) -> bool {
        self.policies.is_static()
    }
}

impl Instance {
    /// Where the lights shine; `None` if they do not, because a scale of zero hides the instance or
    /// because of its appearance.
    pub fn shown(&self) -> Option<&Placed> {
        self.placed.as_ref().filter(|_| self.appearance.is_shown())
    }

    /// The effects that the instance has; none if it is not shown.
    fn effects(&self) -> Effects {
        self.shown().map_or(Effects::empty(), |placed| placed.effects() | self.appearance.effects())
    }
}

impl Default for LightWorld {
    fn default() -> Self {
        Self::new()
    }
}

impl fmt::Debug for LightWorld {
    /// Counts, not contents.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("LightWorld")
            .field("trees", &self.tree_count())
            .field("instances", &self.instance_count())
            .field("regions", &self.region_count())
            .field("directionals", &self.directionals.len())
            .field("lights", &self.light_count())
            .field("effects", &self.effects())
            .field("origin", &self.origin())
            .finish_non_exhaustive()
    }
}

impl LightWorld {
    /// Creates an empty world that measures its work with the machine's clock.
    pub fn new() -> Self {
        Self::with_clock(Arc::new(SystemClock::default()))
    }

    /// Creates an empty world with a given clock, for tests and replays.
    pub fn with_clock(clock: Arc<dyn Clock>) -> Self {
        Self {
            trees: SlotMap::with_key(),
            instances: InstanceMap::default(),
            directionals: SlotMap::with_key(),
            tree_slots: Vec::new(),
            origin: origin::Origin::default(),
            light_count: 0,
            effects: HeldEffects::default(),
            solid_angle_sampling: false,
            glossy_sampling: false,
            segment_sampling: false,
            rest_timers: RestTimers::default(),
            pending: KeySet::default(),
            added_lights: Vec::new(),
            removed_lights: Vec::new(),
            changes: Changes::default(),
            move_scratch: moves::MoveScratch::default(),
            scheduler: Scheduler::default(),
            long_builder: long_build::LongBuilder::default(),
            jobs: Vec::new(),
            view_weights: attention::ViewWeights::default(),
            overlaps: overlap::Overlaps::default(),
            neighbours: neighbours::Neighbours::default(),
            section_count: 0,
            regions: Regions::default(),
            new_placeholders: Vec::new(),
            counted: Counted::default(),
            clock,
            top: OnceLock::new(),
        }
    }

    /// The number of trees, with or without instances.
    pub fn tree_count(&self) -> usize {
        self.trees.len()
    }

    /// The number of instances, hidden ones included.
    pub fn instance_count(&self) -> usize {
        self.instances.len()
    }

    /// The number of directional lights.
    pub fn directional_count(&self) -> usize {
        self.directionals.len()
    }

    /// The number of lights that have a [`LightId`](crate::LightId): the lights of each tree once
    /// per instance, hidden instances included, and the directional lights. Lights that were added
    /// or removed count from the next [`LightWorld::update`] on.
    pub fn light_count(&self) -> usize {
        self.light_count + self.directionals.len()
    }

    /// For each effect, the number of lights (those of each tree once, with or without instances),
    /// instances and trees that have it now. O(1).
    pub fn effect_counts(&self) -> &EffectCounts {
        self.effects.counts()
    }

    /// The effects that something in the world has now, [`Effects::MOVING`] included. Edits of
    /// lights count from the next [`LightWorld::update`] on. O(1).
    pub fn active_effects(&self) -> Effects {
        self.effects.counts().effects()
    }

    /// The effects that shaders and buffer layouts should be made for. O(1).
    ///
    /// This is the set of all [`LightWorld::active_effects`] of now and of the last
    /// [`EFFECT_HOLD_UPDATES`](crate::effects::EFFECT_HOLD_UPDATES) calls of
    /// [`LightWorld::update`], so that flicker does not change it. It never contains
    /// [`Effects::MOVING`], which changes no shader.
    pub fn effects(&self) -> Effects {
        self.effects.effects()
    }

    /// Whether rectangles and triangles that are large or near are sampled by solid angle. False
    /// until [`LightWorld::set_solid_angle_sampling`] is called.
    pub fn solid_angle_sampling(&self) -> bool {
        self.solid_angle_sampling
    }

    /// Whether shaders that are made for this world know glossy surfaces. False until
    /// [`LightWorld::set_glossy_sampling`] is called.
    pub fn glossy_sampling(&self) -> bool {
        self.glossy_sampling
    }

    /// Whether shaders that are made for this world know segments of rays. False until
    /// [`LightWorld::set_segment_sampling`] is called.
    pub fn segment_sampling(&self) -> bool {
        self.segment_sampling
    }

    /// A tree as of the last update; `None` for a stale key.
    pub fn tree(&self, tree: TreeKey) -> Option<&LightTree> {
        self.trees.get(tree).map(|entry| &entry.tree)
    }

    /// The keys of all trees.
    pub fn trees(&self) -> impl Iterator<Item = TreeKey> {
        self.trees.keys()
    }

    /// The keys of all instances, hidden ones included.
    pub fn instances(&self) -> impl Iterator<Item = InstanceKey> {
        self.instances.keys()
    }

    /// A directional light; `None` for a stale key.
    pub fn directional(&self, key: DirectionalKey) -> Option<&DirectionalLight> {
        self.directionals.get(key)
    }

    /// The keys of all directional lights.
    pub fn directionals(&self) -> impl Iterator<Item = DirectionalKey> {
        self.directionals.keys()
    }

    /// All directional lights with their keys, in the order of the keys.
    pub(crate) fn directional_lights(&self) -> impl Iterator<Item = (DirectionalKey, &DirectionalLight)> {
        self.directionals.iter()
    }

    /// The placement of an instance; `None` for a stale key.
    pub fn placement(&self, instance: InstanceKey) -> Option<Placement> {
        self.instances.get(instance).map(|i| i.placement)
    }

    /// The tree of an instance; `None` for a stale key.
    pub fn instance_tree(&self, instance: InstanceKey) -> Option<TreeKey> {
        self.instances.get(instance).map(|i| i.tree)
    }

    /// The policy of an instance; `None` for a stale key.
    pub fn policy(&self, instance: InstanceKey) -> Option<Policy> {
        self.instances.get(instance).map(|i| i.policy)
    }

    /// The number by which shaders refer to an instance; `None` for a stale key.
    pub fn slot(&self, instance: InstanceKey) -> Option<u32> {
        self.instances.contains_key(instance).then(|| slot_of(instance))
    }

    /// A number that shaders read with `light_generation(slot)`, at least 1; `None` for a stale key.
    /// It changes when the slot gets another instance, so a sample that was kept from an earlier
    /// frame still means the same instance if its slot has the same generation. It repeats after
    /// 2²⁴ - 1 instances of one slot.
    pub fn generation(&self, instance: InstanceKey) -> Option<u32> {
        self.instances.contains_key(instance).then(|| generation_of(instance))
    }

    /// The live instance that shaders refer to by this number; `None` if there is none.
    pub fn instance_at(&self, slot: u32) -> Option<InstanceKey> {
        self.instances.key_at(slot)
    }

    /// The number of instance slots that are or were in use.
    pub(crate) fn slot_count(&self) -> usize {
        self.instances.slot_count()
    }

    /// The number of tree slots that are or were in use.
    #[cfg(feature = "gpu-plan")]
    pub(crate) fn tree_slot_count(&self) -> u32 {
        self.tree_slots.len() as u32
    }

    /// The live tree of a tree slot.
    #[cfg(feature = "gpu-plan")]
    pub(crate) fn tree_at(&self, slot: u32) -> Option<TreeKey> {
        self.tree_slots.get(slot as usize).copied().flatten()
    }

    #[cfg(feature = "gpu-plan")]
    pub(crate) fn tree_entry(&self, tree: TreeKey) -> Option<&TreeEntry> {
        self.trees.get(tree)
    }

    pub(crate) fn instance(&self, instance: InstanceKey) -> Option<&Instance> {
        self.instances.get(instance)
    }

    /// The top level on the CPU, built when it is first needed after a change.
    ///
    /// It is built outside of any lock. Built inside `OnceLock::get_or_init`, it could deadlock:
    /// while a rayon worker waits for parts of its build, it may steal a job that needs the top
    /// level too. Threads that call this at the same time may each build it; the results are equal
    /// and the first one is kept.
    pub(crate) fn top_level(&self) -> &TopLevel {
        if let Some(top) = self.top.get() {
            return top;
        }
        let mut built = TopLevel::build(&self.parts(), self.instances.slot_count());
        if self.active_effects().contains(Effects::MASKS) {
            built.set_masks(|slot| self.instance_at(slot).map_or(0, |key| self.instances[key].appearance.mask));
        }
        self.top.get_or_init(|| built)
    }
}

/// Records which key occupies a slot now.
fn set_slot<K: Copy>(slots: &mut Vec<Option<K>>, slot: u32, key: Option<K>) {
    if slots.len() <= slot as usize {
        slots.resize(slot as usize + 1, None);
    }
    slots[slot as usize] = key;
}
