//! Divides a tree into pieces, each of which a workgroup refits by itself. A piece is a node with some of
//! the nodes below it. The pieces of one pass do not depend on each other.

use std::cmp::Reverse;

use crate::tree::{ChildRef, LightTree, Node, WIDTH};

/// The most nodes that a piece has, with the uppermost nodes of the pieces below it.
pub(super) const ENTRIES: u32 = 96;

/// This bit marks an entry that is the number of a cluster, and not a node.
pub(super) const STORED: u32 = 1 << 31;

/// The nodes that a workgroup refits at once: eight invocations each.
pub(super) const ROUND: usize = 16;

/// The pieces of a tree, as shaders read them, in pairs of words:
///
/// - the number of the source, and the number of rounds;
/// - the number of the cluster of the uppermost node with the bit [`STORED`], and 0;
/// - for each round its first entry, and how many it has;
/// - for each entry, the deepest first, a node, and its children that are nodes: the first of their entries
///   in 24 bits and a bit for each slot; or a cluster with the bit [`STORED`], and 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Pieces {
    pub pairs: Vec<[u32; 2]>,
    /// Where the pieces of each pass begin.
    pub passes: Vec<Vec<u32>>,
    /// The number of pieces, each of which has one cluster.
    pub count: u32,
}

/// An entry of a piece.
#[derive(Clone, Copy, Debug)]
enum Entry {
    Node(u32),
    /// The piece with this uppermost node.
    Piece(u32),
}

/// What is known of a node's subtree, without the pieces that were cut off.
#[derive(Clone, Copy, Debug, Default)]
struct Open {
    entries: u32,
    pass: u32,
    /// The node is the uppermost of a piece.
    is_cut: bool,
}

/// The children of a node that are nodes, with their slots.
fn below(node: &Node) -> impl Iterator<Item = (usize, u32)> {
    (0..WIDTH).filter_map(|slot| match node.child(slot) {
        Some(ChildRef::Node(child)) => Some((slot, child)),
        _ => None,
    })
}

/// Cuts subtrees off from the leaves up, wherever a piece would be too large: first those that are refitted
/// in the earliest pass, and of these the largest.
fn cut(nodes: &[Node]) -> Vec<Open> {
    let mut open = vec![Open::default(); nodes.len()];
    for (index, node) in nodes.iter().enumerate().rev() {
        let mut children: Vec<u32> = below(node).map(|(_, child)| child).collect();
        let mut entries = 1 + children.iter().map(|child| open[*child as usize].entries).sum::<u32>();
        children.sort_by_key(|child| (open[*child as usize].pass, Reverse(open[*child as usize].entries)));
        let mut pass = 0;
        for child in children {
            let child = &mut open[child as usize];
            child.is_cut = entries > ENTRIES && child.entries > 1;
            if child.is_cut {
                entries -= child.entries - 1;
            }
            pass = pass.max(child.pass + u32::from(child.is_cut));
        }
        open[index] = Open { entries, pass, is_cut: false };
    }
    open
}

impl Pieces {
    /// The pieces of the tree of a source. Clusters are numbered from 0 on. O(nodes).
    pub fn of(tree: &LightTree, source: u32) -> Self {
        let nodes = tree.nodes();
        let mut pieces = Self::default();
        if nodes.is_empty() {
            return pieces;
        }
        let open = cut(nodes);
        let mut numbers = vec![0];
        let mut roots = vec![0];
        numbers.resize(nodes.len(), 0);
        let mut next = 0;
        while let Some(root) = roots.get(next).copied() {
            let levels = levels(nodes, &open, root);
            for entry in levels.iter().flatten() {
                if let Entry::Piece(node) = entry {
                    numbers[*node as usize] = roots.len() as u32;
                    roots.push(*node);
                }
            }
            let pass = open[root as usize].pass as usize;
            if pieces.passes.len() <= pass {
                pieces.passes.resize(pass + 1, Vec::new());
            }
            pieces.passes[pass].push(pieces.pairs.len() as u32);
            pieces.add(nodes, &levels, source, |node| STORED | numbers[node as usize], next as u32);
            next += 1;
        }
        pieces.count = roots.len() as u32;
        pieces
    }

    /// Adds a piece. `cluster` names the clusters of the pieces below it.
    fn add(&mut self, nodes: &[Node], levels: &[Vec<Entry>], source: u32, cluster: impl Fn(u32) -> u32, number: u32) {
        let (mut rounds, mut entries) = (Vec::new(), Vec::new());
        // The entries below the present level, of which the last level was the last.
        let mut first_below = 0;
        for level in levels.iter().rev() {
            let first = entries.len() as u32;
            let mut next_below = first_below;
            for entry in level {
                entries.push(match entry {
                    Entry::Piece(node) => [cluster(*node), 0],
                    Entry::Node(node) => {
                        let slots = below(&nodes[*node as usize]).fold(0, |bits, (slot, _)| bits | 1 << slot);
                        let words = [*node, next_below | slots << 24];
                        next_below += slots.count_ones();
                        words
                    }
                });
            }
            let starts = (0..level.len()).step_by(ROUND);
            rounds.extend(starts.map(|start| [first + start as u32, (level.len() - start).min(ROUND) as u32]));
            first_below = first;
        }
        self.pairs.push([source, rounds.len() as u32]);
        self.pairs.push([STORED | number, 0]);
        self.pairs.extend(rounds);
        self.pairs.extend(entries);
    }

    /// The pairs with clusters from `base` on.
    pub fn pairs_from(&self, base: u32) -> impl Iterator<Item = [u32; 2]> {
        self.pairs.iter().map(move |[word, other]| [if word & STORED != 0 { word + base } else { *word }, *other])
    }
}

/// The entries of the piece below a node by depth, the node first. Those below a node are neighbours.
fn levels(nodes: &[Node], open: &[Open], root: u32) -> Vec<Vec<Entry>> {
    let mut levels = vec![vec![Entry::Node(root)]];
    loop {
        let mut deeper = Vec::new();
        for entry in levels.last().into_iter().flatten() {
            let Entry::Node(node) = entry else { continue };
            deeper.extend(below(&nodes[*node as usize]).map(|(_, child)| match open[child as usize].is_cut {
                true => Entry::Piece(child),
                false => Entry::Node(child),
            }));
        }
        if deeper.is_empty() {
            return levels;
        }
        levels.push(deeper);
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::light::Light;
    use crate::math::dice::hash;

    fn lights(count: u32, spacing: impl Fn(f32) -> f32) -> Vec<Light> {
        let at = |seed: u32| spacing((hash(seed) >> 8) as f32 / (1 << 24) as f32);
        (0..count).map(|i| Light::point(Vec3::new(at(3 * i), at(3 * i + 1), at(3 * i + 2)), Vec3::ONE)).collect()
    }

    /// Plays the refit of all pieces, and checks that each node is refitted once, after its children.
    fn check(tree: &LightTree) -> Pieces {
        let pieces = Pieces::of(tree, 7);
        let mut done = vec![false; tree.nodes().len()];
        let mut clusters = vec![None; pieces.count as usize];
        let mut found = 0;
        for (pass, starts) in pieces.passes.iter().enumerate() {
            let stored_before = clusters.clone();
            for start in starts {
                let start = *start as usize;
                let [source, rounds] = pieces.pairs[start];
                assert_eq!(source, 7);
                let entries = start + 2 + rounds as usize;
                let mut local: Vec<u32> = Vec::new();
                for round in 0..rounds as usize {
                    let [first, count] = pieces.pairs[start + 2 + round];
                    assert!(first as usize == local.len() && (1..=ROUND as u32).contains(&count));
                    let before = local.clone();
                    for entry in first..first + count {
                        let [word, children] = pieces.pairs[entries + entry as usize];
                        if word & STORED != 0 {
                            // Only what earlier passes have written is there.
                            local.push(stored_before[(word & !STORED) as usize].expect("an earlier pass"));
                            continue;
                        }
                        for (rank, (slot, child)) in below(&tree.nodes()[word as usize]).enumerate() {
                            assert!(children >> 24 >> slot & 1 == 1, "node {word}, slot {slot}");
                            assert_eq!(before[(children & 0xff_ffff) as usize + rank], child, "node {word}");
                        }
                        assert!(!std::mem::replace(&mut done[word as usize], true), "node {word} twice");
                        local.push(word);
                        found += 1;
                    }
                }
                assert!(local.len() <= ENTRIES as usize, "{} entries", local.len());
                assert_eq!(pieces.pairs[start + 1 + rounds as usize][1], 1, "the last round has the uppermost node");
                let number = (pieces.pairs[start + 1][0] & !STORED) as usize;
                assert!(clusters[number].replace(*local.last().expect("a node")).is_none(), "pass {pass}");
            }
        }
        assert!(clusters.iter().all(Option::is_some) && found == tree.nodes().len());
        assert!(pieces.passes.last().is_none_or(|last| last.len() == 1));
        pieces
    }

    #[test]
    fn every_node_is_refitted_once_after_its_children_in_few_passes() {
        for count in [1, 8, 9, 64, 700, 5_000, 40_000, 300_000] {
            let tree = LightTree::new(lights(count, |x| x)).expect("valid");
            let pieces = check(&tree);
            assert!(pieces.passes.len() <= 4, "{count}: {} passes", pieces.passes.len());
            let nodes = tree.nodes().len();
            assert!(pieces.pairs.len() <= 2 * nodes + 8, "{count}: {} of {nodes}", pieces.pairs.len());
        }
        assert_eq!(Pieces::of(&LightTree::default(), 0), Pieces::default());
    }

    #[test]
    fn deep_trees_take_few_passes_too() {
        // Each octave of distance has a few lights, so the tree is a chain.
        let tree = LightTree::new(lights(3_000, |x| (58.0 * (x - 0.5)).exp2())).expect("valid");
        assert!(check(&tree).passes.len() <= 4);
    }

    #[test]
    fn trees_that_lights_came_to_and_left_are_divided_too() {
        let mut tree = LightTree::new(lights(4_000, |x| x)).expect("valid");
        tree.remove_lights(&(0..300).map(|i| 7 * i).collect::<Vec<_>>()).expect("they are there");
        tree.add_lights(&lights(200, |x| 2.0 * x)).expect("valid");
        let reached = {
            let mut open = vec![0];
            let mut count = 0;
            while let Some(node) = open.pop() {
                count += 1;
                open.extend(below(&tree.nodes()[node as usize]).map(|(_, child)| child));
            }
            count
        };
        let pieces = Pieces::of(&tree, 7);
        let listed: usize = pieces
            .passes
            .iter()
            .flatten()
            .map(|start| {
                let [_, rounds] = pieces.pairs[*start as usize];
                let rounds = &pieces.pairs[*start as usize + 2..][..rounds as usize];
                rounds.iter().map(|[_, count]| *count as usize).sum::<usize>()
            })
            .sum();
        assert_eq!(listed, reached + pieces.count as usize - 1);
    }
}
