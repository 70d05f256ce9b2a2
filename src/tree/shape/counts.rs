//! Counts of lights that fill nodes: nodes over that many lights can hold six or more children
//! each.

use crate::tree::WIDTH;

/// The fewest children of a full node.
pub(super) const FULL: usize = 6;

/// The counts that do not fill nodes, as bits: 0, 2 to 5, 9 to 11, 17. All larger counts do.
const SPARSE_COUNTS: u32 = {
    let (mut bits, mut count) = (1, 2_usize);
    while count < u32::BITS as usize {
        if count < FULL * count.div_ceil(WIDTH) {
            bits |= 1 << count;
        }
        count += 1;
    }
    bits
};

/// Whether nodes over `count` lights can hold [`FULL`] or more children each. One light needs no
/// node.
pub(super) fn fills_nodes(count: usize) -> bool {
    count >= u32::BITS as usize || SPARSE_COUNTS >> count & 1 == 0
}

/// Where to cut a group of `count` > [`WIDTH`] lights in two: the number on the left, near half,
/// such that both sides fill nodes. There are three exceptions:
///
/// - No cut of 10 or 11 fills nodes on both sides. Only a root has so few lights. The left side
///   fits into it as single lights.
/// - 31 is cut into 14 and 17, of which 17 does not fill its nodes.
pub(super) fn middle(count: usize) -> usize {
    let nodes = count.div_ceil(WIDTH);
    match count {
        9 | 17 => 1,
        10 | 11 => count - FULL,
        _ => (nodes / 2).max(1) * (count / nodes),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_count_fills_nodes_if_it_can_be_divided_into_full_ones() {
        assert!(fills_nodes(1) && !fills_nodes(0));
        for count in 2..200 {
            // Full nodes hold FULL to WIDTH lights each.
            let can_be_divided = (1..=count).any(|nodes| (nodes * FULL..=nodes * WIDTH).contains(&count));
            assert_eq!(fills_nodes(count), can_be_divided, "{count}");
        }
    }

    #[test]
    fn the_middle_fills_nodes_on_both_sides_but_for_three_counts() {
        let fills_both = |count: usize| fills_nodes(middle(count)) && fills_nodes(count - middle(count));
        let exceptions: Vec<usize> = (WIDTH + 1..5000).filter(|count| !fills_both(*count)).collect();
        assert_eq!(exceptions, [10, 11, 31]);
        assert_eq!([10, 11, 31].map(middle), [4, 5, 14]);
        // From 18 on, the smaller side has at least 30 %.
        for count in 18..5000 {
            let left = middle(count);
            assert!(10 * left.min(count - left) >= 3 * count, "{count}: {left}");
        }
    }
}
