//! Checks that plans are played in order, each once.

use super::error::PlanError;
use super::frame::FramePlan;

/// Which plan has to be played next. Keep one beside the buffers that the plans are played on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PlanCursor {
    played: u64,
}

impl PlanCursor {
    /// To be called before a plan is played.
    ///
    /// # Errors
    /// [`PlanError::OutOfOrder`] if the plan was played before, or if one before it was not. The
    /// plan must not be played then. Continue with the plan that is expected, or call
    /// [`LightPlanner::lose`](super::LightPlanner::lose) and [`PlanCursor::skip_to`] the plan that
    /// is made after that.
    pub fn advance(&mut self, plan: &FramePlan) -> Result<(), PlanError> {
        let expected = self.played + 1;
        if plan.number != expected {
            return Err(PlanError::OutOfOrder { expected, given: plan.number });
        }
        self.played = expected;
        Ok(())
    }

    /// Expects this plan next, whatever was played before.
    pub fn skip_to(&mut self, plan: &FramePlan) {
        self.played = plan.number.saturating_sub(1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_plan_is_accepted_once_and_in_order() {
        let plan = |number| FramePlan { number, ..FramePlan::default() };
        let mut cursor = PlanCursor::default();
        assert_eq!(cursor.advance(&plan(2)), Err(PlanError::OutOfOrder { expected: 1, given: 2 }));
        assert_eq!(cursor.advance(&plan(1)), Ok(()));
        assert_eq!(cursor.advance(&plan(1)), Err(PlanError::OutOfOrder { expected: 2, given: 1 }));
        assert_eq!(cursor.advance(&plan(2)), Ok(()));
        cursor.skip_to(&plan(7));
        assert_eq!(cursor.advance(&plan(7)), Ok(()));
        assert_eq!(cursor.advance(&plan(9)), Err(PlanError::OutOfOrder { expected: 8, given: 9 }));
    }
}
