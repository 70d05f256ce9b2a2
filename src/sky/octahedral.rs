//! Directions on a square: the octahedral parametrisation.

use glam::Vec3;

/// The index of the pixel that a direction meets, in rows of `width`.
pub(super) fn pixel_at(width: usize, direction: Vec3) -> usize {
    let [x, y, z] = (direction / direction.abs().element_sum()).to_array();
    let folded = |a: f32, b: f32| (1.0 - b.abs()).copysign(a);
    let [u, v] = if y >= 0.0 { [x, z] } else { [folded(x, z), folded(z, x)] };
    let [column, row] = [u, v].map(|at| (((0.5 * at + 0.5) * width as f32) as usize).min(width - 1));
    row * width + column
}
