//! What the view of trees draws: boxes, lights, and a floor under the lights of a dump.

use super::colors::FLOOR;
use super::light_marks::draw_lights;
use super::overlay::Overlay;
use super::tree_boxes::{TreeColors, tree_boxes};
use girandole::glam::Vec3;
use girandole::{LightWorld, TreeKey};
use std::collections::HashMap;
use testbed::render::shading::View;
use testbed::scene::dump::bounds;

/// The largest number of steps of the floor along one side.
const FLOOR_LINES: f32 = 40.0;

/// What is drawn of a world.
pub struct Drawn<'a> {
    /// The level of the boxes.
    pub level: i32,
    /// Whether there are lights.
    pub has_lights: bool,
    /// How loose the trees of a dump are; `None` for a scene, which has surfaces.
    pub looseness: Option<&'a HashMap<TreeKey, f32>>,
}

/// The lights of a world and boxes over them; under those of a dump, a floor.
pub fn draw(world: &LightWorld, view: &View, (width, height): (u32, u32), drawn: &Drawn) -> Overlay {
    let colors = drawn.looseness.map_or(TreeColors::Age, TreeColors::Looseness);
    let mut overlay = Overlay::default();
    if drawn.looseness.is_some() {
        draw_floor(world, view, &mut overlay);
    }
    if drawn.has_lights {
        draw_lights(world, view, width as f32 / height as f32, &mut overlay);
    }
    overlay.lines.extend(tree_boxes(world, view, drawn.level, &colors).lines);
    overlay
}

/// A grid below all lights. Its step is a power of ten in metres.
fn draw_floor(world: &LightWorld, view: &View, overlay: &mut Overlay) {
    let bounds = bounds(world);
    if bounds.is_empty() {
        return;
    }
    let step = 10.0f32.powf((bounds.extent().max_element().max(1.0) / FLOOR_LINES).log10().ceil());
    let [low, high] = [(bounds.min / step).floor() * step, (bounds.max / step).ceil() * step];
    let lines = |axis: usize| {
        let count = ((high[axis] - low[axis]) / step).round() as usize;
        (0..=count).map(move |line| low[axis] + step * line as f32)
    };
    let y = bounds.min.y;
    lines(0).for_each(|x| overlay.line(view, [Vec3::new(x, y, low.z), Vec3::new(x, y, high.z)], FLOOR));
    lines(2).for_each(|z| overlay.line(view, [Vec3::new(low.x, y, z), Vec3::new(high.x, y, z)], FLOOR));
}
