//! The lights of a world as drawings: outlines of surfaces, crosses for all others.

use super::colors::Rgb;
use super::overlay::Overlay;
use super::tree_boxes::{in_front, map};
use girandole::glam::{Vec2, Vec3};
use girandole::{Light, LightWorld, Shape};
use testbed::render::shading::View;

/// Lights that are drawn at most, those of the nearest instances.
const MAX_LIGHTS: usize = 20_000;
/// Half the size of a cross, as a share of the picture's height.
const CROSS: f32 = 0.003;
/// Lights that do not shine.
const DARK: Rgb = [70, 70, 70];

/// The hue of a light, as bright as a screen shows it.
fn color(emission: Vec3) -> Rgb {
    let most = emission.max_element();
    if most <= 0.0 {
        return DARK;
    }
    // The exponent of a screen, about.
    (emission / most).to_array().map(|channel| (255.0 * channel.powf(1.0 / 2.2)).round() as u8)
}

/// Draws lights. `aspect` is the picture's width over its height.
pub fn draw_lights(world: &LightWorld, view: &View, aspect: f32, overlay: &mut Overlay) {
    let half = Vec2::new(CROSS / aspect, CROSS);
    let mut left = MAX_LIGHTS;
    for instance in in_front(world, view) {
        let shown = world.instance(instance);
        let tree = shown.and_then(|shown| world.tree(shown.tree));
        let (Some(tree), Some((linear, translation))) = (tree, map(world, instance)) else { continue };
        let factor = shown.filter(|shown| shown.appearance.is_enabled).map(|shown| shown.appearance.factor);
        let at = |point: Vec3| linear * point + translation;
        for light in tree.lights().iter().filter(|light| !light.is_removed()).take(left) {
            left -= 1;
            let color = color(light.emission * factor.unwrap_or_default());
            match outline(light) {
                Some(corners) => overlay.outline(view, &corners.into_iter().map(at).collect::<Vec<_>>(), color),
                None => overlay.cross(view, at(light.aabb().center()), half, color),
            }
        }
    }
}

/// The corners of a surface; `None` for lights of other kinds.
fn outline(light: &Light) -> Option<Vec<Vec3>> {
    match light.shape {
        Shape::Rectangle { center, half_u, half_v, .. } => {
            let corners = [half_u + half_v, half_v - half_u, -half_u - half_v, half_u - half_v];
            Some(corners.map(|corner| center + corner).to_vec())
        }
        Shape::Triangle { vertices, .. } => Some(vertices.to_vec()),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use girandole::{LightTree, Placement, Policy};
    use testbed::scene::Camera;

    #[test]
    fn each_light_has_its_outline_in_its_hue() {
        let mut world = LightWorld::new();
        let back = Vec3::NEG_Z * 10.0;
        let lights = vec![
            Light::point(back, Vec3::new(4.0, 0.0, 0.0)),
            Light::rectangle(back, Vec3::X, Vec3::Y, Vec3::splat(9.0)),
            Light::triangle([back, back + Vec3::X, back + Vec3::Y], Vec3::ZERO),
        ];
        let tree = world.add_tree(LightTree::new(lights).expect("valid lights"));
        let key = world.add_instance(tree, Placement::IDENTITY, Policy::Budgeted).expect("valid");
        let view =
            View::new(&Camera { eye: Vec3::ZERO, target: Vec3::NEG_Z, vertical_fov: 1.0, up: Vec3::Y }, 200, 100);
        let colors = |world: &LightWorld| {
            let mut overlay = Overlay::default();
            draw_lights(world, &view, 2.0, &mut overlay);
            overlay.lines.iter().map(|line| line.color).collect::<Vec<_>>()
        };
        let [red, white] = [[255, 0, 0], [255; 3]];
        assert_eq!(colors(&world), [red, red, white, white, white, white, DARK, DARK, DARK]);
        world.set_appearance(key, |a| a.is_enabled = false).expect("it lives");
        assert_eq!(colors(&world), [DARK; 9]);
    }
}
