//! Brings the GPU's buffers up to date with a world: what changed, and nothing else.

use std::collections::BTreeSet;
use std::ops::Range;

use super::GpuLights;
use super::error::GpuError;
use super::layout::{InstanceRecord, LightRecord, ParamsRecord, Strides, TreeRecord};
use super::pool::Pool;
use super::probe;
use super::relayout::Relayout;
use super::stored::{self, Stored};
use crate::effects::Effects;
use crate::keys::{TreeKey, slot_of};
use crate::tree::LightTree;
use crate::world::{FrameDelta, LightWorld};

/// What [`GpuLights::upload`] sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UploadReport {
    /// Bytes written to buffers; 0 if nothing changed.
    pub bytes: u64,
    /// Trees whose nodes and lights were written.
    pub trees: usize,
    /// Instances whose records were written.
    pub instances: usize,
}

/// Which tree a slot holds on the GPU, and where it lies in the pools.
#[derive(Clone, Debug, Default)]
pub(super) struct TreeRanges {
    key: Option<TreeKey>,
    nodes: Range<u32>,
    lights: Range<u32>,
}

impl TreeRanges {
    /// The end of its nodes, for tests.
    #[cfg(test)]
    pub(super) fn node_end(&self) -> u32 {
        self.nodes.end
    }

    /// The end of its lights, for tests.
    #[cfg(test)]
    pub(super) fn light_end(&self) -> u32 {
        self.lights.end
    }

    fn fits(&self, tree: &LightTree) -> bool {
        self.nodes.len() == tree.nodes().len() && self.lights.len() == tree.lights().len()
    }
}

impl GpuLights {
    /// Writes what `delta` names, as `world` has it now. Give it every delta that [`LightWorld::take_delta`] returned, or
    /// [`FrameDelta::everything`] once. Trees that an instance needs and that never came are sent along.
    ///
    /// # Errors
    /// [`GpuError::Full`] if something would outgrow its buffer. Then nothing was written; what the delta names is
    /// remembered and goes with the next upload, once the world holds less. [`GpuError::DeviceLost`] from the first call
    /// on after wgpu noticed; in browsers only the engine's own `set_device_lost_callback` tells.
    ///
    /// O(what changed). Writes go through the queue, ahead of the next submission. What is stored of nodes, lights and
    /// instances follows the world's effects: where these change, the GPU copies its pools, and everything is bound
    /// anew.
    pub fn upload(&mut self, world: &LightWorld, delta: &FrameDelta) -> Result<UploadReport, GpuError> {
        self.upload_as(world, delta, world.effects())
    }

    /// The same in the layout of these effects, which must contain the world's.
    pub(super) fn upload_as(
        &mut self,
        world: &LightWorld,
        delta: &FrameDelta,
        effects: Effects,
    ) -> Result<UploadReport, GpuError> {
        probe::check(&self.device)?;
        let mut report = UploadReport::default();
        let is_still = delta.is_empty() && self.unsent.is_empty() && !self.has_new_usage();
        if is_still && self.params.strides == Strides::of(effects) {
            self.effects = effects;
            return Ok(report);
        }
        let mut changes = std::mem::take(&mut self.unsent);
        changes.add(delta);
        let reserved = self.set_layout(effects).and_then(|sent| Ok((sent, self.reserve(world, &mut changes)?)));
        let placed = match reserved {
            Ok((sent, placed)) => {
                report.bytes += sent;
                placed
            }
            Err(error) => {
                self.unsent = changes;
                return Err(error);
            }
        };

        // Trees that moved within the pools take their instances along.
        for (slot, ranges) in placed {
            let former = std::mem::replace(self.tree_ranges_mut(slot), ranges);
            self.release(former);
            if let Some(entry) = world.tree_at(slot).and_then(|key| world.tree_entry(key)) {
                changes.instances.extend(entry.instances.iter().map(|key| slot_of(*key)));
            }
        }
        for slot in &changes.trees {
            report.bytes += self.write_tree(*slot, world);
        }
        report.trees = changes.trees.len();
        report.instances = changes.instances.len();
        report.bytes += self.write_instances(&changes.instances, world);
        if changes.directionals {
            let records: Vec<_> = world.directionals().map(|(_, light)| LightRecord::directional(light)).collect();
            report.bytes += self.lights.write(self.directionals.start, &records);
        }
        report.bytes += self.follow_usage(&changes.instances, world);
        report.bytes += self.refresh(self.params_of(world, effects));
        self.bind_usage();
        self.top_is_stale = true;
        self.effects = effects;
        Ok(report)
    }

    /// Brings the pools into the layout that a world of these effects is stored in, or leaves them all as they are
    /// where one would outgrow its buffer. Until the next success, shaders keep the old buffers, with the old strides.
    fn set_layout(&mut self, effects: Effects) -> Result<u64, GpuError> {
        let [nodes, lights, instances] = [Stored::nodes(effects), Stored::lights(effects), Stored::instances(effects)];
        self.nodes.check_layout(&nodes)?;
        self.lights.check_layout(&lights)?;
        self.instances.check_layout(&instances)?;
        let mut sent = 0;
        let relayout = Relayout::default;
        if *self.nodes.stored() != nodes {
            let relayout = self.relayout.get_or_insert_with(relayout);
            sent += self.nodes.set_layout(nodes, stored::missing_of_node, relayout);
        }
        if *self.lights.stored() != lights {
            let relayout = self.relayout.get_or_insert_with(relayout);
            sent += self.lights.set_layout(lights, stored::missing_of_light, relayout);
        }
        if *self.instances.stored() != instances {
            let relayout = self.relayout.get_or_insert_with(relayout);
            sent += self.instances.set_layout(instances, stored::missing_of_instance, relayout);
        }
        Ok(sent)
    }

    /// Finds room for all that grew, or takes nothing. Returns the trees that need a new place; a removed tree's is empty.
    fn reserve(&mut self, world: &LightWorld, changes: &mut Unsent) -> Result<Vec<(u32, TreeRanges)>, GpuError> {
        for slot in &changes.instances {
            let tree = world.instance_at(*slot).and_then(|key| world.instance_tree(key));
            if let Some(tree) = tree
                && self.tree_ranges_mut(slot_of(tree)).key != Some(tree)
            {
                changes.trees.insert(slot_of(tree));
            }
        }
        let mut placed = Vec::new();
        let reserved = self.reserve_all(world, changes, &mut placed);
        if reserved.is_err() {
            for (_, ranges) in placed.drain(..) {
                self.release(ranges);
            }
        }
        reserved.map(|()| placed)
    }

    fn reserve_all(
        &mut self,
        world: &LightWorld,
        changes: &Unsent,
        placed: &mut Vec<(u32, TreeRanges)>,
    ) -> Result<(), GpuError> {
        for slot in changes.trees.iter().copied() {
            let key = world.tree_at(slot);
            match key.and_then(|key| world.tree(key)) {
                Some(tree) if self.tree_ranges_mut(slot).key == key && self.tree_ranges_mut(slot).fits(tree) => {}
                Some(tree) => {
                    let nodes = self.nodes.alloc(tree.nodes().len() as u32)?;
                    match self.lights.alloc(tree.lights().len() as u32) {
                        Ok(lights) => placed.push((slot, TreeRanges { key, nodes, lights })),
                        Err(error) => {
                            self.nodes.free(nodes);
                            return Err(error);
                        }
                    }
                }
                None => placed.push((slot, TreeRanges::default())),
            }
        }
        let highest = changes.trees.iter().max().map_or(0, |slot| slot + 1);
        grow_table(&mut self.trees, &mut self.tree_count, highest)?;
        grow_table(&mut self.instances, &mut self.instance_count, world.slot_count() as u32)?;
        self.top.reserve(world.slot_count() as u32)?;
        if changes.directionals {
            let count = world.directionals().count() as u32;
            if count as usize != self.directionals.len() {
                let range = self.lights.alloc(count)?;
                self.lights.free(std::mem::replace(&mut self.directionals, range));
            }
        }
        Ok(())
    }

    fn release(&mut self, ranges: TreeRanges) {
        self.nodes.free(ranges.nodes);
        self.lights.free(ranges.lights);
    }

    fn tree_ranges_mut(&mut self, slot: u32) -> &mut TreeRanges {
        let slot = slot as usize;
        if self.tree_ranges.len() <= slot {
            self.tree_ranges.resize_with(slot + 1, TreeRanges::default);
        }
        &mut self.tree_ranges[slot]
    }

    fn write_tree(&mut self, slot: u32, world: &LightWorld) -> u64 {
        let Some(tree) = world.tree_at(slot).and_then(|key| world.tree(key)) else { return 0 };
        let lights: Vec<_> =
            tree.lights().iter().zip(tree.leaves()).map(|(light, place)| LightRecord::of(light, *place)).collect();
        let ranges = &self.tree_ranges[slot as usize];
        self.nodes.write(ranges.nodes.start, tree.nodes())
            + self.lights.write(ranges.lights.start, &lights)
            + self.trees.write(slot, &[TreeRecord::of(tree)])
    }

    /// Writes neighbouring slots together.
    fn write_instances(&mut self, slots: &BTreeSet<u32>, world: &LightWorld) -> u64 {
        let mut bytes = 0;
        let mut run: Vec<InstanceRecord> = Vec::new();
        let mut first = 0;
        for slot in slots {
            if first + run.len() as u32 != *slot {
                bytes += self.instances.write(first, &run);
                run.clear();
                first = *slot;
            }
            run.push(self.instance_record(*slot, world));
        }
        bytes + self.instances.write(first, &run)
    }

    fn instance_record(&self, slot: u32, world: &LightWorld) -> InstanceRecord {
        let Some(instance) = world.instance_at(slot).and_then(|key| world.instance(key)) else {
            return InstanceRecord::NONE;
        };
        let tree = slot_of(instance.tree);
        let ranges = &self.tree_ranges[tree as usize];
        InstanceRecord::of(&instance.placed, tree, ranges.nodes.start, ranges.lights.start)
    }

    fn params_of(&self, world: &LightWorld, effects: Effects) -> ParamsRecord {
        ParamsRecord {
            slots: world.slot_count() as u32,
            directional_base: self.directionals.start,
            directional_count: self.directionals.len() as u32,
            strides: Strides::of(effects),
            ..self.params
        }
    }
}

/// Slots to be written: a delta's, those of deltas that failed before it, and what follows from them.
#[derive(Clone, Debug, Default)]
pub(super) struct Unsent {
    trees: BTreeSet<u32>,
    instances: BTreeSet<u32>,
    directionals: bool,
}

impl Unsent {
    fn is_empty(&self) -> bool {
        self.trees.is_empty() && self.instances.is_empty() && !self.directionals
    }

    fn add(&mut self, delta: &FrameDelta) {
        self.trees.extend(&delta.trees);
        self.instances.extend(&delta.instances);
        self.directionals |= delta.directionals;
    }
}

/// Makes room for records 0 to `count` of a pool that is used as a table: nothing is ever given back, so every
/// reservation continues the last.
fn grow_table<T: bytemuck::NoUninit>(pool: &mut Pool<T>, used: &mut u32, count: u32) -> Result<(), GpuError> {
    if count > *used {
        let range = pool.alloc(count - *used)?;
        debug_assert_eq!(range.start, *used, "a table has no gaps");
        *used = range.end;
    }
    Ok(())
}
