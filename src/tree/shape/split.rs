//! Splits lights in two where the summed cost of both sides is least.
//!
//! Based on CK18 4.2-4.4. Differs: only cuts are tried that leave counts that fill nodes on both
//! sides, or that are in a gap. A few lights have so few of these that they are sorted instead of
//! binned.

use std::array;

use glam::Vec4;

use super::bins::{AXES, BinCut, BinGrid, Bins, MIN_EXTENT, Sides};
use super::counts::{fills_nodes, middle};
use super::group::{BuildItem, Group, GroupSums, MeanBounds, SumsOfRuns, costs};
use super::median::{KeyPartition, Selection};
use crate::tree::WIDTH;
use crate::tree::units::{BIN_TICKS, CLASSIFY_TICKS, CUT_TICKS, DIGIT_TICKS, MOVE_TICKS, SELECT_TICKS, SUM_TICKS};

/// Up to this many lights, all cuts are tried. At most five of them fill nodes on each axis, and
/// bins would miss most of these. 24 takes 10 % longer and gains nothing.
const MAX_SORTED: usize = 16;

/// Steps along an axis that sorting distinguishes. Lights in the same step keep their order.
const SORT_STEPS: f32 = (1 << 24) as f32;

/// A gap is wider than this many steps: three quarters of the extent.
const GAP_STEPS: i32 = 3 << 22;

/// Splits of fewer items are done at once. Those of more have 16 bins instead of 8. With 8 bins for
/// all, the tree of a city of 10,000 lights costs 5 % more. 16 bins from 32 lights on gain nothing over
/// this and take 2 to 5 % longer.
pub(super) const MIN_STEPPED: usize = 128;

/// Splits more than [`WIDTH`] items in two parts and sorts them, the left part first. If `halve`
/// is set, the parts are halves instead of those of least cost.
pub(super) fn split(items: &mut [BuildItem], whole: &Group, halve: bool) -> [Group; 2] {
    if items.len() < MIN_STEPPED {
        return split_at_once(items, whole, halve);
    }
    let mut split = Splitting::new();
    split.start(whole, halve);
    loop {
        if let Some(parts) = split.advance(items, whole, usize::MAX, &mut 0) {
            return parts;
        }
    }
}

/// [`split()`] of fewer than [`MIN_STEPPED`] items.
pub(super) fn split_at_once(items: &mut [BuildItem], whole: &Group, halve: bool) -> [Group; 2] {
    let parts = if halve || !has_cost(whole) {
        None
    } else if items.len() <= MAX_SORTED {
        split_sorted(items, whole)
    } else {
        split_binned(items, whole)
    };
    of_tree(whole, parts.unwrap_or_else(|| split_middle(items, &whole.means)))
}

/// The parts of a group, which belong to the same tree.
fn of_tree(whole: &Group, parts: [Group; 2]) -> [Group; 2] {
    parts.map(|part| Group { tree_sq: whole.tree_diagonal_sq(), ..part })
}

/// Splits items at the best cut between two of eight bins. `None`, and the items stay as they are, if no
/// cut is allowed.
fn split_binned(items: &mut [BuildItem], whole: &Group) -> Option<[Group; 2]> {
    let grid = BinGrid::new(whole, 8.0);
    let mut bins = Bins::<8>::EMPTY;
    bins.add_items(items, &grid);
    let cut = bins.cut(whole, &grid)?;
    let mut sides = Sides::EMPTY;
    while sides.advance_along(items, &grid, &cut) > 0 {}
    Some(sides.parts(&cut))
}

/// Whether cuts of a group differ in cost: its lights shine, and they differ in place or direction.
fn has_cost(whole: &Group) -> bool {
    let is_one_place = whole.means.position.extent().max_element() < MIN_EXTENT;
    whole.sums.per_flux() != 0.0 && (!is_one_place || whole.means.has_directions())
}

/// The longest axis of a box. `None` if the box is one point.
pub(super) fn longest_axis(means: &MeanBounds) -> Option<usize> {
    let extent = means.position.extent().to_array();
    (0..3).filter(|axis| extent[*axis] > 0.0).max_by(|a, b| extent[*a].total_cmp(&extent[*b]))
}

/// Splits near the median along the longest axis. Lights at one place keep their order.
fn split_middle(items: &mut [BuildItem], means: &MeanBounds) -> [Group; 2] {
    let left = middle(items.len());
    if let Some(axis) = longest_axis(means) {
        let order = |a: &BuildItem, b: &BuildItem| a.mean[axis].total_cmp(&b.mean[axis]);
        items.select_nth_unstable_by(left, |a, b| order(a, b).then(a.index().cmp(&b.index())));
    }
    let (left, right) = items.split_at(left);
    [Group::around(left), Group::around(right)]
}

/// A cut of sorted items.
struct SortedCut {
    /// The number of items on the left.
    cut: usize,
    /// The items' places before sorting.
    order: [u8; MAX_SORTED],
    sums: [GroupSums; 2],
}

/// Tries all allowed cuts of at most [`MAX_SORTED`] items. `None` if there are none.
#[inline(never)]
fn split_sorted(items: &mut [BuildItem], whole: &Group) -> Option<[Group; 2]> {
    let count = items.len();
    let unit = whole.cost_unit();
    let grid = BinGrid::new(whole, SORT_STEPS);
    let mut sums = [GroupSums::EMPTY; MAX_SORTED];
    let mut keys = [[0; MAX_SORTED]; AXES];
    for (place, item) in items.iter().enumerate() {
        sums[place] = item.sums();
        let mut add_keys = |first_axis: usize, steps: Vec4| {
            for (keys, step) in keys[first_axis..][..3].iter_mut().zip(steps.to_array()) {
                // The place in the last digits makes all keys of an axis different.
                keys[place] = step as i32 * MAX_SORTED as i32 + place as i32;
            }
        };
        add_keys(0, grid.places::<false>(item));
        add_keys(3, grid.places::<true>(item));
    }
    let mut cuts = [0; MAX_SORTED];
    let mut allowed = 0;
    for cut in (1..count).filter(|cut| fills_nodes(*cut) && fills_nodes(count - cut)) {
        cuts[allowed] = cut;
        allowed += 1;
    }
    let (mut least, mut best) = (f32::INFINITY, None);
    for axis in (0..AXES).filter(|axis| grid.is_cut(*axis)) {
        let order = sorted(&keys[axis], count);
        let mut lefts = [GroupSums::EMPTY; MAX_SORTED];
        let mut rights = [GroupSums::EMPTY; MAX_SORTED];
        let (mut left, mut right) = (GroupSums::EMPTY, GroupSums::EMPTY);
        for place in 0..count {
            lefts[place] = left;
            left.add(&sums[order[place] as usize % MAX_SORTED]);
        }
        for place in (0..count).rev() {
            right.add(&sums[order[place] as usize % MAX_SORTED]);
            rights[place] = right;
        }
        // Across a gap any counts are better than a node with lights of both sides.
        let step = |place: u8| keys[axis][place as usize % MAX_SORTED] / MAX_SORTED as i32;
        let gap = (1..count).find(|cut| grid.is_longest(axis) && step(order[*cut]) - step(order[*cut - 1]) > GAP_STEPS);
        cuts[allowed] = gap.unwrap_or_default();
        for pair in cuts[..allowed + usize::from(gap.is_some())].chunks(2) {
            let [a, b] = [pair[0], pair[pair.len() - 1]];
            let cost = grid.stretch[axis] * costs([&lefts[a], &rights[a], &lefts[b], &rights[b]], unit);
            for (cut, cost) in [(a, cost.x + cost.y), (b, cost.z + cost.w)] {
                if cost < least {
                    (least, best) = (cost, Some(SortedCut { cut, order, sums: [lefts[cut], rights[cut]] }));
                }
            }
        }
    }
    let SortedCut { cut, order, sums } = best?;
    let unsorted: [BuildItem; MAX_SORTED] = array::from_fn(|place| items[place.min(count - 1)]);
    items.iter_mut().zip(order).for_each(|(item, place)| *item = unsorted[place as usize % MAX_SORTED]);
    let group = |items: &[BuildItem], sums| {
        let means = if items.len() > WIDTH { MeanBounds::around(items) } else { MeanBounds::EMPTY };
        Group { count: items.len(), sums, means, ..Group::EMPTY }
    };
    let (left, right) = items.split_at(cut);
    Some([group(left, sums[0]), group(right, sums[1])])
}

/// The places of the first `count` keys, in ascending order of the keys. Counting the smaller keys
/// needs no branches.
fn sorted(keys: &[i32; MAX_SORTED], count: usize) -> [u8; MAX_SORTED] {
    let mut ranks = [0; MAX_SORTED];
    for key in &keys[..count] {
        ranks.iter_mut().zip(keys).for_each(|(rank, other)| *rank += i32::from(key < other));
    }
    let mut order = [0; MAX_SORTED];
    ranks[..count].iter().zip(0..).for_each(|(rank, place)| order[*rank as usize % MAX_SORTED] = place);
    order
}

/// The state of a split of at least [`MIN_STEPPED`] items, which can stop and go on.
pub(super) struct Splitting {
    phase: SplitPhase,
    grid: BinGrid,
    bins: SumsOfRuns<Bins<16>>,
    /// The best cut, once it is chosen.
    cut: Option<BinCut>,
    sides: Sides,
    /// The sums of the left and of the right half.
    halves: [SumsOfRuns<Group>; 2],
}

/// What a split does next.
enum SplitPhase {
    /// Sum the items in bins.
    Bin,
    /// Choose the best cut.
    Cut,
    /// Move the items to their side of the cut.
    Partition,
    /// Search the limit between both halves.
    Select(Box<Selection>, usize),
    /// Move the items to their half.
    Halve(KeyPartition),
    /// Sum both halves.
    Sum,
}

impl Splitting {
    pub fn new() -> Self {
        Self {
            phase: SplitPhase::Sum,
            grid: BinGrid::new(&Group::EMPTY, 16.0),
            bins: SumsOfRuns::new(Bins::EMPTY),
            cut: None,
            sides: Sides::EMPTY,
            halves: [SumsOfRuns::new(Group::EMPTY), SumsOfRuns::new(Group::EMPTY)],
        }
    }

    /// Starts the split of a group of at least [`MIN_STEPPED`] items. `halve` is as in
    /// [`split()`].
    pub fn start(&mut self, whole: &Group, halve: bool) {
        if halve || !has_cost(whole) {
            return self.start_middle(whole);
        }
        self.grid = BinGrid::new(whole, 16.0);
        self.bins.clear();
        self.phase = SplitPhase::Bin;
    }

    /// Starts a split near the median.
    fn start_middle(&mut self, whole: &Group) {
        self.halves.iter_mut().for_each(SumsOfRuns::clear);
        self.phase = match longest_axis(&whole.means) {
            Some(axis) => SplitPhase::Select(Box::new(Selection::new(axis, middle(whole.count))), 0),
            None => SplitPhase::Sum,
        };
    }

    /// Works on about `most` of the items of the group, or on all of them for `usize::MAX`, and adds the
    /// ticks to `ticks`. Returns both parts once the split is done.
    pub fn advance(
        &mut self,
        items: &mut [BuildItem],
        whole: &Group,
        most: usize,
        ticks: &mut usize,
    ) -> Option<[Group; 2]> {
        match &mut self.phase {
            SplitPhase::Bin => {
                let grid = &self.grid;
                *ticks += BIN_TICKS * self.bins.add_some(items, most, |bins, items| bins.add_items(items, grid));
                if self.bins.added() == items.len() {
                    self.phase = SplitPhase::Cut;
                }
            }
            SplitPhase::Cut => {
                *ticks += CUT_TICKS;
                self.cut = self.bins.get().cut(whole, &self.grid);
                if self.cut.is_some() {
                    self.sides = Sides::EMPTY;
                    self.phase = SplitPhase::Partition;
                } else {
                    self.start_middle(whole);
                }
            }
            SplitPhase::Partition => return self.partition(items, whole, most, ticks),
            SplitPhase::Select(selection, counted) => {
                let end = items.len().min(counted.saturating_add(most));
                selection.count(&items[*counted..end]);
                *ticks += SELECT_TICKS * (end - *counted);
                *counted = end;
                if end == items.len() {
                    *ticks += DIGIT_TICKS;
                    *counted = 0;
                    if let Some(limit) = selection.fix_digit() {
                        self.phase = SplitPhase::Halve(KeyPartition::new(selection.axis(), limit, items.len()));
                    }
                }
            }
            SplitPhase::Halve(partition) => {
                *ticks += MOVE_TICKS * most.min(items.len());
                if partition.advance(items, most) {
                    self.phase = SplitPhase::Sum;
                }
            }
            SplitPhase::Sum => return self.sum_halves(items, whole, most, ticks),
        }
        None
    }

    /// Moves items to their side of the cut. Returns both sides once all are there.
    fn partition(
        &mut self,
        items: &mut [BuildItem],
        whole: &Group,
        most: usize,
        ticks: &mut usize,
    ) -> Option<[Group; 2]> {
        let cut = self.cut.as_ref()?;
        loop {
            let handled = self.sides.advance_along(items, &self.grid, cut);
            *ticks += CLASSIFY_TICKS * handled.max(1);
            if handled == 0 {
                return Some(of_tree(whole, self.sides.parts(cut)));
            }
            if most < items.len() {
                return None;
            }
        }
    }

    /// Sums up items of both halves. Returns the sums once all are added.
    fn sum_halves(&mut self, items: &[BuildItem], whole: &Group, most: usize, ticks: &mut usize) -> Option<[Group; 2]> {
        let (left, right) = items.split_at(middle(whole.count));
        let [left_sums, right_sums] = &mut self.halves;
        let (half, sums) = if left_sums.added() < left.len() { (left, left_sums) } else { (right, right_sums) };
        *ticks += SUM_TICKS * sums.add_some(half, most, Group::add_items);
        let is_done = self.halves[1].added() == right.len();
        is_done.then(|| of_tree(whole, [*self.halves[0].get(), *self.halves[1].get()]))
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::cluster::Cluster;
    use crate::cluster::bounds::Aabb;
    use crate::tree::testing::Rng;

    fn random_items(rng: &mut Rng, count: usize, size: Vec3) -> Vec<BuildItem> {
        let mut item = |index| {
            let mean = rng.position(1.0) * size;
            let axis = rng.position(0.5);
            BuildItem::new(
                &Cluster { aabb: Aabb::point(mean), mean, axis, flux: rng.between(0.1, 9.0), ..Cluster::EMPTY },
                index,
            )
        };
        (0..count as u32).map(&mut item).collect()
    }

    #[test]
    fn a_stepped_split_gives_the_same_parts_and_order_as_a_split_at_once() {
        let mut rng = Rng(5);
        let mut stepped = Splitting::new();
        for count in [128, 129, 500, 4000, 70_000] {
            for size in [Vec3::ONE, Vec3::new(1.0e6, 1.0, 0.0), Vec3::ZERO] {
                for halve in [false, true] {
                    let mut whole_items = random_items(&mut rng, count, size);
                    let mut stepped_items = whole_items.clone();
                    let whole = Group::around(&whole_items);
                    let expected = split(&mut whole_items, &whole, halve);
                    stepped.start(&whole, halve);
                    let mut ticks = 0;
                    let parts = loop {
                        if let Some(parts) = stepped.advance(&mut stepped_items, &whole, 64, &mut ticks) {
                            break parts;
                        }
                    };
                    let indices = |items: &[BuildItem]| items.iter().map(BuildItem::index).collect::<Vec<_>>();
                    assert!(indices(&whole_items) == indices(&stepped_items), "{count} {size} {halve}");
                    assert_eq!(format!("{expected:?}"), format!("{parts:?}"), "{count} {size} {halve}");
                }
            }
        }
    }
}
