//! The window, its keys and its title.

use bevy::prelude::*;
use bevy::window::{PrimaryWindow, WindowPlugin, WindowResolution};
use bevy_girandole::GirandoleStats;

use crate::lamps::Clock;
use crate::options::Options;

pub fn add_plugins(app: &mut App, options: &Options) {
    let [width, height] = options.size;
    let window = Window { resolution: WindowResolution::new(width, height), ..default() };
    app.add_plugins(DefaultPlugins.set(WindowPlugin { primary_window: Some(window), ..default() }))
        .add_systems(Startup, |mut commands: Commands, options: Res<Options>| {
            commands.spawn(crate::camera(&options));
        })
        .add_systems(Update, (steer, name));
}

fn steer(
    keys: Res<ButtonInput<KeyCode>>,
    time: Res<Time>,
    options: Res<Options>,
    mut clock: ResMut<Clock>,
    mut place: Local<Option<[f32; 2]>>,
    mut camera: Single<&mut Transform, With<Camera3d>>,
) {
    if keys.just_pressed(KeyCode::Space) {
        clock.is_stopped = !clock.is_stopped;
    }
    let axis = |less, more| f32::from(keys.pressed(more)) - f32::from(keys.pressed(less));
    let turn = axis(KeyCode::ArrowLeft, KeyCode::ArrowRight);
    let away = axis(KeyCode::ArrowUp, KeyCode::ArrowDown);
    if turn == 0.0 && away == 0.0 {
        return;
    }
    let [angle, zoom] = place.get_or_insert([0.0, 1.0]);
    *angle += 0.5 * turn * time.delta_secs();
    *zoom = (*zoom * (1.0 + away * time.delta_secs())).clamp(0.1, 3.0);
    **camera = crate::place(&options, *angle, *zoom);
}

fn name(stats: Res<GirandoleStats>, time: Res<Time>, mut window: Single<&mut Window, With<PrimaryWindow>>) {
    let report = stats.report();
    window.title = format!(
        "Girandole: {} lights, {} moves, {} bytes, frame of {:.1} ms",
        report.lights,
        report.moved,
        report.bytes,
        1000.0 * time.delta_secs(),
    );
}
