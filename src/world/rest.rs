//! For how long the lights of trees have not changed.

/// The most doublings of the delay before a freeze.
///
/// The longest delay is 64 times the first one, two minutes at 60 frames a second. Without a limit, a tree whose lamps
/// flicker now and then would keep the memory that freezing frees for ever. At the limit, a tree is thawed at most once
/// in 7,680 updates. A thaw computes every node once, as a refit of all lights does, which is then a small share of the
/// time of those updates.
const MAX_DOUBLINGS: u8 = 6;

/// For how long the lights of a tree have been as they are.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Rest {
    pub state: RestState,
    /// How often the delay before a freeze was doubled, which each edit of the frozen tree does.
    pub doublings: u8,
    /// The number of updates when the lights changed last, or when the tree was added or thawed if that was later.
    pub since: u64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum RestState {
    Moving,
    #[default]
    Still,
    Frozen,
}

/// Which tree is looked at next.
#[derive(Debug, Default)]
pub(super) struct RestRound {
    /// The number of updates so far.
    pub updates: u64,
    pub slot: u32,
}

impl Rest {
    pub fn since(round: &RestRound) -> Self {
        Self { since: round.updates, ..Self::default() }
    }

    /// Starts again for a tree that is not frozen any more, though no light has changed.
    pub fn wake(&mut self, round: &RestRound) {
        if !self.is_awake() {
            (self.state, self.since) = (RestState::Still, round.updates);
        }
    }

    /// Starts again since lights have changed, which thaws the tree.
    pub fn has_moved(&mut self, round: &RestRound) {
        if !self.is_awake() {
            self.doublings = (self.doublings + 1).min(MAX_DOUBLINGS);
        }
        (self.state, self.since) = (RestState::Moving, round.updates);
    }

    pub fn is_moving(&self) -> bool {
        self.state == RestState::Moving
    }

    pub fn is_awake(&self) -> bool {
        self.state != RestState::Frozen
    }
}
