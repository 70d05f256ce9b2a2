//! The pass that poses the triangles of emissive meshes on the GPU.

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
use crate::rigs::PosedMesh;
use crate::world::GirandoleLights;

/// The most workgroups of a dispatch in one dimension.
const MAX_GROUPS: usize = 65_535;
/// The invocations of a workgroup.
const LANES: usize = 64;

/// The text of the pass.
#[derive(Resource)]
pub struct PoseShader(pub Handle<Shader>);

/// The pass, and what it binds.
#[derive(Resource)]
pub struct Posing {
    layout: BindGroupLayoutDescriptor,
    pipeline: CachedComputePipelineId,
    joints: RawBufferVec<Mat4>,
    /// The weights of morph targets.
    weights: RawBufferVec<f32>,
    /// By their address.
    meshes: HashMap<usize, PosedEntities>,
}

/// A mesh, and the entities that have it.
struct PosedEntities {
    /// Keeps the address in use.
    mesh: Arc<PosedMesh>,
    corners: Buffer,
    offsets: Buffer,
    /// The number of the source, the first joint, the number of joints and the first weight of each entity.
    poses: RawBufferVec<[u32; 4]>,
    group: Option<BindGroup>,
}

/// Creates the pass on a device.
pub fn start(
    mut commands: Commands,
    cache: Res<PipelineCache>,
    shader: Res<PoseShader>,
    mut lights: ResMut<GirandoleLights>,
) {
    let layout = layout("girandole poses", &[READ; 5]);
    let pipeline = cache.queue_compute_pipeline(ComputePipelineDescriptor {
        label: Some("girandole poses".into()),
        layout: vec![layout.clone(), sources_layout()],
        shader: shader.0.clone(),
        entry_point: Some("girandole_pose".into()),
        ..default()
    });
    let mut joints = RawBufferVec::new(BufferUsages::STORAGE);
    joints.set_label(Some("girandole joints"));
    let mut weights = RawBufferVec::new(BufferUsages::STORAGE);
    weights.set_label(Some("girandole weights of morph targets"));
    lights.has_new_poses = true;
    commands.insert_resource(Posing { layout, pipeline, joints, weights, meshes: HashMap::new() });
}

/// Uploads the poses of this frame, if any has changed, and the triangles of new meshes.
pub fn prepare(
    mut lights: ResMut<GirandoleLights>,
    posing: Option<ResMut<Posing>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    cache: Res<PipelineCache>,
) {
    let Some(mut posing) = posing.filter(|_| lights.has_new_poses) else { return };
    let Posing { layout, joints, weights, meshes, .. } = &mut *posing;
    lights.has_new_poses = false;
    joints.clear();
    weights.clear();
    meshes.values_mut().for_each(|of| of.poses.clear());
    // Without a pose, lights are where they were when they were added.
    for (kind, posed) in lights.posed.iter().filter(|(_, posed)| !posed.pose.joints.is_empty()) {
        let Some(source) = lights.source_number(*kind) else { continue };
        let (mesh, pose) = (&posed.mesh, &posed.pose);
        let of = meshes.entry(Arc::as_ptr(mesh).addr()).or_insert_with(|| PosedEntities::new(mesh, &device));
        of.poses.push([source, joints.len() as u32, pose.joints.len() as u32, weights.len() as u32]);
        joints.extend(pose.joints.iter().copied());
        weights.extend(pose.weights.iter().copied().chain(std::iter::repeat(0.0)).take(mesh.targets()));
    }
    meshes.retain(|_, of| !of.poses.is_empty());
    if meshes.is_empty() {
        return;
    }
    if weights.is_empty() {
        // A binding has at least one.
        weights.push(0.0);
    }
    joints.write_buffer(&device, &queue);
    weights.write_buffer(&device, &queue);
    let own = cache.get_bind_group_layout(layout);
    for of in meshes.values_mut() {
        of.poses.write_buffer(&device, &queue);
        let bindings = (of.poses.binding(), joints.binding(), weights.binding());
        let (Some(poses), Some(joints), Some(weights)) = bindings else { continue };
        let [corners, offsets] = [&of.corners, &of.offsets].map(|buffer| buffer.as_entire_binding());
        let entries = BindGroupEntries::sequential((corners, poses, joints, offsets, weights));
        of.group = Some(device.create_bind_group("girandole poses", &own, &entries));
    }
}

impl PosedEntities {
    fn new(mesh: &Arc<PosedMesh>, device: &RenderDevice) -> Self {
        let buffer = |label, contents| {
            let usage = BufferUsages::STORAGE;
            device.create_buffer_with_data(&BufferInitDescriptor { label: Some(label), contents, usage })
        };
        let corners = buffer("girandole corners", bytemuck::cast_slice(&mesh.corners));
        // A binding has at least one float, which is less than a target.
        let offsets = if mesh.offsets.is_empty() { &[0; 4] } else { bytemuck::cast_slice(&mesh.offsets) };
        let offsets = buffer("girandole morph targets", offsets);
        let poses = RawBufferVec::new(BufferUsages::STORAGE);
        Self { mesh: Arc::clone(mesh), corners, offsets, poses, group: None }
    }
}

/// Records the pass.
pub fn record(
    posing: Option<Res<Posing>>,
    gpu: Option<Res<GirandoleGpu>>,
    cache: Res<PipelineCache>,
    mut context: RenderContext,
) {
    let (Some(posing), Some(gpu)) = (posing, gpu) else { return };
    let Some(pipeline) = cache.get_compute_pipeline(posing.pipeline) else { return };
    let Some(sources) = gpu.source_group().filter(|_| !posing.meshes.is_empty()) else { return };
    let descriptor = ComputePassDescriptor { label: Some("girandole poses"), timestamp_writes: None };
    let mut pass = context.command_encoder().begin_compute_pass(&descriptor);
    pass.set_pipeline(pipeline);
    pass.set_bind_group(1, &**sources, &[]);
    for of in posing.meshes.values() {
        let Some(group) = &of.group else { continue };
        pass.set_bind_group(0, &**group, &[]);
        let triangles = of.mesh.corners.len() / 3;
        let groups = [triangles.div_ceil(LANES), of.poses.len()].map(|count| count.min(MAX_GROUPS) as u32);
        pass.dispatch_workgroups(groups[0], groups[1], 1);
    }
}
