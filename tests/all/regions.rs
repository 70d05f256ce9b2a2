//! Regions enter a world wholly or not at all, and leave it with all of their trees and instances.

use girandole::glam::{DVec3, Mat3, Vec3};
use girandole::{
    Appearance, FrameBudget, Light, LightTree, LightWorld, MAX_DISTANCE, Placement, Policy, Region, RegionInstance,
    RegionKey, ShadingPoint, TreeKey, WorldError,
};

use testbed::testing::support::{Rng, all_pmfs, assert_frequencies, place_tree};

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
    let (tree, _) = place_tree(&mut world, rng.lights(20, 5.0), rng.affine(30.0), Policy::Budgeted);
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
        state += &format!("\n{key:?} {:?}", world.instance(key));
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
    let (mut world, tree) = world(&mut Rng(500));
    let mut filled = std::thread::spawn(move || region(&mut Rng(501), tree)).join().expect("the thread ends");
    let key = world.add_region(&mut filled).expect("valid");
    let removed = world.remove_region(key).expect("it lives");
    std::thread::spawn(move || drop((removed, filled))).join().expect("the thread ends");
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
