//! Finds trees whose instances lie inside one another, such as strings of lamps across a square.
//!
//! Where many clusters surround a shading point, a few splits cannot tell which of them has a light
//! near by. The lights of such trees therefore become leaves of the top level, which sorts them by
//! position whatever instance they belong to (docs/decisions.md, 49).
//!
//! Instances are filed in grids by size and position, so that the instances around a position are
//! found without a search. An instance is judged when it is added, and again a few at a time while
//! anything moves. The work of an update is bounded. All boxes are in world coordinates, so nothing
//! is filed again when the origin moves.

use std::collections::HashMap;

use glam::{DVec3, Vec3};
use slotmap::SecondaryMap;

use super::division::{DivisionEdit, may_have_light_parts};
use super::slot_round::SlotRound;
use crate::keys::{InstanceKey, TreeKey};

/// An instance is surrounded if its middle lies within this many others.
const MIN_SURROUNDING: usize = 4;

/// Boxes count as larger by this share of their diagonal, because flat ones rarely meet.
const MARGIN: f32 = 0.1;

/// A tree gets light parts when more than this share of its instances is surrounded. It is whole again
/// when the share is at most half of this.
const LIGHT_PARTS_SHARE: f32 = 0.5;

/// Instances that an update judges again while anything moves.
pub(super) const JUDGED_PER_UPDATE: usize = 4;

/// Slots that an update looks at to find them.
const SLOTS_PER_UPDATE: usize = 64;

/// The largest number of instances that are compared with one position. In a grid by size, only
/// instances that lie inside one another are this many, and then the first few decide.
const MAX_LOOKED_AT: usize = 64;

/// The range of sizes: powers of two in metres. Objects of a few centimetres and less count as the
/// smallest size.
const SIZES: std::ops::Range<i32> = -4..32;

/// The largest number of instances that a cell lists. More of them would not change a judgement, and
/// instances at one place would make it slow to file them.
const MAX_LISTED: usize = 128;

/// A cell of the grid for one size.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct GridCell {
    pub size: i32,
    /// Modulo 2^32. Cells that share a number are half a million kilometres apart.
    at: [i32; 3],
}

/// A box in world coordinates, with the margin.
#[derive(Clone, Copy, Debug, PartialEq)]
struct WorldBox {
    center: DVec3,
    /// Half of the edges.
    reach: DVec3,
}

/// What is known of an instance.
#[derive(Clone, Copy, Debug)]
struct Filed {
    cell: GridCell,
    /// The box around its lights.
    bounds: WorldBox,
    /// The cell lists it.
    is_listed: bool,
    is_surrounded: bool,
}

/// The instances of trees that may have light parts, filed by size and position.
#[derive(Debug, Default)]
pub(super) struct Overlaps {
    cells: HashMap<GridCell, Vec<(InstanceKey, WorldBox)>>,
    /// The number of listed instances of each size; empty at first.
    counts: Vec<u32>,
    filed: SecondaryMap<InstanceKey, Filed>,
    /// Instances that were added since the last update.
    new: Vec<InstanceKey>,
    /// The slots that are visited after the last change.
    round: SlotRound,
}

/// The length of the cells for a size: twice the extent of the largest instance of that size, so
/// that the boxes around a position are filed in the eight cells nearest to it.
fn cell_length(size: i32) -> f64 {
    2.0 * f64::powi(2.0, size)
}

/// The numbers of a cell, from whole coordinates.
fn numbers(coordinates: DVec3) -> [i32; 3] {
    coordinates.to_array().map(|coordinate| coordinate as i64 as i32)
}

impl WorldBox {
    /// The box of these edge lengths, before the margin.
    fn new(center: DVec3, extent: Vec3) -> Self {
        Self { center, reach: (0.5 * extent + MARGIN * extent.length()).as_dvec3() }
    }

    /// Whether a position lies in the box.
    fn is_around(&self, position: DVec3) -> bool {
        (position - self.center).abs().cmple(self.reach).all()
    }

    fn cell(&self) -> GridCell {
        GridCell::around(self.center, 2.0 * self.reach.max_element())
    }
}

impl GridCell {
    /// The cell of a box with this longest edge. Its size is the edge, rounded up to a power of two.
    pub fn around(center: DVec3, edge: f64) -> Self {
        let size = (edge.max(f64::MIN_POSITIVE).log2().ceil() as i32).clamp(SIZES.start, SIZES.end - 1);
        Self { size, at: numbers((center / cell_length(size)).floor()) }
    }
}

/// The eight cells of a size nearest to a position.
pub(super) fn corner_cells(size: i32, position: DVec3) -> impl Iterator<Item = GridCell> {
    // The nearest corner between cells.
    let corner = numbers((position / cell_length(size)).round());
    (0..8).map(move |i| GridCell { size, at: [0, 1, 2].map(|k| corner[k].wrapping_sub(i >> k & 1)) })
}

fn index_of(size: i32) -> usize {
    (size - SIZES.start) as usize
}

impl Overlaps {
    /// Files an instance with the box around its lights, in place of what was filed before. Returns
    /// whether that had another box.
    fn put(&mut self, key: InstanceKey, bounds: WorldBox) -> bool {
        let former = self.filed.get(key).copied();
        if former.is_some_and(|former| former.bounds == bounds) {
            return false;
        }
        if let Some(former) = &former {
            self.take_from_cell(key, former);
        }
        let cell = bounds.cell();
        let listed = self.cells.entry(cell).or_default();
        let is_listed = listed.len() < MAX_LISTED;
        if is_listed {
            listed.push((key, bounds));
            self.counts.resize(SIZES.len(), 0);
            self.counts[index_of(cell.size)] += 1;
        }
        let is_surrounded = former.is_some_and(|former| former.is_surrounded);
        self.filed.insert(key, Filed { cell, bounds, is_listed, is_surrounded });
        former.is_some()
    }

    /// Forgets an instance. Returns whether it was surrounded.
    fn take(&mut self, key: InstanceKey) -> bool {
        let Some(filed) = self.filed.remove(key) else { return false };
        self.take_from_cell(key, &filed);
        filed.is_surrounded
    }

    /// O([`MAX_LISTED`]).
    fn take_from_cell(&mut self, key: InstanceKey, filed: &Filed) {
        let Some(listed) = self.cells.get_mut(&filed.cell).filter(|_| filed.is_listed) else { return };
        self.counts[index_of(filed.cell.size)] -= 1;
        listed.retain(|(other, _)| *other != key);
        if listed.is_empty() {
            self.cells.remove(&filed.cell);
        }
    }

    /// Whether the middle of a filed instance lies within enough others of about its size: a small
    /// object within large ones is well described by its cluster.
    fn is_surrounded(&self, key: InstanceKey) -> bool {
        let Some(Filed { cell, bounds, .. }) = self.filed.get(key) else { return false };
        let middle = bounds.center;
        let (mut surrounding, mut looked_at) = (0, 0);
        let has_any = |size: &i32| self.counts.get(index_of(*size)).is_some_and(|count| *count > 0);
        for size in (cell.size - 1..=cell.size + 1).filter(has_any) {
            for cell in corner_cells(size, middle) {
                for (other, bounds) in self.cells.get(&cell).into_iter().flatten() {
                    looked_at += 1;
                    surrounding += usize::from(*other != key && bounds.is_around(middle));
                    if surrounding >= MIN_SURROUNDING || looked_at >= MAX_LOOKED_AT {
                        return surrounding >= MIN_SURROUNDING;
                    }
                }
            }
        }
        false
    }
}

impl Overlaps {
    /// Files an instance of a tree that may have light parts. The next update judges it.
    pub fn file_new(&mut self, key: InstanceKey, edit: &mut DivisionEdit) {
        if self.file(key, edit) {
            self.new.push(key);
        }
    }

    /// Files an instance, or forgets it if it is hidden or its tree may not have light parts.
    /// Returns whether it is filed.
    fn file(&mut self, key: InstanceKey, edit: &mut DivisionEdit) -> bool {
        let Some(instance) = edit.scene.instances.get(key) else { return false };
        let tree = &edit.scene.trees[instance.tree].tree;
        let (cluster, count) = (tree.cluster(), tree.light_count());
        let may_have_light_parts = may_have_light_parts(count) && tree.sides().is_empty() && cluster.flux > 0.0;
        let placed = instance.shown().filter(|_| may_have_light_parts);
        let Some(placed) = placed else {
            self.forget(key, instance.tree, edit);
            return false;
        };
        // Without the translation, which f32 would round.
        let aabb = cluster.aabb.transformed(&placed.linear.linear, Vec3::ZERO);
        let center = instance.placement.translation + aabb.center().as_dvec3();
        if self.put(key, WorldBox::new(center, aabb.extent())) {
            // What was judged by its former box is judged again.
            self.round.restart(edit.scene.instances.slot_count());
        }
        true
    }

    /// Forgets an instance that leaves its tree, or whose tree may not have light parts any more.
    pub fn forget(&mut self, key: InstanceKey, tree: TreeKey, edit: &mut DivisionEdit) {
        if self.take(key) {
            edit.scene.trees[tree].surrounded -= 1;
            judge_light_parts(tree, edit);
        }
    }

    /// Judges the instances that were added since the last update, and some others if anything has
    /// moved since all of them were judged. O(1) for each.
    pub fn judge_some(&mut self, has_moved: bool, edit: &mut DivisionEdit) {
        for key in std::mem::take(&mut self.new) {
            self.judge(key, edit);
        }
        if has_moved {
            self.round.restart(edit.scene.instances.slot_count());
        }
        let mut judged = 0;
        for _ in 0..SLOTS_PER_UPDATE {
            if judged == JUDGED_PER_UPDATE {
                break;
            }
            let Some(slot) = self.round.visit(edit.scene.instances.slot_count()) else { break };
            if let Some(key) = edit.scene.instances.key_at(slot) {
                judged += usize::from(self.judge(key, edit));
            }
        }
    }

    /// Judges one instance. Returns whether its tree may have light parts.
    fn judge(&mut self, key: InstanceKey, edit: &mut DivisionEdit) -> bool {
        if !self.file(key, edit) {
            return false;
        }
        let is_surrounded = self.is_surrounded(key);
        let filed = &mut self.filed[key];
        if std::mem::replace(&mut filed.is_surrounded, is_surrounded) != is_surrounded {
            let tree = edit.scene.instances[key].tree;
            let surrounded = &mut edit.scene.trees[tree].surrounded;
            if is_surrounded {
                *surrounded += 1
            } else {
                *surrounded -= 1
            }
            judge_light_parts(tree, edit);
        }
        true
    }
}

/// Gives a tree light parts, or makes it whole, according to the share of its instances that are
/// surrounded.
fn judge_light_parts(tree: TreeKey, edit: &mut DivisionEdit) {
    let entry = &edit.scene.trees[tree];
    let share = entry.surrounded as f32 / entry.instances.len().max(1) as f32;
    let least = if entry.has_light_parts { 0.5 * LIGHT_PARTS_SHARE } else { LIGHT_PARTS_SHARE };
    edit.set_light_parts(tree, share > least);
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Mat3};

    use super::*;
    use crate::LightWorld;
    use crate::instance::part::Division;
    use crate::instance::placement::Placement;
    use crate::light::Light;
    use crate::policy::Policy;
    use crate::scheduler::FrameBudget;
    use crate::tree::LightTree;
    use crate::world::division::MAX_LIGHT_PARTS;

    fn string(lamps: usize) -> Vec<Light> {
        (0..lamps).map(|i| Light::point(Vec3::X * (i as f32 - 0.5 * lamps as f32), Vec3::ONE)).collect()
    }

    /// A string through the origin at an angle.
    fn crossing(angle: f32) -> Placement {
        Placement { linear: Mat3::from_rotation_y(angle), translation: DVec3::Y * 0.05 * f64::from(angle) }
    }

    /// A world of one instance per tree.
    fn world_of(placements: impl IntoIterator<Item = Placement>, lamps: usize) -> (LightWorld, Vec<InstanceKey>) {
        let mut world = LightWorld::new();
        let mut add = |placement| {
            let tree = world.add_tree(LightTree::new(string(lamps)).expect("valid"));
            world.add_instance(tree, placement, Policy::Budgeted).expect("valid")
        };
        let keys = placements.into_iter().map(&mut add).collect();
        (world, keys)
    }

    fn light_parts_count(world: &LightWorld) -> usize {
        world.trees().filter(|tree| world.division(*tree) == Division::Lights).count()
    }

    #[test]
    fn strings_that_cross_have_light_parts_after_the_next_update_and_strings_in_a_row_are_not() {
        let (mut world, _) = world_of((0..5).map(|i| crossing(i as f32)), 40);
        assert_eq!(light_parts_count(&world), 0);
        world.update(FrameBudget::NONE);
        assert_eq!(light_parts_count(&world), 5);
        assert_eq!(world.parts().len(), 5 * 40);
        // Side by side, ten metres apart or end to end.
        let row = (0..20).map(|i| Placement::at(DVec3::new(0.0, 0.0, 10.0 * f64::from(i))));
        let chain = (0..20).map(|i| Placement::at(DVec3::new(41.0 * f64::from(i), 50.0, 0.0)));
        let (mut world, _) = world_of(row.chain(chain), 40);
        world.update(FrameBudget::NONE);
        assert_eq!((light_parts_count(&world), world.parts().len()), (0, 40));
    }

    #[test]
    fn overlaps_are_found_ten_thousand_kilometres_from_zero_as_at_zero() {
        let far = DVec3::new(1.0e7, -9.0e6, 8.0e6);
        let strings = |apart: f64| {
            let at = |i: u32| {
                let here = crossing(i as f32);
                let translation = far + here.translation + DVec3::Z * apart * f64::from(i);
                Placement { translation, ..here }
            };
            // The origin stays at zero, from where f32 resolves a metre.
            let (mut world, _) = world_of((0..5).map(at), 40);
            world.update(FrameBudget::NONE);
            light_parts_count(&world)
        };
        assert_eq!(strings(0.0), 5);
        assert_eq!(strings(60.0), 0);
    }

    #[test]
    fn four_strings_more_than_128_lights_and_small_objects_in_large_ones_stay_whole() {
        let (mut world, _) = world_of((0..4).map(|i| crossing(i as f32)), 40);
        world.update(FrameBudget::NONE);
        assert_eq!(light_parts_count(&world), 0);
        let (mut world, _) = world_of((0..5).map(|i| crossing(i as f32)), MAX_LIGHT_PARTS + 1);
        world.update(FrameBudget::NONE);
        assert_eq!(light_parts_count(&world), 0);
        let (mut world, _) = world_of((0..5).map(|i| crossing(i as f32)), MAX_LIGHT_PARTS);
        let lantern = world.add_tree(LightTree::new(string(2)).expect("valid"));
        world.add_instance(lantern, Placement::IDENTITY, Policy::Budgeted).expect("valid");
        world.update(FrameBudget::NONE);
        assert_eq!((light_parts_count(&world), world.division(lantern)), (5, Division::Whole));
    }

    #[test]
    fn strings_that_move_apart_are_whole_after_some_updates_of_bounded_work() {
        let (mut world, keys) = world_of((0..40).map(|i| crossing(0.01 * i as f32)), 20);
        world.update(FrameBudget::NONE);
        assert_eq!(light_parts_count(&world), 40);
        for (key, i) in keys.iter().zip(0..) {
            world.move_instance(*key, Placement::at(DVec3::Z * 100.0 * f64::from(i))).expect("valid");
        }
        let mut before = light_parts_count(&world);
        // Once for the moves, and once more because those that came first met the former places of
        // others. Slot 0 is never in use.
        for _ in 0..21 {
            world.update(FrameBudget::NONE);
            let now = light_parts_count(&world);
            assert!(before - now <= JUDGED_PER_UPDATE, "{before} {now}");
            before = now;
        }
        assert_eq!(before, 0);
        // Everything was judged, so updates do nothing more.
        assert_eq!(world.divisions.overlaps.round.visit(world.slot_count()), None);
        assert!(world.divisions.overlaps.new.is_empty());
    }

    #[test]
    fn instances_at_one_place_far_away_or_without_extent_cost_no_more_than_others() {
        let (mut world, keys) = world_of((0..1000).map(|_| crossing(0.0)), 3);
        world.update(FrameBudget::NONE);
        assert!(world.divisions.overlaps.cells.values().all(|listed| listed.len() <= MAX_LISTED));
        assert_eq!(light_parts_count(&world), 1000);
        let point = world.add_tree(LightTree::new(vec![Light::point(Vec3::ZERO, Vec3::ONE); 2]).expect("valid"));
        for i in 0..1000 {
            let translation = DVec3::new(f64::from(i), -1.0e9 + f64::from(i), 1.0e9);
            world.add_instance(point, Placement::at(translation), Policy::Budgeted).expect("in range");
            let scale = Mat3::from_diagonal(Vec3::splat(if i % 2 == 0 { 1.0e-8 } else { 1.0e8 }));
            world.move_instance(keys[i as usize], Placement { linear: scale, translation }).expect("in range");
        }
        for _ in 0..1100 {
            world.update(FrameBudget::NONE);
        }
        assert!(world.divisions.overlaps.cells.values().all(|listed| listed.len() <= MAX_LISTED));
        for key in keys {
            world.remove_instance(key).expect("it lives");
        }
        assert_eq!(world.divisions.overlaps.filed.len(), 1000);
    }

    #[test]
    fn what_is_filed_follows_instances_that_are_hidden_removed_copied_and_replaced() {
        let (mut world, keys) = world_of((0..8).map(|i| crossing(i as f32)), 10);
        world.update(FrameBudget::NONE);
        let filed = |world: &LightWorld| {
            let in_cells: usize = world.divisions.overlaps.cells.values().map(Vec::len).sum();
            let counted: u32 = world.divisions.overlaps.counts.iter().sum();
            let listed = world.divisions.overlaps.filed.values().filter(|filed| filed.is_listed).count();
            assert_eq!((in_cells, counted as usize), (listed, listed));
            let surrounded = world.divisions.overlaps.filed.values().filter(|filed| filed.is_surrounded).count();
            assert_eq!(world.scene.trees.values().map(|entry| entry.surrounded as usize).sum::<usize>(), surrounded);
            in_cells
        };
        assert_eq!(filed(&world), 8);
        world.remove_instance(keys[0]).expect("it lives");
        assert_eq!(filed(&world), 7);
        let shared = world.instance_tree(keys[1]).expect("it lives");
        let second = world.add_instance(shared, crossing(0.5), Policy::Budgeted).expect("valid");
        world.make_unique(second).expect("it lives");
        world.update(FrameBudget::NONE);
        assert_eq!((filed(&world), light_parts_count(&world)), (8, 8));
        let round = world.divisions.overlaps.round;
        world.set_origin(DVec3::new(1.0e4, 0.0, 7.0)).expect("near");
        // Nothing is filed again.
        assert_eq!((filed(&world), world.divisions.overlaps.round), (8, round));
        world.replace_lights(shared, string(1)).expect("valid");
        world.move_instance(keys[2], Placement { linear: Mat3::ZERO, ..Placement::IDENTITY }).expect("valid");
        for _ in 0..4 {
            world.update(FrameBudget::NONE);
        }
        assert_eq!((filed(&world), light_parts_count(&world)), (6, 6));
        keys[2..].iter().for_each(|key| world.remove_instance(*key).expect("it lives"));
        world.update(FrameBudget::NONE);
        world.update(FrameBudget::NONE);
        assert_eq!((filed(&world), light_parts_count(&world)), (1, 0));
        assert_eq!(world.divisions.overlaps.cells.len(), 1);
    }
}
