//! Reads the buffers of a device as shaders do, and compares them with the world, which has point
//! lights only, or with those of a new planner.

use std::collections::HashSet;

use girandole::plan::{LightPlanner, PlanLimits};
use girandole::tree::{EMPTY_SLOT, LEAF, NO_PARENT, WIDTH};
use girandole::{Light, LightTree, LightWorld};

use super::plan_device::{Device, Played, slots};

/// The index of the first stand-in of a tree.
const STAND_IN: u32 = 1 << 30;

/// The word of a node that holds its parent, and that of a light that holds its place.
const PARENT: usize = 36;
const PLACE: usize = 7;

/// The words of the parameters that say where directional lights, parts and masks start.
const PLACES_OF_PARAMS: [usize; 3] = [1, 5, 7];
const FLAGS: usize = 12;
/// The bytes of the record of a part.
const PART_BYTES: usize = 80;
/// The words of an instance that say where its tree, its nodes, its lights and its parts start.
const PLACES_OF_INSTANCE: [usize; 4] = [13, 14, 15, 16];

/// Bits of the flags of an instance.
const LIVE: u32 = 1;
const STANDS_IN: u32 = 16;

/// A buffer as words, and the words of one record.
struct Records<'a> {
    bytes: &'a [u8],
    stride: usize,
}

impl Records<'_> {
    fn word(&self, record: u32, word: usize) -> u32 {
        let at = 4 * (record as usize * self.stride + word);
        u32::from_le_bytes(self.bytes[at..at + 4].try_into().expect("four bytes"))
    }

    fn words(&self, record: u32) -> Vec<u32> {
        (0..self.stride).map(|word| self.word(record, word)).collect()
    }

    fn float(&self, record: u32, word: usize) -> f32 {
        f32::from_bits(self.word(record, word))
    }
}

/// The parameters, nodes, instances and lights.
fn records(played: &Played) -> [Records<'_>; 4] {
    let [params, _, nodes, instances, lights] = played.bound().map(|id| played.device.content(id));
    let of = |bytes, stride| Records { bytes, stride };
    [of(params, 12), of(nodes, 56), of(instances, 40), of(lights, 16)]
}

/// What was found of an instance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Found {
    /// Lights of trees that are whole.
    pub lights: usize,
    pub stand_ins: usize,
}

/// Checks that shaders find for each shown instance either its lights or stand-ins of about the same
/// flux, and never anything else. Returns how many of each.
pub fn check(played: &Played, world: &LightWorld) -> Found {
    let [_, nodes, instances, lights] = records(played);
    let mut all = Found::default();
    for key in world.instances() {
        let slot = world.slot(key).expect("it lives");
        let flags = instances.word(slot, FLAGS);
        assert_eq!(flags & LIVE, LIVE, "slot {slot} is shown");
        let [node_base, light_base] = [14, 15].map(|word| instances.word(slot, word));
        let tree_key = world.instance(key).expect("it lives").tree;
        let tree = world.tree(tree_key).expect("it lives");
        let (mut found, mut openings) = (Vec::new(), Vec::new());
        let mut stack = vec![0];
        while let Some(node) = stack.pop() {
            if tree.nodes().is_empty() {
                break;
            }
            for place in 0..WIDTH as u32 {
                let target = nodes.word(node_base + node, 4 + 4 * place as usize);
                if target == EMPTY_SLOT {
                    continue;
                }
                if target & LEAF == 0 {
                    assert!(target > node, "children follow their parents");
                    match nodes.word(node_base + target, PARENT) {
                        opening if opening & LEAF != 0 => openings.push(opening & !LEAF),
                        found => assert_eq!(found, node * WIDTH as u32 + place, "the parent of a node"),
                    }
                    stack.push(target);
                    continue;
                }
                let index = target & !LEAF;
                let record = light_base.wrapping_add(index);
                match lights.word(record, PLACE) {
                    // A light that is an opening of its tree by itself.
                    opening if opening & LEAF != 0 => openings.push(opening & !LEAF),
                    found => assert_eq!(found, node * WIDTH as u32 + place, "the place of a light"),
                }
                let light = Light::point(
                    [0, 1, 2].map(|word| lights.float(record, word)).into(),
                    [4, 5, 6].map(|word| lights.float(record, word)).into(),
                );
                found.push((index, light));
            }
        }
        found.sort_by_key(|(index, _)| *index);
        assert!(found.windows(2).all(|pair| pair[0].0 < pair[1].0), "each light once");
        openings.sort_unstable();
        assert!(openings.iter().zip(0..).all(|(opening, index)| *opening == index), "{openings:?}");
        let stands_in = flags & STANDS_IN != 0;
        assert_eq!(stands_in, played.planner.stands_in(tree_key), "slot {slot}");
        if stands_in {
            check_stand_ins(tree, &found);
            all.stand_ins += found.len();
        } else {
            check_lights(tree, &found, played.planner.is_waiting(tree_key));
            all.lights += found.len();
        }
    }
    all
}

/// The records of the parts of a shown instance, as the build of the top level reads them.
fn part_records(played: &Played, slot: u32, tree: u32) -> Vec<u8> {
    let [pass, .., parts, _, trees] = played.device.leaves[..] else { unreachable!("seven buffers") };
    let words = |id, stride| Records { bytes: played.device.content(id), stride };
    let (count, parts) = (words(pass, 1).word(0, 0), words(parts, 2));
    let own = (0..count).filter(|part| parts.word(*part, 0) == slot).count();
    played.device.content(trees)[PART_BYTES * tree as usize..][..PART_BYTES * own].to_vec()
}

/// Checks that shaders and the build of the top level read the same bits as with a new planner, but
/// for the places of records in their buffers, and for trees that wait in an older version. Stand-ins
/// are those of a new planner that sends no large tree whole. Returns how many trees were compared.
///
/// Nodes that a tree has spare, and slots without an instance, are read by nobody, so they may hold
/// what was there before.
pub fn check_as_new(played: &Played, world: &LightWorld) -> Found {
    check_as_new_within(PlanLimits::default(), played, world)
}

/// As [`check_as_new`], with a new planner within these limits.
pub fn check_as_new_within(limits: PlanLimits, played: &Played, world: &LightWorld) -> Found {
    let new = |limits| {
        let mut new = Played { planner: LightPlanner::new(limits), device: Device::default() };
        new.frame(world);
        new
    };
    let whole = new(limits);
    let few = world.trees().any(|tree| played.planner.stands_in(tree));
    let few = few.then(|| new(limits.with_frame_bytes(0)));
    let [params, _, instances, _] = records(played);
    let [expected, ..] = records(&whole);
    let [ours, new] = [&params, &expected].map(|params| without(params.words(0), &PLACES_OF_PARAMS));
    assert_eq!(ours, new, "parameters");
    assert_eq!(params.word(0, 7) > 0, expected.word(0, 7) > 0, "masks");
    for light in 0..params.word(0, 2) {
        let [ours, new] = [played, &whole].map(|played| {
            let [params, .., lights] = records(played);
            lights.words(params.word(0, 1) + light)
        });
        assert_eq!(ours, new, "directional light {light}");
    }
    let (mut seen, mut found) = (HashSet::new(), Found::default());
    for slot in 1..slots(world) as u32 {
        let Some(key) = world.instance_at(slot) else {
            assert_eq!(instances.word(slot, FLAGS) & LIVE, 0, "slot {slot}");
            continue;
        };
        let tree_key = world.instance(key).expect("it lives").tree;
        let tree = world.tree(tree_key).expect("it lives");
        let stands_in = instances.word(slot, FLAGS) & STANDS_IN != 0;
        let is_older = !stands_in && played.planner.is_waiting(tree_key);
        let new = few.as_ref().filter(|_| stands_in).unwrap_or(&whole);
        // Where not all trees fit, it depends on what happened before which of them stand in.
        if new.planner.stands_in(tree_key) != stands_in {
            continue;
        }
        let read = [played, new].map(|played| {
            let [_, nodes, instances, lights] = records(played);
            let mut words = instances.words(slot);
            // The flags of an older version have its birth number.
            words[FLAGS] &= if is_older { LIVE } else { u32::MAX };
            let bases = PLACES_OF_INSTANCE.map(|word| words[word]);
            (without(words, &PLACES_OF_INSTANCE), bases, nodes, lights)
        });
        let [(ours, bases, nodes, lights), (expected, new_bases, new_nodes, new_lights)] = read;
        assert_eq!(ours, expected, "slot {slot}");
        if ours[FLAGS] & LIVE == 0 || is_older {
            continue;
        }
        let parts = part_records(played, slot, bases[0]);
        assert!(parts == part_records(new, slot, new_bases[0]), "the parts of slot {slot}");
        if !seen.insert(tree_key) {
            continue;
        }
        let (mut below, mut read, mut openings) = (vec![0], Vec::new(), 0);
        while let Some(node) = below.pop().filter(|_| !tree.nodes().is_empty()) {
            let words = nodes.words(bases[1] + node);
            assert_eq!(words, new_nodes.words(new_bases[1] + node), "node {node} of slot {slot}");
            openings += usize::from(words[PARENT] & LEAF != 0 && words[PARENT] != NO_PARENT);
            let children = (0..WIDTH).map(|place| words[4 + 4 * place]).filter(|child| *child != EMPTY_SLOT);
            let (leaves, inner): (Vec<_>, Vec<_>) = children.partition(|child| child & LEAF != 0);
            below.extend(inner);
            read.extend(leaves.into_iter().map(|leaf| leaf & !LEAF));
        }
        if !stands_in {
            // Also those that were removed.
            read = (0..tree.lights().len() as u32).collect();
        }
        for light in &read {
            let words = lights.words(bases[2].wrapping_add(*light));
            assert_eq!(words, new_lights.words(new_bases[2].wrapping_add(*light)), "light {light} of slot {slot}");
            openings += usize::from(words[PLACE] & LEAF != 0 && words[PLACE] != NO_PARENT);
        }
        // A part that is no opening is the whole tree.
        let expected = parts.len() / PART_BYTES;
        assert!(openings == expected || (openings, expected) == (0, 1), "{openings} openings of {expected}");
        found.stand_ins += usize::from(stands_in);
        found.lights += usize::from(!stands_in);
    }
    found
}

/// Words without those that name places.
fn without(mut words: Vec<u32>, places: &[usize]) -> Vec<u32> {
    places.iter().for_each(|place| words[*place] = 0);
    words
}

fn check_stand_ins(tree: &LightTree, found: &[(u32, Light)]) {
    assert!(found.len() <= 64 && found.iter().all(|(index, _)| *index >= STAND_IN));
    for (_, light) in found {
        assert!(tree.lights().iter().any(|other| other.shape == light.shape), "{light:?} is a light of the tree");
    }
    let flux: f32 = found.iter().map(|(_, light)| light.flux()).sum();
    let expected = tree.cluster().flux;
    assert!((flux - expected).abs() <= 0.01 * expected, "{flux} stands in for {expected}");
}

/// A tree that waits is older than in the world.
fn check_lights(tree: &LightTree, found: &[(u32, Light)], is_older: bool) {
    assert!(found.iter().all(|(index, _)| *index < STAND_IN));
    let live = (0..).zip(tree.lights()).filter(|(_, light)| !light.is_removed());
    let is_same = live.clone().count() == found.len()
        && live
            .zip(found)
            .all(|((i, light), (j, other))| i == *j && light.shape == other.shape && light.emission == other.emission);
    assert!(is_same || is_older, "{} lights of {}", found.len(), tree.light_count());
}
