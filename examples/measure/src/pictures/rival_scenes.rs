//! Scenes with thousands of lights for the comparison of samplers: small, procedural, and seeded.

use girandole::glam::{Affine3A, Vec3, vec3};
use girandole::{Light, Policy};
use testbed::scene::assembly::Assembly;
use testbed::scene::palette::{COOL, NEUTRAL, Palette, SODIUM, SOFT, WARM};
use testbed::scene::part::Part;
use testbed::scene::rng::Rng;
use testbed::scene::{Camera, SceneError, Stage, Still};

/// Vertical fields of view, in radians.
const FIELD_OF_VIEW: f32 = 1.0;
/// Cells along each side of a yard, and their edge in metres.
const CELLS: usize = 10;
const CELL: f32 = 10.0;
/// Levels of brightness, by factors of [`STEP`].
const LEVELS: usize = 12;
const STEP: f32 = 1.8;

/// What a yard is lit by.
#[derive(Clone, Copy, PartialEq)]
pub enum Lamps {
    /// Rectangles in any direction.
    Panels,
    Points,
}

/// Closes a scene: what the camera sees at night.
fn finished(mut assembly: Assembly, palette: Palette, eye: Vec3, target: Vec3) -> Stage {
    assembly.scene.materials = palette.materials;
    assembly.scene.camera = Camera { eye, target, vertical_fov: FIELD_OF_VIEW, up: Vec3::Y };
    Stage { scene: assembly.scene, world: assembly.world, animation: Box::new(Still) }
}

/// A yard of 100 m x 100 m with crates and `count` lamps of very different brightness, as a hundred
/// cells with a light tree each.
pub fn yard(lamps: Lamps, count: usize) -> Result<Stage, SceneError> {
    let (mut assembly, mut palette, mut rng) = (Assembly::new(), Palette::default(), Rng::new(11, 42));
    let (ground, crates) = (palette.matte(0.4, 0.38, 0.35), palette.matte(0.5, 0.4, 0.3));
    for cell in 0..CELLS * CELLS {
        let mut part = Part::default();
        part.floor([0.0; 2], [CELL; 2], 0.0, ground);
        for _ in 0..3 {
            let low = vec3(rng.range(0.0, CELL - 2.0), 0.0, rng.range(0.0, CELL - 2.0));
            part.cuboid(low, low + vec3(rng.range(0.5, 2.0), rng.range(0.5, 3.0), rng.range(0.5, 2.0)), crates);
        }
        for _ in 0..count / (CELLS * CELLS) {
            let at = vec3(rng.range(0.0, CELL), rng.range(0.3, 5.0), rng.range(0.0, CELL));
            let level = STEP.powi(rng.below(LEVELS) as i32);
            let color = rng.pick(&[WARM, SOFT, NEUTRAL, COOL]);
            if lamps == Lamps::Points {
                part.lights.push(Light::point(at, color * level));
                continue;
            }
            let normal = vec3(rng.range(-1.0, 1.0), rng.range(-1.0, 1.0), rng.range(-1.0, 1.0)).normalize_or(Vec3::Y);
            let side = normal.any_orthonormal_vector();
            let size = rng.range(0.05, 0.2);
            part.glow(at, side * size, normal.cross(side) * (0.6 * size), palette.glow(color, 100.0 * level));
        }
        let corner = vec3((cell % CELLS) as f32, 0.0, (cell / CELLS) as f32) * CELL;
        let design = assembly.design(part)?;
        assembly.place(design, Affine3A::from_translation(corner), Policy::Static)?;
    }
    let middle = 0.5 * CELL * CELLS as f32;
    Ok(finished(assembly, palette, vec3(-4.0, 9.0, -4.0), vec3(middle, 0.0, middle)))
}

/// A tunnel of 600 m with two rows of lamps under its ceiling, and cars with lamps.
pub fn tunnel() -> Result<Stage, SceneError> {
    const SEGMENT: f32 = 20.0;
    const SEGMENTS: usize = 30;
    const LAMPS: usize = 33;
    const CARS: usize = 80;
    let (mut assembly, mut palette, mut rng) = (Assembly::new(), Palette::default(), Rng::new(12, 42));
    let (road, wall) = (palette.matte(0.25, 0.25, 0.25), palette.matte(0.6, 0.58, 0.5));
    let paint = palette.matte(0.4, 0.1, 0.1);
    let (lamp, tail) = (palette.glow(SODIUM, 4_000.0), palette.glow(vec3(1.0, 0.05, 0.02), 900.0));
    let place = |along: f32, right: f32| Affine3A::from_translation(vec3(along, 0.0, right));
    let mut segment = Part::default();
    segment.floor([0.0, -6.0], [SEGMENT, 6.0], 0.0, road);
    segment.cuboid(vec3(0.0, 0.0, -6.5), vec3(SEGMENT, 7.0, -6.0), wall);
    segment.cuboid(vec3(0.0, 0.0, 6.0), vec3(SEGMENT, 7.0, 6.5), wall);
    segment.cuboid(vec3(0.0, 7.0, -6.5), vec3(SEGMENT, 7.5, 6.5), wall);
    for i in 0..LAMPS {
        let x = (i as f32 + 0.5) * SEGMENT / LAMPS as f32;
        // The front is the side of the first half axis times the second: below.
        for z in [-2.5, 2.5] {
            segment.glow(vec3(x, 6.8, z), Vec3::X * 0.2, Vec3::Z * 0.07, lamp);
        }
    }
    let segment = assembly.design(segment)?;
    for i in 0..SEGMENTS {
        assembly.place(segment, place(i as f32 * SEGMENT, 0.0), Policy::Static)?;
    }
    let mut car = Part::default();
    car.cuboid(vec3(-2.0, 0.3, -0.9), vec3(2.0, 1.4, 0.9), paint);
    for side in [-0.6, 0.6] {
        car.glow(vec3(-2.02, 0.9, side), Vec3::Z * 0.15, Vec3::Y * 0.08, tail);
        let ahead = vec3(1.0, -0.08, 0.0).normalize();
        car.lights.push(Light::spot(vec3(2.1, 0.7, side), ahead, 0.15, 0.5, SOFT * 3_000.0));
    }
    let car = assembly.design(car)?;
    let lanes = [-4.0, -1.3, 1.3, 4.0];
    for _ in 0..CARS {
        let at = place(rng.range(10.0, SEGMENT * SEGMENTS as f32), rng.pick(&lanes));
        assembly.place(car, at, Policy::Static)?;
    }
    Ok(finished(assembly, palette, vec3(1.0, 2.2, 0.4), vec3(60.0, 1.2, 0.0)))
}

/// A wet street of 400 m between houses with lit windows, under lamps.
pub fn street() -> Result<Stage, SceneError> {
    const HOUSES: usize = 40;
    const WIDTH: f32 = 10.0;
    let (mut assembly, mut palette, mut rng) = (Assembly::new(), Palette::default(), Rng::new(13, 42));
    let (road, wall) = (palette.glossy([0.08, 0.08, 0.09], 0.2), palette.glossy([0.35, 0.3, 0.27], 0.5));
    let designs = (0..5)
        .map(|_| {
            let mut house = Part::default();
            let floors = 3 + rng.below(4);
            house.cuboid(vec3(0.0, 0.0, 0.0), vec3(WIDTH, 3.0 * floors as f32 + 1.0, 8.0), wall);
            for (floor, column) in (0..floors).flat_map(|floor| (0..8).map(move |column| (floor, column))) {
                let nits = 30.0 * STEP.powi(rng.below(6) as i32);
                let color = rng.pick(&[WARM, SOFT, NEUTRAL, COOL]);
                let at = vec3(0.9 + 1.17 * column as f32, 1.8 + 3.0 * floor as f32, -0.02);
                if rng.chance(0.8) {
                    house.glow(at, Vec3::NEG_X * 0.35, Vec3::Y * 0.6, palette.glow(color, nits));
                }
            }
            assembly.design(house)
        })
        .collect::<Result<Vec<_>, _>>()?;
    let length = WIDTH * HOUSES as f32;
    let mut ground = Part::default();
    ground.floor([-20.0, -8.0], [length, 8.0], 0.0, road);
    let ground = assembly.design(ground)?;
    assembly.place(ground, Affine3A::IDENTITY, Policy::Static)?;
    for house in 0..HOUSES {
        let x = WIDTH * house as f32;
        let right = Affine3A::from_translation(vec3(x, 0.0, 7.0));
        let left =
            Affine3A::from_translation(vec3(x + WIDTH, 0.0, -7.0)) * Affine3A::from_rotation_y(std::f32::consts::PI);
        for place in [right, left] {
            assembly.place(rng.pick(&designs), place, Policy::Static)?;
        }
    }
    let mut lamp = Part::default();
    lamp.beam(Vec3::ZERO, vec3(0.0, 6.0, 0.0), 0.12, wall);
    lamp.lights.push(Light::spot(vec3(0.0, 5.8, 0.0), Vec3::NEG_Y, 0.4, 1.2, SODIUM * 700.0));
    let lamp = assembly.design(lamp)?;
    for i in 0..2 * HOUSES {
        let at = vec3(5.0 * i as f32, 0.0, if i % 2 == 0 { 5.0 } else { -5.0 });
        assembly.place(lamp, Affine3A::from_translation(at), Policy::Static)?;
    }
    Ok(finished(assembly, palette, vec3(-8.0, 1.8, 0.5), vec3(40.0, 2.0, 0.0)))
}
