//! What a world contains, as it is now.

use glam::DVec3;
use slotmap::SlotMap;

use super::births::{BirthCounter, Births};
use super::change_log::ChangeLog;
use super::rest::Rest;
use super::slot_table::SlotTable;
use super::source::Source;
use super::staged::StagedLights;
use super::sums::TreeTerms;
use crate::effects::Effects;
use crate::instance::appearance::Appearance;
use crate::instance::placement::{Placed, Placement};
use crate::instance::portal::{PlacedPortal, Portal};
use crate::keys::{DirectionalKey, InstanceKey, RegionKey, TreeKey};
use crate::light::DirectionalLight;
use crate::policy::{AttributeHistory, Excess, Policy, PolicySet, RebuildRequest};
use crate::rare::Rare;
use crate::sky::Sky;
use crate::tree::{Attributes, LightTree, Opening, WIDTH};

/// The trees, instances, directional lights and sky of a world, and the origin of their coordinates.
#[derive(Default)]
pub(super) struct Scene {
    pub trees: SlotTable<TreeKey, TreeEntry>,
    pub instances: SlotTable<InstanceKey, Instance>,
    pub directionals: SlotMap<DirectionalKey, DirectionalLight>,
    /// The map of the sky, and the instance of its patches.
    pub sky: Option<(InstanceKey, Sky)>,
    pub portals: Vec<Portal>,
    /// The same relative to the origin.
    pub placed_portals: Vec<PlacedPortal>,
    pub births: BirthCounter,
    /// The trees that have a source, by its number.
    pub sources: Vec<Option<TreeKey>>,
    pub origin: DVec3,
}

impl Scene {
    /// Brings the portals relative to the origin up to date.
    pub fn place_portals(&mut self) {
        let origin = self.origin;
        self.placed_portals = self.portals.iter().map(|portal| portal.placed(origin)).collect();
    }

    /// The present version of a tree.
    pub fn version(&self, tree: TreeKey) -> Option<TreeVersion> {
        let entry = self.trees.get(tree)?;
        Some(TreeVersion { tree, made_by: (entry.births.replaced, entry.tree.builds()) })
    }
}

/// A tree of a world.
#[derive(Default)]
pub(crate) struct TreeEntry {
    pub tree: LightTree,
    pub births: TreeBirths,
    pub instances: Vec<InstanceKey>,
    /// The nodes and lights that changed, for uploads.
    pub log: ChangeLog,
    pub(super) staged: Rare<StagedLights>,
    /// The next update looks at the tree.
    pub is_pending: bool,
    pub requests: Requests,
    pub(super) rest: Rest,
    /// The kernel that writes its lights, if one does.
    pub(super) source: Option<Box<Source>>,
    pub crowd: Crowd,
    /// Where the top level leads into the tree, in the order of their places; none of a whole tree.
    pub openings: Box<[Opening]>,
    /// The result of a build in slices or in the background.
    pub successor: Option<Successor>,
    /// What the sums over all trees hold of this one.
    pub(super) counted: TreeTerms,
}

/// The edits by which a shader knows whether a light is still the one that it has kept.
#[derive(Clone, Default)]
pub(crate) struct TreeBirths {
    pub lights: Rare<Births>,
    /// The number of the last edit that put another tree in the place of this one; 0 before any.
    pub replaced: u32,
}

/// What a tree's request for a rebuild follows from, besides its attributes.
#[derive(Default)]
pub(crate) struct Requests {
    /// The policies of all instances.
    pub policies: PolicySet,
    pub history: AttributeHistory,
    /// A policy changed since the last update, so that the tree may request a rebuild although no
    /// light changes.
    pub has_new_policy: bool,
    pub weight: TreeWeight,
}

/// The lights of others between those of a tree.
#[derive(Default)]
pub(crate) struct Crowd {
    /// About how many there are for an instance, in the mean.
    pub lights: f32,
    /// They make the tree loose, so that each light is an opening.
    pub is_loose: bool,
    /// They would make it loose, but the openings would be too many.
    pub is_held_back: bool,
}

/// A tree that was built in slices or in the background. It replaces that of its entry at the next
/// refit.
pub(crate) struct Successor {
    pub tree: Box<LightTree>,
    /// The revision of the log at which the build was begun.
    pub since: u64,
}

/// The version of a tree that the GPU holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TreeVersion {
    pub tree: TreeKey,
    /// The exchange and the build that made it.
    made_by: (u32, u32),
}

/// What the weight of one tree is computed from.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TreeWeight {
    /// The illuminance at the viewpoint without cosines, in lux; the flux in lumens if the
    /// viewpoint is unknown.
    pub illuminance: f32,
    /// The update in which the illuminance was computed, if it was.
    pub computed_at: Option<u64>,
}

/// An instance of a [`LightWorld`](crate::LightWorld).
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Instance {
    /// Its tree.
    pub tree: TreeKey,
    /// Where it is.
    pub placement: Placement,
    /// When its tree requests a rebuild.
    pub policy: Policy,
    /// What it changes about the lights of its tree.
    pub appearance: Appearance,
    /// The region that it was added with.
    pub region: Option<RegionKey>,
    /// `None` while the instance is hidden by its placement. [`Instance::shown`] tells whether
    /// its lights shine.
    pub(crate) placed: Option<Placed>,
    /// The number of the edit that added it.
    pub(crate) birth: u32,
    /// Its index in its tree's list of instances.
    pub(super) index_in_tree: u32,
    /// The effects that the counts of the world have of it.
    pub(super) counted: Effects,
    /// Its lights are patches of the sky, at a distance of 1 from every shading point. It is no part of the top
    /// level.
    pub(crate) is_sky: bool,
}

impl TreeEntry {
    pub fn new(tree: LightTree) -> Self {
        let history = AttributeHistory::start(tree.attributes());
        Self { tree, requests: Requests { history, ..Requests::default() }, ..Self::default() }
    }

    /// Some instance has a policy that can request a rebuild.
    pub fn may_rebuild(&self) -> bool {
        self.requests.policies.may_rebuild()
    }

    /// The most demanding request of the tree's policies, if it has these attributes.
    pub(super) fn rebuild_request(&self, attributes: &Attributes, excess: Excess) -> RebuildRequest {
        let request = self.requests.policies.rebuild_request(&self.requests.history, attributes, excess);
        // There is only one tree over so few lights.
        let is_pointless = request <= RebuildRequest::Optional && self.tree.light_count() <= WIDTH;
        if is_pointless { RebuildRequest::None } else { request }
    }

    /// The present terms of the tree in the sums over all trees.
    pub(super) fn terms(&self) -> TreeTerms {
        TreeTerms {
            lights: self.tree.light_count() as u32,
            instances: self.instances.len() as u32,
            openings: self.openings.len() as u32,
            moving: u8::from(self.rest.is_moving()) + u8::from(self.source.is_some()),
            is_awake: self.rest.is_awake(),
            is_held_back: self.crowd.is_held_back,
        }
    }

    /// There are instances, and all of them promise that the lights do not change.
    pub fn is_static(&self) -> bool {
        self.requests.policies.is_static()
    }
}

impl Instance {
    /// An instance that the world does not have yet, with the lights as the tree has them.
    pub(super) fn new(tree: TreeKey, placement: Placement, policy: Policy, placed: Option<Placed>) -> Self {
        Self {
            tree,
            placement,
            policy,
            appearance: Appearance::default(),
            region: None,
            placed,
            birth: 0,
            index_in_tree: 0,
            counted: Effects::empty(),
            is_sky: false,
        }
    }

    /// Where the lights shine; `None` if they do not, because its placement hides the instance or
    /// because of its appearance.
    pub(crate) fn shown(&self) -> Option<&Placed> {
        self.placed.as_ref().filter(|_| self.appearance.is_shown())
    }

    /// The effects that the instance has; none if it is not shown.
    pub(crate) fn effects(&self) -> Effects {
        let sky = if self.is_sky { Effects::SKY } else { Effects::empty() };
        self.shown().map_or(Effects::empty(), |placed| placed.effects() | self.appearance.effects() | sky)
    }
}
