//! The light world: trees, instances of them and directional lights. Edits go in, and
//! readers follow the [`Changes`].

mod appearance;
mod attention;
mod births;
mod build_thread;
mod change_log;
mod crowds;
mod delta;
mod divide;
#[cfg(feature = "bake")]
mod dump;
mod edit;
mod filing;
mod kernel_parts;
mod log;
#[cfg(feature = "gpu-plan")]
mod measures;
mod memory;
mod moves;
mod long_build;
mod opening;
mod parts;
mod rebuild;
mod rebuilds;
mod reference;
mod refit;
mod region;
mod region_view;
mod regions;
mod reports;
mod rest;
mod scene;
mod sky;
mod settle;
mod slot_table;
mod snapshot;
mod staged;
mod stamps;
mod source;
mod sources;
mod sums;
mod update;
mod viewpoint;

use std::fmt;
use std::sync::Arc;

use glam::Vec3;
use slotmap::SlotMap;

pub(crate) use births::birth_of_directional;
#[cfg(feature = "gpu-plan")]
pub(crate) use births::{BIRTH_BITS, of_instance as birth_of_instance};
#[cfg(feature = "gpu-plan")]
pub(crate) use change_log::TreeChanges;
#[cfg(feature = "bake")]
pub use dump::LeftOut;
#[cfg(feature = "gpu-plan")]
pub(crate) use kernel_parts::KernelPart;
pub use log::{Changes, Revision};
#[cfg(feature = "gpu-plan")]
pub(crate) use measures::SourceMeasure;
pub use memory::WorldMemory;
pub use region::{Region, RegionInstance, RegionTree};
pub use region_view::RegionView;
pub use reports::{BackgroundReport, FrameReport, JobReport, RebuildState};
pub use scene::Instance;
pub(crate) use scene::TreeEntry;
#[cfg(feature = "gpu-plan")]
pub(crate) use scene::TreeVersion;
pub use source::TreeSource;

use crate::cluster::Cluster;
use crate::effects::{EffectCounts, Effects, HeldEffects};
use crate::instance::part::Part;
use crate::keys::{DirectionalKey, InstanceKey, LightId, RegionKey, TreeKey, slot_of};
use crate::light::DirectionalLight;
use crate::scheduler::Clock;
use crate::top::TopLevel;
use crate::tree::{LightTree, Node, Opening};
use crowds::Crowds;
use filing::{Filing, TopCache};
use log::WorldLog;
use rebuilds::Rebuilds;
use rest::RestRound;
use scene::Scene;
use staged::Edits;
use sums::Sums;

/// All lights of a scene: light trees, instances of them, and directional lights.
///
/// Most programs need ten calls:
///
/// | to | call |
/// |---|---|
/// | add lights of an object, and the object | [`add_tree`](Self::add_tree), [`add_instance`](Self::add_instance) |
/// | add sun and sky | [`add_directional`](Self::add_directional), [`set_sky`](Self::set_sky) |
/// | move an object, dim or hide its lights, remove it | [`move_instance`](Self::move_instance), [`set_appearance`](Self::set_appearance), [`remove_instance`](Self::remove_instance) |
/// | change lights within a tree | [`set_lights`](Self::set_lights) |
/// | end the edits of a frame | [`update`](Self::update) |
/// | sample on the CPU | [`sampler`](Self::sampler) |
///
/// A call that returns an error has changed nothing. Lights that are changed, added or removed follow
/// at the next [`LightWorld::update`]; moves, additions and removals of instances and trees take
/// effect at once.
#[derive(Default)]
pub struct LightWorld {
    scene: Scene,
    sums: Sums,
    effects: HeldEffects,
    rest: RestRound,
    edits: Edits,
    log: WorldLog,
    /// Memory of [`LightWorld::move_instances`], kept for the next call: slots and numbers of moves.
    move_order: Vec<(u32, u32)>,
    rebuilds: Rebuilds,
    crowds: Crowds,
    regions: SlotMap<RegionKey, RegionView>,
    filing: Filing,
    top: TopCache,
}

impl fmt::Debug for LightWorld {
    /// Counts, not contents.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("LightWorld")
            .field("trees", &self.scene.trees.len())
            .field("instances", &self.scene.instances.len())
            .field("regions", &self.regions.len())
            .field("directionals", &self.scene.directionals.len())
            .field("lights", &self.light_count())
            .field("effects", &self.effects())
            .field("origin", &self.origin())
            .finish_non_exhaustive()
    }
}

impl LightWorld {
    /// Creates an empty world that measures its work with the machine's clock.
    pub fn new() -> Self {
        Self::default()
    }

    /// Creates an empty world with a given clock, for tests and replays.
    pub fn with_clock(clock: Arc<dyn Clock>) -> Self {
        let mut world = Self::default();
        world.rebuilds.clock = clock;
        world
    }

    /// The number of lights that have a [`LightId`](crate::LightId): the lights of each tree once
    /// per instance, hidden instances included, and the directional lights. Lights that were added
    /// or removed count from the next [`LightWorld::update`] on.
    pub fn light_count(&self) -> usize {
        self.sums.lights + self.scene.directionals.len()
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

    /// The effects that shaders should be made for. O(1).
    ///
    /// This is the set of all [`LightWorld::active_effects`] of now and of the last
    /// [`EFFECT_HOLD_UPDATES`](crate::effects::EFFECT_HOLD_UPDATES) calls of
    /// [`LightWorld::update`], so that flicker does not change it. It never contains
    /// [`Effects::MOVING`], which changes no shader.
    pub fn effects(&self) -> Effects {
        self.effects.effects()
    }

    /// Whether rectangles and triangles that are large or near are sampled by solid angle.
    pub(crate) fn solid_angle_sampling(&self) -> bool {
        self.effects.counts().has(Effects::SOLID_ANGLES)
    }

    /// A tree as of the last update; `None` for a stale key.
    pub fn tree(&self, tree: TreeKey) -> Option<&LightTree> {
        self.scene.trees.get(tree).map(|entry| &entry.tree)
    }

    /// The keys of all trees.
    pub fn trees(&self) -> impl ExactSizeIterator<Item = TreeKey> {
        self.scene.trees.keys()
    }

    /// The keys of all instances, hidden ones included.
    pub fn instances(&self) -> impl ExactSizeIterator<Item = InstanceKey> {
        self.scene.instances.keys()
    }

    /// A directional light; `None` for a stale key.
    pub fn directional(&self, key: DirectionalKey) -> Option<&DirectionalLight> {
        self.scene.directionals.get(key)
    }

    /// The keys of all directional lights.
    pub fn directionals(&self) -> impl ExactSizeIterator<Item = DirectionalKey> {
        self.scene.directionals.keys()
    }

    /// All directional lights with their keys, in the order of the keys.
    pub(crate) fn directional_lights(&self) -> impl Iterator<Item = (DirectionalKey, &DirectionalLight)> {
        self.scene.directionals.iter()
    }

    /// An instance with its tree, placement, policy and appearance; `None` for a stale key.
    pub fn instance(&self, instance: InstanceKey) -> Option<&Instance> {
        self.scene.instances.get(instance)
    }

    /// The number by which shaders refer to an instance; `None` for a stale key.
    pub fn slot(&self, instance: InstanceKey) -> Option<u32> {
        self.scene.instances.contains_key(instance).then(|| slot_of(instance))
    }

    /// A number that shaders read with `light_generation(instance, light)`, at least 1 and below 2²⁴;
    /// `None` for a stale key, if the instance is not shown, and for an index beyond those of the tree. A
    /// removed light keeps its number until its index is used again. Shaders read 0 where no instance is
    /// shown, for an index beyond those of the tree, and where they see stand-ins of the tree. O(1).
    ///
    /// A slot and an index name the same light for as long as this number stays the same. Another
    /// instance in the slot, another tree, other lights in the tree, or a light that was added at the
    /// index of one that was removed all change it; two lights have the same number by chance once in
    /// 2²⁴.
    pub fn generation(&self, light: LightId) -> Option<u32> {
        match light {
            LightId::Local { instance, light } => {
                let Instance { tree, birth, .. } = self.instance(instance).filter(|shown| shown.shown().is_some())?;
                let entry = &self.scene.trees[*tree];
                ((light as usize) < entry.tree.lights().len()).then(|| {
                    births::generation(
                        births::of_instance(*birth, entry.births.replaced),
                        entry.births.lights.of(light),
                    )
                })
            }
            LightId::Directional(key) => {
                self.scene.directionals.contains_key(key).then(|| births::generation(0, birth_of_directional(key)))
            }
        }
    }

    /// The live instance that shaders refer to by this number; `None` if there is none.
    pub fn instance_at(&self, slot: u32) -> Option<InstanceKey> {
        self.scene.instances.key_at(slot)
    }

    /// The present point in the history of the world: what a reader that has read all changes keeps.
    pub fn revision(&self) -> Revision {
        self.log.revision(self.origin())
    }

    /// What changed since a revision of this world. There may be any number of readers, and what one
    /// reads is not lost for others. With `Revision::default()` everything has changed.
    ///
    /// O(1); the lists cost what they name.
    ///
    /// ```
    /// use girandole::glam::{DVec3, Vec3};
    /// use girandole::{Light, LightTree, LightWorld, Placement, Policy, Revision};
    /// let mut world = LightWorld::new();
    /// let lamp = world.add_tree(LightTree::new(vec![Light::point(Vec3::Y, Vec3::ONE)])?);
    /// let car = world.add_instance(lamp, Placement::IDENTITY, Policy::Budgeted)?;
    /// // A reader that has seen nothing, and one that goes on from here.
    /// let slot = world.slot(car);
    /// assert!(world.changes_since(Revision::default()).added_instances().eq(slot));
    /// let seen = world.revision();
    /// assert!(world.changes_since(seen).is_empty());
    /// world.move_instance(car, Placement::at(DVec3::X))?;
    /// assert!(world.changes_since(seen).moved_instances().eq(slot));
    /// # Ok::<(), girandole::WorldError>(())
    /// ```
    pub fn changes_since(&self, revision: Revision) -> Changes<'_> {
        self.log.changes_since(revision, self.origin())
    }

    /// The number of instance slots that are or were in use.
    pub(crate) fn slot_count(&self) -> usize {
        self.scene.instances.slot_count()
    }

    /// The number of tree slots that are or were in use.
    #[cfg(feature = "gpu-plan")]
    pub(crate) fn tree_slot_count(&self) -> u32 {
        self.scene.trees.slot_count() as u32
    }

    /// The live tree of a tree slot.
    #[cfg(feature = "gpu-plan")]
    pub(crate) fn tree_at(&self, slot: u32) -> Option<TreeKey> {
        self.scene.trees.key_at(slot)
    }

    #[cfg(feature = "gpu-plan")]
    pub(crate) fn tree_entry(&self, tree: TreeKey) -> Option<&TreeEntry> {
        self.scene.trees.get(tree)
    }

    /// The openings of a tree, in the order of their places; none of a whole tree.
    pub(crate) fn openings(&self, tree: TreeKey) -> &[Opening] {
        &self.scene.trees[tree].openings
    }

    /// The number of parts of all instances.
    #[cfg(feature = "gpu-plan")]
    pub(crate) fn part_count(&self) -> usize {
        self.sums.parts
    }

    /// The parts of all instances, in the order of the slots, with their clusters.
    pub(crate) fn parts(&self) -> Vec<(Part, Cluster)> {
        self.scene.parts()
    }

    /// The origin, which is the centre of a sector. f32 holds it exactly.
    pub(crate) fn home(&self) -> Vec3 {
        self.scene.origin.as_vec3()
    }

    /// The error that stand-ins make for a tree, see [`ViewWeights::error_of_stand_ins`].
    #[cfg(feature = "gpu-plan")]
    pub(crate) fn error_of_stand_ins(&self, tree: TreeKey) -> f32 {
        self.rebuilds.weights.error_of_stand_ins(tree, &self.scene)
    }

    /// The top level on the CPU, built when it is first needed after a change.
    ///
    /// It is built outside of any lock. Built inside `OnceLock::get_or_init`, it could deadlock:
    /// while a rayon worker waits for parts of its build, it may steal a job that needs the top
    /// level too. Threads that call this at the same time may each build it; the results are equal
    /// and the first one is kept.
    pub(crate) fn top_level(&self) -> &TopLevel {
        if let Some(top) = self.top.level.get() {
            return top;
        }
        let mut built = TopLevel::build(&self.parts(), self.scene.instances.slot_count(), self.partition());
        if self.active_effects().contains(Effects::MASKS) {
            built.set_masks(|slot| self.instance_at(slot).map_or(0, |key| self.scene.instances[key].appearance.mask));
        }
        self.top.level.get_or_init(|| built)
    }

    /// The nodes of the top level on the CPU, for tools that look into it: the root first, and the boxes
    /// relative to [`LightWorld::origin`]. The tree is built when it is first needed after a change, as by
    /// [`LightWorld::sampler`].
    pub fn top_nodes(&self) -> &[Node] {
        &self.top_level().nodes
    }
}
