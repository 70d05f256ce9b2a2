//! Groups of lights, what is summed over them, and their costs.
//!
//! The cost is that of `tree/cost.rs`. All sums are in f32, and four groups are costed at once.

use glam::{Mat4, Vec3, Vec4};

use crate::cluster::{Aabb, Cluster};
use crate::math::parallel::map_chunks;
use crate::tree::cost::{build_cost, size};

/// Fluxes are divided by 2^30: 2^31 lights of the largest flux (1e34 lm) add up to 2e34, and the
/// least flux (1e-18 lm) stays a normal number.
const FLUX_UNIT: f32 = 1.0 / (1 << 30) as f32;

/// Directions are not cut if they differ by less than this along every axis, in units of the
/// sphere's radius.
const MIN_DIRECTION_EXTENT: f32 = 0.2;

/// Added to the size of each part where directions differ, as a share of the squared diagonal of
/// the group that is split. Where the lights lie close together, their directions then decide.
const MIN_SIZE: f32 = 0.03 * 0.03;

/// Lights that one thread sums in a row. Sums over more lights are sums of such runs, in order,
/// with threads or without.
const RUN: usize = 1 << 14;

/// Up to this many lights are a single run nevertheless: threads have other groups to work on.
const MAX_SINGLE_RUN: usize = 1 << 16;

/// The data of one light (in a top level, of one subtree) in a build. 64 bytes, a cache line.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub(crate) struct BuildItem {
    min: Vec4,
    /// The fourth lane holds the bits of the index; no arithmetic touches it, only comparisons.
    max: Vec4,
    /// Mean position. The fourth lane holds 1 / flux, or 0 for a dark light.
    pub(super) mean: Vec4,
    /// Flux times mean direction, then flux, in units of [`FLUX_UNIT`].
    power: Vec4,
}

impl BuildItem {
    /// Takes the box, flux, mean and axis of a cluster.
    pub fn new(cluster: &Cluster, index: u32) -> Self {
        let flux = cluster.flux * FLUX_UNIT;
        Self {
            min: cluster.aabb.min.extend(0.0),
            max: cluster.aabb.max.extend(f32::from_bits(index)),
            mean: cluster.mean.extend(per_flux(flux)),
            power: (cluster.axis * flux).extend(flux),
        }
    }

    /// The index that was given.
    pub fn index(&self) -> u32 {
        self.max.w.to_bits()
    }

    pub fn aabb(&self) -> Aabb {
        Aabb { min: self.min.truncate(), max: self.max.truncate() }
    }

    /// The mean position.
    pub fn position(&self) -> Vec3 {
        self.mean.truncate()
    }

    /// The mean direction of emission. The fourth lane has no meaning.
    #[inline(always)]
    pub(super) fn direction(&self) -> Vec4 {
        self.power * self.mean.w
    }

    pub(super) fn sums(&self) -> GroupSums {
        GroupSums { min: self.min, max: self.max, power: self.power }
    }
}

/// The inverse of a flux; 0 for a flux of 0.
fn per_flux(flux: f32) -> f32 {
    if flux >= f32::MIN_POSITIVE { flux.recip() } else { 0.0 }
}

/// The box and the summed flux of a group. The fourth lane of the corners has no meaning.
#[derive(Clone, Copy, Debug)]
pub(super) struct GroupSums {
    min: Vec4,
    max: Vec4,
    power: Vec4,
}

impl GroupSums {
    pub const EMPTY: Self = Self { min: Vec4::INFINITY, max: Vec4::NEG_INFINITY, power: Vec4::ZERO };

    #[inline(always)]
    pub fn add(&mut self, other: &Self) {
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
        self.power += other.power;
    }

    /// The squared diagonal of the box.
    pub fn diagonal_sq(&self) -> f32 {
        (self.max - self.min).max(Vec4::ZERO).truncate().length_squared()
    }

    /// The factor that makes this group's flux 1. 0 for a dark group.
    pub fn per_flux(&self) -> f32 {
        per_flux(self.power.w)
    }
}

/// What the costs of the parts of a group are relative to.
#[derive(Clone, Copy)]
pub(super) struct CostUnit {
    /// The factor that makes the group's flux 1.
    pub per_flux: f32,
    /// Added to the size of each part, in square metres.
    pub min_size: f32,
}

/// Costs of four groups.
#[inline(always)]
pub(super) fn costs(groups: [&GroupSums; 4], unit: CostUnit) -> Vec4 {
    let lanes = |[a, b, c, d]: [Vec4; 4]| Mat4::from_cols(a, b, c, d).transpose();
    // Empty boxes are inverted.
    let edges = lanes(groups.map(|group| (group.max - group.min).max(Vec4::ZERO)));
    let powers = lanes(groups.map(|group| group.power * unit.per_flux));
    let size = size([edges.x_axis, edges.y_axis, edges.z_axis]) + Vec4::splat(unit.min_size);
    build_cost(size, [powers.x_axis, powers.y_axis, powers.z_axis], powers.w_axis)
}

/// A box of positions or of directions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub min: Vec4,
    pub max: Vec4,
}

impl Bounds {
    pub const EMPTY: Self = Self { min: Vec4::INFINITY, max: Vec4::NEG_INFINITY };

    /// Widens the box to contain a point. `outside` is 0 in all lanes, or infinity in all lanes for
    /// a point that is left out.
    #[inline(always)]
    pub fn add(&mut self, point: Vec4, outside: Vec4) {
        self.min = self.min.min(point + outside);
        self.max = self.max.max(point - outside);
    }

    pub fn union(&self, other: &Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    pub fn extent(&self) -> Vec3 {
        (self.max - self.min).truncate()
    }
}

/// The boxes of the mean positions and of the mean directions of some items.
#[derive(Clone, Copy, Debug)]
pub(super) struct MeanBounds {
    pub position: Bounds,
    pub direction: Bounds,
}

impl MeanBounds {
    pub const EMPTY: Self = Self { position: Bounds::EMPTY, direction: Bounds::EMPTY };

    pub fn around(items: &[BuildItem]) -> Self {
        Self::EMPTY.with(items)
    }

    /// These bounds, widened to contain some items.
    #[inline(always)]
    fn with(mut self, items: &[BuildItem]) -> Self {
        items.iter().for_each(|item| self.add(item, Vec4::ZERO));
        self
    }

    /// Whether the directions differ enough to divide the items by them.
    pub fn has_directions(&self) -> bool {
        self.direction.extent().max_element() >= MIN_DIRECTION_EXTENT
    }

    /// Widens the boxes to contain an item. `outside` is as in [`Bounds::add`].
    #[inline(always)]
    pub fn add(&mut self, item: &BuildItem, outside: Vec4) {
        self.position.add(item.mean, outside);
        self.direction.add(item.direction(), outside);
    }

    pub fn union(&self, other: &Self) -> Self {
        Self { position: self.position.union(&other.position), direction: self.direction.union(&other.direction) }
    }
}

/// The number, the sums and the mean positions of consecutive items.
#[derive(Clone, Copy, Debug)]
pub(super) struct Group {
    pub count: usize,
    pub sums: GroupSums,
    /// The squared diagonal of the box of the whole tree; 0 in the group of the whole tree itself.
    pub tree_sq: f32,
    /// Left empty for groups that fit into one node: no split needs it.
    pub means: MeanBounds,
    /// The group is cut along its longest axis alone.
    pub is_cut_along_longest: bool,
}

impl Group {
    pub const EMPTY: Self =
        Self { count: 0, sums: GroupSums::EMPTY, tree_sq: 0.0, means: MeanBounds::EMPTY, is_cut_along_longest: false };

    pub fn around(items: &[BuildItem]) -> Self {
        let mut sums = SumsOfRuns::new(Self::EMPTY);
        sums.add_some(items, usize::MAX, Self::add_items);
        *sums.get()
    }

    /// What the costs of this group's parts are relative to.
    pub fn cost_unit(&self) -> CostUnit {
        let min_size = match MIN_SIZE * self.sums.diagonal_sq() {
            _ if !self.means.has_directions() => 0.0,
            // Lights at one place have no size but this one.
            0.0 => 1.0,
            size => size,
        };
        CostUnit { per_flux: self.sums.per_flux(), min_size }
    }

    /// The squared diagonal of the box of the whole tree.
    pub fn tree_diagonal_sq(&self) -> f32 {
        self.tree_sq.max(self.sums.diagonal_sq())
    }

    /// Costs of two parts of this group.
    pub fn costs(&self, [a, b]: [&Self; 2]) -> [f32; 2] {
        let four = [&a.sums, &b.sums, &GroupSums::EMPTY, &GroupSums::EMPTY];
        let [a, b, ..] = costs(four, self.cost_unit()).to_array();
        [a, b]
    }
}

/// Sums over consecutive items, which may be added in several pieces.
pub(super) trait ItemSums: Clone + Send + Sync {
    /// Empties the sums.
    fn clear(&mut self);
    /// Adds the sums of other items.
    fn add(&mut self, other: &Self);
}

impl Group {
    /// Adds some items.
    pub fn add_items(&mut self, items: &[BuildItem]) {
        self.count += items.len();
        let mut sums = self.sums;
        items.iter().for_each(|item| sums.add(&item.sums()));
        self.sums = sums;
        self.means = self.means.with(items);
    }
}

impl ItemSums for Group {
    fn clear(&mut self) {
        *self = Self::EMPTY;
    }

    fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.sums.add(&other.sums);
        self.means = self.means.union(&other.means);
    }
}

/// Sums over many items that are added in pieces, or at once by several threads. Sums over more than
/// [`MAX_SINGLE_RUN`] items are sums of runs, in order, so they have the same bits.
pub(super) struct SumsOfRuns<T> {
    /// The sums of all complete runs; the only sums if all items are one run.
    all: T,
    /// The sums of the present run.
    run: T,
    /// The number of items that have been added.
    added: usize,
}

impl Default for SumsOfRuns<Group> {
    fn default() -> Self {
        Self::new(Group::EMPTY)
    }
}

impl<T: ItemSums> SumsOfRuns<T> {
    /// No items.
    pub fn new(empty: T) -> Self {
        Self { all: empty.clone(), run: empty, added: 0 }
    }

    /// Forgets all items.
    pub fn clear(&mut self) {
        // The present run is empty once its items have been added.
        self.all.clear();
        self.added = 0;
    }

    /// Adds up to `most` more of `items`, which are all items of the sums, with `add_items`. Returns
    /// their number, 0 once all have been added.
    pub fn add_some(
        &mut self,
        items: &[BuildItem],
        most: usize,
        add_items: impl Fn(&mut T, &[BuildItem]) + Sync,
    ) -> usize {
        let first = self.added;
        let mut end = items.len().min(first.saturating_add(most));
        if items.len() <= MAX_SINGLE_RUN {
            add_items(&mut self.all, &items[first..end]);
        } else if end - first == items.len() {
            self.add_runs(items, add_items);
        } else {
            let run_end = items.len().min((first / RUN + 1) * RUN);
            end = end.min(run_end);
            add_items(&mut self.run, &items[first..end]);
            if end == run_end {
                self.all.add(&self.run);
                self.run.clear();
            }
        }
        self.added = end;
        end - first
    }

    /// Adds all items, each run on some thread.
    fn add_runs(&mut self, items: &[BuildItem], add_items: impl Fn(&mut T, &[BuildItem]) + Sync) {
        let empty = &self.run;
        let sums_of = |run: &[BuildItem]| {
            let mut sums = empty.clone();
            add_items(&mut sums, run);
            sums
        };
        map_chunks(items, RUN, sums_of).iter().for_each(|run| self.all.add(run));
    }

    /// The number of items that have been added.
    pub fn added(&self) -> usize {
        self.added
    }

    /// The sums, once all items have been added.
    pub fn get(&self) -> &T {
        &self.all
    }
}
