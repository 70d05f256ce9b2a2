//! The pictures of one frame, and their errors against the reference of the frame.

use super::stages::Film;
use girandole::glam::Vec3;
use girandole::light::luminance;
use std::f64::consts::FRAC_2_PI;
use testbed::direct_light::draw::{Draw, Resampled};
use testbed::direct_light::numbers::numbers;
use testbed::direct_light::reference::Reference;
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
    /// Renders the reference of a frame.
    pub fn new(
        film: &'a Film,
        (geometry, view): (&'a Geometry, &'a View),
        (settings, frame): (&Settings, u32),
    ) -> Result<Self, SceneError> {
        let renderer = Renderer { scene: &film.stage.scene, geometry, view, numbers };
        let mut draw = Resampled { lights: film.stage.world.sampler(), candidates: CANDIDATES, has_gloss: false };
        let first = REFERENCE_SEED + frame * SEEDS_PER_FRAME;
        let pass = |seed| renderer.picture(&mut draw, f64::from(PASS_SAMPLES), seed);
        let reference = Reference::new(view.pixels.len(), (first..first + settings.passes).map(pass));
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
