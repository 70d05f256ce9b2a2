//! Buffers that are too small: what does not fit is replaced or refused and the report says so, the rest of the
//! world is as it was, a still world comes to rest, and what was left out comes back once there is room.

use super::limits::{lamps, played, row};
use super::update;
use girandole::glam::DVec3;
use girandole::plan::{PlanError, PlanLimits};
use girandole::{InstanceKey, LightTree, LightWorld, Placement, Policy, TreeKey, TreeSource};
use testbed::testing::plan_device::Played;
use testbed::testing::plan_records::{Found, check, check_as_new_within};
use testbed::testing::support::{Rng, place_tree};

/// The lights of the large tree.
const LARGE: usize = 100;

/// Ten trees of 22 lights, a large tree whose instances have many parts, and where the next instance goes.
struct Town {
    world: LightWorld,
    houses: Vec<TreeKey>,
    large: TreeKey,
    instances: Vec<InstanceKey>,
    rng: Rng,
}

impl Town {
    /// Whether the lights of the large tree are particles, or lie between each other's.
    fn new(are_particles: bool) -> Self {
        let mut rng = Rng(91);
        let (mut world, houses) = row(&mut rng, 10, 22);
        let large = world.add_tree(LightTree::new(lamps(&mut rng, LARGE)).expect("valid"));
        if are_particles {
            world.set_light_source(large, TreeSource::GpuParticles).expect("valid");
        }
        Self { world, houses, large, instances: Vec::new(), rng }
    }

    /// Adds or removes instances of the large tree until there are so many.
    fn set_instances(&mut self, count: usize) {
        while self.instances.len() < count {
            let at = DVec3::new(0.0, 500.0, 0.0) + self.rng.position(1.0).as_dvec3();
            let key = self.world.add_instance(self.large, Placement::at(at), Policy::Budgeted).expect("valid");
            self.instances.push(key);
        }
        for key in self.instances.drain(count..) {
            self.world.remove_instance(key).expect("it lives");
        }
        (0..4).for_each(|_| update(&mut self.world));
    }
}

/// Plans frames until the world rests, at most three, and checks what shaders see. Returns the instances that are
/// held back.
fn rest(played: &mut Played, world: &LightWorld, limits: PlanLimits) -> usize {
    let held_back = played.frame(world).report.held_back_instances;
    check(played, world);
    let rests = (0..3).any(|_| played.frame(world).report.bytes == 0);
    assert!(rests, "a still world sends bytes");
    let mut new = super::limits::played(limits);
    // Trees that are held back come back with a margin, so another planner may open them earlier.
    if new.frame(world).report.held_back_instances == held_back {
        check_as_new_within(limits, played, world);
    }
    held_back
}

#[test]
fn only_the_tree_whose_parts_do_not_fit_is_whole_and_it_is_opened_again() {
    for (are_particles, limit) in [(true, 160_000), (true, 1 << 20), (false, 160_000), (false, 1 << 20)] {
        let mut town = Town::new(are_particles);
        let limits = PlanLimits::new(limit);
        let mut played = played(limits);
        // The most instances whose parts fit, each found by a planner of its own.
        let (mut most, mut fails) = (2, 1000);
        while fails - most > 1 {
            let middle = usize::midpoint(most, fails);
            town.set_instances(middle);
            let report = super::limits::played(limits).frame(&town.world).report;
            if report.held_back_instances == 0 { most = middle } else { fails = middle }
        }
        assert!(most >= 4, "{most}");
        let mut held_back = |count| {
            town.set_instances(count);
            let held_back = rest(&mut played, &town.world, limits);
            let stands_in = |key: &TreeKey| played.planner.stands_in(*key) || played.planner.is_waiting(*key);
            assert!(!town.houses.iter().chain([&town.large]).any(stands_in), "{count} instances");
            let lights = town.houses.len() * 22 + count * LARGE;
            assert_eq!(check(&played, &town.world), Found { lights, stand_ins: 0 });
            held_back
        };
        // Without a margin the tree does not come back.
        let counts = [most, most + 1, 10 * most, most, most / 2, most, 0];
        assert_eq!(counts.map(&mut held_back), [0, most + 1, 10 * most, most, 0, 0, 0], "{most} fit");
    }
}

#[test]
fn more_instances_than_fit_are_refused_until_some_are_gone() {
    let limits = PlanLimits::new(160_000);
    let mut rng = Rng(92);
    let (mut world, _) = row(&mut rng, 1, 1);
    let tree = world.trees().next().expect("one tree");
    let mut keys = Vec::new();
    let mut set = |world: &mut LightWorld, count: usize| {
        while keys.len() < count {
            let at = Placement::at(rng.position(100.0).as_dvec3());
            keys.push(world.add_instance(tree, at, Policy::Static).expect("valid"));
        }
        keys.drain(count..).for_each(|key| world.remove_instance(key).expect("it lives"));
        update(world);
    };
    let mut most = 1;
    let mut probe = played(limits);
    let refused = loop {
        set(&mut world, most + 1);
        match probe.planner.reserve(&world) {
            Ok(reservation) => drop(reservation.plan()),
            Err(error) => break error,
        }
        most += 1;
    };
    assert!(most > 400 && matches!(refused, PlanError::Full { limit: 160_000, .. }), "{most}: {refused}");
    let mut played = played(limits);
    set(&mut world, most);
    rest(&mut played, &world, limits);
    for count in [most + 1, 10 * most] {
        set(&mut world, count);
        assert!(matches!(played.planner.reserve(&world), Err(PlanError::Full { .. })), "{count}");
    }
    set(&mut world, most);
    // The table may be longer than that of a new planner.
    played.frame(&world);
    assert_eq!(check(&played, &world), Found { lights: most + 1, stand_ins: 0 });
    assert!(played.frame(&world).is_empty(), "a still world comes to rest");
}

#[test]
fn a_tree_that_does_not_fit_stands_in_alone() {
    let mut rng = Rng(93);
    let limits = PlanLimits::new(200_000);
    let (mut world, houses) = row(&mut rng, 10, 22);
    let mut played = played(limits);
    let mut stands_in = |count: usize| {
        let (large, key) =
            place_tree(&mut world, lamps(&mut rng, count), Placement::at(DVec3::Y * 500.0), Policy::Budgeted);
        update(&mut world);
        rest(&mut played, &world, limits);
        assert!(houses.iter().all(|key| !played.planner.stands_in(*key)), "{count} lights");
        let stands_in = played.planner.stands_in(large);
        world.remove_instance(key).expect("it lives");
        world.remove_tree(large).expect("no instance has it");
        update(&mut world);
        rest(&mut played, &world, limits);
        stands_in
    };
    // The most lights that fit, by halving: nodes run out before lights do.
    let (mut fits, mut fails) = (100, 20_000);
    while fails - fits > 1 {
        let middle = usize::midpoint(fits, fails);
        if stands_in(middle) { fails = middle } else { fits = middle }
    }
    assert!(fits > 2000, "{fits}");
    assert_eq!([fits, fits + 1, 10 * fits, fits].map(&mut stands_in), [false, true, true, false]);
}
