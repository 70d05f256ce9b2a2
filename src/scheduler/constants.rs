//! All constants of the scheduler's decisions, in one place. `docs/math.md` has the formulas that they belong to, and
//! what each rule adds.

use std::time::Duration;

/// What a frame pays in never raises the balance of the ledger above this or above its own budget,
/// so only frames with shorter budgets save up. It is enough for a slice.
pub(super) const LEDGER_CAPACITY: Duration = Duration::from_micros(20);

/// The length of a slice of the long build, unless less time is left of the frame. The clock
/// is read after each slice, so this bounds how far a frame exceeds its budget.
pub(super) const SLICE: Duration = Duration::from_micros(20);

/// The least units of a slice, about a microsecond: less is not worth the reading of a clock.
pub(super) const MIN_SLICE_UNITS: usize = 32;

/// A job is charged at most this many times the time that it was predicted to take.
pub(super) const MAX_CHARGE_RATIO: f64 = 4.0;

/// Values that differ by more than this many doublings from the greatest one of late count as
/// equally small.
pub(super) const VALUE_RANGE: f32 = 16.0;

/// How many doublings the greatest value of late loses in a round.
pub(super) const TOP_DECAY: f32 = 0.0625;

/// The doublings of value that a round of waiting is worth.
pub(super) const AGING: f32 = 2.0;

/// The priority of a tree that will probably gain nothing, when it begins to wait. It is served
/// once its priority has reached 0.
pub(super) const DOUBTFUL: f32 = -16.0 * AGING;

/// The rise of ln s² beyond the predicted one that is possible in any tree that has changed.
pub(super) const DOUBT: f32 = 1.0;

/// Trees that do not fit into the rest of a frame are passed over; the search for smaller ones ends
/// after this many.
pub(super) const MAX_PASSED_OVER: usize = 8;

/// A tree that was passed over gets a long build at the end of a frame only if it may take more than one in
/// this many of the frame's budget. To wake the thread for smaller trees took most of the budget:
/// 18 trees of 12 lights were rebuilt in 0.3 ms, where there is time for 80.
pub(super) const MAX_UNSPENT_SHARE: u32 = 8;

/// The predicted rise of ln s² per rise of the logarithm of the splitting cost. All four attributes
/// predict little better (R² of 0.83 held out, against 0.81), mostly by distance, which also falls
/// when lights come together; then a tree that needs a rebuild would not request one.
pub(super) const RISE_PER_COST: f32 = 1.51;

/// ln s² of a tree that was just built: a constant, and the coefficients of the logarithm of its
/// number of lights, of the logarithm of its attribute of variance, and of the length of its mean
/// direction of emission.
pub(super) const FRESH_COEFFICIENTS: [f32; 4] = [-9.46, 0.389, 4.91, 3.81];

/// The value of a rebuild is proportional to this power of the tree's share of the picture. The
/// share is known so roughly that its full ratios would rank trees by errors.
pub(super) const SHARE_POWER: f32 = 0.3;

/// The value of a rebuild is proportional to this power of the s² of the tree when it was just
/// built, for the same reason.
pub(super) const FRESH_POWER: f32 = 0.4;

/// The value of a rebuild is computed from a rise of at least this logarithm: trees with a smaller
/// predicted rise gained about equally little.
pub(super) const LEAST_RISE: f32 = 0.3;

/// Logarithms of rises count as at most this, 150 times: attributes may rise from 0, or to
/// infinity.
pub(super) const MAX_RISE: f32 = 5.0;

/// ln s² stays within this of 0.
pub(super) const MAX_LN_VARIANCE: f32 = 12.0;

/// Smaller attributes count as this much. Attributes are of order 1.
pub(super) const MIN_ATTRIBUTE: f32 = 1.0e-3;
