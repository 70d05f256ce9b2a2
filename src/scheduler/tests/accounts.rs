//! How the scheduler keeps track of single trees: how long each has waited, which one comes first, and
//! what its jobs cost.

use super::*;
use crate::scheduler::cost::whole;

/// A budget for small trees, but not for `LARGE` ones.
const BUDGET: Duration = Duration::from_micros(300);
const LARGE: usize = 1_000_000;

/// A scheduler that knows trees with these numbers of lights.
fn scheduler_of<const N: usize>(sizes: [usize; N]) -> (Scheduler, [TreeKey; N]) {
    let mut keys = SlotMap::<TreeKey, ()>::with_key();
    let mut scheduler = Scheduler::default();
    let trees = sizes.map(|lights| {
        let tree = keys.insert(());
        scheduler.add(tree, TreeFeatures::default(), lights);
        tree
    });
    (scheduler, trees)
}

/// Lets a tree ask for a rebuild, with this share of the picture.
fn ask(scheduler: &mut Scheduler, tree: TreeKey, share: f32) {
    scheduler.has_changed(tree, &TreeFeatures::of_cost(1.0));
    scheduler.set_request(tree, RebuildRequest::Optional, share);
}

/// Lets the scheduler see a tree of the greatest value, relative to which priorities are.
fn see_best(scheduler: &mut Scheduler, tree: TreeKey) {
    ask(scheduler, tree, 1.0);
    scheduler.withdraw(tree);
}

/// The first step of the first job of a new frame.
fn first_job(scheduler: &mut Scheduler) -> Option<BuildStep> {
    scheduler.start_frame(BUDGET);
    scheduler.start_jobs(BUDGET, Duration::ZERO);
    scheduler.next_job(Duration::ZERO).then(|| scheduler.job()[0])
}

fn is_slice(step: Option<BuildStep>) -> bool {
    step.is_some_and(|step| step.work.kind != WorkKind::Rebuild)
}

#[test]
fn waits_are_counted_in_frames_in_the_queue_and_for_a_long_build() {
    let (mut scheduler, [tree]) = scheduler_of([LARGE]);
    assert!(!scheduler.has_jobs() && !scheduler.waits(tree));
    scheduler.start_frame(BUDGET);
    ask(&mut scheduler, tree, 1.0);
    (0..3).for_each(|_| scheduler.start_frame(Duration::ZERO));
    assert_eq!((scheduler.frame(), scheduler.longest_wait(), scheduler.waiting_trees()), (4, 3, 1));
    assert!(scheduler.has_jobs() && scheduler.waits(tree) && !scheduler.is_long_build_of(tree));

    assert!(is_slice(first_job(&mut scheduler)));
    assert_eq!((scheduler.longest_wait(), scheduler.long_build_wait(), scheduler.waiting_trees()), (4, 4, 0));
    assert!(scheduler.has_jobs() && scheduler.waits(tree) && scheduler.is_long_build_of(tree));

    // A long build that has ended stays until it is paid for, but its tree no longer waits.
    let work = scheduler.go_on_in_background();
    scheduler.finish_background(work, scheduler.costs.predict(work));
    scheduler.was_rebuilt(tree, TreeFeatures::default());
    assert_eq!((scheduler.longest_wait(), scheduler.long_build_wait()), (0, 4));
    assert!(scheduler.has_jobs() && !scheduler.waits(tree) && !scheduler.is_long_build_of(tree));
    // Frames pay for it.
    for _ in 0..10_000 {
        assert!(first_job(&mut scheduler).is_none());
    }
    assert!(!scheduler.has_jobs() && scheduler.long_build_wait() == 0);
}

#[test]
fn a_tree_that_requests_nothing_or_has_the_long_build_is_not_in_the_queue() {
    let (mut scheduler, [tree]) = scheduler_of([100]);
    ask(&mut scheduler, tree, 1.0);
    scheduler.set_request(tree, RebuildRequest::None, 1.0);
    assert!(!scheduler.has_jobs() && !scheduler.waits(tree));
    assert_eq!(scheduler.waiting_nanos, 0);

    let (mut scheduler, [tree]) = scheduler_of([LARGE]);
    ask(&mut scheduler, tree, 1.0);
    assert!(is_slice(first_job(&mut scheduler)));
    let waiting = scheduler.waiting_nanos;
    ask(&mut scheduler, tree, 1.0);
    assert!(scheduler.is_long_build_of(tree));
    assert_eq!((scheduler.waiting_trees(), scheduler.waiting_nanos), (0, waiting));
}

#[test]
fn no_request_stands_but_a_required_one() {
    let requests =
        [RebuildRequest::Doubtful, RebuildRequest::Optional, RebuildRequest::Required, RebuildRequest::Urgent];
    for request in requests {
        let (mut scheduler, [tree]) = scheduler_of([100]);
        scheduler.has_changed(tree, &TreeFeatures::of_cost(1.0));
        scheduler.set_request(tree, request, 1.0);
        let standing = if request == RebuildRequest::Required { request } else { RebuildRequest::None };
        assert_eq!(scheduler.standing_request(tree, RebuildRequest::None), standing, "{request:?}");
    }
}

#[test]
fn a_slice_that_ends_a_build_closes_it() {
    let (mut scheduler, [tree]) = scheduler_of([LARGE]);
    ask(&mut scheduler, tree, 1.0);
    assert!(is_slice(first_job(&mut scheduler)));
    scheduler.did_slice(100, 0);
    scheduler.finish_job(Duration::from_micros(10), |_, _| {});
    assert!(!scheduler.has_jobs() && !scheduler.waits(tree));
    assert_eq!(scheduler.waiting_nanos, 0);
}

#[test]
fn the_tree_with_the_greater_priority_comes_before_a_long_build_and_others_come_after() {
    // The small tree costs 30,000 times less, which a share with a power of 0.3 makes up for.
    for (share, comes_first) in [(1.0, true), (1.0e-18, false)] {
        let (mut scheduler, [large, small]) = scheduler_of([LARGE, 100]);
        see_best(&mut scheduler, small);
        ask(&mut scheduler, large, 1.0);
        assert!(is_slice(first_job(&mut scheduler)));
        ask(&mut scheduler, small, share);
        assert_eq!(is_slice(first_job(&mut scheduler)), !comes_first, "{share}");
    }
}

#[test]
fn of_two_trees_that_gain_the_same_the_cheaper_one_comes_first() {
    let (mut scheduler, [large, small]) = scheduler_of([400, 100]);
    see_best(&mut scheduler, small);
    ask(&mut scheduler, large, 1.0);
    ask(&mut scheduler, small, 1.0);
    assert_eq!(first_job(&mut scheduler).map(|step| step.tree), Some(small));
}

#[test]
fn urgent_requests_begin_above_all_others_and_in_the_order_of_their_values() {
    let (mut scheduler, [best, worst]) = scheduler_of([100; 2]);
    for (tree, share) in [(best, 1.0), (worst, 0.0)] {
        scheduler.has_changed(tree, &TreeFeatures::of_cost(1.0));
        scheduler.set_request(tree, RebuildRequest::Urgent, share);
    }
    let priorities = [best, worst].map(|tree| scheduler.priority(scheduler.queue.entry(tree).rank));
    assert_eq!(priorities, [2.0, 1.0].map(|above| f64::from(VALUE_RANGE) + above));
}

#[test]
fn the_greatest_value_of_late_falls_with_each_round() {
    let (mut scheduler, [tree]) = scheduler_of([100]);
    ask(&mut scheduler, tree, 1.0);
    let top = scheduler.top_value.expect("a tree asked");
    scheduler.advance_rounds(2.5);
    let fall = top - scheduler.top_value.expect("as before");
    assert!((fall - 2.5 / 16.0).abs() < 1.0e-4, "{fall}");
}

#[test]
fn the_time_of_a_batch_is_divided_as_predicted() {
    let (mut scheduler, trees) = scheduler_of([20, 14, 9]);
    trees.iter().for_each(|tree| ask(&mut scheduler, *tree, 1.0));
    assert!(!is_slice(first_job(&mut scheduler)));
    let predicted: Vec<_> = scheduler.job().iter().map(|step| step.nanos).collect();
    assert_eq!(predicted.len(), 3);
    let sum = 3.0 * predicted.iter().sum::<f64>();
    let mut done = Vec::new();
    scheduler.finish_job(Duration::from_nanos(sum as u64), |_, job| done.push(ledger::nanos(job.took)));
    for (took, predicted) in done.iter().zip(predicted) {
        assert!((took - 3.0 * predicted).abs() < 4.0, "{took} {predicted}");
    }
}

#[test]
fn a_rebuild_outside_of_budgets_teaches_what_it_costs() {
    let (mut scheduler, [tree]) = scheduler_of([100]);
    let before = scheduler.costs.predict(whole(100));
    scheduler.finish_rebuild_outside(tree, 2 * before);
    let ratio = scheduler.costs.predict(whole(100)).as_secs_f64() / before.as_secs_f64();
    assert!((1.4..1.6).contains(&ratio), "{ratio}");
}

#[test]
fn a_copy_knows_what_its_original_knows_but_does_not_wait() {
    let (mut scheduler, [original, copy]) = scheduler_of([100, 7]);
    ask(&mut scheduler, original, 1.0);
    assert_eq!(scheduler.excess(copy), Excess { likely: 0.0, possible: 0.0 });
    scheduler.copy(original, copy);
    assert_eq!(scheduler.excess(copy), scheduler.excess(original));
    assert!(scheduler.excess(copy).possible > scheduler.excess(copy).likely && scheduler.excess(copy).likely > 0.0);
    assert_eq!(scheduler.work_of_rebuild(copy), whole(100));
    assert!(scheduler.waits(original) && !scheduler.waits(copy));
}

#[test]
fn trees_that_are_replaced_resized_or_removed_are_known_as_what_they_are_now() {
    let (mut scheduler, [replaced, resized, removed]) = scheduler_of([100; 3]);
    for tree in [replaced, resized, removed] {
        ask(&mut scheduler, tree, 1.0);
    }
    scheduler.was_replaced(replaced, TreeFeatures::of_cost(0.5), 30);
    scheduler.was_resized(resized, 40);
    scheduler.remove(removed);
    let works = [replaced, resized].map(|tree| scheduler.work_of_rebuild(tree));
    assert_eq!(works, [whole(30), whole(40)]);
    assert_eq!(scheduler.excess(replaced), Excess { likely: 0.0, possible: 0.0 });
    assert_eq!((scheduler.waiting_trees(), scheduler.tree_in_turn()), (1, Some(resized)));
    assert!(!scheduler.waits(replaced) && scheduler.waits(resized));

    // A tree that has the long build, and then is no longer needed.
    let (mut scheduler, [tree]) = scheduler_of([LARGE]);
    ask(&mut scheduler, tree, 1.0);
    assert!(is_slice(first_job(&mut scheduler)));
    scheduler.remove(tree);
    assert!(!scheduler.has_jobs() && scheduler.waiting_nanos == 0);
}
