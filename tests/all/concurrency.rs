//! Sampling from many threads while builds run in the background, and worlds that are dropped in
//! the middle of a build.
//!
//! The clock is virtual. A build therefore spans the same frames in every run, while its thread
//! really works beside the threads that sample.
//!
//! `cargo test --test all concurrency -- --ignored` runs long sessions with fresh seeds.

use std::sync::Arc;
use std::thread;
use std::time::{Duration, SystemTime};

use girandole::{FrameBudget, LightId, LightWorld, Policy, TreeKey};

use crate::scheduler::{TestWorld, check_trees, random_light, scatter};
use testbed::testing::support::Rng;

/// Threads that sample.
const THREADS: u64 = 8;
/// Samples of each of them in a frame.
const SAMPLES: usize = 32;
/// The number of lights of a tree: its build takes 1.2 ms, four frames of the sessions.
const LIGHTS: usize = 12_000;
/// The time between two frames, and the budget of each.
const FRAME: Duration = Duration::from_micros(300);

/// Keeps small changes from requesting a rebuild.
const POLICY: Policy = Policy::Bounded { floor: 1.0, ceiling: 1.0e9 };

/// What a thread sampled in a frame: lights, and the bits of their probabilities and directions.
type Samples = Vec<Option<(LightId, [u32; 4])>>;

/// What happened in all frames of a session.
#[derive(Debug, Default, PartialEq)]
struct Record {
    samples: Vec<Samples>,
    /// Builds that were started, taken and dropped.
    builds: [usize; 3],
    /// Frames in which a build ran while samples were drawn.
    frames_beside_a_build: usize,
}

/// A world whose trees change at random.
struct Session {
    test: TestWorld,
    trees: Vec<TreeKey>,
}

impl Session {
    fn new(seed: u64) -> Self {
        let mut test = TestWorld::new(seed);
        test.calibrate();
        let trees = (0..3).map(|_| test.add_tree(LIGHTS, POLICY)).collect();
        Self { test, trees }
    }

    /// Changes something. One change in four makes a tree request a rebuild.
    fn change(&mut self) {
        let Self { test, trees } = self;
        let at = test.rng.bits() as usize % trees.len();
        let tree = trees[at];
        let some = |rng: &mut Rng| -> Vec<_> { (0..50).map(|_| random_light(rng, 10.0)).collect() };
        match test.rng.bits() % 16 {
            0..4 => scatter(&mut test.world, &mut test.rng, tree),
            4..10 => {
                let changes: Vec<_> = (0..).zip(some(&mut test.rng)).collect();
                test.world.set_lights(tree, &changes).expect("valid lights");
            }
            10..13 => drop(test.world.add_lights(tree, &some(&mut test.rng)).expect("valid lights")),
            13 => {
                test.remove(tree);
                trees[at] = test.add_tree(LIGHTS, POLICY);
            }
            14 => test.world.replace_lights(tree, some(&mut test.rng)).expect("valid lights"),
            _ => {
                let instance = test.instance_of(tree);
                for policy in [Policy::RefitOnly, POLICY] {
                    test.world.set_policy(instance, policy).expect("a valid policy");
                }
            }
        }
    }

    /// Runs a frame, and returns whether a build runs after it.
    fn frame(&mut self, record: &mut Record) -> bool {
        self.test.clock.advance(FRAME);
        let background = self.test.world.update(FrameBudget::new(FRAME)).background;
        for (sum, more) in record.builds.iter_mut().zip([background.started, background.taken, background.dropped]) {
            *sum += more;
        }
        record.frames_beside_a_build += background.running;
        background.running > 0
    }
}

/// What one thread samples.
fn sample(world: &LightWorld, seed: u64) -> Samples {
    let mut rng = Rng(seed);
    // Every thread asks for a sampler, so that several make the top level at the same time.
    let sampler = world.sampler();
    let mut one = || {
        let at = rng.shading_point(100.0);
        let u = [rng.unit(), rng.unit(), rng.unit(), rng.unit()];
        let sample = sampler.sample(&at, u)?;
        let [x, y, z] = sample.incident.direction.to_array();
        Some((sample.light, [sample.pmf, x, y, z].map(f32::to_bits)))
    };
    (0..SAMPLES).map(|_| one()).collect()
}

/// What all threads sample, one after the other or at the same time.
fn sample_all(world: &LightWorld, seed: u64, at_once: bool) -> Vec<Samples> {
    let seeds = (0..THREADS).map(|i| seed.wrapping_mul(THREADS).wrapping_add(i));
    if !at_once {
        return seeds.map(|seed| sample(world, seed)).collect();
    }
    thread::scope(|scope| {
        let threads: Vec<_> = seeds.map(|seed| scope.spawn(move || sample(world, seed))).collect();
        threads.into_iter().map(|thread| thread.join().expect("no panic")).collect()
    })
}

/// A session of some frames.
fn session(seed: u64, frames: u64, at_once: bool) -> Record {
    let mut session = Session::new(seed);
    let mut record = Record::default();
    for frame in 0..frames {
        if frame % 2 == 0 {
            session.change();
        }
        session.frame(&mut record);
        record.samples.extend(sample_all(&session.test.world, seed ^ frame << 32, at_once));
    }
    check_trees(&session.test.world);
    record
}

/// Runs sessions on one thread and on many, and returns the sums of builds and frames.
fn compare_sessions(seeds: impl Iterator<Item = u64>, frames: u64) -> ([usize; 3], usize) {
    let (mut builds, mut frames_beside_a_build) = ([0; 3], 0);
    for seed in seeds {
        let [one_thread, many_threads] = [false, true].map(|at_once| session(seed, frames, at_once));
        assert!(one_thread == many_threads, "seed {seed:#x}");
        builds.iter_mut().zip(one_thread.builds).for_each(|(sum, more)| *sum += more);
        frames_beside_a_build += one_thread.frames_beside_a_build;
    }
    (builds, frames_beside_a_build)
}

#[cfg(feature = "parallel")]
#[test]
fn many_threads_sample_the_same_as_one_while_builds_run_in_the_background() {
    let ([started, taken, dropped], frames) = compare_sessions(173..175, 100);
    assert!(started > 10 && taken > 5 && dropped > 1 && frames > 50, "{started} {taken} {dropped} {frames}");
}

#[test]
#[ignore = "takes a minute"]
fn many_threads_sample_the_same_as_one_with_a_fresh_seed() {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).expect("a time after 1970");
    let seed = now.as_nanos() as u64;
    let ([started, ..], _) = compare_sessions((0..8).map(|i| seed.wrapping_add(i)), 300);
    assert!(started > 100, "{started}");
}

/// Drops a world while a build runs in its background, or some changes later.
fn drop_world(seed: u64) {
    let mut session = Session::new(seed);
    let mut record = Record::default();
    scatter(&mut session.test.world, &mut session.test.rng, session.trees[0]);
    let runs = (0..100).any(|_| session.frame(&mut record));
    assert!(runs, "seed {seed}: no build was started");
    for _ in 0..seed % 4 {
        session.change();
        session.frame(&mut record);
    }
    let clock = Arc::downgrade(&session.test.clock);
    drop(session);
    assert!(clock.upgrade().is_none(), "seed {seed}: something of the world lives on");
}

/// The number of threads of this process that build trees in the background.
#[cfg(target_os = "linux")]
fn build_threads() -> usize {
    let tasks = std::fs::read_dir("/proc/self/task").expect("Linux lists the threads of a process").flatten();
    // A thread may end before its name is read.
    let names = tasks.filter_map(|task| std::fs::read_to_string(task.path().join("comm")).ok());
    names.filter(|name| name.trim_end() == "girandole build").count()
}

#[cfg(feature = "parallel")]
#[test]
#[cfg(target_os = "linux")]
fn worlds_that_are_dropped_in_the_middle_of_a_build_leave_no_thread() {
    const CHILD: &str = "GIRANDOLE_DROPS_WORLDS";
    const NAME: &str = "concurrency::worlds_that_are_dropped_in_the_middle_of_a_build_leave_no_thread";
    if std::env::var_os(CHILD).is_none() {
        // A process of its own, in which no other test has such threads.
        let program = std::env::current_exe().expect("a path");
        let output =
            std::process::Command::new(program).args([NAME, "--exact", "--nocapture"]).env(CHILD, "1").output();
        let output = output.expect("the process starts");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        return;
    }
    let mut seen = 0;
    for seed in 0..16 {
        drop_world(seed);
        seen = seen.max(build_threads());
    }
    assert!(seen > 0, "no build outlived its world");
    // Builds take milliseconds.
    let ends = (0..6000).any(|_| {
        thread::sleep(Duration::from_millis(10));
        build_threads() == 0
    });
    assert!(ends, "{} threads still run", build_threads());
}
