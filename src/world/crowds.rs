//! Finds out how crowded trees are: how many lights of other instances lie between the lights of an
//! instance. That decides how far trees are opened (`opening.rs`).
//!
//! Instances of trees that may be opened are filed in grids by size and position. Every instance looks
//! for filed ones whose boxes its own box overlaps, and joins their *crowds* with its lights, or with as
//! many of them as the overlap has. It does so when it was added, and once in each *round* over all
//! slots; rounds go on while anything moves. Work and memory for each instance are bounded. Where more
//! instances are filed than one may look at, it looks at some of them, which are others in each round,
//! and counts for as many times more.
//!
//! All boxes are in world coordinates, so nothing is filed again when the origin moves.

use std::collections::HashMap;

use glam::{DVec3, Vec3};
use slotmap::SecondaryMap;

use super::opening::OpeningEdit;
use super::scene::{CROWD_UNIT, Scene};
use crate::keys::{InstanceKey, TreeKey, slot_of};
use crate::math::dice::hash;

/// Boxes count as at least this thick, relative to their diagonal: lamps above a town are among its
/// houses.
const THICKNESS: f64 = 0.02;

/// Slots that an update visits while anything moves.
pub(super) const SLOTS_PER_UPDATE: usize = 64;

/// The largest number of filed instances of one size that an instance looks at.
const MAX_LOOKED_AT: usize = 64;

/// The range of sizes: powers of two in metres. Objects of a few centimetres and less count as the
/// smallest size.
const SIZES: std::ops::Range<i32> = -4..32;

/// A cell of the grid for one size.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct GridCell {
    size: i32,
    /// Modulo 2^32. Cells that share a number are half a million kilometres apart.
    at: [i32; 3],
}

/// A box in world coordinates that is not flat.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ThickBox {
    center: DVec3,
    /// Half of the edge lengths.
    reach: DVec3,
}

/// What is known of an instance of a tree that may be opened.
#[derive(Clone, Copy, Debug)]
struct Filed {
    bounds: ThickBox,
    /// Its index in the list of its cell.
    index: u32,
    /// The lights that have joined its crowd in this round, and that did in the last one.
    crowd: [f32; 2],
    /// The round in which that was.
    round: u32,
    /// What the crowd of its tree holds of it, in units of [`CROWD_UNIT`].
    counted: u64,
    /// It is to be counted.
    is_uncounted: bool,
}

/// The instances of trees that may be opened, filed by size and position.
#[derive(Debug, Default)]
pub(super) struct Crowds {
    cells: HashMap<GridCell, Vec<InstanceKey>>,
    /// The numbers of filed instances by size, in ascending order of size. None is 0.
    sizes: Vec<(i32, u32)>,
    filed: SecondaryMap<InstanceKey, Filed>,
    /// Instances that were added since the last update.
    new: Vec<InstanceKey>,
    /// Instances whose crowds are to be counted. Empty between updates; kept for its memory.
    uncounted: Vec<InstanceKey>,
    /// The number of the round.
    round: u32,
    /// The slot that is visited next.
    next: usize,
    /// Rounds that are still to end, the present one included.
    rounds_left: u32,
}

/// The length of the cells for a size: twice the extent of the largest instance of that size, so that
/// the boxes around a position are filed in the eight cells nearest to it.
fn cell_length(size: i32) -> f64 {
    2.0 * f64::powi(2.0, size)
}

/// The numbers of a cell, from whole coordinates.
fn numbers(coordinates: DVec3) -> [i32; 3] {
    coordinates.to_array().map(|coordinate| coordinate as i64 as i32)
}

/// The eight cells of a size nearest to a position.
fn corner_cells(size: i32, position: DVec3) -> [GridCell; 8] {
    // The nearest corner between cells.
    let corner = numbers((position / cell_length(size)).round());
    std::array::from_fn(|i| GridCell { size, at: [0, 1, 2].map(|k| corner[k].wrapping_sub((i >> k & 1) as i32)) })
}

impl ThickBox {
    /// The box around the lights of an instance; `None` if they do not shine.
    fn of(key: InstanceKey, scene: &Scene) -> Option<Self> {
        let instance = scene.instances.get(key)?;
        let cluster = scene.trees[instance.tree].tree.cluster();
        let placed = instance.shown().filter(|_| cluster.flux > 0.0 && !instance.is_sky)?;
        // Without the translation, which f32 would round.
        let aabb = cluster.aabb.transformed(&placed.linear.linear, Vec3::ZERO);
        Some(Self::new(instance.placement.translation + aabb.center().as_dvec3(), aabb.extent()))
    }

    fn new(center: DVec3, extent: Vec3) -> Self {
        let half = 0.5 * extent.as_dvec3();
        Self { center, reach: half.max(DVec3::splat(THICKNESS * half.length())) }
    }

    /// The longest edge, rounded up to a power of two.
    fn size(&self) -> i32 {
        let edge = 2.0 * self.reach.max_element();
        (edge.max(f64::MIN_POSITIVE).log2().ceil() as i32).clamp(SIZES.start, SIZES.end - 1)
    }

    fn cell(&self) -> GridCell {
        let size = self.size();
        GridCell { size, at: numbers((self.center / cell_length(size)).floor()) }
    }

    /// The share of another box that lies in this one. This box counts as endless in the direction of the
    /// other's centre. So a thin string of lamps holds half of another one that crosses it, not a sliver.
    fn share_of(&self, other: &Self) -> f64 {
        let common = self.reach + other.reach - (self.center - other.center).abs();
        let one = |axis: usize| match 2.0 * other.reach[axis] {
            // A single point.
            0.0 => f64::from(u8::from(common[axis] >= 0.0)),
            edge => (common[axis] / edge).clamp(0.0, 1.0),
        };
        one(0) * one(1) * one(2)
    }
}

impl Filed {
    /// The crowd as of a round.
    fn at(&self, round: u32) -> [f32; 2] {
        match round.wrapping_sub(self.round) {
            0 => self.crowd,
            1 => [0.0, self.crowd[0]],
            _ => [0.0; 2],
        }
    }
}

impl Crowds {
    /// Files an instance with its box. Returns whether it is new or has another box.
    fn put(&mut self, key: InstanceKey, bounds: ThickBox) -> bool {
        let former = self.filed.get(key).copied();
        if former.is_some_and(|former| former.bounds == bounds) {
            return false;
        }
        if let Some(former) = &former {
            self.take_from_cell(former);
        }
        let cell = bounds.cell();
        let listed = self.cells.entry(cell).or_default();
        let index = listed.len() as u32;
        listed.push(key);
        match self.sizes.binary_search_by_key(&cell.size, |(size, _)| *size) {
            Ok(index) => self.sizes[index].1 += 1,
            Err(index) => self.sizes.insert(index, (cell.size, 1)),
        }
        let filed = former.unwrap_or(Filed {
            bounds,
            index,
            crowd: [0.0; 2],
            round: self.round,
            counted: 0,
            is_uncounted: false,
        });
        self.filed.insert(key, Filed { bounds, index, ..filed });
        true
    }

    /// Forgets an instance. Returns what its tree's crowd holds of it.
    fn take(&mut self, key: InstanceKey) -> u64 {
        let Some(filed) = self.filed.remove(key) else { return 0 };
        self.take_from_cell(&filed);
        filed.counted
    }

    fn take_from_cell(&mut self, filed: &Filed) {
        let cell = filed.bounds.cell();
        let Some(listed) = self.cells.get_mut(&cell) else { return };
        listed.swap_remove(filed.index as usize);
        match listed.get(filed.index as usize) {
            Some(moved) => self.filed[*moved].index = filed.index,
            None if listed.is_empty() => drop(self.cells.remove(&cell)),
            None => {}
        }
        if let Ok(index) = self.sizes.binary_search_by_key(&cell.size, |(size, _)| *size) {
            self.sizes[index].1 -= 1;
            if self.sizes[index].1 == 0 {
                self.sizes.remove(index);
            }
        }
    }

    /// Lets an instance with so many lights join the crowds of filed ones that its box overlaps. Those
    /// that are half as large as it, or larger: a small object within a large one is well described
    /// by its cluster.
    fn join(&mut self, key: InstanceKey, bounds: &ThickBox, lights: f64, is_new: bool) {
        // A new instance that the round will visit again joins the crowds of the last round alone.
        let is_visited = (slot_of(key) as usize) < self.next;
        let first = self.sizes.partition_point(|(size, _)| *size < bounds.size() - 1);
        for (size, _) in &self.sizes[first..] {
            let cells = corner_cells(*size, bounds.center);
            let lists = cells.map(|cell| self.cells.get(&cell).map_or(&[][..], Vec::as_slice));
            let count: usize = lists.iter().map(|list| list.len()).sum();
            for list in lists {
                let looks =
                    if count <= MAX_LOOKED_AT { list.len() } else { (list.len() * MAX_LOOKED_AT).div_ceil(count) };
                let weight = lights * list.len() as f64 / looks.max(1) as f64;
                let from = hash(slot_of(key) ^ self.round << 16) as usize;
                for look in 0..looks {
                    let other = list[(from + look) % list.len()];
                    let share = if other == key { 0.0 } else { self.filed[other].bounds.share_of(bounds) };
                    if share > 0.0 {
                        let crowd = self.filed[other].at(self.round);
                        let added = (weight * share) as f32;
                        let filed = &mut self.filed[other];
                        filed.round = self.round;
                        filed.crowd = match (is_new, is_visited) {
                            (false, _) => [crowd[0] + added, crowd[1]],
                            (true, false) => [crowd[0], crowd[1] + added],
                            (true, true) => [crowd[0] + added, crowd[1] + added],
                        };
                        if is_new && !std::mem::replace(&mut filed.is_uncounted, true) {
                            self.uncounted.push(other);
                        }
                    }
                }
            }
        }
    }
}

impl Crowds {
    /// Notes an instance that was added or whose tree changed. The next update looks at it.
    pub fn add(&mut self, key: InstanceKey, edit: &mut OpeningEdit) {
        self.new.push(key);
        let tree = edit.scene.instances[key].tree;
        if !edit.scene.trees[tree].openings.is_empty() || !edit.scene.trees[tree].tree.sides().is_empty() {
            edit.update(tree);
        }
    }

    /// [`Crowds::add`] for all instances of a tree.
    pub fn add_all(&mut self, tree: TreeKey, edit: &mut OpeningEdit) {
        for index in 0..edit.scene.trees[tree].instances.len() {
            self.add(edit.scene.trees[tree].instances[index], edit);
        }
    }

    /// Forgets an instance that leaves its tree, or whose tree may not be opened any more.
    pub fn forget(&mut self, key: InstanceKey, tree: TreeKey, edit: &mut OpeningEdit) {
        let counted = self.take(key);
        if counted != 0 {
            edit.scene.trees[tree].crowd -= counted;
            edit.update(tree);
        }
    }

    /// Looks at the instances that were added since the last update. Until a round has ended that began
    /// after the last move, looks at some others too. O(1) for each.
    pub fn look(&mut self, has_moved: bool, edit: &mut OpeningEdit) {
        let new = std::mem::take(&mut self.new);
        for key in &new {
            self.file(*key, edit);
        }
        if self.filed.is_empty() {
            (self.next, self.rounds_left) = (0, 0);
            return;
        }
        for key in new {
            self.join_others(key, true, edit);
            self.uncounted.push(key);
        }
        self.count_all(edit);
        if has_moved {
            self.restart();
        }
        for _ in 0..SLOTS_PER_UPDATE {
            if self.rounds_left == 0 {
                break;
            }
            if let Some(key) = edit.scene.instances.key_at(self.next as u32) {
                self.file(key, edit);
                self.join_others(key, false, edit);
                self.uncounted.push(key);
            }
            self.next += 1;
            if self.next >= edit.scene.instances.slot_count() {
                self.next = 0;
                self.round = self.round.wrapping_add(1);
                self.rounds_left -= 1;
            }
        }
        self.count_all(edit);
    }

    /// Lets all instances look again: what is left of this round, a whole round, and one in which the
    /// crowds of that round are counted.
    fn restart(&mut self) {
        self.rounds_left = if self.next > 0 { 3 } else { 2 };
    }

    /// Files an instance of a tree that may be opened, or forgets it.
    fn file(&mut self, key: InstanceKey, edit: &mut OpeningEdit) {
        let Some(tree) = edit.scene.instances.get(key).map(|instance| instance.tree) else { return };
        let may_open = edit.scene.trees[tree].may_open();
        match ThickBox::of(key, edit.scene).filter(|_| may_open) {
            Some(bounds) => {
                if self.put(key, bounds) {
                    // Any other instance may be in its crowd.
                    self.restart();
                }
            }
            None => self.forget(key, tree, edit),
        }
    }

    fn join_others(&mut self, key: InstanceKey, is_new: bool, edit: &OpeningEdit) {
        let Some(bounds) = ThickBox::of(key, edit.scene) else { return };
        let tree = &edit.scene.trees[edit.scene.instances[key].tree].tree;
        self.join(key, &bounds, tree.light_count() as f64, is_new);
    }

    /// Counts the crowds that are not counted yet in those of their trees, which are then opened as far
    /// as these call for.
    fn count_all(&mut self, edit: &mut OpeningEdit) {
        self.uncounted.sort_unstable();
        self.uncounted.dedup();
        let mut trees = Vec::new();
        for key in self.uncounted.drain(..) {
            let Some(filed) = self.filed.get_mut(key) else { continue };
            filed.is_uncounted = false;
            let [present, last] = filed.at(self.round);
            let crowd = (f64::from(present.max(last)) / CROWD_UNIT) as u64;
            let former = std::mem::replace(&mut filed.counted, crowd);
            if crowd != former {
                let tree = edit.scene.instances[key].tree;
                let of_tree = &mut edit.scene.trees[tree].crowd;
                *of_tree = *of_tree - former + crowd;
                trees.push(tree);
            }
        }
        trees.sort_unstable();
        trees.dedup();
        // First all of what they want, which decides how much each of them gets.
        trees.iter().for_each(|tree| edit.recount(*tree));
        trees.into_iter().for_each(|tree| edit.update(tree));
    }
}

#[cfg(test)]
mod tests {
    use glam::Mat3;

    use super::*;
    use crate::LightWorld;
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

    fn string(lamps: usize) -> Vec<Light> {
        let at = |i: usize| Vec3::new(i as f32 - 0.5 * lamps as f32, 5.0, 0.0);
        (0..lamps).map(|i| Light::point(at(i), Vec3::ONE)).collect()
    }

    fn add(world: &mut LightWorld, lights: Vec<Light>, place: Placement) -> (TreeKey, InstanceKey) {
        let tree = world.add_tree(LightTree::new(lights).expect("valid"));
        (tree, world.add_instance(tree, place, Policy::Budgeted).expect("valid"))
    }

    /// Updates until no instance is to be looked at.
    fn settle(world: &mut LightWorld) {
        world.update(FrameBudget::NONE);
        while world.crowds.rounds_left > 0 {
            world.update(FrameBudget::NONE);
        }
    }

    /// The crowd of the only instance of a tree.
    fn crowd(world: &LightWorld, tree: TreeKey) -> f64 {
        world.scene.trees[tree].crowd as f64 * CROWD_UNIT
    }

    const FAR: [DVec3; 2] = [DVec3::ZERO, DVec3::new(1.0e7, -9.0e6, 8.0e6)];

    #[test]
    fn a_crowd_counts_the_lights_of_others_within_the_box_and_the_share_of_those_across_its_border() {
        for far in FAR {
            let mut world = LightWorld::new();
            let (tree, _) = add(&mut world, lamps(300), Placement::at(far));
            let at = |x: f64| Placement::at(far + DVec3::X * x);
            let (small, _) = add(&mut world, string(7), at(10.0));
            world.update(FrameBudget::NONE);
            assert_eq!((crowd(&world, tree), crowd(&world, small)), (7.0, 0.0), "a small one in a large one");
            assert!(world.openings(tree).is_empty(), "the root has eight children");
            add(&mut world, string(7), at(20.0));
            add(&mut world, lamps(100), at(400.0));
            settle(&mut world);
            assert_eq!(crowd(&world, tree), 14.0, "those beside it do not count");
            assert!((8..=14).contains(&world.openings(tree).len()), "{}", world.openings(tree).len());
            // Half of it is across the border.
            let (beside, _) = add(&mut world, lamps(200), at(50.0));
            settle(&mut world);
            assert!((crowd(&world, tree) - 114.0).abs() < 5.0, "{}", crowd(&world, tree));
            assert!((crowd(&world, beside) - 164.0).abs() < 7.0, "{}", crowd(&world, beside));
        }
    }

    #[test]
    fn strings_that_cross_are_opened_and_strings_in_a_row_are_not() {
        let crossing =
            |i: usize| Placement { linear: Mat3::from_rotation_y(i as f32), translation: DVec3::Y * 0.05 * i as f64 };
        for far in FAR {
            let mut world = LightWorld::new();
            for i in 0..5 {
                let here = crossing(i);
                add(&mut world, string(40), Placement { translation: far + here.translation, ..here });
            }
            world.update(FrameBudget::NONE);
            assert_eq!(world.parts().len(), 5 * 40);
            // Side by side, ten metres apart or end to end.
            let mut world = LightWorld::new();
            for i in 0..20 {
                add(&mut world, string(40), Placement::at(far + DVec3::Z * 10.0 * f64::from(i)));
                add(&mut world, string(40), Placement::at(far + DVec3::new(41.0 * f64::from(i), 50.0, 0.0)));
            }
            world.update(FrameBudget::NONE);
            assert_eq!(world.parts().len(), 40);
        }
    }

    #[test]
    fn crowds_follow_instances_that_come_go_and_move() {
        let mut world = LightWorld::new();
        let (tree, _) = add(&mut world, lamps(300), Placement::IDENTITY);
        let others: Vec<_> =
            (0..70).map(|i| add(&mut world, string(2), Placement::at(DVec3::X * f64::from(i % 40))).1).collect();
        settle(&mut world);
        assert_eq!(crowd(&world, tree), 140.0);
        world.remove_instance(others[0]).expect("it lives");
        world.move_instance(others[1], Placement::at(DVec3::X * 500.0)).expect("valid");
        world.move_instance(others[2], Placement { linear: Mat3::ZERO, ..Placement::IDENTITY }).expect("valid");
        settle(&mut world);
        assert_eq!(crowd(&world, tree), 134.0);
        world.move_instance(others[1], Placement::IDENTITY).expect("valid");
        add(&mut world, string(9), Placement::IDENTITY);
        world.update(FrameBudget::NONE);
        settle(&mut world);
        assert_eq!(crowd(&world, tree), 145.0);
        for other in &others[1..] {
            world.move_instance(*other, Placement::at(DVec3::X * 500.0)).expect("valid");
        }
        settle(&mut world);
        assert_eq!((crowd(&world, tree), world.openings(tree).len()), (9.0, 8));
        // Everything was looked at, so updates do nothing more.
        world.update(FrameBudget::NONE);
        assert_eq!((world.crowds.rounds_left, world.crowds.new.len()), (0, 0));
    }

    #[test]
    fn an_instance_among_more_than_it_may_look_at_counts_for_those_that_it_leaves_out() {
        for count in [MAX_LOOKED_AT, MAX_LOOKED_AT + 1, 10 * MAX_LOOKED_AT] {
            let mut world = LightWorld::new();
            let tree = world.add_tree(LightTree::new(lamps(129)).expect("valid"));
            for i in 0..count {
                let place = Placement::at(DVec3::X * 1.0e-4 * i as f64);
                world.add_instance(tree, place, Policy::Budgeted).expect("valid");
            }
            settle(&mut world);
            let expected = (129 * count * (count - 1)) as f64;
            let ratio = crowd(&world, tree) / expected;
            assert!((0.95..1.6).contains(&ratio), "{count}: {ratio}");
            assert_eq!(world.openings(tree).len(), 129, "{count}");
        }
    }

    #[test]
    fn what_is_filed_follows_instances_that_are_hidden_removed_copied_and_replaced() {
        let mut world = LightWorld::new();
        let (tree, first) = add(&mut world, lamps(300), Placement::IDENTITY);
        let at = |i: usize| Placement::at(DVec3::X * i as f64);
        let keys: Vec<_> = (0..9).map(|i| world.add_instance(tree, at(i), Policy::Budgeted).expect("valid")).collect();
        world.update(FrameBudget::NONE);
        let check = |world: &LightWorld, filed: usize| {
            let crowds = &world.crowds;
            let counted: u32 = crowds.sizes.iter().map(|(_, count)| count).sum();
            assert_eq!((counted as usize, crowds.filed.len()), (filed, filed));
            for (cell, keys) in &crowds.cells {
                for (index, key) in keys.iter().enumerate() {
                    assert_eq!((crowds.filed[*key].bounds.cell(), crowds.filed[*key].index as usize), (*cell, index));
                }
            }
            let counted: u64 = crowds.filed.values().map(|filed| filed.counted).sum();
            assert_eq!(world.scene.trees.values().map(|entry| entry.crowd).sum::<u64>(), counted);
        };
        check(&world, 10);
        world.make_unique(keys[1]).expect("it lives");
        world.remove_instance(keys[0]).expect("it lives");
        world.move_instance(keys[2], Placement { linear: Mat3::ZERO, ..Placement::IDENTITY }).expect("valid");
        settle(&mut world);
        check(&world, 8);
        // A single light cannot be opened.
        world.replace_lights(tree, lamps(1)).expect("valid");
        settle(&mut world);
        check(&world, 1);
        world.replace_lights(tree, lamps(200)).expect("valid");
        settle(&mut world);
        check(&world, 8);
        for key in keys[1..].iter().chain([&first]) {
            world.remove_instance(*key).expect("it lives");
        }
        settle(&mut world);
        check(&world, 0);
        assert!(world.crowds.cells.is_empty());
    }
}
