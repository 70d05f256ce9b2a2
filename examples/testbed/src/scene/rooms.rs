//! Rooms in two rows along a corridor, with doors between neighbours and to the corridor.
//!
//! The plan lies in x and z. The corridor runs along x with its middle at z = 0. Room `r` is the
//! `r / 2`-th of its row, and odd rooms lie at positive z.

use girandole::glam::{Affine3A, Vec2, Vec3, vec2, vec3};
use girandole::{FrameBudget, Light, LightWorld, Policy};

use super::assembly::{Assembly, Design};
use super::palette::{COOL, Glow, NEUTRAL, Palette, SOFT};
use super::part::Part;
use super::rng::Rng;
use super::{Camera, Scene, SceneError};

/// Length of a room along x and along z, metres.
const ROOM: Vec2 = vec2(5.0, 6.0);
/// Width of the corridor, metres.
const CORRIDOR: f32 = 2.0;
/// Thickness of all walls, metres.
const WALL: f32 = 0.2;
/// Height of the rooms, metres.
const HEIGHT: f32 = 3.0;
/// Width and height of a door, metres.
const DOOR: Vec2 = vec2(1.0, 2.1);
/// Distance between the middles of neighbouring rooms, metres.
const PITCH: f32 = ROOM.x + WALL;
/// Distance of eyes from the floor, metres.
const EYE_HEIGHT: f32 = 1.7;
/// The camera: its room, from where to where it looks in that, and its vertical field of view in radians.
const CAMERA_ROOM: usize = 4;
const CAMERA: [Vec3; 2] = [vec3(-1.7, EYE_HEIGHT, 2.75), vec3(0.6, 1.1, -3.0)];
const FIELD_OF_VIEW: f32 = 1.1;
/// Distance of the emissive faces from ceilings and walls, metres.
const GAP: f32 = 0.01;
/// The levels to which the lamps of a room may be dimmed. Daylight is not dimmed.
const LEVELS: [f32; 3] = [1.0, 0.3, 0.1];
/// Seeds the furniture, the lamps and their levels.
const SEED: u64 = 10;

/// Candela of a desk lamp, about 380 lm.
const DESK_LAMP: f32 = 30.0;
/// Peak candela of a spot, about 210 lm.
const SPOT: f32 = 600.0;
/// Nits of a ceiling panel, 0.3 m wide, about 570 lm.
const PANEL: f32 = 2_000.0;
/// Nits of a window, about 11,000 lm.
const WINDOW: f32 = 1_500.0;

/// A scene of an even number of rooms, its lights, and eyes in every room and in the corridor. All doors are open or
/// closed.
pub fn rooms(count: usize, are_open: bool) -> Result<(Scene, LightWorld, Vec<Vec3>), SceneError> {
    let mut assembly = Assembly::new();
    let mut palette = Palette::default();
    let shell = assembly.mesh(shell(&mut palette, count, are_open).mesh);
    assembly.object(shell, Affine3A::IDENTITY);
    let mut cabinet = Part::default();
    cabinet.cuboid(vec3(-0.25, 0.0, -0.5), vec3(0.25, 2.0, 0.5), palette.matte(0.45, 0.43, 0.4));
    let cabinet = assembly.mesh(cabinet.mesh);
    let mut window = Part::default();
    window.glow(Vec3::ZERO, Vec3::NEG_X, Vec3::Y * 0.6, palette.glow(COOL, WINDOW));
    let window = assembly.design(window)?;
    let mut kits = Vec::new();
    for level in LEVELS {
        let panel = palette.glow(NEUTRAL, PANEL * level);
        let desk = assembly.design(desk(&mut palette, DESK_LAMP * level))?;
        kits.push((panel, desk, assembly.design(track(&mut palette, SPOT * level))?));
    }
    let mut eyes = Vec::new();
    for room in 0..count {
        let mut rng = Rng::new(SEED, room as u64);
        let (panel, desk, track) = rng.pick(&kits);
        // The room's own space has its middle on the floor at the origin and the corridor at -z.
        let to_world = room_to_world(room);
        let ceiling = assembly.design(ceiling([3 + rng.below(3), 4 + rng.below(4)], panel))?;
        let mut place = |design: Design, local: Affine3A| assembly.place(design, to_world * local, Policy::Static);
        place(ceiling, Affine3A::IDENTITY)?;
        place(window, Affine3A::from_translation(vec3(0.0, 1.6, ROOM.y * 0.5 - GAP)))?;
        for _ in 0..4 + rng.below(5) {
            let at = vec3(rng.range(-1.6, 1.6), 0.0, rng.range(-1.8, 2.3));
            place(desk, Affine3A::from_translation(at))?;
        }
        for _ in 0..2 + rng.below(2) {
            let at = vec3(rng.range(-1.2, 1.2), HEIGHT - 0.1, rng.range(-2.0, 2.0));
            place(track, Affine3A::from_translation(at))?;
        }
        let side = if rng.chance(0.5) { 2.2 } else { -2.2 };
        assembly.object(cabinet, to_world * Affine3A::from_translation(vec3(side, 0.0, rng.range(0.5, 2.0))));
        eyes.push(to_world.transform_point3(Vec3::Y * EYE_HEIGHT));
    }
    let mut corridor = Part::default();
    let panel = palette.glow(NEUTRAL, PANEL * 0.3);
    (0..count).for_each(|room| add_panel(&mut corridor, vec2((room as f32 + 0.5) * PITCH * 0.5, 0.0), panel));
    let corridor = assembly.design(corridor)?;
    assembly.place(corridor, Affine3A::IDENTITY, Policy::Static)?;
    let length = PITCH * (count / 2) as f32;
    eyes.extend([0.25, 0.75].map(|share| vec3(length * share, EYE_HEIGHT, 0.0)));
    let Assembly { mut scene, mut world } = assembly;
    scene.materials = palette.materials;
    // From the far corner of a room to its door, through which the corridor is seen.
    let [eye, target] = CAMERA.map(|at| room_to_world(CAMERA_ROOM).transform_point3(at));
    scene.camera = Camera { eye, target, vertical_fov: FIELD_OF_VIEW, up: Vec3::Y };
    world.update(FrameBudget::UNLIMITED);
    Ok((scene, world, eyes))
}

/// A closed door of the room that the camera looks at, with its hinge at the origin, and where it hangs.
pub fn door(material: u32) -> (Part, Affine3A) {
    let mut part = Part::default();
    part.cuboid(vec3(0.0, 0.0, -0.5 * WALL), vec3(DOOR.x, DOOR.y, -0.5 * WALL + 0.04), material);
    // In the space of the room, whose wall to the corridor is at -z.
    let hinge = Affine3A::from_translation(vec3(-0.5 * DOOR.x, 0.0, -0.5 * (ROOM.y + WALL)));
    (part, room_to_world(CAMERA_ROOM) * hinge)
}

/// From the space of a room to the world. Rooms at negative z are turned by half a turn.
fn room_to_world(room: usize) -> Affine3A {
    let x = ((room / 2) as f32 + 0.5) * PITCH;
    let z = CORRIDOR * 0.5 + WALL + ROOM.y * 0.5;
    match room % 2 {
        1 => Affine3A::from_translation(vec3(x, 0.0, z)),
        _ => Affine3A::from_translation(vec3(x, 0.0, -z)) * Affine3A::from_rotation_y(std::f32::consts::PI),
    }
}

/// Floor, ceiling and all walls, with openings for doors or without.
fn shell(palette: &mut Palette, count: usize, are_open: bool) -> Part {
    let mut part = Part::default();
    let [plaster, carpet] = [palette.matte(0.6, 0.59, 0.56), palette.matte(0.25, 0.24, 0.23)];
    let length = PITCH * (count / 2) as f32;
    let inner = CORRIDOR * 0.5 + WALL;
    let outer = inner + ROOM.y;
    let (low, high) = (vec2(-WALL, -outer - WALL), vec2(length + WALL, outer + WALL));
    part.cuboid(vec3(low.x, -WALL, low.y), vec3(high.x, 0.0, high.y), carpet);
    part.cuboid(vec3(low.x, HEIGHT, low.y), vec3(high.x, HEIGHT + WALL, high.y), plaster);
    let half = WALL * 0.5;
    for x in [0.0, length] {
        wall(&mut part, vec2(x - half, low.y), vec2(x + half, high.y), None, plaster);
    }
    for side in [-1.0, 1.0] {
        wall(&mut part, vec2(low.x, side * outer), vec2(high.x, side * (outer + WALL)), None, plaster);
        for column in 0..count / 2 {
            let start = column as f32 * PITCH;
            let door = are_open.then_some(start + PITCH * 0.5);
            wall(&mut part, vec2(start, side * (inner - WALL)), vec2(start + PITCH, side * inner), door, plaster);
            if column > 0 {
                let door = are_open.then_some(side * (inner + 1.5));
                wall(&mut part, vec2(start - half, side * inner), vec2(start + half, side * outer), door, plaster);
            }
        }
    }
    part
}

/// A wall between two corners in (x, z), with a door whose middle is at `door` along the longer
/// side.
fn wall(part: &mut Part, from: Vec2, to: Vec2, door: Option<f32>, material: u32) {
    let (min, max) = (from.min(to), from.max(to));
    let mut piece = |min: Vec2, max: Vec2, base: f32| {
        part.cuboid(vec3(min.x, base, min.y), vec3(max.x, HEIGHT, max.y), material);
    };
    let Some(door) = door else { return piece(min, max, 0.0) };
    let axis = if max.x - min.x > max.y - min.y { Vec2::X } else { Vec2::Y };
    let at = |corner: Vec2, along: f32| corner * (Vec2::ONE - axis) + axis * along;
    let (start, end) = (door - DOOR.x * 0.5, door + DOOR.x * 0.5);
    piece(min, at(max, start), 0.0);
    piece(at(min, start), at(max, end), DOOR.y);
    piece(at(min, end), max, 0.0);
}

/// A grid of square panels that face down.
fn ceiling([columns, rows]: [usize; 2], panel: Glow) -> Part {
    let mut part = Part::default();
    for (column, row) in (0..columns).flat_map(|column| (0..rows).map(move |row| (column, row))) {
        let share = vec2((column as f32 + 0.5) / columns as f32, (row as f32 + 0.5) / rows as f32) - 0.5;
        add_panel(&mut part, share * ROOM, panel);
    }
    part
}

/// A square panel in the ceiling that faces down.
fn add_panel(part: &mut Part, at: Vec2, panel: Glow) {
    part.glow(vec3(at.x, HEIGHT - GAP, at.y), Vec3::X * 0.15, Vec3::Z * 0.15, panel);
}

/// A desk and a lamp with an opaque shade. `candela` in all directions, as if there was no shade.
fn desk(palette: &mut Palette, candela: f32) -> Part {
    let mut part = Part::default();
    let wood = palette.matte(0.35, 0.25, 0.16);
    part.cuboid(vec3(-0.7, 0.72, -0.35), vec3(0.7, 0.75, 0.35), wood);
    for x in [-0.68, 0.66] {
        part.cuboid(vec3(x, 0.0, -0.3), vec3(x + 0.02, 0.72, 0.3), wood);
    }
    let lamp = vec3(0.45, 1.15, 0.1);
    part.beam(vec3(0.6, 0.75, 0.25), vec3(0.6, 1.3, 0.25), 0.015, wood);
    // The shade is farther from the light than the part that shadow rays skip.
    part.cuboid(lamp + vec3(-0.16, 0.12, -0.16), lamp + vec3(0.16, 0.13, 0.16), wood);
    part.lights.push(Light::point(lamp, SOFT / SOFT.max_element() * candela));
    part
}

/// A rail below the ceiling with four spots, which point down and to all sides. `candela` is that
/// of the middle of their beams.
fn track(palette: &mut Palette, candela: f32) -> Part {
    let mut part = Part::default();
    let steel = palette.matte(0.2, 0.2, 0.2);
    part.cuboid(vec3(-0.9, 0.0, -0.02), vec3(0.9, 0.04, 0.02), steel);
    for (index, aside) in [vec2(-0.5, 0.4), vec2(-0.1, -0.6), vec2(0.1, 0.6), vec2(0.5, -0.4)].into_iter().enumerate() {
        let at = vec3(-0.75 + 0.5 * index as f32, -0.05, 0.0);
        let direction = vec3(aside.x, -1.0, aside.y).normalize();
        part.lights.push(Light::spot(at, direction, 0.2, 0.4, SOFT / SOFT.max_element() * candela));
    }
    part
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::geometry::Geometry;

    const ROOMS: usize = 10;

    #[test]
    fn walls_block_and_doors_do_not() {
        let (scene, _, eyes) = rooms(ROOMS, true).expect("a valid scene");
        let geometry = Geometry::new(&scene).expect("valid geometry");
        let is_blocked = |from: Vec3, to: Vec3| geometry.occluded(from, (to - from).normalize(), from.distance(to));
        let beside_door = |eye: Vec3| eye.with_z(eye.z.signum() * (CORRIDOR * 0.5 + WALL + 1.5));
        for room in 0..ROOMS {
            let eye = eyes[room];
            // Doors to the corridor are opposite each other.
            assert!(!is_blocked(eye, eyes[room ^ 1]));
            assert!(is_blocked(eye, eye + Vec3::Z * 20.0) && is_blocked(eye, eye - Vec3::Z * 20.0));
            assert!(is_blocked(eye + Vec3::X, eyes[room ^ 1] + Vec3::X));
            assert!(is_blocked(eye.with_y(2.5), eyes[room ^ 1].with_y(2.5)));
            if room + 2 < ROOMS {
                assert!(is_blocked(eye, eyes[room + 2]));
                assert!(!is_blocked(beside_door(eye), beside_door(eyes[room + 2])));
                assert!(is_blocked(beside_door(eye).with_y(2.5), beside_door(eyes[room + 2]).with_y(2.5)));
            }
        }
    }

    #[test]
    fn the_rooms_have_the_stated_lights_and_doors() {
        let (scene, world, eyes) = rooms(ROOMS, true).expect("a valid scene");
        assert_eq!(eyes.len(), ROOMS + 2);
        assert!((350..=450).contains(&world.light_count()), "{}", world.light_count());
        let count = |part: Part| part.lights.len();
        let glow = Glow { material: 0, radiance: Vec3::ONE };
        let mut palette = Palette::default();
        let fixed = 1;
        let [desk, track] = [count(desk(&mut palette, 1.0)), count(track(&mut palette, 1.0))];
        let fewest = count(ceiling([3, 4], glow)) + 4 * desk + 2 * track + fixed;
        let most = count(ceiling([5, 7], glow)) + 8 * desk + 3 * track + fixed;
        assert!(fewest >= 20 && most <= 60, "{fewest} to {most}");
        assert!(!scene.materials.is_empty());
        // Three cuboids of 12 triangles make a wall with a door: 10 to the corridor, 8 between
        // rooms.
        let solid = 2 + 2 + 2;
        assert_eq!(scene.meshes[0].triangles.len(), 12 * (solid + 3 * (10 + 8)));
    }
}
