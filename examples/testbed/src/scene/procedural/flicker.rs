//! Neon signs that flicker: every third kind has a loose contact.

use girandole::{Light, LightWorld};

use super::blocks::Sign;
use super::rng::Rng;
use super::{Scene, SceneError};

/// The kinds of signs that flicker: the stream of random numbers of each, and its present share of full power.
pub struct FlickeringSigns(Vec<(u64, f32, Sign)>);

impl FlickeringSigns {
    /// Selects the signs that flicker.
    pub fn new(signs: Vec<Sign>) -> Self {
        let numbered = (0..).zip(signs).filter(|(number, sign)| number % 3 == 1 && !sign.objects.is_empty());
        Self(numbered.map(|(number, sign)| (number, 1.0, sign)).collect())
    }

    /// Sets the signs to their power at a time, in seconds. All copies of a kind flicker alike.
    pub fn flicker(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        for (stream, shown, sign) in &mut self.0 {
            // Twelve states per second. In 30 % of the intervals of 1.7 s, 45 % of the states are
            // dark.
            let is_unsteady = Rng::new((time / 1.7) as u64, *stream).chance(0.3);
            let roll = Rng::new((time * 12.0) as u64, 0xf11c + *stream).unit();
            let level = if !is_unsteady || roll > 0.55 { 1.0 } else { 0.06 };
            let Some(tree) = sign.design.tree.filter(|_| level != *shown) else { continue };
            *shown = level;
            let dim = |light: &Light| light.with_emission(light.emission * level);
            let changes: Vec<(u32, Light)> = (0..).zip(sign.lights.iter().map(dim)).collect();
            world.set_lights(tree, &changes)?;
            sign.objects.iter().for_each(|&object| scene.objects[object].emission_scale = level);
        }
        Ok(())
    }
}
