//! The samplers by their names in tables.

use super::candidates::LightList;
use super::nee_at::NeeAt;
use super::regir::ReGir;
use super::tiles::Presampled;
use crate::direct_light::draw::Draw;
use crate::direct_light::view::View;
use girandole::{Light, LightId, LightSampler};

/// All names.
pub const NAMES: [&str; 4] = ["regir", "presampled 8", "presampled 32", "nee-at"];

/// The sampler of a name for a view of lights; `None` for a name that does not exist. `view` is a part of the picture
/// `whole`. `lights` and `ids` as for [`crate::measuring::samplers::published`].
pub fn by_name<'a>(
    name: &str,
    (sampler, ids, lights): (LightSampler<'a>, &'a [LightId], &'a [Light]),
    (view, whole): (&'a View, &View),
) -> Option<Box<dyn Draw + 'a>> {
    let lights = LightList::new(sampler, ids, lights);
    let width = view.width as u32;
    Some(match name {
        "regir" => Box::new(ReGir::new(lights, view, whole)),
        "presampled 8" => Box::new(Presampled::new(lights, width, 8)),
        "presampled 32" => Box::new(Presampled::new(lights, width, 32)),
        "nee-at" => Box::new(NeeAt::new(lights, view)),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::direct_light::draw::{Found, Frame, Sample};
    use crate::direct_light::sobol::sobol;
    use crate::direct_light::view::{Pixel, SUBPIXELS, Surface};
    use crate::measuring::lights::carried;
    use crate::scene::Material;
    use girandole::glam::{Vec3, vec3};
    use girandole::{LightTree, LightWorld, Placement, Policy, ShadingPoint};

    const SIDE: usize = 24;

    /// A floor seen from above, 0.5 m per pixel.
    fn floor() -> View {
        let pixel = |index: usize| {
            let at = vec3((index % SIDE) as f32, 0.0, (index / SIDE) as f32) * 0.5;
            let shading_point = ShadingPoint::surface(at, Vec3::Y);
            let surface = Surface { shading_point, toward_eye: Vec3::Y, material: 0, object: 0 };
            Pixel { surfaces: [Some(surface); SUBPIXELS], background: Vec3::ZERO }
        };
        View { width: SIDE, pixels: (0..SIDE * SIDE).map(pixel).collect() }
    }

    fn world(lights: Vec<Light>) -> LightWorld {
        let mut world = LightWorld::new();
        let tree = world.add_tree(LightTree::new(lights).expect("valid lights"));
        world.add_instance(tree, Placement::IDENTITY, Policy::Static).expect("a valid placement");
        world
    }

    /// Draws frames by a sampler; `see` tells the luminance that a drawn light shows to a pixel. Returns
    /// what was drawn in the last frame.
    fn last_frame(draw: &mut dyn Draw, view: &View, frames: u32, see: impl Fn(u32) -> f32) -> Vec<Option<(u32, f32)>> {
        let (mut found, mut drawn) = (Vec::new(), Vec::new());
        for frame in 0..frames {
            draw.prepare(&Frame { seed: 9, number: frame, found: &found });
            let one = |(pixel, shown): (u32, &Pixel)| {
                let sample = Sample { pixel, frame, u: sobol(pixel, frame, 9) };
                let drawn = draw.draw(shown.surfaces[0].as_ref()?, &Material::default(), &sample)?;
                Some((drawn.light, drawn.weight))
            };
            drawn = (0..).zip(&view.pixels).map(one).collect();
            let seen = |drawn: &Option<(u32, f32)>| {
                drawn.map_or(Found::default(), |(light, weight)| Found { light, luminance: see(light) * weight })
            };
            found = drawn.iter().map(seen).collect();
        }
        drawn
    }

    #[test]
    fn a_single_point_light_is_drawn_without_noise() {
        let (view, world) = (floor(), world(vec![Light::point(vec3(3.0, 2.0, 5.0), Vec3::ONE)]));
        let (lights, ids): (_, Vec<_>) = (carried(&world), world.sampler().all_lights().collect());
        for name in NAMES {
            let mut draw = by_name(name, (world.sampler(), &ids, &lights), (&view, &view)).expect("it exists");
            for drawn in last_frame(draw.as_mut(), &view, 3, |_| 1.0) {
                let (light, weight) = drawn.expect("the light is in sight");
                assert!(light == 0 && (weight - 1.0).abs() < 1.0e-4, "{name}: {weight}");
            }
        }
        assert!(by_name("none", (world.sampler(), &ids, &lights), (&view, &view)).is_none());
    }

    #[test]
    fn nee_at_learns_which_of_a_thousand_lights_is_visible() {
        // Light 700 has one thousandth of all flux, and a wall hides the others.
        let lamp = |i: usize| Light::point(vec3((i % 40) as f32 * 0.3, 3.0, (i / 40) as f32 * 0.48), Vec3::ONE);
        let (view, world) = (floor(), world((0..1_000).map(lamp).collect()));
        let (lights, ids): (_, Vec<_>) = (carried(&world), world.sampler().all_lights().collect());
        let share = |frames| {
            let mut draw = by_name("nee-at", (world.sampler(), &ids, &lights), (&view, &view)).expect("it exists");
            let drawn = last_frame(draw.as_mut(), &view, frames, |light| if light == 700 { 1.0 } else { 0.0 });
            drawn.iter().flatten().filter(|(light, _)| *light == 700).count() as f64 / drawn.len() as f64
        };
        let (first, learnt) = (share(1), share(40));
        // The other lights still win among the five candidates of a sample if they are nearer.
        assert!(first < 0.01 && learnt > 0.4, "{first}, {learnt}");
    }
}
