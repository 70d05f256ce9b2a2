//! Samplers that the light trees are compared with. Only the CPU renders with them.
//!
//! The samplers of `examples/testbed/src/measuring/` choose among the lights of instances. This file adds the
//! lights at infinity, such as the moon, each in the way of the sampler's source.

use super::settings::LightChoice;
use crate::measuring::lights::carried;
use crate::measuring::samplers::{self, Chooser, narrow, wide};
use girandole::light::luminance;
use girandole::{DirectionalLight, LightId, LightPick, LightWorld, ShadingPoint};
use std::f64::consts::PI;
use std::sync::Arc;

/// A sampler over the lights of one frame. It must be built again when lights have changed.
pub struct Baseline {
    choice: LightChoice,
    /// Chooses among the lights of instances.
    local: Box<dyn Chooser>,
    /// The probability that a light at infinity is chosen.
    distant_share: f64,
    /// The lights at infinity.
    distant: Vec<Distant>,
}

/// A light at infinity.
struct Distant {
    light: LightId,
    /// The probability of the lights at infinity up to this one, relative to that of all of them.
    end: f64,
    pmf: f32,
}

impl Baseline {
    /// Builds the sampler; `None` for the choices that are not baselines: those by the light trees
    /// and by no sampler at all. `scene_radius` is that of a sphere around the scene, in metres.
    ///
    /// The lights at infinity are treated as follows.
    ///
    /// - `Uniform`: like any other light.
    /// - `Flux`: their flux is their illuminance times the area of a circle around the scene, as in
    ///   pbrt-v4's `PowerLightSampler`.
    /// - `Pbrt` and `SgTree`: each is as probable as the whole tree, as in pbrt-v4's `BVHLightSampler`.
    pub fn new(choice: LightChoice, world: &LightWorld, scene_radius: f32) -> Option<Self> {
        if choice.is_on_gpu() || choice == LightChoice::Exhaustive {
            return None;
        }
        let is_local = |light: &LightId| matches!(light, LightId::Local { .. });
        let ids: Arc<[LightId]> = world.sampler().all_lights().filter(is_local).collect();
        // Uniform choices need no light but its name.
        let lights = if choice == LightChoice::Uniform { Vec::new() } else { carried(world) };
        let (count, local_count) = (world.directionals().len() as f64, ids.len() as f64);
        let area = PI * f64::from(scene_radius).powi(2);
        let flux = |light: &DirectionalLight| f64::from(luminance(light.illuminance)) * area;
        let (local, local_weight) = match choice {
            LightChoice::Uniform => (samplers::uniform(ids), local_count),
            LightChoice::Flux => {
                let sum = lights.iter().map(|light| f64::from(light.flux())).sum();
                (samplers::flux(&lights, ids), sum)
            }
            LightChoice::SgTree => (samplers::sg_tree(&lights, ids), local_count.min(1.0)),
            _ => (samplers::pbrt(&lights, ids), local_count.min(1.0)),
        };
        let weigh = |light| if choice == LightChoice::Flux { flux(light) } else { 1.0 };
        let directionals = || world.directionals().filter_map(|key| Some((key, world.directional(key)?)));
        let distant_weight =
            if choice == LightChoice::Flux { directionals().map(|(_, light)| flux(light)).sum() } else { count };
        let total = distant_weight + local_weight;
        let mut end = 0.0;
        let distant = directionals()
            .filter(|(_, light)| weigh(light) > 0.0)
            .map(|(key, light)| {
                end += weigh(light) / distant_weight;
                Distant { light: LightId::Directional(key), end, pmf: (weigh(light) / total) as f32 }
            })
            .collect();
        let distant_share = if total > 0.0 { distant_weight / total } else { 0.0 };
        Some(Self { choice, local, distant_share, distant })
    }

    /// The choice that it was built for.
    pub fn choice(&self) -> LightChoice {
        self.choice
    }

    /// Chooses a light; `None` where the sampler ends without one. `u` in [0, 1)^2, with 24 bits
    /// each.
    pub fn choose(&self, shading_point: &ShadingPoint, u: [f32; 2]) -> Option<LightPick> {
        let u = wide(u);
        if u < self.distant_share {
            let u = u / self.distant_share;
            // Rounding may leave the last end below 1.
            let place = self.distant.partition_point(|distant| distant.end <= u).min(self.distant.len() - 1);
            let Distant { light, pmf, .. } = self.distant[place];
            return Some(LightPick { light, pmf });
        }
        let local_share = 1.0 - self.distant_share;
        let pick = self.local.choose(shading_point, narrow((u - self.distant_share) / local_share))?;
        // Without any flux the probability is not a number.
        let pmf = pick.pmf * local_share as f32;
        (pmf > 0.0).then_some(LightPick { pmf, ..pick })
    }
}
