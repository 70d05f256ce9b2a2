//! Finds large trees whose instances lie among others, such as all lamps of a town above its
//! houses. Such trees have sections (`division.rs`), which the top level sorts among the neighbours.
//!
//! Instances of large trees are filed in grids by size and position. Every instance looks for large
//! ones that its own box overlaps, and becomes one of their *neighbours*. It does so after it was
//! added. While anything moves, each update lets some instances look again. Work and memory for
//! each instance are bounded, and a world without large trees pays only for a list of added
//! instances.

use std::collections::HashMap;

use glam::{DVec3, Vec3};
use slotmap::SecondaryMap;

use super::division::DivisionEdit;
use super::overlap::{GridCell, corner_cells};
use super::scene::Scene;
use super::slot_round::SlotRound;
use crate::keys::{InstanceKey, TreeKey};

/// An instance lies among others once it has this many neighbours, and until it has none.
const NEIGHBOURS: usize = 2;

/// Another instance is a neighbour if the intersection of the boxes is at least this share of the
/// smaller box.
const MIN_SHARE: f64 = 0.25;

/// Boxes count as at least this thick, relative to their diagonal: lamps above a town are
/// among its houses.
const THICKNESS: f64 = 0.02;

/// A tree gets sections once more than this share of its instances lie among others, and keeps them
/// until the share is at most half of this.
const MIN_AMONG: f32 = 0.5;

/// Slots that an update visits while anything moves.
pub(super) const SLOTS_PER_UPDATE: usize = 64;

/// The largest number of large instances that are compared with one instance.
const MAX_LOOKED_AT: usize = 64;

/// The largest number of instances that a cell lists.
const MAX_LISTED: usize = 128;

/// A box in world coordinates that is not flat.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ThickBox {
    center: DVec3,
    /// Half of the edge lengths.
    reach: DVec3,
}

/// The state of an instance of a large tree.
#[derive(Clone, Copy, Debug)]
struct Large {
    cell: GridCell,
    bounds: ThickBox,
    is_listed: bool,
    neighbours: [Option<InstanceKey>; NEIGHBOURS],
    is_among_others: bool,
}

/// The instances of large trees, filed by size and position.
#[derive(Debug, Default)]
pub(super) struct Neighbours {
    cells: HashMap<GridCell, Vec<InstanceKey>>,
    /// The numbers of listed instances by size, in ascending order of size. None is 0.
    sizes: Vec<(i32, u32)>,
    large: SecondaryMap<InstanceKey, Large>,
    /// Instances that were added since the last update.
    new: Vec<InstanceKey>,
    /// The slots that are visited after the last change.
    round: SlotRound,
}

impl ThickBox {
    fn new(center: DVec3, extent: Vec3) -> Self {
        let half = 0.5 * extent.as_dvec3();
        Self { center, reach: half.max(DVec3::splat(THICKNESS * half.length())) }
    }

    fn cell(&self) -> GridCell {
        GridCell::around(self.center, 2.0 * self.reach.max_element())
    }

    /// The intersection of two boxes, relative to the smaller edge along each axis; 0 to 1.
    fn share(&self, other: &Self) -> f64 {
        let common = self.reach + other.reach - (self.center - other.center).abs();
        let smaller = 2.0 * self.reach.min(other.reach);
        let share = |axis: usize| match smaller[axis] {
            // A single point.
            0.0 => f64::from(u8::from(common[axis] >= 0.0)),
            smaller => (common[axis] / smaller).clamp(0.0, 1.0),
        };
        share(0) * share(1) * share(2)
    }
}

impl Neighbours {
    /// Files an instance of a large tree. Returns whether it is new or has another box.
    fn put(&mut self, key: InstanceKey, bounds: ThickBox) -> bool {
        let former = self.large.get(key).copied();
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
            listed.push(key);
            match self.sizes.binary_search_by_key(&cell.size, |(size, _)| *size) {
                Ok(index) => self.sizes[index].1 += 1,
                Err(index) => self.sizes.insert(index, (cell.size, 1)),
            }
        }
        let (neighbours, is_among_others) =
            former.map_or(([None; NEIGHBOURS], false), |former| (former.neighbours, former.is_among_others));
        self.large.insert(key, Large { cell, bounds, is_listed, neighbours, is_among_others });
        true
    }

    /// Forgets an instance. Returns whether it lay among others.
    fn take(&mut self, key: InstanceKey) -> bool {
        let Some(large) = self.large.remove(key) else { return false };
        self.take_from_cell(key, &large);
        large.is_among_others
    }

    /// O([`MAX_LISTED`]).
    fn take_from_cell(&mut self, key: InstanceKey, large: &Large) {
        let Some(listed) = self.cells.get_mut(&large.cell).filter(|_| large.is_listed) else { return };
        listed.retain(|other| *other != key);
        if listed.is_empty() {
            self.cells.remove(&large.cell);
        }
        if let Ok(index) = self.sizes.binary_search_by_key(&large.cell.size, |(size, _)| *size) {
            self.sizes[index].1 -= 1;
            if self.sizes[index].1 == 0 {
                self.sizes.remove(index);
            }
        }
    }

    /// Makes an instance a neighbour of the large ones that its box overlaps. Calls `changed` for
    /// each of them that now begins to lie among others.
    fn meet(&mut self, key: InstanceKey, bounds: &ThickBox, mut changed: impl FnMut(InstanceKey)) {
        let own = bounds.cell().size;
        let mut looked_at = 0;
        let first = self.sizes.partition_point(|(size, _)| *size < own - 1);
        for (size, _) in &self.sizes[first..] {
            for cell in corner_cells(*size, bounds.center) {
                for other in self.cells.get(&cell).into_iter().flatten() {
                    looked_at += 1;
                    if looked_at > MAX_LOOKED_AT {
                        return;
                    }
                    let Some(large) = self.large.get_mut(*other).filter(|_| *other != key) else { continue };
                    if large.neighbours.contains(&Some(key)) || large.bounds.share(bounds) < MIN_SHARE {
                        continue;
                    }
                    let Some(free) = large.neighbours.iter_mut().find(|other| other.is_none()) else { continue };
                    *free = Some(key);
                    let is_among_others = large.neighbours.iter().all(Option::is_some);
                    if is_among_others && !std::mem::replace(&mut large.is_among_others, true) {
                        changed(*other);
                    }
                }
            }
        }
    }
}

impl Neighbours {
    /// Notes an instance that was added or whose tree changed. The next update judges it.
    pub fn judge_later(&mut self, key: InstanceKey) {
        self.new.push(key);
    }

    /// Forgets an instance that leaves its tree, or whose tree is not large any more.
    pub fn forget(&mut self, key: InstanceKey, tree: TreeKey, edit: &mut DivisionEdit) {
        if self.take(key) {
            edit.scene.trees[tree].among_others -= 1;
            judge_tree(tree, edit);
        }
    }

    /// Judges the instances that were added since the last update. Until all instances have been
    /// judged after the last move, judges some others too. O(1) for each.
    pub fn judge_some(&mut self, has_moved: bool, edit: &mut DivisionEdit) {
        let new = std::mem::take(&mut self.new);
        for key in &new {
            self.file_large(*key, edit);
        }
        if self.large.is_empty() {
            self.round.end();
            return;
        }
        for key in new {
            self.meet_others(key, edit);
        }
        if has_moved {
            self.round.restart(edit.scene.instances.slot_count());
        }
        for _ in 0..SLOTS_PER_UPDATE {
            let Some(slot) = self.round.visit(edit.scene.instances.slot_count()) else { break };
            if let Some(key) = edit.scene.instances.key_at(slot) {
                self.file_large(key, edit);
                self.meet_others(key, edit);
                self.part_from_others(key, edit);
            }
        }
    }

    /// Files an instance if its tree is large, or forgets it.
    fn file_large(&mut self, key: InstanceKey, edit: &mut DivisionEdit) {
        let Some(tree) = edit.scene.instances.get(key).map(|instance| instance.tree) else { return };
        match thick_box(key, edit.scene).filter(|_| edit.scene.is_large(tree)) {
            Some(bounds) => {
                if self.put(key, bounds) {
                    // Any other instance may be its neighbour.
                    self.round.restart(edit.scene.instances.slot_count());
                }
            }
            None => self.forget(key, tree, edit),
        }
    }

    /// Makes an instance a neighbour of large ones.
    fn meet_others(&mut self, key: InstanceKey, edit: &mut DivisionEdit) {
        let Some(bounds) = thick_box(key, edit.scene) else { return };
        let mut changed = Vec::new();
        self.meet(key, &bounds, |other| changed.push(other));
        for other in changed {
            let tree = edit.scene.instances[other].tree;
            edit.scene.trees[tree].among_others += 1;
            judge_tree(tree, edit);
        }
    }

    /// Drops the neighbours of a large instance that are gone.
    fn part_from_others(&mut self, key: InstanceKey, edit: &mut DivisionEdit) {
        let Some(large) = self.large.get(key).copied() else { return };
        let is_near = |other: &InstanceKey| {
            thick_box(*other, edit.scene).is_some_and(|bounds| large.bounds.share(&bounds) >= MIN_SHARE)
        };
        let neighbours = large.neighbours.map(|other| other.filter(is_near));
        let is_among_others = large.is_among_others && neighbours.iter().any(Option::is_some);
        self.large[key] = Large { neighbours, is_among_others, ..large };
        if is_among_others != large.is_among_others {
            let tree = edit.scene.instances[key].tree;
            edit.scene.trees[tree].among_others -= 1;
            judge_tree(tree, edit);
        }
    }
}

/// The box around the lights of an instance; `None` if they do not shine.
fn thick_box(key: InstanceKey, scene: &Scene) -> Option<ThickBox> {
    let instance = scene.instances.get(key)?;
    let cluster = scene.trees[instance.tree].tree.cluster();
    let placed = instance.shown().filter(|_| cluster.flux > 0.0)?;
    // Without the translation, which f32 would round.
    let aabb = cluster.aabb.transformed(&placed.linear.linear, Vec3::ZERO);
    Some(ThickBox::new(instance.placement.translation + aabb.center().as_dvec3(), aabb.extent()))
}

/// Gives a tree sections, or takes them away, according to the share of its instances that lie among
/// others.
fn judge_tree(tree: TreeKey, edit: &mut DivisionEdit) {
    let entry = &mut edit.scene.trees[tree];
    let share = entry.among_others as f32 / entry.instances.len().max(1) as f32;
    entry.is_among_others = share > if entry.is_among_others { 0.5 * MIN_AMONG } else { MIN_AMONG };
    edit.update_sections(tree);
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

    /// Lamps over a square of 100 m.
    fn lamps(count: usize) -> Vec<Light> {
        let at = |i: usize| Vec3::new((i * 37 % 101) as f32 - 50.0, 5.0, (i * 53 % 97) as f32 - 48.0);
        (0..count).map(|i| Light::point(at(i), Vec3::ONE)).collect()
    }

    fn add(world: &mut LightWorld, lights: Vec<Light>, at: DVec3) -> (TreeKey, InstanceKey) {
        let tree = world.add_tree(LightTree::new(lights).expect("valid"));
        (tree, world.add_instance(tree, Placement::at(at), Policy::Budgeted).expect("valid"))
    }

    fn has_sections(world: &LightWorld, tree: TreeKey) -> bool {
        matches!(world.division(tree), Division::Sections(_))
    }

    /// A large tree, and two small objects at a distance along x.
    fn small_beside_large(distance: f64, far: DVec3) -> (LightWorld, TreeKey, [InstanceKey; 2]) {
        let mut world = LightWorld::new();
        let small = |i: f64| far + DVec3::new(distance, 4.0, 10.0 * i);
        let first = add(&mut world, vec![Light::point(Vec3::ZERO, Vec3::ONE)], small(0.0)).1;
        world.update(FrameBudget::NONE);
        let (tree, _) = add(&mut world, lamps(300), far);
        let second = add(&mut world, vec![Light::point(Vec3::ZERO, Vec3::ONE)], small(1.0)).1;
        world.update(FrameBudget::NONE);
        (world, tree, [first, second])
    }

    #[test]
    fn a_large_tree_among_two_others_has_sections_and_one_beside_them_has_not() {
        for far in [DVec3::ZERO, DVec3::new(1.0e7, -9.0e6, 8.0e6)] {
            let (world, tree, _) = small_beside_large(20.0, far);
            assert!(has_sections(&world, tree));
            assert_eq!(world.sums.sections, world.sections(tree).len());
            // One for each light, of which there are few.
            assert_eq!(world.parts().len(), 300 + 2);
            let (world, tree, _) = small_beside_large(120.0, far);
            assert!(!has_sections(&world, tree));
        }
    }

    #[test]
    fn trees_of_128_lights_and_one_other_object_change_nothing() {
        for (count, others, expected) in [(129, 2, true), (128, 2, false), (129, 1, false)] {
            let mut world = LightWorld::new();
            let (tree, _) = add(&mut world, lamps(count), DVec3::ZERO);
            for i in 0..others {
                add(&mut world, lamps(2), DVec3::X * f64::from(i));
            }
            world.update(FrameBudget::NONE);
            assert_eq!(has_sections(&world, tree), expected, "{count} {others}");
        }
    }

    #[test]
    fn regions_have_sections_where_they_overlap_by_a_quarter() {
        for (apart, expected) in [(60.0, true), (101.0, false)] {
            let mut world = LightWorld::new();
            let trees: Vec<_> =
                (0..5).map(|i| add(&mut world, lamps(300), DVec3::X * apart * f64::from(i)).0).collect();
            world.update(FrameBudget::NONE);
            // Those in the middle have two neighbours.
            assert!(trees[1..4].iter().all(|tree| has_sections(&world, *tree) == expected), "{apart}");
        }
    }

    #[test]
    fn sections_go_when_all_neighbours_have_gone_and_come_back_with_them() {
        let (mut world, tree, [first, second]) = small_beside_large(20.0, DVec3::ZERO);
        world.remove_instance(first).expect("it lives");
        world.update(FrameBudget::NONE);
        assert!(has_sections(&world, tree), "one neighbour keeps them");
        world.move_instance(second, Placement::at(DVec3::X * 500.0)).expect("valid");
        world.update(FrameBudget::NONE);
        assert!(!has_sections(&world, tree) && world.sums.sections == 0);
        world.move_instance(second, Placement::at(DVec3::new(1.0, 4.0, 0.0))).expect("valid");
        add(&mut world, lamps(1), DVec3::Z);
        world.update(FrameBudget::NONE);
        assert!(has_sections(&world, tree));
        // Everything was judged, so updates do nothing more.
        world.update(FrameBudget::NONE);
        assert_eq!(
            (world.divisions.neighbours.round.visit(world.slot_count()), world.divisions.neighbours.new.len()),
            (None, 0)
        );
    }

    #[test]
    fn sections_are_bounded_for_a_tree_of_many_instances() {
        let mut world = LightWorld::new();
        let tree = world.add_tree(LightTree::new(lamps(5000)).expect("valid"));
        let mut most = 0;
        for i in 0..3000 {
            let place = Placement::at(DVec3::X * 0.001 * f64::from(i));
            world.add_instance(tree, place, Policy::Budgeted).expect("valid");
            if i % 500 == 2 {
                world.update(FrameBudget::NONE);
            }
            let sections = world.sections(tree).len();
            assert_eq!(world.sums.sections, sections * (i as usize + 1));
            most = most.max(sections * (i as usize + 1));
        }
        assert!((4096..=2 * 8192 + 2048).contains(&most), "{most}");
        assert!(world.sections(tree).is_empty(), "a root of eight children is too much for each of 3,000");
    }

    #[test]
    fn what_is_filed_follows_instances_that_are_hidden_removed_copied_and_replaced() {
        let mut world = LightWorld::new();
        let (tree, first) = add(&mut world, lamps(300), DVec3::ZERO);
        let keys: Vec<_> = (0..9)
            .map(|i| world.add_instance(tree, Placement::at(DVec3::X * f64::from(i)), Policy::Budgeted).expect("valid"))
            .collect();
        world.update(FrameBudget::NONE);
        let check = |world: &LightWorld, filed: usize| {
            let neighbours = &world.divisions.neighbours;
            let listed: usize = neighbours.cells.values().map(Vec::len).sum();
            let counted: u32 = neighbours.sizes.iter().map(|(_, count)| count).sum();
            assert_eq!((listed, counted as usize, neighbours.large.len()), (filed, filed, filed));
            let among = neighbours.large.values().filter(|large| large.is_among_others).count();
            assert_eq!(world.scene.trees.values().map(|entry| entry.among_others as usize).sum::<usize>(), among);
        };
        check(&world, 10);
        world.make_unique(keys[1]).expect("it lives");
        world.remove_instance(keys[0]).expect("it lives");
        let hidden = Placement { linear: Mat3::ZERO, ..Placement::IDENTITY };
        world.move_instance(keys[2], hidden).expect("valid");
        world.update(FrameBudget::NONE);
        world.update(FrameBudget::NONE);
        check(&world, 8);
        world.replace_lights(tree, lamps(50)).expect("valid");
        world.update(FrameBudget::NONE);
        check(&world, 1);
        world.replace_lights(tree, lamps(200)).expect("valid");
        world.update(FrameBudget::NONE);
        check(&world, 8);
        for key in keys[1..].iter().chain([&first]) {
            world.remove_instance(*key).expect("it lives");
        }
        world.update(FrameBudget::NONE);
        check(&world, 0);
        assert!(world.divisions.neighbours.cells.is_empty() && world.sums.sections == 0);
    }
}
