//! The GPU side: uploads, the top level that is rebuilt after each change, and sampling. The only
//! module that uses wgpu.
//!
//! Everything runs on the engine's own device and queue, and is recorded into the engine's own
//! encoder. The one exception is the copy of a buffer that grows or changes its layout: it is
//! submitted at once. Nothing waits for the GPU. Nothing is read back except usage counts, and
//! those only on request ([`GpuLights::count_usage`]).
//!
//! A frame has three steps:
//!
//! 1. [`GpuLights::upload`] sends what changed.
//! 2. [`GpuLights::build_top`] records the build of the top level.
//! 3. The engine's shaders bind [`GpuLights::bind_group`] and call the functions of
//!    [`LightShader`]. An engine without such a shader calls [`GpuLights::sample`] or
//!    [`GpuLights::resample`] instead.
//!
//! # Browsers
//!
//! On WebAssembly, wgpu reports less and there are no threads:
//!
//! - The loss of the device and the lack of memory are not noticed: [`GpuError::DeviceLost`] and
//!   [`GpuError::OutOfMemory`] do not occur. The engine learns of both from its own callbacks and
//!   error scopes.
//! - [`PipelineVariants::get`] compiles a missing variant before it returns.

mod bindings;
mod candidates;
mod error;
mod kernel;
mod layout;
pub mod measure;
mod memory;
mod parts;
mod pipeline_variants;
mod pool;
mod probe;
mod records;
mod recorder;
mod relayout;
mod resampling;
mod runs;
mod sampling;
mod shader;
mod sort;
mod stages;
mod stored;
mod target_hook;
#[cfg(test)]
mod testing;
mod text;
mod top;
mod top_status;
mod upload;
mod upload_state;
mod usage;
#[cfg(test)]
mod variants;
mod visibility;

use std::fmt;
use std::ops::Range;
use std::sync::OnceLock;

use glam::DVec3;

use bindings::{bind_lights, light_layout, params_buffer};
use candidates::CandidateTable;
use error::check_limits;
pub use error::{GpuError, TargetHookError};
use kernel::Kernel;
use layout::{InstanceRecord, LightRecord, ParamsRecord, Strides, TreeRecord};
use measure::CountKernel;
use parts::PartTable;
pub use pipeline_variants::{MAX_VARIANTS, PipelineVariants};
use pool::Pool;
use recorder::Recorder;
pub use records::{ReservoirRecord, SampleRecord, SampleRequest};
use relayout::Relayout;
pub use shader::LightShader;
pub use target_hook::TargetHook;
pub use text::wgsl;
use top::TopBuild;
use top_status::TopStatus;
pub use upload_state::UploadReport;
use upload_state::{PendingChanges, TreeRanges};
use usage::UsageCounters;
pub use usage::{DEFAULT_USAGE_INTERVAL, UsageCounts};
use visibility::LearntTable;

use crate::counts::SplitCount;
use crate::effects::Effects;
use crate::tree::Node;

/// The lights of one [`LightWorld`](crate::LightWorld) on a GPU: the buffers and the bind group
/// that shaders read, and the pipelines that fill them.
///
/// Keep one for each world and device. Several threads may share it, except in browsers: recording
/// with [`GpuLights::sample`] takes `&self`.
///
/// Buffers start small, grow by doubling, and keep their content. Which parts of a record they
/// store depends on the effects of the world:
///
/// | record | bytes | more bytes |
/// |---|---:|---|
/// | node | 160 | 32 for [`Effects::CONES`], 16 for [`Effects::RANGES`] |
/// | light | 32 | 32 if a light is not a point, or has a range |
/// | instance | 80 | 48 for [`Effects::NON_RIGID`], 16 for [`Effects::FACTORS`] or [`Effects::MASKS`] |
/// | leaf of the top level | 24 | none |
/// | node of the top level | as any node | 32 for [`Effects::MASKS`] |
///
/// ```
/// use girandole::gpu::{GpuError, GpuLights};
/// use girandole::{LightWorld, wgpu};
///
/// fn frame(
///     lights: &mut GpuLights,
///     world: &mut LightWorld,
///     encoder: &mut wgpu::CommandEncoder,
/// ) -> Result<(), GpuError> {
///     let delta = world.take_delta();
///     lights.upload(world, &delta)?;
///     lights.build_top(encoder);
///     // The engine's passes bind `lights.bind_group()`. Submit the encoder before the next upload.
///     Ok(())
/// }
/// ```
pub struct GpuLights {
    device: wgpu::Device,
    queue: wgpu::Queue,
    nodes: Pool<Node>,
    lights: Pool<LightRecord>,
    /// A table by slot.
    instances: Pool<InstanceRecord>,
    instance_count: u32,
    trees: Pool<TreeRecord>,
    tree_ranges: Vec<TreeRanges>,
    parts: PartTable,
    /// The changes of failed uploads.
    pending: PendingChanges,
    /// A range of the light pool.
    directionals: Range<u32>,
    params: ParamsRecord,
    params_buffer: wgpu::Buffer,
    /// For the next bind group: the old one keeps its own parameters. An upload makes it before it
    /// changes anything.
    spare_params: Option<wgpu::Buffer>,
    /// Made at first use.
    relayout: Option<Relayout>,
    top: TopBuild,
    top_status: TopStatus,
    sampling: Kernel,
    resampling: Kernel,
    candidates: CandidateTable,
    /// The effects that the buffers are stored for, without [`Effects::MOVING`].
    effects: Effects,
    /// Made at first use.
    node_counter: OnceLock<CountKernel>,
    /// Made at first use.
    usage: OnceLock<UsageCounters>,
    /// Made at first use.
    learnt: OnceLock<LearntTable>,
    /// The world's origin at the last upload.
    origin: DVec3,
    /// Bound as usage counters until the first upload that counts.
    no_usage: wgpu::Buffer,
    /// An upload was refused memory, so the buffers are incomplete: `dark` is bound in their place.
    is_dark: bool,
    dark: DarkBuffers,
    layout: wgpu::BindGroupLayout,
    bind_group: wgpu::BindGroup,
    /// The generations of the buffers that the bind group was made for; `None` for `dark`.
    bound: Option<[u64; 4]>,
}

/// Zeros in place of all buffers that shaders bind: a world without lights.
struct DarkBuffers {
    params: wgpu::Buffer,
    storage: wgpu::Buffer,
}

impl DarkBuffers {
    fn new(device: &wgpu::Device) -> Result<Self, GpuError> {
        // The root node and more: shaders never read past the end of a buffer.
        let storage = memory::create_buffer(device, "no lights", 256, wgpu::BufferUsages::STORAGE)?;
        Ok(Self { params: params_buffer(device)?, storage })
    }
}

impl GpuLights {
    /// Makes pipelines and small buffers on the engine's device. Clones both handles, and submits
    /// nothing.
    ///
    /// # Errors
    /// - [`GpuError::Limit`] names the first limit of the device that is not sufficient. WebGPU's
    ///   default limits are.
    /// - [`GpuError::DeviceLost`] and [`GpuError::OutOfMemory`].
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Result<Self, GpuError> {
        check_limits(&device.limits())?;
        probe::check(device)?;
        let (result, is_refused) = memory::watch(device, || Self::make(device, queue));
        if is_refused { Err(GpuError::OutOfMemory { what: "pipelines", bytes: 0 }) } else { result }
    }

    fn make(device: &wgpu::Device, queue: &wgpu::Queue) -> Result<Self, GpuError> {
        let nodes = Pool::new(device, queue, "light tree nodes", 64)?;
        let lights = Pool::new(device, queue, "lights", 64)?;
        let instances = Pool::new(device, queue, "instances", 64)?;
        let trees = Pool::new(device, queue, "light trees", 16)?;
        let parts = PartTable::new(device, queue)?;
        let candidates = CandidateTable::new(device, queue)?;
        let no_usage = usage::zeros(device, 0)?;
        let dark = DarkBuffers::new(device)?;
        let params_buffer = params_buffer(device)?;
        let params = ParamsRecord {
            splits: SplitCount::DEFAULT.get() as u32,
            strides: Strides::of(Effects::all()),
            ..ParamsRecord::default()
        };
        queue.write_buffer(&params_buffer, 0, bytemuck::bytes_of(&params));
        let top = TopBuild::new(device, queue)?;
        let layout = light_layout(device);
        let sampling = Kernel::sampling(device, &layout);
        let resampling = Kernel::resampling(device, &layout);
        let buffers = [&params_buffer, top.nodes(), nodes.buffer(), instances.buffer(), lights.buffer()];
        let bind_group = bind_lights(device, &layout, &buffers);
        let bound = [top.generation(), nodes.generation(), instances.generation(), lights.generation()];
        Ok(Self {
            device: device.clone(),
            queue: queue.clone(),
            nodes,
            lights,
            instances,
            instance_count: 0,
            trees,
            tree_ranges: Vec::new(),
            parts,
            pending: PendingChanges::default(),
            directionals: 0..0,
            params,
            params_buffer,
            spare_params: None,
            relayout: None,
            top,
            top_status: TopStatus::new(),
            sampling,
            resampling,
            candidates,
            effects: Effects::all() - Effects::MOVING,
            node_counter: OnceLock::new(),
            usage: OnceLock::new(),
            learnt: OnceLock::new(),
            origin: DVec3::ZERO,
            no_usage,
            is_dark: false,
            dark,
            layout,
            bind_group,
            bound: Some(bound),
        })
    }

    /// Records the build of the top level into the engine's encoder, if a build is due.
    ///
    /// A build is due after an upload that changed something. It is also due if the commands of the
    /// last build were dropped before they were submitted, as in a frame that is skipped or whose
    /// surface is outdated: the next call records it again. Otherwise nothing is recorded.
    ///
    /// Submit the encoder before the next [`GpuLights::upload`]: the numbers of instances and
    /// rounds that a build reads are written ahead of the next submission, and the next build
    /// overwrites them. Commands that are neither submitted nor dropped yet count as submitted, so
    /// submit encoders in the order of recording. Submitting more than one build of the same
    /// upload does no harm: each makes the same top level.
    ///
    /// Records 16 dispatches, and two for each round, of which a hundred thousand instances take
    /// five.
    pub fn build_top(&mut self, encoder: &mut wgpu::CommandEncoder) {
        if self.is_dark || !self.top_status.needs_build() {
            return;
        }
        self.top_status.record(encoder);
        let mut recorder = Recorder::together(encoder, "girandole top level");
        self.top.record(&mut recorder, self.parts.count());
    }

    /// Sets how many clusters shaders split before they choose a light, as
    /// [`LightSampler::with_splits`](crate::LightSampler::with_splits) does. It is
    /// [`SplitCount::DEFAULT`] at first. Writes 48 bytes, ahead of the next submission.
    pub fn set_splits(&mut self, splits: SplitCount) {
        self.send_params(ParamsRecord { splits: splits.get() as u32, ..self.params });
    }

    /// Returns the bytes sent.
    fn send_params(&mut self, params: ParamsRecord) -> u64 {
        if params == self.params {
            return 0;
        }
        self.params = params;
        self.queue.write_buffer(&self.params_buffer, 0, bytemuck::bytes_of(&params));
        size_of::<ParamsRecord>() as u64
    }

    /// The layout of [`GpuLights::bind_group`], for the pipeline layouts of the engine's shaders:
    /// one uniform buffer and four read-only storage buffers, for compute and fragment stages.
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
        &self.bind_group
    }

    /// The effects that a shader must support to use [`GpuLights::bind_group`]: those of
    /// [`LightWorld::effects`](crate::LightWorld::effects) at the last upload, and all before the
    /// first one. Never contains [`Effects::MOVING`], on which no shader depends.
    pub fn effects(&self) -> Effects {
        self.effects
    }

    /// Returns the WGSL text and the bind group layout that an engine's shader needs to choose
    /// lights. Joins texts and compiles nothing.
    ///
    /// `group` is the number of the bind group with the lights, 0 to 3 by WebGPU's default.
    /// `effects` are the effects that the text has to support; with [`Effects::all`] it supports
    /// every world.
    pub fn shader(&self, group: u32, effects: Effects) -> LightShader {
        let wgsl = wgsl(group, effects);
        let layout = self.layout.clone();
        LightShader { wgsl, group, effects, records_usage: false, learns_visibility: false, target: None, layout }
    }

    /// Writes the parameters, and replaces bind groups whose buffers were replaced. Returns the
    /// bytes sent.
    fn refresh(&mut self, params: ParamsRecord) -> u64 {
        let bound =
            [self.top.generation(), self.nodes.generation(), self.instances.generation(), self.lights.generation()];
        self.top.set_layout(params.strides, params.masks);
        self.top.bind(self.parts.pool(), &self.instances, &self.trees);
        let sent = if Some(bound) == self.bound {
            self.send_params(params)
        } else {
            // The former bind group keeps the former buffers, to which the former strides belong.
            self.params_buffer = self.spare_params.take().expect("the upload has made a spare buffer");
            self.params = params;
            self.queue.write_buffer(&self.params_buffer, 0, bytemuck::bytes_of(&params));
            self.bind_group = bind_lights(&self.device, &self.layout, &self.buffers());
            self.bound = Some(bound);
            size_of::<ParamsRecord>() as u64
        };
        self.rebind_usage();
        self.rebind_visibility();
        sent
    }

    /// Binds buffers of zeros, in which shaders find no light, until an upload succeeds.
    fn make_dark(&mut self) {
        self.is_dark = true;
        self.bound = None;
        self.bind_group = bind_lights(&self.device, &self.layout, &self.buffers());
        if let Some(usage) = self.usage.get_mut() {
            usage.restart();
        }
        self.rebind_usage();
        self.rebind_visibility();
    }

    /// The buffers that shaders bind, in the order of the layout.
    fn buffers(&self) -> [&wgpu::Buffer; 5] {
        if self.is_dark {
            let DarkBuffers { params, storage } = &self.dark;
            return [params, storage, storage, storage, storage];
        }
        [&self.params_buffer, self.top.nodes(), self.nodes.buffer(), self.instances.buffer(), self.lights.buffer()]
    }
}

impl fmt::Debug for GpuLights {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("GpuLights")
            .field("effects", &self.effects)
            .field("splits", &self.params.splits)
            .field("instance_slots", &self.params.slots)
            .field("tree_slots", &self.tree_ranges.len())
            .field("parts", &self.parts.count())
            .field("node_capacity", &self.nodes.capacity())
            .field("light_capacity", &self.lights.capacity())
            .field("needs_build", &self.top_status.needs_build())
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec3};

    use super::*;
    use crate::gpu::testing::{gpu, read};
    use crate::light::Light;
    use crate::placement::Placement;
    use crate::policy::Policy;
    use crate::world::{FrameDelta, LightWorld};

    #[test]
    fn every_public_type_has_a_debug_form_and_may_be_shared_by_threads() {
        fn check<T: fmt::Debug + Send + Sync>() {}
        check::<GpuLights>();
        check::<GpuError>();
        check::<LightShader>();
        check::<ReservoirRecord>();
        check::<SampleRecord>();
        check::<SampleRequest>();
        check::<TargetHook>();
        check::<TargetHookError>();
        check::<UploadReport>();
        check::<UsageCounts<'static>>();
        fn has_debug_form<T: fmt::Debug>() {}
        has_debug_form::<PipelineVariants<wgpu::ComputePipeline>>();
        let (device, queue) = gpu();
        let lights = GpuLights::new(&device, &queue).expect("default limits are enough");
        let text = format!("{lights:?}");
        assert!(text.contains("instance_slots: 0") && text.contains("needs_build: true"), "{text}");
    }

    #[test]
    fn two_builds_of_one_upload_give_the_same_top_level() {
        let (device, queue) = gpu();
        let mut world = LightWorld::new();
        let tree = world.add_tree(vec![Light::point(Vec3::Y, Vec3::ONE)]).expect("valid");
        for i in 0..700_u32 {
            let place = DVec3::new(f64::from(i * i % 97), 0.0, f64::from(i % 31));
            world.add_instance(tree, Placement::at(place), Policy::Static).expect("valid");
        }
        let mut lights = GpuLights::new(&device, &queue).expect("default limits are enough");
        lights.upload(&world, &FrameDelta::everything(&world)).expect("room enough");
        let mut record = || {
            lights.top_status.invalidate();
            let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            lights.build_top(&mut encoder);
            encoder.finish()
        };
        let [dropped, once, again] = [record(), record(), record()];
        drop(dropped);
        queue.submit([once]);
        let nodes: Vec<u32> = read(&device, &queue, lights.top.nodes());
        assert!(nodes.iter().any(|word| *word != 0));
        queue.submit([again]);
        assert!(read::<u32>(&device, &queue, lights.top.nodes()) == nodes);
    }
}
