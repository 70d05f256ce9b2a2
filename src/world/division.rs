//! Which parts of each tree are leaves of the top level: the whole tree, its sides, its sections or
//! its lights.

use std::sync::OnceLock;

use super::log::WorldLog;
use super::scene::Scene;
use super::sums::Sums;
use crate::instance::part::Division;
use crate::keys::{TreeKey, slot_of};
use crate::top::TopLevel;
use crate::tree::{Section, WIDTH};

/// Trees of more lights stay whole: each *light part* of a tree, one for each light, is a leaf of the
/// top level, which is built anew when anything moves. So do trees that are divided into sides: as
/// single lights they are noisier, because the top level divides by position alone.
pub(super) const MAX_LIGHT_PARTS: usize = 128;

/// The largest number of sections of a tree. Each of them takes 80 bytes on the GPU. For each
/// instance of the tree it takes 24 bytes more and is a leaf of the top level, which costs work in
/// each build (docs/decisions.md, 49).
pub(super) const MAX_SECTIONS: usize = 2048;

/// The largest number of sections of all instances of a tree.
const MAX_OF_INSTANCES: usize = 8192;

/// The largest number of sections of all instances of a world. Instances that are added to trees
/// with sections may exceed it.
const MAX_OF_WORLD: usize = 65_536;

impl Scene {
    /// How the tree of an entry is divided in the top level.
    pub fn division(&self, tree: TreeKey) -> Division {
        let entry = &self.trees[tree];
        match &entry.tree {
            _ if !entry.sections.is_empty() => Division::Sections(entry.sections.len() as u32),
            tree if !tree.sides().is_empty() => Division::Sides,
            tree if entry.has_light_parts && tree.lights().len() <= MAX_LIGHT_PARTS => Division::Lights,
            _ => Division::Whole,
        }
    }

    /// The sections of a tree, in the order of their places; empty for another division.
    pub fn sections(&self, tree: TreeKey) -> &[Section] {
        &self.trees[tree].sections
    }

    /// Whether a tree may have sections. Smaller ones may have light parts instead.
    pub fn is_large(&self, tree: TreeKey) -> bool {
        let tree = &self.trees[tree].tree;
        tree.light_count() > MAX_LIGHT_PARTS && tree.sides().is_empty()
    }
}

/// Whether a tree of so many lights may have light parts.
pub(super) fn may_have_light_parts(lights: usize) -> bool {
    (2..=MAX_LIGHT_PARTS).contains(&lights)
}

/// The scene, and what has to follow when the division of a tree changes.
pub(super) struct DivisionEdit<'a> {
    pub scene: &'a mut Scene,
    pub sums: &'a mut Sums,
    pub log: &'a mut WorldLog,
    pub top: &'a mut OnceLock<TopLevel>,
}

impl DivisionEdit<'_> {
    /// Gives a tree light parts, or takes them away.
    pub fn set_light_parts(&mut self, tree: TreeKey, has_light_parts: bool) {
        let entry = &mut self.scene.trees[tree];
        if std::mem::replace(&mut entry.has_light_parts, has_light_parts) != has_light_parts {
            self.log.tree(slot_of(tree));
            self.top.take();
        }
    }

    /// Chooses the sections of a tree anew, after its nodes were replaced.
    pub fn renew_sections(&mut self, tree: TreeKey) {
        self.set_sections(tree, Vec::new());
        self.update_sections(tree);
    }

    /// Gives a tree sections or takes them away, and chooses them anew if they do not fit the tree
    /// any more. O(sections).
    pub fn update_sections(&mut self, key: TreeKey) {
        let entry = &self.scene.trees[key];
        let is_wanted = entry.is_among_others && self.scene.is_large(key);
        let instances = entry.instances.len().max(1);
        if entry.sections.is_empty() && !is_wanted {
            return;
        }
        if is_wanted && !entry.sections.is_empty() {
            // Hysteresis: up to twice as many stay, so instances that come and go seldom change
            // them.
            let fits = entry.sections.len() * instances <= 2 * MAX_OF_INSTANCES;
            if fits && entry.tree.has_sections(&entry.sections) {
                return;
            }
        }
        let others = self.sums.sections - entry.counted.sections;
        let left = MAX_OF_WORLD.saturating_sub(others).min(MAX_OF_INSTANCES) / instances;
        let sections = if is_wanted { entry.tree.sections(left.min(MAX_SECTIONS)) } else { Vec::new() };
        self.set_sections(key, sections);
    }

    fn set_sections(&mut self, key: TreeKey, sections: Vec<Section>) {
        let entry = &mut self.scene.trees[key];
        if entry.sections == sections {
            return;
        }
        let former = std::mem::replace(&mut entry.sections, sections);
        // The nodes and lights of sections are uploaded with the number of the section.
        let (tree, mut nodes, mut lights) = (&entry.tree, Vec::new(), Vec::new());
        for section in former.iter().chain(&entry.sections) {
            match section.light() {
                Some(light) if (light as usize) < tree.lights().len() => lights.push(light),
                None if (section.child_bits as usize) < tree.nodes().len() => nodes.push(section.child_bits),
                _ => {}
            }
        }
        // The record of a section is sent with its parent node.
        nodes.extend(entry.sections.iter().map(|section| section.place / WIDTH as u32));
        nodes.dedup();
        let records = tree.nodes().len() + tree.lights().len();
        entry.log.add(&nodes, lights.into_iter(), records);
        entry.recount(self.sums);
        self.log.tree(slot_of(key));
        self.top.take();
    }
}
