//! The pictures of one frame, and their errors against the reference of the frame.

use super::stages::Film;
use girandole::glam::Vec3;
use girandole::light::luminance;
use std::f64::consts::FRAC_2_PI;
use std::path::Path;
use testbed::direct_light::draw::{Draw, Resampled};
use testbed::direct_light::numbers::numbers;
use testbed::direct_light::reference::{Key, Reference};
use testbed::direct_light::renderer::Renderer;
use testbed::direct_light::view::View;
use testbed::measuring::score::{FLOOR, Score, mean};
use testbed::render::geometry::Geometry;
use testbed::scene::SceneError;

/// Light candidates of each sample of a reference.
const CANDIDATES: u32 = 8;
/// Samples per pixel of each pass of a reference.
pub const PASS_SAMPLES: u32 = 16;
/// The seed of the first pass of a reference, beyond those of all pictures.
const REFERENCE_SEED: u32 = 1 << 30;
/// Seeds of a frame.
const SEEDS_PER_FRAME: u32 = 1 << 10;

/// How frames are rendered.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Width and height, pixels.
    pub size: (u32, u32),
    /// Light samples per pixel.
    pub samples: u32,
    /// Independent pictures of each frame and strategy.
    pub seeds: u32,
    /// Passes of a reference.
    pub passes: u32,
}

/// A frame that is rendered.
pub struct Shot<'a> {
    renderer: Renderer<'a>,
    reference: Vec<Vec3>,
    /// The MAPE of the reference itself, estimated from its passes.
    pub reference_error: f64,
    settings: Settings,
    frame: u32,
}

/// The surfaces that the camera sees in the present frame of a film.
pub fn view(film: &Film, geometry: &Geometry, settings: &Settings) -> View {
    View::new(&film.stage.scene, geometry, settings.size)
}

impl<'a> Shot<'a> {
    /// Renders the reference of a frame, or reads what there is of it from `file`. An interrupted
    /// run continues after the last finished pass.
    pub fn new(
        film: &'a Film,
        (geometry, view): (&'a Geometry, &'a View),
        (settings, frame): (&Settings, u32),
        file: &Path,
    ) -> Result<Self, SceneError> {
        let renderer = Renderer { scene: &film.stage.scene, geometry, view, numbers };
        let mut reference = Reference::open(file, key(film, settings), view.pixels.len());
        let mut draw = Resampled { lights: film.stage.world.sampler(), candidates: CANDIDATES };
        while reference.passes() < u64::from(settings.passes) {
            let seed = REFERENCE_SEED + frame * SEEDS_PER_FRAME + reference.passes() as u32;
            let pass = renderer.picture(&mut draw, f64::from(PASS_SAMPLES), seed);
            reference.add(&pass).map_err(SceneError)?;
        }
        let picture = reference.picture();
        if mean(&picture) <= 0.0 {
            return Err(SceneError("the picture is black; choose another --camera".into()));
        }
        let reference_error = own_error(&picture, &reference.variance());
        Ok(Self { renderer, reference: picture, reference_error, settings: *settings, frame })
    }

    /// The MAPE of one picture for each seed. All strategies get the same random numbers.
    pub fn errors(&self, draw: &mut dyn Draw) -> Vec<f64> {
        let error = |seed: u32| {
            let seed = self.frame * SEEDS_PER_FRAME + seed;
            let picture = self.renderer.picture(draw, f64::from(self.settings.samples), seed);
            Score::new(&picture, &self.reference).mape
        };
        (0..self.settings.seeds).map(error).collect()
    }
}

/// The expected MAPE of a picture with these squared standard errors whose expectation is the
/// picture itself. The mean magnitude of a normal error is √(2/π) times its standard deviation.
fn own_error(picture: &[Vec3], variance: &[f64]) -> f64 {
    let floor = FLOOR * mean(picture);
    let one = |(pixel, variance): (&Vec3, &f64)| (variance * FRAC_2_PI).sqrt() / (floor + f64::from(luminance(*pixel)));
    picture.iter().zip(variance).map(one).sum::<f64>() / picture.len() as f64
}

/// Identifies what a frame shows: its camera, lights and objects.
fn key(film: &Film, settings: &Settings) -> Key {
    let scene = &film.stage.scene;
    let camera = &scene.camera;
    let mut numbers: Vec<f32> = vec![settings.size.0 as f32, settings.size.1 as f32, camera.vertical_fov];
    numbers.extend(camera.eye.to_array().into_iter().chain(camera.target.to_array()));
    for light in &film.lights {
        numbers.extend(light.aabb().center().to_array().into_iter().chain(light.emission.to_array()));
    }
    for object in &scene.objects {
        numbers.extend(object.transform.to_cols_array());
        numbers.push(object.mesh as f32);
    }
    let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
    Key::new().add(&bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_of_a_reference_has_the_value_computed_by_hand() {
        let picture = [Vec3::ONE, Vec3::splat(3.0)];
        // The mean is 2, so the floor is 0.02. The standard errors are 0.1 and 0.
        let expected = 0.1 * (2.0 / std::f64::consts::PI).sqrt() / 1.02 / 2.0;
        assert!((own_error(&picture, &[0.01, 0.0]) - expected).abs() < 1.0e-7);
    }
}
