//! The units of a build that is done in steps, and what each piece of work counts.
//!
//! A unit is the work for one light in one level of a binary tree. Pieces of work are counted in
//! ticks, fractions of a unit. The ticks of a piece are proportional to its typical time, so that
//! the time of a step follows from its units. All numbers were measured in release builds over 64
//! to 300,000 random lights, with one thread (2-core Intel Xeon virtual machine, 2026-11-22). A
//! tick took about 0.3 ns there, and a unit 20 ns.

/// Ticks of a unit.
pub(super) const UNIT: usize = 68;

/// The allocation of an array.
pub(super) const ALLOCATE_TICKS: usize = 150;
/// A sum over all items, for each item.
pub(super) const SUM_TICKS: usize = 8;
/// A sum in bins, for each item.
pub(super) const BIN_TICKS: usize = 18;
/// The choice of the best cut between bins.
pub(super) const CUT_TICKS: usize = 1300;
/// The classification of an item in a partition, or a swap of two.
pub(super) const CLASSIFY_TICKS: usize = 8;
/// The count of an item's digit in a selection.
pub(super) const SELECT_TICKS: usize = 8;
/// The end of a digit in a selection.
pub(super) const DIGIT_TICKS: usize = 300;
/// The classification of an item in a partition by keys.
pub(super) const MOVE_TICKS: usize = 20;
/// A step in the choice of a node's children.
pub(super) const NODE_TICKS: usize = 110;
/// The refit of a node.
pub(super) const REFIT_TICKS: usize = 740;

/// The doublings of the number of lights beyond 1024, at most 8. Pieces that write to new memory
/// take longer in large trees, whose memory is neither in the cache nor mapped yet.
fn memory_levels(lights: usize) -> usize {
    (lights.max(1).ilog2() as usize).clamp(10, 18) - 10
}

/// The copy of a light in a tree of `lights`.
pub(super) fn copy_ticks(lights: usize) -> usize {
    6 + 3 * memory_levels(lights)
}

/// The cluster of a light and its item, in a tree of `lights`.
pub(super) fn place_ticks(lights: usize) -> usize {
    80 + 12 * memory_levels(lights)
}

/// The lay-out of a node in a tree of `lights`.
pub(super) fn lay_out_ticks(lights: usize) -> usize {
    300 + 200 * memory_levels(lights)
}

/// A split of `items` that is not cut.
pub(super) fn whole_split_ticks(items: usize) -> usize {
    1260 + 22 * items
}

/// The units of a build over `lights` lights, an estimate: their number times the levels of a
/// binary tree. No lights count as one.
pub(crate) fn units_of_build(lights: usize) -> f64 {
    let n = lights.max(1) as f64;
    n * (n.log2() + 1.0)
}

/// [`units_of_build`] in whole units; 0 for no lights.
pub(super) fn build_units(lights: usize) -> usize {
    if lights == 0 { 0 } else { units_of_build(lights).ceil() as usize }
}
