//! Dumps come back as they were, and files that were damaged or forged are refused.

use glam::{DVec3, Mat3, Quat, Vec3};

use super::*;
use crate::file::seal;
use crate::keys::{InstanceKey, LightId, TreeKey};
use crate::light::{DirectionalLight, Light};
use crate::profile::Profile;
use crate::profile::tests::{of_degrees, street_lamp};
use crate::tree::testing::Rng;
use crate::tree::{Attribute, LightTree};
use crate::world::{LightWorld, TreeSource};
use crate::{FrameBudget, Placement, Policy, ShadingPoint, Sky};

fn lamps(rng: &mut Rng, count: usize, reach: f32) -> Vec<Light> {
    (0..count).map(|_| Light::point(rng.position(reach), Vec3::splat(rng.between(0.5, 5.0)))).collect()
}

fn tree(rng: &mut Rng, count: usize, reach: f32) -> LightTree {
    LightTree::new(lamps(rng, count, reach)).expect("valid lights")
}

/// A tree whose lights have moved far from their neighbours.
fn loose(rng: &mut Rng, count: usize) -> LightTree {
    let mut tree = tree(rng, count, 10.0);
    let moved: Vec<_> = (0..).zip(lamps(rng, count, 10.0)).collect();
    tree.set_lights(&moved).expect("valid lights");
    tree.refit();
    tree
}

/// A tree of which lights were removed and to which others were added.
fn scattered(rng: &mut Rng) -> LightTree {
    let mut tree = tree(rng, 300, 10.0);
    // One by one: where many come and go at once, the tree is built again.
    for light in lamps(rng, 40, 12.0) {
        tree.add_lights(&[light]).expect("a valid light");
    }
    (0..200).for_each(|light| tree.remove_lights(&[light]).expect("it is there"));
    assert!(tree.nodes().iter().any(|node| node.count() == 0), "some nodes are spare");
    tree
}

fn at(x: f64, y: f64, z: f64) -> Placement {
    Placement::at(DVec3::new(x, y, z))
}

/// A world with trees and instances of all kinds, and with slots that are empty.
fn world() -> LightWorld {
    let mut rng = Rng(5);
    let mut world = LightWorld::new();
    world.set_origin_near(DVec3::new(2048.0, 0.0, -1024.0)).expect("near");
    world.set_glossy_sampling(true);
    let stretch = Placement { linear: Mat3::from_diagonal(Vec3::new(1.0, 1.0, 0.02)), ..at(2050.0, 0.0, -1000.0) };
    let profiled = |i: u64| Light::profile(Vec3::Y * i as f32, Quat::IDENTITY, street_lamp(i % 2), Vec3::ONE);
    let trees = [
        tree(&mut rng, 40, 3.0),
        loose(&mut rng, 200),
        tree(&mut rng, 100, 5.0),
        tree(&mut rng, 80, 9.0),
        LightTree::new((0..30).map(profiled).collect()).expect("valid lights"),
        LightTree::default(),
        tree(&mut rng, 20, 4.0),
    ];
    let keys = trees.map(|tree| world.add_tree(tree));
    world.set_light_source(keys[6], TreeSource::GpuParticles).expect("no profiles");
    world.set_light_source(keys[3], TreeSource::GpuMesh).expect("no profiles");
    let policies = [
        Policy::Budgeted,
        Policy::Bounded { floor: 0.1, ceiling: 0.5 },
        Policy::Static,
        Policy::RefitOnly,
        Policy::Deviation { attribute: Attribute::Variance, deviation: 0.25, factor: 2.0 },
        Policy::Ratio { attribute: Attribute::Overlap, factor: 1.5 },
        Policy::AlwaysRebuild,
    ];
    let mut instances = Vec::new();
    for i in 0..60 {
        let turned = Mat3::from_rotation_y(i as f32);
        let placement = Placement { linear: turned, ..at(2048.0 + f64::from(i % 8), 0.5, -1024.0 + f64::from(i)) };
        let index = i as usize % keys.len();
        instances.push(world.add_instance(keys[index], placement, policies[index]).expect("valid"));
    }
    // The first instance of its tree comes last, so the tree is not built for it.
    world.add_instance(keys[3], stretch, Policy::Budgeted).expect("valid");
    world.add_instance(keys[0], Placement { linear: Mat3::ZERO, ..stretch }, Policy::Budgeted).expect("hidden");
    for (i, key) in instances.iter().enumerate() {
        match i % 5 {
            0 => world.set_appearance(*key, |a| a.factor = Vec3::new(0.5, 1.0, 2.0)),
            1 => world.set_appearance(*key, |a| a.mask = 0b110),
            2 => world.set_appearance(*key, |a| a.user_data = i as u32),
            3 if i % 2 == 0 => world.set_appearance(*key, |a| a.is_enabled = false),
            _ => Ok(()),
        }
        .expect("it lives");
    }
    for (direction, lux) in [(Vec3::NEG_Y, 0.25), (Vec3::X, 0.5)] {
        let illuminance = Vec3::splat(lux);
        world.add_directional(DirectionalLight { direction, illuminance }).expect("valid");
    }
    [0, 7, 33].into_iter().for_each(|i| world.remove_instance(instances[i]).expect("it lives"));
    for _ in 0..3 {
        world.update(FrameBudget::NONE);
    }
    world
}

fn dumped(world: &LightWorld) -> Vec<u8> {
    let mut bytes = Vec::new();
    world.write_dump(&mut bytes).expect("memory takes all");
    bytes
}

fn read(bytes: &[u8]) -> LightWorld {
    LightWorld::from_dump(bytes).expect("a dump").0
}

/// A light, by the slot of its instance, or the place of a directional light in the order of all.
fn name(world: &LightWorld, light: LightId) -> (u32, u32) {
    match light {
        LightId::Local { instance, light } => (world.slot(instance).expect("it lives"), light),
        LightId::Directional(key) => {
            (u32::MAX, world.directionals().position(|other| other == key).expect("it lives") as u32)
        }
    }
}

/// What is sampled in a world at some points, bit for bit.
fn samples(world: &LightWorld) -> Vec<((u32, u32), [u32; 8])> {
    let sampler = world.sampler();
    let mut rng = Rng(77);
    let mut found = Vec::new();
    for i in 0..600 {
        let position = Vec3::new(rng.between(-5.0, 12.0), rng.between(-2.0, 9.0), rng.between(-5.0, 70.0));
        let point = if i % 3 == 0 { ShadingPoint::volume(position) } else { ShadingPoint::surface(position, Vec3::Y) };
        let point = if i % 4 == 0 { point.with_mask(0b10) } else { point };
        let u = [0; 4].map(|_| rng.between(0.0, 0.999));
        if let Some(sample) = sampler.sample(&point, u) {
            let incident = sample.incident;
            let [x, y, z] = incident.radiance.to_array();
            let [a, b, _] = incident.direction.to_array();
            let numbers = [sample.pmf, incident.pdf, x, y, z, a, b].map(f32::to_bits);
            let [p, q, r, s, t, v, w] = numbers;
            found.push((name(world, sample.light), [p, q, r, s, t, v, w, sample.user_data]));
        }
    }
    assert!(found.len() > 400 || world.trees().len() == 1, "{}", found.len());
    found
}

fn trees(world: &LightWorld) -> impl Iterator<Item = (TreeKey, &LightTree)> {
    world.trees().map(|key| (key, world.tree(key).expect("it lives")))
}

#[test]
fn a_dump_has_the_same_nodes_instances_samples_and_probabilities() {
    let world = world();
    let parts = world.parts().len();
    assert!(parts > world.instances().len() + 200, "some trees are opened: {parts}");
    let back = read(&dumped(&world));
    assert_eq!(back.trees().len(), world.trees().len());
    for ((key, tree), (back_key, loaded)) in trees(&world).zip(trees(&back)) {
        assert_eq!((loaded.nodes(), loaded.leaves(), loaded.lights()), (tree.nodes(), tree.leaves(), tree.lights()));
        assert_eq!((loaded.cluster(), loaded.attributes()), (tree.cluster(), tree.attributes()));
        assert_eq!((loaded.sides(), loaded.effects()), (tree.sides(), tree.effects()));
        assert_eq!(back.openings(back_key), world.openings(key));
        let source = |world: &LightWorld, key| world.light_source(key).map(|(source, _)| source);
        assert_eq!(source(&back, back_key), source(&world, key));
    }
    let instances = |world: &LightWorld| -> Vec<_> {
        let of = |key: InstanceKey| {
            let tree =
                world.instance(key).map(|i| i.tree).and_then(|tree| world.trees().position(|other| other == tree));
            let appearance = world.instance(key).expect("it lives").appearance;
            (
                world.slot(key),
                tree,
                world.instance(key).map(|i| i.placement),
                world.instance(key).map(|i| i.policy),
                appearance,
            )
        };
        world.instances().map(of).collect()
    };
    assert_eq!(instances(&back), instances(&world));
    assert_eq!(back.active_effects(), world.active_effects());
    assert_eq!(back.origin(), world.origin());
    assert_eq!(back.parts(), world.parts());
    assert_eq!(back.top_nodes(), world.top_nodes());
    assert_eq!(samples(&back), samples(&world));
    assert_eq!(dumped(&back), dumped(&world), "a dump of a dump");
}

#[test]
fn an_update_of_a_dump_builds_nothing() {
    let mut back = read(&dumped(&world()));
    let former = samples(&back);
    let report = back.update(FrameBudget::UNLIMITED);
    assert_eq!((report.rebuilt_trees, report.refit_trees), (0, 0));
    assert_eq!(samples(&back), former);
}

#[test]
fn a_loose_tree_stays_loose() {
    let mut rng = Rng(9);
    let tree = loose(&mut rng, 500);
    let fresh = LightTree::new(tree.lights().to_vec()).expect("valid lights");
    let mut world = LightWorld::new();
    world.add_tree(tree);
    let back = read(&dumped(&world));
    let (_, loaded) = trees(&back).next().expect("a tree");
    assert!(loaded.attributes().overlap > 2.0 * fresh.attributes().overlap);
    assert_eq!(loaded.nodes(), trees(&world).next().expect("a tree").1.nodes());
}

#[test]
fn scattered_nodes_come_in_order_with_the_same_boxes_and_probabilities() {
    let mut rng = Rng(3);
    let mut world = LightWorld::new();
    let key = world.add_tree(scattered(&mut rng));
    world.add_instance(key, at(1.0, 2.0, 3.0), Policy::RefitOnly).expect("valid");
    let back = read(&dumped(&world));
    let (tree, (_, loaded)) = (world.tree(key).expect("it lives"), trees(&back).next().expect("a tree"));
    loaded.check().expect("the tree is sound");
    let in_use = tree.nodes().iter().filter(|node| node.count() > 0).count();
    assert_eq!((loaded.nodes().len(), loaded.lights()), (in_use, tree.lights()));
    let boxes = |tree: &LightTree| {
        let in_use = tree.nodes().iter().filter(|node| node.count() > 0);
        let mut boxes: Vec<_> = in_use.map(|node| (node.origin.map(f32::to_bits), node.low, node.high)).collect();
        boxes.sort_unstable();
        boxes
    };
    assert_eq!(boxes(loaded), boxes(tree));
    assert_eq!(samples(&back), samples(&world));
    let mut edited = loaded.clone();
    edited.add_lights(&lamps(&mut rng, 20, 5.0)).expect("valid lights");
    edited.check().expect("the tree is sound");
}

#[test]
fn a_tree_without_its_lights_and_one_of_a_single_node_come_back() {
    let mut rng = Rng(4);
    let mut world = LightWorld::new();
    for count in [1, 5, 8, 30] {
        let mut few = tree(&mut rng, count, 3.0);
        few.remove_lights(&(0..count as u32 - 1).collect::<Vec<_>>()).expect("distinct");
        world.add_tree(few.clone());
        few.remove_lights(&[count as u32 - 1]).expect("it is the last");
        world.add_tree(few);
    }
    let back = read(&dumped(&world));
    for ((_, tree), (_, loaded)) in trees(&world).zip(trees(&back)) {
        assert_eq!((loaded.lights(), loaded.light_count()), (tree.lights(), tree.light_count()));
        loaded.check().expect("the tree is sound");
    }
}

#[test]
fn what_a_dump_lacks_is_counted() {
    let mut world = world();
    let whole = dumped(&world);
    let sky = world.set_sky(Sky::from_fn(32, |_| Vec3::ONE).expect("a map"));
    let key = world.trees().next().expect("a tree");
    world.set_emission(key, 0, Vec3::splat(9.0)).expect("valid");
    let mut bytes = Vec::new();
    let left_out = world.write_dump(&mut bytes).expect("memory takes all");
    assert_eq!(left_out, LeftOut { skies: 1, portals: 0, waiting_trees: 1, gpu_trees: 2 });
    let (back, found) = LightWorld::from_dump(&bytes).expect("a dump");
    assert_eq!((found, back.sky().is_none()), (left_out, true));
    // The sky has taken the slot of an instance that was removed.
    assert!(world.slot(sky).is_some_and(|slot| back.instance_at(slot).is_none()));
    assert_eq!(samples(&back), samples(&read(&whole)));
}

#[test]
fn a_profile_that_no_one_has_made_comes_with_the_dump() {
    let lamp = of_degrees(&[0.0, 45.0, 91.25], &[0.0, 90.0], &[5.0, 4.0, 3.0, 2.0, 1.0, 0.5]);
    let record = lamp.record();
    // Another process would make the profile anew.
    let mut other = record.clone();
    other[11 + 1] = 0.7f32.to_bits();
    let made = Profile::of_record(&other).expect("sound");
    assert!(made != lamp && Profile::of_record(&record) == Some(lamp) && made.record() == other);
    for (at, value) in [(0, 0), (1, u32::MAX), (2, 0.5f32.to_bits()), (11, f32::NAN.to_bits()), (12, 4.0f32.to_bits())]
    {
        let mut wrong = record.clone();
        wrong[at] = value;
        assert_eq!(Profile::of_record(&wrong), None, "{at}");
    }
    assert_eq!(Profile::of_record(&record[..record.len() - 1]), None);
}

/// A small dump in which every byte counts.
fn small() -> Vec<u8> {
    let mut rng = Rng(8);
    let mut world = LightWorld::new();
    let keys = [12, 3].map(|count| world.add_tree(tree(&mut rng, count, 3.0)));
    let lamp = Light::profile(Vec3::ZERO, Quat::IDENTITY, street_lamp(1), Vec3::ONE);
    let profiled = world.add_tree(LightTree::new(vec![lamp]).expect("valid"));
    world.set_light_source(keys[0], TreeSource::GpuParticles).expect("no profiles");
    let bounded = Policy::Bounded { floor: 0.1, ceiling: 0.5 };
    let first = world.add_instance(keys[0], Placement::IDENTITY, bounded).expect("valid");
    world.add_instance(keys[0], at(5.0, 0.0, 0.0), Policy::Budgeted).expect("valid");
    world.add_instance(profiled, at(0.0, 0.0, 3.0), Policy::Budgeted).expect("valid");
    world.remove_instance(first).expect("it lives");
    let moon = DirectionalLight { direction: Vec3::NEG_Y, illuminance: Vec3::ONE };
    world.add_directional(moon).expect("valid");
    dumped(&world)
}

#[test]
fn every_truncation_and_every_flipped_byte_is_refused() {
    let bytes = small();
    read(&bytes);
    for end in 0..bytes.len() {
        let refused = LightWorld::from_dump(&bytes[..end]).expect_err("it is not complete");
        assert!(matches!(refused.code(), 1100 | 1102), "{end}: {refused}");
    }
    for at in 0..bytes.len() {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x41;
        let refused = LightWorld::from_dump(&damaged).expect_err("it is damaged");
        assert!(matches!(refused.code(), 1100..=1102), "{at}: {refused}");
    }
}

#[test]
fn whatever_a_forged_dump_says_it_is_refused_or_a_world_that_can_be_used() {
    let bytes = small();
    let (mut worlds, mut errors) = (0, std::collections::BTreeSet::new());
    let mut try_read = |forged: &mut Vec<u8>| {
        seal(forged);
        match LightWorld::from_dump(forged) {
            Ok((mut world, _)) => {
                worlds += 1;
                let point = ShadingPoint::surface(Vec3::Y, Vec3::Y);
                let mut pmfs = Vec::new();
                world.sampler().distribution(&point, &mut pmfs);
                assert!(pmfs.iter().sum::<f32>() <= 1.001);
                world.update(FrameBudget::UNLIMITED);
                world.sampler().sample(&point, [0.5; 4]);
            }
            Err(error) => drop(errors.insert(error.code())),
        }
    };
    for at in 8..bytes.len() - 4 {
        for mask in [0x01, 0x80, 0xff] {
            let mut forged = bytes.clone();
            forged[at] ^= mask;
            try_read(&mut forged);
        }
    }
    for at in (8..bytes.len() - 4).step_by(4) {
        for value in [0, u32::MAX, 1 << 31, 0x7fc0_0000, 0x7f80_0000] {
            let mut forged = bytes.clone();
            forged[at..at + 4].copy_from_slice(&value.to_le_bytes());
            try_read(&mut forged);
        }
    }
    for end in 12..bytes.len() {
        try_read(&mut bytes[..end].to_vec());
    }
    let mut longer = bytes.clone();
    longer.extend([0; 4]);
    try_read(&mut longer);
    assert!(worlds > 200, "{worlds}");
    assert!([1101, 1104].into_iter().eq(errors), "other versions and wrong contents");
}

#[test]
fn particles_of_more_instances_than_a_top_level_should_hold_are_refused() {
    let mut rng = Rng(10);
    let [many, one] = [2048, 1].map(|count| tree(&mut rng, count, 3.0));
    // Parts of the first instance of a tree follow from bytes of the tree; those of others cost a record each.
    let forged = |instances: usize, of_one: usize| {
        let mut world = LightWorld::new();
        for (tree, count) in [(&many, instances), (&one, of_one)] {
            let key = world.add_tree(tree.clone());
            for i in 0..count {
                world.add_instance(key, at(9.0 * i as f64, 0.0, 0.0), Policy::Static).expect("valid");
            }
            world.set_light_source(key, TreeSource::GpuParticles).expect("no profiles");
        }
        dumped(&world)
    };
    let most = 1 << 21;
    let at_limit = forged(most / 2048 + 1, 1);
    assert!(at_limit.len() < 400_000);
    assert_eq!(read(&at_limit).instances().len(), 1026);
    for (instances, of_one, index) in [(1025, 2, 1026), (2000, 0, 1025), (10 * most / 2048 + 1, 1, 1025)] {
        let error = LightWorld::from_dump(&forged(instances, of_one)).map(drop).expect_err("too many parts");
        let what = format!("instance {index}: more than {most} openings and particles");
        assert!(error.to_string().starts_with(&what), "{error}");
    }
}

#[test]
fn values_that_a_world_refuses_are_refused_with_its_error() {
    let bytes = small();
    // The last instance lies before a directional light of 24 bytes and the checksum.
    let end = bytes.len() - 4 - 24;
    let (nan, infinite_f64) = (f32::NAN.to_bits(), 0x7ff0_0000);
    for (at, value) in [(end - 92, infinite_f64), (end - 72, nan), (end - 36, nan), (end + 12, nan), (16, infinite_f64)]
    {
        let mut forged = bytes.clone();
        forged[at..at + 4].copy_from_slice(&value.to_le_bytes());
        seal(&mut forged);
        let error = LightWorld::from_dump(&forged).map(drop).expect_err("no world takes this value");
        let what = ["the header: ", "instance 2: ", "directional light 0: "];
        assert!(what.iter().any(|what| error.to_string().starts_with(what)), "{at}: {error}");
    }
}

#[test]
fn a_disk_that_is_full_is_the_caller_s_error() {
    struct Full(usize);
    impl std::io::Write for Full {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            self.0 = self.0.checked_sub(bytes.len()).ok_or(std::io::ErrorKind::StorageFull)?;
            Ok(bytes.len())
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }
    let world = world();
    let length = dumped(&world).len();
    assert!(world.write_dump(&mut Full(length)).is_ok());
    for room in [0, 9, length / 2, length - 1] {
        let error = world.write_dump(&mut Full(room)).expect_err("it is full");
        assert_eq!(error.kind(), std::io::ErrorKind::StorageFull);
    }
}
