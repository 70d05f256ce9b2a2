//! Lights that are added to a tree and removed from it without a build: what it costs, what the
//! indices mean, and that the tree and the GPU hold what a plain list holds.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use girandole::glam::Vec3;
use girandole::gpu::{GpuLights, UploadReport};
use girandole::scheduler::VirtualClock;
use girandole::tree::{NO_LEAF, NO_PARENT, WIDTH};
use girandole::{
    Effects, FrameBudget, FrameReport, InstanceKey, Light, LightId, LightTree, LightWorld, Placement, Policy,
    ShadingPoint, TreeKey, WorldError,
};
use proptest::prelude::*;

use crate::gpu::gpu_lights;
use testbed::measuring::sigma::{Noise, Summary};
use testbed::testing::support::{Rng, SPLITS, all_pmfs, assert_probabilities, place_tree, world_of};

fn lamp(x: f32) -> Light {
    Light::point(Vec3::new(x, 0.0, 0.0), Vec3::ONE)
}

/// A lamp in a cube of 100 m.
fn any_lamp(rng: &mut Rng) -> Light {
    Light::point(rng.position(50.0), Vec3::splat(rng.between(1.0, 9.0)))
}

fn lamps(rng: &mut Rng, count: usize) -> Vec<Light> {
    (0..count).map(|_| any_lamp(rng)).collect()
}

fn frame(world: &mut LightWorld, lights: &mut GpuLights) -> (FrameReport, UploadReport) {
    let report = world.update(FrameBudget::NONE);
    (report, lights.upload(world).expect("room enough"))
}

/// The number of nodes from a leaf of a tree to the root.
fn depth(tree: &LightTree, light: u32) -> usize {
    let parent = |place: &u32| Some(tree.nodes()[*place as usize / WIDTH].parent).filter(|place| *place != NO_PARENT);
    std::iter::successors(Some(tree.leaves()[light as usize]), parent).count()
}

fn greatest_depth(tree: &LightTree) -> usize {
    let present = (0..).zip(tree.leaves()).filter(|(_, place)| **place != NO_LEAF);
    present.map(|(light, _)| depth(tree, light)).max().unwrap_or(0)
}

/// The indices of a tree's lights.
fn present(tree: &LightTree) -> Vec<u32> {
    (0..).zip(tree.lights()).filter(|(_, light)| !light.is_removed()).map(|(index, _)| index).collect()
}

#[test]
fn lights_are_added_and_removed_at_the_update_and_keep_their_indices() {
    let (mut world, tree, instance) = world_of(vec![lamp(0.0), lamp(1.0), lamp(2.0)], Policy::Budgeted);
    let lights = |world: &LightWorld| world.tree(tree).expect("it lives").lights().to_vec();
    let pmf = |world: &LightWorld, light: u32| {
        world.sampler().pmf(&ShadingPoint::volume(Vec3::Y), LightId::Local { instance, light })
    };
    world.remove_lights(tree, &[1]).expect("it has the light");
    assert_eq!(world.add_lights(tree, &[lamp(7.0), lamp(8.0)]), Ok(vec![3, 4]), "1 is not vacant yet");
    world.set_lights(tree, &[(4, lamp(9.0))]).expect("added lights may be set at once");
    world.set_emission(tree, 3, Vec3::splat(5.0)).expect("added lights may be set at once");
    assert!(lights(&world).len() == 3 && pmf(&world, 1) > 0.0, "nothing happens before the update");
    world.update(FrameBudget::NONE);
    let bright = lamp(7.0).with_emission(Vec3::splat(5.0));
    let now = lights(&world);
    assert_eq!((now[0], now[2], now[3], now[4]), (lamp(0.0), lamp(2.0), bright, lamp(9.0)));
    assert!(now[1].is_removed() && now.len() == 5);
    assert_eq!([0, 1, 2, 3, 4].map(|light| pmf(&world, light) > 0.0), [true, false, true, true, true]);
    assert_eq!((world.light_count(), world.tree(tree).map(LightTree::light_count)), (4, Some(4)));
    assert_eq!((world.added_lights(), world.removed_lights()), (&[(tree, 3), (tree, 4)][..], &[(tree, 1)][..]));
    // The vacant index comes first, once.
    assert_eq!(world.add_lights(tree, &[lamp(3.0), lamp(4.0)]), Ok(vec![1, 5]));
    world.update(FrameBudget::NONE);
    assert_eq!((world.added_lights(), world.removed_lights()), (&[(tree, 1), (tree, 5)][..], &[][..]));
    assert!((0..6).all(|light| pmf(&world, light) > 0.0));
    let before = world.revision();
    world.update(FrameBudget::NONE);
    assert!(world.added_lights().is_empty() && world.revision() == before);
}

#[test]
fn a_light_that_comes_and_goes_between_two_updates_is_never_there_and_costs_nothing() {
    let (mut world, tree, _) = world_of(lamps(&mut Rng(400), 40), Policy::Budgeted);
    world.remove_lights(tree, &[7]).expect("it has the light");
    world.update(FrameBudget::NONE);
    let before = world.revision();
    assert_eq!(world.add_lights(tree, &[lamp(1.0), lamp(2.0)]), Ok(vec![7, 40]));
    world.remove_lights(tree, &[40, 7]).expect("they were added");
    assert_eq!(world.set_emission(tree, 40, Vec3::ONE), Err(WorldError::RemovedLight { index: 40 }));
    assert_eq!(world.add_lights(tree, &[lamp(3.0)]), Ok(vec![41]), "no index twice between two updates");
    world.remove_lights(tree, &[41]).expect("it was added");
    let report = world.update(FrameBudget::NONE);
    assert_eq!((report.refit_trees, report.refit_nodes, world.revision()), (0, 0, before));
    assert!(world.added_lights().is_empty() && world.removed_lights().is_empty());
    assert_eq!(world.add_lights(tree, &[lamp(3.0)]), Ok(vec![7]), "the indices are vacant again");
    // A light that is set and removed is removed; its other changes are dropped.
    world.set_lights(tree, &[(3, lamp(5.0))]).expect("valid");
    world.remove_lights(tree, &[3]).expect("it has the light");
    world.update(FrameBudget::NONE);
    assert!(world.tree(tree).expect("it lives").lights()[3].is_removed());
}

#[test]
fn each_refused_call_has_its_error_and_changes_nothing() {
    let (mut world, tree, instance) = world_of(lamps(&mut Rng(401), 20), Policy::Budgeted);
    world.remove_lights(tree, &[4]).expect("it has the light");
    world.update(FrameBudget::NONE);
    world.remove_lights(tree, &[5]).expect("it has the light");
    let removed = |index| Err(WorldError::RemovedLight { index });
    let missing = |index, count| Err(WorldError::NoSuchLight { index, count });
    for index in [4, 5] {
        assert_eq!(world.remove_lights(tree, &[9, index]), removed(index), "twice");
        assert_eq!(world.set_lights(tree, &[(9, lamp(1.0)), (index, lamp(1.0))]), removed(index));
        assert_eq!(world.set_light_range(tree, index, &[lamp(1.0)]), removed(index));
        assert_eq!(world.set_emission(tree, index, Vec3::ONE), removed(index));
    }
    assert_eq!(world.remove_lights(tree, &[9, 8, 9]), removed(9), "twice in one call");
    assert_eq!(world.remove_lights(tree, &[9, 20]), missing(20, 20));
    assert_eq!(world.set_emission(tree, 20, Vec3::ONE), missing(20, 20));
    let negative = Light::point(Vec3::ZERO, -Vec3::ONE);
    let refused = world.add_lights(tree, &[lamp(1.0), negative]);
    assert!(matches!(refused, Err(WorldError::Entry { index: 1, ref source, .. }) if source.code() == 100));
    let vacant = world.tree(tree).expect("it lives").lights()[4];
    assert!(matches!(world.add_lights(tree, &[vacant]), Err(WorldError::Entry { index: 0, .. })));
    assert_eq!(WorldError::RemovedLight { index: 4 }.code(), 210);
    // Only the one light went, and the refused additions took no index.
    assert_eq!(world.add_lights(tree, &[lamp(1.0), lamp(2.0)]), Ok(vec![4, 20]));
    world.update(FrameBudget::NONE);
    assert_eq!((world.added_lights(), world.removed_lights()), (&[(tree, 4), (tree, 20)][..], &[(tree, 5)][..]));

    world.set_policy(instance, Policy::Static).expect("valid");
    assert_eq!(world.add_lights(tree, &[lamp(1.0)]), Err(WorldError::StaticTree(tree)));
    assert_eq!(world.remove_lights(tree, &[1]), Err(WorldError::StaticTree(tree)));
    world.remove_instance(instance).expect("it lives");
    world.remove_tree(tree).expect("unused");
    assert_eq!(world.add_lights(tree, &[]), Err(WorldError::NoSuchTree(tree)));
    assert_eq!(world.remove_lights(tree, &[]), Err(WorldError::NoSuchTree(tree)));
}

#[test]
fn adding_and_removing_a_light_costs_a_path_of_nodes_in_a_tree_of_any_size() {
    let mut rng = Rng(403);
    for (count, edits, moves) in [(1_000, 400, 4), (100_000, 200, 1)] {
        let (mut world, tree, _) = world_of(lamps(&mut rng, count), Policy::RefitOnly);
        let mut lights = gpu_lights();
        frame(&mut world, &mut lights);
        let (mut resent, mut nodes, mut bytes, mut greatest) = (0, 0, 0, [0; 3]);
        let mut added = Vec::new();
        for edit in 0..edits {
            added.extend(world.add_lights(tree, &[any_lamp(&mut rng)]).expect("valid"));
            let (refit, sent) = frame(&mut world, &mut lights);
            // Where the ranges of the tree grow, all of it is sent.
            if sent.lights >= count {
                resent += 1;
                continue;
            }
            nodes += refit.refit_nodes;
            bytes += sent.bytes;
            greatest = [
                greatest[0].max(refit.refit_nodes),
                greatest[1].max(sent.lights),
                greatest[2].max(sent.bytes as usize),
            ];
            assert_eq!((sent.trees, sent.instances), (1, 0), "edit {edit}");
        }
        // The first range of the lights has their exact size. Each later one has a quarter more than
        // the lights or nodes that it is made for.
        assert!(resent <= moves, "{resent} of {edits} additions to {count} lights sent the whole tree");
        assert!(nodes <= 10 * edits && bytes <= 2_500 * edits as u64, "{count}: {nodes} nodes, {bytes} bytes");
        let [nodes, lights_sent, bytes] = greatest;
        assert!(nodes <= 64 && lights_sent <= 400 && bytes <= 32_768, "{greatest:?}");
        let (mut nodes, mut bytes) = (0, 0);
        for _ in 0..edits {
            let gone = added.swap_remove(rng.below(added.len()));
            world.remove_lights(tree, &[gone]).expect("it has the light");
            let (refit, sent) = frame(&mut world, &mut lights);
            nodes += refit.refit_nodes;
            bytes += sent.bytes;
            assert!(refit.refit_nodes <= 24 && sent.lights <= 24 && sent.bytes <= 16_384, "{refit:?} {sent:?}");
        }
        assert!(nodes <= 10 * edits && bytes <= 2_500 * edits as u64, "{count}: {nodes} nodes, {bytes} bytes");
        world.tree(tree).expect("it lives").check().expect("the tree is sound");
    }
}

#[test]
fn paths_stay_short_whatever_the_order_of_the_lights_is() {
    type Place = fn(usize) -> Vec3;
    let orders: [(&str, Place); 4] = [
        ("in a row", |i| Vec3::X * i as f32),
        ("at one point", |_| Vec3::ONE),
        ("nearer and nearer", |i| Vec3::X * 0.9_f32.powi((i % 800) as i32) * 1000.0),
        ("out along a spiral", |i| Vec3::new((i as f32).cos(), 0.0, (i as f32).sin()) * i as f32),
    ];
    for (name, place) in orders {
        let light = |i: usize| Light::point(place(i), Vec3::ONE);
        let mut tree = LightTree::new((0..20).map(light).collect()).expect("valid");
        for i in 20..6_000 {
            tree.add_lights(&[light(i)]).expect("valid");
        }
        tree.check().expect("the tree is sound");
        let grown = greatest_depth(&tree);
        let nodes = tree.nodes().len();
        tree.rebuild();
        let built = greatest_depth(&tree);
        assert!(grown <= built + 3, "{name}: {grown} nodes deep, a new tree {built}");
        assert!(nodes <= 3 * tree.nodes().len(), "{name}: {nodes} nodes, a new tree {}", tree.nodes().len());
    }
}

#[test]
fn nodes_of_removed_lights_are_used_again() {
    let mut rng = Rng(404);
    let mut tree = LightTree::new(lamps(&mut rng, 2_000)).expect("valid");
    let mut most = 0;
    for _ in 0..20_000 {
        let lights = present(&tree);
        let gone = lights[rng.below(lights.len())];
        tree.remove_lights(&[gone]).expect("it has the light");
        assert_eq!(tree.add_lights(&[any_lamp(&mut rng)]), Ok(vec![gone]));
        most = most.max(tree.nodes().len());
    }
    tree.check().expect("the tree is sound");
    assert_eq!((tree.lights().len(), tree.light_count()), (2_000, 2_000));
    tree.rebuild();
    assert!(most <= 2 * tree.nodes().len(), "{most} nodes, a new tree {}", tree.nodes().len());
}

#[test]
fn whole_parts_of_a_large_tree_may_go_at_once() {
    let mut rng = Rng(415);
    let whole = LightTree::new(lamps(&mut rng, 40_000)).expect("valid");
    for side in [-40.0, -20.0, 0.0, 30.0] {
        let mut tree = whole.clone();
        let goes = |light: &Light| light.cluster().mean.x > side || light.cluster().mean.y < side;
        let gone: Vec<u32> =
            (0..).zip(tree.lights()).filter(|(_, light)| goes(light)).map(|(index, _)| index).collect();
        tree.remove_lights(&gone).expect("it has the lights");
        tree.check().expect("the tree is sound");
        assert_eq!(tree.light_count(), 40_000 - gone.len());
        // A change of all others sweeps over all nodes.
        let changes: Vec<_> = present(&tree).into_iter().map(|index| (index, any_lamp(&mut rng))).collect();
        tree.set_lights(&changes).expect("valid");
        tree.refit();
        tree.check().expect("the tree is sound");
    }
}

#[test]
fn a_tree_may_become_empty_and_be_filled_again() {
    for policy in [Policy::Budgeted, Policy::RefitOnly, Policy::AlwaysRebuild] {
        let (mut world, tree, instance) = world_of(Vec::new(), policy);
        let mut rng = Rng(405);
        for count in [1, 8, 9, 70, 300] {
            let indices = world.add_lights(tree, &lamps(&mut rng, count)).expect("valid");
            assert!(indices.iter().copied().eq(0..count as u32));
            world.update(FrameBudget::NONE);
            let pmfs = all_pmfs(&world.sampler(), &ShadingPoint::volume(Vec3::ZERO));
            assert!(pmfs.iter().filter(|(_, pmf)| *pmf > 0.0).count() == count, "{pmfs:?}");
            world.tree(tree).expect("it lives").check().expect("the tree is sound");
            world.remove_lights(tree, &indices).expect("it has the lights");
            world.update(FrameBudget::UNLIMITED);
            let empty = world.tree(tree).expect("it lives");
            empty.check().expect("the tree is sound");
            assert_eq!((empty.light_count(), empty.nodes().len(), world.light_count()), (0, 0, 0));
            assert_eq!(world.sampler().pick(&ShadingPoint::volume(Vec3::ZERO), [0.5; 2]), None);
            let light = LightId::Local { instance, light: 0 };
            assert_eq!(world.sampler().pmf(&ShadingPoint::volume(Vec3::ZERO), light), 0.0);
        }
    }
}

/// A model of a tree: what stands at each index.
type Model = Vec<Option<Light>>;

/// Checks a tree against its model, and the probabilities of all lights of the world.
fn check_world(world: &LightWorld, models: &[(TreeKey, InstanceKey, Model)], rng: &mut Rng) {
    for (key, _, model) in models {
        let tree = world.tree(*key).expect("it lives");
        tree.check().expect("the tree is sound");
        let lights: Vec<_> = tree.lights().iter().map(|light| (!light.is_removed()).then_some(*light)).collect();
        assert!(lights == *model, "{lights:?} {model:?}");
        let count = model.iter().flatten().count();
        assert_eq!(tree.light_count(), count);
        let mut effects = Effects::empty();
        model.iter().flatten().for_each(|light| effects |= light.effects());
        assert_eq!(tree.effects().effects(), effects);
    }
    let count: usize = models.iter().map(|(.., model)| model.iter().flatten().count()).sum();
    assert_eq!(world.light_count(), count);
    for splits in SPLITS {
        let sampler = world.sampler().with_splits(splits);
        let at = rng.shading_point(30.0);
        assert_probabilities(&sampler, &at, 2_000, rng);
        for (light, pmf) in all_pmfs(&sampler, &at) {
            let LightId::Local { instance, light: index } = light else { continue };
            let (.., model) = models.iter().find(|(_, key, _)| *key == instance).expect("each has an instance");
            let is_dark = pmf == 0.0 && sampler.sample_light(&at, light, [0.3, 0.6]).is_none();
            assert!(model[index as usize].is_some() || is_dark, "a removed light has {pmf}");
        }
    }
}

/// Changes one tree and its model.
fn edit(world: &mut LightWorld, (key, instance, model): &mut (TreeKey, InstanceKey, Model), rng: &mut Rng) {
    let held: Vec<u32> = (0..).zip(&*model).filter(|(_, light)| light.is_some()).map(|(index, _)| index).collect();
    let some = |rng: &mut Rng, most: usize| -> Vec<u32> {
        let chosen: BTreeSet<u32> = (0..rng.below(most + 1)).map(|_| held[rng.below(held.len())]).collect();
        chosen.into_iter().collect()
    };
    match rng.below(9) {
        0..3 => {
            let most = [3, 20, 80][rng.below(3)];
            let count = rng.below(most);
            let lights = rng.lights(count, 12.0);
            let indices = world.add_lights(*key, &lights).expect("valid");
            for (index, light) in indices.into_iter().zip(lights) {
                model.resize(model.len().max(index as usize + 1), None);
                assert_eq!(model[index as usize].replace(light), None, "index {index} is in use");
            }
        }
        3..5 if !held.is_empty() => {
            let most = if rng.below(6) == 0 { 3 * held.len() } else { 12 };
            let gone = some(rng, most);
            world.remove_lights(*key, &gone).expect("it has the lights");
            gone.into_iter().for_each(|index| model[index as usize] = None);
        }
        5 if !held.is_empty() => {
            let changes: Vec<_> = some(rng, 20).into_iter().map(|index| (index, rng.light(12.0))).collect();
            world.set_lights(*key, &changes).expect("valid");
            changes.iter().for_each(|(index, light)| model[*index as usize] = Some(*light));
        }
        6 if rng.below(4) == 0 => {
            let count = rng.below(120);
            let lights = rng.lights(count, 12.0);
            *model = lights.iter().copied().map(Some).collect();
            world.replace_lights(*key, lights).expect("valid");
        }
        7 => {
            world.rebuild_tree(*key).expect("it lives");
        }
        _ => world.move_instance(*instance, rng.affine(20.0)).expect("valid"),
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    /// Random edits against plain lists. Half of the updates have no edits staged twice.
    #[test]
    fn after_random_additions_and_removals_trees_hold_what_plain_lists_hold(seed in any::<u64>(), steps in 1_usize..70) {
        let mut rng = Rng(seed);
        let mut world = LightWorld::new();
        let mut models = Vec::new();
        for count in [0, 5, 40, 150, 600] {
            let lights = rng.lights(count, 12.0);
            let model: Model = lights.iter().copied().map(Some).collect();
            let tree = world.add_tree(LightTree::new(lights).expect("valid"));
            let policy = [Policy::Budgeted, Policy::RefitOnly, Policy::AlwaysRebuild][rng.below(3)];
            models.push((tree, world.add_instance(tree, rng.affine(20.0), policy).expect("valid"), model));
        }
        for step in 0..steps {
            let which = rng.below(models.len());
            edit(&mut world, &mut models[which], &mut rng);
            // An index is not used twice between two updates, so the model cannot tell.
            if rng.below(2) == 0 {
                world.update(FrameBudget::new(Duration::from_micros(rng.below(200) as u64)));
                // What the model has removed behind the last light was never added.
                for (key, _, model) in &mut models {
                    let held = world.tree(*key).expect("it lives").lights().len();
                    assert!(model.iter().skip(held).all(Option::is_none));
                    model.resize(held, None);
                }
                if step % 8 == 0 {
                    check_world(&world, &models, &mut rng);
                }
            }
        }
        world.update(FrameBudget::UNLIMITED);
        for (key, _, model) in &mut models {
            model.resize(world.tree(*key).expect("it lives").lights().len(), None);
        }
        check_world(&world, &models, &mut rng);
    }
}

#[test]
fn a_build_that_is_open_while_lights_come_and_go_has_all_of_them_when_it_is_taken() {
    for in_background in [false, true] {
        // A rebuild of the tree takes 3 ms, a frame has 0.3 ms.
        let clock = Arc::new(VirtualClock::new(|work| Duration::from_nanos(1_000 * work.lights as u64)));
        let mut world = LightWorld::with_clock(clock.clone());
        world.set_background_builds(in_background);
        let mut rng = Rng(407);
        let lights = rng.lights(3_000, 12.0);
        let model: Model = lights.iter().copied().map(Some).collect();
        let (tree, instance) = place_tree(&mut world, lights, Placement::IDENTITY, Policy::AlwaysRebuild);
        let mut models = vec![(tree, instance, model)];
        let mut finished = 0;
        for round in 0..150 {
            let (.., model) = &mut models[0];
            let held: Vec<u32> = (0..).zip(&*model).filter(|(_, l)| l.is_some()).map(|(index, _)| index).collect();
            // More go than come, so some indices that went during a build are vacant at its end.
            let gone: BTreeSet<u32> = (0..4).map(|_| held[rng.below(held.len())]).collect();
            let gone: Vec<u32> = gone.into_iter().collect();
            let lights = rng.lights(2, 12.0);
            for (index, light) in world.add_lights(tree, &lights).expect("valid").into_iter().zip(lights) {
                model.resize(model.len().max(index as usize + 1), None);
                model[index as usize] = Some(light);
            }
            world.remove_lights(tree, &gone).expect("it has the lights");
            gone.into_iter().for_each(|index| model[index as usize] = None);
            let report = world.update(FrameBudget::new(Duration::from_micros(300)));
            clock.advance(Duration::from_micros(500));
            // A tree that was replaced is refitted as a whole.
            let nodes = world.tree(tree).expect("it lives").nodes().len();
            finished += usize::from(report.refit_nodes == nodes);
            if round % 10 == 0 {
                check_world(&world, &models, &mut rng);
            }
        }
        assert!(finished >= 10, "{finished} builds finished");
        check_world(&world, &models, &mut rng);
    }
}

#[test]
fn a_tree_that_a_build_divides_while_lights_are_added_takes_the_rest_of_them() {
    let panel = |i: usize, up: Vec3| {
        let u = 0.2 * up.any_orthonormal_vector();
        Light::rectangle(Vec3::new(i as f32, 0.0, 0.0), u, up.cross(u), Vec3::ONE)
    };
    // Too few to be divided.
    let mut tree = LightTree::new((0..10).map(|i| panel(i, Vec3::Y)).collect()).expect("valid");
    // Many at once would be a build.
    for i in 10..19 {
        tree.add_lights(&[panel(i, -Vec3::Y)]).expect("valid");
    }
    assert!(tree.sides().is_empty());
    // With the first of these, the tree has twice the lights that it was built for.
    tree.add_lights(&[panel(19, Vec3::X), panel(20, Vec3::X)]).expect("valid");
    tree.check().expect("the tree is sound");
    assert_eq!((tree.sides().len(), tree.light_count()), (3, 21));
}

/// The mean of sigma of a tree of points over some points in a volume.
fn mean_sigma(tree: &LightTree) -> f64 {
    let mut rng = Rng(411);
    let mut pmfs = Vec::new();
    let noises: Vec<_> = (0..200)
        .map(|_| {
            let at = rng.position(50.0);
            tree.distribution(&ShadingPoint::volume(at), 6, &mut pmfs);
            let arriving = |light: &Light| light.emission.x / light.cluster().mean.distance_squared(at);
            let contributions: Vec<f32> = tree.lights().iter().map(arriving).collect();
            Noise::of(&contributions, &pmfs).expect("some light contributes")
        })
        .collect();
    assert!(noises.iter().all(|noise| !noise.has_unreached));
    Summary::of(&noises).mean
}

#[test]
fn a_tree_whose_lights_were_replaced_one_by_one_is_little_worse_and_a_rebuild_makes_it_new() {
    for (count, clustered) in [(1_000, false), (10_000, false), (10_000, true)] {
        let mut rng = Rng(410);
        let mut middles: Vec<Vec3> = (0..40).map(|_| rng.position(45.0)).collect();
        let mut light = |rng: &mut Rng, is_new: bool| match clustered {
            false => any_lamp(rng),
            // The new lights are around places where there were none.
            true => {
                if is_new && middles.len() == 40 {
                    middles = (0..41).map(|_| rng.position(45.0)).collect();
                }
                let middle = middles[rng.below(middles.len())];
                Light::point(middle + rng.position(2.0), Vec3::splat(rng.between(1.0, 9.0)))
            }
        };
        let lights = (0..count).map(|_| light(&mut rng, false)).collect();
        let mut tree = LightTree::new(lights).expect("valid");
        let before = mean_sigma(&tree);
        for _ in 0..count * 3 / 10 {
            tree.remove_lights(&[{
                let held = present(&tree);
                held[rng.below(held.len())]
            }])
            .expect("it has the light");
            let new = light(&mut rng, true);
            tree.add_lights(&[new]).expect("valid");
        }
        tree.check().expect("the tree is sound");
        let (worn, rise) = (mean_sigma(&tree), tree.cost_rise());
        let fresh = mean_sigma(&LightTree::new(tree.lights().to_vec()).expect("valid"));
        tree.rebuild();
        let rebuilt = mean_sigma(&tree);
        assert_eq!(rebuilt, fresh);
        // Where lights appear at places that had none, the splitting cost tells.
        let (bound, least_rise) = if clustered { (2.5, 0.3) } else { (1.25, -0.05) };
        assert!(worn <= bound * fresh, "{worn} after the edits, {fresh} in a new tree, {before} before them");
        assert!(rise >= least_rise, "the splitting cost has risen by {rise}");
    }
}

#[test]
fn a_tree_that_has_degraded_by_additions_requests_a_rebuild_and_gets_it() {
    let mut rng = Rng(412);
    let group = |rng: &mut Rng, at: f32| {
        let middle = 45.0 * Vec3::new((at * 1.7).sin(), (at * 2.3).sin(), (at * 3.1).sin());
        Light::point(middle + rng.position(2.0), Vec3::splat(rng.between(1.0, 9.0)))
    };
    let lights = (0..2_000).map(|i| group(&mut rng, (i % 40) as f32)).collect();
    let (mut world, tree, _) = world_of(lights, Policy::Budgeted);
    for i in 0..600 {
        let light = group(&mut rng, (40 + i % 40) as f32);
        world.remove_lights(tree, &[3 * i]).expect("it has the light");
        world.add_lights(tree, &[light]).expect("valid");
        assert_eq!(world.update(FrameBudget::NONE).waiting_trees, 1, "edit {i}");
    }
    let worn = world.tree(tree).expect("it lives");
    assert!(worn.cost_rise() > 0.2, "{}", worn.cost_rise());
    assert_eq!(world.update(FrameBudget::UNLIMITED).rebuilt_trees, 1);
    let built = world.tree(tree).expect("it lives");
    built.check().expect("the tree is sound");
    assert_eq!((built.cost_rise(), built.light_count()), (0.0, 2_000));
    assert_eq!(world.update(FrameBudget::UNLIMITED).rebuilt_trees, 0, "it has what it asked for");
}

#[test]
fn additions_to_a_tree_at_rest_thaw_it() {
    let mut rng = Rng(413);
    let mut tree = LightTree::new(lamps(&mut rng, 900)).expect("valid");
    tree.freeze();
    let mut plain = LightTree::new(tree.lights().to_vec()).expect("valid");
    let new = lamps(&mut rng, 300);
    for tree in [&mut tree, &mut plain] {
        tree.remove_lights(&[5, 7, 700]).expect("it has the lights");
        assert_eq!(tree.add_lights(&new).map(|indices| indices[..4].to_vec()), Ok(vec![5, 7, 700, 900]));
    }
    assert!(!tree.is_frozen() && tree.nodes() == plain.nodes() && tree.leaves() == plain.leaves());
    tree.freeze();
    tree.check().expect("the frozen tree is sound");
    tree.set_lights(&[(5, lamp(1.0))]).expect("valid");
    tree.refit();
    tree.check().expect("the tree is sound");
}

#[cfg(feature = "bake")]
#[test]
fn a_baked_tree_keeps_its_indices_and_the_vacant_ones() {
    let mut rng = Rng(414);
    let mut tree = LightTree::new(rng.lights(500, 12.0)).expect("valid");
    tree.remove_lights(&(0..100).collect::<Vec<_>>()).expect("it has the lights");
    tree.add_lights(&rng.lights(60, 12.0)).expect("valid");
    let mut loaded = LightTree::from_baked(&tree.bake()).expect("bytes that were just written");
    loaded.check().expect("the loaded tree is sound");
    assert_eq!((loaded.lights(), loaded.effects()), (tree.lights(), tree.effects()));
    tree.rebuild();
    assert!(loaded.nodes() == tree.nodes() && loaded.leaves() == tree.leaves());
    assert_eq!(loaded.bake(), tree.bake());
    assert_eq!(loaded.remove_lights(&[70]), Err(WorldError::RemovedLight { index: 70 }));
    let new = rng.lights(41, 12.0);
    let indices = loaded.add_lights(&new).expect("valid");
    assert!(indices.iter().copied().eq((60..100).chain([500])));
    loaded.check().expect("the tree is sound");
    let all = present(&loaded);
    loaded.remove_lights(&all).expect("it has the lights");
    let empty = LightTree::from_baked(&loaded.bake()).expect("bytes that were just written");
    assert_eq!((empty.light_count(), empty.lights().len()), (0, 501));
}
