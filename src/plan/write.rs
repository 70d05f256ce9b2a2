//! Plans the upload of a frame: what changed, and nothing else.

use std::ops::Range;

use super::buffers::ShaderBuffers;
use super::changes::UploadReport;
use super::commands::Commands;
use super::draft::Draft;
use super::frame::FramePlan;
use super::held::Held;
use super::layout::{Bases, InstanceRecord, LightRecord, ParamsRecord, STAND_IN, TreeRecord, stored_place};
use super::node_record::{NodeRecord, stored_nodes};
use super::pool::Pool;
use super::residency::Form;
use super::room::Frame;
use super::runs::runs;
use super::scatter::{MAX_TARGETS, Scattered, scatter, staged_bytes};
use super::top::MapQuads;
use super::tree_writes::{Source, TreeWrite, written_records};
use crate::instance::portal::portal_quads;
use crate::keys::slot_of;
use crate::light::Light;
use crate::math::dice::hash;
use crate::profile::for_each_table;
use crate::sky::Sky;
use crate::tree::{ChildRef, LEAF, Node};
use crate::world::{LightWorld, birth_of_directional, birth_of_instance};

/// The staged records of short runs, one list for each of these pools.
type Lists = [Scattered; MAX_TARGETS];

/// The pools in the order of their lists.
const NODES: usize = 0;
const LIGHTS: usize = 1;
const TREES: usize = 2;
const INSTANCES: usize = 3;

/// The bytes of a record of each pool.
const STRIDES: [u64; MAX_TARGETS] = [
    Pool::<NodeRecord>::STRIDE,
    Pool::<LightRecord>::STRIDE,
    Pool::<TreeRecord>::STRIDE,
    Pool::<InstanceRecord>::STRIDE,
];

/// Which of the buffers that shaders bind are new in this frame.
struct Replaced {
    top: bool,
    instances: bool,
    lights: bool,
}

/// Commands and bytes of a plan besides the records of the large pools: parts and parameters.
const MORE_COMMANDS: usize = 16;
const MORE_BYTES: u64 = 2048;

impl Held {
    /// Writes what changed, for which there is room. `before` are the buffers that shaders bound.
    pub(super) fn write(&mut self, frame: Frame<'_>, before: Option<ShaderBuffers>, draft: &mut Draft) {
        let former = self.uniforms.params;
        let replaced = self.replace_params(before, draft);
        let instance_runs = runs(frame.changes.instances.iter().copied(), 0);
        // Most of the room is made at once, so that the list is not copied while it grows.
        let of_trees = |pool: usize| frame.trees.writes.iter().flat_map(move |write| &write.runs[pool]);
        let bytes = |run: &Range<u32>, pool: usize| run.len() as u64 * (STRIDES[pool] + 4);
        let nodes: u64 = of_trees(NODES).map(|run| bytes(run, NODES)).sum();
        let lights: u64 = of_trees(LIGHTS).map(|run| bytes(run, LIGHTS)).sum();
        let instances: u64 = instance_runs.iter().map(|run| bytes(run, INSTANCES)).sum();
        let records = STRIDES[TREES] * frame.trees.writes.len() as u64;
        let writes = MORE_COMMANDS + 3 * frame.trees.writes.len();
        draft.plan.upload.reserve(writes, MORE_BYTES + nodes + lights + records + instances);
        let mut lists = Lists::default();
        lists[NODES] = Scattered::with_room_for(of_trees(NODES), STRIDES[NODES]);
        lists[LIGHTS] = Scattered::with_room_for(of_trees(LIGHTS), STRIDES[LIGHTS]);
        lists[INSTANCES] = Scattered::with_room_for(instance_runs.iter(), STRIDES[INSTANCES]);
        let FramePlan { upload, report, .. } = &mut draft.plan;
        *report = UploadReport {
            trees: frame.changes.trees.len(),
            instances: frame.changes.instances.len(),
            ..self.report_of(upload)
        };
        self.instances.parts.write(upload);
        for write in &frame.trees.writes {
            self.write_tree(upload, &mut lists, frame.world, write, report);
        }
        for run in &instance_runs {
            let record = |slot| self.instance_record(slot, frame.world);
            self.instances.pool.write_each(upload, &mut lists[INSTANCES], run.clone(), record);
        }
        if frame.changes.directionals {
            self.write_directionals(upload, frame.world);
        }
        self.scatter(lists, draft);
        let FramePlan { upload, top, report, .. } = &mut draft.plan;
        let is_new_top = replaced.top || self.is_lost;
        self.write_maps(upload, frame.world, is_new_top);
        self.write_params(upload, frame.world);
        let params = self.uniforms.params;
        self.previous.follow_maps(params, upload);
        self.sources.write(upload);
        self.top.is_due |= self.sources.is_active();
        let parts = self.instances.parts.count();
        let partition = self.top.fitting(frame.world.partition(), parts, MapQuads::of(frame.world));
        self.top.prepare(upload, parts, &partition, params);
        let is_moved = (former.masks, former.home) != (params.masks, params.home);
        if frame.changes.concern_lights || is_new_top || is_moved || self.top.is_due {
            self.finish_top(top);
        }
        let is_void = upload.bytes_written() > 0 || !top.is_empty();
        self.cuts.follow(upload, frame.world.origin(), is_void, self.is_lost);
        report.bytes = upload.bytes_written();
        self.is_lost = false;
        self.previous.changed([
            replaced.instances || report.instances > 0,
            replaced.lights || report.lights > 0 || frame.changes.directionals || self.sources.is_active(),
        ]);
    }

    /// Makes another buffer of parameters if any other buffer that shaders bind is another one: the former parameters
    /// belong to the former buffers. Returns which ones are.
    fn replace_params(&mut self, before: Option<ShaderBuffers>, draft: &mut Draft) -> Replaced {
        let now =
            [self.top.nodes(), self.trees.nodes.buffer(), self.instances.pool.buffer(), self.trees.lights.buffer()];
        let mut is_new = [true; 4];
        if let Some(ShaderBuffers([_, former @ ..])) = before {
            is_new = std::array::from_fn(|i| former[i] != now[i]);
        }
        if is_new.contains(&true) {
            let params = draft.uniform("sampling parameters", size_of::<ParamsRecord>() as u64);
            draft.plan.freed.extend(self.uniforms.params_buffer.replace(params));
            // Nothing was written to the new one.
            self.uniforms.params = ParamsRecord { slots: u32::MAX, ..ParamsRecord::default() };
        }
        let [top, _, instances, lights] = is_new;
        Replaced { top, instances, lights }
    }

    /// Writes runs of the nodes and lights of a tree, and the records of its parts.
    fn write_tree(
        &mut self,
        commands: &mut Commands,
        lists: &mut Lists,
        world: &LightWorld,
        write: &TreeWrite,
        report: &mut UploadReport,
    ) {
        let Some(entry) = world.tree_at(write.slot).and_then(|key| world.tree_entry(key)) else { return };
        // Of a tree, indices of lights are those of the tree. Those of stand-ins follow on `STAND_IN`.
        let (tree, offset, openings) = match &write.source {
            Source::StandIns(few) => (&**few, STAND_IN, [].as_slice()),
            Source::Tree | Source::Piece if write.is_opened => (&entry.tree, 0, &entry.openings[..]),
            Source::Tree | Source::Piece => (&entry.tree, 0, [].as_slice()),
        };
        let sky = world.sky().filter(|(key, _)| world.instance(*key).is_some_and(|i| slot_of(i.tree) == write.slot));
        let sky = sky.map(|(_, sky)| sky);
        let ([node_base, light_base], [node_runs, light_runs]) = (write.bases, &write.runs);
        for run in node_runs {
            let range = run.start as usize..run.end as usize;
            report.nodes += range.len();
            let nodes = run.clone().zip(&stored_nodes(tree)[range]).map(|(index, node)| {
                let parent = stored_place(node.parent, openings);
                let record = NodeRecord::of(&with_lights_from(offset, Node { parent, ..*node }));
                NodeRecord { lights: if index == 0 { [offset, tree.lights().len() as u32] } else { [0; 2] }, ..record }
            });
            let target = node_base + run.start..node_base + run.end;
            self.trees.nodes.write(commands, Some(&mut lists[NODES]), target, nodes);
        }
        for run in light_runs {
            let range = run.start as usize..run.end as usize;
            report.lights += range.len();
            let birth = |light| match write.source {
                // Stand-ins are drawn anew when the tree changes.
                Source::StandIns(_) => hash(write.slot).wrapping_add(entry.log.revision() as u32),
                Source::Tree | Source::Piece => entry.births.lights.of(light),
            };
            let lights = run.clone().zip(&tree.lights()[range.clone()]).zip(&tree.leaves()[range]);
            let fill = lights.map(|((index, light), place)| {
                light_record(sky, index, light, stored_place(*place, openings)).with_birth(birth(index))
            });
            let target = light_base + run.start..light_base + run.end;
            self.trees.lights.write(commands, Some(&mut lists[LIGHTS]), target, fill);
        }
        if matches!(write.source, Source::Tree) {
            self.trees.residency.was_written(write.slot, entry.log.revision());
        }
        // The records of stand-ins describe the whole tree, so nothing changes in the top level
        // when it takes their place.
        let state = self.trees.residency.get(write.slot);
        let (tree, openings) = (&entry.tree, state.openings(entry));
        for run in written_records(write, openings, state.records.len()) {
            let target = state.records.start + run.start..state.records.start + run.end;
            // The sky is no part of the top level.
            let fill = run.map(|index| match sky {
                Some(_) => TreeRecord::default(),
                None => TreeRecord::of(tree, openings, index),
            });
            self.trees.records.write(commands, Some(&mut lists[TREES]), target, fill);
        }
    }

    fn write_directionals(&self, commands: &mut Commands, world: &LightWorld) {
        let records = world
            .directional_lights()
            .map(|(key, light)| LightRecord::directional(light).with_birth(birth_of_directional(key)));
        let run = self.trees.directionals.clone();
        self.trees.lights.write(commands, None, run, records);
    }

    /// Writes what has changed of the maps beside the top level, or all of them where their buffer is new: portals,
    /// profiles and the sky.
    fn write_maps(&mut self, commands: &mut Commands, world: &LightWorld, is_new: bool) {
        let (buffer, quads, sky_map) = (self.top.nodes(), self.top.map_quads(), self.top.sky_map());
        let portals = world.placed_portals();
        if quads.portals > 0 && (is_new || *self.maps.portals != *portals) {
            self.maps.portals = portals.into();
            let quads = portal_quads(portals);
            let first = self.top.parts() - quads.len() as u32;
            commands.write(buffer, 16 * u64::from(first), bytemuck::cast_slice(&quads));
        }
        if is_new {
            (self.maps.profiles, self.maps.sky) = (0, 0);
        }
        if quads.profiles > 0 {
            for_each_table(self.maps.profiles, quads.profiles, |end, words| {
                commands.write(buffer, 16 * u64::from(sky_map - end), bytemuck::cast_slice(words));
                self.maps.profiles = end;
            });
        }
        if let Some((_, sky)) = world.sky() {
            sky.for_each_change(self.maps.sky, |quad, quads| {
                commands.write(buffer, 16 * u64::from(sky_map + quad), bytemuck::cast_slice(quads));
            });
            self.maps.sky = sky.revision();
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

    /// Writes the short runs.
    fn scatter(&mut self, lists: Lists, draft: &mut Draft) {
        let pools = [
            self.trees.nodes.buffer(),
            self.trees.lights.buffer(),
            self.trees.records.buffer(),
            self.instances.pool.buffer(),
        ];
        let targets = pools.into_iter().zip(STRIDES).zip(lists);
        let targets: Vec<_> = targets.map(|((pool, stride), list)| (pool, stride, list)).collect();
        let most = self.trees.limits.largest_buffer;
        let bytes = staged_bytes(&targets, most);
        let staging = if bytes > 0 { Some(self.uniforms.stage(bytes, most, draft)) } else { None };
        scatter(&mut draft.plan.upload, &targets, staging);
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
}

/// The record of a light of a tree, or of a patch if the tree is that of a sky.
fn light_record(sky: Option<&Sky>, index: u32, light: &Light, place: u32) -> LightRecord {
    match sky {
        Some(sky) => sky.stored_patch(index).map_or(LightRecord::DARK, |patch| LightRecord::patch(patch, place)),
        None => LightRecord::of(light, place),
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
