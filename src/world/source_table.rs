//! Which trees have a source: a kernel of the engine that writes their lights.

use std::collections::{BTreeSet, HashMap};

use crate::keys::TreeKey;

/// Who writes the lights of a tree: see [`LightWorld::set_light_source`](crate::LightWorld::set_light_source).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum TreeSource {
    /// Edits of the world.
    #[default]
    Cpu,
    /// A kernel of the engine, in each frame. The lights keep about the same neighbours, as the
    /// triangles of a skinned mesh do: a refit on the GPU follows them.
    GpuMesh,
    /// A kernel of the engine, in each frame. The lights mingle, come and go, as particles do: each of
    /// them is a leaf of the top level, which is built anew in each frame.
    GpuParticles,
}

/// The sources of a world, by number and by tree.
#[derive(Debug, Default)]
pub(super) struct Sources {
    pub numbers: Vec<Option<TreeKey>>,
    free: BTreeSet<u32>,
    pub trees: HashMap<TreeKey, Source>,
}

/// The source of one tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Source {
    pub by: TreeSource,
    number: u32,
    /// The count of the last measure, and all refusals so far.
    pub refused: (u32, u64),
}

impl Sources {
    /// The source of a tree, and its number.
    pub fn of(&self, tree: TreeKey) -> Option<(TreeSource, u32)> {
        self.get(tree).map(|source| (source.by, source.number))
    }

    pub fn get(&self, tree: TreeKey) -> Option<&Source> {
        if self.trees.is_empty() { None } else { self.trees.get(&tree) }
    }

    /// Gives a tree a source, with the number that it has already or with the least that is free.
    pub fn set(&mut self, tree: TreeKey, source: TreeSource) {
        let number = self.of(tree).map(|(_, number)| number).or_else(|| self.free.pop_first());
        let number = number.unwrap_or(self.numbers.len() as u32);
        if self.numbers.len() <= number as usize {
            self.numbers.push(None);
        }
        self.numbers[number as usize] = Some(tree);
        self.trees.insert(tree, Source { by: source, number, refused: (0, 0) });
    }

    /// Takes the source of a tree away. Returns whether it had one.
    pub fn remove(&mut self, tree: TreeKey) -> bool {
        let Some(Source { number, .. }) = self.trees.remove(&tree) else { return false };
        self.numbers[number as usize] = None;
        self.free.insert(number);
        true
    }
}
