//! The light sampler of [`bevy::solari`], Bevy's ray-traced renderer, by Girandole.
//!
//! Solari picks a light uniformly, and then a triangle of its mesh uniformly. With [`GirandoleSolariPlugin`], each point
//! draws a triangle from Girandole's light trees. It needs a Solari that takes a sampler: the script `patch.sh` makes one
//! by a small patch. `docs/solari.md` describes how to use it, what it costs, and its limits.

mod names;

use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use bevy::render::render_resource::{
    BindGroup, BindGroupEntry, BindGroupLayoutDescriptor, BindGroupLayoutEntry, BufferBindingType,
    BufferInitDescriptor, BufferUsages, PipelineCache, ShaderStages,
};
use bevy::render::renderer::RenderDevice;
use bevy::render::sync_world::MainEntity;
use bevy::render::{Render, RenderApp, RenderSystems};
use bevy::shader::Shader;
use bevy::solari::prelude::RaytracingMesh3d;
use bevy::solari::scene::{LightNames, LightSampler, RaytracingSceneBindings, prepare_raytracing_scene_resources};
use bevy_girandole::{
    GirandoleGpu, GirandoleLight, GirandoleNames, GirandolePlugin, GirandoleSystems, buffer_entry, lights_layout,
};

use names::SolariName;

/// Draws lights for Solari. Add it after Bevy's own plugins.
///
/// Entities with a `RaytracingMesh3d`, a `Mesh3d` and an emissive material are lights, and so are directional lights.
#[derive(Clone, Copy, Debug, Default)]
pub struct GirandoleSolariPlugin;

/// Keeps the module alive, so that it can be imported.
#[derive(Resource)]
struct Module {
    _handle: Handle<Shader>,
}

impl Plugin for GirandoleSolariPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins(GirandolePlugin { ray_traced: true, ..default() }).add_systems(PreUpdate, mark);
        let text = include_str!("solari.wgsl");
        let shader = Shader::from_wesl(text, "embedded://girandole/solari.wesl");
        let handle = app.world_mut().resource_mut::<Assets<Shader>>().add(shader);
        app.insert_resource(Module { _handle: handle });
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        let names = BindGroupLayoutDescriptor::new(
            "girandole names",
            &[BindGroupLayoutEntry {
                visibility: ShaderStages::COMPUTE,
                ..buffer_entry(0, BufferBindingType::Storage { read_only: true })
            }],
        );
        render_app.insert_resource(LightSampler { layouts: [lights_layout(), names], bind_groups: None }).add_systems(
            Render,
            bind.in_set(RenderSystems::PrepareResources)
                .after(GirandoleSystems::Upload)
                .after(prepare_raytracing_scene_resources),
        );
    }
}

type Unmarked = (Or<(With<RaytracingMesh3d>, With<DirectionalLight>)>, Without<GirandoleLight>);

/// Hands all lights of Solari to Girandole.
fn mark(mut commands: Commands, lights: Query<Entity, Unmarked>) {
    for entity in &lights {
        commands.entity(entity).insert(GirandoleLight);
    }
}

/// The names of all lights, here and in Solari.
#[derive(SystemParam)]
struct Names<'w, 's> {
    ours: Res<'w, GirandoleNames>,
    theirs: Option<Res<'w, RaytracingSceneBindings>>,
    entities: Query<'w, 's, &'static MainEntity>,
    sent: Local<'s, Option<u64>>,
}

impl Names<'_, '_> {
    /// What to send, if names have changed since the last call.
    fn changed(&mut self) -> Option<Vec<u32>> {
        let theirs = self.theirs.as_ref()?;
        let changes = Some(self.ours.changes());
        if *self.sent == changes && !theirs.have_lights_changed() {
            return None;
        }
        *self.sent = changes;
        let name = |of: LightNames| {
            let entity = self.entities.get(of.entity).ok()?.id();
            Some(SolariName { entity, light: of.light, instance: of.instance })
        };
        let theirs: Vec<SolariName> = theirs.light_names().filter_map(name).collect();
        Some(names::words(self.ours.lights(), &theirs))
    }
}

/// Binds the lights, and their names if these have changed.
fn bind(
    mut names: Names,
    gpu: Option<Res<GirandoleGpu>>,
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    mut sampler: ResMut<LightSampler>,
    mut present: Local<Option<BindGroup>>,
) {
    if let Some(words) = names.changed() {
        let (contents, usage) = (bytemuck::cast_slice(&words), BufferUsages::STORAGE);
        let descriptor = BufferInitDescriptor { label: Some("girandole names"), contents, usage };
        let buffer = device.create_buffer_with_data(&descriptor);
        let layout = cache.get_bind_group_layout(&sampler.layouts[1]);
        let entry = BindGroupEntry { binding: 0, resource: buffer.as_entire_binding() };
        *present = Some(device.create_bind_group("girandole names", &layout, &[entry]));
    }
    let lights = gpu.as_ref().and_then(|gpu| gpu.bind_group());
    sampler.bind_groups = lights.zip(present.as_ref()).map(|(lights, names)| [lights.clone(), names.clone()]);
}

/// The program in the documents compiles.
#[cfg(doctest)]
#[doc = include_str!("../../../../docs/solari.md")]
struct Page;
