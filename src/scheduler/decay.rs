//! Estimates how much a rebuild of a tree saves until the tree is as noisy as it is now.
//!
//! The estimate assumes that the tree decays as it did since its last rebuild, `age` frames ago.
//! Then a rebuilt tree is as noisy as now after `age` frames, and until then it loses on average
//! what it lost in the last `age` frames. So a rebuild saves the present loss in each of `age`
//! frames, less the sum of the losses in the last `age` frames. For a tree that is scrambled in
//! every frame this is the loss of one frame; a tree that moves rarely and rests in between saves
//! for long.
//!
//! Trees are served by savings per unit of time. For losses that grow evenly this makes the best
//! use of a budget: the time between the rebuilds of a tree is then proportional to the square root
//! of its cost divided by its rate of decay (docs/math.md). Source: Whittle, Restless bandits
//! (1988), for deterministic decay.

/// Ages count as at most this many frames. Otherwise a tree that rested for an hour would count as
/// one that is going to rest for an hour.
const MAX_AGE: f64 = 240.0;

/// The decay of one tree since its last rebuild. A loss is the extra noise of one frame, in any
/// unit.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Decay {
    /// The frame of the last rebuild.
    rebuilt_at: u64,
    /// The frame of the last change.
    changed_at: u64,
    /// The loss per frame since the last change.
    loss: f32,
    /// The sum of the losses of all frames from the last rebuild to the last change. In f32 it would
    /// stop growing after 2^24 frames.
    accumulated_loss: f64,
    /// The tree has changed since its last rebuild.
    has_changed: bool,
}

impl Decay {
    /// Resets the decay: the tree was rebuilt.
    pub fn reset(&mut self, frame: u64) {
        *self = Self { rebuilt_at: frame, changed_at: frame, ..Self::default() };
    }

    /// The frame of the last rebuild.
    pub fn rebuilt_at(&self) -> u64 {
        self.rebuilt_at
    }

    /// Records that the tree changed, and has this loss per frame from now on.
    pub fn record_loss(&mut self, frame: u64, loss: f32) {
        let unchanged = frame.saturating_sub(self.changed_at) as f64;
        self.accumulated_loss += f64::from(self.loss) * unchanged;
        self.changed_at = frame;
        self.loss = loss;
        self.has_changed = true;
    }

    /// Whether the tree has changed since its last rebuild.
    pub fn has_changed(&self) -> bool {
        self.has_changed
    }

    /// What a rebuild in this frame would save in all, at least the loss of this frame.
    pub fn savings(&self, frame: u64) -> f32 {
        let age = frame.saturating_sub(self.rebuilt_at) as f64;
        let saved = f64::from(self.loss) * age - self.accumulated_loss;
        let share = if age > MAX_AGE { MAX_AGE / age } else { 1.0 };
        ((saved * share) as f32).max(self.loss)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tree rebuilt in frame 10 with these losses in the frames that follow, and the last frame.
    fn after(losses: impl IntoIterator<Item = f32>) -> (Decay, u64) {
        let mut decay = Decay::default();
        decay.reset(10);
        let mut frame = 10;
        for loss in losses {
            frame += 1;
            decay.record_loss(frame, loss);
        }
        (decay, frame)
    }

    #[test]
    fn savings_are_the_area_between_the_present_loss_and_the_past_losses() {
        // The loss grows by 1 each frame: 8 * 8 less 0 + 1 + .. + 7.
        let (decay, frame) = after((1..=8).map(|loss| loss as f32));
        assert_eq!(decay.savings(frame), 64.0 - 28.0);
        // The loss is constant from the first frame on: a rebuild saves one frame's worth.
        let (decay, frame) = after([3.0; 20]);
        assert_eq!(decay.savings(frame), 3.0);
        // After 50 frames of rest a rebuild is expected to last as long, and longer if the tree
        // rests again.
        let (mut decay, frame) = after([0.0]);
        decay.record_loss(frame + 50, 2.0);
        assert_eq!(decay.savings(frame + 50), 102.0);
        assert_eq!(decay.savings(frame + 60), 122.0);
        decay.record_loss(frame + 60, 2.0);
        assert_eq!(decay.savings(frame + 60), 102.0, "ten frames with a loss are no rest");
        // The loss fell without a rebuild.
        let (decay, frame) = after([5.0, 5.0, 1.0]);
        assert_eq!(decay.savings(frame), 1.0);
    }

    #[test]
    fn ages_count_as_at_most_240_frames() {
        let mut decay = Decay::default();
        decay.record_loss(200_000, 2.0);
        assert!((decay.savings(200_000) - 480.0).abs() < 1.0e-3);
        decay.reset(300_000);
        assert_eq!(decay.savings(200_000), 0.0, "an earlier frame counts as age 0");
    }

    #[test]
    fn a_tree_that_was_equally_bad_for_six_days_is_worth_one_frame() {
        let (mut decay, frame) = after(std::iter::repeat_n(3.0, 1 << 25));
        assert_eq!(decay.savings(frame), 3.0);
        // Beyond 2^32 frames, of which one in a million was bad.
        for i in 1..=8192 {
            decay.record_loss(frame + (i << 20), 0.0);
            decay.record_loss(frame + (i << 20) + 1, 3.0);
            decay.record_loss(frame + (i << 20) + 2, 0.0);
        }
        let last = frame + (8192 << 20) + 3;
        decay.record_loss(last, 3.0);
        assert!((decay.savings(last) - 720.0).abs() < 5.0, "{}", decay.savings(last));
    }
}
