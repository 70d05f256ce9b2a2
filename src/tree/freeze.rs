//! Trees at rest drop what only refits need, most of their memory on the CPU; the next edit computes it again.

use super::LightTree;
use super::attributes::Terms;
use super::dirty::Dirty;
use super::node::{Node, WIDTH};
use super::refit::Tasks;
use super::wide::WideCluster;
use crate::light::Light;

impl LightTree {
    /// Drops what only refits need: the clusters at full precision and each subtree's part of the attributes, some 100
    /// bytes a light. The next [`LightTree::set`] computes them again, and the refit after it visits all nodes once, to
    /// the very same bits as if nothing had been dropped. Refits first, if some light has changed since.
    ///
    /// [`LightWorld`](crate::LightWorld) does this to its trees by itself, once their lights have not changed for a while. O(1),
    /// but for that refit.
    pub fn freeze(&mut self) {
        if self.dirty.len() > 0 {
            self.refit_without_attributes();
        }
        self.wide = Vec::new();
        self.terms = Vec::new();
        self.dirty = Dirty::default();
        self.tasks = Tasks::default();
    }

    /// Whether the tree is without what refits need.
    pub fn is_frozen(&self) -> bool {
        self.wide.len() < self.nodes.len()
    }

    /// Bytes of all arrays, lights included: what the tree takes besides itself.
    pub fn memory(&self) -> usize {
        let Self { lights, leaves, nodes, wide, spans, sizes, fresh, terms, .. } = self;
        size_of::<Light>() * lights.capacity()
            + size_of::<Node>() * nodes.capacity()
            + size_of::<WideCluster>() * wide.capacity()
            + size_of::<Terms>() * terms.capacity()
            + size_of::<u32>() * (leaves.capacity() + spans.capacity() + sizes.capacity() + fresh.capacity())
            + self.dirty.memory()
            + self.tasks.memory()
    }

    /// Undoes [`LightTree::freeze`] but for what the next refit computes, which visits all nodes.
    pub(super) fn thaw(&mut self) {
        if !self.is_frozen() {
            return;
        }
        let count = self.nodes.len();
        self.wide = vec![WideCluster::EMPTY; count];
        for (light, place) in self.lights.iter().zip(&self.leaves) {
            let place = *place as usize;
            self.wide[place / WIDTH].set(place % WIDTH, &light.cluster());
        }
        self.terms = vec![Terms::default(); count];
        self.dirty = Dirty::none(count);
        (0..count).filter(|node| self.spans[*node] > 0).for_each(|node| self.dirty.insert(node));
        self.tasks = Tasks::new(&self.spans);
    }

    /// A copy that has all that refits need.
    pub(super) fn thawed(&self) -> Self {
        let mut tree = self.clone();
        tree.thaw();
        tree.refit_without_attributes();
        tree
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn lamp(i: usize) -> Light {
        let turn = |speed: f32| (i as f32 * speed).sin();
        let place = Vec3::new(turn(0.7), turn(1.3), turn(2.1)) * 30.0;
        let emission = Vec3::splat((turn(3.7) + 0.5).max(0.0));
        match i % 3 {
            0 => Light::point(place, emission).with_range(9.0 + i as f32),
            1 => Light::spot(place, Vec3::Y, 0.2, 0.9, emission),
            _ => Light::rectangle(place, Vec3::X * turn(0.3), Vec3::new(0.0, turn(0.9), 0.3), emission),
        }
    }

    /// All that later calls depend on, and what they see. Floats print as what they are, and NaN equals itself.
    fn all_of(tree: &LightTree) -> String {
        let LightTree { nodes, wide, spans, sizes, fresh, terms, leaves, credit, root, attributes, effects, .. } = tree;
        let bits: &[u8] = bytemuck::cast_slice(nodes);
        let shape = format!("{bits:?} {spans:?} {sizes:?} {leaves:?} {root:?}");
        format!("{shape} {wide:?} {fresh:?} {terms:?} {credit} {attributes:?} {effects:?}")
    }

    #[test]
    fn a_tree_that_was_frozen_goes_on_as_if_it_had_never_been() {
        type Step = fn(&mut LightTree);
        let edit: Step = |tree| {
            let changes: Vec<_> = (0..tree.lights.len()).step_by(7).map(|i| (i as u32, lamp(i + 5000))).collect();
            tree.apply(&changes);
        };
        let next: [(&str, Step); 6] = [
            ("edit, refit", |tree| {
                tree.apply(&[(0, lamp(9000))]);
                tree.refit();
            }),
            ("edit, refit unmeasured, edit, refit", |tree| {
                tree.apply(&[(0, lamp(9000))]);
                tree.refit_without_attributes();
                tree.apply(&[(0, lamp(9001))]);
                tree.refit();
            }),
            ("rebuild worst", |tree| {
                tree.rebuild_worst(tree.lights.len() / 3);
                tree.rebuild_worst(tree.lights.len());
            }),
            ("rebuild", LightTree::rebuild),
            ("refit", LightTree::refit),
            ("edit, freeze, edit, refit", |tree| {
                tree.apply(&[(0, lamp(9000))]);
                tree.freeze();
                tree.apply(&[(0, lamp(9001))]);
                tree.refit();
            }),
        ];
        for count in [1, 9, 700, 20_000] {
            for refit in [LightTree::refit, LightTree::refit_without_attributes] {
                let mut plain = LightTree::build((0..count).map(lamp).collect());
                edit(&mut plain);
                refit(&mut plain);
                let mut frozen = plain.clone();
                frozen.freeze();
                assert!(frozen.is_frozen() && !plain.is_frozen());
                frozen.check().expect("a frozen tree is sound");
                assert_eq!(
                    format!("{:?} {:?}", frozen.root, frozen.attributes),
                    format!("{:?} {:?}", plain.root, plain.attributes)
                );
                for (name, next) in next {
                    let [mut plain, mut frozen] = [plain.clone(), frozen.clone()];
                    next(&mut plain);
                    next(&mut frozen);
                    frozen.check().unwrap_or_else(|e| panic!("{name}: {e}"));
                    // A measured tree has nothing to do when it is refitted without edits, and stays as it is.
                    if frozen.is_frozen() {
                        frozen.thaw();
                        frozen.refit();
                    }
                    // Equal but for terms that wait to be measured.
                    plain.refit();
                    assert!(all_of(&plain) == all_of(&frozen), "{count} lights, {name}");
                }
            }
        }
    }

    #[test]
    fn a_frozen_tree_is_less_than_half_as_large() {
        let mut tree = LightTree::build((0..20_000).map(lamp).collect());
        let before = tree.memory();
        tree.freeze();
        assert!(2 * tree.memory() < before, "{} of {before} bytes", tree.memory());
        tree.apply(&[(3, lamp(7))]);
        assert_eq!(tree.memory(), before);
    }

    #[test]
    fn a_frozen_tree_whose_nodes_are_not_what_its_lights_make_is_found_out() {
        let mut tree = LightTree::build((0..50).map(lamp).collect());
        tree.freeze();
        tree.nodes[0].flux[0] += 1;
        assert_eq!(tree.check().expect_err("broken").what, "not what its lights make");
    }
}
