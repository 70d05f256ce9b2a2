//! Plans the upload of a frame: what changed, and nothing else.

use std::ops::Range;

use super::LightPlanner;
use super::changes::{TreeRanges, UploadReport};
use super::commands::Commands;
use super::frame::FramePlan;
use super::layout::{Bases, InstanceRecord, LightRecord, ParamsRecord, TreeRecord};
use super::reserve::{Reservation, Room, TreeRuns, TreeWrite};
use super::scatter::{Scattered, scatter};
use crate::effects::Effects;
use crate::keys::{generation_of, slot_of};
use crate::world::LightWorld;

/// The short runs of each pool that takes them from staged records.
struct Staged {
    nodes: Scattered,
    lights: Scattered,
    trees: Scattered,
    instances: Scattered,
}

impl Reservation<'_> {
    /// Returns the plan of the frame. The buffers that were reserved must exist.
    ///
    /// Copies what is sent: O(what changed). A plan without changes has no commands.
    pub fn plan(mut self) -> FramePlan {
        self.is_used = true;
        let mut room = std::mem::take(&mut self.room);
        let (planner, world, changes, effects) = (&mut *self.planner, self.world, &self.changes, self.effects);
        planner.number += 1;
        planner.effects = effects;
        let mut plan = FramePlan { number: planner.number, ..FramePlan::default() };
        plan.new_buffers = std::mem::take(&mut room.new_buffers);
        let copies = std::mem::take(&mut room.copies);
        planner.previous.adopt(copies, planner.params, (&mut plan.upload, &mut plan.freed));
        if room.is_idle {
            if planner.is_top_due {
                planner.finish_top(&mut plan.top);
            }
            plan.report.bytes = plan.upload.bytes_written();
            planner.previous.changed([!plan.top.is_empty(), false, false, false]);
            return plan;
        }
        let ParamsRecord { strides, masks, home, .. } = planner.params;
        let former = (strides, masks, home);
        let is_new_top = planner.top.is_replaced() || planner.is_lost;
        let replaced = [planner.nodes.is_replaced(), planner.instances.is_replaced(), planner.lights.is_replaced()];
        let Room { placed, parts, directionals, trees, instances, instance_runs, is_scattered, .. } =
            planner.adopt(room, &mut plan);
        for (slot, ranges) in placed {
            let former = std::mem::replace(planner.tree_ranges_mut(slot), ranges);
            planner.release(former);
        }
        if let Some(range) = directionals {
            let former = std::mem::replace(&mut planner.directionals, range);
            planner.lights.free(former);
        }
        let commands = &mut plan.upload;
        planner.parts.write(commands, parts);
        let [nodes, lights, of_trees, of_instances] = is_scattered.map(Scattered::new);
        let mut staged = Staged { nodes, lights, trees: of_trees, instances: of_instances };
        let mut report = UploadReport {
            trees: changes.trees.as_slice().len(),
            instances: instances.as_slice().len(),
            ..UploadReport::default()
        };
        planner.write_trees(commands, &mut staged, world, &trees, &mut report);
        planner.write_instances(commands, &mut staged, world, instance_runs);
        if changes.directionals {
            let run = planner.directionals.clone();
            let records = world.directionals().map(|(_, light)| LightRecord::directional(light));
            planner.lights.write(commands, &mut Scattered::default(), run, records);
        }
        planner.scatter(commands, staged);
        planner.write_params(commands, world, effects);
        let ParamsRecord { strides, masks, home, .. } = planner.params;
        planner.top.prepare(commands, planner.parts.count(), strides, (masks, home));
        report.bytes = commands.bytes_written();
        plan.report = report;
        planner.is_lost = false;
        if changes.concern_lights() || is_new_top || former != (strides, masks, home) || planner.is_top_due {
            planner.finish_top(&mut plan.top);
        }
        planner.previous.changed([
            !plan.top.is_empty(),
            replaced[0] || report.nodes > 0,
            replaced[1] || report.instances > 0,
            replaced[2] || report.lights > 0 || changes.directionals,
        ]);
        plan
    }
}

impl LightPlanner {
    /// Takes new buffers into use. Returns what is left of the room.
    fn adopt(&mut self, room: Room, plan: &mut FramePlan) -> Room {
        let FramePlan { upload, freed, .. } = plan;
        self.relayout_uniform = room.relayout_uniform.or(self.relayout_uniform);
        self.scatter_uniform = room.scatter_uniform.or(self.scatter_uniform);
        if let Some(staging) = room.staging {
            freed.extend(self.staging.replace(staging).map(|(id, _)| id));
        }
        if let Some(params) = room.params {
            freed.extend(self.params_buffer.replace(params));
            // Nothing was written to the new one.
            self.params = ParamsRecord { slots: u32::MAX, ..ParamsRecord::default() };
        }
        self.instance_count = self.instance_count.max(room.slots.end);
        let uniform = |pass| self.relayout_uniform.map(|buffer| (buffer, pass));
        freed.extend(self.nodes.adopt(upload, uniform(0)));
        freed.extend(self.lights.adopt(upload, uniform(1)));
        freed.extend(self.instances.adopt(upload, uniform(2)));
        freed.extend(self.trees.adopt(upload, None));
        freed.extend(self.parts.pool().adopt(upload, None));
        self.top.adopt(upload, freed);
        room
    }

    /// Writes what has changed in trees since they were written last.
    fn write_trees(
        &mut self,
        commands: &mut Commands,
        staged: &mut Staged,
        world: &LightWorld,
        TreeRuns { runs, trees }: &TreeRuns,
        report: &mut UploadReport,
    ) {
        for TreeWrite { slot, nodes, lights } in trees {
            let Some(entry) = world.tree_at(*slot).and_then(|key| world.tree_entry(key)) else { continue };
            let (tree, ranges) = (&entry.tree, &mut self.tree_ranges[*slot as usize]);
            ranges.revision = entry.log.revision();
            let TreeRanges { nodes: node_range, lights: light_range, records, division, .. } = &*ranges;
            for run in &runs[nodes.clone()] {
                let range = run.start as usize..run.end as usize;
                report.nodes += range.len();
                let target = node_range.start + run.start..node_range.start + run.end;
                self.nodes.write(commands, &mut staged.nodes, target, tree.nodes()[range].iter().copied());
            }
            for run in &runs[lights.clone()] {
                let range = run.start as usize..run.end as usize;
                report.lights += range.len();
                let lights = tree.lights()[range.clone()].iter().zip(&tree.leaves()[range]);
                let fill = lights.map(|(light, place)| LightRecord::of(light, *place));
                let target = light_range.start + run.start..light_range.start + run.end;
                self.lights.write(commands, &mut staged.lights, target, fill);
            }
            let fill = TreeRecord::of(tree, *division).into_iter();
            self.trees.write(commands, &mut staged.trees, records.clone(), fill);
        }
    }

    /// Writes the records of instances.
    fn write_instances(&self, commands: &mut Commands, staged: &mut Staged, world: &LightWorld, runs: Vec<Range<u32>>) {
        for run in runs {
            let records = run.clone().map(|slot| self.instance_record(slot, world));
            self.instances.write(commands, &mut staged.instances, run, records);
        }
    }

    fn instance_record(&self, slot: u32, world: &LightWorld) -> InstanceRecord {
        let Some(key) = world.instance_at(slot) else { return InstanceRecord::NONE };
        let generation = generation_of(key);
        let Some(instance) = world.instance(key) else { return InstanceRecord::NONE };
        let Some(placed) = instance.shown() else { return InstanceRecord::hidden(generation) };
        let ranges = &self.tree_ranges[slot_of(instance.tree) as usize];
        let parts = self.parts.range(slot);
        let bases = Bases {
            tree: ranges.records.start,
            node: ranges.nodes.start,
            light: ranges.lights.start,
            part: parts.start,
            division: ranges.division,
        };
        InstanceRecord::of(placed, &instance.appearance, bases).with_generation(generation)
    }

    /// Sends the staged records, if there are any.
    fn scatter(&self, commands: &mut Commands, staged: Staged) {
        let (Some((staging, _)), Some(uniform)) = (self.staging, self.scatter_uniform) else { return };
        let targets = [
            (self.nodes.buffer(), self.nodes.stride(), staged.nodes),
            (self.lights.buffer(), self.lights.stride(), staged.lights),
            (self.trees.buffer(), self.trees.stride(), staged.trees),
            (self.instances.buffer(), self.instances.stride(), staged.instances),
        ];
        scatter(commands, targets, (staging, uniform));
    }

    /// Sends the parameters, if they have changed.
    fn write_params(&mut self, commands: &mut Commands, world: &LightWorld, effects: Effects) {
        let params = self.params_of(world, effects);
        if let Some(buffer) = self.params_buffer
            && (params != self.params || self.is_lost)
        {
            commands.write(buffer, 0, bytemuck::bytes_of(&params));
            self.params = params;
        }
    }

    /// Adds the build of the top level, which is then no longer due.
    fn finish_top(&mut self, commands: &mut Commands) {
        self.build_top(commands);
        self.is_top_due = false;
    }
}
