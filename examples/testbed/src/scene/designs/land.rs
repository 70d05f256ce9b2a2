//! Land that reaches the horizon.

use super::palette::Palette;
use super::part::Part;

/// How far land reaches beyond the place that it surrounds, metres. The haze hides its end: it leaves
/// less than a thousandth of the light from there.
const REACH: f32 = 64_000.0;

/// Flat land at the height `y`: the rectangle from `low` to `high` in (x, z), and a frame around it up
/// to the horizon.
///
/// The frame is apart from the rectangle, so that rounding is small in the rectangle. It casts no
/// shadow, so that the box of all that does remains small.
pub fn land([low, high]: [[f32; 2]; 2], y: f32, color: [f32; 3], palette: &mut Palette) -> [Part; 2] {
    let mut near = Part::default();
    near.floor(low, high, y, palette.matte(color[0], color[1], color[2]));
    let mut far = Part::default();
    let material = palette.shadowless(color);
    let (outer_low, outer_high) = (low.map(|edge| edge - REACH), high.map(|edge| edge + REACH));
    far.floor([outer_low[0], outer_low[1]], [outer_high[0], low[1]], y, material);
    far.floor([outer_low[0], high[1]], [outer_high[0], outer_high[1]], y, material);
    far.floor([outer_low[0], low[1]], [low[0], high[1]], y, material);
    far.floor([high[0], low[1]], [outer_high[0], high[1]], y, material);
    [near, far]
}

#[cfg(test)]
mod tests {
    use girandole::glam::Vec3;

    use super::*;

    #[test]
    fn land_covers_each_place_once_and_only_what_is_near_casts_shadows() {
        let mut palette = Palette::default();
        let parts = land([[-10.0, 20.0], [30.0, 50.0]], -0.5, [0.1; 3], &mut palette);
        let areas = parts.each_ref().map(|part| {
            let normals = part.mesh.triangles.iter().map(|triangle| {
                let [a, b, c] = triangle.vertices;
                assert!(a.y == -0.5 && b.y == -0.5 && c.y == -0.5);
                (b - a).cross(c - a).dot(Vec3::Y) * 0.5
            });
            normals.inspect(|area| assert!(*area > 0.0)).map(f64::from).sum::<f64>()
        });
        let whole = (40.0 + 2.0 * f64::from(REACH)) * (30.0 + 2.0 * f64::from(REACH));
        assert_eq!(areas[0], 1_200.0);
        assert!(((areas[0] + areas[1]) / whole - 1.0).abs() < 1e-6, "{areas:?} of {whole}");
        let is_shadowless = |part: &Part| {
            part.mesh.triangles.iter().all(|triangle| palette.materials[triangle.material as usize].see_through)
        };
        assert_eq!(parts.each_ref().map(is_shadowless), [false, true]);
    }
}
