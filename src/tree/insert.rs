//! Adds lights to a tree without building it again.
//!
//! A light goes down from the root to the child whose cost it raises least, as in Guttman, R-Trees
//! (1984), with the cost of builds. It becomes a child of the first node that has room and below
//! which no node would keep its cost, or else shares a new node with the light whose cost it raises
//! least. New nodes stand behind all others, or where removals have left spare ones, so a parent
//! still comes before its children, but subtrees are not contiguous any more.
//!
//! Differs: nodes are not split on the way up, which would put a parent behind its children. Instead
//! a subtree that has twice the lights that it was made for is made again from its lights.
//! So paths stay short, whatever the order of the lights is, and each light pays for O(log n) others
//! at most in each subtree that holds it.

use super::build::count_effects;
use super::cost::{orientation, size};
use super::edited::make_room;
use super::node::{LEAF, NO_PARENT, Node, WIDTH};
use super::placed::{PlacedLight, build_items};
use super::shape::shape;
use super::wide::WideCluster;
use super::{LightTree, check_light_count, check_lights};
use crate::cluster::Cluster;
use crate::error::WorldError;
use crate::light::Light;
use crate::tree::attributes::AttributeSums;

/// A subtree is made again once it has this many times the lights that it was made for.
const MAX_GROWTH: u32 = 2;

/// A light does not go below a child whose cost it would raise by more than this share, if the node
/// has room for it (docs/decisions.md, 55).
const MAX_RISE: f64 = 0.3;

/// Where a light goes below a node.
struct LightPlace {
    slot: usize,
    /// The cluster of the child with the light.
    merged: Cluster,
    /// The cost of the child, and by how much the light raises it.
    cost: f64,
    rise: f64,
    /// The number of lights of the child.
    lights: u32,
}

impl LightTree {
    /// Adds lights and returns their indices, in the order of the lights: the least ones of removed
    /// lights first, then new ones behind the last. Refits the nodes above the lights, so the tree can be
    /// sampled at once.
    ///
    /// Each light costs O(depth) and, amortised, the build of O(log n) lights, once the tree is not
    /// frozen. A tree that is divided into sides, which has at most 256 lights, is built again, and so is
    /// one of which more than a tenth is new.
    ///
    /// # Errors
    /// [`WorldError::Entry`] for the first invalid light, by its index in `lights`;
    /// [`WorldError::Value`] for more than [`MAX_LIGHTS`](super::MAX_LIGHTS) indices. No light has then
    /// been added.
    pub fn add_lights(&mut self, lights: &[Light]) -> Result<Vec<u32>, WorldError> {
        check_lights(lights.iter().enumerate())?;
        let vacant = self.edited.vacant();
        let appended = lights.len().saturating_sub(vacant.len());
        check_light_count(self.lights.len() + appended)?;
        let behind = self.lights.len() as u32..;
        let indices: Vec<u32> = vacant.iter().copied().chain(behind).take(lights.len()).collect();
        let changes: Vec<_> = indices.iter().copied().zip(lights.iter().copied()).collect();
        self.apply(&changes);
        self.refit_changes();
        self.forget_moved();
        Ok(indices)
    }

    /// Adds one light at a vacant index, and marks the nodes above it for the next refit. The tree
    /// has nodes.
    pub(super) fn insert(&mut self, index: u32, light: &Light) {
        self.edited.will_add(&self.light_counts);
        self.hold_index(index);
        self.lights[index as usize] = *light;
        self.edited.set_vacant(index, false);
        count_effects(&mut self.effects, light);
        // A dark light goes where it would go if it shone.
        let own = light.cluster();
        let lit = if own.flux > 0.0 { own } else { Light { emission: glam::Vec3::ONE, ..*light }.cluster() };
        let mut node = 0;
        loop {
            self.light_counts[node] += 1;
            let count = self.nodes[node].count();
            let choice = self.choose(node, &lit);
            let has_room = count < WIDTH;
            let Some(choice) = choice.filter(|choice| !has_room || choice.rise <= MAX_RISE * choice.cost) else {
                self.nodes[node].set_count(count + 1);
                self.put_leaf(node, count, index, &own);
                return;
            };
            let child = self.nodes[node].children[choice.slot];
            if own.flux > 0.0 {
                // Later additions see the box as it will be.
                self.state.data_mut().wide[node].set(choice.slot, &choice.merged);
            }
            if child & LEAF != 0 {
                let pair = self.share_node(node * WIDTH + choice.slot, child & !LEAF);
                self.put_leaf(pair, 1, index, &own);
                return self.rebuild_grown(pair);
            }
            node = child as usize;
        }
    }

    /// The child of a node whose cost a light raises least: of the child nodes if the node has room,
    /// of all children otherwise. Of equal ones the one with the fewest lights.
    fn choose(&self, node: usize, light: &Cluster) -> Option<LightPlace> {
        let record = &self.nodes[node];
        let has_room = record.count() < WIDTH;
        let mut best: Option<LightPlace> = None;
        for slot in 0..record.count() {
            let child = record.children[slot];
            let is_light = child & LEAF != 0;
            if is_light && has_room {
                continue;
            }
            let cluster = self.state.data().wide[node].get(slot);
            let merged = merged(&cluster, light);
            let present = cost(&cluster);
            let rise = cost(&merged) - present;
            let lights = if is_light { 1 } else { self.light_counts[child as usize] };
            let is_better = |best: &LightPlace| rise < best.rise || rise == best.rise && lights < best.lights;
            if best.as_ref().is_none_or(is_better) {
                best = Some(LightPlace { slot, merged, cost: present, rise, lights });
            }
        }
        best
    }

    /// Writes a light to a slot of a node.
    fn put_leaf(&mut self, node: usize, slot: usize, index: u32, cluster: &Cluster) {
        self.nodes[node].children[slot] = index | LEAF;
        self.state.data_mut().wide[node].set(slot, cluster);
        self.place_leaf(index, node * WIDTH + slot);
        self.state.data_mut().dirty.insert(node);
    }

    /// Puts a new node in the place of a light, which becomes its first child. There is room for the
    /// second. Returns the node.
    fn share_node(&mut self, place: usize, light: u32) -> usize {
        let pair = self.new_node_after(place / WIDTH);
        self.nodes[place / WIDTH].children[place % WIDTH] = pair as u32;
        self.nodes[pair].parent = place as u32;
        self.nodes[pair].set_count(2);
        self.light_counts[pair] = 2;
        self.edited.was_built(pair, 2);
        let cluster = self.lights[light as usize].cluster();
        self.put_leaf(pair, 0, light, &cluster);
        pair
    }

    /// An empty node behind another one: a spare one, or one that is appended.
    fn new_node_after(&mut self, node: usize) -> usize {
        self.edited.take_node_after(node).unwrap_or_else(|| {
            make_room(&mut self.nodes);
            make_room(&mut self.state.data_mut().wide);
            make_room(&mut self.state.data_mut().attribute_sums);
            self.nodes.push(Node::EMPTY);
            self.state.data_mut().wide.push(WideCluster::EMPTY);
            self.light_counts.push(0);
            self.state.data_mut().attribute_sums.push(AttributeSums::default());
            self.state.data_mut().dirty.grow(self.nodes.len());
            self.edited.built_lights.push(0);
            self.nodes.len() - 1
        })
    }

    /// Makes the highest subtree again that holds a node and has outgrown what it was made for.
    fn rebuild_grown(&mut self, node: usize) {
        let parent = |node: &usize| match self.nodes[*node].parent {
            NO_PARENT => None,
            place => Some(place as usize / WIDTH),
        };
        let has_outgrown = |node: &usize| {
            let lights = self.light_counts[*node];
            lights > WIDTH as u32 && lights / MAX_GROWTH >= self.edited.built_lights[*node]
        };
        match std::iter::successors(Some(node), parent).filter(has_outgrown).last() {
            Some(0) => self.rebuild(),
            Some(root) => self.rebuild_scattered(root),
            None => {}
        }
    }

    /// Shapes the subtree below a node again, in nodes that may be anywhere behind it. O(n log n) in
    /// its lights.
    fn rebuild_scattered(&mut self, root: usize) {
        let mut lights = Vec::with_capacity(self.light_counts[root] as usize);
        let mut below = vec![root];
        while let Some(node) = below.pop() {
            for slot in 0..self.nodes[node].count() {
                match self.nodes[node].children[slot] {
                    light if light & LEAF != 0 => {
                        lights.push(PlacedLight {
                            index: light & !LEAF,
                            cluster: self.state.data().wide[node].get(slot),
                        });
                    }
                    child => below.push(child as usize),
                }
            }
            if node != root {
                self.free_node(node);
            }
        }
        let shape = shape(&mut build_items(&lights, self.reference()));
        let mut places = vec![root; shape.len()];
        for i in 1..shape.len() {
            places[i] = self.new_node_after(places[i - 1]);
        }
        self.nodes[root] = Node { parent: self.nodes[root].parent, ..Node::EMPTY };
        self.state.data_mut().wide[root] = WideCluster::EMPTY;
        for (shaped, node) in shape.iter().zip(&places) {
            self.nodes[*node].set_count(shaped.count as usize);
            for (slot, child) in shaped.children[..shaped.count as usize].iter().enumerate() {
                if child & LEAF != 0 {
                    let PlacedLight { index, cluster } = lights[(child & !LEAF) as usize];
                    self.put_leaf(*node, slot, index, &cluster);
                } else {
                    let child = places[*child as usize];
                    self.nodes[*node].children[slot] = child as u32;
                    self.nodes[child].parent = (*node * WIDTH + slot) as u32;
                }
            }
            self.state.data_mut().dirty.insert(*node);
        }
        for node in places.into_iter().rev() {
            self.count_lights(node);
            self.edited.was_built(node, self.light_counts[node]);
            let (cluster, place) = (
                self.state.data().wide[node].merged_for(self.maps.weights.as_deref()).cluster,
                self.nodes[node].parent as usize,
            );
            self.state.data_mut().wide[place / WIDTH].set(place % WIDTH, &cluster);
        }
    }
}

/// Two clusters as one.
fn merged(a: &Cluster, b: &Cluster) -> Cluster {
    let mut wide = WideCluster::EMPTY;
    wide.set(0, a);
    wide.set(1, b);
    wide.merged().cluster
}

/// The cost of a cluster in a node: flux times size times orientation. In f64, because a flux times
/// an area can exceed f32.
fn cost(cluster: &Cluster) -> f64 {
    if cluster.flux <= 0.0 {
        return 0.0;
    }
    let extent = cluster.aabb.extent().to_array();
    f64::from(cluster.flux) * f64::from(size(extent)) * f64::from(orientation(cluster.axis.length()))
}
