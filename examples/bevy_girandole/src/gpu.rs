//! The lights on Bevy's device: upload, the build of the top level, and the bind groups of passes.

use std::collections::HashMap;
use std::time::Instant;

use bevy::log::error_once;
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_resource::{
    BindGroup, BindGroupLayoutDescriptor, BindGroupLayoutEntry, BindingType, Buffer, BufferBindingType,
    BufferInitDescriptor, BufferUsages, ShaderStages,
};
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue};
use bevy::render::view::ExtractedView;
use girandole::Effects;
use girandole::gpu::{GpuLights, GpuOptions};

use crate::components::GirandoleCamera;
use crate::kinds::KindRecord;
use crate::pass::PassShaders;
use crate::settings::{GirandoleReport, GirandoleSettings, GirandoleStats};
use crate::shadows::GirandoleShadows;
use crate::world::GirandoleLights;

/// What the lights of this plugin may call for: everything but segments, masks and
/// sampling by solid angle. The shader text supports the effects that are returned.
pub fn effects() -> Effects {
    Effects::CONES
        | Effects::RANGES
        | Effects::AREAS
        | Effects::DIRECTIONAL
        | Effects::NON_RIGID
        | Effects::FACTORS
        | Effects::GLOSSY
        | Effects::SKY
}

/// What the lights keep on the device.
#[derive(Resource, Clone, Copy)]
pub struct LightOptions(pub GpuOptions);

/// The lights on the GPU, in the render world.
#[derive(Resource)]
pub struct GirandoleGpu {
    lights: GpuLights,
    kinds: Option<Buffer>,
    bind_group: Option<BindGroup>,
    source_group: Option<BindGroup>,
    source_numbers: HashMap<Entity, u32>,
    /// Frames since the device was made.
    pub(crate) frames: u64,
    /// Whether any light changed in this frame.
    pub has_changed: bool,
    /// Whether any surface changed in this frame.
    pub has_new_surfaces: bool,
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
}

/// The layout of [`GirandoleGpu::bind_group`], as Bevy's pipelines describe it.
pub fn lights_layout() -> BindGroupLayoutDescriptor {
    layout("girandole lights", &[BufferBindingType::Uniform, READ, READ, READ, READ, READ, WRITE, READ])
}

/// The layout of [`GirandoleGpu::source_group`], for compute pipelines.
pub fn sources_layout() -> BindGroupLayoutDescriptor {
    let entry = |binding| BindGroupLayoutEntry { visibility: ShaderStages::COMPUTE, ..buffer_entry(binding, WRITE) };
    BindGroupLayoutDescriptor::new("girandole sources", &[entry(0), entry(1)])
}

pub(crate) const READ: BufferBindingType = BufferBindingType::Storage { read_only: true };
pub(crate) const WRITE: BufferBindingType = BufferBindingType::Storage { read_only: false };

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
pub fn start(mut commands: Commands, device: Res<RenderDevice>, queue: Res<RenderQueue>, options: Res<LightOptions>) {
    match GpuLights::with_options(device.wgpu_device(), &queue, options.0) {
        Ok(lights) => commands.insert_resource(GirandoleGpu {
            lights,
            kinds: None,
            bind_group: None,
            source_group: None,
            source_numbers: HashMap::new(),
            frames: 0,
            has_changed: false,
            has_new_surfaces: false,
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
    gpu.has_new_surfaces = std::mem::take(&mut lights.has_new_surfaces);
    gpu.counts = [lights.slot_count, lights.world.directionals().len() as u32];
    stats.set(GirandoleReport {
        frames: gpu.frames,
        passes: 0,
        added: counts.added,
        removed: counts.removed,
        moved: counts.moved,
        changed: counts.changed,
        bytes,
        instances,
        trees: lights.world.trees().len(),
        lights: lights.world.instances().len(),
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

/// Makes cells follow the pixels of the first camera with a perspective: of one with a [`GirandoleCamera`], if there is
/// any.
pub fn follow_camera(
    gpu: Option<ResMut<GirandoleGpu>>,
    cameras: Query<(Entity, &ExtractedView, &ExtractedCamera, Has<GirandoleCamera>)>,
) {
    let perspectives = cameras.iter().filter_map(|(entity, view, camera, is_ours)| {
        let rows = camera.physical_viewport_size.filter(|size| size.y > 0)?.y;
        // Of a pixel at a distance of a metre, in metres.
        let size = 2.0 / (view.clip_from_view.y_axis.y * rows as f32);
        let eye = view.world_from_view.translation().as_dvec3();
        (view.clip_from_view.w_axis.w == 0.0).then_some(((!is_ours, camera.order, entity), eye, size))
    });
    if let Some(((_, eye, size), mut gpu)) = perspectives.min_by_key(|(order, ..)| *order).zip(gpu) {
        gpu.lights.set_cut_view(eye, size);
    }
}

/// Records the builds of the top level and of the cuts of cells that the last frame marked, ahead of the passes of all
/// cameras.
pub fn build_top(gpu: Option<ResMut<GirandoleGpu>>, mut context: RenderContext) {
    if let Some(mut gpu) = gpu {
        gpu.lights.build_top(context.command_encoder());
        gpu.lights.build_cuts(context.command_encoder());
    }
}
