//! A split of many lights that can stop and go on.
//!
//! It calls the functions that [`split()`](super::split::split) calls, on pieces of the items and
//! in the same order, so its parts have the same bits.

use super::bins::{BinCut, BinGrid, Bins, Sides};
use super::counts::middle;
use super::group::{BuildItem, Group, SumsOfRuns};
use super::median::{KeyPartition, Selection};
use super::split::{MIN_MANY_BINS, has_cost, longest_axis, of_tree};
use crate::tree::units::{BIN_TICKS, CLASSIFY_TICKS, CUT_TICKS, DIGIT_TICKS, MOVE_TICKS, SELECT_TICKS, SUM_TICKS};

/// Splits of fewer items are not cut.
pub(super) const MIN_STEPPED: usize = MIN_MANY_BINS;

/// Items that are binned, counted, moved or summed at once.
const PIECE: usize = 64;

/// The state of a split.
pub(super) struct SteppedSplit {
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

impl SteppedSplit {
    pub fn new() -> Self {
        Self {
            phase: SplitPhase::Sum,
            grid: BinGrid::new(&Group::EMPTY, 16.0),
            bins: SumsOfRuns::new(Bins::EMPTY, Bins::EMPTY),
            cut: None,
            sides: Sides::EMPTY,
            halves: [const { SumsOfRuns::new(Group::EMPTY, Group::EMPTY) }; 2],
        }
    }

    /// Starts the split of a group of at least [`MIN_STEPPED`] items. `halve` is as in
    /// [`split()`](super::split::split).
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

    /// Works on a piece of the items of the group, and adds its ticks to `ticks`. Returns both
    /// parts once the split is done.
    pub fn advance(&mut self, items: &mut [BuildItem], whole: &Group, ticks: &mut usize) -> Option<[Group; 2]> {
        match &mut self.phase {
            SplitPhase::Bin => {
                let grid = &self.grid;
                *ticks += BIN_TICKS * self.bins.add_some(items, PIECE, |bins, items| bins.add_items(items, grid));
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
            SplitPhase::Partition => {
                let cut = self.cut.as_mut()?;
                let handled = self.sides.advance_along(items, &self.grid, cut);
                *ticks += CLASSIFY_TICKS * handled.max(1);
                if handled == 0 {
                    [cut.groups[0].means, cut.groups[1].means] = self.sides.means();
                    return Some(of_tree(whole, cut.groups));
                }
            }
            SplitPhase::Select(selection, counted) => {
                let end = items.len().min(*counted + PIECE);
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
                *ticks += MOVE_TICKS * PIECE;
                if partition.advance(items, PIECE) {
                    self.phase = SplitPhase::Sum;
                }
            }
            SplitPhase::Sum => {
                let (left, right) = items.split_at(middle(whole.count));
                let [left_sums, right_sums] = &mut self.halves;
                let (half, sums) = if left_sums.added() < left.len() { (left, left_sums) } else { (right, right_sums) };
                *ticks += SUM_TICKS * sums.add_some(half, PIECE, Group::add_items);
                if self.halves[1].added() == right.len() {
                    return Some(of_tree(whole, [*self.halves[0].get(), *self.halves[1].get()]));
                }
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::cluster::Cluster;
    use crate::cluster::bounds::Aabb;
    use crate::tree::shape::split::split;
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
        let mut stepped = SteppedSplit::new();
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
                        if let Some(parts) = stepped.advance(&mut stepped_items, &whole, &mut ticks) {
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
