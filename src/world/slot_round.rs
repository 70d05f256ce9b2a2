//! Visits all instance slots in turn, a few in each update, as long as anything changes.

/// The slots that are still to be visited.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct SlotRound {
    left: usize,
    /// Modulo the number of slots.
    next: usize,
}

impl SlotRound {
    /// Starts again: all slots are to be visited, in the order in which it had been going on.
    pub fn restart(&mut self, slots: usize) {
        self.left = slots;
    }

    /// The next slot; `None` if all have been visited.
    pub fn visit(&mut self, slots: usize) -> Option<u32> {
        self.left = self.left.checked_sub(1)?;
        let slot = self.next.checked_rem(slots)?;
        self.next = slot + 1;
        Some(slot as u32)
    }

    /// Ends the round, because there is nothing to find.
    pub fn end(&mut self) {
        self.left = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_round_visits_each_slot_once_and_goes_on_where_it_was_when_it_starts_again() {
        let mut round = SlotRound::default();
        assert_eq!(round.visit(5), None);
        round.restart(5);
        assert_eq!([(); 3].map(|()| round.visit(5)), [Some(0), Some(1), Some(2)]);
        round.restart(5);
        assert_eq!([(); 6].map(|()| round.visit(5)), [Some(3), Some(4), Some(0), Some(1), Some(2), None]);
        // Slots came.
        round.restart(7);
        assert_eq!(round.visit(7), Some(3));
        round.end();
        assert_eq!((round.visit(7), round.visit(0)), (None, None));
    }
}
