//! A device that plays the uploads of plans in ordinary memory. It checks each command, and fills
//! new buffers with garbage, so that a plan that relies on their content is found out.

use std::collections::{HashMap, HashSet};

use girandole::LightWorld;
use girandole::plan::{Binding, BufferId, BufferKind, Command, Commands, FramePlan, KERNELS, LightPlanner, PlanCursor};
use girandole::plan::{PlanError, UNIFORM_ALIGNMENT};

/// The buffers of one planner.
#[derive(Default)]
pub struct Device {
    buffers: HashMap<BufferId, (BufferKind, Vec<u8>)>,
    /// All that were ever made.
    seen: HashSet<BufferId>,
    cursor: PlanCursor,
    /// Dispatches of the last plan by kernel.
    pub dispatches: HashMap<&'static str, usize>,
    /// Writes of the last plan.
    pub writes: usize,
    /// The buffers of the last stage that read the parts, instances and trees.
    pub leaves: Vec<BufferId>,
}

impl Device {
    /// Makes the buffers of a plan, plays its upload, checks its build of the top level, and frees
    /// what it frees.
    pub fn play(&mut self, plan: &FramePlan) -> Result<(), PlanError> {
        self.cursor.advance(plan)?;
        for buffer in &plan.new_buffers {
            assert!(self.seen.insert(buffer.id), "{buffer:?} has a number of its own");
            assert!(buffer.bytes > 0 && buffer.bytes.is_multiple_of(4), "{buffer:?}");
            self.buffers.insert(buffer.id, (buffer.kind, vec![0xcd; buffer.bytes as usize]));
        }
        self.dispatches.clear();
        self.writes = 0;
        self.run(&plan.upload);
        self.run(&plan.top);
        for id in &plan.freed {
            assert!(self.buffers.remove(id).is_some(), "{id:?} is freed once");
        }
        Ok(())
    }

    /// Expects this plan next.
    pub fn skip_to(&mut self, plan: &FramePlan) {
        self.cursor.skip_to(plan);
    }

    /// The content of a buffer.
    pub fn content(&self, id: BufferId) -> &[u8] {
        &self.buffers[&id].1
    }

    /// The bytes of all buffers.
    pub fn bytes_of_all(&self) -> u64 {
        self.buffers.values().map(|(_, bytes)| bytes.len() as u64).sum()
    }

    fn bytes(&mut self, id: BufferId, offset: u64, length: u64) -> &mut [u8] {
        assert!(offset.is_multiple_of(4) && length.is_multiple_of(4) && length > 0);
        let (_, bytes) = self.buffers.get_mut(&id).expect("the buffer exists");
        &mut bytes[offset as usize..(offset + length) as usize]
    }

    fn run(&mut self, commands: &Commands) {
        for command in commands.iter() {
            match command {
                Command::Write { buffer, offset, bytes } => {
                    self.writes += 1;
                    self.bytes(buffer, offset, bytes.len() as u64).copy_from_slice(bytes);
                }
                Command::Copy { from, to, offset, bytes } => {
                    assert_ne!(from, to);
                    let copied = self.bytes(from, 0, bytes).to_vec();
                    self.bytes(to, offset, bytes).copy_from_slice(&copied);
                }
                Command::Clear { buffer, offset, bytes } => self.bytes(buffer, offset, bytes).fill(0),
                Command::Dispatch { kernel, buffers, uniform_offset, workgroups } => {
                    assert!(KERNELS.contains(&kernel));
                    assert!(workgroups.iter().all(|count| (1..=65_535).contains(count)), "{workgroups:?}");
                    assert!(uniform_offset.is_multiple_of(UNIFORM_ALIGNMENT));
                    assert_eq!(buffers.len(), kernel.bindings().len());
                    for (id, binding) in buffers.iter().zip(kernel.bindings()) {
                        let (kind, content) = &self.buffers[id];
                        match binding {
                            Binding::Uniform { bytes } => {
                                assert_eq!(*kind, BufferKind::Uniform);
                                assert!((uniform_offset + bytes) as usize <= content.len());
                            }
                            _ => assert_eq!(*kind, BufferKind::Storage),
                        }
                    }
                    *self.dispatches.entry(kernel.entry()).or_default() += 1;
                    match kernel.entry() {
                        "scatter" => self.scatter(buffers, uniform_offset as usize, workgroups),
                        "top_leaves" => self.leaves = buffers.to_vec(),
                        _ => {}
                    }
                }
                _ => unreachable!("this version has no other commands"),
            }
        }
    }

    /// Fills all buffers with garbage, as a device that lost them might.
    pub fn forget(&mut self) {
        self.buffers.values_mut().for_each(|(_, bytes)| bytes.fill(0xcd));
    }

    /// What the kernel does, written from its description.
    fn scatter(&mut self, buffers: &[BufferId], offset: usize, workgroups: [u32; 3]) {
        let word = |bytes: &[u8], index: usize| u32::from_le_bytes(bytes[4 * index..][..4].try_into().expect("a word"));
        let pass: Vec<usize> = (0..4).map(|i| word(&self.content(buffers[0])[offset..], i) as usize).collect();
        let [records, quads, places, first] = pass[..] else { unreachable!() };
        assert!(records * quads <= workgroups.iter().product::<u32>() as usize * 64, "an invocation for each unit");
        let staged = self.content(buffers[1]).to_vec();
        for record in 0..records {
            let place = word(&staged[16 * places..], record) as usize;
            let bytes = &staged[16 * (first + record * quads)..][..16 * quads];
            self.bytes(buffers[2], (16 * quads * place) as u64, 16 * quads as u64).copy_from_slice(bytes);
        }
    }
}

/// A planner with its device.
pub struct Played {
    pub planner: LightPlanner,
    pub device: Device,
}

impl Played {
    pub fn new() -> Self {
        Self { planner: LightPlanner::new(Default::default()), device: Device::default() }
    }

    /// Plans and plays a frame.
    pub fn frame(&mut self, world: &LightWorld) -> FramePlan {
        let plan = self.planner.reserve(world).expect("room enough").plan();
        self.device.play(&plan).expect("in order");
        plan
    }

    /// The buffers that shaders bind: parameters, nodes of the top level, nodes, instances, lights.
    pub fn bound(&self) -> [BufferId; 5] {
        let bound = self.planner.bindings().expect("a plan was made");
        bound.as_ref().try_into().expect("five buffers")
    }

    /// The records of instances, which have the same place on every device that follows the world.
    pub fn instances(&self, world: &LightWorld, stride: usize) -> Vec<u8> {
        let [_, _, _, instances, _] = self.bound();
        // Slots begin at 1.
        self.device.content(instances)[stride..stride * slots(world)].to_vec()
    }
}

/// One more than the greatest slot.
pub fn slots(world: &LightWorld) -> usize {
    world.instances().filter_map(|key| world.slot(key)).max().map_or(1, |slot| slot as usize + 1)
}
