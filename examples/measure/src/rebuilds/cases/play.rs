//! What the scenes have in common: the clock, the placement of trees, and the detection of
//! rebuilds.

pub use super::super::player::FRAME;
use girandole::glam::{DVec3, Mat3, dvec3};
use girandole::scheduler::{Clock, VirtualClock, WorkKind};
use girandole::{Light, LightTree, LightWorld, Placement, Policy, TreeKey};
use std::sync::Arc;
use std::time::Duration;
use testbed::scene::SceneError;

/// The distance between neighbouring trees, in metres.
const STEP: f64 = 60.0;

/// A clock on which the rebuild of a light takes a fixed time. Refits take no time, since they are
/// no part of the budget.
pub fn clock(nanos_per_light: u64) -> Arc<VirtualClock> {
    Arc::new(VirtualClock::new(move |work| {
        let nanos = match work.kind {
            WorkKind::Refit => 0,
            _ => nanos_per_light,
        };
        Duration::from_nanos(nanos * work.lights as u64)
    }))
}

/// A world on a clock.
pub fn world_on(clock: &Arc<VirtualClock>) -> LightWorld {
    LightWorld::with_clock(Arc::clone(clock) as Arc<dyn Clock>)
}

/// Adds a tree with one instance, beside those that are there.
pub fn add(world: &mut LightWorld, lights: Vec<Light>, policy: Policy) -> Result<TreeKey, SceneError> {
    let index = world.trees().len();
    let translation: DVec3 = STEP * dvec3((index % 16) as f64, 0.0, (index / 16) as f64);
    let tree = world.add_tree(LightTree::new(lights)?);
    world.add_instance(tree, Placement { linear: Mat3::IDENTITY, translation }, policy)?;
    Ok(tree)
}

/// Finds out whether trees were rebuilt, from their shapes alone: a refit never changes the order
/// of leaves.
pub struct RebuildDetector {
    /// The leaves of each tree after the last call.
    leaves: Vec<Vec<u32>>,
}

impl RebuildDetector {
    /// Starts with the present trees.
    pub fn new(world: &LightWorld, trees: &[TreeKey]) -> Self {
        Self { leaves: trees.iter().map(|tree| leaves(world, *tree).to_vec()).collect() }
    }

    /// Whether the `index`-th tree was rebuilt since the last call, whole or in part. The tree must
    /// change in every frame: one at rest may be rebuilt to the same shape.
    pub fn was_rebuilt(&mut self, index: usize, tree: &LightTree) -> bool {
        let has_changed = self.leaves[index] != tree.leaves();
        if has_changed {
            self.leaves[index] = tree.leaves().to_vec();
        }
        // Right after a rebuild within the frame the cost has not risen at all.
        has_changed || tree.cost_rise() == 0.0
    }
}

/// The leaves of a tree; none if it does not exist.
pub fn leaves(world: &LightWorld, tree: TreeKey) -> &[u32] {
    world.tree(tree).map_or(&[], |tree| tree.leaves())
}
