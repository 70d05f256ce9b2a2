//! Decides which trees request a rebuild, and with which priority.

use super::schedule::{QueuePosition, RebuildState, Schedule};
use super::{LightWorld, TreeEntry};
use crate::keys::TreeKey;
use crate::policy::RebuildRequest;
use crate::scheduler::{TreeFeatures, Work, WorkKind};
use crate::tree::WIDTH;

impl TreeEntry {
    /// Records that the lights of the tree have changed, or that a part of it was rebuilt.
    pub(super) fn record_change(&mut self, frame: u64) {
        let now = self.tree.attributes();
        self.history.observe(&now);
        let RebuildState { forecast, decay, rise, .. } = &mut self.rebuild_state;
        *rise = forecast.rise(&TreeFeatures::of(&self.tree));
        decay.record_loss(frame, forecast.gain(*rise));
    }

    /// The most demanding request of the tree's policies.
    fn rebuild_request(&self) -> RebuildRequest {
        let now = self.tree.attributes();
        // Half the logarithm of the variance is that of the standard deviation.
        let excess = (0.5 * self.rebuild_state.rise).exp_m1();
        let request = self.policies.rebuild_request(&self.history, &now, excess);
        // There is only one tree over so few lights.
        let is_pointless = request == RebuildRequest::Optional && self.tree.lights().len() <= WIDTH;
        if is_pointless { RebuildRequest::None } else { request }
    }
}

impl LightWorld {
    /// Re-evaluates whether a tree requests a rebuild, and with which priority: after a refit, a
    /// partial rebuild, or a change of its weight.
    pub(super) fn update_request(&mut self, key: TreeKey) {
        let entry = &self.trees[key];
        let mut request = entry.rebuild_request();
        // A request of the algorithms of SS is kept until it is served.
        if entry.rebuild_state.request == RebuildRequest::Required && entry.may_rebuild() {
            request = request.max(RebuildRequest::Required);
        }
        if request == RebuildRequest::None || entry.rebuild_state.build_id.is_some() {
            return self.withdraw_request(key);
        }
        let lights = entry.tree.lights().len();
        let gain = self.weight_of(key) * self.trees[key].rebuild_state.decay.savings(self.schedule.frame);
        let cost = self.schedule.costs.predict(Work { kind: WorkKind::Rebuild, lights }).as_nanos().max(1);
        // A score of 0 is reserved for trees that are suspended.
        let score = (gain / cost as f32).clamp(f32::MIN_POSITIVE, f32::MAX);
        let is_urgent = request == RebuildRequest::Urgent;
        let Self { schedule: Schedule { queue, by_age, frame, .. }, trees, .. } = self;
        let state = &mut trees[key].rebuild_state;
        state.request = request;
        match state.waiting {
            Some(QueuePosition { index, .. }) => queue.set(index, score, is_urgent),
            None => {
                let index = queue.push(key, score, is_urgent);
                state.waiting = Some(QueuePosition { index, sequence: by_age.push(key), is_oversized: false });
                state.requested_at = *frame;
            }
        }
    }

    /// Withdraws a tree's request and removes the tree from all queues.
    pub(super) fn withdraw_request(&mut self, key: TreeKey) {
        let state = &mut self.trees[key].rebuild_state;
        state.request = RebuildRequest::None;
        let Some(QueuePosition { index, sequence, is_oversized }) = state.waiting.take() else { return };
        let Schedule { queue, by_age, oversized, .. } = &mut self.schedule;
        if is_oversized { oversized } else { by_age }.remove(sequence);
        let Some(moved) = queue.remove(index) else { return };
        if let Some(position) = &mut self.trees[moved].rebuild_state.waiting {
            position.index = index;
        }
    }

    /// Moves a waiting tree to the end of `oversized` (trees that are too large for a frame) or of
    /// `by_age` (all others), unless it is in that queue already.
    pub(super) fn set_oversized(&mut self, key: TreeKey, becomes_oversized: bool) {
        let Self { schedule: Schedule { by_age, oversized, .. }, trees, .. } = self;
        let Some(QueuePosition { sequence, is_oversized, .. }) = &mut trees[key].rebuild_state.waiting else { return };
        if *is_oversized != becomes_oversized {
            let (from, to) = if becomes_oversized { (by_age, oversized) } else { (oversized, by_age) };
            from.remove(*sequence);
            *sequence = to.push(key);
            *is_oversized = becomes_oversized;
        }
    }

    /// Forgets a tree's build in the background, and its result.
    pub(super) fn cancel_build(&mut self, key: TreeKey) {
        let state = &mut self.trees[key].rebuild_state;
        state.build_id = None;
        state.successor = None;
    }
}
