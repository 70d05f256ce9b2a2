mod lasting;

use glam::{DVec3, Quat, Vec3};

use super::partition::Place;
use super::partition::renewal::RENEWED_PARTS;
use super::*;
use crate::instance::placement::Placement;
use crate::light::{Light, luminance};
use crate::policy::Policy;
use crate::sampling::sample::LightSampler;
use crate::scheduler::FrameBudget;
use crate::shading::shading_point::ShadingPoint;
use crate::tree::LightTree;
use crate::tree::testing::Rng;
use crate::tree::{BuildItem, LEAF, shape};
use crate::world::LightWorld;

/// A number in [0, 1) for each index and purpose.
fn random(index: usize, purpose: u64) -> f32 {
    Rng((index as u64 * 64 + purpose).wrapping_mul(0x9e37_79b9_7f4a_7c15)).unit()
}

/// A square city with lamps, shop windows and strings of lights along its streets, each an
/// instance.
fn city(instances: usize) -> LightWorld {
    let mut world = LightWorld::new();
    let mut add = |lights: Vec<Light>| world.add_tree(LightTree::new(lights).expect("valid lights"));
    let head = Light::spot(Vec3::Y * 6.0, Vec3::NEG_Y, 0.6, 1.2, Vec3::splat(900.0));
    let trees = [
        add(vec![head]),
        add((0..12).map(|i| Light::point(Vec3::new(i as f32, 4.0 + random(i, 0), 0.0), Vec3::splat(20.0))).collect()),
        add((0..4)
            .map(|i| Light::rectangle(Vec3::new(3.0 * i as f32, 2.0, 0.0), Vec3::X, Vec3::Y, Vec3::splat(60.0)))
            .collect()),
        add((0..40)
            .map(|i| {
                Light::point(
                    Vec3::new(8.0 * random(i, 1), 20.0 * random(i, 2), 8.0 * random(i, 3)),
                    Vec3::splat(5.0 + 50.0 * random(i, 4)),
                )
            })
            .collect()),
    ];
    let size = 12.0 * (instances as f32).sqrt();
    for i in 0..instances {
        // Streets are 60 m apart, in both directions.
        let street = (random(i, 10) * size / 60.0).floor() * 60.0 + 4.0 * random(i, 11);
        let along = random(i, 12) * size;
        let (x, z) = if i % 2 == 0 { (street, along) } else { (along, street) };
        let linear = glam::Mat3::from_quat(Quat::from_rotation_y(6.3 * random(i, 13)));
        let placement = Placement { linear, translation: DVec3::new(x.into(), 0.0, z.into()) };
        world.add_instance(trees[(random(i, 14) * 4.0) as usize], placement, Policy::Static).expect("valid");
    }
    world
}

/// The top level over the same parts that is built like a bottom-level tree.
fn by_cost(parts: &[(Part, Cluster)], slots: usize) -> TopLevel {
    let item = |((_, cluster), i): (&(Part, Cluster), u32)| BuildItem::new(cluster, i);
    let shape = shape(&mut parts.iter().zip(0..).map(item).collect::<Vec<_>>());
    let mut top = TopLevel::without_nodes(parts, slots);
    top.nodes.resize(shape.len(), Node::EMPTY);
    let mut build = Build { top, parts, order: Vec::new(), starts: Vec::new(), partition: &Partition::default() };
    let mut made = vec![Unit::EMPTY; shape.len()];
    for (index, node) in shape.iter().enumerate().rev() {
        let unit = |child: &u32| match child & LEAF {
            0 => made[*child as usize],
            _ => Unit { cluster: parts[(child & !LEAF) as usize].1, kind: UnitKind::Part(child & !LEAF) },
        };
        let units: Vec<Unit> = node.children[..node.count as usize].iter().map(unit).collect();
        made[index] = build.pack(index as u32, &units);
    }
    build.top
}

/// The exact relative standard deviation of one sample at each shading point (docs/benchmarks.md).
fn sigmas(sampler: &LightSampler<'_>, shading_points: &[ShadingPoint]) -> Vec<f64> {
    let mut pmfs = Vec::new();
    let sigma = |shading_point: &ShadingPoint| {
        sampler.distribution(shading_point, &mut pmfs);
        let (mut sum, mut squares) = (0.0, 0.0);
        for (light, pmf) in sampler.all_lights().zip(&pmfs) {
            let Some(incident) = sampler.sample_light(shading_point, light, [0.5, 0.5]) else { continue };
            let lux =
                f64::from(luminance(incident.radiance) * incident.direction.dot(shading_point.normal) / incident.pdf);
            sum += lux;
            squares += lux * lux / f64::from(*pmf);
        }
        (squares / (sum * sum) - 1.0).max(0.0).sqrt()
    };
    shading_points.iter().map(sigma).collect()
}

#[test]
fn the_top_level_is_at_most_20_percent_noisier_than_a_bottom_level_build_over_the_instances() {
    let mut world = city(6000);
    world.update(FrameBudget::NONE);
    let (parts, slots) = (world.parts(), world.slot_count());
    let (ours, best) = (TopLevel::build(&parts, slots, world.partition()), by_cost(&parts, slots));
    let size = 12.0 * 6000.0_f32.sqrt();
    let position = |i: usize| Vec3::new(random(i, 20) * size, 0.0, random(i, 21) * size);
    let shading_points: Vec<ShadingPoint> = (0..40).map(|i| ShadingPoint::surface(position(i), Vec3::Y)).collect();
    let [ours, best] = [&ours, &best].map(|top| sigmas(&world.sampler().with_top(top), &shading_points));
    let mean = |sigmas: &[f64]| sigmas.iter().sum::<f64>() / sigmas.len() as f64;
    let geometric = |sigmas: &[f64]| mean(&sigmas.iter().map(|sigma| sigma.ln()).collect::<Vec<_>>()).exp();
    let (means, typical) = (mean(&ours) / mean(&best), geometric(&ours) / geometric(&best));
    assert!(mean(&best) > 0.1, "there is too little noise to compare");
    // Only the bottom-level build divides by directions.
    assert!(means < 1.2 && typical < 1.2, "{means} {typical}");
}

/// The parts of lamps at some places, each an instance.
fn lamps(at: impl Iterator<Item = Vec3>) -> Vec<(Part, Cluster)> {
    let lamp =
        |(slot, at): (u32, Vec3)| (Part { slot, entry: ChildRef::Node(0) }, Light::point(at, Vec3::ONE).cluster());
    (0..).zip(at).map(lamp).collect()
}

/// A partition of lamps, divided by all of them.
fn partition_of(parts: &[(Part, Cluster)]) -> Partition {
    let mut partition = Partition::default();
    parts.iter().for_each(|(part, cluster)| partition.file(part.slot, std::iter::once(Place::of(cluster, 1))));
    partition.renew(usize::MAX, |part| parts[part.slot as usize].1);
    partition
}

/// Checks that each part is a leaf once, where its place says, and returns the depth of the tree.
fn checked_depth(top: &TopLevel, parts: usize) -> usize {
    let mut leaves = 0;
    let mut stack = vec![(ROOT, 1)];
    let mut deepest = 0;
    while let Some((node, depth)) = stack.pop() {
        deepest = deepest.max(depth);
        let record = &top.nodes[node as usize];
        for slot in 0..WIDTH {
            let place = node * WIDTH as u32 + slot as u32;
            match record.child(slot) {
                None => {}
                Some(ChildRef::Leaf(leaf)) => {
                    leaves += 1;
                    assert_eq!(top.places(top.part(leaf).expect("a part").slot), [place]);
                }
                Some(ChildRef::Node(child)) => {
                    assert_eq!(top.nodes[child as usize].parent, place);
                    stack.push((child, depth + 1));
                }
            }
        }
    }
    assert_eq!(leaves, parts);
    deepest
}

#[test]
fn any_number_of_parts_anywhere_makes_a_sound_tree() {
    let far = |i: usize| {
        let (distance, angle) = (10.0_f32.powf(-3.0 + 12.0 * random(i, 1)), 6.3 * random(i, 2));
        distance * Vec3::new(angle.cos(), 0.2, angle.sin())
    };
    type At<'a> = &'a dyn Fn(usize) -> Vec3;
    let places: [(&str, At<'_>, usize); 4] = [
        ("one place", &|_| Vec3::ONE, 9),
        ("a line", &|i| Vec3::X * i as f32, 9),
        ("a grid", &|i| Vec3::new((i % 1000) as f32, 0.0, (i / 1000) as f32), 9),
        ("twelve decades", &far, 16),
    ];
    for (name, at, most) in places {
        for count in [0, 1, 8, 9, 16, 17, 170, 1_000_000] {
            let parts = lamps((0..count).map(at));
            let partition = partition_of(&parts);
            partition.check();
            let depth = checked_depth(&TopLevel::build(&parts, count, &partition), count);
            assert!(depth <= most, "{name}, {count}: {depth}");
            // Without planes the runs of the root hold all parts.
            let depth = checked_depth(&TopLevel::build(&parts, count, &Partition::default()), count);
            assert!(depth <= 7, "{name}, {count}: {depth}");
        }
    }
}

/// The divided nodes that changed after a change with a number.
fn changed_after(partition: &Partition, number: u64) -> usize {
    partition.all_divided().filter(|(.., changed, _)| *changed > number).count()
}

#[test]
fn a_part_that_goes_far_away_and_comes_back_changes_few_nodes() {
    let count = 20_000;
    let mut parts = lamps((0..count).map(|i| 100.0 * Vec3::new(random(i, 1), 0.1 * random(i, 2), random(i, 3))));
    let mut partition = partition_of(&parts);
    let depth = checked_depth(&TopLevel::build(&parts, count, &partition), count);
    let (size, home) = (partition.len(), parts[7].1.mean);
    // In each direction as far as positions go, then back.
    for way in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::new(0.3, -1.0, -0.5)] {
        for step in (0..14).chain((0..14).rev()) {
            let number = partition.number();
            let at = home + way * 4.0_f32.powi(step);
            parts[7].1 = Light::point(at, Vec3::ONE).cluster();
            partition.file(7, std::iter::once(Place::of(&parts[7].1, 1)));
            partition.renew(4096, |part| parts[part.slot as usize].1);
            partition.check();
            assert!(changed_after(&partition, number) < 100, "{} nodes", changed_after(&partition, number));
            let top = TopLevel::build(&parts, count, &partition);
            assert!(checked_depth(&top, count) <= depth + 16);
            // It is alone, or among few others.
            let place = top.places(7)[0];
            let beside = (0..WIDTH).filter(|slot| top.nodes[place as usize / WIDTH].child(*slot).is_some()).count();
            assert!(step < 6 || beside == 2, "{at}: {beside}");
        }
    }
    assert!(partition.len() <= size + 64, "{} nodes, {size} before", partition.len());
    assert_eq!(checked_depth(&TopLevel::build(&parts, count, &partition), count), depth);
}

#[test]
fn large_nodes_are_divided_over_several_renewals_while_parts_move() {
    for moves in [0, 1000] {
        let count = 60_000;
        let mut parts = lamps((0..count).map(|i| 100.0 * Vec3::new(random(i, 1), 0.1 * random(i, 2), random(i, 3))));
        let mut partition = partition_of(&parts);
        let file = |partition: &mut Partition, parts: &mut [(Part, Cluster)], i: usize, at: Vec3| {
            parts[i].1 = Light::point(at, Vec3::ONE).cluster();
            partition.file(i as u32, std::iter::once(Place::of(&parts[i].1, 1)));
        };
        // Most of them gather in a tenth of the space.
        for i in (0..count).filter(|i| i % 8 != 0) {
            let at = Vec3::new(10.0 * random(i, 4), 10.0 * random(i, 5), 100.0 * random(i, 6));
            file(&mut partition, &mut parts, i, at);
        }
        let (mut renewals, mut quiet) = (0, 0);
        while quiet < 2 {
            for i in (0..moves).map(|i| (i * 7919 + renewals * 104_729) % count) {
                let at = parts[i].1.mean + Vec3::new(random(i, 7), 0.0, random(i, 8)) - 0.5;
                file(&mut partition, &mut parts, i, at);
            }
            partition.renew(RENEWED_PARTS, |part| parts[part.slot as usize].1);
            partition.check();
            quiet = if partition.is_dividing() { 0 } else { quiet + 1 };
            renewals += 1;
            assert!(renewals < 200, "{moves} moves");
            if renewals % 10 == 0 {
                checked_depth(&TopLevel::build(&parts, count, &partition), count);
            }
        }
        assert!(renewals > 10, "{renewals} renewals");
        // The cells are about as full as those of a fresh partition.
        let fresh = partition_of(&parts);
        let share = partition.len() as f32 / fresh.len() as f32;
        assert!((0.8..1.25).contains(&share), "{} nodes, {} fresh ones", partition.len(), fresh.len());
    }
}

#[test]
fn partitions_follow_parts_that_move_come_and_go() {
    let mut parts = lamps((0..5000).map(|i| 100.0 * Vec3::new(random(i, 1), 0.1 * random(i, 2), random(i, 3))));
    let mut partition = partition_of(&parts);
    let size = partition.len();
    let renew = |partition: &mut Partition, parts: &[(Part, Cluster)]| {
        partition.check();
        let is_changed = partition.renew(usize::MAX, |part| parts[part.slot as usize].1);
        partition.check();
        checked_depth(&TopLevel::build(parts, parts.len(), partition), parts.len());
        is_changed
    };
    assert!(!renew(&mut partition, &parts), "nothing has moved");
    // Half of them turn away, then all gather at one place, and spread again.
    for round in 0..3 {
        for i in 0..5000 {
            let at = match round {
                0 if i % 2 == 0 => continue,
                1 => Vec3::splat(7.0),
                _ => 100.0 * Vec3::new(random(i, 4), 3.0 + random(i, 5), random(i, 6)),
            };
            parts[i].1 = Light::point(at, Vec3::ONE).cluster();
            partition.file(i as u32, std::iter::once(Place::of(&parts[i].1, 1)));
        }
        assert!(renew(&mut partition, &parts), "round {round}");
    }
    assert!(partition.len() < 2 * size, "{} {size}", partition.len());
    // All but one go.
    (1..5000).for_each(|slot| partition.file(slot, std::iter::empty()));
    parts.truncate(1);
    assert!(renew(&mut partition, &parts));
    assert_eq!(partition.len(), 1);
}
