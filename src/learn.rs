//! Records what a shadow ray found, for learnt visibility.

use crate::cut::NO_INSTANCE;
use crate::keys::slot_of;
use crate::sample::{LightId, LightSampler};
use crate::shading_point::ShadingPoint;
use crate::tree::{NO_PARENT, WIDTH};
use crate::visibility::bin_of_child;

impl LightSampler<'_> {
    /// Records whether a light that was sampled is visible from a shading point: whether a shadow
    /// ray to the chosen point on the light met nothing.
    ///
    /// Goes to the table that the sampler was made [`with`](Self::with_visibility), and changes
    /// what that returns from its next [`end_frame`](crate::VisibilityTable::end_frame) on. Without
    /// a table, for directional lights and for lights that do not exist, nothing is recorded.
    /// Record all samples, or a random part of them: a share is the visible part of what is
    /// recorded. Any threads may call this at once; additions to shared counters are all that they
    /// contend for.
    ///
    /// The cost is one node for each level above the light, about a fifth of a sample.
    pub fn record_visibility(&self, shading_point: &ShadingPoint, light: LightId, is_visible: bool) {
        let Some((table, grid)) = &self.visibility else { return };
        let LightId::Local { instance, light } = light else { return };
        let Some((lights, mut tree)) = self.tree_view(instance, shading_point) else { return };
        let Some(place) = lights.leaves().get(light as usize) else { return };
        let cell = grid.cell(shading_point);
        let Some(row) = table.row_or_claim(&cell) else { return };
        let mut place = *place;
        let mut to_world = self.world_of(&tree);
        let mut last = None;
        // Each cluster that holds the light may be a member of the cut.
        loop {
            let (node, slot) = (&tree.nodes[place as usize / WIDTH], place as usize % WIDTH);
            let bin = bin_of_child(node, slot, tree.local.position, &to_world, &cell, grid.edge);
            // A sample counts once in a group that holds a cluster and its parent.
            if last != Some(bin) {
                table.count(row, bin, is_visible);
            }
            last = Some(bin);
            place = node.parent;
            if place == NO_PARENT {
                if tree.instance == NO_INSTANCE {
                    return;
                }
                place = self.top.places[slot_of(instance) as usize];
                tree = self.root(shading_point);
                to_world = self.world_of(&tree);
            }
        }
    }
}
