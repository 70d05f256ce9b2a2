//! Worlds that leave out one effect of their lights, so that what the effect costs and what it
//! contributes can be measured.
//!
//! A light without the effect has the flux of the light with it.

use girandole::glam::Vec3;
use girandole::{Effects, FrameBudget, Light, LightTree, LightWorld, Policy, Shape};
use std::collections::HashMap;
use std::f32::consts::FRAC_PI_2;
use testbed::scene::SceneError;

/// The effects of lights that can be left out, and their names in tables.
pub const LIGHT_EFFECTS: [(Effects, &str); 3] =
    [(Effects::CONES, "cones"), (Effects::RANGES, "ranges"), (Effects::AREAS, "areas")];

/// A copy of a world whose lights lack an effect.
pub fn without(world: &LightWorld, effect: Effects) -> Result<LightWorld, SceneError> {
    let mut copy = LightWorld::new();
    let mut trees = HashMap::new();
    for key in world.trees() {
        let lights = world.tree(key).map(|tree| tree.lights()).unwrap_or_default();
        trees.insert(key, copy.add_tree(LightTree::new(lights.iter().map(|light| simplify(light, effect)).collect())?));
    }
    for instance in world.instances() {
        if let (Some(tree), Some(placement)) =
            (world.instance(instance).map(|i| i.tree), world.instance(instance).map(|i| i.placement))
        {
            copy.add_instance(trees[&tree], placement, Policy::Static)?;
        }
    }
    copy.update(FrameBudget::UNLIMITED);
    Ok(copy)
}

/// A light of the same flux without an effect.
fn simplify(light: &Light, effect: Effects) -> Light {
    if !light.effects().contains(effect) {
        return *light;
    }
    if effect == Effects::RANGES {
        return light.with_range(f32::INFINITY);
    }
    let shape = match (effect, light.shape) {
        (Effects::CONES, Shape::Spot { position, .. })
        | (Effects::CONES | Effects::PROFILES, Shape::Profile { position, .. }) => Shape::Point { position },
        (Effects::CONES, Shape::Rectangle { center, half_u, half_v, .. }) => {
            Shape::Rectangle { center, half_u, half_v, two_sided: true }
        }
        (Effects::CONES, Shape::Triangle { vertices, .. }) => Shape::Triangle { vertices, two_sided: true },
        (_, shape) => without_extent(shape),
    };
    let simple = light.with_shape(shape);
    let factor = if simple.flux() > 0.0 { light.flux() / simple.flux() } else { 0.0 };
    simple.with_emission(light.emission * factor)
}

/// A light at the middle of a shape. One-sided surfaces become spots of a half space.
fn without_extent(shape: Shape) -> Shape {
    let half_space = |position: Vec3, normal: Vec3| match normal.try_normalize() {
        Some(direction) => Shape::Spot { position, direction, inner_angle: 0.0, outer_angle: FRAC_PI_2 },
        None => Shape::Point { position },
    };
    match shape {
        Shape::Rectangle { center, half_u, half_v, two_sided: false } => half_space(center, half_u.cross(half_v)),
        Shape::Triangle { vertices: [a, b, c], two_sided: false } => {
            half_space((a + b + c) / 3.0, (b - a).cross(c - a))
        }
        Shape::Rectangle { center, .. } | Shape::Sphere { center, .. } => Shape::Point { position: center },
        Shape::Triangle { vertices: [a, b, c], .. } => Shape::Point { position: (a + b + c) / 3.0 },
        punctual => punctual,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_light_without_an_effect_keeps_its_flux() {
        let radiance = Vec3::new(3.0, 2.0, 1.0);
        let [u, v] = [Vec3::X * 0.5, Vec3::Y * 0.25];
        for light in [
            Light::spot(Vec3::ZERO, Vec3::Z, 0.2, 0.6, radiance).with_range(5.0),
            Light::rectangle(Vec3::ONE, u, v, radiance),
            Light::triangle([Vec3::ZERO, u, v], radiance).two_sided(),
            Light::sphere(Vec3::ONE, 0.3, radiance).with_range(9.0),
        ] {
            let mut left_out = 0;
            for (effect, _) in LIGHT_EFFECTS.into_iter().filter(|(effect, _)| light.effects().contains(*effect)) {
                let simple = simplify(&light, effect);
                assert!((simple.flux() / light.flux() - 1.0).abs() < 1e-5, "{light:?}, {effect:?}");
                // A surface without extent has a direction instead; a one-sided one had it before.
                assert!(!simple.effects().contains(effect), "{light:?}, {effect:?}");
                left_out += 1;
            }
            assert!(left_out > 0);
        }
    }
}
