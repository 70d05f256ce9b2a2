//! What instances want rules what the scheduler may do.

use girandole::{Attribute, Policy, WorldError};

use super::{Theater, builds};

#[test]
fn static_and_refit_only_trees_are_never_rebuilt() {
    let mut theater = Theater::new(10);
    let still = theater.tree(100, Policy::Static);
    let plain = theater.tree(100, Policy::RefitOnly);
    assert_eq!(theater.world.set_lights(still, &[]), Err(WorldError::StaticTree(still)));
    for _ in 0..10 {
        theater.scatter(plain);
        let report = theater.frame(1_000_000);
        assert_eq!(
            (report.refit_trees, report.rebuilt_trees, report.rebuilt_parts, report.waiting_trees),
            (1, 0, 0, 0)
        );
    }
}

#[test]
fn always_rebuild_comes_first_and_then_who_is_past_its_ceiling() {
    let mut theater = Theater::new(11);
    theater.calibrate();
    let weighed: Vec<_> = (0..10).map(|_| theater.tree(50, Policy::Budgeted)).collect();
    let bounded = theater.tree(100, Policy::Bounded { floor: 0.01, ceiling: 0.02 });
    let patient = theater.tree(100, Policy::Bounded { floor: 1.0e9, ceiling: 1.0e9 });
    let always: Vec<_> = (0..2).map(|_| theater.tree(100, Policy::AlwaysRebuild)).collect();
    let all: Vec<_> = weighed.iter().chain(&always).chain([&bounded, &patient]).copied().collect();
    all.iter().for_each(|tree| theater.scatter(*tree));
    // One goes before them, who has waited longest; there is time for no more.
    let report = theater.frame(43);
    assert_eq!((report.rebuilt_trees, report.waiting_trees), (4, 9));
    let first: Vec<_> = builds(&theater.world).iter().map(|job| job.tree).collect();
    assert_eq!(first[0], weighed[0]);
    assert!(always.iter().chain([&bounded]).all(|tree| first.contains(tree)), "{first:?}");
}

#[test]
fn the_algorithms_of_ss_nominate_and_the_budget_cuts() {
    let attribute = Attribute::SplittingCost;
    for policy in
        [Policy::Ratio { attribute, factor: 1.05 }, Policy::Deviation { attribute, deviation: 0.01, factor: 1.0 }]
    {
        let mut theater = Theater::new(12);
        theater.calibrate();
        let trees: Vec<_> = (0..6).map(|_| theater.tree(100, policy)).collect();
        trees.iter().for_each(|tree| theater.scatter(*tree));
        let report = theater.frame(28);
        assert_eq!((report.rebuilt_trees, report.rebuilt_parts, report.waiting_trees), (2, 0, 4), "{policy:?}");
        // Once nominated, a tree waits though its lights rest.
        assert_eq!(theater.frame(28).waiting_trees, 2);
        assert_eq!(theater.frame(28).waiting_trees, 0);
    }
}

#[test]
fn who_changes_its_mind_while_it_waits_is_not_rebuilt() {
    let mut theater = Theater::new(13);
    let tree = theater.tree(100, Policy::AlwaysRebuild);
    let instance = theater.world.instances().next().expect("one");
    theater.scatter(tree);
    assert_eq!(theater.frame(0).waiting_trees, 1);
    theater.world.set_policy(instance, Policy::RefitOnly).expect("valid");
    let report = theater.frame(1000);
    assert_eq!((report.rebuilt_trees, report.waiting_trees), (0, 0));
}
