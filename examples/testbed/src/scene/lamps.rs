//! The street lamps of a real city, from a table: lamp posts on flat ground, an instance each.

use std::collections::BTreeMap;
use std::path::Path;

use girandole::glam::{Affine3A, DVec2, Quat, Vec2, dvec2, vec2, vec3};
use girandole::{Policy, Profile};

use super::assembly::{Assembly, Design};
use super::designs::furniture::{self, Lamp};
use super::designs::land;
use super::palette::Palette;
use super::{Camera, SceneError, Stage, Still};

/// The columns of the table, and the smallest and the largest value of each: metres east and north, metres above the
/// ground, and lumens. The highest masts are below 100 m, and the strongest floodlights below 10 million lumens.
const COLUMNS: [(&str, [f64; 2]); 4] =
    [("x_m", [-2e7, 2e7]), ("y_m", [-2e7, 2e7]), ("est_height_m", [0.5, 200.0]), ("est_lumens", [0.0, 1e8])];
/// How far the land that casts shadows reaches beyond all lamps, metres.
const LAND_MARGIN: f32 = 1_500.0;
/// The camera looks at the square of this edge that has the most lamps, metres.
const VIEW_CELL: f32 = 240.0;
/// Lamps of one row are at least this far from each other, metres, and each looks at so many neighbours on each side.
const LEAST_ROW_GAP: f32 = 4.0;
const NEIGHBOURS: usize = 64;

/// Reads a table and places its lamps. Positions in national grids can lie megametres from the origin, so all are
/// shifted by the whole kilometres that bring the mean position closest to it.
pub fn stage(path: &Path, lamp_profile: Option<Profile>) -> Result<Stage, SceneError> {
    let rows = read(path).map_err(|what| SceneError(format!("{}: {}", path.display(), what.replace('\n', " "))))?;
    let mean = rows.iter().map(|&[x, y, ..]| dvec2(x, y)).sum::<DVec2>() / rows.len() as f64;
    let shift = (mean / 1000.0).round() * 1000.0;
    let place = |&[x, y, ..]: &[f64; 4]| (dvec2(x, y) - shift).as_vec2() * vec2(1.0, -1.0);
    let positions: Vec<Vec2> = rows.iter().map(place).collect();
    let mut assembly = Assembly::new();
    let mut palette = Palette { lamp_profile, ..Palette::default() };
    // Lamps with the same height and flux share a tree and a mesh; real tables have few kinds.
    let mut designs: BTreeMap<[u64; 2], Design> = BTreeMap::new();
    for ((&[_, _, height, lumens], position), arm) in rows.iter().zip(&positions).zip(arms(&positions)) {
        let kind = match height {
            height if height < 5.5 => Lamp::Globe,
            _ if lumens > 12_000.0 => Lamp::Sodium,
            _ => Lamp::Led,
        };
        let key = [height, lumens].map(f64::to_bits);
        let design = match designs.get(&key) {
            Some(&known) => known,
            None => assembly.design(furniture::lamp(kind, height as f32, lumens as f32, &mut palette))?,
        };
        designs.insert(key, design);
        let turn = Quat::from_rotation_y(arm.x.atan2(arm.y));
        let transform = Affine3A::from_rotation_translation(turn, vec3(position.x, 0.0, position.y));
        assembly.place(design, transform, Policy::Static)?;
    }
    let around = |(low, high): (Vec2, Vec2), at: &Vec2| (low.min(*at), high.max(*at));
    let (low, high) = positions.iter().fold((Vec2::MAX, Vec2::MIN), around);
    let near = [low - LAND_MARGIN, high + LAND_MARGIN].map(|corner| corner.to_array());
    for part in land::land(near, 0.0, [0.075, 0.08, 0.06], &mut palette) {
        let mesh = assembly.mesh(part.mesh);
        assembly.object(mesh, Affine3A::IDENTITY);
    }
    assembly.add_night()?;
    let Assembly { mut scene, world } = assembly;
    scene.materials = palette.materials;
    let middle = densest(&positions);
    let (eye, target) = (vec3(middle.x, 52.0, middle.y + 110.0), vec3(middle.x, 0.0, middle.y));
    scene.camera = Camera { eye, target, ..scene.camera };
    scene.is_metered = true;
    Ok(Stage { scene, world, animation: Box::new(Still) })
}

/// The [`COLUMNS`] of each row of a table. Errors are without its name.
fn read(path: &Path) -> Result<Vec<[f64; COLUMNS.len()]>, String> {
    let mut builder = csv::ReaderBuilder::new();
    // A row that is too short is reported below, with the column that it lacks.
    builder.flexible(true).trim(csv::Trim::All);
    let mut reader = builder.from_path(path).map_err(|error| error.to_string())?;
    let headers = reader.headers().map_err(|error| error.to_string())?.clone();
    let mut places = [0; COLUMNS.len()];
    for ((name, _), place) in COLUMNS.iter().zip(&mut places) {
        let found = headers.iter().position(|header| header == *name);
        *place = found.ok_or_else(|| format!("there is no column {name:?}"))?;
    }
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|error| error.to_string())?;
        let mut values = [0.0; COLUMNS.len()];
        for (((name, [min, max]), place), value) in COLUMNS.iter().zip(places).zip(&mut values) {
            let line = record.position().map_or(0, |position| position.line());
            let wrong = |what: &str| format!("line {line}, column {name:?}: {what}");
            let text = record.get(place).ok_or_else(|| wrong("the row is too short"))?;
            *value = text.parse().map_err(|_| wrong(&format!("{text:?} is not a number")))?;
            if !(*min..=*max).contains(value) {
                return Err(wrong(&format!("{value} is not between {min} and {max}")));
            }
        }
        rows.push(values);
    }
    if rows.is_empty() { Err("it contains no lamps".into()) } else { Ok(rows) }
}

/// The direction of each lamp's arm: across the row that the lamp forms with the nearest other one, on the same side
/// of all parallel rows. Lamps without a row point all around, so that those in one place do not have the same box,
/// for which obvhs 0.4 takes quadratic time.
fn arms(positions: &[Vec2]) -> Vec<Vec2> {
    let mut order: Vec<usize> = (0..positions.len()).collect();
    order.sort_by(|a, b| positions[*a].x.total_cmp(&positions[*b].x));
    let mut arms = vec![Vec2::X; positions.len()];
    for (place, &lamp) in order.iter().enumerate() {
        let near = &order[place.saturating_sub(NEIGHBOURS)..(place + NEIGHBOURS + 1).min(order.len())];
        let toward = near.iter().map(|&other| positions[other] - positions[lamp]);
        let nearest = toward
            .filter(|toward| toward.length() > LEAST_ROW_GAP)
            .min_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
        arms[lamp] = match nearest {
            Some(along) if along.x + 0.37 * along.y < 0.0 => vec2(along.y, -along.x),
            Some(along) => vec2(-along.y, along.x),
            None => Vec2::from_angle(lamp as f32 * 2.399_963),
        };
    }
    arms
}

/// The mean of the positions in the square that has the most.
fn densest(positions: &[Vec2]) -> Vec2 {
    let mut cells: BTreeMap<[i32; 2], (u32, Vec2)> = BTreeMap::new();
    for at in positions {
        let (count, sum) = cells.entry((at / VIEW_CELL).floor().as_ivec2().to_array()).or_default();
        (*count, *sum) = (*count + 1, *sum + at);
    }
    cells.into_values().max_by_key(|(count, _)| *count).map_or(Vec2::ZERO, |(count, sum)| sum / count as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "x_m,y_m,est_height_m,est_lumens\n";

    /// Reads a table with this text.
    fn load(name: &str, text: &str) -> Result<Stage, SceneError> {
        let path = std::env::temp_dir().join(format!("girandole_lamps_{}_{name}", std::process::id()));
        std::fs::write(&path, text).expect("a writable temporary folder");
        let stage = stage(&path, None);
        std::fs::remove_file(&path).expect("a file that exists");
        stage
    }

    fn placements(stage: &Stage) -> Vec<girandole::glam::Vec3> {
        let placement = |instance| stage.world.instance(instance).map(|instance| instance.placement);
        stage.world.instances().filter_map(placement).map(|placement| placement.translation.as_vec3()).collect()
    }

    #[test]
    fn lamps_have_the_positions_and_fluxes_of_the_file() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/lamps_small.csv");
        let stage = stage(Path::new(path), None).expect("the sample file");
        let all = placements(&stage);
        // The first lamp: 135 m west and 7 m north of the origin.
        assert!(all.len() == 24 && all[0].abs_diff_eq(vec3(-135.0, 0.0, -7.0), 1e-3), "{all:?}");
        let trees = stage.world.trees().filter_map(|key| stage.world.tree(key));
        let fluxes: Vec<f32> = trees.map(|tree| tree.lights()[0].flux()).collect();
        for lumens in [23_750.0, 14_250.0, 9_500.0, 4_125.0] {
            assert!(fluxes.iter().any(|flux| (flux / lumens - 1.0).abs() < 0.01), "{lumens} in {fluxes:?}");
        }
    }

    #[test]
    fn columns_may_be_in_any_order_and_far_positions_are_shifted() {
        let text = "kind,est_lumens,y_m,x_m,est_height_m\nLED,9000,5790030,398040,8\nLED,9000,5790070,397980,8\n";
        let all = placements(&load("far", text).expect("a valid table"));
        assert!(all[0].abs_diff_eq(vec3(40.0, 0.0, -30.0), 1e-3) && all[1].abs_diff_eq(vec3(-20.0, 0.0, -70.0), 1e-3));
    }

    #[test]
    fn arms_reach_across_rows_on_one_side_and_lamps_in_one_place_point_all_around() {
        let row = arms(&[vec2(0.0, 0.0), vec2(30.0, 0.0), vec2(60.0, 0.0)]);
        assert!(row.iter().all(|arm| arm.normalize().abs_diff_eq(Vec2::Y, 1e-6)), "{row:?}");
        let many = vec![Vec2::ONE; 500];
        let mut around: Vec<f32> = arms(&many).iter().map(|arm| arm.to_angle()).collect();
        around.sort_by(f32::total_cmp);
        assert!(around.windows(2).all(|pair| pair[1] - pair[0] > 1e-4));
    }

    #[test]
    fn errors_name_the_line_and_the_column_on_one_line() {
        for (name, row, expected) in [
            ("word", "1,two,8,9000", "line 3, column \"y_m\": \"two\" is not a number"),
            ("nan", "NaN,2,8,9000", "line 3, column \"x_m\": NaN is not between"),
            ("short", "1,2,8", "line 3, column \"est_lumens\": the row is too short"),
            ("low", "1,2,0,9000", "line 3, column \"est_height_m\": 0 is not between"),
            ("dark", "1,2,8,-1", "line 3, column \"est_lumens\": -1 is not between"),
            ("empty", "1,,8,9000", "line 3, column \"y_m\": \"\" is not a number"),
        ] {
            let SceneError(line) = load(name, &format!("{HEAD}1,2,8,9000\n{row}\n")).err().expect(name);
            assert!(line.contains(expected) && !line.contains('\n'), "{line}");
        }
        let refused = |name, text: &str| load(name, text).err().map(|error| error.0).unwrap_or_default();
        assert!(refused("header", "x_m,h\n1,2\n").ends_with("there is no column \"y_m\""));
        assert!(refused("none", HEAD).ends_with("it contains no lamps"));
        assert!(stage(Path::new("/nowhere/lamps.csv"), None).is_err());
    }
}
