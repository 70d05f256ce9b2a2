use std::collections::HashMap;

use glam::{DVec3, Quat, Vec3};

use super::*;
use crate::cluster::Aabb;
use crate::instance::placement::Placement;
use crate::light::{Light, luminance};
use crate::policy::Policy;
use crate::sampling::sample::LightSampler;
use crate::shading::shading_point::ShadingPoint;
use crate::tree::LightTree;
use crate::tree::testing::Rng;
use crate::tree::{BuildItem, LEAF, fills_nodes, middle, shape};
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
    let lit: Vec<u32> = (0..parts.len() as u32).filter(|part| parts[*part as usize].1.flux > 0.0).collect();
    let item = |(part, i): (&u32, u32)| BuildItem::new(&parts[*part as usize].1, i);
    let mut items: Vec<BuildItem> = lit.iter().zip(0..).map(item).collect();
    let shape = shape(&mut items);
    let mut tree = PieceTree::default();
    let mut made: Vec<Option<Unit>> = vec![None; shape.len()];
    for (index, node) in shape.iter().enumerate().rev() {
        let units: Vec<Unit> = node.children[..node.count as usize]
            .iter()
            .map(|child| match child & LEAF {
                0 => made[*child as usize].expect("children come after their parents"),
                _ => {
                    let part = lit[(child & !LEAF) as usize];
                    Unit { cluster: parts[part as usize].1, kind: UnitKind::Part(part) }
                }
            })
            .collect();
        made[index] = Some(tree.add_node(&units));
    }
    let mut top = TopLevel::without_nodes(parts, slots);
    top.append(tree, &mut Vec::new());
    top
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
    // Enough instances for a pass of several pieces before the last pass.
    let world = city(6000);
    let (parts, slots) = (world.parts(), world.slot_count());
    let (ours, best) = (TopLevel::build(&parts, slots), by_cost(&parts, slots));
    let size = 12.0 * 6000.0_f32.sqrt();
    let position = |i: usize| Vec3::new(random(i, 20) * size, 0.0, random(i, 21) * size);
    let shading_points: Vec<ShadingPoint> = (0..40).map(|i| ShadingPoint::surface(position(i), Vec3::Y)).collect();
    let [ours, best] = [&ours, &best].map(|top| sigmas(&world.sampler().with_top(top), &shading_points));
    let mean = |sigmas: &[f64]| sigmas.iter().sum::<f64>() / sigmas.len() as f64;
    // What is typical. Medians of 40 points vary by a fifth with the sample that divides space.
    let geometric = |sigmas: &[f64]| mean(&sigmas.iter().map(|sigma| sigma.ln()).collect::<Vec<_>>()).exp();
    let (means, typical) = (mean(&ours) / mean(&best), geometric(&ours) / geometric(&best));
    assert!(mean(&best) > 0.1, "there is too little noise to compare");
    // Only the bottom-level build divides by directions.
    assert!(means < 1.2 && typical < 1.2, "{means} {typical}");
}

/// The worst that can become of a part, whatever its units are.
#[derive(Clone, Copy, Default)]
struct Worst {
    /// The cuts of the part and of all that it is cut into.
    cuts: usize,
    /// The rounds in which the part, and parts of its kind that it is cut into, are cut.
    rounds: usize,
}

/// The worst for a part of `count` units that comes from `round` cuts of its kind.
fn worst(count: usize, round: usize, known: &mut HashMap<(usize, usize), Worst>) -> Worst {
    if count <= WIDTH {
        return Worst::default();
    }
    if let Some(worst) = known.get(&(count, round)) {
        return *worst;
    }
    let is_large = |count: usize| count > SMALL;
    let last = if is_large(count) { LARGE_ROUNDS } else { SMALL_ROUNDS };
    let cuts = |left: usize| round < last && fills_nodes(left) && fills_nodes(count - left);
    let mut all = Worst::default();
    for left in (1..count).filter(|left| *left == middle(count) || cuts(*left)) {
        let mut both = Worst { cuts: 1, rounds: 1 };
        for half in [left, count - left] {
            let is_alike = is_large(half) == is_large(count);
            let below = worst(half, if is_alike { last.min(round + 1) } else { 0 }, known);
            both.cuts += below.cuts;
            both.rounds = both.rounds.max(if is_alike { 1 + below.rounds } else { 0 });
        }
        all = Worst { cuts: all.cuts.max(both.cuts), rounds: all.rounds.max(both.rounds) };
    }
    known.insert((count, round), all);
    all
}

#[test]
fn no_piece_needs_more_rounds_than_shaders_make() {
    let known = &mut HashMap::new();
    let large = (SMALL + 1..=PIECE).map(|count| worst(count, 0, known).rounds).max();
    let small = (WIDTH + 1..=SMALL).map(|count| worst(count, 0, known).rounds).max();
    assert_eq!((large, small), (Some(LARGE_ROUNDS + LARGE_HALVINGS), Some(SMALL_ROUNDS + SMALL_HALVINGS)));
}

/// Whether a side of a cut can have `count` units.
fn is_side(count: usize) -> bool {
    fills_nodes(count) || [middle(31), 31 - middle(31)].contains(&count)
}

/// For each number of units the most nodes that they need, as one part that is a node.
fn most_nodes_of_parts() -> Vec<usize> {
    // Nodes without nodes below them but those of full parts: `parts` parts of 1 or of 6 to 8 units.
    let mut most: Vec<usize> = (0..=PIECE).map(|count| usize::from(count > 1)).collect();
    for (singles, sixes, sevens) in (0..9).flat_map(|a| (0..9).flat_map(move |b| (0..9).map(move |c| (a, b, c)))) {
        for eights in 0..9 {
            let parts = singles + sixes + sevens + eights;
            let count = singles + 6 * sixes + 7 * sevens + 8 * eights;
            if !(2..=WIDTH).contains(&parts) || count <= WIDTH {
                continue;
            }
            let sizes = [1; WIDTH].into_iter().take(singles).chain([6; WIDTH].into_iter().take(sixes));
            let sizes = sizes.chain([7; WIDTH].into_iter().take(sevens)).chain([8; WIDTH].into_iter().take(eights));
            let mut room = WIDTH - parts;
            let closed = sizes.filter(|size| {
                let is_inlined = *size - 1 <= room;
                room -= if is_inlined { *size - 1 } else { 0 };
                !is_inlined
            });
            most[count] = most[count].max(1 + closed.count());
        }
    }
    // No cut of 10 or 11 leaves full parts, and 9 and 17 leave one unit alone.
    for count in [9, 10, 11, 17] {
        most[count] = most[count].max(2 + count / 10);
    }
    // Other nodes have eight children: `below[k][count]` is the most nodes of k children.
    let mut below = vec![[None::<usize>; PIECE + 1]; WIDTH + 1];
    below[0][0] = Some(0);
    for count in 1..=PIECE {
        for children in 2..=WIDTH {
            let of = |child: usize| Some(below[children - 1][count - child]? + if child > 1 { most[child] } else { 0 });
            below[children][count] = (1..count).filter(|child| is_side(*child)).filter_map(of).max();
        }
        if count > WIDTH {
            most[count] = most[count].max(below[WIDTH][count].map_or(0, |nodes| nodes + 1));
        }
        below[1][count] = is_side(count).then_some(if count > 1 { most[count] } else { 0 });
    }
    most
}

#[test]
fn no_piece_has_more_cuts_or_nodes_than_there_is_room_for() {
    let known = &mut HashMap::new();
    let cuts = (0..=PIECE).map(|count| worst(count, 0, known).cuts).max();
    assert!(cuts.is_some_and(|cuts| (200..=MAX_CUTS).contains(&cuts)), "{cuts:?}");
    // The number of the first cut of a part has eight bits and is not 0.
    const { assert!(MAX_CUTS < 256 && PIECE < 512) };
    // The nodes of a piece that leaves any number of parts.
    let of_part = most_nodes_of_parts();
    let mut most = vec![0; PIECE + 1];
    for count in 1..=PIECE {
        let sides = (1..=count).filter(|part| is_side(*part));
        let nodes = sides.map(|part| most[count - part] + if part > 1 { of_part[part] } else { 0 });
        most[count] = nodes.max().unwrap_or(0);
    }
    // A piece that fits into a node is one, whatever its count.
    for nodes in &mut most[2..=WIDTH] {
        *nodes = 1.max(*nodes);
    }
    for count in UNITS_PER_NODE..=PIECE {
        assert!(most[count] <= most_nodes(count), "{count}: {}", most[count]);
    }
    // The whole tree has a root even for one unit, and one node more is reserved for it.
    for count in 0..=PIECE {
        assert!(of_part[count].max(1) <= most_nodes(count) + 1, "{count}: {}", of_part[count]);
    }
    assert!(most[PIECE] > PIECE / 5, "the bound is not far from the worst case");
}

/// Clusters whose boxes halve in numbers and shrink to a fortieth, or lose one unit or eight, with each cut.
fn nested(count: usize, origin: f32, size: f32, rng: &mut Rng, units: &mut Vec<Cluster>) {
    let sides = [1, 8, count / 2, count / 2 + 1].map(|side| side.min(count));
    let side = sides[(rng.unit() * 4.0) as usize];
    if count <= 2 * WIDTH || !fills_nodes(side) || !fills_nodes(count - side) {
        let lamp = LightTree::new(vec![Light::point(Vec3::ZERO, Vec3::ONE)]).expect("valid").cluster();
        units.extend((0..count).map(|_| {
            let mean = Vec3::X * (origin + size * rng.unit());
            Cluster { mean, aabb: Aabb { min: mean, max: mean }, ..lamp }
        }));
        return;
    }
    nested(count - side, origin, size / 40.0, rng, units);
    nested(side, origin + size, size / 40.0, rng, units);
}

#[test]
fn tiny_parts_need_no_more_nodes_than_there_is_room_for() {
    // One tiny part at each depth to which cuts are searched for.
    let mut most_tiny = 0;
    for (round, count) in (0..40).flat_map(|round| [WIDTH + 1, 31, 32, 100, 300, PIECE].map(|count| (round, count))) {
        let mut units = Vec::new();
        nested(count, 0.0, 1.0e15, &mut Rng(round << 32 | count as u64), &mut units);
        let split = SplitPiece::new(units.iter(), count / 3);
        let tiny = split.parts.iter().filter(|part| part.is_tiny).count();
        let in_order = split.order.iter().zip(0..);
        let in_order: Vec<Unit> =
            in_order.map(|(unit, i)| Unit { cluster: units[*unit], kind: UnitKind::Part(i) }).collect();
        let mut root = PieceTree::default();
        root.add_part(&in_order, &split.parts, split.parts[0]);
        assert!(root.nodes.len() <= most_nodes(count) + 1 + tiny, "{round}, {count}: {}, {tiny}", root.nodes.len());
        assert!(tiny <= MAX_TINY, "{round}, {count}: {tiny}");
        most_tiny = most_tiny.max(tiny);
    }
    assert!(most_tiny > MAX_TINY / 4, "{most_tiny}");
}
