//! Brings the GPU's buffers up to date with a world. Sends what changed and nothing else.

use std::collections::BTreeSet;
use std::ops::Range;

use super::GpuLights;
use super::bindings::params_buffer;
use super::error::GpuError;
use super::layout::{Bases, InstanceRecord, LightRecord, ParamsRecord, Strides, TreeRecord};
use super::memory;
use super::parts::NewParts;
use super::pool::Pool;
use super::probe;
use super::relayout::Relayout;
use super::runs::runs;
use super::stored::{self, Stored};
use super::upload_state::{PendingChanges, TreeRanges, UploadReport, room};
use crate::effects::Effects;
use crate::keys::slot_of;
use crate::world::{FrameDelta, LightWorld, TreeChanges};

/// Nodes that did not change are sent along if at most this many lie between two that did. That
/// saves a write.
const NODE_GAP: u32 = 2;
/// The same for lights.
const LIGHT_GAP: u32 = 8;

impl GpuLights {
    /// Sends the changes that `delta` names, with their present values in `world`.
    ///
    /// Pass every delta that [`LightWorld::take_delta`] returns, in order; or, once,
    /// [`FrameDelta::everything`]. A tree that an instance needs and that was never sent is sent
    /// along.
    ///
    /// Writes go through the queue, ahead of the next submission. Which parts of nodes, lights and
    /// instances are stored follows [`LightWorld::effects`]: when these change, the GPU converts
    /// its buffers and the bind group is replaced. O(what changed); an upload without changes sends
    /// nothing.
    ///
    /// # Errors
    /// An upload that fails is not lost: its changes are kept and sent with the next one.
    ///
    /// - [`GpuError::Full`] if a buffer would outgrow what the device can bind. Nothing was
    ///   written. Later uploads succeed once the world holds less.
    /// - [`GpuError::OutOfMemory`] if the device has no memory left. Shaders keep reading what
    ///   they read before, or sample no light, as documented there.
    /// - [`GpuError::DeviceLost`] from the first call after wgpu noticed the loss. In browsers
    ///   only the engine's own `set_device_lost_callback` reports it.
    pub fn upload(&mut self, world: &LightWorld, delta: &FrameDelta) -> Result<UploadReport, GpuError> {
        self.upload_as(world, delta, world.effects())
    }

    /// Uploads in the layout for these effects, which must contain the world's.
    pub(super) fn upload_as(
        &mut self,
        world: &LightWorld,
        delta: &FrameDelta,
        effects: Effects,
    ) -> Result<UploadReport, GpuError> {
        probe::check(&self.device)?;
        // No shader depends on whether lights move.
        let effects = effects - Effects::MOVING;
        let is_starting_usage = self.usage.get().is_some_and(|usage| usage.is_starting());
        let is_unchanged = delta.is_empty() && self.pending.is_empty() && !is_starting_usage;
        let is_laid_out =
            self.params.strides == Strides::of(effects) && (self.params.masks != 0) == effects.contains(Effects::MASKS);
        if is_unchanged && is_laid_out {
            self.effects = effects;
            let solid_angles = u32::from(world.solid_angle_sampling());
            let bytes = self.send_params(ParamsRecord { solid_angles, ..self.params });
            return Ok(UploadReport { bytes, ..UploadReport::default() });
        }
        let mut changes = std::mem::take(&mut self.pending);
        changes.add(delta);
        let device = self.device.clone();
        let (result, is_refused) = memory::watch(&device, || self.send(world, &mut changes, effects));
        if is_refused {
            // Some write or copy did not happen, and wgpu does not report which.
            changes.add_everything(world);
            self.tree_ranges.iter_mut().for_each(|ranges| ranges.revision = 0);
            self.parts.lose_records();
            self.pending = changes;
            self.make_dark();
            let bytes = result.map_or(0, |report| report.bytes);
            return Err(GpuError::OutOfMemory { what: "uploaded records", bytes });
        }
        if result.is_err() {
            self.pending = changes;
        }
        result
    }

    /// Reserves all memory, and only then changes what shaders read.
    fn send(
        &mut self,
        world: &LightWorld,
        changes: &mut PendingChanges,
        effects: Effects,
    ) -> Result<UploadReport, GpuError> {
        let former = (self.top.generation(), self.params.strides, self.params.masks, self.is_dark);
        let mut bytes = self.set_layout(effects)?;
        let Reserved { placed, parts, usage } = self.reserve(world, changes, effects)?;

        for (slot, ranges) in placed {
            let former = std::mem::replace(self.tree_ranges_mut(slot), ranges);
            self.release(former);
        }
        bytes += self.parts.write(parts);
        let mut written = WrittenTrees::default();
        for slot in &changes.trees {
            self.write_tree(*slot, world, &mut written);
        }
        bytes += written.bytes;
        let records = changes.records();
        bytes += self.write_instances(&records, world);
        if changes.directionals {
            let records: Vec<_> = world.directionals().map(|(_, light)| LightRecord::directional(light)).collect();
            bytes += self.lights.write(self.directionals.start, &records);
        }
        if let Some(counters) = self.usage.get_mut() {
            bytes += counters.follow((&self.device, &self.queue), usage, &changes.instances, world);
        }
        bytes += self.follow_origin(world.origin());
        self.is_dark = false;
        bytes += self.refresh(self.params_of(world, effects));
        if changes.concern_lights()
            || former != (self.top.generation(), self.params.strides, self.params.masks, self.is_dark)
        {
            self.top_status.invalidate();
        }
        self.effects = effects;
        let WrittenTrees { nodes, lights, .. } = written;
        Ok(UploadReport { bytes, trees: changes.trees.len(), nodes, lights, instances: records.len() })
    }

    /// Brings the pools into the layout that stores a world with these effects, or leaves all of
    /// them as they are. Shaders keep the old buffers, with the old strides, until the upload
    /// succeeds. Returns the bytes sent.
    fn set_layout(&mut self, effects: Effects) -> Result<u64, GpuError> {
        let nodes = self.nodes.prepare_layout(Stored::nodes(effects))?;
        let lights = self.lights.prepare_layout(Stored::lights(effects))?;
        let instances = self.instances.prepare_layout(Stored::instances(effects))?;
        let has_records = nodes.is_some() && !self.nodes.is_empty()
            || lights.is_some() && !self.lights.is_empty()
            || instances.is_some() && !self.instances.is_empty();
        if has_records && self.relayout.is_none() {
            self.relayout = Some(Relayout::new(&self.device)?);
        }
        let relayout = self.relayout.as_ref();
        let mut sent = 0;
        if let Some(nodes) = nodes {
            sent += self.nodes.adopt_layout(nodes, stored::missing_of_node, relayout);
        }
        if let Some(lights) = lights {
            sent += self.lights.adopt_layout(lights, stored::missing_of_light, relayout);
        }
        if let Some(instances) = instances {
            sent += self.instances.adopt_layout(instances, stored::missing_of_instance, relayout);
        }
        Ok(sent)
    }

    /// Reserves room for everything that grew, or nothing.
    fn reserve(
        &mut self,
        world: &LightWorld,
        changes: &mut PendingChanges,
        effects: Effects,
    ) -> Result<Reserved, GpuError> {
        for slot in &changes.instances {
            let tree = world.instance_at(*slot).and_then(|key| world.instance_tree(key));
            if let Some(tree) = tree
                && self.tree_ranges_mut(slot_of(tree)).key != Some(tree)
            {
                changes.trees.insert(slot_of(tree));
            }
        }
        let mut placed = Vec::new();
        let mut parts = NewParts::default();
        match self.reserve_all((world, effects), changes, &mut placed, &mut parts) {
            Ok(usage) => Ok(Reserved { placed, parts, usage }),
            Err(error) => {
                placed.into_iter().for_each(|(_, ranges)| self.release(ranges));
                self.parts.release(parts);
                Err(error)
            }
        }
    }

    /// Returns the buffer for usage counters, if another one is needed.
    fn reserve_all(
        &mut self,
        (world, effects): (&LightWorld, Effects),
        changes: &mut PendingChanges,
        placed: &mut Vec<(u32, TreeRanges)>,
        parts: &mut NewParts,
    ) -> Result<Option<wgpu::Buffer>, GpuError> {
        if self.spare_params.is_none() {
            self.spare_params = Some(params_buffer(&self.device)?);
        }
        for slot in changes.trees.iter().copied() {
            let key = world.tree_at(slot);
            let tree = key.and_then(|key| Some((world.tree(key)?, world.division(key))));
            match tree {
                Some((tree, division))
                    if self.tree_ranges_mut(slot).key == key && self.tree_ranges_mut(slot).fit(tree, division) => {}
                Some((tree, division)) => {
                    // Pushed first, so that what was reserved is released if the rest fails.
                    placed.push((slot, TreeRanges { key, division, ..TreeRanges::NONE }));
                    let ranges = placed.last_mut().map(|(_, ranges)| ranges).expect("pushed above");
                    let former = &self.tree_ranges[slot as usize];
                    let [nodes, lights] = [tree.nodes().len(), tree.lights().len()];
                    let has_grown = |range: &Range<u32>, count: usize| former.key == key && count > range.len();
                    let has_grown = has_grown(&former.nodes, nodes) || has_grown(&former.lights, lights);
                    let [nodes, lights] =
                        [nodes, lights].map(|count| if has_grown { room(count) } else { count as u32 });
                    ranges.nodes = self.nodes.alloc(nodes)?;
                    ranges.lights = self.lights.alloc(lights)?;
                    ranges.records = self.trees.alloc(TreeRecord::count(tree, division))?;
                }
                None => placed.push((slot, TreeRanges::NONE)),
            }
        }
        // The instances of trees that moved within the pools are written too.
        for (slot, _) in &*placed {
            if let Some(entry) = world.tree_at(*slot).and_then(|key| world.tree_entry(key)) {
                changes.instances.extend(entry.instances.iter().map(|key| slot_of(*key)));
            }
        }
        let counts = changes.instances.iter().map(|slot| (*slot, self.part_count(*slot, world, placed)));
        let counts: Vec<_> = counts.collect();
        *parts = self.parts.reserve(counts.into_iter())?;
        let slots = world.slot_count() as u32;
        grow_table(&mut self.instances, &mut self.instance_count, slots)?;
        let usage = match self.usage.get() {
            Some(usage) => usage.reserve(&self.device, slots)?,
            None => None,
        };
        let directionals = world.directionals().count() as u32;
        let directionals = match changes.directionals && directionals as usize != self.directionals.len() {
            true => Some(self.lights.alloc(directionals)?),
            false => None,
        };
        // Last, because a build of the last upload may still be due, in the present buffers.
        if let Err(error) = self.top.reserve(self.parts.count(), effects.contains(Effects::MASKS)) {
            directionals.into_iter().for_each(|range| self.lights.free(range));
            return Err(error);
        }
        if let Some(range) = directionals {
            self.lights.free(std::mem::replace(&mut self.directionals, range));
        }
        Ok(usage)
    }

    /// The number of parts of the instance in a slot: as many as its tree has records, once the
    /// ranges in `placed` replace the present ones. 0 without an instance.
    fn part_count(&self, slot: u32, world: &LightWorld, placed: &[(u32, TreeRanges)]) -> u32 {
        let tree = world.instance_at(slot).and_then(|key| world.instance_tree(key));
        let Some(tree) = tree.map(slot_of) else { return 0 };
        // In ascending order of slots.
        let ranges = match placed.binary_search_by_key(&tree, |(slot, _)| *slot) {
            Ok(index) => &placed[index].1,
            Err(_) => &self.tree_ranges[tree as usize],
        };
        ranges.records.len() as u32
    }

    fn release(&mut self, ranges: TreeRanges) {
        self.nodes.free(ranges.nodes);
        self.lights.free(ranges.lights);
        self.trees.free(ranges.records);
    }

    fn tree_ranges_mut(&mut self, slot: u32) -> &mut TreeRanges {
        let slot = slot as usize;
        if self.tree_ranges.len() <= slot {
            self.tree_ranges.resize(slot + 1, TreeRanges::NONE);
        }
        &mut self.tree_ranges[slot]
    }

    /// Writes what has changed in a tree since it was written last.
    fn write_tree(&mut self, slot: u32, world: &LightWorld, written: &mut WrittenTrees) {
        let Some(entry) = world.tree_at(slot).and_then(|key| world.tree_entry(key)) else { return };
        let (tree, ranges) = (&entry.tree, &mut self.tree_ranges[slot as usize]);
        let all = |count: usize| vec![Range { start: 0, end: count as u32 }];
        let (nodes, lights) = match entry.log.since(ranges.revision) {
            Some(TreeChanges { nodes, lights }) => (runs(nodes, NODE_GAP), runs(lights, LIGHT_GAP)),
            None => (all(tree.nodes().len()), all(tree.lights().len())),
        };
        ranges.revision = entry.log.revision();
        for run in nodes {
            let records = &tree.nodes()[run.start as usize..run.end as usize];
            written.nodes += records.len();
            written.bytes += self.nodes.write(ranges.nodes.start + run.start, records);
        }
        for run in lights {
            let record = |light: u32| LightRecord::of(&tree.lights()[light as usize], tree.leaves()[light as usize]);
            let records: Vec<_> = run.clone().map(record).collect();
            written.lights += records.len();
            written.bytes += self.lights.write(ranges.lights.start + run.start, &records);
        }
        written.bytes += self.trees.write(ranges.records.start, &TreeRecord::of(tree, ranges.division));
    }

    /// Writes the records of these slots, neighbouring ones together. Returns the bytes sent.
    fn write_instances(&mut self, slots: &BTreeSet<u32>, world: &LightWorld) -> u64 {
        let write = |run: Range<u32>| {
            let records: Vec<_> = run.clone().map(|slot| self.instance_record(slot, world)).collect();
            self.instances.write(run.start, &records)
        };
        runs(slots.iter().copied(), 0).into_iter().map(write).sum()
    }

    fn instance_record(&self, slot: u32, world: &LightWorld) -> InstanceRecord {
        let Some(instance) = world.instance_at(slot).and_then(|key| world.instance(key)) else {
            return InstanceRecord::NONE;
        };
        let Some(placed) = instance.shown() else { return InstanceRecord::NONE };
        let ranges = &self.tree_ranges[slot_of(instance.tree) as usize];
        let parts = self.parts.range(slot);
        let bases = Bases {
            tree: ranges.records.start,
            node: ranges.nodes.start,
            light: ranges.lights.start,
            part: parts.start,
            division: ranges.division,
        };
        InstanceRecord::of(placed, &instance.appearance, bases)
    }

    fn params_of(&self, world: &LightWorld, effects: Effects) -> ParamsRecord {
        ParamsRecord {
            slots: world.slot_count() as u32,
            directional_base: self.directionals.start,
            directional_count: self.directionals.len() as u32,
            strides: Strides::of(effects),
            solid_angles: u32::from(world.solid_angle_sampling()),
            parts: self.top.parts(),
            masks: if effects.contains(Effects::MASKS) { self.top.masks() } else { 0 },
            ..self.params
        }
    }
}

/// What an upload has written of trees.
#[derive(Default)]
struct WrittenTrees {
    bytes: u64,
    nodes: usize,
    lights: usize,
}

/// What an upload needs before it changes anything.
struct Reserved {
    /// New ranges for trees by slot; empty for a tree that was removed.
    placed: Vec<(u32, TreeRanges)>,
    /// New ranges for the parts of instances.
    parts: NewParts,
    /// For the usage counters, if they need another buffer.
    usage: Option<wgpu::Buffer>,
}

/// Makes room for the records 0 to `count` of a pool that is used as a table. Nothing of it is ever
/// given back, so every reservation continues the last one.
fn grow_table<T: bytemuck::NoUninit>(pool: &mut Pool<T>, used: &mut u32, count: u32) -> Result<(), GpuError> {
    if count > *used {
        let range = pool.alloc(count - *used)?;
        debug_assert_eq!(range.start, *used, "a table has no gaps");
        *used = range.end;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Mat3, Vec3};

    use super::*;
    use crate::gpu::memory::refusals::Refusals;
    use crate::gpu::records::{SampleRecord, SampleRequest};
    use crate::gpu::testing::{gpu, noop, read};
    use crate::light::{DirectionalLight, Light};
    use crate::placement::Placement;
    use crate::policy::Policy;

    /// Fewer than the first buffers hold.
    fn small_world() -> LightWorld {
        let mut world = LightWorld::new();
        let tree = world.add_tree(vec![Light::point(Vec3::Y, Vec3::ONE)]).expect("valid");
        world.add_instance(tree, Placement::IDENTITY, Policy::Static).expect("valid");
        world
    }

    /// Adds more trees, lights and instances than the first buffers hold, with all effects, so that
    /// every buffer grows or changes its layout.
    fn grow(world: &mut LightWorld) {
        let spot =
            |i: u32| Light::spot(Vec3::new(i as f32, 1.0, 0.0), Vec3::NEG_Y, 0.1, 1.4, Vec3::ONE).with_range(99.0);
        let scale = Mat3::from_diagonal(Vec3::new(1.0, 2.0, 3.0));
        for i in 0..40 {
            let tree = world.add_tree((0..20).map(spot).collect()).expect("valid");
            for j in 0..10 {
                let translation = DVec3::new(f64::from(i), 0.0, f64::from(j));
                world.add_instance(tree, Placement { linear: scale, translation }, Policy::Static).expect("valid");
            }
        }
        let sun = DirectionalLight { direction: Vec3::NEG_Y, illuminance: Vec3::splat(0.1) };
        world.add_directional(sun).expect("valid");
    }

    #[test]
    fn each_buffer_of_an_upload_may_be_refused_and_the_next_upload_sends_what_is_missing() {
        let (device, queue) = noop();
        let mut refused = Vec::new();
        for successes in 0.. {
            let mut world = small_world();
            let mut lights = GpuLights::new(&device, &queue).expect("default limits are enough");
            lights.count_usage(1);
            lights.upload(&world, &FrameDelta::everything(&world)).expect("room enough");
            world.take_delta();
            let before = (lights.bind_group().clone(), lights.usage_bind_group().clone(), lights.effects());
            grow(&mut world);
            let delta = world.take_delta();
            let refusals = Refusals::of_buffers_after(successes);
            let result = lights.upload(&world, &delta);
            if refusals.count() == 0 {
                assert!(result.is_ok_and(|report| (report.trees, report.instances) == (40, 400)));
                break;
            }
            drop(refusals);
            let Err(GpuError::OutOfMemory { what, bytes }) = result else { panic!("{result:?}") };
            assert!(bytes > 0, "{what}");
            let after = (lights.bind_group().clone(), lights.usage_bind_group().clone(), lights.effects());
            assert!(after == before, "{what}: shaders go on reading what they read");
            refused.push(what);
            let report = lights.upload(&world, &FrameDelta::default()).expect("there is memory again");
            assert!(report.trees >= 40 && report.instances >= 400, "{what}: {report:?}");
            assert_eq!(lights.upload(&world, &FrameDelta::default()), Ok(UploadReport::default()));
        }
        for what in [
            "light tree nodes",
            "lights",
            "instances",
            "light trees",
            "relayout",
            "sampling parameters",
            "usage counters",
            "sort keys",
        ] {
            assert!(refused.contains(&what), "{what} never refused: {refused:?}");
        }
    }

    #[test]
    fn each_buffer_of_new_lights_may_be_refused() {
        let (device, queue) = noop();
        for successes in 0.. {
            let refusals = Refusals::of_buffers_after(successes);
            let result = GpuLights::new(&device, &queue);
            if refusals.count() == 0 {
                assert!(result.is_ok() && successes > 10, "{successes} buffers");
                break;
            }
            assert!(matches!(result.err(), Some(GpuError::OutOfMemory { .. })));
        }
        let _refusals = Refusals::of_other_memory();
        let refused = GpuError::OutOfMemory { what: "pipelines", bytes: 0 };
        assert_eq!(GpuLights::new(&device, &queue).err(), Some(refused));
    }

    /// Builds the top level if that is due, and samples at a few shading points.
    fn sample(lights: &mut GpuLights) -> Vec<SampleRecord> {
        let (device, queue) = gpu();
        let request = |i: u32| SampleRequest {
            position: [i as f32 * 0.6, 0.0, (i % 7) as f32],
            normal: [0.0, 1.0, 0.0],
            u: [0.1, 0.3, 0.5, 0.7].map(|u| (u + i as f32 * 0.618) % 1.0),
            ..SampleRequest::default()
        };
        let requests: Vec<_> = (0..64).map(request).collect();
        let buffer = || {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: None,
                size: size_of_val(&requests[..]) as u64,
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            })
        };
        let (input, output) = (buffer(), buffer());
        queue.write_buffer(&input, 0, bytemuck::cast_slice(&requests));
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        lights.build_top(&mut encoder);
        // The pipeline for all effects: the first call waits for it, and no other is made.
        let pipeline = lights.sampling.pipeline(Effects::all());
        lights.sample_with(&pipeline, &mut encoder, &input, &output, requests.len() as u32);
        queue.submit([encoder.finish()]);
        read(&device, &queue, &output)
    }

    fn count_lit(records: &[SampleRecord]) -> usize {
        records.iter().filter(|record| record.pmf > 0.0).count()
    }

    #[test]
    fn a_refused_buffer_leaves_the_lights_and_a_due_build_in_place() {
        let (device, queue) = gpu();
        let mut world = small_world();
        let mut lights = GpuLights::new(&device, &queue).expect("default limits are enough");
        lights.upload(&world, &FrameDelta::everything(&world)).expect("room enough");
        world.take_delta();
        let before = sample(&mut lights);
        assert_eq!(count_lit(&before), 64);
        grow(&mut world);
        let delta = world.take_delta();
        for successes in 0.. {
            let refusals = Refusals::of_buffers_after(successes);
            let result = lights.upload(&world, &delta);
            if refusals.count() == 0 {
                assert!(result.is_ok() && successes > 5, "{successes} buffers");
                break;
            }
            assert!(matches!(result, Err(GpuError::OutOfMemory { .. })));
            lights.top_status.invalidate();
            assert!(sample(&mut lights) == before, "refused after {successes} buffers");
        }
    }

    #[test]
    fn refused_records_leave_no_light_until_the_next_upload_sends_all() {
        let (device, queue) = gpu();
        let mut world = small_world();
        let mut lights = GpuLights::new(&device, &queue).expect("default limits are enough");
        lights.upload(&world, &FrameDelta::everything(&world)).expect("room enough");
        world.take_delta();
        grow(&mut world);
        let delta = world.take_delta();
        for delta in [delta, FrameDelta::default()] {
            let _refusals = Refusals::of_other_memory();
            let Err(GpuError::OutOfMemory { what: "uploaded records", bytes }) = lights.upload(&world, &delta) else {
                panic!("the writes are refused");
            };
            assert!(bytes > 40 * 20 * 64, "{bytes} bytes would have been sent");
            assert_eq!(count_lit(&sample(&mut lights)), 0);
        }
        let report = lights.upload(&world, &FrameDelta::default()).expect("there is memory again");
        assert_eq!((report.trees, report.instances), (41, 401));
        let mut fresh = GpuLights::new(&device, &queue).expect("default limits are enough");
        fresh.upload(&world, &FrameDelta::everything(&world)).expect("room enough");
        let expected = sample(&mut fresh);
        assert!(count_lit(&expected) > 32);
        assert!(sample(&mut lights) == expected);
    }

    #[test]
    fn the_first_upload_compiles_no_pipeline_to_convert_records() {
        let (device, queue) = noop();
        let mut world = small_world();
        let mut lights = GpuLights::new(&device, &queue).expect("default limits are enough");
        lights.upload(&world, &FrameDelta::everything(&world)).expect("room enough");
        assert!(lights.relayout.is_none(), "there was nothing to convert");
        world.take_delta();
        grow(&mut world);
        let delta = world.take_delta();
        lights.upload(&world, &delta).expect("room enough");
        assert!(lights.relayout.is_some());
    }
}
