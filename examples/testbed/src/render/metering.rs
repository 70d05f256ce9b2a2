//! Finds an exposure for what the camera sees, as a camera's meter does.
//!
//! The key of dim scenes is lower, as in Krawczyk, Myszkowski and Seidel, Perceptual Effects in Real-time
//! Tone Mapping (2005), so that a night stays one. Differs: only surfaces that lights reach count.

use super::cpu::Integrator;
use super::geometry::Geometry;
use super::image::ShadowRays;
use super::scene::Scene;
use super::sequence::PixelSequence;
use super::shading::View;
use super::textures::OpacitySeed;
use girandole::LightWorld;
use girandole::glam::Vec2;
use girandole::light::luminance;
use rayon::prelude::*;

/// Cells along the width and the height of the picture. Each is one measurement, so that surfaces count by
/// the area that the camera sees.
const GRID: (u32, u32) = (32, 18);
/// Camera rays of a cell, each with the light of one sample.
const SAMPLES: u32 = 8;
/// What the geometric mean of the luminance is mapped to: middle grey.
const KEY: f32 = 0.18;
/// Below this mean, in nits, the key falls with its square root, down to `MIN_KEY`.
const DIM: f32 = 0.3;
const MIN_KEY: f32 = 0.04;
/// A tenth of the cells may be mapped to more than `BRIGHT`, which is not yet white on the screen.
const BRIGHT_SHARE: f32 = 0.1;
const BRIGHT: f32 = 2.0;
/// What the mean emission is mapped to, in pictures with little else.
const EMITTED: f32 = 0.5;
/// Share of the cells up to which surfaces that do not emit are ignored.
const FEW: f32 = 0.05;

/// Multiplies the exposure by the one for what the camera sees, once, if the scene asks for it. `size` is
/// that of the picture. The world must be up to date.
pub fn meter(scene: &mut Scene, geometry: &Geometry, world: &LightWorld, size: (u32, u32)) {
    if std::mem::take(&mut scene.is_metered) {
        scene.exposure *= exposure(&measure(scene, geometry, world, size));
    }
}

/// The mean luminance of what rays of a cell met, nits.
#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    /// Of surfaces that do not emit, if any light reaches them; else 0.
    reflected: f32,
    /// The emission of the others.
    emitted: f32,
}

/// The cells of the picture, row by row.
fn measure(scene: &Scene, geometry: &Geometry, world: &LightWorld, (width, height): (u32, u32)) -> Vec<Cell> {
    let integrator = Integrator { scene, geometry, sampler: world.sampler(), candidates: Some(4) };
    let view = View::new(&scene.camera, width, height);
    let (columns, rows) = GRID;
    let cell = |index: u32| {
        let (x, y) = (index % columns, index / columns);
        let sequence = PixelSequence::new(x, y, SAMPLES, 0);
        let seen = |sample: u32| {
            let numbers = sequence.sample(sample);
            let at = Vec2::new(x as f32, y as f32) + Vec2::from(numbers.jitter);
            let direction = view.direction(at, Vec2::new(columns as f32, rows as f32));
            let seed = OpacitySeed::new(index, sample, 0);
            integrator.seen(view.eye, direction, seed, &numbers, &mut ShadowRays::default())
        };
        let (mut cell, mut ambient, mut plain, mut emissive) = (Cell::default(), 0.0, 0.0, 0.0);
        for seen in (0..SAMPLES).filter_map(seen).filter(|seen| !seen.is_unlit) {
            let emission = luminance(seen.emitted);
            if emission > 0.0 {
                (cell.emitted, emissive) = (cell.emitted + emission, emissive + 1.0);
            } else {
                (cell.reflected, plain) = (cell.reflected + luminance(seen.reflected), plain + 1.0);
                ambient += luminance(seen.ambient);
            }
        }
        let reflected = if cell.reflected > 0.0 { (cell.reflected + ambient) / plain } else { 0.0 };
        let emitted = if emissive > 0.0 { cell.emitted / emissive } else { 0.0 };
        Cell { reflected, emitted }
    };
    (0..columns * rows).into_par_iter().map(cell).collect()
}

/// The exposure for a picture; 1 if it shows no light.
fn exposure(cells: &[Cell]) -> f32 {
    let found = |value: fn(&Cell) -> f32| -> Vec<f32> {
        cells.iter().map(value).filter(|value| *value > 0.0 && value.is_finite()).collect()
    };
    let (mut lit, emitted) = (found(|cell| cell.reflected), found(|cell| cell.emitted));
    let geometric_mean =
        |values: &[f32]| (values.iter().map(|value| value.ln()).sum::<f32>() / values.len() as f32).exp();
    let exposure = if lit.len() as f32 > FEW * (lit.len() + emitted.len()) as f32 {
        let mean = geometric_mean(&lit);
        let key = (KEY * (mean / DIM).sqrt()).clamp(MIN_KEY, KEY);
        lit.sort_by(|a, b| b.total_cmp(a));
        let bright = lit[(lit.len() as f32 * BRIGHT_SHARE) as usize];
        (key / mean).min(BRIGHT / bright)
    } else if emitted.is_empty() {
        1.0
    } else {
        EMITTED / geometric_mean(&emitted)
    };
    exposure.clamp(1e-6, 1e6)
}

#[cfg(test)]
mod tests {
    use super::super::scene::{Camera, Material, Mesh, Object, Sky, Triangle};
    use super::*;
    use girandole::glam::{Affine3A, Vec3};
    use girandole::{DirectionalLight, FrameBudget};
    use std::f32::consts::PI;

    /// The exposure for a wall of 2 m that a light without distance shines on, of `lux`, head-on, and that
    /// emits `nits`. The left half is dark and of `strips` strips, and the picture shows a square of `width`.
    fn of_wall(strips: usize, width: f32, lux: f32, nits: f32) -> f32 {
        let quad = |[left, right]: [f32; 2], material: u32| {
            let corner = |x: f32, y: f32| Vec3::new(x, y, 0.0);
            let [a, b, c, d] = [corner(left, -1.0), corner(right, -1.0), corner(right, 1.0), corner(left, 1.0)];
            [[a, b, c], [a, c, d]].map(|vertices| Triangle { vertices, material })
        };
        let edge = |i: usize| i as f32 / strips as f32 - 1.0;
        let triangles = (0..strips).flat_map(|i| quad([edge(i), edge(i + 1)], 0)).chain(quad([0.0, 1.0], 1)).collect();
        let material = |gray: f32| {
            let (base_color, emission) = (Vec3::splat(gray), Vec3::splat(nits));
            Material { base_color, emission, roughness: 1.0, ..Material::default() }
        };
        let mut scene = Scene {
            materials: vec![material(0.0), material(0.5)],
            textures: Vec::new(),
            meshes: vec![Mesh { triangles, ..Mesh::default() }],
            objects: vec![Object { mesh: 0, transform: Affine3A::IDENTITY, emission_scale: 1.0, visible: true }],
            festival: None,
            camera: Camera {
                eye: Vec3::Z * 1000.0,
                target: Vec3::ZERO,
                vertical_fov: 2.0 * (width * 0.5 / 1000.0).atan(),
                up: Vec3::Y,
            },
            sky: Sky { zenith: Vec3::ONE, horizon: Vec3::ONE, ..Sky::default() },
            lamp_clearance: 0.1,
            exposure: 1.0,
            is_metered: true,
            warnings: Vec::new(),
        };
        let mut world = LightWorld::new();
        if lux > 0.0 {
            let light = DirectionalLight { direction: Vec3::NEG_Z, illuminance: Vec3::splat(lux) };
            world.add_directional(light).expect("a valid light");
        }
        world.update(FrameBudget::UNLIMITED);
        let geometry = Geometry::new(&scene).expect("a valid scene");
        for _ in 0..2 {
            // The second time changes nothing.
            meter(&mut scene, &geometry, &world, (100, 100));
        }
        scene.exposure
    }

    #[test]
    fn surfaces_count_by_the_area_in_view() {
        // At roughness 1, the wall reflects (0.96 base colour + 0.01) / pi of light head-on.
        let lux = 100.0 * PI;
        let mean = (1.0f32 * 49.0).sqrt();
        for strips in [1, 500] {
            let exposure = of_wall(strips, 2.0, lux, 0.0);
            assert!((exposure * mean / KEY - 1.0).abs() < 0.01, "{strips} strips: {exposure}");
        }
        // The sky does not count, unlike in a mean over the whole picture.
        let far = of_wall(1, 3.2, lux, 0.0);
        assert!((far * mean / KEY - 1.0).abs() < 0.01, "{far}");
    }

    #[test]
    fn only_emission_counts_where_all_surfaces_emit_and_darkness_changes_nothing() {
        assert!((of_wall(1, 2.0, 1.0, 4.0) * 4.0 / EMITTED - 1.0).abs() < 1e-4);
        assert_eq!(of_wall(1, 2.0, 0.0, 0.0), 1.0);
    }

    #[test]
    fn dim_pictures_have_a_lower_key_and_bright_parts_are_not_white() {
        let of = |values: &[f32]| {
            exposure(&values.iter().map(|&reflected| Cell { reflected, emitted: 0.0 }).collect::<Vec<_>>())
        };
        for (mean, key) in [(50.0, KEY), (DIM, KEY), (DIM / 4.0, KEY / 2.0), (1e-3, MIN_KEY)] {
            let exposure = of(&[mean, 0.0, mean * 2.0, mean * 0.5]);
            assert!((exposure * mean / key - 1.0).abs() < 1e-4, "{mean}: {exposure}");
        }
        // A third of the cells is 10,000 times as bright.
        let mixed = [vec![1.0; 20], vec![1e4; 10]].concat();
        assert!((of(&mixed) * 1e4 - BRIGHT).abs() < 1e-3);
    }
}
