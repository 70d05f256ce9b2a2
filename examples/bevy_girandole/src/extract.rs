//! Moves data from the main world to the render world, while both wait.

use bevy::pbr::{ExtractedDirectionalLight, ExtractedPointLight};
use bevy::prelude::*;
use bevy::render::MainWorld;
use bevy::render::sync_world::{MainEntity, RenderEntity};

use crate::components::GirandoleCamera;
use crate::gathered::Changes;
use crate::history::History;
use crate::pass::PassPipeline;
use crate::settings::GirandoleSettings;
use crate::world::GirandoleLights;

/// Takes the edits and the settings. This moves two lists; the render world applies the edits in
/// `gpu::prepare`, while the main world continues.
pub fn edits(
    mut commands: Commands,
    mut main_world: ResMut<MainWorld>,
    mut lights: ResMut<GirandoleLights>,
    mut settings: ResMut<GirandoleSettings>,
) {
    settings.clone_from(main_world.resource::<GirandoleSettings>());
    let mut changes = main_world.resource_mut::<Changes>();
    let changes = changes.bypass_change_detection();
    // Those of a frame that was not rendered are still there.
    lights.apply();
    lights.edits = changes.take();
    let taken = std::mem::take(&mut changes.taken);
    for entity in taken {
        // What Bevy has extracted of the light before it was marked.
        if let Some(render_entity) = main_world.get::<RenderEntity>(entity)
            && let Ok(mut render_entity) = commands.get_entity(render_entity.id())
        {
            render_entity.remove::<(ExtractedPointLight, ExtractedDirectionalLight)>();
        }
    }
}

/// Copies the component of cameras.
pub fn cameras(
    mut commands: Commands,
    mut main_world: ResMut<MainWorld>,
    present: Query<(Entity, &MainEntity), With<GirandoleCamera>>,
) {
    for (entity, main_entity) in &present {
        if main_world.get::<GirandoleCamera>(main_entity.id()).is_none() {
            commands.entity(entity).remove::<(GirandoleCamera, PassPipeline, History)>();
        }
    }
    let mut cameras = main_world.query::<(&RenderEntity, &GirandoleCamera)>();
    for (entity, &camera) in cameras.iter(&main_world) {
        commands.entity(entity.id()).insert(camera);
    }
}
