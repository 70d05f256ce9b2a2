//! Moves of many instances in one call, and what readers find of them.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use girandole::effects::EFFECT_HOLD_UPDATES;
use girandole::glam::{DVec3, Mat3, Vec3};
use girandole::gpu::UploadReport;
use girandole::{
    FrameBudget, InstanceKey, LightTree, LightWorld, MAX_DISTANCE, Placement, Policy, Revision, WorldError,
};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

use crate::gpu::gpu_lights;
use testbed::testing::support::{Rng, SPLITS, distribution, place_tree, vary};

type Moves = Vec<(InstanceKey, Placement)>;

/// A world of small trees, which may have light parts, and of trees that are divided by side. The first
/// instance of a tree of each kind is stretched.
fn world(seed: u64) -> LightWorld {
    let mut rng = Rng(seed);
    let mut world = LightWorld::new();
    for lights in [5, 12, 12, 40] {
        for first in [Placement::IDENTITY, stretched(&mut rng)] {
            let (tree, _) = place_tree(&mut world, rng.lights(lights, 2.0), first, Policy::Budgeted);
            for _ in 0..4 {
                world.add_instance(tree, rng.affine(10.0), Policy::Budgeted).expect("valid");
            }
        }
    }
    vary(&mut world);
    world
}

/// So much that a tree whose first instance this is would be divided in another way.
fn stretched(rng: &mut Rng) -> Placement {
    let scale = Vec3::new(rng.between(0.1, 0.3), rng.between(0.5, 1.0), rng.between(2.0, 5.0));
    Placement { linear: Mat3::from_diagonal(scale), translation: rng.position(10.0).as_dvec3() }
}

/// Moves of random instances, some of them several times: apart and into one another, to where they
/// are, and out of sight.
fn random_moves(world: &LightWorld, rng: &mut Rng, count: usize) -> Moves {
    let keys: Vec<_> = world.instances().collect();
    let place = |key, rng: &mut Rng| match rng.below(8) {
        0 => world.instance(key).expect("it lives").placement,
        1 => Placement { linear: Mat3::ZERO, translation: rng.position(10.0).as_dvec3() },
        2 => stretched(rng),
        3 | 4 => Placement::at(rng.position(0.5).as_dvec3()),
        _ => rng.affine(20.0).into(),
    };
    let mut one = |_| {
        let key = keys[rng.below(keys.len())];
        (key, place(key, rng))
    };
    (0..count).map(&mut one).collect()
}

fn one_by_one(world: &mut LightWorld, moves: &[(InstanceKey, Placement)]) {
    for (key, placement) in moves {
        world.move_instance(*key, *placement).expect("valid");
    }
}

/// The last move of each instance.
fn last_ones(moves: &Moves) -> Moves {
    let last: HashMap<_, _> = moves.iter().copied().collect();
    moves.iter().filter(|(key, _)| last.contains_key(key)).map(|(key, _)| (*key, last[key])).collect()
}

/// The placements of a world, its trees and its probabilities, to the bit.
fn state(world: &LightWorld, seed: u64) -> impl PartialEq + std::fmt::Debug + use<> {
    let placements: Vec<_> = world.instances().map(|key| (key, world.instance(key).map(|i| i.placement))).collect();
    let tree = |key| world.tree(key).map(|tree| (tree.nodes().to_vec(), tree.is_frozen()));
    let trees: Vec<_> = world.trees().map(tree).collect();
    let mut rng = Rng(seed);
    let mut pmfs = Vec::new();
    for splits in SPLITS {
        let of_all = distribution(&world.sampler().with_splits(splits), &rng.masked_point(12.0));
        pmfs.extend(of_all.iter().map(|pmf| pmf.to_bits()));
    }
    (placements, trees, pmfs, *world.effect_counts())
}

/// The slots of instances that were moved, added and removed.
fn lists(world: &LightWorld, since: Revision) -> [Vec<u32>; 3] {
    let changes = world.changes_since(since);
    let lists: [Vec<u32>; 3] = [
        changes.moved_instances().collect(),
        changes.added_instances().collect(),
        changes.removed_instances().collect(),
    ];
    assert!(lists.iter().all(|list| list.is_sorted()));
    lists
}

/// An update without its times.
fn update(world: &mut LightWorld) -> [usize; 5] {
    let report = world.update(FrameBudget::NONE);
    let frozen = world.trees().filter(|key| world.tree(*key).is_some_and(LightTree::is_frozen)).count();
    [report.moved_instances, report.refit_trees, report.rebuilt_trees, report.waiting_trees, frozen]
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 24,
        rng_seed: RngSeed::Fixed(56),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn many_moves_in_one_call_do_what_they_do_one_by_one(seed in any::<u64>(), steps in 1_usize..12) {
        let [mut together, mut last, mut all] = [0; 3].map(|_| world(seed));
        let mut seen = [together.revision(), last.revision()];
        let mut rng = Rng(seed ^ 1);
        for _ in 0..steps {
            // Few, or more than one thread takes.
            let count = [1, 7, 1500][rng.below(3)];
            let moves = random_moves(&together, &mut rng, count);
            together.move_instances(&moves).expect("valid");
            one_by_one(&mut last, &last_ones(&moves));
            one_by_one(&mut all, &moves);
            prop_assert_eq!(together.effects(), last.effects());
            if rng.bits().is_multiple_of(2) {
                prop_assert_eq!(lists(&together, seen[0]), lists(&last, seen[1]));
                seen = [together.revision(), last.revision()];
            }
            let updates = if rng.bits().is_multiple_of(6) { EFFECT_HOLD_UPDATES as usize + 2 } else { rng.below(3) };
            for _ in 0..updates {
                prop_assert_eq!(update(&mut together), update(&mut last));
                all.update(FrameBudget::NONE);
            }
            let seed = rng.bits();
            let expected = state(&last, seed);
            prop_assert!(state(&together, seed) == expected && state(&all, seed) == expected);
        }
    }

    /// Random edits, and what a reader of each frame and one that skips frames must find, from the
    /// keys and placements when they have read last.
    #[test]
    fn readers_find_what_was_moved_added_and_removed_since_they_read(seed in any::<u64>()) {
        let mut rng = Rng(seed);
        let mut world = LightWorld::new();
        let tree = world.add_tree(LightTree::new(rng.lights(3, 1.0)).expect("valid"));
        for _ in 0..80 {
            world.add_instance(tree, rng.affine(9.0), Policy::Budgeted).expect("valid");
        }
        let whole = world.changes_since(Revision::default());
        prop_assert!(whole.added_instances().eq(world.instances().filter_map(|key| world.slot(key))));
        prop_assert!(whole.moved_instances().next().is_none() && whole.origin_shift().is_none());
        let mut readers = [Reader::of(&world), Reader::of(&world)];
        for _ in 0..12 {
            for _ in 0..rng.below(30) {
                let keys: Vec<_> = world.instances().collect();
                let key = keys[rng.below(keys.len())];
                match rng.below(7) {
                    0 => drop(world.add_instance(tree, rng.affine(9.0), Policy::Budgeted).expect("valid")),
                    1 => {
                        let slot = world.slot(key).expect("it lives");
                        for reader in &mut readers {
                            reader.removed.insert(slot);
                        }
                        world.remove_instance(key).expect("it lives");
                    }
                    2 => world.set_appearance(key, |a| a.is_enabled = rng.bits().is_multiple_of(2)).expect("it lives"),
                    3 => drop(world.make_unique(key).expect("it lives")),
                    4 => world.set_origin_near(rng.position(5000.0).as_dvec3()).expect("near"),
                    5 => world.move_instance(key, rng.affine(9.0)).expect("valid"),
                    _ => {
                        let moves = random_moves(&world, &mut rng, 5);
                        world.move_instances(&moves).expect("valid");
                    }
                }
                if rng.bits().is_multiple_of(9) {
                    world.update(FrameBudget::NONE);
                }
            }
            readers[0].check_and_go_on(&world);
            if rng.bits().is_multiple_of(3) {
                readers[1].check_and_go_on(&world);
            }
        }
    }
}

/// A reader of changes, with the instances that there were when it read last, and what was removed
/// since.
struct Reader {
    seen: Revision,
    origin: DVec3,
    before: BTreeMap<u32, (InstanceKey, Option<Placement>)>,
    removed: BTreeSet<u32>,
}

impl Reader {
    fn of(world: &LightWorld) -> Self {
        let of = |key| (world.slot(key).expect("it lives"), (key, world.instance(key).map(|i| i.placement)));
        let before = world.instances().map(of).collect();
        Self { seen: world.revision(), origin: world.origin(), before, removed: BTreeSet::new() }
    }

    fn check_and_go_on(&mut self, world: &LightWorld) {
        let next = Self::of(world);
        let changes = world.changes_since(self.seen);
        assert!(changes.removed_instances().eq(self.removed.iter().copied()));
        // Random placements never lead back.
        let is_moved = |(slot, (key, placement)): &(&u32, &(InstanceKey, Option<Placement>))| {
            self.before.get(slot).is_some_and(|(former, place)| key == former && placement != place)
        };
        assert!(changes.moved_instances().eq(next.before.iter().filter(is_moved).map(|(slot, _)| *slot)));
        let is_added = |(slot, (key, _)): &(&u32, &(InstanceKey, Option<Placement>))| {
            self.before.get(slot).is_none_or(|(former, _)| key != former)
        };
        assert!(changes.added_instances().eq(next.before.iter().filter(is_added).map(|(slot, _)| *slot)));
        let shift = next.origin - self.origin;
        assert_eq!(changes.origin_shift(), (shift != DVec3::ZERO).then_some(shift));
        *self = next;
        assert!(world.changes_since(self.seen).is_empty());
    }
}

#[test]
fn a_refused_move_is_named_and_no_other_move_is_done() {
    let mut world = world(562);
    let gone = world.instances().last().expect("some instance");
    world.remove_instance(gone).expect("it lives");
    world.update(FrameBudget::NONE);
    let (before, revision) = (state(&world, 1), world.revision());
    // Few are done in turn, and many on threads.
    let good = last_ones(&random_moves(&world, &mut Rng(563), 2000));
    let far = Placement::at(DVec3::X * MAX_DISTANCE.next_up());
    let key = world.instances().next().expect("some instance");
    let too_far = world.move_instance(key, far).expect_err("it is too far away");
    assert!(matches!(&too_far, WorldError::Value(error) if error.value == MAX_DISTANCE.next_up()), "{too_far}");
    let large = Placement { linear: Mat3::from_diagonal(Vec3::MAX), translation: DVec3::ZERO };
    for (at, count) in [(0, 9), (1, 2000), (1600, 2000), (2000, 2000)] {
        let mut refuse = |key, placement, source: WorldError| {
            let mut moves = good[..count].to_vec();
            // Later moves that are refused, and one that supersedes the refused one, change nothing.
            let first = good[0].0;
            moves.splice(at..at, [(key, placement), (gone, far), (first, large), (first, Placement::IDENTITY)]);
            let refused = WorldError::Entry { what: "move", index: at, source: Box::new(source.clone()) };
            assert_eq!(source.code(), refused.code());
            assert_eq!(world.move_instances(&moves), Err(refused));
            assert_eq!(update(&mut world)[0], 0);
            assert_eq!(world.revision(), revision);
        };
        refuse(gone, Placement::IDENTITY, WorldError::NoSuchInstance(gone));
        refuse(InstanceKey::default(), far, WorldError::NoSuchInstance(InstanceKey::default()));
        refuse(good[0].0, far, too_far.clone());
    }
    assert!(state(&world, 1) == before);
    world.move_instances(&[]).expect("nothing to refuse");
    world.move_instances(&good).expect("what was refused before leaves no trace");
    assert!(good.iter().all(|(key, placement)| world.instance(*key).map(|i| i.placement) == Some(*placement)));
}

#[test]
fn moves_to_where_instances_are_cost_nothing() {
    let mut world = world(564);
    let mut lights = gpu_lights();
    let mut sent = |world: &mut LightWorld| {
        let moved = world.update(FrameBudget::NONE).moved_instances;
        let is_empty = world.changes_since(lights.revision()).is_empty();
        (moved, is_empty, lights.upload(world).expect("room enough"))
    };
    // Until it is known which trees are loose.
    for step in [1.0e-3, -1.0e-3, 0.0, 0.0] {
        let key = world.instances().next().expect("one");
        let place = world.instance(key).expect("it lives").placement;
        world.move_instance(key, Placement { translation: place.translation + step, ..place }).expect("valid");
        sent(&mut world);
    }
    let present: Moves = world.instances().map(|key| (key, world.instance(key).expect("it lives").placement)).collect();
    let nothing = (0, true, UploadReport::default());
    one_by_one(&mut world, &present);
    assert_eq!(sent(&mut world), nothing);
    // Away and back in one call.
    let mut moves = random_moves(&world, &mut Rng(565), 700);
    moves.extend(&present);
    world.move_instances(&moves).expect("valid");
    assert_eq!(sent(&mut world), nothing);
    // One that stays a little away.
    let (key, place) = present[3];
    moves.push((key, Placement { translation: place.translation + 1.0e-3, ..place }));
    world.move_instances(&moves).expect("valid");
    let (moved, _, report) = sent(&mut world);
    assert_eq!((moved, report.instances), (1, 1));
}
