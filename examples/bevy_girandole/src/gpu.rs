//! The lights on Bevy's device: upload, the build of the top level, and the bind groups of passes.

use std::collections::HashMap;
use std::time::Instant;

use bevy::log::error_once;
use bevy::prelude::*;
use bevy::render::render_resource::{
    BindGroup, BindGroupLayoutDescriptor, BindGroupLayoutEntry, BindingType, Buffer, BufferBindingType,
    BufferInitDescriptor, BufferUsages, ShaderStages,
};
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue};
use girandole::gpu::GpuLights;
use girandole::{CutOptions, Effects, VisibilityOptions};

use crate::kinds::KindRecord;
use crate::pass::PassShaders;
use crate::settings::{GirandoleReport, GirandoleSettings, GirandoleStats};
use crate::shadows::{GirandoleShadows, ShadowRays};
use crate::world::GirandoleLights;

/// What the lights of this plugin may call for: everything but segments, masks, origins on a grid,
/// and sampling by solid angle. The shader text supports the effects that are returned.
pub fn effects() -> Effects {
    Effects::CONES
        | Effects::RANGES
        | Effects::AREAS
        | Effects::TWO_SIDED
        | Effects::DIRECTIONAL
        | Effects::NON_RIGID
        | Effects::FACTORS
        | Effects::GLOSSY
        | Effects::SKY
}

/// The storage buffers that a stage binds when it chooses from shared cuts: those of Bevy's view and six of this plugin.
const STORAGE_BUFFERS: u32 = 16;
/// Those that it binds as well when it learns from shadow rays.
const LEARNING_BUFFERS: u32 = 2;

/// The lights on the GPU, in the render world.
#[derive(Resource)]
pub struct GirandoleGpu {
    lights: GpuLights,
    kinds: Option<Buffer>,
    bind_group: Option<BindGroup>,
    source_group: Option<BindGroup>,
    source_numbers: HashMap<Entity, u32>,
    /// The settings of the table of shared cuts that was made last, or refused.
    asked: Option<CutOptions>,
    /// Whether there is a table of shared cuts.
    shares_cuts: bool,
    /// The settings of the table of learnt visibility that was made last, or refused.
    asked_to_learn: Option<VisibilityOptions>,
    /// Frames since the device was made.
    pub(crate) frames: u64,
    /// Whether any light changed in this frame.
    pub has_changed: bool,
    /// Slots of instances, and directional lights, for sums over all lights.
    pub counts: [u32; 2],
}

impl GirandoleGpu {
    /// The lights, to be bound at the group of the shader's module; `None` before the first upload.
    /// It has the layout of [`lights_layout`].
    pub fn bind_group(&self) -> Option<&BindGroup> {
        self.bind_group.as_ref()
    }

    /// What compute passes bind to write lights, at the group [`SOURCES_GROUP`](crate::SOURCES_GROUP) of the module
    /// `girandole::sources`. It has the layout of [`sources_layout`]. `None` before the first upload of a
    /// [`GirandoleSource`](crate::GirandoleSource) or of a light that is posed, and while there is no memory for lights.
    pub fn source_group(&self) -> Option<&BindGroup> {
        self.source_group.as_ref()
    }

    /// The number by which a pass finds the lights of an entity of the main world with a
    /// [`GirandoleSource`](crate::GirandoleSource). It stays the same while the entity has the component.
    pub fn source_number(&self, entity: Entity) -> Option<u32> {
        self.source_numbers.get(&entity).copied()
    }

    /// The buffer with one record for each kind of light, which the module binds as
    /// `girandole_kinds`; `None` before the first upload.
    pub fn kinds(&self) -> Option<&Buffer> {
        self.kinds.as_ref()
    }

    /// Replaces the table of learnt visibility, if the settings ask for another one.
    fn learn(&mut self, wanted: Option<VisibilityOptions>) {
        let wanted = wanted.filter(|_| self.shares_cuts);
        if wanted != self.asked_to_learn {
            self.asked_to_learn = wanted;
            if let Err(error) = self.lights.learn_visibility(wanted) {
                error_once!("girandole: {error}");
            }
        }
    }

    /// Whether there is a table of shared cuts.
    pub(crate) fn shares_cuts(&self) -> bool {
        self.shares_cuts
    }

    /// What shaders bind that mark cells, and that choose from their cuts.
    pub(crate) fn cut_bind_groups(&self, learns: bool) -> [BindGroup; 2] {
        let cuts = if learns { self.lights.learning_cut_bind_group() } else { self.lights.cut_bind_group() };
        [self.lights.mark_bind_group(), cuts].map(|group| group.clone().into())
    }

    /// Makes cells follow the pixels of a camera: its position, and the size of a pixel at a distance of a metre.
    pub(crate) fn set_cut_view(&mut self, eye: Vec3, pixel: f32) {
        self.lights.set_cut_view(eye.as_dvec3(), pixel);
    }

    /// Records the build of the cuts of marked cells.
    pub(crate) fn build_cuts(&mut self, context: &mut RenderContext) {
        self.lights.build_cuts(context.command_encoder());
    }

    /// Replaces the table of shared cuts, if the settings ask for another one.
    fn share_cuts(&mut self, wanted: Option<CutOptions>, shadows: Option<ShadowRays>, device: &RenderDevice) {
        let needed = STORAGE_BUFFERS + shadows.map_or(0, |rays| LEARNING_BUFFERS + rays.storage_buffers());
        let has_room = device.limits().max_storage_buffers_per_shader_stage >= needed;
        let wanted = wanted.filter(|_| has_room);
        if wanted == self.asked {
            return;
        }
        self.asked = wanted;
        match self.lights.share_cuts(wanted) {
            Ok(()) => self.shares_cuts = wanted.is_some(),
            Err(error) => error_once!("girandole: {error}"),
        }
    }
}

/// The layout of [`GirandoleGpu::bind_group`], as Bevy's pipelines describe it.
pub fn lights_layout() -> BindGroupLayoutDescriptor {
    layout("girandole lights", &[BufferBindingType::Uniform, READ, READ, READ, READ])
}

/// The layout of [`GirandoleGpu::source_group`], for compute pipelines.
pub fn sources_layout() -> BindGroupLayoutDescriptor {
    let entry = |binding| BindGroupLayoutEntry {
        visibility: ShaderStages::COMPUTE,
        ..buffer_entry(binding, BufferBindingType::Storage { read_only: false })
    };
    BindGroupLayoutDescriptor::new("girandole sources", &[entry(0), entry(1)])
}

/// The layout of shaders that choose from shared cuts, and may learn.
pub(crate) fn cuts_layout(learns: bool) -> BindGroupLayoutDescriptor {
    let written = BufferBindingType::Storage { read_only: false };
    let all = [BufferBindingType::Uniform, READ, READ, READ, READ, READ, READ, written];
    layout("girandole lights and cuts", &all[..if learns { 8 } else { 6 }])
}

/// The layout of shaders that mark cells.
pub(crate) fn marks_layout() -> BindGroupLayoutDescriptor {
    layout("girandole marks", &[BufferBindingType::Storage { read_only: false }])
}

pub(crate) const READ: BufferBindingType = BufferBindingType::Storage { read_only: true };

pub(crate) fn layout(label: &'static str, types: &[BufferBindingType]) -> BindGroupLayoutDescriptor {
    let entries: Vec<_> = types.iter().zip(0..).map(|(ty, binding)| buffer_entry(binding, *ty)).collect();
    BindGroupLayoutDescriptor::new(label, &entries)
}

/// A buffer for compute and fragment shaders.
pub fn buffer_entry(binding: u32, ty: BufferBindingType) -> BindGroupLayoutEntry {
    BindGroupLayoutEntry {
        binding,
        visibility: ShaderStages::COMPUTE | ShaderStages::FRAGMENT,
        ty: BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
        count: None,
    }
}

/// Creates the lights on a device, including a new device after the previous one was lost.
pub fn start(mut commands: Commands, device: Res<RenderDevice>, queue: Res<RenderQueue>) {
    match GpuLights::new(device.wgpu_device(), &queue) {
        Ok(lights) => commands.insert_resource(GirandoleGpu {
            lights,
            kinds: None,
            bind_group: None,
            source_group: None,
            source_numbers: HashMap::new(),
            asked: None,
            shares_cuts: false,
            asked_to_learn: None,
            frames: 0,
            has_changed: false,
            counts: [0; 2],
        }),
        Err(error) => error_once!("girandole: {error}"),
    }
}

/// Updates the light world and uploads what changed.
pub fn prepare(
    mut lights: ResMut<GirandoleLights>,
    gpu: Option<ResMut<GirandoleGpu>>,
    settings: Res<GirandoleSettings>,
    device: Res<RenderDevice>,
    shaders: Res<PassShaders>,
    shadows: Option<Res<GirandoleShadows>>,
    stats: Res<GirandoleStats>,
) {
    let Some(mut gpu) = gpu else { return };
    let lights = &mut *lights;
    lights.apply();
    let start = Instant::now();
    gpu.lights.follow_sources(&mut lights.world);
    let frame = lights.update(settings.budget);
    let update = start.elapsed();
    let start = Instant::now();
    let (mut bytes, mut instances) = (0, 0);
    gpu.share_cuts(settings.cuts.filter(|_| shaders.sharing.is_some()), shaders.shadows, &device);
    gpu.learn(settings.visibility.filter(|_| shaders.shadows.is_some()));
    match gpu.lights.upload(&lights.world) {
        Ok(report) => (bytes, instances) = (report.bytes, report.instances),
        Err(error) => error_once!("girandole: {error}"),
    }
    if lights.has_new_records || gpu.kinds.is_none() {
        bytes += upload_kinds(&mut gpu, &device, &lights.records);
        lights.has_new_records = false;
    }
    if !effects().contains(gpu.lights.effects()) && gpu.frames > 0 {
        error_once!("girandole: the lights need effects that the shader lacks: {:?}", gpu.lights.effects());
    }
    gpu.source_group = gpu.lights.source_group().map(|group| group.clone().into());
    gpu.source_numbers.clone_from(&lights.source_numbers());
    gpu.bind_group = Some(gpu.lights.bind_group().clone().into());
    gpu.frames += 1;
    let (updated, [casters, waiting_meshes], shadow_time) =
        shadows.map_or_else(Default::default, |shadows| (shadows.updated, shadows.counts(), shadows.took));
    bytes += updated.bytes;
    let counts = lights.take_counts();
    gpu.has_changed = counts.any() || frame.rebuilt_trees > 0 || frame.refit_trees > 0;
    gpu.counts = [lights.slot_count, lights.world.directional_count() as u32];
    stats.set(GirandoleReport {
        frames: gpu.frames,
        passes: 0,
        added: counts.added,
        removed: counts.removed,
        moved: counts.moved,
        changed: counts.changed,
        bytes,
        instances,
        trees: lights.world.tree_count(),
        lights: lights.world.instance_count(),
        written: lights.written_trees(),
        shadow_rays: shaders.shadows,
        casters,
        waiting_meshes,
        structures: updated.structures,
        gather: counts.gather,
        apply: counts.apply,
        update,
        upload: start.elapsed(),
        shadows: shadow_time,
        refused: counts.refused,
    });
}

fn upload_kinds(gpu: &mut GirandoleGpu, device: &RenderDevice, records: &[KindRecord]) -> u64 {
    let contents = bytemuck::cast_slice(records);
    gpu.kinds = Some(device.create_buffer_with_data(&BufferInitDescriptor {
        label: Some("girandole kinds"),
        contents,
        usage: BufferUsages::STORAGE,
    }));
    contents.len() as u64
}

/// Records the build of the top level, ahead of the passes of all cameras.
pub fn build_top(gpu: Option<ResMut<GirandoleGpu>>, mut context: RenderContext) {
    if let Some(mut gpu) = gpu {
        gpu.lights.build_top(context.command_encoder());
    }
}

/// Records the end of a frame of learnt visibility, after the passes of all cameras.
pub fn fold_visibility(gpu: Option<ResMut<GirandoleGpu>>, mut context: RenderContext) {
    if let Some(mut gpu) = gpu {
        gpu.lights.fold_visibility(context.command_encoder());
    }
}
