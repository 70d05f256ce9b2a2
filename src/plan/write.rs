//! Plans the upload of a frame: what changed, and nothing else.

use std::collections::BTreeMap;
use std::ops::Range;

use super::LightPlanner;
use super::changes::UploadReport;
use super::commands::Commands;
use super::frame::FramePlan;
use super::layout::{Bases, InstanceRecord, LightRecord, ParamsRecord, STAND_IN, TreeRecord, stored_place};
use super::node_record::{NodeRecord, stored_nodes};
use super::pool::Pool;
use super::reserve::Reservation;
use super::residency::{Form, Incoming, TreeState};
use super::room::{Room, TreeRoom};
use super::scatter::{MAX_TARGETS, Scattered, scatter};
use super::tree_writes::{Source, TreeRuns, written_records};
use crate::effects::Effects;
use crate::instance::portal::portal_quads;
use crate::keys::slot_of;
use crate::math::dice::hash;
use crate::profile::for_each_table;
use crate::span::span;
use crate::tree::{ChildRef, LEAF, Node};
use crate::world::{LightWorld, birth_of_directional, birth_of_instance};

/// Commands and bytes of a plan besides the records of the large pools: parts and parameters.
const MORE_COMMANDS: usize = 32;
const MORE_BYTES: u64 = 4096;

/// The bytes of a record of each pool that takes short runs from staged records.
const STRIDES: [u64; MAX_TARGETS] = [
    Pool::<NodeRecord>::STRIDE,
    Pool::<LightRecord>::STRIDE,
    Pool::<TreeRecord>::STRIDE,
    Pool::<InstanceRecord>::STRIDE,
];

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
        span!("plan");
        self.is_used = true;
        let mut room = std::mem::take(&mut self.room);
        let (planner, world, changes) = (&mut *self.planner, self.world, &self.changes);
        planner.number += 1;
        planner.revision = world.revision();
        // No shader depends on whether lights move.
        planner.effects = world.effects() - Effects::MOVING;
        let mut plan = FramePlan { number: planner.number, ..FramePlan::default() };
        plan.new_buffers = std::mem::take(&mut room.new_buffers);
        planner.trees.is_resized = false;
        let copies = std::mem::take(&mut room.copies);
        planner.previous.adopt(copies, planner.uniforms.params, (&mut plan.upload, &mut plan.freed));
        if room.is_idle {
            planner.lists.keep(room.trees.writes, room.runs.instances);
            planner.top.is_due |= planner.sources.is_active();
            if planner.top.is_due {
                planner.finish_top(&mut plan.top);
            }
            planner.cuts.follow(&mut plan.upload, world.origin(), (!plan.top.is_empty(), false));
            plan.report = planner.report_of(&plan.upload);
            let is_refit = planner.sources.is_active();
            planner.previous.changed([false, is_refit]);
            planner.buffers.change(&plan.new_buffers, &plan.freed);
            return plan;
        }
        let ParamsRecord { masks, home, .. } = planner.uniforms.params;
        let former = (masks, home);
        let is_new_top = planner.top.is_replaced() || planner.is_lost;
        let replaced = [planner.instances.pool.is_replaced(), planner.trees.lights.is_replaced()];
        let room = planner.adopt(room, &mut plan);
        let mut staged = planner.make_lists(&room, &mut plan.upload);
        let Room { trees, parts, directionals, sources, runs, .. } = room;
        let TreeRoom { placed, incoming, is_packed, writes, .. } = trees;
        planner.place(placed, incoming);
        planner.trees.residency.is_packed |= is_packed;
        if let Some(range) = directionals {
            let former = std::mem::replace(&mut planner.trees.directionals, range);
            planner.trees.lights.free(former);
        }
        let commands = &mut plan.upload;
        planner.instances.parts.write(commands, parts);
        let mut report = UploadReport {
            trees: changes.trees.as_slice().len(),
            instances: changes.instances.as_slice().len(),
            ..planner.waiting_report()
        };
        planner.write_trees(commands, &mut staged, world, &writes, &mut report);
        planner.write_instances(commands, &mut staged, world, &runs.instances);
        planner.lists.keep(writes, runs.instances);
        if changes.directionals {
            let run = planner.trees.directionals.clone();
            let records = world
                .directional_lights()
                .map(|(key, light)| LightRecord::directional(light).with_birth(birth_of_directional(key)));
            planner.trees.lights.write(commands, &mut Scattered::default(), run, records);
        }
        planner.scatter(commands, staged);
        planner.write_portals(commands, world, is_new_top);
        planner.write_profiles(commands, is_new_top);
        planner.write_sky(commands, world, is_new_top);
        planner.write_params(commands, world);
        planner.previous.follow_maps(planner.uniforms.params, commands);
        let ParamsRecord { masks, home, .. } = planner.uniforms.params;
        planner.sources.adopt(sources, commands, &mut plan.freed);
        planner.top.is_due |= planner.sources.is_active();
        let parts = planner.instances.parts.count();
        let partition = planner.top.fitting(world.partition(), parts, super::reserve::map_sizes(world));
        planner.top.prepare(commands, (parts, &partition), (masks, home));
        if changes.concern_lights || is_new_top || former != (masks, home) || planner.top.is_due {
            planner.finish_top(&mut plan.top);
        }
        let is_void = commands.bytes_written() > 0 || !plan.top.is_empty();
        planner.cuts.follow(commands, world.origin(), (is_void, planner.is_lost));
        report.bytes = commands.bytes_written();
        plan.report = report;
        planner.is_lost = false;
        planner.previous.changed([
            replaced[0] || report.instances > 0,
            replaced[1] || report.lights > 0 || changes.directionals || planner.sources.is_active(),
        ]);
        planner.buffers.change(&plan.new_buffers, &plan.freed);
        plan
    }
}

/// A node whose lights have indices from `offset` on.
fn with_lights_from(offset: u32, mut node: Node) -> Node {
    if offset > 0 {
        for child in &mut node.children {
            if let Some(ChildRef::Leaf(light)) = ChildRef::of(*child) {
                *child = LEAF | (light + offset);
            }
        }
    }
    node
}

impl LightPlanner {
    /// Takes the new places of trees into use.
    fn place(&mut self, placed: BTreeMap<u32, TreeState>, incoming: Option<Incoming>) {
        let former_incoming = std::mem::replace(&mut self.trees.residency.incoming, incoming.clone());
        let seen = former_incoming.as_ref().and_then(|former| placed.get(&former.slot)).cloned();
        for (slot, state) in placed {
            let former = self.trees.residency.replace(slot, state.clone());
            self.trees.release_others(&former, &state);
        }
        self.trees.release_incoming(former_incoming, incoming.as_ref(), seen.as_ref());
    }

    /// Makes room for what is written, so that no list is copied while it grows. A few more commands
    /// and bytes are for parameters.
    fn make_lists(&self, room: &Room, commands: &mut Commands) -> Staged {
        let (mut writes, mut bytes) = (MORE_COMMANDS, room.runs.staged_bytes + MORE_BYTES);
        let lists: [Scattered; MAX_TARGETS] = std::array::from_fn(|i| {
            let (count, stride, is_scattered) = (&room.runs.counts[i], STRIDES[i], room.runs.is_scattered[i]);
            let (runs, bytes_of_runs) = count.written(stride, is_scattered);
            writes += runs;
            bytes += bytes_of_runs;
            count.list(stride, is_scattered)
        });
        commands.reserve(writes, bytes);
        let [nodes, lights, trees, instances] = lists;
        Staged { nodes, lights, trees, instances }
    }

    /// The report of an upload of nothing but these commands.
    pub(super) fn report_of(&self, upload: &Commands) -> UploadReport {
        UploadReport { bytes: upload.bytes_written(), ..self.waiting_report() }
    }

    /// What waits now.
    fn waiting_report(&self) -> UploadReport {
        UploadReport {
            waiting_trees: self.trees.residency.waiting_count(),
            waiting_bytes: self.trees.residency.waiting_bytes(),
            stand_ins: self.trees.residency.stand_in_count(),
            held_back_instances: self.trees.opened.held_back(),
            ..UploadReport::default()
        }
    }

    /// Takes new buffers into use. Returns what is left of the room.
    fn adopt(&mut self, room: Room, plan: &mut FramePlan) -> Room {
        let FramePlan { upload, freed, .. } = plan;
        self.uniforms.scatter = room.uniforms.scatter.or(self.uniforms.scatter);
        if let Some(staging) = room.uniforms.staging {
            freed.extend(self.uniforms.staging.replace(staging).map(|(id, _)| id));
        }
        if let Some(params) = room.uniforms.params {
            freed.extend(self.uniforms.params_buffer.replace(params));
            // Nothing was written to the new one.
            self.uniforms.params = ParamsRecord { slots: u32::MAX, ..ParamsRecord::default() };
        }
        self.instances.count = self.instances.count.max(room.slots.end);
        freed.extend(self.trees.nodes.adopt(upload));
        freed.extend(self.trees.lights.adopt(upload));
        freed.extend(self.instances.pool.adopt(upload));
        freed.extend(self.trees.records.adopt(upload));
        freed.extend(self.instances.parts.pool().adopt(upload));
        self.top.adopt(upload, freed);
        room
    }

    /// Writes what has changed in trees since they were written last.
    fn write_trees(
        &mut self,
        commands: &mut Commands,
        staged: &mut Staged,
        world: &LightWorld,
        TreeRuns { runs, writes }: &TreeRuns,
        report: &mut UploadReport,
    ) {
        for (write, [node_runs, light_runs]) in writes {
            let Some(entry) = world.tree_at(write.slot).and_then(|key| world.tree_entry(key)) else { continue };
            // Of a tree, indices of lights are those of the tree. Those of stand-ins follow on `STAND_IN`.
            let (tree, offset, openings) = match &write.source {
                Source::StandIns(few) => (&**few, STAND_IN, [].as_slice()),
                Source::Tree | Source::Piece if write.is_opened => (&entry.tree, 0, &entry.openings[..]),
                Source::Tree | Source::Piece => (&entry.tree, 0, [].as_slice()),
            };
            let sky = world
                .sky()
                .filter(|(key, _)| world.instance_tree(*key).is_some_and(|tree| slot_of(tree) == write.slot));
            let sky = sky.map(|(_, sky)| sky);
            let [node_base, light_base] = write.bases;
            for run in &runs[node_runs.clone()] {
                let range = run.start as usize..run.end as usize;
                report.nodes += range.len();
                let nodes = run.clone().zip(&stored_nodes(tree)[range]).map(|(index, node)| {
                    let parent = stored_place(node.parent, openings);
                    let record = NodeRecord::of(&with_lights_from(offset, Node { parent, ..*node }));
                    NodeRecord {
                        lights: if index == 0 { [offset, tree.lights().len() as u32] } else { [0; 2] },
                        ..record
                    }
                });
                let target = node_base + run.start..node_base + run.end;
                self.trees.nodes.write(commands, &mut staged.nodes, target, nodes);
            }
            for run in &runs[light_runs.clone()] {
                let range = run.start as usize..run.end as usize;
                report.lights += range.len();
                let birth = |light| match write.source {
                    // Stand-ins are drawn anew when the tree changes.
                    Source::StandIns(_) => hash(write.slot).wrapping_add(entry.log.revision() as u32),
                    Source::Tree | Source::Piece => entry.births.of(light),
                };
                let lights = run.clone().zip(&tree.lights()[range.clone()]).zip(&tree.leaves()[range]);
                let fill = lights.map(|((index, light), place)| {
                    let place = stored_place(*place, openings);
                    let record = match sky {
                        Some(sky) => {
                            sky.stored_patch(index).map_or(LightRecord::DARK, |p| LightRecord::patch(p, place))
                        }
                        None => LightRecord::of(light, place),
                    };
                    record.with_birth(birth(index))
                });
                let target = light_base + run.start..light_base + run.end;
                self.trees.lights.write(commands, &mut staged.lights, target, fill);
            }
            if matches!(write.source, Source::Tree) {
                self.trees.residency.was_written(write.slot, entry.log.revision());
            }
            // The records of stand-ins describe the whole tree, so nothing changes in the top level
            // when it takes their place.
            let state = self.trees.residency.get(write.slot);
            let (tree, openings) = (&entry.tree, state.openings(entry));
            for run in written_records(write, openings, state.records.len(), &runs[node_runs.clone()]) {
                let target = state.records.start + run.start..state.records.start + run.end;
                // The sky is no part of the top level.
                let fill = run.map(|index| match sky {
                    Some(_) => TreeRecord::default(),
                    None => TreeRecord::of(tree, openings, index),
                });
                self.trees.records.write(commands, &mut staged.trees, target, fill);
            }
        }
    }

    /// Writes the portals if the buffer has others.
    fn write_portals(&mut self, commands: &mut Commands, world: &LightWorld, is_new: bool) {
        let portals = world.placed_portals();
        if self.top.map_quads().portals == 0 || (!is_new && self.written_portals == portals) {
            return;
        }
        self.written_portals = portals.to_vec();
        let quads = portal_quads(portals);
        let first = self.top.parts() - quads.len() as u32;
        commands.write(self.top.nodes(), 16 * u64::from(first), bytemuck::cast_slice(&quads));
    }

    /// Writes the tables of profiles that the buffer lacks.
    fn write_profiles(&mut self, commands: &mut Commands, is_new: bool) {
        let room = self.top.map_quads().profiles;
        if is_new {
            self.written_profiles = 0;
        }
        if room == 0 {
            return;
        }
        let (buffer, sky_map) = (self.top.nodes(), self.top.sky_map());
        for_each_table(self.written_profiles, room, |end, words| {
            commands.write(buffer, 16 * u64::from(sky_map - end), bytemuck::cast_slice(words));
            self.written_profiles = end;
        });
    }

    /// Writes what has changed of the sky's map, or all of it where the buffer is new.
    fn write_sky(&mut self, commands: &mut Commands, world: &LightWorld, is_new: bool) {
        let Some((_, sky)) = world.sky() else { return };
        let since = if is_new { 0 } else { self.written_sky };
        let (buffer, first) = (self.top.nodes(), 16 * u64::from(self.top.sky_map()));
        sky.for_each_change(since, |quad, quads| {
            commands.write(buffer, first + 16 * u64::from(quad), bytemuck::cast_slice(quads));
        });
        self.written_sky = sky.revision();
    }

    /// Writes the records of instances.
    fn write_instances(&self, commands: &mut Commands, staged: &mut Staged, world: &LightWorld, runs: &[Range<u32>]) {
        for run in runs {
            let record = |slot| self.instance_record(slot, world);
            self.instances.pool.write_each(commands, &mut staged.instances, run.clone(), record);
        }
    }

    fn instance_record(&self, slot: u32, world: &LightWorld) -> InstanceRecord {
        let Some(key) = world.instance_at(slot) else { return InstanceRecord::NONE };
        let Some(instance) = world.instance(key) else { return InstanceRecord::NONE };
        // No generation either, if it is hidden.
        let Some(placed) = instance.shown() else { return InstanceRecord::NONE };
        let state = self.trees.residency.get(slot_of(instance.tree));
        let parts = self.instances.parts.range(slot);
        let stands_in = state.form == Form::StandIns;
        let bases = Bases {
            tree: state.records.start,
            node: state.nodes.start,
            // Shaders add the index of a light, and sums wrap around.
            light: state.lights.start.wrapping_sub(if stands_in { STAND_IN } else { 0 }),
            part: parts.start,
            stands_in,
        };
        InstanceRecord::of(placed, &instance.appearance, bases)
            .with_birth(birth_of_instance(instance.birth, state.replaced))
    }

    /// Sends the staged records, if there are any.
    fn scatter(&self, commands: &mut Commands, staged: Staged) {
        let (Some((staging, _)), Some(uniform)) = (self.uniforms.staging, self.uniforms.scatter) else { return };
        let targets = [
            (self.trees.nodes.buffer(), STRIDES[0], staged.nodes),
            (self.trees.lights.buffer(), STRIDES[1], staged.lights),
            (self.trees.records.buffer(), STRIDES[2], staged.trees),
            (self.instances.pool.buffer(), STRIDES[3], staged.instances),
        ];
        scatter(commands, targets, (staging, uniform));
    }

    /// Sends the parameters, if they have changed.
    fn write_params(&mut self, commands: &mut Commands, world: &LightWorld) {
        let params = self.params_of(world);
        if let Some(buffer) = self.uniforms.params_buffer
            && (params != self.uniforms.params || self.is_lost)
        {
            commands.write(buffer, 0, bytemuck::bytes_of(&params));
            self.uniforms.params = params;
        }
    }

    /// Adds the refit and the build of the top level, which is then no longer due.
    fn finish_top(&mut self, commands: &mut Commands) {
        commands.reserve_as(self.top.sizes);
        self.build_top(commands);
        self.top.sizes = commands.sizes();
        self.top.is_due = false;
    }
}
