//! What the device holds once all plans are played.

use std::sync::Arc;

use super::PlanLimits;
use super::buffers::{Buffers, Ids, ShaderBuffers};
use super::changes::UploadReport;
use super::commands::Commands;
use super::cuts::CutStore;
use super::instance_store::InstanceStore;
use super::layout::{InstanceRecord, LightRecord, ParamsRecord};
use super::pool::Pool;
use super::previous::{Present, Previous};
use super::residency::Form;
use super::sources::SourceStore;
use super::top::TopBuild;
use super::tree_store::TreeStore;
use super::uniforms::Uniforms;
use crate::effects::Effects;
use crate::instance::portal::PlacedPortal;
use crate::instance::sector;
use crate::keys::slot_of;
use crate::sampling::view::NO_INSTANCE;
use crate::world::{LightWorld, Revision};

/// More commands than most builds of the top level take.
const MOST_OF_TOP: usize = 16;

/// What the device holds once all plans are played. A frame works on a copy, which replaces this if the engine takes
/// the plan. So nothing has to be taken back. A copy takes O(1): it shares all lists until one of the two changes them.
#[derive(Clone)]
pub(super) struct Held {
    pub trees: TreeStore,
    pub instances: InstanceStore,
    pub sources: SourceStore,
    pub uniforms: Uniforms,
    pub top: TopBuild,
    pub previous: Previous,
    pub cuts: CutStore,
    pub maps: WrittenMaps,
    pub buffers: Buffers,
    pub ids: Ids,
    /// How far the plans have followed the world.
    pub revision: Revision,
    /// The device may lack what was written.
    pub is_lost: bool,
    /// The effects of the world at the last plan, without [`Effects::MOVING`].
    pub effects: Effects,
    /// Plans that were made.
    pub number: u64,
}

/// What the device has of maps.
#[derive(Clone, Default)]
pub(super) struct WrittenMaps {
    /// The revision of the sky's map; 0 for none.
    pub sky: u64,
    /// Where the tables of profiles end, in quads.
    pub profiles: u32,
    pub portals: Arc<[PlacedPortal]>,
}

impl Held {
    /// Nothing yet.
    pub fn new(limits: PlanLimits) -> Self {
        Self {
            trees: TreeStore::new(limits),
            instances: InstanceStore::new(limits.largest_buffer),
            sources: SourceStore::new(limits.largest_buffer),
            uniforms: Uniforms::default(),
            top: TopBuild::new(limits.largest_buffer),
            previous: Previous::new(),
            cuts: CutStore::default(),
            maps: WrittenMaps::default(),
            buffers: Buffers::default(),
            ids: Ids::default(),
            revision: Revision::default(),
            is_lost: false,
            effects: Effects::all() - Effects::MOVING,
            number: 0,
        }
    }

    /// The buffers that shaders bind; `None` before the first plan.
    pub fn bindings(&self) -> Option<ShaderBuffers> {
        let params = self.uniforms.params_buffer?;
        Some(ShaderBuffers([
            params,
            self.top.nodes(),
            self.trees.nodes.buffer(),
            self.instances.pool.buffer(),
            self.trees.lights.buffer(),
        ]))
    }

    /// The buffers of instances and lights that shaders bind.
    pub fn present(&self) -> Option<[Present; 2]> {
        self.uniforms.params_buffer?;
        let (instances, lights) = (&self.instances.pool, &self.trees.lights);
        Some([
            (instances.buffer(), instances.used() * Pool::<InstanceRecord>::STRIDE, instances.bytes()),
            (lights.buffer(), lights.used() * Pool::<LightRecord>::STRIDE, lights.bytes()),
        ])
    }

    /// Adds the refit of sources and the build of the top level. Adds nothing before the first plan.
    pub fn build_top(&self, commands: &mut Commands) {
        if self.uniforms.params_buffer.is_some() {
            let [nodes, lights, records] =
                [self.trees.nodes.buffer(), self.trees.lights.buffer(), self.trees.records.buffer()];
            self.sources.refit(commands, [nodes, lights, records]);
            self.top.build(commands, [self.instances.parts.buffer(), self.instances.pool.buffer(), records]);
        }
    }

    /// Adds the refit and the build of the top level, which is then no longer due.
    pub fn finish_top(&mut self, commands: &mut Commands) {
        commands.reserve(MOST_OF_TOP, 0);
        self.build_top(commands);
        self.top.is_due = false;
    }

    /// The report of an upload of nothing but these commands.
    pub fn report_of(&self, upload: &Commands) -> UploadReport {
        UploadReport {
            bytes: upload.bytes_written(),
            waiting_trees: self.trees.residency.waiting_count(),
            waiting_bytes: self.trees.residency.waiting_bytes(),
            stand_ins: self.trees.residency.stand_in_count(),
            held_back_instances: self.trees.opened.held_back(),
            ..UploadReport::default()
        }
    }

    /// The slot of the sky's instance, if it is shown and its tree is on the device: older patches, or stand-ins, do
    /// not fit the map.
    fn sky_slot(&self, world: &LightWorld) -> Option<u32> {
        let (key, _) = world.sky()?;
        let instance = world.instance(key).filter(|instance| instance.shown().is_some())?;
        let state = self.trees.residency.get(slot_of(instance.tree));
        let has_nodes = world.tree(instance.tree).is_some_and(|tree| !tree.nodes().is_empty());
        (state.form == Form::Whole && !state.waits && has_nodes).then(|| slot_of(key))
    }

    /// The parameters of shaders.
    pub fn params_of(&self, world: &LightWorld) -> ParamsRecord {
        let effects = world.effects();
        ParamsRecord {
            slots: self.instances.count,
            directional_base: self.trees.directionals.start,
            directional_count: self.trees.directionals.len() as u32,
            sky: self.sky_slot(world).unwrap_or(NO_INSTANCE),
            solid_angles: u32::from(world.solid_angle_sampling()),
            parts: self.top.parts(),
            sky_map: match world.sky().is_some() || effects.contains(Effects::PROFILES) {
                true => self.top.sky_map(),
                false => 0,
            },
            masks: if effects.contains(Effects::MASKS) { self.top.masks() } else { 0 },
            home: sector::number(world.home()),
            padding: 0,
        }
    }
}
