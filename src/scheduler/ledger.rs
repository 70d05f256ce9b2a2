//! The account of time: what frames grant, and what jobs take.

use std::time::Duration;

use super::constants::{LEDGER_CAPACITY, MAX_CHARGE_RATIO};

/// The time that rebuilds may still take, in frames and in the background together.
///
/// Every frame pays its budget in and every job takes its time out. The balance is limited to
/// [`LEDGER_CAPACITY`], or to the budget of the present frame if that is longer. So a world at rest
/// does not save up for a long frame.
///
/// Over any number of frames, all jobs together take no more than the budgets of these frames, plus
/// the capacity, plus the time by which the last job exceeded its prediction, plus what a long
/// build in the background has not been paid for yet.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Ledger {
    /// In nanoseconds; negative after a job that took longer than there was time for.
    balance: f64,
    /// All that was ever taken out.
    #[cfg(test)]
    charged: f64,
}

impl Ledger {
    /// Pays in the budget of a frame.
    pub fn grant(&mut self, budget: Duration) {
        let capacity = nanos(budget).max(nanos(LEDGER_CAPACITY));
        self.balance = (self.balance + nanos(budget)).min(capacity);
    }

    /// Takes out the time of a job that was predicted to take `predicted`. A job counts as at most
    /// [`MAX_CHARGE_RATIO`] times that: a machine that was suspended during a job would otherwise
    /// pay for hours.
    pub fn charge(&mut self, took: Duration, predicted: Duration) {
        self.take_out(nanos(took).min(MAX_CHARGE_RATIO * nanos(predicted)));
    }

    /// Takes out as much of `due` nanoseconds as there is, and returns how much that is.
    pub fn pay(&mut self, due: f64) -> f64 {
        let paid = due.min(self.balance).max(0.0);
        self.take_out(paid);
        paid
    }

    /// Pays back what was paid too much.
    pub fn give_back(&mut self, nanos: f64) {
        self.take_out(-nanos);
    }

    fn take_out(&mut self, nanos: f64) {
        self.balance -= nanos;
        #[cfg(test)]
        {
            self.charged += nanos;
        }
    }

    /// All that was ever taken out, in nanoseconds.
    #[cfg(test)]
    pub fn charged(&self) -> f64 {
        self.charged
    }

    /// The time that may be spent now.
    pub fn balance(&self) -> Duration {
        // The cast turns negative numbers into 0.
        Duration::from_nanos(self.balance as u64)
    }
}

/// A time in nanoseconds.
pub(super) fn nanos(time: Duration) -> f64 {
    time.as_secs_f64() * 1.0e9
}

#[cfg(test)]
mod tests {
    use super::*;

    const MICROSECOND: Duration = Duration::from_micros(1);

    #[test]
    fn unspent_time_is_kept_up_to_the_capacity_and_a_longer_budget_is_usable_in_its_frame() {
        let mut ledger = Ledger::default();
        for _ in 0..100 {
            ledger.grant(3 * MICROSECOND);
        }
        assert_eq!(ledger.balance(), LEDGER_CAPACITY);
        ledger.grant(900 * MICROSECOND);
        assert_eq!(ledger.balance(), 900 * MICROSECOND);
        ledger.charge(890 * MICROSECOND, 890 * MICROSECOND);
        ledger.grant(3 * MICROSECOND);
        assert_eq!(ledger.balance(), 13 * MICROSECOND);
    }

    #[test]
    fn what_is_given_back_can_be_spent() {
        let mut ledger = Ledger::default();
        ledger.grant(10 * MICROSECOND);
        assert_eq!(ledger.pay(8000.0), 8000.0);
        ledger.give_back(3000.0);
        assert_eq!(ledger.balance(), 5 * MICROSECOND);
    }

    #[test]
    fn an_overdraft_is_paid_back_and_a_stall_is_charged_in_part() {
        let mut ledger = Ledger::default();
        ledger.grant(10 * MICROSECOND);
        ledger.charge(25 * MICROSECOND, 20 * MICROSECOND);
        assert_eq!((ledger.balance(), ledger.pay(1000.0)), (Duration::ZERO, 0.0));
        ledger.grant(18 * MICROSECOND);
        assert_eq!(ledger.balance(), 3 * MICROSECOND);
        assert_eq!((ledger.pay(2000.0), ledger.pay(2000.0), ledger.pay(2000.0)), (2000.0, 1000.0, 0.0));
        ledger.charge(Duration::from_secs(3600), MICROSECOND);
        ledger.grant(10 * MICROSECOND);
        assert_eq!(ledger.balance(), 6 * MICROSECOND);
    }

    #[test]
    fn an_unlimited_budget_leaves_the_balance_finite() {
        let mut ledger = Ledger::default();
        ledger.grant(Duration::MAX);
        assert!(ledger.balance() > Duration::from_secs(1 << 30));
        ledger.charge(Duration::MAX, Duration::MAX);
        ledger.grant(MICROSECOND);
        assert!(ledger.balance() <= LEDGER_CAPACITY);
    }
}
