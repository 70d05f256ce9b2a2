//! Reads the buffers of a device as shaders do, and compares them with the world. For worlds of point
//! lights.

use girandole::tree::{EMPTY_SLOT, LEAF, WIDTH};
use girandole::{Light, LightTree, LightWorld};

use super::plan_device::Played;

/// The index of the first stand-in of a tree.
const STAND_IN: u32 = 1 << 30;

/// The word of a node that holds its parent.
const PARENT: usize = 36;

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

    fn float(&self, record: u32, word: usize) -> f32 {
        f32::from_bits(self.word(record, word))
    }
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
    let [params, _, nodes, instances, lights] = played.bound();
    let params = Records { bytes: played.device.content(params), stride: 0 };
    let records = |id, word| Records { bytes: played.device.content(id), stride: 4 * params.word(0, word) as usize };
    let (nodes, lights, instances) = (records(nodes, 4), records(lights, 6), records(instances, 7));
    let mut all = Found::default();
    for key in world.instances() {
        let slot = world.slot(key).expect("it lives");
        let flags = instances.word(slot, 12);
        assert_eq!(flags & LIVE, LIVE, "slot {slot} is shown");
        let [node_base, light_base] = [14, 15].map(|word| instances.word(slot, word));
        let tree_key = world.instance_tree(key).expect("it lives");
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
                match lights.word(record, 7) {
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
    // A record has 80 bytes.
    played.device.content(trees)[80 * tree as usize..][..80 * own].to_vec()
}

/// Checks that the top level is built from the same parts as with a new planner, but for trees that
/// wait. Every instance must be shown, and the last plan must have built the top level.
pub fn check_parts(played: &Played, world: &LightWorld) {
    let mut fresh = Played::new();
    fresh.frame(world);
    let instances = |played: &Played| {
        let [params, _, _, instances, _] = played.bound();
        let params = Records { bytes: played.device.content(params), stride: 0 };
        (instances, 4 * params.word(0, 7) as usize)
    };
    for key in world.instances().filter(|key| world.instance_tree(*key).is_some_and(|t| !played.planner.is_waiting(t)))
    {
        let slot = world.slot(key).expect("it lives");
        let records = |played: &Played| {
            let (id, stride) = instances(played);
            let tree = Records { bytes: played.device.content(id), stride }.word(slot, 13);
            part_records(played, slot, tree)
        };
        assert!(records(played) == records(&fresh), "the parts of slot {slot}");
    }
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
