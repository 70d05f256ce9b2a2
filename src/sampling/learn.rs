//! Records what a shadow ray found, for learnt visibility.

use glam::Mat3;

use crate::keys::LightId;
use crate::sampling::sample::{LightSample, LightSampler};
use crate::sampling::walk::LeafPath;
use crate::shading::segment::LocalSegment;
use crate::shading::shading_point::ShadingPoint;
use crate::tree::WIDTH;
use crate::visibility::{bin_of_child, bin_toward};

impl LightSampler<'_> {
    /// Records whether a sample's point on a light is visible from a shading point: whether a shadow
    /// ray to it met nothing. Any sampler of the world may have drawn the sample, and it may be that of a
    /// [`Reservoir`](crate::Reservoir).
    ///
    /// Goes to the table that the sampler was made [`with`](Self::with_visibility), and changes
    /// what that returns from its next [`end_frame`](crate::VisibilityTable::end_frame) on. Without
    /// a table, for directional lights and for lights that do not exist, nothing is recorded.
    /// Record all samples, or a random part of them: a share is the visible part of what is
    /// recorded. Any threads may call this at once; additions to shared counters are all that they
    /// contend for.
    ///
    /// The cost is one node for each level above the light, about a quarter of a sample without shared
    /// cuts. Where a frame has many samples in each cell, as in pictures of 1920 x 1080 pixels, record
    /// one in 16: these teach within a few frames.
    pub fn record_visibility(&self, shading_point: &ShadingPoint, sample: &LightSample, is_visible: bool) {
        let Some((table, grid)) = &self.visibility else { return };
        let LightId::Local { instance, light } = sample.light else { return };
        let view = self.view(shading_point);
        let Some(mut path) = self.leaf_path(&view, instance, light) else { return };
        let cell = grid.cell(shading_point);
        let Some(row) = table.row_to_record(&cell) else { return };
        let mut to_world = view.to_world(&path.tree);
        // What candidates ask for, and then what cuts do: each cluster that holds the light may be a member.
        let toward = sample.incident.toward(LocalSegment::of(shading_point).as_ref());
        let mut last = bin_toward(toward, cell.from_center, grid.edge);
        table.count(row, last, is_visible);
        while path.enter_top() {
            let LeafPath { tree, place, .. } = &path;
            if tree.is_top() {
                to_world = Mat3::IDENTITY;
            }
            let (node, slot) = (&tree.nodes[*place as usize / WIDTH], *place as usize % WIDTH);
            let bin = bin_of_child(node, slot, &tree.local, &to_world, &cell, grid.edge);
            // A sample counts once in a group that holds a cluster and its parent.
            if last != bin {
                table.count(row, bin, is_visible);
            }
            last = bin;
            path.place = node.parent;
        }
    }
}
