//! The light world of the render world, and the edits that are applied to it.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use bevy::ecs::entity::Entity;
use bevy::ecs::resource::Resource;
use bevy::log::warn_once;
use bevy::math::{Mat3, Quat, Vec3};
use girandole::{
    DirectionalKey, DirectionalLight, FrameBudget, FrameReport, InstanceKey, LightTree, LightWorld, Placement, Policy,
    Sky, TreeKey, TreeSource, WorldError,
};

use crate::edits::{Edit, Edits, State, Tree, Written};
use crate::kinds::KindRecord;
use crate::rigs::{Pose, PosedMesh};

/// What the number of a light refers to.
#[derive(Clone, Debug, Default)]
enum Slot {
    #[default]
    Empty,
    Instance(InstanceKey, u32),
    /// A directional light; `None` while it is hidden.
    Directional(Option<DirectionalKey>),
    /// A light that the world refused. It is tried again when it moves or changes.
    Refused(Box<State>),
}

/// `LIGHT_DIRECTIONAL` of the library's WGSL.
const LIGHT_DIRECTIONAL: u32 = u32::MAX;

/// A mesh that an entity poses.
#[derive(Clone, Debug)]
pub struct Posed {
    pub mesh: Arc<PosedMesh>,
    /// Without joints until it is sent.
    pub pose: Pose,
}

/// The lights, in the render world. After [`GirandoleSystems::Upload`](crate::GirandoleSystems::Upload) they are those of
/// the frame.
#[derive(Resource, Debug)]
pub struct GirandoleLights {
    pub(crate) world: LightWorld,
    trees: Vec<Option<TreeKey>>,
    slots: Vec<Slot>,
    /// Slots of instances in use, free ones between them included.
    pub(crate) slot_count: u32,
    /// What the shader knows of each kind.
    pub(crate) records: Vec<KindRecord>,
    /// Whether `records` have changed since the last upload.
    pub(crate) has_new_records: bool,
    /// Meshes that are posed, by kind.
    pub(crate) posed: HashMap<u32, Posed>,
    /// Whether `posed` has changed since the last upload.
    pub(crate) has_new_poses: bool,
    /// The kinds that passes of the application write, by entity.
    passes: HashMap<Entity, u32>,
    has_new_names: bool,
    /// Whether any surface changed since the last frame.
    pub(crate) has_new_surfaces: bool,
    /// The edits of this frame, which were extracted and not yet applied.
    pub(crate) edits: Edits,
    pub(crate) counts: Counts,
}

/// What was done with the edits since the last report.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counts {
    pub added: usize,
    pub removed: usize,
    pub moved: usize,
    pub changed: usize,
    /// Over all frames.
    pub refused: u64,
    pub gather: Duration,
    pub apply: Duration,
}

impl Counts {
    /// Whether any light has changed.
    pub fn any(&self) -> bool {
        self.added + self.removed + self.moved + self.changed > 0
    }
}

impl Default for GirandoleLights {
    fn default() -> Self {
        Self {
            world: {
                let mut world = LightWorld::new();
                world.set_glossy_sampling(true);
                world
            },
            trees: Vec::new(),
            slots: Vec::new(),
            slot_count: 0,
            records: vec![KindRecord::default()],
            has_new_records: true,
            posed: HashMap::new(),
            has_new_poses: false,
            passes: HashMap::new(),
            has_new_names: false,
            has_new_surfaces: false,
            edits: Edits::default(),
            counts: Counts::default(),
        }
    }
}

impl GirandoleLights {
    /// The light world, to look at, to sample on the CPU, or to write into a dump. Keys are those of the plugin.
    pub fn world(&self) -> &LightWorld {
        &self.world
    }

    /// Applies the edits that were extracted, and adds to the counts.
    pub(crate) fn apply(&mut self) {
        let started = Instant::now();
        let edits = std::mem::take(&mut self.edits);
        self.counts.gather += edits.gather;
        self.has_new_names |= !edits.edits.is_empty();
        self.has_new_surfaces |= edits.has_new_surfaces;
        for edit in edits.edits {
            // A kind is refused for each of its lights.
            let is_light = !matches!(edit, Edit::AddKind { .. });
            if let Err(error) = self.edit(edit) {
                self.counts.refused += u64::from(is_light);
                warn_once!("girandole: a light was refused: {error}");
            }
        }
        self.follow(edits.moves);
        self.pose(edits.poses);
        self.counts.apply += started.elapsed();
    }

    /// Returns the counts since the last call. Only `refused` goes on.
    pub(crate) fn take_counts(&mut self) -> Counts {
        let refused = self.counts.refused;
        std::mem::replace(&mut self.counts, Counts { refused, ..Counts::default() })
    }

    /// Refits and rebuilds trees within a budget.
    pub(crate) fn update(&mut self, budget: FrameBudget) -> FrameReport {
        self.world.update(budget)
    }

    fn edit(&mut self, edit: Edit) -> Result<(), WorldError> {
        match edit {
            Edit::AddKind { kind, tree } => self.add_kind(kind, tree),
            Edit::ReplaceKind { kind, tree: Tree { lights, record, written } } => {
                self.counts.changed += 1;
                let Some(tree) = self.trees.get(kind as usize).copied().flatten() else { return Ok(()) };
                if let Err(error) = self.world.replace_lights(tree, lights) {
                    // The former triangles are no longer those of the mesh.
                    self.record(kind, KindRecord { lights: 0, ..record });
                    self.world.replace_lights(tree, Vec::new())?;
                    self.write(kind, tree, None)?;
                    return Err(error);
                }
                self.record(kind, record);
                self.write(kind, tree, written)
            }
            Edit::RemoveKind { kind } => match self.trees.get_mut(kind as usize).and_then(Option::take) {
                Some(tree) => {
                    self.write(kind, tree, None)?;
                    self.world.remove_tree(tree)
                }
                None => Ok(()),
            },
            Edit::Add { light, state } => {
                self.counts.added += 1;
                self.put(light, state)
            }
            Edit::Set { light, state } => {
                self.counts.changed += 1;
                self.set(light, state)
            }
            Edit::Show { light, shown } => {
                self.counts.changed += 1;
                match self.slots.get_mut(light as usize) {
                    Some(Slot::Instance(key, _)) => self.world.set_appearance(*key, |a| a.is_enabled = shown),
                    Some(Slot::Refused(state)) => {
                        state.shown = shown;
                        Ok(())
                    }
                    _ => Ok(()),
                }
            }
            Edit::Directional { light, shown, value } => {
                self.counts.changed += 1;
                self.directional(light, shown, value)
            }
            Edit::Remove { light } => {
                self.counts.removed += 1;
                self.remove(light)
            }
            Edit::SetSky { kind, map } => {
                self.counts.changed += 1;
                self.set_sky(kind, *map)
            }
            Edit::AdjustSky { rotation, factor } => {
                self.counts.changed += 1;
                self.adjust_sky(rotation, factor)
            }
            Edit::RemoveSky => {
                self.counts.removed += 1;
                self.remove_sky()
            }
        }
    }

    fn record(&mut self, kind: u32, record: KindRecord) {
        let kind = kind as usize;
        if self.records.len() <= kind {
            self.records.resize(kind + 1, KindRecord::default());
        }
        self.has_new_records |= self.records[kind] != record;
        self.records[kind] = record;
    }

    fn add_kind(&mut self, kind: u32, Tree { lights, record, written }: Tree) -> Result<(), WorldError> {
        self.record(kind, record);
        if self.trees.len() <= kind as usize {
            self.trees.resize(kind as usize + 1, None);
        }
        self.trees[kind as usize] = None;
        let tree = self.world.add_tree(LightTree::new(lights)?);
        self.trees[kind as usize] = Some(tree);
        self.write(kind, tree, written)
    }

    /// Sets what writes the lights of a kind on the GPU.
    fn write(&mut self, kind: u32, tree: TreeKey, written: Option<Written>) -> Result<(), WorldError> {
        let pose = self.posed.remove(&kind).map(|posed| posed.pose);
        self.has_new_poses |= pose.is_some();
        self.passes.retain(|_, of_entity| *of_entity != kind);
        match written {
            None => self.world.set_light_source(tree, TreeSource::Cpu),
            Some(Written::Pass(entity, source)) => {
                self.world.set_light_source(tree, source)?;
                self.passes.insert(entity, kind);
                Ok(())
            }
            Some(Written::Posed(mesh)) => {
                self.world.set_light_source(tree, TreeSource::GpuMesh)?;
                self.has_new_poses = true;
                self.posed.insert(kind, Posed { mesh, pose: pose.unwrap_or_default() });
                Ok(())
            }
        }
    }

    /// The number by which kernels know the tree of a kind.
    pub(crate) fn source_number(&self, kind: u32) -> Option<u32> {
        let tree = self.trees.get(kind as usize).copied().flatten()?;
        self.world.light_source(tree).map(|(_, number)| number)
    }

    /// The numbers of the sources that passes of the application write, by entity.
    pub(crate) fn source_numbers(&self) -> HashMap<Entity, u32> {
        self.passes.iter().filter_map(|(entity, kind)| Some((*entity, self.source_number(*kind)?))).collect()
    }

    /// Trees whose lights are written on the GPU.
    pub(crate) fn written_trees(&self) -> usize {
        self.posed.len() + self.passes.len()
    }

    /// Poses meshes.
    fn pose(&mut self, poses: Vec<(u32, Pose)>) {
        self.counts.moved += poses.len();
        for (kind, pose) in poses {
            if let Some(posed) = self.posed.get_mut(&kind) {
                posed.pose = pose;
                self.has_new_poses = true;
            }
        }
    }

    /// Whether lights may have other names than at the last call.
    pub(crate) fn take_new_names(&mut self) -> bool {
        std::mem::take(&mut self.has_new_names)
    }

    /// The slot of the instance of a light and 0, or `LIGHT_DIRECTIONAL` and the number of a directional light.
    pub(crate) fn name(&self, light: u32) -> Option<(u32, u32)> {
        match self.slot(light) {
            Slot::Instance(key, _) => self.world.slot(key).map(|slot| (slot, 0)),
            Slot::Directional(Some(key)) => {
                let number = self.world.directionals().position(|of| of == key)?;
                Some((LIGHT_DIRECTIONAL, number as u32))
            }
            _ => None,
        }
    }

    fn slot(&self, light: u32) -> Slot {
        self.slots.get(light as usize).cloned().unwrap_or_default()
    }

    /// Adds a light. One that is refused leaves nothing in the world.
    fn put(&mut self, light: u32, state: State) -> Result<(), WorldError> {
        if self.slots.len() <= light as usize {
            self.slots.resize(light as usize + 1, Slot::Empty);
        }
        self.slots[light as usize] = Slot::Refused(Box::new(state));
        let Some(tree) = self.trees.get(state.kind as usize).copied().flatten() else {
            // The log has the reason for which the kind was refused.
            self.counts.refused += 1;
            return Ok(());
        };
        let key = self.world.add_instance(tree, state.placement, Policy::Budgeted)?;
        if let Err(error) = self.adjust(key, state) {
            self.world.remove_instance(key)?;
            return Err(error);
        }
        self.slots[light as usize] = Slot::Instance(key, state.kind);
        self.slot_count = self.slot_count.max(self.world.slot(key).map_or(0, |slot| slot + 1));
        Ok(())
    }

    /// Gives an instance the state of a light of the same kind.
    fn adjust(&mut self, key: InstanceKey, state: State) -> Result<(), WorldError> {
        self.world.set_appearance(key, |a| a.user_data = state.kind)?;
        self.world.move_instance(key, state.placement)?;
        self.world.set_appearance(key, |appearance| {
            appearance.factor = state.factor;
            appearance.is_enabled = state.shown;
        })
    }

    /// Changes a light. One that is refused goes dark.
    fn set(&mut self, light: u32, state: State) -> Result<(), WorldError> {
        match self.slot(light) {
            Slot::Instance(key, kind) if kind == state.kind => {
                let result = self.adjust(key, state);
                if result.is_err() {
                    self.remove(light)?;
                    self.slots[light as usize] = Slot::Refused(Box::new(state));
                }
                result
            }
            _ => {
                self.remove(light)?;
                self.put(light, state)
            }
        }
    }

    fn directional(&mut self, light: u32, shown: bool, value: DirectionalLight) -> Result<(), WorldError> {
        if self.slots.len() <= light as usize {
            self.slots.resize(light as usize + 1, Slot::Empty);
        }
        match self.slots[light as usize] {
            Slot::Directional(Some(key)) if shown => return self.world.set_directional(key, value),
            _ => self.remove(light)?,
        }
        let key = if shown { Some(self.world.add_directional(value)?) } else { None };
        self.slots[light as usize] = Slot::Directional(key);
        Ok(())
    }

    fn set_sky(&mut self, kind: u32, map: Sky) -> Result<(), WorldError> {
        let sky = self.world.set_sky(map);
        let patches = self.world.instance(sky).and_then(|sky| self.world.tree(sky.tree));
        self.record(kind, KindRecord::sky(patches.map_or(0, LightTree::light_count)));
        self.slot_count = self.slot_count.max(self.world.slot(sky).map_or(0, |slot| slot + 1));
        self.world.set_appearance(sky, |a| a.user_data = kind)
    }

    /// Turns the sky and sets its factor. A sky that is refused is dark until the next one is right.
    fn adjust_sky(&mut self, rotation: Quat, factor: f32) -> Result<(), WorldError> {
        let Some((sky, _)) = self.world.sky() else { return Ok(()) };
        let placement = Placement { linear: Mat3::from_quat(rotation), ..Placement::IDENTITY };
        let adjusted = self
            .world
            .move_instance(sky, placement)
            .and_then(|()| self.world.set_appearance(sky, |sky| sky.factor = Vec3::splat(factor)));
        self.world.set_appearance(sky, |sky| sky.is_enabled = adjusted.is_ok())?;
        adjusted
    }

    fn remove_sky(&mut self) -> Result<(), WorldError> {
        let Some((sky, _)) = self.world.sky() else { return Ok(()) };
        let patches = self.world.instance(sky).map(|sky| sky.tree);
        self.world.remove_instance(sky)?;
        patches.map_or(Ok(()), |tree| self.world.remove_tree(tree))
    }

    fn remove(&mut self, light: u32) -> Result<(), WorldError> {
        let Some(slot) = self.slots.get_mut(light as usize) else { return Ok(()) };
        match std::mem::take(slot) {
            Slot::Instance(key, _) => self.world.remove_instance(key),
            Slot::Directional(Some(key)) => self.world.remove_directional(key),
            Slot::Directional(None) | Slot::Refused(_) | Slot::Empty => Ok(()),
        }
    }

    /// Moves all lights in one call or, if one of the moves is refused, each by itself. Lights that
    /// were refused are tried again at their new place.
    fn follow(&mut self, moves: Vec<(u32, Placement)>) {
        let mut retries = Vec::new();
        // In the memory of the moves: both pairs have one size.
        let instance = |(light, placement)| match self.slots.get(light as usize) {
            Some(Slot::Instance(key, _)) => Some((*key, placement)),
            Some(Slot::Refused(state)) if state.placement != placement => {
                retries.push((light, State { placement, ..**state }));
                None
            }
            _ => None,
        };
        let instances: Vec<(InstanceKey, Placement)> = moves.into_iter().filter_map(instance).collect();
        retries.into_iter().for_each(|(light, state)| self.retry(light, state));
        self.counts.moved += instances.len();
        if self.world.move_instances(&instances).is_err() {
            for &(key, placement) in &instances {
                if let Err(error) = self.world.move_instance(key, placement) {
                    self.counts.refused += 1;
                    warn_once!("girandole: a move was refused: {error}");
                }
            }
        }
    }

    /// Tries to add a light that was refused before.
    fn retry(&mut self, light: u32, state: State) {
        match self.put(light, state) {
            Ok(()) => self.counts.changed += usize::from(matches!(self.slot(light), Slot::Instance(..))),
            Err(error) => {
                self.counts.refused += 1;
                warn_once!("girandole: a light was refused: {error}");
            }
        }
    }
}

#[cfg(test)]
mod tests;
