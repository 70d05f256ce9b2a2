//! The policies of instances bound what the scheduler may do.

use girandole::{Attribute, Policy, WorldError};

use super::{TestWorld, rebuild_jobs};

#[test]
fn static_and_refit_only_trees_are_never_rebuilt() {
    let mut test = TestWorld::new(10);
    let static_tree = test.add_tree(100, Policy::Static);
    let refit_only = test.add_tree(100, Policy::RefitOnly);
    assert_eq!(test.world.set_lights(static_tree, &[]), Err(WorldError::StaticTree(static_tree)));
    for _ in 0..10 {
        test.scatter(refit_only);
        let report = test.frame(1_000_000);
        assert_eq!(
            (report.refit_trees, report.rebuilt_trees, report.rebuilt_parts, report.waiting_trees),
            (1, 0, 0, 0)
        );
    }
}

#[test]
fn trees_that_always_rebuild_or_exceed_their_ceiling_come_before_budgeted_trees() {
    let mut test = TestWorld::new(11);
    test.calibrate();
    let budgeted: Vec<_> = (0..10).map(|_| test.add_tree(50, Policy::Budgeted)).collect();
    let above_ceiling = test.add_tree(100, Policy::Bounded { floor: 0.01, ceiling: 0.02 });
    let below_floor = test.add_tree(100, Policy::Bounded { floor: 1.0e9, ceiling: 1.0e9 });
    let always: Vec<_> = (0..2).map(|_| test.add_tree(100, Policy::AlwaysRebuild)).collect();
    for tree in budgeted.iter().chain(&always).chain([&above_ceiling, &below_floor]) {
        test.scatter(*tree);
    }
    // The tree that has waited longest comes first, from its own share; then there is time for
    // three more.
    let report = test.frame(43);
    assert_eq!((report.rebuilt_trees, report.waiting_trees), (4, 9));
    let rebuilt: Vec<_> = rebuild_jobs(&test.world).iter().map(|job| job.tree).collect();
    assert_eq!(rebuilt[0], budgeted[0]);
    assert!(always.iter().chain([&above_ceiling]).all(|tree| rebuilt.contains(tree)), "{rebuilt:?}");
}

#[test]
fn requests_of_the_algorithms_of_ss_stand_until_the_budget_allows_a_rebuild() {
    let attribute = Attribute::SplittingCost;
    for policy in
        [Policy::Ratio { attribute, factor: 1.05 }, Policy::Deviation { attribute, deviation: 0.01, factor: 1.0 }]
    {
        let mut test = TestWorld::new(12);
        test.calibrate();
        let trees: Vec<_> = (0..6).map(|_| test.add_tree(100, policy)).collect();
        trees.iter().for_each(|tree| test.scatter(*tree));
        let report = test.frame(28);
        assert_eq!((report.rebuilt_trees, report.rebuilt_parts, report.waiting_trees), (2, 0, 4), "{policy:?}");
        // The requests stand although the lights rest.
        assert_eq!(test.frame(28).waiting_trees, 2);
        assert_eq!(test.frame(28).waiting_trees, 0);
    }
}

#[test]
fn a_waiting_tree_whose_policy_becomes_refit_only_is_not_rebuilt() {
    let mut test = TestWorld::new(13);
    let tree = test.add_tree(100, Policy::AlwaysRebuild);
    test.scatter(tree);
    assert_eq!(test.frame(0).waiting_trees, 1);
    test.world.set_policy(test.instance_of(tree), Policy::RefitOnly).expect("a valid policy");
    let report = test.frame(1000);
    assert_eq!((report.rebuilt_trees, report.waiting_trees), (0, 0));
}
