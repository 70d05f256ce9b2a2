//! Each kind of a wrong file is refused by an error that names what is wrong.

use super::*;
use crate::cluster::Cluster;
use crate::error::LoadError;
use crate::file::{VERSION, seal};
use crate::tree::{EMPTY_SLOT, LEAF, NO_PARENT, Node};

fn tree() -> LightTree {
    let lamp = |i: usize| Light::spot(Vec3::splat(i as f32), Vec3::Y, 0.1, 0.3, Vec3::ONE).with_range(9.0);
    LightTree::build((0..300).map(lamp).collect())
}

/// The error for the bytes of a tree after a change.
fn refusal(change: impl FnOnce(&mut Vec<u8>)) -> LoadError {
    let mut bytes = tree().bake();
    change(&mut bytes);
    LightTree::from_baked(&bytes).expect_err("a wrong file")
}

/// The error for bytes that were changed by someone who knows how to seal them.
fn forged(change: impl FnOnce(&mut Vec<u8>)) -> LoadError {
    refusal(|bytes| {
        change(bytes);
        seal(bytes);
    })
}

/// The error for a tree that was broken before it was baked.
fn broken(break_it: impl FnOnce(&mut LightTree)) -> String {
    let mut tree = tree();
    break_it(&mut tree);
    let error = LightTree::from_baked(&tree.bake()).expect_err("the tree is broken");
    let text = error.to_string();
    text.strip_prefix("the tree: ").expect("the lights are right").to_owned()
}

fn put(bytes: &mut [u8], at: usize, word: u32) {
    bytes[at..at + 4].copy_from_slice(&word.to_le_bytes());
}

#[test]
fn a_file_of_another_format_is_refused() {
    let expected = LoadError::Format { expected: "a baked tree" };
    for bytes in [&b"glTF"[..], b"\x89PNG\r\n\x1a\n and more than a header", &[0; 500], b"\x89GDUMP\r\n and more"] {
        assert_eq!(LightTree::from_baked(bytes).err().as_ref(), Some(&expected));
    }
    assert_eq!(refusal(|bytes| bytes[3] ^= 32), expected);
    // All numbers reversed.
    assert_eq!(refusal(|bytes| bytes.chunks_mut(4).for_each(<[u8]>::reverse)), expected);
    assert_eq!(expected.to_string(), "the first bytes are not those of a baked tree");
}

#[test]
fn a_file_of_another_version_is_refused_whatever_follows() {
    for given in [0, VERSION - 1, VERSION + 1, u32::MAX] {
        let expected = LoadError::Version { given, supported: VERSION };
        assert_eq!(forged(|bytes| put(bytes, 8, given)), expected);
        assert_eq!(refusal(|bytes| put(bytes, 8, given)), expected);
        let shorter = refusal(|bytes| {
            put(bytes, 8, given);
            bytes.truncate(12);
        });
        assert_eq!(shorter, expected);
    }
}

#[test]
fn a_file_of_the_wrong_length_is_refused() {
    let whole = tree().bake();
    let length = whole.len();
    for bytes in (8..HEADER_BYTES + 8).chain((8..length).step_by(611)).chain(length - 5..length) {
        assert_eq!(LightTree::from_baked(&whole[..bytes]).err(), Some(LoadError::Damaged { bytes }));
    }
    assert_eq!(refusal(|bytes| bytes.push(0)), LoadError::Damaged { bytes: length + 1 });
    assert!((0..8).all(|bytes| LightTree::from_baked(&whole[..bytes]).is_err()));
    // With a right checksum.
    let error = forged(|bytes| bytes.extend([0; 4]));
    assert_eq!(error, LoadError::content("the length", "4 bytes follow the last value"));
    let error = forged(|bytes| bytes.truncate(length - 4));
    assert!(error.to_string().starts_with("the length: "), "{error}");
}

#[test]
fn numbers_of_records_that_do_not_fit_the_file_are_refused_before_anything_is_read() {
    let error = LoadError::content("the header", "more lights, nodes or sides than a tree can have");
    for (at, most) in [(12, (1 << 31) - 1), (16, (1 << 29) - 1), (20, 8)] {
        assert_eq!(forged(|bytes| put(bytes, at, u32::MAX)), error);
        assert_eq!(forged(|bytes| put(bytes, at, most + 1)), error);
        assert_ne!(forged(|bytes| put(bytes, at, most)), error);
    }
    for (at, most) in [(12, (1 << 31) - 1), (16, (1 << 29) - 1)] {
        let error = forged(|bytes| put(bytes, at, most)).to_string();
        assert!(error.starts_with(&format!("the length: {most} values do not fit into the ")), "{error}");
    }
}

#[test]
fn any_flipped_bit_is_found() {
    let bytes = LightTree::build(any_lights(&mut Rng(21), 20)).bake();
    for bit in 0..8 * bytes.len() {
        let mut flipped = bytes.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        let error = LightTree::from_baked(&flipped).expect_err("a bit was flipped");
        let is_identified = bit / 8 >= PREFIX_BYTES;
        assert!(!is_identified || matches!(error, LoadError::Damaged { .. }), "bit {bit}: {error}");
    }
}

#[test]
fn values_that_are_never_written_are_refused_although_the_checksum_is_right() {
    let header = |why| LoadError::content("the header", why);
    assert_eq!(forged(|bytes| put(bytes, 24, 2)), header("a flag is neither 0 nor 1"));
    for (at, cost) in [(28, f32::NAN), (28, -1.0), (32, f32::NAN), (44, -1.0)] {
        let error = forged(|bytes| put(bytes, at, cost.to_bits()));
        assert_eq!(error, header("a cost or an attribute is below 0 or not a number"));
    }
    let reference = header("the reference is the linear part of no instance");
    assert_eq!(forged(|bytes| put(bytes, 124, 1)), reference);
    assert_eq!(forged(|bytes| put(bytes, 124, 1 << 31)), reference);
    for (entry, value) in [(0, f32::NAN), (4, f32::INFINITY), (8, 2.0e9), (0, 0.0)] {
        let wrong = |bytes: &mut Vec<u8>| {
            (0..9).for_each(|i| put(bytes, 120 + 4 * i, if i % 4 == 0 { 1.0_f32 } else { 0.0 }.to_bits()));
            put(bytes, 120 + 4 * entry, value.to_bits());
        };
        assert_eq!(forged(wrong), reference, "{entry} {value}");
    }
    // The third light: an unknown kind, and a coordinate that is not finite.
    let third = HEADER_BYTES + 2 * size_of::<Record>();
    let field = LoadError::content("light 2", "a field has a value that is never written");
    assert_eq!(forged(|bytes| put(bytes, third, 99)), field);
    let error = forged(|bytes| {
        put(bytes, third + 4, f32::INFINITY.to_bits());
        put(bytes, third + 2 * size_of::<Record>(), 99);
    });
    assert_eq!(error.to_string(), "light 2: position is inf; it must be from -1000000000 to 1000000000");
    assert_eq!(error.code(), 1104);
}

#[test]
fn each_broken_link_between_nodes_is_named_with_its_place() {
    let first_child = tree().nodes[0].children[0];
    assert_eq!(first_child, 1);
    assert!(broken(|tree| tree.nodes[0].parent = 8).starts_with("node 0, slot 0: the node is not a child"));
    assert!(broken(|tree| tree.nodes[1].parent = NO_PARENT).starts_with("node 0, slot 0: the child's link"));
    assert!(broken(|tree| tree.nodes[1].parent ^= 1).contains("slot 0: the child's link to its parent"));
    assert!(broken(|tree| tree.nodes[0].children[0] = u32::MAX / 2).contains("the child does not lie behind"));
    assert!(broken(|tree| tree.nodes[0].children[0] = 0).contains("the child does not lie behind"));
    assert!(broken(|tree| tree.nodes[0].children[1] = EMPTY_SLOT).contains("slot 1: the slot is in use"));
    assert!(broken(|tree| tree.nodes[0].children[1] = LEAF | 300).contains("slot 1: the tree has no such light"));
    assert!(broken(|tree| tree.leaves.swap(3, 4)).contains("the light names another leaf"));
    assert!(broken(|tree| tree.leaves[299] = u32::MAX).contains("the light names another leaf"));
    let message = broken(|tree| tree.lights[7] = Light::REMOVED);
    assert!(message.ends_with("a light has no leaf, or a removed light has one"), "{message}");
    let lost = broken(|tree| {
        tree.hold_index(300);
        tree.lights[300] = Light::point(Vec3::ZERO, Vec3::ONE);
    });
    assert!(lost.ends_with("a light has no leaf, or a removed light has one"), "{lost}");
    assert!(broken(|tree| tree.nodes[0].steps = 0).contains("the number of children is outside 1 to 8"));
    assert!(broken(|tree| tree.nodes[0].steps |= 9 << 24).contains("the number of children is outside"));
    assert!(broken(|tree| tree.nodes[1].children[0] = 1).contains("the child does not lie behind the node"));
    assert!(broken(|tree| tree.nodes[1].children[0] = 4000).contains("the child does not lie behind the node"));
    assert!(broken(|tree| tree.light_counts[1] += 1).contains("the number of lights is not the sum"));
    let last = tree().nodes.len() - 1;
    // A node that no other names.
    let orphan = broken(|tree| {
        tree.nodes.push(Node::EMPTY);
        tree.light_counts.push(0);
    });
    let place = format!("node {}, slot 0", last + 1);
    assert!(orphan.starts_with(&format!("{place}: the node is not a child of the node")), "{orphan}");
}

#[test]
fn each_number_that_builds_do_not_make_is_named_with_its_place() {
    assert!(broken(|tree| tree.nodes[0].origin[1] = f32::NAN).contains("the boxes are not within the range"));
    assert!(broken(|tree| tree.nodes[0].origin[1] = 1.0e30).contains("the boxes are not within the range"));
    assert!(broken(|tree| tree.nodes[1].steps |= 0xff00).starts_with("node 1, slot 0: the boxes are not within"));
    let inverted = |tree: &mut LightTree| (tree.nodes[0].low[2][0], tree.nodes[0].high[2][0]) = (2, 1);
    assert!(broken(inverted).contains("the least corner of a box is beyond the greatest"));
    assert!(broken(|tree| tree.nodes[0].flux[0] = 0x7fc0).contains("a flux is outside its limits"));
    assert!(broken(|tree| tree.nodes[0].flux[0] |= 0x8000).contains("a flux is outside its limits"));
    assert!(broken(|tree| tree.nodes[0].flux[2] += 4).contains("slot 2: the flux is not the sum"));
    assert!(broken(|tree| tree.nodes[0].flux[2] = 0).contains("slot 2: the flux is not the sum"));
    assert!(broken(|tree| tree.nodes[0].range[2] = 0).contains("a range is outside its limits"));
    assert!(broken(|tree| tree.nodes[0].range[2] = 0x7fc0).contains("a range is outside its limits"));
    let root = |change: fn(&mut Cluster)| broken(|tree| change(&mut tree.root));
    assert!(root(|root| root.flux *= 2.0).contains("the flux of a cluster is not that of its children"));
    assert!(root(|root| root.flux = f32::NAN).contains("the flux of a cluster is not that of its children"));
    assert!(root(|root| root.mean.x = f32::NAN).contains("a number of a cluster is outside its limits"));
    assert!(root(|root| root.variance = -1.0).contains("a number of a cluster is outside its limits"));
    assert!(root(|root| root.axis.y = 2.0).contains("a number of a cluster is outside its limits"));
    assert!(root(|root| root.cos_half_angle = f32::NAN).contains("a number of a cluster is outside its limits"));
    assert!(root(|root| root.range = 0.0).contains("the box or the range of a cluster"));
    assert!(root(|root| root.aabb.min.x = 1.0e6).contains("the box or the range of a cluster"));
    assert!(broken(|tree| tree.sides = [tree.root].into()).ends_with("the sides are not the children of the root"));
}

#[test]
fn a_side_that_does_not_lie_in_its_node_is_refused() {
    let mut tree = LightTree::build(
        (0..20).map(|i| Light::spot(Vec3::X * i as f32, [Vec3::X, Vec3::NEG_X][i % 2], 0.1, 0.3, Vec3::ONE)).collect(),
    );
    assert_eq!(tree.sides.len(), 2);
    tree.sides[1].aabb.max.x += 50.0;
    let error = LightTree::from_baked(&tree.bake()).expect_err("the side is too large");
    assert!(error.to_string().ends_with("a side is not inside its node"), "{error}");
}

#[test]
fn an_empty_tree_has_no_nodes_and_no_lights() {
    let bytes = LightTree::build(Vec::new()).bake();
    assert_eq!(bytes.len(), HEADER_BYTES + 4);
    let mut tree = LightTree::build(Vec::new());
    tree.sides = [Cluster::EMPTY].into();
    let error = LightTree::from_baked(&tree.bake()).expect_err("a side of nothing");
    assert!(error.to_string().ends_with("the sides are not the children of the root"), "{error}");
    let mut tree = LightTree::build(Vec::new());
    (tree.nodes, tree.light_counts) = (vec![Node::EMPTY], vec![0]);
    let error = LightTree::from_baked(&tree.bake()).expect_err("a root without children");
    assert!(error.to_string().ends_with("the number of children is outside 1 to 8"), "{error}");
}
