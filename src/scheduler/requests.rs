//! Priorities: which request is served first.

use super::constants::{AGING, DOUBT, DOUBTFUL, SHARE_POWER, TOP_DECAY, VALUE_RANGE};
use super::cost::whole;
use super::{Scheduler, TreeFeatures, Waiting};
use crate::keys::TreeKey;
use crate::policy::{Excess, RebuildRequest};

/// Predictions count as at most this many nanoseconds, about 15 minutes, so that sums are exact.
const MAX_NANOS: f64 = 1.0e12;

/// Steps of rank for one doubling. Priorities that differ by less count as equal.
const STEPS: f64 = 8.0;

impl Scheduler {
    /// Records that the lights of a tree have changed.
    pub fn has_changed(&mut self, tree: TreeKey, now: &TreeFeatures) {
        let frame = self.frame;
        let state = &mut self.trees[tree];
        state.rise = now.rise_since(&state.built);
        state.decay.record_loss(frame, state.built.gain(state.rise));
    }

    /// How much noisier a tree is predicted to be than a new one, as of its last change.
    pub fn excess(&self, tree: TreeKey) -> Excess {
        let state = &self.trees[tree];
        // Half the logarithm of the variance is that of the standard deviation.
        let of = |rise: f32| (0.5 * rise).exp_m1();
        let doubt = if state.decay.has_changed() { DOUBT } else { 0.0 };
        Excess { likely: of(state.rise), possible: of(state.rise + doubt) }
    }

    /// Lets a tree start anew that was rebuilt, in any way.
    pub fn was_rebuilt(&mut self, tree: TreeKey, features: TreeFeatures) {
        self.trees[tree].start(features, self.frame);
        self.withdraw(tree);
    }

    /// Lets a tree start anew that got other lights and was built for them.
    pub fn was_replaced(&mut self, tree: TreeKey, features: TreeFeatures, lights: usize) {
        self.withdraw(tree);
        self.cancel(tree);
        let frame = self.frame;
        let state = &mut self.trees[tree];
        state.set_lights(lights);
        state.start(features, frame);
    }

    /// Records that lights were added to a tree or removed from it. A tree that waits keeps its
    /// place in the queue, and the size that it had when it began to wait.
    pub fn was_resized(&mut self, tree: TreeKey, lights: usize) {
        self.trees[tree].set_lights(lights);
    }

    /// What a tree requests whose policies make this request now. A request of
    /// [`RebuildRequest::Required`] stands until it is served or [withdrawn](Scheduler::withdraw).
    pub fn standing_request(&self, tree: TreeKey, request: RebuildRequest) -> RebuildRequest {
        if self.trees[tree].is_required { request.max(RebuildRequest::Required) } else { request }
    }

    /// Sets what a tree requests now. `share` is the tree's share of the picture.
    ///
    /// A tree that already waits keeps its age. The time for which it was doubtful counts towards
    /// its age as a doubtful tree only.
    pub fn set_request(&mut self, tree: TreeKey, request: RebuildRequest, share: f32) {
        if request == RebuildRequest::None || self.is_long_build_of(tree) {
            return self.withdraw(tree);
        }
        let (start, nanos) = self.start_of(tree, request, share);
        let Self { trees, queue, frame, rounds, waiting_nanos, .. } = self;
        let state = &mut trees[tree];
        state.is_required |= request == RebuildRequest::Required;
        let waiting = state.waiting.get_or_insert_with(|| {
            queue.push(tree, state.lights, *frame);
            Waiting { since_round: *rounds, asked_round: *rounds }
        });
        *waiting_nanos = *waiting_nanos - queue.entry(tree).nanos + nanos;
        if request == RebuildRequest::Doubtful {
            waiting.asked_round = *rounds;
        }
        let as_doubtful = rank(DOUBTFUL, waiting.since_round);
        queue.set(tree, rank(start, waiting.asked_round).max(as_doubtful), nanos);
    }

    /// The priority that a request begins with, and the predicted nanoseconds of the rebuild.
    ///
    /// | request | start, in doublings |
    /// |---|---|
    /// | doubtful: the tree will probably gain nothing | [`DOUBTFUL`] |
    /// | optional, required | 0 to [`VALUE_RANGE`], by the value |
    /// | urgent | `VALUE_RANGE` + 1 to `VALUE_RANGE` + 2, by the value |
    ///
    /// The value is the noise that the rebuild removes per time. Its logarithm is taken relative to
    /// that of the greatest value of late.
    fn start_of(&mut self, tree: TreeKey, request: RebuildRequest, share: f32) -> (f32, u64) {
        let state = &self.trees[tree];
        let nanos = self.costs.nanos(whole(state.lights), state.units).clamp(1.0, MAX_NANOS) as u64;
        if request == RebuildRequest::Doubtful {
            return (DOUBTFUL, nanos);
        }
        let value = share.powf(SHARE_POWER) * state.decay.savings(self.frame) / nanos as f32;
        let value = value.clamp(f32::MIN_POSITIVE, f32::MAX).log2();
        let top = self.top_value.map_or(value, |top| top.max(value));
        self.top_value = Some(top);
        let by_value = (value - top + VALUE_RANGE).max(0.0);
        let is_urgent = request == RebuildRequest::Urgent;
        (if is_urgent { VALUE_RANGE + 1.0 + by_value / VALUE_RANGE } else { by_value }, nanos)
    }

    /// Withdraws the request of a tree.
    pub fn withdraw(&mut self, tree: TreeKey) {
        let state = &mut self.trees[tree];
        (state.is_required, state.waiting) = (false, None);
        self.waiting_nanos -= self.queue.remove(tree).map_or(0, |entry| entry.nanos);
    }

    /// Lets all trees that wait age.
    pub(super) fn advance_rounds(&mut self, rounds: f64) {
        self.rounds += rounds;
        self.top_value = self.top_value.map(|top| top - TOP_DECAY * rounds as f32);
    }

    /// The priority of a rank now, in doublings.
    pub(super) fn priority(&self, rank: i64) -> f64 {
        rank as f64 / STEPS + f64::from(AGING) * self.rounds
    }
}

/// The rank of a tree that began to wait with the priority `start`. Ranks order as priorities do,
/// and do not change while trees age.
fn rank(start: f32, since_round: f64) -> i64 {
    ((f64::from(start) - f64::from(AGING) * since_round) * STEPS).ceil() as i64
}
