//! Splits lights in two where the summed cost of both sides is least.
//!
//! Based on CK18 4.2-4.4. Differs: only cuts are tried that leave counts that fill nodes on both
//! sides, or that are in a gap. A few lights have so few of these that they are sorted instead of
//! binned.

use std::array;

use glam::Vec4;

use super::bins::{AXES, BinGrid, MIN_EXTENT, split_binned};
use super::counts::{fills_nodes, middle};
use super::group::{BuildItem, Group, GroupSums, MeanBounds, costs};
use super::median;
use crate::tree::WIDTH;

/// Up to this many lights, all cuts are tried. At most five of them fill nodes on each axis, and
/// bins would miss most of these. 24 takes 10 % longer and gains nothing.
const MAX_SORTED: usize = 16;

/// From this many lights on, there are 16 bins instead of 8. With 8 bins for all, the tree of a
/// city of 10,000 lights costs 5 % more. 16 bins from 32 lights on gain nothing over this and take
/// 2 to 5 % longer.
pub(super) const MIN_MANY_BINS: usize = 128;

/// Steps along an axis that sorting distinguishes. Lights in the same step keep their order.
const SORT_STEPS: f32 = (1 << 24) as f32;

/// A gap is wider than this many steps: three quarters of the extent.
const GAP_STEPS: i32 = 3 << 22;

/// Splits more than [`WIDTH`] items in two parts and sorts them, the left part first. If `halve`
/// is set, the parts are halves instead of those of least cost.
pub(super) fn split(items: &mut [BuildItem], whole: &Group, halve: bool) -> [Group; 2] {
    let parts = if halve || !has_cost(whole) {
        None
    } else if items.len() <= MAX_SORTED {
        split_sorted(items, whole)
    } else if items.len() < MIN_MANY_BINS {
        split_binned::<8>(items, whole)
    } else {
        split_binned::<16>(items, whole)
    };
    let parts = parts.unwrap_or_else(|| split_middle(items, &whole.means));
    of_tree(whole, parts)
}

/// The parts of a group, which belong to the same tree.
pub(super) fn of_tree(whole: &Group, parts: [Group; 2]) -> [Group; 2] {
    parts.map(|part| Group { tree_sq: whole.tree_diagonal_sq(), ..part })
}

/// Whether cuts of a group differ in cost: its lights shine, and they differ in place or direction.
pub(super) fn has_cost(whole: &Group) -> bool {
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
        if items.len() < MIN_MANY_BINS {
            let order = |a: &BuildItem, b: &BuildItem| a.mean[axis].total_cmp(&b.mean[axis]);
            items.select_nth_unstable_by(left, |a, b| order(a, b).then(a.index().cmp(&b.index())));
        } else {
            median::divide(items, axis, left);
        }
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
