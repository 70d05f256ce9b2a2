//! Neon signs that flicker: every third kind has a loose contact.

use girandole::{Light, LightWorld, TreeKey};

use super::blocks::Sign;
use super::rng::Rng;
use super::{Scene, SceneError};

/// The signs that flicker.
pub struct FlickeringSigns {
    kinds: Vec<FlickeringSign>,
}

/// One kind of sign, of which all copies flicker alike.
struct FlickeringSign {
    tree: TreeKey,
    /// The lights at full power.
    lights: Vec<Light>,
    objects: Vec<usize>,
    /// Of the random numbers.
    stream: u64,
    /// Present share of full power.
    level: f32,
}

impl FlickeringSigns {
    /// Selects the signs that flicker.
    pub fn new(signs: Vec<Sign>) -> Self {
        let mut kinds = Vec::new();
        for (index, sign) in
            signs.into_iter().enumerate().filter(|(index, sign)| index % 3 == 1 && !sign.objects.is_empty())
        {
            let Some(tree) = sign.design.tree else { continue };
            let (lights, objects) = (sign.lights, sign.objects);
            kinds.push(FlickeringSign { tree, lights, objects, stream: index as u64, level: 1.0 });
        }
        Self { kinds }
    }

    /// Sets the signs to their power at a time, in seconds.
    pub fn flicker(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        for sign in &mut self.kinds {
            // Twelve states per second. In 30 % of the intervals of 1.7 s, 45 % of the states are
            // dark.
            let is_unsteady = Rng::new((time / 1.7) as u64, sign.stream).chance(0.3);
            let roll = Rng::new((time * 12.0) as u64, 0xf11c + sign.stream).unit();
            let level = if !is_unsteady || roll > 0.55 { 1.0 } else { 0.06 };
            if level == sign.level {
                continue;
            }
            sign.level = level;
            let dim = |(index, light): (usize, &Light)| (index as u32, light.with_emission(light.emission * level));
            let changes: Vec<(u32, Light)> = sign.lights.iter().enumerate().map(dim).collect();
            world.set_lights(sign.tree, &changes)?;
            sign.objects.iter().for_each(|&object| scene.objects[object].emission_scale = level);
        }
        Ok(())
    }
}
