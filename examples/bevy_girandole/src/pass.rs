//! The pass that adds the light to the picture of a camera, in Bevy's schedule of 3D cameras.

use bevy::core_pipeline::FullscreenShader;
use bevy::pbr::{MeshPipeline, MeshPipelineKey, MeshViewBindGroup, ViewKeyCache};
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_resource::{
    BindGroupEntry, BindGroupLayoutDescriptor, BindGroupLayoutEntry, BindingResource, BindingType, BlendComponent,
    BlendFactor, BlendOperation, BlendState, BufferBindingType, BufferInitDescriptor, BufferUsages,
    CachedRenderPipelineId, ColorTargetState, ColorWrites, FragmentState, LoadOp, Operations, PipelineCache,
    RenderPassColorAttachment, RenderPassDescriptor, RenderPipelineDescriptor, ShaderStages, SpecializedRenderPipeline,
    SpecializedRenderPipelines, StoreOp, TextureSampleType, TextureViewDimension,
};
use bevy::render::renderer::{RenderContext, RenderDevice, ViewQuery};
use bevy::render::view::{ExtractedView, ViewTarget};
use bevy::shader::{Shader, ShaderDefVal};
use bytemuck::{Pod, Zeroable};

use crate::components::{Estimate, GirandoleCamera};
use crate::gpu::{GirandoleGpu, READ, WRITE, buffer_entry, lights_layout};
use crate::history::{DIST_FORMAT, FrameKey, History, MEAN_FORMAT};
use crate::settings::GirandoleStats;
use crate::shadows::{GirandoleShadows, ShadowRays};

/// Numbers for the pass of one camera. Twin of `GirandoleView` in pass.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct ViewUniform {
    seed: u32,
    frame: u32,
    candidates: u32,
    samples: u32,
    still_frames: u32,
    moving_frames: u32,
    is_exhaustive: u32,
    slots: u32,
    directionals: u32,
    has_history: u32,
    lights_moved: u32,
    heat_map: u32,
    reused_frames: u32,
    width: u32,
    shows_history: u32,
    padding: u32,
}

/// What a pass writes.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub enum Output {
    /// Light, which is added to the picture.
    Light,
    /// In place of the picture.
    History,
    /// By a shader of its own.
    HeatMap,
}

impl Output {
    fn of(estimate: Estimate) -> Self {
        match estimate {
            Estimate::Sampled | Estimate::Exhaustive => Self::Light,
            Estimate::History => Self::History,
            Estimate::HeatMap(_) => Self::HeatMap,
        }
    }
}

/// Makes the pipelines of the pass.
#[derive(Resource)]
pub struct PassPipelines {
    mesh_pipeline: MeshPipeline,
    fullscreen: FullscreenShader,
    shaders: PassShaders,
    layout: BindGroupLayoutDescriptor,
}

/// The shaders of the pass, which the main world has made.
#[derive(Resource, Clone)]
pub struct PassShaders {
    /// The light, and the heat map in its place.
    pub texts: [Handle<Shader>; 2],
    /// How they trace shadow rays, if they do.
    pub shadows: Option<ShadowRays>,
}

/// The pipeline of one camera.
#[derive(Component)]
pub struct PassPipeline(CachedRenderPipelineId);

pub fn start(
    mut commands: Commands,
    mesh_pipeline: Res<MeshPipeline>,
    fullscreen: Res<FullscreenShader>,
    shaders: Res<PassShaders>,
    shadows: Option<Res<GirandoleShadows>>,
) {
    let texture = |binding| BindGroupLayoutEntry {
        binding,
        visibility: ShaderStages::FRAGMENT,
        ty: BindingType::Texture {
            sample_type: TextureSampleType::Float { filterable: false },
            view_dimension: TextureViewDimension::D2,
            multisampled: false,
        },
        count: None,
    };
    let kinds = buffer_entry(0, BufferBindingType::Storage { read_only: true });
    let view = buffer_entry(1, BufferBindingType::Uniform);
    let [then, now] = [(8, READ), (9, WRITE)].map(|(binding, ty)| buffer_entry(binding, ty));
    let mut entries = vec![kinds, view, texture(2), texture(3), then, now];
    entries.extend(shadows.iter().flat_map(|shadows| shadows.layout_entries()));
    commands.insert_resource(PassPipelines {
        mesh_pipeline: mesh_pipeline.clone(),
        fullscreen: fullscreen.clone(),
        shaders: shaders.clone(),
        layout: BindGroupLayoutDescriptor::new("girandole pass", &entries),
    });
}

impl SpecializedRenderPipeline for PassPipelines {
    type Key = (MeshPipelineKey, Output);

    #[allow(clippy::needless_update)]
    fn specialize(&self, (key, output): Self::Key) -> RenderPipelineDescriptor {
        let layout = self.mesh_pipeline.get_view_layout(key.into());
        let add = BlendComponent {
            src_factor: BlendFactor::One,
            dst_factor: BlendFactor::One,
            operation: BlendOperation::Add,
        };
        let blend = (output == Output::Light).then_some(BlendState { color: add, alpha: add });
        let targets = [(key.target_format(), blend), (MEAN_FORMAT, None), (DIST_FORMAT, None)];
        let target = |(format, blend)| Some(ColorTargetState { format, blend, write_mask: ColorWrites::ALL });
        RenderPipelineDescriptor {
            label: Some("girandole pass".into()),
            layout: vec![layout.main_layout, layout.binding_array_layout, self.layout.clone(), lights_layout()],
            vertex: self.fullscreen.to_vertex_state(),
            fragment: Some(FragmentState {
                shader: self.shaders.texts[usize::from(output == Output::HeatMap)].clone(),
                shader_defs: shader_defs(&self.mesh_pipeline, key),
                entry_point: Some("girandole_fragment".into()),
                targets: targets.map(target).to_vec(),
                // Bevy 0.20 has one more field.
                ..default()
            }),
            ..default()
        }
    }
}

/// What Bevy's shader modules need to know of the pipeline, as in Bevy's deferred lighting.
fn shader_defs(mesh_pipeline: &MeshPipeline, key: MeshPipelineKey) -> Vec<ShaderDefVal> {
    let mut defs: Vec<ShaderDefVal> = [
        "DEFERRED_LIGHTING_PIPELINE",
        "STANDARD_MATERIAL_CLEARCOAT",
        "DEFERRED_PREPASS",
        "DEPTH_PREPASS",
        "MOTION_VECTOR_PREPASS",
    ]
    .map(Into::into)
    .to_vec();
    if key.contains(MeshPipelineKey::NORMAL_PREPASS) {
        defs.push("NORMAL_PREPASS".into());
    }
    if mesh_pipeline.binding_arrays_are_usable {
        defs.push("MULTIPLE_LIGHT_PROBES_IN_ARRAY".into());
    }
    defs
}

/// Chooses the pipeline of each camera.
pub fn specialize(
    mut commands: Commands,
    cache: Res<PipelineCache>,
    keys: Res<ViewKeyCache>,
    mut made: ResMut<SpecializedRenderPipelines<PassPipelines>>,
    pipelines: Res<PassPipelines>,
    cameras: Query<(Entity, &ExtractedView, &ExtractedCamera, &GirandoleCamera)>,
) {
    let needed =
        MeshPipelineKey::DEPTH_PREPASS | MeshPipelineKey::DEFERRED_PREPASS | MeshPipelineKey::MOTION_VECTOR_PREPASS;
    for (entity, view, camera, settings) in &cameras {
        let Some(key) = keys.get(&view.retained_view_entity).copied() else { continue };
        if !key.contains(needed) || key.msaa_samples() != 1 || !camera.hdr {
            warn_once!("girandole: a camera needs the depth, deferred and motion vector prepasses, Hdr and Msaa::Off");
            commands.entity(entity).remove::<PassPipeline>();
            continue;
        }
        let pipeline = made.specialize(&cache, &pipelines, (key, Output::of(settings.estimate)));
        commands.entity(entity).insert(PassPipeline(pipeline));
    }
}

type PassView = (
    &'static GirandoleCamera,
    &'static ExtractedCamera,
    &'static MeshViewBindGroup,
    &'static ViewTarget,
    &'static PassPipeline,
    &'static mut History,
);

/// Records the pass of one camera.
pub fn draw(
    view: ViewQuery<PassView>,
    cache: Res<PipelineCache>,
    pipelines: Res<PassPipelines>,
    gpu: Option<Res<GirandoleGpu>>,
    shadows: Option<Res<GirandoleShadows>>,
    stats: Res<GirandoleStats>,
    mut context: RenderContext,
) {
    let (settings, camera, mesh_view, target, pipeline, mut history) = view.into_inner();
    let Some(gpu) = gpu else { return };
    let Some(pipeline) = cache.get_render_pipeline(pipeline.0) else { return };
    let (Some(kinds), Some(lights)) = (gpu.kinds(), gpu.bind_group()) else { return };
    let casters = shadows.as_ref().map_or(Some(Vec::new()), |shadows| shadows.bindings());
    let Some(casters) = casters else { return };
    let has_new_shadows = shadows.as_ref().is_some_and(|shadows| shadows.updated.has_changed);
    let waiting = cache.waiting_pipelines().count();
    let frame = history.next_frame(FrameKey {
        frame: gpu.frames,
        setting: settings.history,
        estimate: settings.estimate,
        viewport: camera.viewport.as_ref().map(|viewport| [viewport.physical_position, viewport.physical_size]),
        exposure: camera.exposure,
    });
    let settles = history.settles(gpu.has_new_surfaces, waiting, settings.moving_frames);
    let uniform = ViewUniform {
        seed: settings.seed,
        frame: frame.number,
        candidates: settings.candidates,
        samples: settings.samples,
        still_frames: settings.still_frames.max(settings.moving_frames),
        moving_frames: settings.moving_frames,
        is_exhaustive: u32::from(settings.estimate == Estimate::Exhaustive),
        slots: gpu.counts[0],
        directionals: gpu.counts[1],
        has_history: u32::from(frame.has_past),
        lights_moved: u32::from(gpu.has_changed || frame.has_new_exposure || has_new_shadows || settles),
        heat_map: match settings.estimate {
            Estimate::HeatMap(shown) => shown.number(),
            _ => 0,
        },
        reused_frames: if frame.keeps { settings.reused_frames } else { 0 },
        width: frame.width,
        shows_history: u32::from(settings.estimate == Estimate::History),
        padding: 0,
    };
    let device: &RenderDevice = context.render_device();
    let uniform = device.create_buffer_with_data(&BufferInitDescriptor {
        label: Some("girandole view"),
        contents: bytemuck::bytes_of(&uniform),
        usage: BufferUsages::UNIFORM,
    });
    let resources = [
        kinds.as_entire_binding(),
        uniform.as_entire_binding(),
        BindingResource::TextureView(&frame.past.mean),
        BindingResource::TextureView(&frame.past.dist),
        frame.past.kept.as_entire_binding(),
        frame.present.kept.as_entire_binding(),
    ];
    // Between them is what casts shadows.
    let entries = [0, 1, 2, 3, 8, 9].into_iter().zip(resources);
    let entries = entries.map(|(binding, resource)| BindGroupEntry { binding, resource });
    let entries: Vec<_> = entries.chain(casters).collect();
    let own = device.create_bind_group("girandole pass", &cache.get_bind_group_layout(&pipelines.layout), &entries);
    let write = |view| {
        let ops = Operations { load: LoadOp::Clear(default()), store: StoreOp::Store };
        Some(RenderPassColorAttachment { view, depth_slice: None, resolve_target: None, ops })
    };
    let mut pass = context.begin_tracked_render_pass(RenderPassDescriptor {
        label: Some("girandole pass"),
        color_attachments: &[
            Some(target.get_color_attachment()),
            write(&frame.present.mean),
            write(&frame.present.dist),
        ],
        depth_stencil_attachment: None,
        timestamp_writes: None,
        occlusion_query_set: None,
        multiview_mask: None,
    });
    if let Some(viewport) = &camera.viewport {
        pass.set_camera_viewport(viewport);
    }
    pass.set_render_pipeline(pipeline);
    pass.set_bind_group(0, &mesh_view.main, &mesh_view.main_offsets);
    pass.set_bind_group(1, &mesh_view.binding_array, &[]);
    pass.set_bind_group(2, &own, &[]);
    pass.set_bind_group(3, lights, &[]);
    pass.draw(0..3, 0..1);
    stats.count_pass();
}
