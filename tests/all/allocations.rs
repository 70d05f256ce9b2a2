//! Frames allocate nothing where nothing grows.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use girandole::effects::EFFECT_HOLD_UPDATES;
use girandole::glam::{DVec3, Vec3};
use girandole::{CandidateCount, FrameBudget, Light, LightTree, LightWorld, Placement, Policy};

use crate::support::Rng;

/// The system's allocator, which counts the requests of each thread.
struct Counting;

thread_local! {
    /// Constant and without a destructor: to read it allocates nothing.
    static REQUESTS: Cell<usize> = const { Cell::new(0) };
}

fn count_request() {
    // A thread that is about to end has no counter any more.
    let _ = REQUESTS.try_with(|requests| requests.set(requests.get() + 1));
}

// SAFETY: every call goes on to the system's allocator as it came.
#[allow(unsafe_code, reason = "an allocator cannot be written without")]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count_request();
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count_request();
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count_request();
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// How often this thread asks for memory during some work.
fn requests(work: impl FnOnce()) -> usize {
    let before = REQUESTS.get();
    work();
    REQUESTS.get() - before
}

/// Runs on a pool of one thread, so that all of the work is counted.
fn on_one_thread(work: impl FnOnce() + Send) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
    pool.install(work);
}

#[test]
fn builds_are_counted() {
    let lights = Rng(70).lights(100, 10.0);
    assert!(requests(|| drop(LightTree::new(lights))) > 0);
}

#[test]
fn setting_lights_and_refitting_asks_for_no_memory() {
    on_one_thread(|| {
        let mut rng = Rng(71);
        for count in [1, 9, 500, 50_000] {
            let tree = LightTree::new(rng.lights(count, 50.0)).expect("valid");
            // A clone has as much room as the tree itself.
            for mut tree in [tree.clone(), tree] {
                for changed in [1, count.div_ceil(50), count] {
                    let mut change = || ((rng.bits() % count as u64) as u32, rng.light(50.0));
                    let changes: Vec<_> = (0..changed).map(|_| change()).collect();
                    for refit in [LightTree::refit, LightTree::refit_without_attributes] {
                        let requests = requests(|| {
                            tree.set_lights(&changes).expect("valid");
                            refit(&mut tree);
                        });
                        assert_eq!(requests, 0, "{changed} of {count} lights");
                    }
                }
            }
        }
    });
}

#[test]
fn an_update_of_a_world_that_stands_still_asks_for_no_memory() {
    let mut world = Rng(72).world(3, 100, 4, 20.0);
    let tree = world.trees().next().expect("a tree");
    world.set_lights(tree, &[(0, Light::point(Vec3::ONE, Vec3::ONE))]).expect("valid");
    world.add_instance(tree, Placement::at(DVec3::ONE), Policy::AlwaysRebuild).expect("valid");
    world.update(FrameBudget::UNLIMITED);
    world.take_delta();
    // While its trees come to rest, and after that.
    let tree_is_frozen = |world: &LightWorld| world.tree(tree).is_some_and(LightTree::is_frozen);
    assert!(!tree_is_frozen(&world));
    for _ in 0..2 * EFFECT_HOLD_UPDATES {
        assert_eq!(requests(|| drop((world.update(FrameBudget::UNLIMITED), world.take_delta()))), 0);
    }
    assert!(tree_is_frozen(&world));
}

#[test]
fn sampling_asks_for_no_memory() {
    let mut rng = Rng(83);
    let world = rng.world(3, 30, 4, 10.0);
    // Builds the top level.
    let sampler = world.sampler();
    let shading_points: Vec<_> = (0..50).map(|_| rng.shading_point(12.0)).collect();
    let asked = requests(|| {
        for shading_point in &shading_points {
            let u = [rng.unit(), rng.unit(), rng.unit(), rng.unit()];
            if let Some(kept) = sampler.resample(shading_point, u, CandidateCount::MAX) {
                std::hint::black_box(sampler.pdf(shading_point, kept.chosen.light, Vec3::ZERO));
            }
            std::hint::black_box(sampler.sample(shading_point, u));
        }
    });
    assert_eq!(asked, 0);
}
