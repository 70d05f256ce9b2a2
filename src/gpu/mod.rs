//! The GPU side: uploads, the top level that is rebuilt after each change, and sampling. The only
//! module that uses wgpu: it plays the plans of [`plan`](crate::plan) on the engine's device.
//!
//! Everything runs on the engine's own device and queue, and is recorded into the engine's own
//! encoder. There are two exceptions, which an upload submits at once: the copy of a buffer that
//! grows or changes its layout, and the pass that brings many changed records to their places.
//! Nothing waits for the GPU, and nothing is read back.
//!
//! A frame has two steps:
//!
//! 1. [`GpuLights::sync`] updates the world ([`LightWorld::update`](crate::LightWorld::update)),
//!    sends what changed ([`GpuLights::upload`]), and records the build of the top level
//!    ([`GpuLights::build_top`]) and of the cuts of cells that were marked ([`GpuLights::build_cuts`]). An engine may
//!    make these calls by itself.
//! 2. The engine's shaders bind [`GpuLights::bind_group`], mark the cells of their shading points by `light_mark`, and
//!    call the functions of [`LightShader`].
//!
//! # Browsers
//!
//! On WebAssembly, wgpu reports less and there are no threads:
//!
//! - The loss of the device and the lack of memory are not noticed: [`GpuError::DeviceLost`] and
//!   [`GpuError::OutOfMemory`] do not occur. The engine learns of both from its own callbacks and
//!   error scopes.
//! - The making of a pipeline returns soon, since another process of the browser compiles, but nothing
//!   is drawn until that has finished. Make pipelines for [`GpuLights::effects`] only when a frame asks
//!   for them: the pipeline for all effects takes longest.

mod bindings;
mod cuts;
mod error;
mod fate;
mod limits;
#[doc(hidden)]
pub mod measure;
mod memory;
mod options;
mod player;
#[cfg(test)]
mod poison;
mod probe;
mod shader;
mod source_link;
mod sources;
mod sync;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod top_status;
mod upload;
#[cfg(test)]
mod variants;

use std::fmt;

use bindings::{ALL, bind, light_layout};
pub use error::GpuError;
use error::{check_limits, largest_storage_buffer};
pub use options::GpuOptions;
use player::{Player, labelled};
pub use shader::LightShader;
use source_link::SourceLink;
pub use sync::SyncReport;
use top_status::TopStatus;

use crate::effects::Effects;
use crate::plan::{BufferId, Commands, KERNELS, Kernel, LightPlanner, PlanLimits};
pub use crate::plan::{GpuMemory, HeatMap, ShaderNameError, ShaderParts, UploadReport, wgsl, with_prefix};
use crate::world::Revision;

/// The lights of one [`LightWorld`](crate::LightWorld) on a GPU: the buffers and the bind group that shaders read, and
/// the pipelines that fill them.
///
/// Keep one for each world and device. Buffers start small, grow by doubling, and keep their content. A node takes 224
/// bytes, a light 64, an instance 160, a leaf of the top level 24, and a node of the top level 224, or 272 in worlds with
/// [`Effects::MASKS`].
///
/// ```
/// use girandole::gpu::{GpuError, GpuLights};
/// use girandole::{FrameBudget, LightWorld, wgpu};
///
/// fn frame(
///     lights: &mut GpuLights,
///     world: &mut LightWorld,
///     encoder: &mut wgpu::CommandEncoder,
/// ) -> Result<(), GpuError> {
///     lights.sync(world, FrameBudget::NONE, encoder)?;
///     // The engine's passes bind `lights.bind_group()`. Submit the encoder before the next call.
///     Ok(())
/// }
/// ```
pub struct GpuLights {
    device: wgpu::Device,
    /// Decides what the buffers hold.
    planner: LightPlanner,
    /// Has the buffers.
    player: Player,
    /// The build of the top level after the last upload.
    top: Commands,
    top_status: TopStatus,
    /// The engine has built cuts since the last [`GpuLights::sync`].
    has_built_cuts: bool,
    learns: bool,
    /// There was no upload yet, or one was refused memory, so that the buffers are incomplete: `dark` is bound in their
    /// place.
    is_dark: bool,
    dark: DarkBuffers,
    /// What shaders bind, and its layout.
    group: wgpu::BindGroup,
    layout: wgpu::BindGroupLayout,
    has_previous: bool,
    /// The buffers that the group was made for; `None` for zeros.
    bound: [Option<BufferId>; ALL],
    sources: SourceLink,
}

/// Zeros in place of all buffers that shaders bind: a world without lights.
struct DarkBuffers {
    params: wgpu::Buffer,
    storage: wgpu::Buffer,
    /// Shaders may write it.
    marks: wgpu::Buffer,
}

impl DarkBuffers {
    fn new(device: &wgpu::Device) -> Result<Self, GpuError> {
        // The root node and more: shaders never read past the end of a buffer.
        let zeros = |what, usage| memory::create_buffer(device, what, 256, usage);
        let storage = zeros("no lights", wgpu::BufferUsages::STORAGE)?;
        let marks = zeros("no marks", wgpu::BufferUsages::STORAGE)?;
        let params = zeros("no parameters", wgpu::BufferUsages::UNIFORM)?;
        Ok(Self { params, storage, marks })
    }

    /// In the order of the bindings.
    fn buffers(&self) -> [&wgpu::Buffer; ALL] {
        let Self { params, storage, marks } = self;
        [params, storage, storage, storage, storage, storage, marks, storage]
    }
}

impl GpuLights {
    /// Makes pipelines and buffers on the engine's device, with the default [`GpuOptions`]. Clones both handles, and
    /// submits nothing.
    ///
    /// # Errors
    /// - [`GpuError::Limit`] names the first limit of the device that is not sufficient. WebGPU's
    ///   default limits are.
    /// - [`GpuError::DeviceLost`] and [`GpuError::OutOfMemory`].
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Result<Self, GpuError> {
        Self::with_options(device, queue, GpuOptions::default())
    }

    /// As [`GpuLights::new`], with other options.
    ///
    /// # Errors
    /// As [`GpuLights::new`].
    pub fn with_options(device: &wgpu::Device, queue: &wgpu::Queue, options: GpuOptions) -> Result<Self, GpuError> {
        check_limits(&device.limits())?;
        probe::check(device)?;
        let (result, is_refused) = memory::watch(device, || Self::make(device, queue, &options));
        if is_refused { Err(GpuError::OutOfMemory { what: "pipelines", bytes: 0 }) } else { result }
    }

    fn make(device: &wgpu::Device, queue: &wgpu::Queue, options: &GpuOptions) -> Result<Self, GpuError> {
        let dark = DarkBuffers::new(device)?;
        let count = if options.previous { ALL } else { ALL - 1 };
        let layout = light_layout(device, count, options.fragments_write);
        let group = bind(device, "girandole lights", &layout, &dark.buffers()[..count]);
        let mut lights = Self {
            device: device.clone(),
            planner: LightPlanner::new(PlanLimits::new(largest_storage_buffer(device))),
            player: Player::new(device, queue),
            top: Commands::default(),
            top_status: TopStatus::new(),
            has_built_cuts: false,
            learns: options.learning.is_some(),
            is_dark: true,
            dark,
            group,
            layout,
            has_previous: options.previous,
            bound: [None; ALL],
            sources: SourceLink::new(device),
        };
        // Refits are rare, so their kernels are compiled when they are needed.
        let is_rare = |kernel: &&Kernel| kernel.stage() == "refit";
        KERNELS.iter().filter(|kernel| !is_rare(kernel)).for_each(|kernel| lights.player.compile(*kernel));
        lights.planner.keep_previous(options.previous);
        lights.make_cells(options)?;
        Ok(lights)
    }

    /// Records the build of the top level into the engine's encoder, if a build is due, and before it the refit of
    /// the trees whose lights [kernels of the engine](GpuLights::source_group) write.
    ///
    /// A build is due after an upload that changed something, and after each while there are such trees. It is also due if the commands of the
    /// last build were dropped before they were submitted, as in a frame that is skipped or whose
    /// surface is outdated: the next call records it again. Otherwise nothing is recorded.
    ///
    /// Submit the encoder before the next [`GpuLights::upload`]: the numbers of instances and
    /// passes that a build reads are written ahead of the next submission, and the next build
    /// overwrites them. Commands that are neither submitted nor dropped yet count as submitted, so
    /// submit encoders in the order of recording. Submitting more than one build of the same
    /// upload does no harm: each makes the same top level.
    ///
    /// Records six dispatches, and two for each pass over the parts: 10 for ten thousand instances,
    /// and 12 for a million.
    pub fn build_top(&mut self, encoder: &mut wgpu::CommandEncoder) {
        if self.is_dark || !self.top_status.needs_build() {
            return;
        }
        self.top_status.record(encoder);
        self.player.record(encoder, &labelled("girandole top level"), self.top.iter());
        self.record_readback(encoder);
    }

    /// The layout of [`GpuLights::bind_group`], for the pipeline layouts of the engine's shaders: one uniform buffer, five
    /// read-only storage buffers and one that is written, for compute and fragment stages; with
    /// [`GpuOptions::previous`] one more that is only read.
    pub fn bind_group_layout(&self) -> &wgpu::BindGroupLayout {
        &self.layout
    }

    /// The bind group with the lights, to be set at the group number of the engine's
    /// [`LightShader`].
    ///
    /// An upload replaces it when it replaces a buffer by a larger one or by one of another
    /// layout. So call this in each frame after [`GpuLights::upload`], and submit the commands
    /// that use it before the next upload. A bind group that was replaced keeps the former buffers,
    /// all of them in their former layout, for commands that are submitted late.
    pub fn bind_group(&self) -> &wgpu::BindGroup {
        &self.group
    }

    /// The revision of the world at the last upload that succeeded; `Revision::default()` before the
    /// first one. [`LightWorld::changes_since`](crate::LightWorld::changes_since) tells what the next upload will
    /// send.
    pub fn revision(&self) -> Revision {
        self.planner.revision()
    }

    /// The effects that a shader must support to use [`GpuLights::bind_group`]: those of
    /// [`LightWorld::effects`](crate::LightWorld::effects) at the last upload, and all before the
    /// first one. Never contains [`Effects::MOVING`], on which no shader depends.
    pub fn effects(&self) -> Effects {
        self.planner.effects()
    }

    /// Returns the WGSL text and the bind group layout that an engine's shader needs to choose
    /// lights. Joins texts and compiles nothing.
    ///
    /// `group` is the number of the bind group with the lights, 0 to 3 by WebGPU's default.
    /// `effects` are the effects that the text has to support; with [`Effects::all`] it supports
    /// every world. With [`GpuOptions::learning`] it has `light_record_visibility` ([`ShaderParts::learns`]).
    pub fn shader(&self, group: u32, effects: Effects) -> LightShader {
        let parts = ShaderParts { learns: self.learns, previous: self.has_previous, ..ShaderParts::default() };
        LightShader::new(group, effects, parts, self.layout.clone())
    }

    /// Replaces the bind groups if a buffer was replaced. A former bind group keeps the former
    /// buffers, with the parameters that belong to them.
    fn rebind(&mut self) {
        let bound = self.ids();
        if bound.iter().all(Option::is_none) || bound != self.bound {
            self.bound = bound;
            let count = if self.has_previous { ALL } else { ALL - 1 };
            self.group = bind(&self.device, "girandole lights", &self.layout, &self.buffers()[..count]);
        }
    }

    /// The buffers that shaders bind, in the order of the layout; `None` for zeros. There are no cells while an
    /// upload has failed, since cuts may name nodes that are not there.
    fn ids(&self) -> [Option<BufferId>; ALL] {
        let mut ids = [None; ALL];
        let Some(lights) = self.planner.bindings().filter(|_| !self.is_dark) else { return ids };
        let all = lights.iter().copied().chain(self.planner.cells().into_iter().flatten());
        ids.iter_mut().zip(all).for_each(|(id, bound)| *id = Some(bound));
        ids[ALL - 1] = self.planner.previous();
        ids
    }

    /// Binds buffers of zeros, in which shaders find no light, until an upload succeeds.
    fn make_dark(&mut self) {
        self.is_dark = true;
        self.rebind();
    }

    /// The buffers that shaders bind, in the order of the layout.
    fn buffers(&self) -> [&wgpu::Buffer; ALL] {
        let mut buffers = self.dark.buffers();
        for (buffer, bound) in buffers.iter_mut().zip(self.bound) {
            *buffer = bound.map_or(*buffer, |id| self.player.buffer(id));
        }
        buffers
    }
}

impl fmt::Debug for GpuLights {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("GpuLights")
            .field("planner", &self.planner)
            .field("is_dark", &self.is_dark)
            .field("needs_build", &self.top_status.needs_build())
            .finish_non_exhaustive()
    }
}
