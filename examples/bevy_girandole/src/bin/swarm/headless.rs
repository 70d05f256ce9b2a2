//! Renders frames without a window, and writes the last one or all of them to files.

use std::time::Duration;

use bevy::app::ScheduleRunnerPlugin;
use bevy::camera::RenderTarget;
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::render_resource::{TextureFormat, WgpuFeatures};
use bevy::render::settings::WgpuSettings;
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured, save_to_disk};
use bevy::window::{ExitCondition, WindowPlugin};
use bevy::winit::WinitPlugin;

use crate::options::Options;

pub fn add_plugins(app: &mut App, options: &Options) {
    let window = WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() };
    let disabled_features = options.no_ray_queries.then_some(WgpuFeatures::EXPERIMENTAL_RAY_QUERY);
    let render = RenderPlugin {
        synchronous_pipeline_compilation: true,
        render_creation: WgpuSettings { disabled_features, ..default() }.into(),
        ..default()
    };
    app.add_plugins(DefaultPlugins.set(window).set(render).disable::<WinitPlugin>())
        .add_plugins(ScheduleRunnerPlugin::run_loop(Duration::ZERO))
        .add_systems(Startup, spawn_camera)
        .add_systems(Last, finish);
}

#[derive(Resource)]
struct Target(Handle<Image>);

fn spawn_camera(mut commands: Commands, options: Res<Options>, mut images: ResMut<Assets<Image>>) {
    let [width, height] = options.size;
    let target = images.add(Image::new_target_texture(width, height, TextureFormat::Rgba8UnormSrgb, None));
    commands.spawn((crate::camera(&options), RenderTarget::Image(target.clone().into())));
    commands.insert_resource(Target(target));
}

fn finish(
    mut commands: Commands,
    mut frame: Local<u32>,
    options: Res<Options>,
    target: Res<Target>,
    mut exit: MessageWriter<AppExit>,
) {
    *frame += 1;
    if *frame != options.frames.max(1) {
        // Bevy takes one picture of a camera in a frame.
        if let Some(folder) = options.film.as_ref().filter(|_| *frame < options.frames) {
            let file = format!("{folder}/frame_{:04}.png", *frame);
            commands.spawn(Screenshot::image(target.0.clone())).observe(save_to_disk(file));
        }
        return;
    }
    let Some(out) = &options.out else {
        exit.write(AppExit::Success);
        return;
    };
    commands.spawn(Screenshot::image(target.0.clone())).observe(save_to_disk(out.clone())).observe(
        |_: On<ScreenshotCaptured>, mut exit: MessageWriter<AppExit>| {
            exit.write(AppExit::Success);
        },
    );
}
