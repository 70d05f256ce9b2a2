//! The scenes, frame by frame: what is drawn, and the lights one by one.

use super::vehicles::with_vehicles;
use girandole::glam::Vec3;
use girandole::{FrameBudget, Light};
use std::path::PathBuf;
use testbed::direct_light::stage::prepare;
use testbed::measuring::lights::carried;
use testbed::scene::gltf_scene;
use testbed::scene::procedural::{self, CityOptions, Size};
use testbed::scene::{Camera, SceneError, Stage};

/// Vertical field of view in glTF scenes, radians: 60 degrees.
const FIELD_OF_VIEW: f32 = std::f32::consts::FRAC_PI_3;
/// The seed of the city.
const CITY_SEED: u64 = 1;

/// A scene to play.
#[derive(Clone, Debug)]
pub enum Source {
    /// The procedural city.
    City(Size),
    /// A glTF file, in which strings of lights and lanterns sway if it has no animations, with
    /// vehicles.
    Gltf {
        file: PathBuf,
        /// Position and target, metres.
        camera: (Vec3, Vec3),
        /// The ends of the line of vehicles on the ground, metres.
        path: (Vec3, Vec3),
        vehicles: usize,
    },
}

impl Source {
    /// The name in titles and file names.
    pub fn name(&self) -> String {
        match self {
            Self::City(size) => format!("city_{size:?}"),
            Self::Gltf { file, .. } => file.file_stem().unwrap_or(file.as_os_str()).to_string_lossy().into_owned(),
        }
    }

    /// Loads the scene as it is at a time in seconds, without lights at infinity, which belong to
    /// no tree.
    pub fn load(&self, start: f64) -> Result<Stage, SceneError> {
        let stage = match self {
            Self::City(size) => {
                procedural::stage(&CityOptions { size: *size, cars: None, seed: CITY_SEED, lamp_profile: None })?
            }
            Self::Gltf { file, camera: (eye, target), path, vehicles } => {
                let camera = Camera { eye: *eye, target: *target, vertical_fov: FIELD_OF_VIEW, up: Vec3::Y };
                with_vehicles(gltf_scene::stage(file, Some(camera))?, *path, *vehicles)?
            }
        };
        prepare(stage, start)
    }
}

/// A stage that is played frame by frame.
pub struct Film {
    pub stage: Stage,
    /// All lights in world space, in the order of [`girandole::LightSampler::all_lights`].
    pub lights: Vec<Light>,
    /// The lights that differ from those of the last frame, by index.
    pub changes: Vec<(u32, Light)>,
    timing: Timing,
}

/// When frames are shown.
#[derive(Clone, Copy, Debug)]
pub struct Timing {
    /// Time of frame 0, seconds.
    pub start: f64,
    /// Frames per second.
    pub fps: f64,
}

impl Film {
    /// Loads a scene and shows frame 0.
    pub fn new(source: &Source, timing: Timing) -> Result<Self, SceneError> {
        let stage = source.load(timing.start)?;
        let lights = carried(&stage.world);
        if lights.is_empty() {
            return Err(SceneError(format!("{}: the scene has no lights", source.name())));
        }
        Ok(Self { stage, lights, changes: Vec::new(), timing })
    }

    /// The seconds of a frame.
    pub fn frame_time(&self) -> f64 {
        1.0 / self.timing.fps
    }

    /// Shows a later frame.
    pub fn advance(&mut self, frame: u32) -> Result<(), SceneError> {
        let Stage { scene, world, animation } = &mut self.stage;
        animation.advance(self.timing.start + f64::from(frame) / self.timing.fps, scene, world)?;
        world.update(FrameBudget::UNLIMITED);
        let now = carried(world);
        let differs = |(_, (now, before)): &(u32, (&Light, &Light))| now != before;
        let pairs = (0..).zip(now.iter().zip(&self.lights));
        self.changes = pairs.filter(differs).map(|(index, (now, _))| (index, *now)).collect();
        self.lights = now;
        Ok(())
    }
}
