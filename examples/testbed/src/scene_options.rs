//! The part of the command line that selects a scene, which other programs share.

use super::scene::dump;
use super::scene::dusk::{self, Dusk};
use super::scene::festival;
use super::scene::gltf_scene;
use super::scene::lamps;
use super::scene::procedural::{self, CityOptions, Size};
use super::scene::screen;
use super::scene::{Camera, SceneError, Stage};
use clap::Args;
use girandole::glam::Vec3;
use std::ops::RangeInclusive;
use std::path::PathBuf;

/// Vertical field of view of `--camera`, radians: 60 degrees.
const FIELD_OF_VIEW: f32 = std::f32::consts::FRAC_PI_3;

/// A scene and a camera.
#[derive(Clone, Debug, Args)]
pub struct SceneOptions {
    /// Size of the procedural city
    #[arg(long, value_name = "SIZE", value_enum, ignore_case = true, default_value_t = Size::S, conflicts_with_all = ["gltf", "lamps"])]
    pub world: Size,
    /// Number of cars in the procedural city [default: depends on its size]
    #[arg(long, value_name = "N", conflicts_with_all = ["gltf", "lamps"])]
    pub cars: Option<usize>,
    /// Seed of the city and of the noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Use this glTF scene (.gltf or .glb) instead of the procedural city
    #[arg(long, value_name = "FILE", conflicts_with = "lamps")]
    pub gltf: Option<PathBuf>,
    /// Use the street lamps of a real city: a table in CSV with the columns x_m and y_m (metres east and north),
    /// est_height_m (metres) and est_lumens
    #[arg(long, value_name = "FILE.csv")]
    pub lamps: Option<PathBuf>,
    /// Camera: position and target in metres [default: depends on the scene]
    #[arg(long, value_name = "x,y,z,x,y,z", value_parser = parse_camera, allow_hyphen_values = true)]
    pub camera: Option<(Vec3, Vec3)>,
    /// Correction of the exposure in stops: 1 makes pictures twice as bright [from -20 to 20]
    #[arg(long, value_name = "EV", default_value_t = 0.0, value_parser = parse_exposure, allow_negative_numbers = true)]
    pub exposure: f32,
    /// A fire and a dancer in the procedural city, which a GPU moves. Cars stay away, unless they are asked for.
    #[arg(skip)]
    pub fire: bool,
    /// The time after sunset, in place of the night.
    #[arg(skip)]
    pub dusk: Option<Dusk>,
    /// A dump of a light world in place of a scene.
    #[arg(skip)]
    pub dump: Option<PathBuf>,
}

/// Where a screen hangs over the avenue at dusk, in sight of the camera.
const SCREEN: Vec3 = Vec3::new(0.0, 11.5, 84.0);

impl SceneOptions {
    /// Loads the scene for pictures of this width and height.
    pub fn load(&self, (width, height): (u32, u32)) -> Result<Stage, SceneError> {
        let Self { gltf, lamps, seed, world, fire, dusk, dump, .. } = self.clone();
        let lamp_profile = dusk.as_ref().map(Dusk::profile).transpose()?;
        let mut stage = if let Some(path) = dump {
            dump::stage(&path, width as f32 / height as f32)?
        } else if let Some(path) = gltf {
            gltf_scene::stage_in_frame(&path, self.camera(), width as f32 / height as f32)?
        } else if let Some(path) = lamps {
            lamps::stage(&path, lamp_profile)?
        } else {
            let cars = self.procedural_cars();
            let city = procedural::stage(&CityOptions { size: world, cars, seed, lamp_profile })?;
            let city = if dusk.is_some() { screen::hang(city, SCREEN)? } else { city };
            if fire { festival::celebrate(city)? } else { city }
        };
        if dusk.is_some() {
            dusk::set(&mut stage)?;
        }
        if let Some(path) =
            dusk.and_then(|dusk| dusk.ies).filter(|_| lamp_profile.is_some_and(|profile| profile.flux() == 0.0))
        {
            let warning = format!("{}: all its intensities are 0 candela, so street lamps are dark", path.display());
            stage.scene.warnings.push(warning);
        }
        if let Some(camera) = self.camera() {
            stage.scene.camera = camera;
        }
        stage.scene.exposure *= self.exposure.exp2();
        Ok(stage)
    }

    /// The number of cars, if it can be chosen: in the procedural city.
    pub fn procedural_cars(&self) -> Option<usize> {
        let usual = if self.fire { 0 } else { self.world.default_cars() };
        self.files().next().is_none().then(|| self.cars.unwrap_or(usual))
    }

    /// The name of the scene for titles.
    #[allow(dead_code, reason = "only measuring programs have titles")]
    pub fn name(&self) -> String {
        let stem = |path: &PathBuf| path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        let file = self.files().next();
        file.map_or_else(|| format!("city {:?}", self.world), stem)
    }

    /// The files of a scene that is not the procedural city.
    fn files(&self) -> impl Iterator<Item = &PathBuf> {
        [&self.dump, &self.gltf, &self.lamps].into_iter().flatten()
    }

    /// The camera of `--camera`.
    fn camera(&self) -> Option<Camera> {
        self.camera.map(|(eye, target)| Camera { eye, target, vertical_fov: FIELD_OF_VIEW, up: Vec3::Y })
    }
}

/// Parses the size of a picture, such as `640x360`; both sides must be in a range of pixels.
pub fn parse_size(text: &str, sides: RangeInclusive<u32>) -> Result<(u32, u32), String> {
    let size = text.split_once(['x', 'X']).and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    match size {
        Some((w, h)) if sides.contains(&w) && sides.contains(&h) => Ok((w, h)),
        Some(_) => Err(format!("each side must be from {} to {} pixels", sides.start(), sides.end())),
        None => Err("expected a width and a height, such as 640x360".into()),
    }
}

/// Parses a correction of the exposure, in stops.
fn parse_exposure(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(stops) if (-20.0..=20.0).contains(&stops) => Ok(stops),
        _ => Err("expected a number of stops, from -20 to 20".into()),
    }
}

/// Parses a position and a target: six numbers, in metres.
pub fn parse_camera(text: &str) -> Result<(Vec3, Vec3), String> {
    let numbers: Option<Vec<f32>> = text.split(',').map(|x| x.trim().parse().ok()).collect();
    let Some(&[ex, ey, ez, tx, ty, tz]) = numbers.as_deref() else {
        return Err("expected six numbers: x,y,z of the position and x,y,z of the target".into());
    };
    let (eye, target) = (Vec3::new(ex, ey, ez), Vec3::new(tx, ty, tz));
    if !eye.is_finite() || !target.is_finite() || eye.max(target).abs().max_element() > 1e7 {
        return Err("coordinates must be finite and at most 10000000 metres".into());
    }
    if (target - eye).length() < 1e-3 {
        return Err("the position and the target must differ".into());
    }
    Ok((eye, target))
}
