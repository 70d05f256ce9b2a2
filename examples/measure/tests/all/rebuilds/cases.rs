//! The scenes of the budget example that broke earlier schedulers, in their quick form.

use measure::rebuilds::cases::{Extent, at_rest, large_tree, lock_out, varying_budgets};

/// The longest wait in rounds; a round is the time granted in which all trees could be rebuilt
/// once. After 9 rounds no newcomer precedes a tree that gains something; one more round
/// passes until it is served, and some of another for the build that is open then.
const MAX_ROUNDS: f64 = 10.75;

#[test]
fn every_tree_is_rebuilt_under_every_sequence_of_budgets() {
    for outcome in varying_budgets(Extent::Quick).expect("the scene plays") {
        assert_eq!(outcome.never_rebuilt, 0, "{outcome:?}");
        assert!(outcome.longest_wait_rounds <= MAX_ROUNDS, "{outcome:?}");
    }
}

#[test]
fn varying_budgets_are_kept() {
    for outcome in varying_budgets(Extent::Quick).expect("the scene plays") {
        assert_eq!(outcome.overrun_share, 0.0, "{outcome:?}");
        assert!(outcome.spent_share > 0.5, "{outcome:?}");
        // The last build in the background may be done before it is paid for.
        assert!(outcome.overspent <= outcome.longest_build, "{outcome:?}");
    }
}

#[test]
fn a_large_tree_that_was_scrambled_once_becomes_as_good_as_new() {
    let outcomes = large_tree(Extent::Quick).expect("the scene plays");
    assert!([true, false].iter().all(|has| outcomes.iter().any(|outcome| outcome.has_threads == *has)));
    for outcome in outcomes.iter().filter(|outcome| outcome.can_be_new()) {
        assert!(outcome.frames.is_finite() && outcome.final_cost < 1.05, "{outcome:?}");
        // The small trees are served meanwhile.
        assert!(outcome.longest_wait_small < 100, "{outcome:?}");
    }
}

#[test]
fn no_tree_is_locked_out_by_measurements_that_mislead() {
    let outcomes = lock_out(Extent::Quick).expect("the scene plays");
    let [turning, at_rest] = &outcomes[..] else { panic!("{} moments", outcomes.len()) };
    // Trees that turn wait again after each rebuild. A beam that turns away from the others of its
    // side doubles the noise of a tree until then.
    assert!(20 * turning.locked_out <= turning.trees, "{turning:?}");
    assert_eq!((at_rest.locked_out, at_rest.waiting), (0, 0), "{at_rest:?}");
}

#[test]
fn trees_at_rest_become_as_good_as_new_where_there_is_time() {
    for outcome in at_rest(Extent::Quick).expect("the scene plays") {
        assert!(outcome.gap > 0.05, "{outcome:?}");
        assert!(outcome.recovered[2] > 0.99, "{outcome:?}");
    }
}
