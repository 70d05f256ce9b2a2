//! A swarm of 100,000 moving lamps over a field of metal and plastic columns, or 1,000 lamps in a hundred rooms.
//!
//! ```sh
//! cargo run --release --bin swarm                                   # in a window
//! cargo run --release --bin swarm -- --headless --frames 24 --settle 8 --out swarm.png
//! ```
//!
//! The first `--settle` frames move all lamps, each of which is a `PointLight`; the frames after them
//! stand still, so that the picture converges. `--rooms` draws the rooms. `--bevy-lights` leaves the lamps to Bevy. The program
//! ends with a report of what each frame took. In the window, the arrow keys turn and zoom, and the
//! space bar stops the lamps.

mod dump;
mod field;
mod headless;
mod lamps;
mod options;
mod report;
mod rooms;
mod window;

use bevy::camera::Exposure;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::pbr::DefaultOpaqueRendererMethod;
use bevy::post_process::bloom::Bloom;
use bevy::prelude::*;
use bevy_girandole::{Estimate, GirandoleCamera, GirandolePlugin};

use options::Options;

fn main() -> AppExit {
    let options = match Options::parse(std::env::args().skip(1)) {
        Ok(options) => options,
        Err(message) => {
            eprintln!("{message}");
            return AppExit::error();
        }
    };
    let mut app = App::new();
    if options.headless {
        headless::add_plugins(&mut app, &options);
    } else {
        window::add_plugins(&mut app, &options);
    }
    let defaults = GirandolePlugin::default();
    let learning = defaults.learning.filter(|_| !options.no_learning);
    app.add_plugins(GirandolePlugin { shadows: !options.no_shadows, learning, ..defaults });
    if let Err(message) = dump::add_systems(&mut app, &options) {
        eprintln!("{message}");
        return AppExit::error();
    }
    app.insert_resource(DefaultOpaqueRendererMethod::deferred())
        .insert_resource(ClearColor(Color::linear_rgb(0.0006, 0.0008, 0.002)))
        .insert_resource(GlobalAmbientLight { brightness: 0.3, ..default() })
        .insert_resource(options);
    field::add_systems(&mut app);
    lamps::add_systems(&mut app);
    report::add_systems(&mut app);
    app.run()
}

/// The camera, at an angle in radians around the field.
fn camera(options: &Options) -> impl Bundle {
    let samples = if options.bevy_lights { 0 } else { options.samples };
    let estimate = options.heat_map.map_or(Estimate::Sampled, Estimate::HeatMap);
    let (candidates, moving_frames) = (options.candidates, options.moving_frames);
    let reused_frames = options.reused_frames;
    let view = GirandoleCamera { candidates, samples, reused_frames, moving_frames, estimate, ..default() };
    // Colours of a heat map are shown as they are.
    let (tonemapping, bloom) = match options.heat_map {
        None => (Tonemapping::AcesFitted, Bloom::NATURAL),
        Some(_) => (Tonemapping::None, Bloom { intensity: 0.0, ..Bloom::NATURAL }),
    };
    (Camera3d::default(), view, Msaa::Off, tonemapping, bloom, EXPOSURE, place(options, 0.0, 1.0))
}

/// For lamps of some hundred lumens at night.
const EXPOSURE: Exposure = Exposure { ev100: 5.5 };

/// The camera's transform, by the angle around the field in radians and a factor of its default
/// distance.
fn place(options: &Options, angle: f32, zoom: f32) -> Transform {
    let (sin, cos) = angle.sin_cos();
    let (dist, height) = if options.rooms { (17.0, 21.0) } else { (70.0, 17.0) };
    Transform::from_xyz(dist * zoom * sin, height * zoom, dist * zoom * cos)
        .looking_at(Vec3::new(0.0, 1.0, 0.0), Vec3::Y)
}
