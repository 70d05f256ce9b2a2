//! The pass that poses the triangles of skinned emissive meshes on the GPU.

use std::collections::HashMap;
use std::sync::Arc;

use bevy::prelude::*;
use bevy::render::render_resource::{
    BindGroup, BindGroupEntries, BindGroupLayoutDescriptor, Buffer, BufferInitDescriptor, BufferUsages,
    CachedComputePipelineId, ComputePassDescriptor, ComputePipelineDescriptor, PipelineCache, RawBufferVec,
};
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue};
use bevy::shader::Shader;

use crate::gpu::{GirandoleGpu, READ, layout, sources_layout};
use crate::skins::Triangle;
use crate::world::Lights;

/// The most workgroups of a dispatch in one dimension.
const MAX_GROUPS: usize = 65_535;
/// The invocations of a workgroup.
const LANES: usize = 64;

/// The text of the pass.
#[derive(Resource)]
pub struct SkinShader(pub Handle<Shader>);

/// The pass, and what it binds.
#[derive(Resource)]
pub struct Skinning {
    layout: BindGroupLayoutDescriptor,
    pipeline: CachedComputePipelineId,
    joints: RawBufferVec<Mat4>,
    /// By the address of their triangles.
    meshes: HashMap<usize, MeshSkins>,
}

/// A mesh, and the entities that have it.
struct MeshSkins {
    /// Keeps the address in use.
    triangles: Arc<[Triangle]>,
    corners: Buffer,
    /// The number of the source, the first joint, and the number of joints of each entity.
    skins: RawBufferVec<[u32; 4]>,
    group: Option<BindGroup>,
}

/// Creates the pass on a device.
pub fn start(mut commands: Commands, cache: Res<PipelineCache>, shader: Res<SkinShader>, mut lights: ResMut<Lights>) {
    let layout = layout("girandole skins", &[READ, READ, READ]);
    let pipeline = cache.queue_compute_pipeline(ComputePipelineDescriptor {
        label: Some("girandole skins".into()),
        layout: vec![layout.clone(), sources_layout()],
        shader: shader.0.clone(),
        entry_point: Some("girandole_skin".into()),
        ..default()
    });
    let mut joints = RawBufferVec::new(BufferUsages::STORAGE);
    joints.set_label(Some("girandole joints"));
    lights.has_new_skins = true;
    commands.insert_resource(Skinning { layout, pipeline, joints, meshes: HashMap::new() });
}

/// Uploads the poses of this frame, if any has changed, and the triangles of new meshes.
pub fn prepare(
    mut lights: ResMut<Lights>,
    skinning: Option<ResMut<Skinning>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    cache: Res<PipelineCache>,
) {
    let Some(mut skinning) = skinning.filter(|_| lights.has_new_skins) else { return };
    let Skinning { layout, joints, meshes, .. } = &mut *skinning;
    lights.has_new_skins = false;
    joints.clear();
    meshes.values_mut().for_each(|mesh| mesh.skins.clear());
    // Without a pose, lights are where they were when they were added.
    for (kind, skin) in lights.skins.iter().filter(|(_, skin)| !skin.pose.is_empty()) {
        let Some(source) = lights.source_number(*kind) else { continue };
        let address = skin.triangles.as_ptr().addr();
        let mesh = meshes.entry(address).or_insert_with(|| MeshSkins::new(&skin.triangles, &device));
        mesh.skins.push([source, joints.len() as u32, skin.pose.len() as u32, 0]);
        joints.extend(skin.pose.iter().copied());
    }
    meshes.retain(|_, mesh| !mesh.skins.is_empty());
    if meshes.is_empty() {
        return;
    }
    joints.write_buffer(&device, &queue);
    let own = cache.get_bind_group_layout(layout);
    for mesh in meshes.values_mut() {
        mesh.skins.write_buffer(&device, &queue);
        let (Some(skins), Some(joints)) = (mesh.skins.binding(), joints.binding()) else { continue };
        let entries = BindGroupEntries::sequential((mesh.corners.as_entire_binding(), skins, joints));
        mesh.group = Some(device.create_bind_group("girandole skins", &own, &entries));
    }
}

impl MeshSkins {
    fn new(triangles: &Arc<[Triangle]>, device: &RenderDevice) -> Self {
        let corners = device.create_buffer_with_data(&BufferInitDescriptor {
            label: Some("girandole corners"),
            contents: bytemuck::cast_slice(triangles),
            usage: BufferUsages::STORAGE,
        });
        let skins = RawBufferVec::new(BufferUsages::STORAGE);
        Self { triangles: Arc::clone(triangles), corners, skins, group: None }
    }
}

/// Records the pass.
pub fn record(
    skinning: Option<Res<Skinning>>,
    gpu: Option<Res<GirandoleGpu>>,
    cache: Res<PipelineCache>,
    mut context: RenderContext,
) {
    let (Some(skinning), Some(gpu)) = (skinning, gpu) else { return };
    let Some(pipeline) = cache.get_compute_pipeline(skinning.pipeline) else { return };
    let Some(sources) = gpu.source_group().filter(|_| !skinning.meshes.is_empty()) else { return };
    let descriptor = ComputePassDescriptor { label: Some("girandole skins"), timestamp_writes: None };
    let mut pass = context.command_encoder().begin_compute_pass(&descriptor);
    pass.set_pipeline(pipeline);
    pass.set_bind_group(1, &**sources, &[]);
    for mesh in skinning.meshes.values() {
        let Some(group) = &mesh.group else { continue };
        pass.set_bind_group(0, &**group, &[]);
        let groups = [mesh.triangles.len().div_ceil(LANES), mesh.skins.len()].map(|count| count.min(MAX_GROUPS) as u32);
        pass.dispatch_workgroups(groups[0], groups[1], 1);
    }
}
