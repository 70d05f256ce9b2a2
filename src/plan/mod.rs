//! What a GPU has to do for a frame, as data: buffers to make and free, writes, copies, clears and
//! dispatches. Needs no graphics API.
//!
//! An engine on Vulkan, D3D12 or Metal plays these plans on its own device. An engine on wgpu uses
//! `girandole::gpu::GpuLights`, which plays them too.
//!
//! A frame has these steps:
//!
//! 1. [`LightPlanner::reserve`] finds out which new buffers are needed for what changed in the world
//!    since the last plan.
//! 2. The engine makes [`Reservation::new_buffers`]. If it has no memory for one, it drops the
//!    reservation, and nothing has changed.
//! 3. [`Reservation::plan`] returns the [`FramePlan`] of the frame.
//! 4. The engine runs its [`FramePlan::upload`] and [`FramePlan::top`], in this order, and frees
//!    [`FramePlan::freed`] once the GPU has finished the frame.
//! 5. The engine's shaders bind [`LightPlanner::bindings`] and [`LightPlanner::cells`], and call the functions
//!    of [`wgsl`]. [`LightPlanner::build_cuts`] says when cells get cuts.
//!
//! ```
//! use girandole::plan::{Command, FramePlan, LightPlanner, NewBuffer, PlanError, PlanLimits};
//! use girandole::LightWorld;
//!
//! fn make_buffer(buffer: &NewBuffer) { /* The engine's own code. */ }
//!
//! fn frame(planner: &mut LightPlanner, world: &LightWorld) -> Result<FramePlan, PlanError> {
//!     let reservation = planner.reserve(world)?;
//!     reservation.new_buffers().iter().for_each(make_buffer);
//!     Ok(reservation.plan())
//! }
//!
//! let mut planner = LightPlanner::new(PlanLimits::default());
//! let plan = frame(&mut planner, &LightWorld::new())?;
//! for command in plan.upload.iter().chain(plan.top.iter()) {
//!     match command {
//!         Command::Write { buffer, offset, bytes } => { /* ... */ }
//!         Command::Copy { from, to, offset, bytes } => { /* ... */ }
//!         Command::Clear { buffer, offset, bytes } => { /* ... */ }
//!         Command::Dispatch { kernel, buffers, uniform_offset, workgroups } => { /* ... */ }
//!         // In builds of shared cuts only.
//!         Command::DispatchIndirect { kernel, buffers, uniform_offset, workgroups } => { /* ... */ }
//!         _ => unreachable!("this version has no other commands"),
//!     }
//! }
//! # Ok::<(), PlanError>(())
//! ```
//!
//! # Order
//!
//! Each command sees what the commands before it have done, in the same plan and in earlier ones.
//! On Vulkan and D3D12 that takes a barrier between two commands of which the second uses a buffer
//! that the first writes. One global memory barrier between all commands is enough, and little is
//! lost by it: all but a few dispatches of a frame depend on the one before.
//!
//! Plans have to be played in the order of their numbers, each once. [`PlanCursor`] checks that.
//! If a plan is lost, call [`LightPlanner::lose`]: the next plan sends everything again.
//!
//! # Shaders
//!
//! All kernels are WGSL text: [`KERNELS`]. naga turns it into SPIR-V, HLSL or MSL, at the build of
//! the engine or at run time. Each kernel has its bindings in group 0: one uniform, whose offset
//! changes, and storage buffers. Writes are never larger than [`PlanLimits`] allows.

/// The text of a file of shaders.
macro_rules! shader {
    ($name:literal) => {
        include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/shaders/", $name, ".wgsl"))
    };
}

pub(crate) mod buffers;
mod changes;
pub(crate) mod commands;
mod cursor;
pub(crate) mod cuts;
pub(crate) mod draft;
mod error;
mod frame;
mod heat_map;
mod held;
mod instance_store;
mod items;
pub(crate) mod kernel;
pub(crate) mod layout;
mod limits;
mod memory;
mod module;
pub(crate) mod node_record;
mod opened;
mod parts;
mod place;
pub(crate) mod pool;
pub(crate) mod previous;
mod ranges;
mod reserve;
mod residency;
mod room;
mod runs;
pub(crate) mod scatter;
mod shared_list;
pub(crate) mod sort;
pub(crate) mod sources;
mod stand_in;
pub(crate) mod text;
pub(crate) mod top;
mod tree_store;
mod tree_writes;
mod uniforms;
mod write;

use std::fmt;

pub use buffers::{BufferId, BufferKind, NewBuffer, ShaderBuffers};
pub use changes::UploadReport;
pub use commands::{Command, Commands};
pub use cursor::PlanCursor;
pub use cuts::{cut_kernels, visibility_kernels};
pub use error::{PlanError, ShaderNameError};
pub use frame::FramePlan;
pub use heat_map::HeatMap;
pub use items::with_prefix;
pub use kernel::{Binding, Kernel, UNIFORM_ALIGNMENT};
#[cfg(test)]
pub(crate) use limits::MAX_LARGEST_BUFFER;
#[cfg(feature = "gpu")]
pub(crate) use limits::MIN_LARGEST_BUFFER;
pub use limits::PlanLimits;
pub use memory::GpuMemory;
pub use module::naga_oil_module;
pub use reserve::Reservation;
pub use sources::{Readback, wgsl_of_sources};
pub use text::{ShaderParts, wgsl, wgsl_with};

use crate::effects::Effects;
use crate::keys::TreeKey;
use crate::world::Revision;
use held::Held;

/// All kernels that plans dispatch. A kernel need not use all of its bindings. [`cut_kernels`] has those that build
/// shared cuts, and [`visibility_kernels`] those by which cells learn.
pub const KERNELS: &[Kernel] = &[
    scatter::SCATTER,
    top::LEAVES,
    top::KEYS,
    sort::SCATTER_KEYS,
    top::CELLS,
    top::BLOCKS,
    sources::REFIT,
    sources::PARTS,
];

/// What the GPU holds of one [`LightWorld`](crate::LightWorld), and what it has to do to follow the world.
///
/// Keep one for each world and device. It holds no GPU object and no copy of the world's data: at
/// most 97 bytes for each tree and 9 bytes for each instance. A clone shares all of it until one of the two follows the
/// world, so it costs O(1).
#[derive(Clone)]
pub struct LightPlanner {
    held: Held,
}

impl LightPlanner {
    /// A planner for a device that holds nothing yet.
    pub fn new(limits: PlanLimits) -> Self {
        Self { held: Held::new(limits.bounded()) }
    }

    /// The lights that the engine's shaders bind after the last plan, in the order of the first bindings
    /// of [`wgsl`]: a uniform buffer of 48 bytes, then four storage buffers that are only read, each
    /// bound whole. `None` before the first plan.
    ///
    /// A plan that replaces one of them replaces the first one too. So commands that were recorded
    /// before go on reading the former buffers, as long as these are not freed.
    pub fn bindings(&self) -> Option<ShaderBuffers> {
        self.held.bindings()
    }

    /// Keeps the instances and lights of the last frame, from the next plan on, or drops them. They take as much
    /// memory again, and a plan copies those that the plan before it changed. See [`ShaderParts::previous`].
    ///
    /// Make one plan for each frame then, also if nothing has changed: a frame is what lies between
    /// two plans. After [`LightPlanner::lose`], the last frame has no lights until the second plan.
    pub fn keep_previous(&mut self, is_kept: bool) {
        self.held.previous.is_kept = is_kept;
    }

    /// The storage buffer of the last frame, which shaders read at binding 7; `None` before the first plan after
    /// [`LightPlanner::keep_previous`]. In that plan's frame it holds the lights of the plan before it.
    pub fn previous(&self) -> Option<BufferId> {
        self.held.previous.buffer()
    }

    /// The revision of the world at the last plan; `Revision::default()` before the first one.
    /// [`LightWorld::changes_since`](crate::LightWorld::changes_since) tells what the next plan
    /// will send.
    pub fn revision(&self) -> Revision {
        self.held.revision
    }

    /// Goes back to an earlier revision, because the last plan was not played.
    #[cfg(feature = "gpu")]
    pub(crate) fn rewind(&mut self, revision: Revision) {
        self.held.revision = revision;
    }

    /// The effects that the text of [`wgsl`] must support to read these buffers: those of
    /// [`LightWorld::effects`](crate::LightWorld::effects) at the last plan, and all before the first one. Never contains
    /// [`Effects::MOVING`], on which no shader depends.
    pub fn effects(&self) -> Effects {
        self.held.effects
    }

    /// The parameters of shaders after the last plan.
    #[cfg(all(test, feature = "gpu"))]
    pub(crate) fn params(&self) -> layout::ParamsRecord {
        self.held.uniforms.params
    }

    /// The buffer of the records of trees, and the ranges of nodes, lights and records of the tree in a slot.
    #[cfg(all(test, feature = "gpu"))]
    pub(crate) fn tree_ranges(&self, slot: u32) -> (BufferId, [std::ops::Range<u32>; 3]) {
        let ranges = self.held.trees.residency.get(slot).ranges().map(Clone::clone);
        (self.held.trees.records.buffer(), ranges)
    }

    /// Tells that the device may lack some of what was planned: a plan was not played, or not to its
    /// end. The next plan of a frame sends everything again, into the same buffers. Until then the buffers are
    /// not to be read.
    ///
    /// If the buffers are gone too, as after the loss of a device, make another planner.
    pub fn lose(&mut self) {
        self.held.is_lost = true;
        self.held.top.is_due = true;
        self.held.previous.lose();
    }

    /// Tells that the last build of the top level was not played, so the next plan has another one.
    /// Needed only if [`FramePlan::top`] alone was left out; see [`LightPlanner::lose`] otherwise.
    pub fn lose_top(&mut self) {
        self.held.top.is_due = true;
    }

    /// The refit of trees that kernels of the engine write and the build of the top level, after the last plan,
    /// whether they are due or not. It may be played
    /// again at any time between two plans. Adds nothing before the first plan.
    pub fn top_level(&self) -> Commands {
        let mut commands = Commands::default();
        self.held.build_top(&mut commands);
        commands
    }

    /// The buffers that kernels of the engine bind to write lights, in the order of the bindings of
    /// [`wgsl_of_sources`]: two storage buffers that are read and written. `None` until the world has a tree with
    /// a [source](crate::TreeSource). Any plan may replace them.
    pub fn source_bindings(&self) -> Option<[BufferId; 2]> {
        self.held.sources.table().map(|table| [table, self.held.trees.lights.buffer()])
    }

    /// What the last refit has found out about at most `most` trees with a source, 32 bytes each: the numbers from
    /// `first` on. `None` if there are none.
    pub fn measures(&self, first: u32, most: u32) -> Option<Readback> {
        self.held.sources.measures(first, most)
    }

    /// The number of numbers of sources, in use or not, after the last plan.
    pub fn source_count(&self) -> u32 {
        self.held.sources.count()
    }

    /// The lights of a tree with a source after the last plan; `None` if the tree has no source, and if the GPU does not
    /// hold it whole.
    pub fn source_lights(&self, tree: TreeKey) -> Option<Readback> {
        self.held.sources.lights(tree, &self.held.trees.lights)
    }

    /// Where kernels have moved some parts of a tree with a source, at most `most`, 80 bytes each: each time those that
    /// follow on the last ones. `None` if the GPU holds no such tree.
    pub fn source_parts(&mut self, most: u32) -> Option<Readback> {
        self.held.sources.next_parts(most, &self.held.trees.records)
    }
}

impl fmt::Debug for LightPlanner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("LightPlanner")
            .field("plans", &self.held.number)
            .field("effects", &self.held.effects)
            .field("instance_slots", &self.held.instances.count)
            .field("tree_slots", &self.held.trees.residency.slots())
            .field("parts", &self.held.instances.parts.count())
            .field("node_capacity", &self.held.trees.nodes.capacity())
            .field("light_capacity", &self.held.trees.lights.capacity())
            .finish_non_exhaustive()
    }
}
