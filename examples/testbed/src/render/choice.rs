//! How each sample of the CPU renderer chooses lights.

use super::baseline::Baseline;
use super::settings::LightChoice;
use girandole::LightWorld;

/// A way to choose lights, ready for the present lights.
#[derive(Clone, Copy)]
pub enum Choice<'a> {
    /// One light, from the light trees.
    Trees,
    /// One light, from another sampler.
    Baseline(&'a Baseline),
    /// All lights.
    All,
}

/// The samplers to compare with that were built over the present lights.
#[derive(Default)]
pub struct Baselines {
    built: Vec<Baseline>,
}

impl Baselines {
    /// Drops all samplers, because lights have changed.
    pub fn clear(&mut self) {
        self.built.clear();
    }

    /// A way to choose lights. Builds its sampler if it is not the light trees and does not exist
    /// yet. `scene_radius` is that of a sphere around the scene, in metres.
    pub fn get(&mut self, choice: LightChoice, world: &LightWorld, scene_radius: f32) -> Choice<'_> {
        let place = match self.built.iter().position(|baseline| baseline.choice() == choice) {
            Some(place) => Some(place),
            None => Baseline::new(choice, world, scene_radius).map(|baseline| {
                self.built.push(baseline);
                self.built.len() - 1
            }),
        };
        match place {
            Some(place) => Choice::Baseline(&self.built[place]),
            None if choice == LightChoice::Exhaustive => Choice::All,
            None => Choice::Trees,
        }
    }
}
