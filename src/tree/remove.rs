//! Removes lights from a tree without building it again.
//!
//! The leaf of a removed light leaves its node, and the last child of the node takes its slot. A
//! node that is left with one child is replaced by that child, so no node gets less than two
//! children and paths never grow.

use super::node::{EMPTY_SLOT, LEAF, NO_LEAF, NO_PARENT, Node, WIDTH};
use super::wide::WideCluster;
use super::{LightTree, check_distinct, check_indices};
use crate::cluster::Cluster;
use crate::error::WorldError;
use crate::light::Light;
use crate::tree::attributes::AttributeSums;

impl LightTree {
    /// Removes lights. Other lights keep their indices; [`LightTree::add_lights`] may use the removed
    /// ones again. Refits the nodes above the removed lights, so the tree can be sampled at once.
    ///
    /// Each light costs O(depth), once the tree is not frozen. A tree that is divided into sides,
    /// which has at most 256 lights, is built again, and so is one that loses more than a tenth.
    ///
    /// # Errors
    /// [`WorldError::NoSuchLight`] for an index outside the tree, [`WorldError::RemovedLight`] for
    /// that of a light that was removed, or that occurs twice. No light has then been removed.
    pub fn remove_lights(&mut self, lights: &[u32]) -> Result<(), WorldError> {
        check_indices(lights.iter().copied(), self.lights.len(), |index| self.lights.get(index))?;
        check_distinct(lights)?;
        let changes: Vec<_> = lights.iter().map(|index| (*index, Light::REMOVED)).collect();
        self.apply(&changes);
        self.refit_changes();
        self.forget_moved();
        Ok(())
    }

    /// Removes one light of several, and marks the nodes above it for the next refit.
    pub(super) fn remove(&mut self, index: u32) {
        self.edited.is_changed = true;
        let former = std::mem::replace(&mut self.lights[index as usize], Light::REMOVED);
        if !former.effects().is_empty() {
            self.effects.remove(former.effects());
        }
        self.edited.set_vacant(index, true);
        let place = std::mem::replace(&mut self.leaves[index as usize], NO_LEAF) as usize;
        let node = place / WIDTH;
        let mut above = node;
        loop {
            self.light_counts[above] -= 1;
            match self.nodes[above].parent {
                NO_PARENT => break,
                parent => above = parent as usize / WIDTH,
            }
        }
        self.take_child(place);
        if node > 0 && self.nodes[node].count() == 1 {
            self.replace_by_child(node);
        }
    }

    /// Takes the child at a place out of its node. The last child moves to the place.
    fn take_child(&mut self, place: usize) {
        let (node, slot) = (place / WIDTH, place % WIDTH);
        let last = self.nodes[node].count() - 1;
        if slot < last {
            self.move_child(node * WIDTH + last, place);
        }
        let record = &mut self.nodes[node];
        record.children[last] = EMPTY_SLOT;
        record.set_count(last);
        self.state.data_mut().wide[node].set(last, &Cluster::EMPTY);
        self.state.data_mut().dirty.insert(node);
    }

    /// Puts the child of a node that has no other into the place of the node, which becomes spare.
    fn replace_by_child(&mut self, node: usize) {
        let place = self.nodes[node].parent as usize;
        self.move_child(node * WIDTH, place);
        self.free_node(node);
        self.state.data_mut().dirty.insert(place / WIDTH);
    }

    /// Moves a child from one place to another, whose former child is gone.
    fn move_child(&mut self, from: usize, to: usize) {
        let child = self.nodes[from / WIDTH].children[from % WIDTH];
        let cluster = self.state.data().wide[from / WIDTH].get(from % WIDTH);
        self.nodes[to / WIDTH].children[to % WIDTH] = child;
        self.state.data_mut().wide[to / WIDTH].set(to % WIDTH, &cluster);
        if child & LEAF != 0 {
            self.place_leaf(child & !LEAF, to);
        } else {
            self.nodes[child as usize].parent = to as u32;
            // So that the node is sent with its new link.
            self.state.data_mut().dirty.insert(child as usize);
        }
    }

    /// Records the place of a light's leaf.
    pub(super) fn place_leaf(&mut self, light: u32, place: usize) {
        self.leaves[light as usize] = place as u32;
        self.edited.moved.push(light);
    }

    /// Makes a node spare.
    pub(super) fn free_node(&mut self, node: usize) {
        self.nodes[node] = Node::EMPTY;
        self.state.data_mut().wide[node] = WideCluster::EMPTY;
        self.state.data_mut().attribute_sums[node] = AttributeSums::default();
        self.light_counts[node] = 0;
        self.state.data_mut().dirty.remove(node);
        self.edited.free.insert(node as u32);
    }
}
