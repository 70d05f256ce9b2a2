//! Buildings on footprints: walls with windows of which some are lit, and flat roofs.
//!
//! All buildings of a square cell are one mesh and one light tree.

use std::collections::BTreeMap;

use girandole::Policy;
use girandole::glam::{Affine3A, DVec2, Vec2, vec2, vec3};

use super::SceneError;
use super::assembly::Assembly;
use super::facade::{Plane, room};
use super::footprints::Footprint;
use super::grid::{self, to_plane};
use super::palette::{Palette, WALLS};
use super::part::Part;
use super::rng::Rng;

/// Edge of a cell, metres.
const CELL: f32 = 100.0;
/// Buildings within this distance of the middle of the view have dark windows too, metres.
const DETAIL_REACH: f32 = 600.0;
/// Distance between the middles of windows, and height of a floor, metres.
const BAY: f32 = 3.0;
const FLOOR: f32 = 3.2;
/// Width and height of a window, metres.
const WINDOW: [f32; 2] = [1.3, 1.5];
/// Distance of windows from the wall, metres.
const OUT: f32 = 0.02;
/// The most windows of a wall. Longer walls have wider bays.
const MAX_WINDOWS: f32 = 4_000.0;
/// The most windows of all buildings, which bounds the memory that they take.
const MAX_ALL_WINDOWS: f64 = 2e7;
/// Buildings of at least this height are offices, metres.
const OFFICE: f32 = 28.0;

/// Adds all buildings. Positions are relative to `shift`, and `middle` is the middle of the view.
pub fn place(
    assembly: &mut Assembly,
    palette: &mut Palette,
    footprints: &[Footprint],
    shift: DVec2,
    middle: Vec2,
    seed: u64,
) -> Result<(), SceneError> {
    let windows: f64 = footprints.iter().map(window_count).sum();
    if windows > MAX_ALL_WINDOWS {
        return Err(SceneError(format!("the buildings have {windows:.0} windows; the limit is {MAX_ALL_WINDOWS}")));
    }
    let mut cells: BTreeMap<(i32, i32), Part> = BTreeMap::new();
    for (index, footprint) in footprints.iter().enumerate() {
        let at = to_plane(footprint.rings[0][0] - shift);
        let cell = grid::key(at, CELL);
        let has_detail = at.distance(middle) < DETAIL_REACH;
        let mut rng = Rng::new(seed, 0xb10c_0000 + index as u64);
        let origin = corner(cell);
        build(cells.entry(cell).or_default(), footprint, shift, origin, has_detail, palette, &mut rng);
    }
    for (cell, part) in cells {
        let origin = corner(cell);
        let design = assembly.design(part)?;
        assembly.place(design, Affine3A::from_translation(vec3(origin.x, 0.0, origin.y)), Policy::Static)?;
    }
    Ok(())
}

/// The corner of a cell in (x, z).
fn corner((x, z): (i32, i32)) -> Vec2 {
    vec2(x as f32, z as f32) * CELL
}

/// Adds a building, relative to `origin`.
fn build(
    part: &mut Part,
    footprint: &Footprint,
    shift: DVec2,
    origin: Vec2,
    has_detail: bool,
    palette: &mut Palette,
    rng: &mut Rng,
) {
    let [low, high] = footprint.heights;
    let [red, green, blue] = rng.pick(&WALLS);
    let style = Style {
        wall: palette.matte(red, green, blue),
        glass: has_detail.then(|| palette.glossy([0.015, 0.02, 0.028], 0.12)),
        is_office: high - low >= OFFICE,
        lit: rng.range(0.14, 0.34),
    };
    let tar = palette.matte(0.07, 0.07, 0.075);
    let mut corners = Vec::new();
    for ring in &footprint.rings {
        let ring: Vec<Vec2> = ring.iter().map(|at| to_plane(*at - shift) - origin).collect();
        for (a, b) in ring.iter().zip(ring.iter().cycle().skip(1)) {
            let along = *b - *a;
            if let Some(right) = along.try_normalize() {
                let right = vec3(right.x, 0.0, right.y);
                let plane = Plane { origin: vec3(a.x, 0.0, a.y), right, width: along.length() };
                wall(part, &plane, [low, high], &style, palette, rng);
            }
        }
        corners.extend(ring);
    }
    for triangle in footprint.triangles.chunks_exact(3) {
        let at = |corner: usize, y: f32| {
            let at = corners[triangle[corner] as usize];
            vec3(at.x, y, at.y)
        };
        part.triangle([0, 1, 2].map(|corner| at(corner, high)), tar);
        if low > 0.0 {
            part.triangle([0, 2, 1].map(|corner| at(corner, low)), style.wall);
        }
    }
}

/// What the walls of a building have in common.
struct Style {
    wall: u32,
    /// Material of dark windows; `None` if they are left out.
    glass: Option<u32>,
    is_office: bool,
    /// Probability that a window is lit.
    lit: f32,
}

/// The numbers of floors, and of windows on each, of a wall. Its sides are in metres.
fn grid_of_windows(width: f32, height: f32) -> [f32; 2] {
    let floors = (height / FLOOR).round().max(1.0);
    [floors, (width / BAY).floor().min((MAX_WINDOWS / floors).floor())]
}

/// The windows of all walls of a building.
fn window_count(footprint: &Footprint) -> f64 {
    let [low, high] = footprint.heights;
    let walls = footprint.rings.iter().flat_map(|ring| ring.iter().zip(ring.iter().cycle().skip(1)));
    let windows = |(from, to): (&DVec2, &DVec2)| {
        let [floors, bays] = grid_of_windows(from.distance(*to) as f32, high - low);
        f64::from(floors * bays)
    };
    walls.map(windows).sum()
}

/// A wall between two heights, with its windows.
fn wall(part: &mut Part, plane: &Plane, [low, high]: [f32; 2], style: &Style, palette: &mut Palette, rng: &mut Rng) {
    plane.rectangle(part, [0.0, plane.width], [low, high], 0.0, style.wall);
    let [floors, bays] = grid_of_windows(plane.width, high - low);
    let (floor, bay) = ((high - low) / floors, plane.width / bays);
    // Low walls have low windows, and those of sheds have none.
    let height = WINDOW[1].min(0.5 * floor);
    if bays < 1.0 || height < 0.6 {
        return;
    }
    for (row, column) in (0..floors as u32).flat_map(|row| (0..bays as u32).map(move |column| (row, column))) {
        let is_lit = rng.chance(style.lit);
        let x = (column as f32 + 0.5) * bay;
        let y = low + row as f32 * floor + 0.33 * floor;
        let (x, y) = ([x - 0.5 * WINDOW[0], x + 0.5 * WINDOW[0]], [y, y + height]);
        if is_lit {
            let (_, _, glow) = room(palette, rng, style.is_office);
            plane.glow(part, x, y, OUT, glow);
        } else if let Some(glass) = style.glass {
            plane.rectangle(part, x, y, OUT, glass);
        }
    }
}

/// The height of the highest roof near a point, metres; 0 if there is none.
pub fn highest_near(footprints: &[Footprint], at: Vec2, reach: f32, shift: DVec2) -> f32 {
    let is_near = |corner: &DVec2| to_plane(*corner - shift).distance(at) < reach;
    let near = footprints.iter().filter(|footprint| footprint.rings[0].iter().any(is_near));
    near.map(|footprint| footprint.heights[1]).fold(0.0, f32::max)
}

/// The box of all footprints in (x, z).
pub fn bounds(footprints: &[Footprint], shift: DVec2) -> Option<[Vec2; 2]> {
    let corners = footprints.iter().flat_map(|footprint| &footprint.rings[0]).map(|at| to_plane(*at - shift));
    corners.map(|at| [at; 2]).reduce(|[low, high], [at, _]| [low.min(at), high.max(at)])
}

#[cfg(test)]
mod tests {
    use girandole::glam::dvec2;

    use super::*;

    /// A block of 30 m by 40 m with a courtyard of 10 m by 10 m, far from (0, 0).
    fn block() -> Footprint {
        let at = |(x, y): (f64, f64)| dvec2(5e5 + x, 4e6 + y);
        let outer = [(0.0, 0.0), (30.0, 0.0), (30.0, 40.0), (0.0, 40.0)].map(at).to_vec();
        let hole = [(10.0, 10.0), (10.0, 20.0), (20.0, 20.0), (20.0, 10.0)].map(at).to_vec();
        // Not the whole roof: its triangles are those of the file's reader.
        Footprint { rings: vec![outer, hole], triangles: vec![0, 1, 4], heights: [0.0, 16.0], feature: 0 }
    }

    fn built(seed: u64) -> Part {
        let (mut part, mut palette) = (Part::default(), Palette::default());
        let mut rng = Rng::new(seed, 0);
        build(&mut part, &block(), dvec2(5e5, 4e6), Vec2::ZERO, true, &mut palette, &mut rng);
        part
    }

    #[test]
    fn more_windows_than_memory_holds_are_refused() {
        let tower = Footprint { heights: [0.0, 2000.0], ..block() };
        // Walls of 30, 40 and 10 m have 6 windows on each of 625 floors, or three where there is no room.
        assert_eq!(window_count(&tower), 625.0 * f64::from(6 + 6 + 6 + 6 + 4 * 3));
        let mut assembly = Assembly::new();
        let all = vec![tower; 1000];
        let placed = place(&mut assembly, &mut Palette::default(), &all, dvec2(5e5, 4e6), Vec2::ZERO, 1);
        assert!(placed.is_err_and(|error| error.0.contains("the limit is 20000000")));
        assert!(assembly.scene.meshes.is_empty());
    }

    #[test]
    fn walls_face_away_from_the_building_and_have_lit_windows() {
        let part = built(7);
        let (mut outer, mut inner) = (0.0, 0.0);
        for triangle in &part.mesh.triangles {
            let [a, b, c] = triangle.vertices;
            let (normal, middle) = ((b - a).cross(c - a), (a + b + c) / 3.0);
            if normal.y.abs() > 1e-3 * normal.length() {
                continue;
            }
            // From the middle of the courtyard, which is at (15, 15), north is -z.
            let out = middle - vec3(15.0, middle.y, -15.0);
            let is_courtyard = out.abs().max_element() < 6.0;
            let facing = normal.dot(out);
            assert!(if is_courtyard { facing < 0.0 } else { facing > 0.0 }, "{triangle:?}");
            *if is_courtyard { &mut inner } else { &mut outer } += 0.5 * normal.length();
        }
        // The walls, and the windows in front of them.
        assert!(outer > 140.0 * 16.0 && inner > 40.0 * 16.0, "{outer} and {inner}");
        // 46 + 12 windows on each of five floors, of which 14 % to 34 % are lit.
        assert!((20..140).contains(&part.lights.len()), "{}", part.lights.len());
    }

    #[test]
    fn the_seed_decides_which_windows_are_lit() {
        assert_eq!(built(7).lights, built(7).lights);
        assert_ne!(built(7).lights, built(8).lights);
    }

    #[test]
    fn buildings_of_a_cell_share_a_tree() {
        let mut assembly = Assembly::new();
        let (mut far, shift) = (block(), dvec2(5e5, 4e6));
        far.rings.iter_mut().flatten().for_each(|at| at.x += 1_000.0);
        let footprints = [block(), block(), far];
        place(&mut assembly, &mut Palette::default(), &footprints, shift, Vec2::ZERO, 1).unwrap();
        assert_eq!((assembly.scene.objects.len(), assembly.world.instances().len()), (2, 2));
        assert_eq!(highest_near(&footprints, Vec2::ZERO, 50.0, shift), 16.0);
        assert_eq!(bounds(&footprints, shift), Some([vec2(0.0, -40.0), vec2(1_030.0, 0.0)]));
    }
}
