//! Clocks that jump, stand still or are replayed.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use girandole::glam::Vec3;
use girandole::scheduler::{Clock, RecordingClock, ReplayClock, SystemClock, VirtualClock, WorkKind};
use girandole::{FrameBudget, FrameReport, JobReport, Light, LightWorld, Placement, Policy, TreeKey};

use super::{Theater, fingerprint, spark};
use crate::support::Rng;

/// Says what a function makes of the number of the question.
struct OddClock(AtomicU64, fn(u64) -> Duration);

impl Clock for OddClock {
    fn now(&self) -> Duration {
        (self.1)(self.0.fetch_add(1, Ordering::Relaxed))
    }
}

fn scatter(world: &mut LightWorld, rng: &mut Rng, tree: TreeKey) {
    let count = world.tree(tree).expect("it lives").lights().len() as u32;
    let changes: Vec<_> = (0..count).map(|i| (i, spark(rng, 10.0))).collect();
    world.set_lights(tree, &changes).expect("valid");
}

fn trees(world: &mut LightWorld, rng: &mut Rng, sizes: &[usize]) -> Vec<TreeKey> {
    let mut tree = |lights: &usize| {
        let tree = world.add_tree((0..*lights).map(|_| spark(rng, 10.0)).collect()).expect("valid");
        world.add_instance(tree, Placement::IDENTITY, Policy::Budgeted).expect("valid");
        tree
    };
    sizes.iter().map(&mut tree).collect()
}

#[test]
fn a_clock_that_stands_still_or_jumps_leaves_frames_bounded() {
    type Now = fn(u64) -> Duration;
    let clocks: [(&str, Now, usize); 4] = [
        ("still", |_| Duration::ZERO, 1),
        ("an hour at every question", |n| Duration::from_secs(3600 * n), 0),
        ("back and forth", |n| Duration::from_secs(if n % 2 == 0 { 1000 } else { 0 }), 0),
        ("at its end", |_| Duration::MAX, 1),
    ];
    for (name, clock, least) in clocks {
        let mut world = LightWorld::with_clock(Arc::new(OddClock(AtomicU64::new(0), clock)));
        let mut rng = Rng(30);
        let trees = trees(&mut world, &mut rng, &[100; 200]);
        let mut rebuilt = 0;
        for frame in 0..200 {
            trees.iter().for_each(|tree| scatter(&mut world, &mut rng, *tree));
            let report = world.update(FrameBudget::new(Duration::from_micros(100)));
            // No machine rebuilds a hundred lights in less than 1.5 us.
            assert!(report.rebuilt_trees <= 67, "{name}, frame {frame}: {report:?}");
            rebuilt += report.rebuilt_trees;
        }
        assert!(rebuilt >= least, "{name}: {rebuilt}");
    }
}

#[test]
fn costs_of_nothing_and_of_ever_leave_the_world_at_work() {
    for strange in [Duration::ZERO, Duration::MAX] {
        let odd = Arc::new(AtomicU64::new(1));
        let is_odd = odd.clone();
        let cost = move |work| if is_odd.load(Ordering::Relaxed) == 1 { strange } else { super::cost(work) };
        let clock = Arc::new(VirtualClock::new(cost));
        let mut theater = Theater { world: LightWorld::with_clock(clock.clone()), clock, rng: Rng(31) };
        let trees: Vec<_> = (0..10).map(|_| theater.tree(100, Policy::Budgeted)).collect();
        for frame in 0..20 {
            trees.iter().for_each(|tree| theater.scatter(*tree));
            theater.frame(100);
            // For a time of no end there is nothing after: a new world on a clock in order goes on.
            odd.store(u64::from(frame < 5 && strange.is_zero()), Ordering::Relaxed);
        }
        assert_eq!(theater.world.tree_count(), 10);
        trees.iter().for_each(|tree| theater.world.tree(*tree).expect("it lives").check().expect("sound"));
        if strange.is_zero() {
            let report = theater.frame(100);
            assert!(report.overrun.is_zero(), "{report:?}");
        }
    }
}

/// Plays some frames of moving trees, one of them too large for a frame.
fn play(clock: Arc<dyn Clock>) -> (LightWorld, Vec<(FrameReport, Vec<JobReport>)>) {
    let mut world = LightWorld::with_clock(clock);
    let mut rng = Rng(32);
    let trees = trees(&mut world, &mut rng, &[50, 100, 400, 1000, 30_000, 20, 700]);
    let mut reports = Vec::new();
    for frame in 0..60_usize {
        for (i, tree) in trees.iter().enumerate().filter(|(i, _)| (frame + i) % 5 < 2) {
            let count = world.tree(*tree).expect("it lives").lights().len() as u32;
            let some: Vec<_> =
                (0..count / 4).map(|_| (rng.bits() as u32 % count, Light::point(rng.place(10.0), Vec3::ONE))).collect();
            // The largest only once, or it would never be still enough for a build.
            if i != 4 || frame == 6 {
                world.set_lights(*tree, &some).expect("valid");
            }
        }
        let report = world.update(FrameBudget::new(Duration::from_micros(400)));
        reports.push((report, world.jobs().to_vec()));
    }
    (world, reports)
}

#[test]
fn a_recorded_run_goes_the_same_way_again() {
    let clock = Arc::new(RecordingClock::new(SystemClock::default()));
    let (world, reports) = play(clock.clone());
    let events = clock.take_events();
    assert!(clock.take_events().is_empty() && events.len() > 120);
    let replay = Arc::new(ReplayClock::new(events.iter().copied()));
    let (again, reports_again) = play(replay.clone());
    assert_eq!(reports, reports_again);
    assert!(fingerprint(&world) == fingerprint(&again));
    assert!(!replay.has_diverged());
    assert!(reports.iter().any(|(report, _)| report.rebuilt_trees > 0));

    // A record of something else does no harm, and is found out.
    let wrong = Arc::new(ReplayClock::new(events.into_iter().take(40)));
    let (other, _) = play(wrong.clone());
    assert!(wrong.has_diverged());
    other.trees().for_each(|tree| other.tree(tree).expect("it lives").check().expect("sound"));
}

#[test]
fn a_run_on_virtual_time_repeats_exactly() {
    let run = || {
        let clock = Arc::new(VirtualClock::new(super::cost));
        let beat = clock.clone();
        let (world, reports) = play(clock);
        (fingerprint(&world), reports, beat.now())
    };
    let (first, second) = (run(), run());
    assert!(first == second);
    let kinds: Vec<_> = first.1.iter().flat_map(|(_, jobs)| jobs.iter().map(|job| job.work.kind)).collect();
    for kind in [WorkKind::Rebuild, WorkKind::Snapshot] {
        assert!(kinds.contains(&kind), "{kind:?}");
    }
}
