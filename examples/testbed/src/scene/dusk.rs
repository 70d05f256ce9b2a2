//! The time after sunset: a sky that is sampled as a light, and street lamps with a photometric profile.

use girandole::glam::{Mat3, Vec3, vec3};
use girandole::{Profile, Sky};
use girandole_assets::profile;
use std::path::PathBuf;

use super::{SceneError, Stage};
use crate::render::shading::sky_radiance;

/// Columns of the map of the sky.
const WIDTH: usize = 256;

/// What is chosen of the dusk.
#[derive(Clone, Debug, Default)]
pub struct Dusk {
    /// An IES or EULUMDAT (.ldt) file that street lamps shine as; `None` for a profile of the program's own.
    pub ies: Option<PathBuf>,
}

impl Dusk {
    /// The profile of street lamps.
    pub fn profile(&self) -> Result<Profile, SceneError> {
        let Some(path) = &self.ies else { return street_lamp() };
        let error = |what: String| SceneError(format!("{}: {what}", path.display()));
        let file = std::fs::read(path).map_err(|read| error(read.to_string()))?;
        let is_eulumdat = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("ldt"));
        let profile = if is_eulumdat { profile::eulumdat(&file) } else { profile::ies(&file) };
        profile.map_err(|refused| error(refused.to_string()))
    }
}

/// A profile like those of street lamps: most light leaves along the road, 66 degrees from straight down, and little
/// toward the houses. Made up, not measured.
fn street_lamp() -> Result<Profile, SceneError> {
    let vertical: Vec<f32> = (0..=36).map(|i| 2.5 * i as f32).collect();
    let planes: Vec<f32> = (0..36).map(|i| 10.0 * i as f32).collect();
    let candela: Vec<f32> = planes
        .iter()
        .flat_map(|plane| {
            let (sin, cos) = plane.to_radians().sin_cos();
            vertical.iter().map(move |angle| {
                let peak = |at: f32, width: f32| (-((angle - at) / width).powi(2)).exp();
                let along = peak(66.0, 12.0) * cos.abs().powi(3);
                let across = 0.5 * peak(45.0, 18.0) * (-sin).max(0.0);
                let below = 0.35 * angle.to_radians().cos();
                // Less toward the houses, and none near the horizon.
                let behind = 1.0 - 0.8 * sin.max(0.0) * (angle / 40.0).min(1.0);
                let shield = ((88.0 - angle) / 10.0).clamp(0.0, 1.0);
                1000.0 * (along + across + below) * behind * shield
            })
        })
        .collect();
    // All around, and vertical angles from straight down.
    let candela = [&candela[..], &candela[..vertical.len()]].concat();
    let radians = |degrees: &f32| f64::from(*degrees).to_radians() as f32;
    let polar: Vec<f32> = vertical.iter().map(radians).collect();
    let around: Vec<f32> = planes.iter().chain(&[360.0]).map(radians).collect();
    let axes = Mat3::from_cols(Vec3::X, Vec3::Y, Vec3::NEG_Z);
    Profile::new(&polar, &around, &candela, axes).map_err(|refused| SceneError(refused.to_string()))
}

/// Turns the night of a stage into dusk. The sky takes the place of the moon and of the ambient light.
pub fn set(stage: &mut Stage) -> Result<(), SceneError> {
    let sky = &mut stage.scene.sky;
    sky.zenith = vec3(0.16, 0.36, 0.95);
    sky.horizon = vec3(0.85, 0.62, 0.72);
    sky.ambient = Vec3::ZERO;
    sky.glow = vec3(5.0, 2.0, 0.7);
    sky.sun = vec3(-0.35, -0.06, -1.0).normalize();
    stage.remove_directionals()?;
    let map = Sky::from_fn(WIDTH, |direction| sky_radiance(&stage.scene.sky, direction))
        .map_err(|refused| SceneError(refused.to_string()))?;
    stage.world.set_sky(map);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_lamps_are_read_by_their_extension_and_refused_with_one_line() {
        let folder = std::env::temp_dir().join(format!("girandole_dusk_{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let read = |name: &str, text: &str| {
            let path = folder.join(name);
            std::fs::write(&path, text).expect("a file");
            Dusk { ies: Some(path) }.profile().map_err(|error| error.to_string())
        };
        let ies = "TILT=NONE\n1 -1 2 2 1 1 2 0 0 0 1 1 0\n0 90\n0\n100 50\n";
        assert!(read("lamp.ies", ies).is_ok_and(|profile| profile.greatest_candela() == 200.0));
        let refused = read("lamp.LDT", ies).expect_err("this is no EULUMDAT file");
        assert!(refused.ends_with("line 3: the symmetry is \"0 90\", not a finite number"), "{refused}");
        let missing = Dusk { ies: Some(folder.join("none.ies")) }.profile().expect_err("there is no file");
        assert!(!missing.to_string().contains('\n'), "{missing}");
        std::fs::remove_dir_all(&folder).expect("the folder of this test");
    }

    #[test]
    fn the_lamp_of_the_program_shines_along_the_road() {
        let lamp = Dusk::default().profile().expect("a profile");
        let along = lamp.candela(vec3(0.9, 0.0, -0.4));
        let [road, houses] = [-1.0, 1.0].map(|y| lamp.candela(vec3(0.0, 0.7 * y, -0.7)));
        assert!(along > road && road > 2.0 * houses && houses > 0.0, "{along} {road} {houses}");
        assert_eq!(lamp.candela(Vec3::X), 0.0);
    }
}
