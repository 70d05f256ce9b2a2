use glam::{DVec3, Mat3, Vec3};

use super::cell::bins;
use super::*;
use crate::light::Light;
use crate::shading::importance::LocalShadingPoint;
use crate::shading::shading_point::ShadingPoint;
use crate::tree::{LightTree, WIDTH};

fn table(cells: usize) -> VisibilityTable {
    VisibilityTable::new(VisibilityOptions::new(1.0, cells).expect("valid options"))
}

fn cell(table: &VisibilityTable, position: Vec3, normal: Vec3) -> Cell {
    table.grid(DVec3::ZERO).cell(&ShadingPoint::surface(position, normal))
}

fn bin(toward: Vec3, edge: f32) -> usize {
    bins(&toward.to_array().map(|coordinate| [coordinate]), edge)[0] as usize
}

/// Records `count` samples of one bin in a cell.
fn record(table: &VisibilityTable, cell: &Cell, bin: usize, is_visible: bool, count: u32) {
    for _ in 0..count {
        if let Some(row) = table.row_to_record(cell) {
            table.count(row, bin, is_visible);
        }
    }
}

#[test]
fn options_out_of_range_are_refused_and_the_limits_are_accepted() {
    for edge in [0.0, -1.0, f32::NAN, f32::INFINITY, EDGES[0].next_down(), EDGES[1].next_up()] {
        let error = VisibilityOptions::new(edge, 64).unwrap_err();
        assert!(error.to_string().ends_with("; it must be from 0.01 to 10000"), "{error}");
    }
    for cells in [0, 1, 2, 3, 5, 100, MAX_CELLS + 1, 2 * MAX_CELLS, usize::MAX] {
        let refused = VisibilityOptions::new(1.0, cells).expect_err("no number of cells").to_string();
        let allowed = "; it must be a power of two, from 4 to 16384";
        assert!(refused.starts_with("the number of cells is ") && refused.ends_with(allowed), "{refused}");
    }
    assert!(EDGES.into_iter().all(|edge| VisibilityOptions::new(edge, WAYS).is_ok()));
    assert!(VisibilityOptions::new(1.0, MAX_CELLS).is_ok());
}

#[test]
fn a_cell_is_a_cube_and_a_side_and_stays_in_place_when_the_origin_moves() {
    let table = table(64);
    let at = cell(&table, Vec3::new(0.4, -0.2, 3.9), Vec3::Y);
    let same = cell(&table, Vec3::new(0.9, -0.9, 3.1), Vec3::new(0.5, 0.8, 0.2));
    assert_eq!((at.key, at.block), (same.key, same.block));
    // The block's middle is at 2, -2, 2, and that of its groups a little beside.
    assert!((at.from_center - Vec3::new(-1.6, 1.8, 1.9) + 0.1183).length() < 1.0e-6, "{}", at.from_center);
    for (position, normal, is_same_block) in [
        (Vec3::new(1.4, -0.2, 3.9), Vec3::Y, true),
        (Vec3::new(3.9, -3.9, 0.1), Vec3::Y, true),
        (Vec3::new(4.1, -0.2, 3.9), Vec3::Y, false),
        (Vec3::new(0.4, 0.2, 3.9), Vec3::Y, false),
        (Vec3::new(0.4, -4.1, 3.9), Vec3::Y, false),
        (Vec3::new(0.4, -0.2, 3.9), Vec3::NEG_Y, false),
        (Vec3::new(0.4, -0.2, 3.9), Vec3::X, false),
        (Vec3::new(0.4, -0.2, 3.9), Vec3::ZERO, false),
    ] {
        let other = cell(&table, position, normal);
        assert!(other.key != at.key && (other.block == at.block) == is_same_block, "{position} {normal}");
    }
    let world = DVec3::new(1.0e7 + 0.4, -0.2, -3.0e6 + 0.7);
    let far = |origin: DVec3| {
        let position = (world - origin).as_vec3();
        table.grid(origin).cell(&ShadingPoint::surface(position, Vec3::Y))
    };
    let near = far(world - DVec3::new(0.3, 0.2, 0.1));
    for origin in [world, world.floor(), world + DVec3::new(-870.25, 12.0, 3.3)] {
        let moved = far(origin);
        assert_eq!((moved.key, moved.block), (near.key, near.block), "{origin}");
        assert!((moved.from_center - near.from_center).length() < 1.0e-3, "{origin}");
    }
}

#[test]
fn no_position_is_out_of_bounds() {
    let table = table(64);
    for x in [0.0, 1.0e-30, 1.0e9, 3.0e38, f32::INFINITY, f32::NEG_INFINITY, f32::NAN] {
        for y in [0.0, -1.0e20, f32::NAN] {
            let cell = cell(&table, Vec3::new(x, y, 0.0), Vec3::new(y, x, 1.0));
            assert!(cell.key.tag & 3 == 3 && cell.block.tag & 3 == 3);
            let [(own, _), (block, _)] = table.buckets(&cell);
            assert!(own + WAYS <= 64 && block >= 64 && block + WAYS <= table.tags.len());
            assert!(bin(Vec3::new(x, y, -x), 1.0) < BINS);
        }
    }
}

#[test]
fn clusters_are_told_apart_by_direction_and_distance_and_scale_with_the_distance() {
    let places: Vec<Vec3> =
        (0..64).map(|i| Vec3::new(i as f32 % 4.0, (i / 4) as f32 % 4.0, (i / 16) as f32) * 2.0 - 3.1).collect();
    let mut bins: Vec<usize> = places.iter().map(|place| bin(*place, 0.5)).collect();
    assert_eq!(bins, places.iter().map(|place| bin(*place * 1.001, 0.5)).collect::<Vec<_>>());
    bins.sort_unstable();
    bins.dedup();
    // 64 random choices among 128 give 50.5 different ones, with a deviation of 2.5.
    assert!(bins.len() >= 40, "{}", bins.len());
    assert_eq!(
        bin(Vec3::new(0.1, 0.2, 0.2), 1.0),
        bin(Vec3::new(0.15, 0.24, -0.2), 1.0),
        "both are nearer than the edge"
    );
}

#[test]
fn the_bins_of_all_children_at_once_are_those_of_single_children() {
    let light = |i: i32| Light::point(Vec3::new((i * 7 % 31) as f32, (i * 5 % 17) as f32, i as f32), Vec3::ONE);
    let tree = LightTree::new((0..200).map(light).collect()).expect("valid lights");
    let shares: [u8; BINS] = std::array::from_fn(|bin| (bin % 251) as u8);
    let to_world = Mat3::from_rotation_y(0.7) * 1.3;
    let key = CellKey { hash: 0, tag: 3 };
    let cell = Cell { key, block: key, from_center: Vec3::new(0.1, -0.3, 0.2) };
    let learnt = LearntCell { shares: &shares, from_center: cell.from_center, edge: 1.0 };
    let local = LocalShadingPoint::of(&ShadingPoint::volume(Vec3::new(11.0, 2.0, 60.0)));
    for node in tree.nodes() {
        let all = learnt.shares(node, &local, &to_world);
        for slot in 0..WIDTH {
            let one = bin_of_child(node, slot, &local, &to_world, &cell, 1.0);
            assert_eq!(all[slot], ((one % 251) as f32 + 1.0) / 256.0);
        }
    }
}

#[test]
fn what_is_recorded_is_read_from_the_next_frame_on_once_the_cell_has_a_row() {
    let mut table = table(64);
    let cell = cell(&table, Vec3::ZERO, Vec3::Y);
    record(&table, &cell, 5, false, 9);
    table.end_frame();
    assert_eq!((table.cell_count(), table.cell(&cell).is_none()), (1, true), "a row without a record");
    record(&table, &cell, 5, false, 9);
    assert!(table.cell(&cell).is_none());
    table.end_frame();
    let shares = table.cell(&cell).expect("a row").shares;
    // The mean is 1 of 10. The group's block has 4 of those and nine hidden ones, and the cell again 4 of 13.
    let (mean, block, own) = (0.1, 0.4 / 13.0, 0.4 / 13.0 * 4.0 / 13.0);
    let code = |share: f64| (255.0 * share).round().max(5.0) as u8;
    assert_eq!(shares[5], code(own));
    assert!(shares.iter().enumerate().all(|(bin, share)| bin == 5 || *share == code(mean)));
    let known_of_block = &table.shares[64 * BINS..].chunks_exact(BINS).map(|shares| shares[5]).collect::<Vec<_>>();
    assert_eq!(known_of_block.iter().filter(|share| **share == code(block)).count(), 1, "{known_of_block:?}");
    table.clear();
    assert_eq!((table.cell_count(), table.cell(&cell).is_none()), (0, true));
}

#[test]
fn neighbours_begin_with_what_their_block_knows_and_are_told_apart_later() {
    let mut table = table(64);
    let cells = [0.5, 1.5, 2.5].map(|x| cell(&table, Vec3::new(x, 0.0, 0.5), Vec3::Y));
    let share = |table: &VisibilityTable, i: usize, bin: usize| table.cell(&cells[i]).map(|known| known.shares[bin]);
    for _ in 0..3 {
        record(&table, &cells[0], 9, true, 20);
        record(&table, &cells[1], 9, false, 20);
        table.end_frame();
    }
    let [seen, hidden, new] = [0, 1, 2].map(|i| share(&table, i, 9).expect("the block is known"));
    assert!(seen > 240 && hidden < 30, "{seen} {hidden}");
    assert!((120..136).contains(&new), "half of the block's records were visible: {new}");
    // A row without a record does not hide what the block knows.
    record(&table, &cells[2], 9, true, 1);
    table.end_frame();
    assert_eq!(table.cell_count(), 3);
    let claimed = share(&table, 2, 9).expect("the block is known");
    assert!((128..150).contains(&claimed), "{claimed}");
    record(&table, &cells[2], 9, true, 20);
    table.end_frame();
    assert!(share(&table, 2, 9) > Some(220));
}

#[test]
fn cells_without_rows_teach_their_block() {
    // Four rows of cells and four of blocks, for nine cells of one block.
    let mut table = table(WAYS);
    let cells: Vec<Cell> =
        (0..9).map(|i| cell(&table, Vec3::new((i % 3) as f32, 0.0, (i / 3) as f32), Vec3::Y)).collect();
    for _ in 0..6 {
        cells.iter().for_each(|cell| record(&table, cell, 3, false, 10));
        table.end_frame();
    }
    assert_eq!(table.cell_count(), WAYS);
    for cell in &cells {
        assert!(table.cell(cell).expect("the block is known").shares[3] < 10);
    }
}

#[test]
fn a_full_table_keeps_its_cells_until_they_are_idle() {
    let mut table = table(WAYS);
    let cells: Vec<Cell> = (0..9).map(|i| cell(&table, Vec3::X * i as f32, Vec3::Y)).collect();
    let has_row = |table: &VisibilityTable, cell: &Cell| table.tags[..WAYS].iter().any(|tag| tag | 1 == cell.key.tag);
    // At least one claim of a bucket succeeds in each frame.
    for _ in 0..WAYS {
        cells[..WAYS].iter().for_each(|cell| record(&table, cell, 1, false, 50));
        table.end_frame();
    }
    assert_eq!(table.cell_count(), WAYS);
    for _ in 0..20 {
        cells.iter().for_each(|cell| record(&table, cell, 1, false, 50));
        table.end_frame();
        assert!(cells.iter().enumerate().all(|(i, cell)| has_row(&table, cell) == (i < WAYS)));
    }
    // The first cell is not recorded any more, so the greatest tag of the others takes its row.
    for frame in 0..2 * MIN_IDLE {
        cells[1..].iter().for_each(|cell| record(&table, cell, 1, false, 50));
        assert_eq!(has_row(&table, &cells[0]), frame < MIN_IDLE + 1, "{frame}");
        table.end_frame();
    }
    let newcomer = (WAYS..9).filter(|i| has_row(&table, &cells[*i])).collect::<Vec<_>>();
    assert!(!has_row(&table, &cells[0]) && newcomer.len() == 1, "{newcomer:?}");
}

#[test]
fn the_order_of_records_does_not_matter() {
    let order = |step: usize| {
        let mut table = table(16);
        for frame in 0..12 {
            for i in 0..997 {
                let i = i * step % 997;
                let cell = cell(&table, Vec3::new((i % 61) as f32, 0.0, 0.0), Vec3::Y);
                record(&table, &cell, (i + frame) % BINS, i.is_multiple_of(3), 1);
            }
            table.end_frame();
        }
        (table.tags.clone(), table.idle.clone(), table.shares.clone(), table.known.clone())
    };
    let first = order(1);
    assert!(first.0[..16].iter().all(|tag| *tag != 0), "all rows of cells are taken");
    assert!([5, 101, 996].into_iter().all(|step| order(step) == first));
}
