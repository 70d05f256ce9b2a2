//! Regions enter a world wholly or not at all, and leave it with all of their trees and instances.

use girandole::glam::{DVec3, Mat3, Vec3};
use girandole::{
    Appearance, Effects, FrameBudget, InstanceKey, Light, LightTree, LightWorld, MAX_DISTANCE, Placement, Policy,
    Region, RegionInstance, RegionKey, ShadingPoint, TreeKey, WorldError,
};

use testbed::testing::support::{Rng, all_pmfs, assert_frequencies};

/// A region of two built trees, a baked tree and a tree of the world, with two instances of each.
fn region(rng: &mut Rng, of_world: TreeKey) -> Region {
    let mut region = Region::new();
    let trees = [
        region.add_tree(LightTree::new(rng.lights(60, 5.0)).expect("valid")),
        region.add_tree(LightTree::new(rng.lights(40, 5.0)).expect("valid")),
        region.add_tree(
            LightTree::from_baked(&LightTree::new(rng.lights(300, 5.0)).expect("valid").bake()).expect("just written"),
        ),
        region.add_world_tree(of_world),
    ];
    for tree in trees.iter().chain(&trees) {
        let instance = RegionInstance::new(*tree, rng.affine(30.0), Policy::Budgeted);
        let (factor, mask) = (Vec3::splat(rng.between(0.5, 2.0)), rng.bits() as u32 | 1);
        let is_enabled = !rng.bits().is_multiple_of(4);
        let user_data = rng.bits() as u32;
        region
            .add_instance(RegionInstance { appearance: Appearance { factor, mask, is_enabled, user_data }, ..instance })
            .expect("valid");
    }
    region
}

/// A world with one tree that has an instance.
fn world(rng: &mut Rng) -> (LightWorld, TreeKey) {
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(rng.lights(20, 5.0)).expect("valid"));
    world.add_instance(tree, rng.affine(30.0), Policy::Budgeted).expect("valid");
    (world, tree)
}

/// The observable state of a world, as text.
fn state(world: &LightWorld) -> String {
    let mut state = format!(
        "{:?} {:?} {:?} {:?} {:?}",
        world,
        world.effect_counts(),
        world.memory(),
        world.trees().collect::<Vec<_>>(),
        world.regions().collect::<Vec<_>>()
    );
    for key in world.instances() {
        let (tree, placement) = (world.instance(key).map(|i| i.tree), world.instance(key).map(|i| i.placement));
        state += &format!(
            "\n{key:?} {tree:?} {placement:?} {:?} {:?}",
            world.instance(key).map(|i| i.policy),
            world.instance(key).map(|i| i.appearance.factor)
        );
    }
    let at = ShadingPoint::volume(Vec3::ONE);
    let sampler = world.sampler();
    for light in sampler.all_lights() {
        state += &format!("\n{light:?} {:x}", sampler.pmf(&at, light).to_bits());
    }
    state
}

/// Checks that the pmf of all lights of a world is exact.
fn check_chances(world: &LightWorld, rng: &mut Rng) {
    for _ in 0..5 {
        assert_frequencies(&world.sampler(), &rng.shading_point(40.0), 4000, rng);
    }
}

#[test]
fn a_region_is_sent_between_threads_and_so_is_what_is_left_of_it() {
    fn is_send<T: Send + 'static>() {}
    is_send::<Region>();
    let mut rng = Rng(500);
    let (mut world, tree) = world(&mut rng);
    let mut filled = std::thread::spawn(move || region(&mut Rng(501), tree)).join().expect("the thread ends");
    let key = world.add_region(&mut filled).expect("valid");
    let removed = world.remove_region(key).expect("it lives");
    std::thread::spawn(move || drop(removed)).join().expect("the thread ends");
}

#[test]
fn a_region_adds_what_single_calls_add_in_its_order() {
    let mut rng = Rng(502);
    let (mut world, tree) = world(&mut rng);
    let key = world.add_region(&mut region(&mut Rng(503), tree)).expect("valid");
    assert_eq!((world.trees().len(), world.instances().len(), world.regions().len()), (4, 9, 1));
    assert_eq!(world.light_count(), 3 * 20 + 2 * (60 + 40 + 300));
    assert_eq!(RegionKey::from(u64::from(key)), key);

    // The same trees and instances, one by one.
    let (mut single, single_tree) = self::world(&mut Rng(502));
    let mut rng = Rng(503);
    let trees = [
        single.add_tree(LightTree::new(rng.lights(60, 5.0)).expect("valid")),
        single.add_tree(LightTree::new(rng.lights(40, 5.0)).expect("valid")),
        single.add_tree(LightTree::new(rng.lights(300, 5.0)).expect("valid")),
        single_tree,
    ];
    for tree in trees.iter().chain(&trees) {
        let added = single.add_instance(*tree, rng.affine(30.0), Policy::Budgeted).expect("valid");
        single.set_appearance(added, |a| a.factor = Vec3::splat(rng.between(0.5, 2.0))).expect("valid");
        single.set_appearance(added, |a| a.mask = rng.bits() as u32 | 1).expect("it lives");
        single.set_appearance(added, |a| a.is_enabled = !rng.bits().is_multiple_of(4)).expect("it lives");
        single.set_appearance(added, |a| a.user_data = rng.bits() as u32).expect("it lives");
    }
    let view = world.region(key).expect("it lives");
    assert_eq!(view.trees, trees);
    assert_eq!(view.instances, single.instances().skip(1).collect::<Vec<_>>());
    assert_eq!(view.own_trees, trees[..3]);
    for instance in world.instances() {
        let of = |world: &LightWorld| world.instance(instance).map(|i| (i.appearance, i.placement, i.tree));
        assert_eq!(of(&world), of(&single));
    }
    assert_eq!(world.effect_counts(), single.effect_counts());
    for _ in 0..3 {
        let at = rng.shading_point(30.0);
        assert_eq!(all_pmfs(&world.sampler(), &at), all_pmfs(&single.sampler(), &at));
        let [report, other] = [&mut world, &mut single].map(|world| world.update(FrameBudget::UNLIMITED));
        assert_eq!((report.rebuilt_trees, report.moved_instances), (other.rebuilt_trees, other.moved_instances));
    }
    check_chances(&world, &mut rng);
}

#[test]
fn a_region_that_is_removed_leaves_the_world_as_it_was_and_hands_its_trees_back() {
    let mut rng = Rng(504);
    let (mut world, tree) = world(&mut rng);
    world.update(FrameBudget::NONE);
    // The tables have reached their size.
    let key = world.add_region(&mut region(&mut rng, tree)).expect("valid");
    drop(world.remove_region(key).expect("it lives"));
    let before = state(&world);
    let mut filled = region(&mut rng, tree);
    let key = world.add_region(&mut filled).expect("valid");
    assert_ne!(state(&world), before);
    world.update(FrameBudget::NONE);
    let trees = world.region(key).expect("it lives").trees.clone();
    let lights: Vec<_> = trees[..3].iter().map(|tree| world.tree(*tree).expect("live").lights().to_vec()).collect();
    let removed = world.remove_region(key).expect("it lives");
    assert!(removed.iter().map(|tree| tree.lights().to_vec()).eq(lights));
    assert_eq!(removed.len(), 3);
    assert_eq!(state(&world), before);
    assert!(trees[..3].iter().all(|tree| world.tree(*tree).is_none()) && world.tree(tree).is_some());
}

#[test]
fn a_region_that_is_removed_twice_or_never_was_is_refused() {
    let mut rng = Rng(505);
    let (mut world, tree) = world(&mut rng);
    let key = world.add_region(&mut region(&mut rng, tree)).expect("valid");
    drop(world.remove_region(key).expect("it lives"));
    let other = world.add_region(&mut region(&mut rng, tree)).expect("valid");
    assert_ne!(key, other);
    let before = state(&world);
    for stale in [key, RegionKey::default(), RegionKey::from(77)] {
        assert_eq!(world.remove_region(stale).err(), Some(WorldError::NoSuchRegion(stale)));
        assert!(world.region(stale).is_none());
    }
    assert_eq!(state(&world), before);
}

#[test]
fn an_empty_region_and_one_without_instances_are_ordinary() {
    let mut world = LightWorld::new();
    let mut region = Region::new();
    assert!(region.is_empty());
    let empty = world.add_region(&mut region).expect("nothing is wrong");
    region = Region::new();
    region.add_tree(LightTree::new(Rng(1).lights(30, 5.0)).expect("valid"));
    assert!(!region.is_empty() && region.tree_count() == 1 && region.instance_count() == 0);
    let alone = world.add_region(&mut region).expect("valid");
    assert_eq!((world.regions().len(), world.trees().len(), world.light_count()), (2, 1, 0));
    assert!(world.sampler().sample(&ShadingPoint::volume(Vec3::ZERO), [0.5; 4]).is_none());
    assert_eq!(world.remove_region(empty).expect("it lives").len(), 0);
    assert_eq!(world.remove_region(alone).expect("it lives").len(), 1);
    assert_eq!((world.regions().len(), world.trees().len()), (0, 0));
}

#[test]
fn what_is_wrong_in_itself_is_refused_as_the_region_is_filled_and_leaves_it_as_it_was() {
    let mut rng = Rng(506);
    let mut region = Region::new();
    let tree = region.add_tree(LightTree::new(rng.lights(30, 5.0)).expect("valid"));
    let instance = RegionInstance::new(tree, Placement::IDENTITY, Policy::Budgeted);
    region.add_instance(instance).expect("valid");
    let before = format!("{region:?}");

    let mut bad = rng.lights(30, 5.0);
    bad[17].emission.y = -1.0;
    assert!(matches!(LightTree::new(bad), Err(WorldError::Entry { index: 17, .. })));
    let mut damaged = LightTree::new(rng.lights(30, 5.0)).expect("valid").bake();
    damaged[900] ^= 4;
    assert_eq!(LightTree::from_baked(&damaged).err().map(|error| error.code()), Some(1102));

    let mut other = Region::new();
    let trees = [(); 4].map(|()| other.add_tree(LightTree::default()));
    let large = Placement { linear: Mat3::from_diagonal(Vec3::new(1.0, 2.0e9, 1.0)), ..Placement::IDENTITY };
    let refused = [
        RegionInstance { tree: trees[3], ..instance },
        RegionInstance { policy: Policy::Bounded { floor: -1.0, ceiling: 1.0 }, ..instance },
        RegionInstance {
            appearance: Appearance { factor: Vec3::new(1.0, f32::NAN, 1.0), ..instance.appearance },
            ..instance
        },
        RegionInstance { placement: large, ..instance },
        RegionInstance { placement: Placement::at(DVec3::new(0.0, f64::INFINITY, 0.0)), ..instance },
    ];
    let codes = refused.map(|instance| region.add_instance(instance).expect_err("refused").code());
    assert_eq!(codes, [212, 100, 100, 100, 100]);
    let error = region.add_instance(refused[0]).expect_err("refused");
    assert_eq!(error, WorldError::NoSuchRegionTree { index: 3, count: 1 });
    assert_eq!(format!("{region:?}"), before);
    let mut world = LightWorld::new();
    world.add_region(&mut region).expect("what is left is valid");
    assert_eq!((world.trees().len(), world.light_count()), (1, 30));
}

#[test]
fn a_world_that_refuses_a_region_is_unchanged_names_the_stale_tree_and_returns_the_region() {
    let mut rng = Rng(507);
    let (mut world, tree) = world(&mut rng);
    let gone = world.add_tree(LightTree::new(Vec::new()).expect("valid"));
    world.remove_tree(gone).expect("unused");
    world.update(FrameBudget::NONE);
    let before = (state(&world), world.revision());

    let mut filled = region(&mut Rng(508), tree);
    let stale = filled.add_world_tree(gone);
    let far = |x: f64| RegionInstance::new(stale, Placement::at(DVec3::X * x), Policy::Budgeted);
    filled.add_instance(far(-MAX_DISTANCE)).expect("at the limit");
    assert_eq!(filled.add_instance(far(MAX_DISTANCE.next_up())).expect_err("too far").code(), 100);
    let error = world.add_region(&mut filled).expect_err("a stale key");
    assert_eq!(error, WorldError::Entry { what: "tree", index: 4, source: Box::new(WorldError::NoSuchTree(gone)) });
    assert_eq!(error.code(), 202);
    assert!(error.to_string().starts_with("tree 4: no tree"));

    assert_eq!((state(&world), world.revision()), before);
    assert_eq!((filled.tree_count(), filled.instance_count()), (5, 9));
}

/// A world with a region, its key, and the keys of its instances.
fn with_region(seed: u64) -> (LightWorld, RegionKey, Vec<TreeKey>, Vec<InstanceKey>, Rng) {
    let mut rng = Rng(seed);
    let (mut world, tree) = world(&mut rng);
    let key = world.add_region(&mut region(&mut rng, tree)).expect("valid");
    let view = world.region(key).expect("it lives");
    let (trees, instances) = (view.trees.clone(), view.instances.clone());
    (world, key, trees, instances, rng)
}

#[test]
fn instances_and_trees_that_were_removed_one_by_one_are_skipped() {
    let (mut world, key, trees, instances, _) = with_region(510);
    // Both instances of the second tree, the tree, one of the first tree, one of the world's tree.
    for index in [1, 5, 0, 7] {
        world.remove_instance(instances[index]).expect("it lives");
    }
    world.remove_tree(trees[1]).expect("unused");
    assert_eq!(world.region(key).expect("it lives").trees, trees);
    // New trees and instances take the slots.
    let other = world.add_tree(LightTree::new(vec![Light::point(Vec3::ONE, Vec3::ONE)]).expect("valid"));
    let others: Vec<_> =
        (0..4).map(|_| world.add_instance(other, Placement::IDENTITY, Policy::Budgeted).expect("valid")).collect();
    let removed = world.remove_region(key).expect("it lives");
    assert_eq!(removed.iter().map(LightTree::light_count).collect::<Vec<_>>(), [60, 300]);
    assert!(
        others.iter().all(|key| world.instance(*key).map(|i| i.placement).is_some()) && world.tree(other).is_some()
    );
    assert_eq!((world.trees().len(), world.instances().len(), world.light_count()), (2, 5, 24));
}

#[test]
fn a_region_whose_trees_are_used_elsewhere_is_not_removed() {
    let (mut world, key, trees, instances, mut rng) = with_region(511);
    let outside = [0, 1].map(|_| world.add_instance(trees[2], rng.affine(9.0), Policy::Budgeted).expect("valid"));
    let mut second = Region::new();
    let used = second.add_world_tree(trees[2]);
    second.add_instance(RegionInstance::new(used, Placement::IDENTITY, Policy::Budgeted)).expect("valid");
    let second = world.add_region(&mut second).expect("valid");
    let before = state(&world);
    let in_use = |instances| Some(WorldError::RegionInUse { region: key, tree: trees[2], instances });
    assert_eq!(world.remove_region(key).err(), in_use(3));
    assert_eq!(state(&world), before);
    assert_eq!(world.region(key).expect("it lives").instances, instances);
    outside.into_iter().for_each(|key| world.remove_instance(key).expect("it lives"));
    assert_eq!(world.remove_region(key).err(), in_use(1));
    assert_eq!(world.remove_region(second).expect("its tree is of the world").len(), 0);
    assert_eq!(world.remove_region(key).expect("unused").len(), 3);
}

#[test]
fn copies_for_single_instances_leave_with_the_region() {
    let (mut world, key, trees, instances, mut rng) = with_region(512);
    // Of a tree of the region, and of one of the world.
    let copies = [instances[0], instances[3]].map(|key| world.make_unique(key).expect("it lives"));
    assert_eq!(world.region(key).expect("it lives").own_trees[3..], copies);
    // The other instance of the first tree is the only one now.
    assert_eq!(world.make_unique(instances[4]), Ok(trees[0]));
    // A copy outlives its instance, and still leaves with the region.
    world.remove_instance(instances[3]).expect("it lives");
    let outside = world.add_instance(copies[1], rng.affine(9.0), Policy::Budgeted).expect("valid");
    let in_use = WorldError::RegionInUse { region: key, tree: copies[1], instances: 1 };
    assert_eq!(world.remove_region(key).err(), Some(in_use));
    world.remove_instance(outside).expect("it lives");
    world.update(FrameBudget::UNLIMITED);
    check_chances(&world, &mut rng);
    let removed = world.remove_region(key).expect("unused");
    assert_eq!(removed.iter().map(LightTree::light_count).collect::<Vec<_>>(), [60, 40, 300, 60, 20]);
    assert_eq!((world.trees().len(), world.instances().len()), (1, 1));
}

#[test]
fn edits_of_a_region_that_wait_are_dropped_with_it_and_others_are_in_the_trees() {
    let (mut world, key, trees, ..) = with_region(513);
    let lamp = Light::point(Vec3::splat(3.0), Vec3::ONE);
    world.set_lights(trees[2], &[(7, lamp)]).expect("valid");
    world.add_lights(trees[1], &[lamp]).expect("valid");
    world.update(FrameBudget::NONE);
    world.set_lights(trees[2], &[(8, lamp)]).expect("valid");
    let removed = world.remove_region(key).expect("it lives");
    assert_eq!(removed[1].light_count(), 41);
    assert_eq!(removed[2].lights()[7], lamp);
    assert_ne!(removed[2].lights()[8], lamp);
    assert!(removed.iter().all(|tree| tree.check().is_ok()));
    assert_eq!(world.update(FrameBudget::UNLIMITED).refit_trees, 0);
    // They may come back as parts of another region.
    let mut again = Region::new();
    for tree in removed {
        let tree = again.add_tree(tree);
        again.add_instance(RegionInstance::new(tree, Placement::IDENTITY, Policy::Budgeted)).expect("valid");
    }
    world.add_region(&mut again).expect("valid");
    assert_eq!(world.light_count(), 20 + 60 + 41 + 300);
}

#[test]
fn trees_of_stretched_first_instances_are_divided_for_them() {
    let mut rng = Rng(514);
    let stretched = Placement { linear: Mat3::from_diagonal(Vec3::new(1.0, 1.0, 0.01)), ..Placement::IDENTITY };
    let lights: Vec<Light> =
        (0..200).map(|_| Light::point(rng.position(10.0) * Vec3::new(1.0, 1.0, 30.0), Vec3::ONE)).collect();
    let expected = LightTree::new_for(lights.clone(), stretched).expect("valid");
    let plain = LightTree::new(lights.clone()).expect("valid");
    assert_ne!(expected.nodes(), plain.nodes());
    let mut world = LightWorld::new();
    let of_world = world.add_tree(LightTree::new(lights.clone()).expect("valid"));
    let mut region = Region::new();
    let trees = [region.add_tree(plain.clone()), region.add_world_tree(of_world), region.add_tree(plain.clone())];
    for (tree, first) in trees.into_iter().zip([stretched, stretched, Placement::IDENTITY]) {
        region.add_instance(RegionInstance::new(tree, first, Policy::Static)).expect("valid");
        region.add_instance(RegionInstance::new(tree, Placement::IDENTITY, Policy::Static)).expect("valid");
    }
    let key = world.add_region(&mut region).expect("valid");
    let trees = world.region(key).expect("it lives").trees.clone();
    let nodes = |world: &LightWorld, index: usize| world.tree(trees[index]).expect("it lives").nodes().to_vec();
    assert!((0..2).all(|index| nodes(&world, index) == expected.nodes()));
    assert!(nodes(&world, 2) == plain.nodes());
    assert_eq!(world.update(FrameBudget::UNLIMITED).rebuilt_trees, 0);
}

#[test]
fn a_region_that_comes_and_goes_leaves_no_effect_and_no_memory() {
    let mut world = LightWorld::new();
    let mut rng = Rng(515);
    for round in 0..20 {
        let of_world = world.add_tree(LightTree::new(rng.lights(12, 5.0)).expect("valid"));
        let key = world.add_region(&mut region(&mut rng, of_world)).expect("valid");
        let instances = world.region(key).expect("it lives").instances.clone();
        for step in 0..round {
            world.make_unique(instances[step % instances.len()]).expect("it lives");
            let trees: Vec<_> = world.trees().collect();
            world.set_lights(trees[step % trees.len()], &[(0, rng.light(5.0))]).expect("valid");
            world.update([FrameBudget::NONE, FrameBudget::UNLIMITED][step % 2]);
        }
        drop(world.remove_region(key).expect("it lives"));
        world.remove_tree(of_world).expect("unused");
        let memory = world.memory();
        assert_eq!((memory.total(), memory.trees.total()), (memory.tables, 0));
        assert_eq!(world.effect_counts().effects(), Effects::empty());
        assert_eq!((world.light_count(), world.trees().len(), world.instances().len()), (0, 0, 0));
    }
}
