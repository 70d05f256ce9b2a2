//! How long a rebuild of a tree lasts, from how it got worse since the last one.
//!
//! If it goes as before, a tree that is rebuilt now will again be as bad in `age` frames, the frames since its last
//! rebuild, and until then on average as bad as it was in those. So a rebuild saves the present loss in each of `age`
//! frames, less what was lost in the last `age` frames. A tree that is scrambled in every frame saves one frame's
//! worth, one that moves now and then and rests between saves for long. Of all trees, those come first that save most
//! for the time: for loss that grows evenly this makes the best of a budget, each tree's time between rebuilds being as
//! the root of its cost by its rate of decay (docs/math.md). Source: Whittle, Restless bandits (1988), for
//! deterministic decay.

/// Frames that count. What was before is forgotten evenly, so that a tree that rested for an hour does not count as one
/// that will rest for an hour.
const HORIZON: f32 = 240.0;

/// Of one tree. Losses are those of a frame, in any unit.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Decay {
    /// Frame of the last rebuild.
    built: u64,
    /// Frame of the last change.
    changed: u64,
    /// Since that change.
    loss: f32,
    /// Sum over all frames from the last rebuild to that change.
    lost: f32,
}

impl Decay {
    /// The tree was rebuilt.
    pub fn start(&mut self, frame: u64) {
        *self = Self { built: frame, changed: frame, loss: 0.0, lost: 0.0 };
    }

    /// The tree changed, and loses so much a frame from now on.
    pub fn change(&mut self, frame: u64, loss: f32) {
        let rested = frame.saturating_sub(self.changed) as f32;
        self.lost += self.loss * rested;
        self.changed = frame;
        self.loss = loss;
    }

    /// What a rebuild now would save in all, at least what it saves in this frame.
    pub fn savings(&self, frame: u64) -> f32 {
        let age = frame.saturating_sub(self.built) as f32;
        let saved = self.loss * age - self.lost;
        let share = if age > HORIZON { HORIZON / age } else { 1.0 };
        (saved * share).max(self.loss)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// After a rebuild in frame 10, these losses in the frames that follow.
    fn after(losses: impl IntoIterator<Item = f32>) -> (Decay, u64) {
        let mut decay = Decay::default();
        decay.start(10);
        let mut frame = 10;
        for loss in losses {
            frame += 1;
            decay.change(frame, loss);
        }
        (decay, frame)
    }

    #[test]
    fn savings_are_the_area_above_the_losses() {
        // It grows by 1 each frame: 8 * 8 less 0 + 1 + .. + 7.
        let (decay, frame) = after((1..=8).map(|loss| loss as f32));
        assert_eq!(decay.savings(frame), 64.0 - 28.0);
        // At once as bad as it gets: a frame's worth.
        let (decay, frame) = after([3.0; 20]);
        assert_eq!(decay.savings(frame), 3.0);
        // At rest for 50 frames, then bad: that long is what a rebuild would last; and longer, if it rests again.
        let (mut decay, frame) = after([0.0]);
        decay.change(frame + 50, 2.0);
        assert_eq!(decay.savings(frame + 50), 102.0);
        assert_eq!(decay.savings(frame + 60), 122.0);
        decay.change(frame + 60, 2.0);
        assert_eq!(decay.savings(frame + 60), 102.0, "it did not rest after all");
        // It got better by itself.
        let (decay, frame) = after([5.0, 5.0, 1.0]);
        assert_eq!(decay.savings(frame), 1.0);
    }

    #[test]
    fn an_hour_of_rest_counts_as_some_seconds() {
        let mut decay = Decay::default();
        decay.change(200_000, 2.0);
        assert!((decay.savings(200_000) - 2.0 * HORIZON).abs() < 1.0e-3);
        decay.start(300_000);
        assert_eq!(decay.savings(200_000), 0.0, "a frame of before is none");
    }
}
