//! A dump as a picture, without a window.

use super::app::files::{write_file, write_png};
use super::app::options::Options;
use super::colors::Rgb;
use super::drawing::{Drawn, draw};
use super::looseness::looseness;
use super::overlay::{Line, Overlay};

use girandole::glam::Vec2;
use std::path::Path;
use testbed::render::shading::View;
use testbed::scene::SceneError;

/// Writes `dump.png` into the folder of `--out`. `print` receives lines for the user.
pub fn run(options: &Options, print: &mut dyn FnMut(&str)) -> Result<(), SceneError> {
    let stage = options.scene.load(options.size)?;
    stage.scene.warnings.iter().for_each(|warning| print(&format!("warning: {warning}")));
    let (width, height) = options.size;
    let view = View::new(&stage.scene.camera, width, height);
    let looseness = looseness(&stage.world);
    let drawn = Drawn { level: options.level, has_lights: true, looseness: Some(&looseness) };
    let overlay = draw(&stage.world, &view, options.size, &drawn);
    let path = options.folder().unwrap_or(Path::new(".")).join("dump.png");
    std::fs::create_dir_all(path.with_file_name("")).map_err(|error| SceneError(error.to_string()))?;
    write_file(&path, |file| write_png(file, options.size, &paint(&overlay, options.size)))?;
    let world = &stage.world;
    let loosest = looseness.values().copied().fold(1.0, f32::max);
    print(&format!(
        "{} lights in {} instances of {} trees, the loosest {loosest:.2}; picture in {}",
        world.light_count(),
        world.instances().len(),
        world.trees().len(),
        path.display()
    ));
    Ok(())
}

/// The lines of an overlay on black: three sRGB bytes per pixel. Later lines lie over earlier ones.
pub fn paint(overlay: &Overlay, (width, height): (u32, u32)) -> Vec<u8> {
    let size = Vec2::new(width as f32, height as f32);
    let mut pixels = vec![0; width as usize * height as usize * 3];
    for Line { ends, color } in &overlay.lines {
        let Some([from, to]) = within(ends.map(|end| end * size), size) else { continue };
        let steps = (to - from).abs().max_element().ceil().max(1.0);
        for step in 0..=steps as usize {
            let at = from.lerp(to, step as f32 / steps);
            put(
                &mut pixels,
                (at.x as usize).min(width as usize - 1),
                (at.y as usize).min(height as usize - 1),
                width,
                *color,
            );
        }
    }
    pixels
}

fn put(pixels: &mut [u8], x: usize, y: usize, width: u32, color: Rgb) {
    pixels[(y * width as usize + x) * 3..][..3].copy_from_slice(&color);
}

/// The part of a line within a picture (Liang and Barsky, 1984); `None` if it is outside.
fn within([from, to]: [Vec2; 2], size: Vec2) -> Option<[Vec2; 2]> {
    let step = to - from;
    let (mut first, mut last) = (0.0f32, 1.0f32);
    for axis in 0..2 {
        if step[axis] == 0.0 {
            (0.0..=size[axis]).contains(&from[axis]).then_some(())?;
            continue;
        }
        let [a, b] = [0.0, size[axis]].map(|side| (side - from[axis]) / step[axis]);
        (first, last) = (first.max(a.min(b)), last.min(a.max(b)));
    }
    (first <= last).then(|| [first, last].map(|share| (from + step * share).clamp(Vec2::ZERO, size)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_painted_where_they_are_within_the_picture() {
        let line = |a: [f32; 2], b: [f32; 2]| Line { ends: [a.into(), b.into()], color: [9, 8, 7] };
        let lit = |line: Line| {
            let pixels = paint(&Overlay { lines: vec![line] }, (10, 5));
            let lit = pixels.chunks(3).enumerate().filter(|(_, pixel)| *pixel == [9, 8, 7]);
            lit.map(|(index, _)| (index % 10, index / 10)).collect::<Vec<_>>()
        };
        let row: Vec<_> = (0..10).map(|x| (x, 2)).collect();
        assert_eq!(lit(line([-1.0e6, 0.5], [1.0e6, 0.5])), row);
        assert_eq!(lit(line([0.31, 0.5], [0.31, 0.5])), [(3, 2)]);
        assert_eq!(lit(line([-0.5, 0.2], [-0.1, 0.9])), []);
        assert_eq!(lit(line([0.5, -3.0], [0.5, -1.0])), []);
        assert_eq!(lit(line([0.0, 0.0], [1.0, 1.0])).len(), 10);
    }
}
