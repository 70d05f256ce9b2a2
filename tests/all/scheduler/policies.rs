//! The policies of instances bound what the scheduler may do.

use girandole::{Attribute, Policy, WorldError};

use super::{TestWorld, far_placement, rebuild_jobs};

#[test]
fn static_and_refit_only_trees_are_never_rebuilt() {
    let mut test = TestWorld::new(10);
    let static_tree = test.add_tree(100, Policy::Static);
    let refit_only = test.add_tree(100, Policy::RefitOnly);
    assert_eq!(test.world.set_lights(static_tree, &[]), Err(WorldError::StaticTree(static_tree)));
    for _ in 0..10 {
        test.scatter(refit_only);
        let report = test.frame(1_000_000);
        assert_eq!((report.refit_trees, report.rebuilt_trees, report.waiting_trees), (1, 0, 0));
        assert!(test.world.jobs().is_empty());
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
    // There is time for the three urgent trees, for one more, and for a slice of another one.
    let report = test.frame(40);
    assert_eq!((report.rebuilt_trees, report.waiting_trees), (4, 8));
    let mut rebuilt: Vec<_> = rebuild_jobs(&test.world).iter().map(|job| job.tree).collect();
    assert!(budgeted.contains(&rebuilt[3]), "{rebuilt:?}");
    rebuilt.truncate(3);
    rebuilt.sort_unstable();
    let mut urgent = vec![above_ceiling, always[0], always[1]];
    urgent.sort_unstable();
    assert_eq!(rebuilt, urgent);
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
        test.world.set_background_builds(false);
        trees.iter().for_each(|tree| test.scatter(*tree));
        let report = test.frame(28);
        // A third tree is built in slices in the rest of the frame.
        assert_eq!((report.rebuilt_trees, report.waiting_trees), (2, 3), "{policy:?}");
        // The requests stand although the lights rest. All rebuilds take 60 µs.
        test.frame(28);
        assert_eq!(test.frame(28).waiting_trees, 0, "{policy:?}");
        test.frame(28);
        assert!(trees.iter().all(|tree| test.is_as_new(*tree)), "{policy:?}");
    }
}

#[test]
fn waiting_trees_without_an_instance_that_rebuilds_any_more_are_not_rebuilt() {
    for is_removed in [false, true] {
        let mut test = TestWorld::new(13);
        let trees: Vec<_> = (0..10).map(|_| test.add_tree(100, Policy::AlwaysRebuild)).collect();
        for tree in &trees {
            test.world.add_instance(*tree, far_placement(), Policy::RefitOnly).expect("a valid instance");
            test.scatter(*tree);
        }
        assert_eq!(test.frame(0).waiting_trees, 10);
        for tree in &trees {
            let instance = test.instance_of(*tree);
            match is_removed {
                true => test.world.remove_instance(instance).expect("the instance exists"),
                false => test.world.set_policy(instance, Policy::RefitOnly).expect("a valid policy"),
            }
        }
        let report = test.frame(1000);
        assert_eq!((report.rebuilt_trees, report.waiting_trees), (0, 0));
        assert!(test.world.jobs().is_empty());
    }
}
