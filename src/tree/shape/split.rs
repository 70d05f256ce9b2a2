//! Splits lights in two where the summed cost is least.
//!
//! Based on CK18 4.2-4.4. Differs: only cuts that leave both sides with counts that fill nodes; of few lights so few of
//! these remain that lights are sorted instead of binned.

use std::array;

use super::WIDTH;
use super::bins::{Grid, split_binned};
use super::group::{Group, Item, Means, Sums, costs};

/// Up to this many lights all cuts are tried. At most five are allowed on each axis, and bins would miss most of them.
/// 24 takes 10 % longer and gains nothing.
const FEW: usize = 16;

/// From this many lights on, there are 16 bins instead of 8. Eight for all make a city of 10,000 lights cost 5 % more;
/// 16 from 32 lights on gain nothing over this and take 2 to 5 % longer.
const MANY: usize = 128;

/// Metres below which lights are at one place: steps along the thinnest axis that is cut have a finite scale above.
const ONE_PLACE: f32 = 1.0e-24;

/// Steps along an axis that sorting tells apart; lights in the same step stay in the order at hand.
const STEPS: f32 = (1 << 24) as f32;

/// Fewest children that make a full node.
pub(crate) const FULL: usize = 6;

/// Counts that do not fill nodes, as bits: none, 2 to 5, 9 to 11, 17.
pub(crate) const SPARSE_COUNTS: u32 = {
    let (mut bits, mut count) = (1, 2_usize);
    while count < u32::BITS as usize {
        if count < FULL * count.div_ceil(WIDTH) {
            bits |= 1 << count;
        }
        count += 1;
    }
    bits
};

/// Whether nodes over this many lights can hold six or more each; one light needs no node.
pub(crate) fn fills_nodes(count: usize) -> bool {
    count >= u32::BITS as usize || SPARSE_COUNTS >> count & 1 == 0
}

/// Splits more than [`WIDTH`] items in two, the left ones first.
///
/// `halve` asks for even halves instead of the least cost.
pub(super) fn split(items: &mut [Item], whole: &Group, halve: bool) -> [Group; 2] {
    let is_dark = whole.sums.per_flux() == 0.0;
    let parts = if halve || is_dark || whole.means.extent().max_element() < ONE_PLACE {
        None
    } else if items.len() <= FEW {
        split_few(items, whole)
    } else if items.len() < MANY {
        split_binned::<8>(items, whole)
    } else {
        split_binned::<16>(items, whole)
    };
    parts.unwrap_or_else(|| split_middle(items, &whole.means))
}

/// Near the middle of the longest axis; what lies at one place, in the order at hand.
fn split_middle(items: &mut [Item], means: &Means) -> [Group; 2] {
    let extent = means.extent().to_array();
    let left = middle(items.len());
    if let Some(axis) = (0..3).filter(|axis| extent[*axis] > 0.0).max_by(|a, b| extent[*a].total_cmp(&extent[*b])) {
        items
            .select_nth_unstable_by(left, |a, b| a.mean[axis].total_cmp(&b.mean[axis]).then(a.index().cmp(&b.index())));
    }
    let (left, right) = items.split_at(left);
    [Group::around(left), Group::around(right)]
}

/// A count near half of `count` that fills nodes on both sides. Where none does, the root is at hand: one side fills
/// nodes, and the other fits into it.
pub(crate) fn middle(count: usize) -> usize {
    let nodes = count.div_ceil(WIDTH);
    match count {
        9 | 17 => 1,
        10 | 11 => count - FULL,
        _ => (nodes / 2).max(1) * (count / nodes),
    }
}

/// Items in order of an axis, for a cut.
struct Sorted {
    cut: usize,
    order: [u8; FEW],
    sums: [Sums; 2],
}

/// Tries all cuts of at most [`FEW`] items.
#[inline(never)]
fn split_few(items: &mut [Item], whole: &Group) -> Option<[Group; 2]> {
    let count = items.len();
    let per_flux = whole.sums.per_flux();
    let grid = Grid::new(&whole.means, STEPS);
    let mut sums = [Sums::EMPTY; FEW];
    let mut keys = [[0; FEW]; 3];
    for (place, item) in items.iter().enumerate() {
        sums[place] = item.sums();
        let steps = grid.places(item.mean).to_array();
        // With the place below them, all keys of an axis differ.
        (0..3).for_each(|axis| keys[axis][place] = steps[axis] as i32 * FEW as i32 + place as i32);
    }
    let mut cuts = [0; FEW];
    let mut allowed = 0;
    for cut in (1..count).filter(|cut| fills_nodes(*cut) && fills_nodes(count - cut)) {
        cuts[allowed] = cut;
        allowed += 1;
    }
    let (mut least, mut best) = (f32::INFINITY, None);
    for axis in (0..3).filter(|axis| grid.scale[*axis] > 0.0) {
        let order = sorted(&keys[axis], count);
        let mut lefts = [Sums::EMPTY; FEW];
        let mut rights = [Sums::EMPTY; FEW];
        let (mut left, mut right) = (Sums::EMPTY, Sums::EMPTY);
        for place in 0..count {
            lefts[place] = left;
            left.add(&sums[order[place] as usize % FEW]);
        }
        for place in (0..count).rev() {
            right.add(&sums[order[place] as usize % FEW]);
            rights[place] = right;
        }
        for pair in cuts[..allowed].chunks(2) {
            let [a, b] = [pair[0], pair[pair.len() - 1]];
            let cost = grid.stretch[axis] * costs([&lefts[a], &rights[a], &lefts[b], &rights[b]], per_flux);
            for (cut, cost) in [(a, cost.x + cost.y), (b, cost.z + cost.w)] {
                if cost < least {
                    (least, best) = (cost, Some(Sorted { cut, order, sums: [lefts[cut], rights[cut]] }));
                }
            }
        }
    }
    let Sorted { cut, order, sums } = best?;
    let unsorted: [Item; FEW] = array::from_fn(|place| items[place.min(count - 1)]);
    items.iter_mut().zip(order).for_each(|(item, place)| *item = unsorted[place as usize % FEW]);
    let group = |items: &[Item], sums| {
        let means = if items.len() > WIDTH { Means::around(items) } else { Means::EMPTY };
        Group { count: items.len(), sums, means }
    };
    let (left, right) = items.split_at(cut);
    Some([group(left, sums[0]), group(right, sums[1])])
}

/// Places of the first `count` keys in ascending order. By counting what is less, which has no branches.
fn sorted(keys: &[i32; FEW], count: usize) -> [u8; FEW] {
    let mut ranks = [0; FEW];
    for key in &keys[..count] {
        ranks.iter_mut().zip(keys).for_each(|(rank, other)| *rank += i32::from(key < other));
    }
    let mut order = [0; FEW];
    ranks[..count].iter().zip(0..).for_each(|(rank, place)| order[*rank as usize % FEW] = place);
    order
}
