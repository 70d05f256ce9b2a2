//! Freezing drops the data that only refits need, which is most of a tree's memory on the CPU. The
//! next edit computes it again.

use super::LightTree;
use super::node::{NO_LEAF, WIDTH};
use super::state::{RefitData, TreeState};

/// The data that only refits need. Nobody reads them: freeing them takes time, and may wait.
pub struct DroppedData {
    _data: TreeState,
}

impl LightTree {
    /// Drops the data that only refits need: the clusters at full precision and each subtree's part
    /// of the attributes, some 100 bytes per light. Refits first if lights have changed since the
    /// last refit.
    ///
    /// The next [`LightTree::set_lights`] allocates the data and computes them again: O(nodes),
    /// once. The results have the same bits as if nothing had been dropped.
    ///
    /// [`LightWorld`](crate::LightWorld) freezes its trees once their lights have not changed for a
    /// while. O(1) apart from the refit.
    pub fn freeze(&mut self) {
        drop(self.freeze_into());
    }

    /// Freezes the tree, and returns the data that it then does without.
    pub(crate) fn freeze_into(&mut self) -> DroppedData {
        if self.is_dirty() {
            self.refit_without_attributes();
        }
        self.quality.cost = self.quality.built_cost;
        let state = if self.nodes.is_empty() { TreeState::default() } else { TreeState::Frozen };
        DroppedData { _data: std::mem::replace(&mut self.state, state) }
    }

    /// Whether the tree is frozen; never for a tree without lights.
    pub fn is_frozen(&self) -> bool {
        matches!(self.state, TreeState::Frozen)
    }

    /// Allocates the dropped data and computes them again. The nodes keep their bits, unless the
    /// tree was baked on a machine whose sines and cosines round differently.
    pub(super) fn thaw(&mut self) {
        if !self.is_frozen() {
            return;
        }
        if let [former] = self.nodes[..] {
            let attributes = self.quality.attributes;
            self.refit_only_node(true);
            self.quality.attributes = attributes;
            self.state = TreeState::Small { is_dirty: false, is_refitted: self.nodes[0] != former };
            return;
        }
        let count = self.nodes.len();
        let former = self.nodes.clone();
        self.state = TreeState::Live(Box::new(RefitData::new(count)));
        for (light, place) in self.lights.iter().zip(&self.leaves) {
            if *place != NO_LEAF {
                let place = *place as usize;
                self.state.data_mut().wide[place / WIDTH].set(place % WIDTH, &light.cluster());
            }
        }
        self.mark_all();
        let attributes = self.quality.attributes;
        self.refit_marked(true);
        self.quality.attributes = attributes;
        self.state.data_mut().refitted.clear();
        if self.nodes != former {
            self.state.data_mut().refitted.add_all();
        }
    }

    /// A copy that is not frozen, with nodes made from its lights.
    pub(super) fn thawed(&self) -> Self {
        let mut tree = self.clone();
        tree.thaw();
        tree
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::light::Light;
    use crate::tree::testing::state_of;

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

    #[test]
    fn a_tree_that_was_frozen_behaves_as_if_it_had_never_been() {
        type Step = fn(&mut LightTree);
        let edit: Step = |tree| {
            let changes: Vec<_> = (0..tree.lights.len()).step_by(7).map(|i| (i as u32, lamp(i + 5000))).collect();
            tree.apply(&changes);
        };
        let next: [(&str, Step); 5] = [
            ("edit, refit", |tree| {
                tree.apply(&[(0, lamp(9000))]);
                tree.refit();
            }),
            ("edit, refit without attributes, edit, refit", |tree| {
                tree.apply(&[(0, lamp(9000))]);
                tree.refit_without_attributes();
                tree.apply(&[(0, lamp(9001))]);
                tree.refit();
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
                frozen.check().expect("the frozen tree is sound");
                assert_eq!(
                    format!("{:?} {:?}", frozen.root, frozen.attributes()),
                    format!("{:?} {:?}", plain.root, plain.attributes())
                );
                for (name, next) in next {
                    let [mut plain, mut frozen] = [plain.clone(), frozen.clone()];
                    next(&mut plain);
                    next(&mut frozen);
                    frozen.check().unwrap_or_else(|e| panic!("{name}: {e}"));
                    // A refit without edits leaves a frozen tree frozen.
                    if frozen.is_frozen() {
                        frozen.thaw();
                        frozen.refit();
                    }
                    // Both are equal once the attributes are up to date.
                    plain.refit();
                    assert!(state_of(&plain) == state_of(&frozen), "{count} lights, {name}");
                }
            }
        }
    }

    #[test]
    fn a_frozen_tree_takes_less_than_half_the_memory() {
        let mut tree = LightTree::build((0..20_000).map(lamp).collect());
        let before = tree.memory_bytes();
        tree.freeze();
        assert!(2 * tree.memory_bytes() < before, "{} of {before} bytes", tree.memory_bytes());
        tree.apply(&[(3, Light { emission: Vec3::ONE, ..lamp(3) })]);
        assert_eq!(tree.memory_bytes(), before);
    }

    #[test]
    fn the_check_finds_a_frozen_node_that_differs_from_its_lights() {
        let mut tree = LightTree::build((0..50).map(lamp).collect());
        tree.freeze();
        tree.nodes[0].mean[0][0] ^= 1;
        let error = tree.check().expect_err("the first node is wrong");
        assert_eq!((error.node, error.what), (0, "the node of the frozen tree differs from one made from its lights"));
    }
}
