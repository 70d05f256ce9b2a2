//! What refits on the GPU measure of the trees that kernels write.

use super::LightWorld;
use super::scene::TreeVersion;
use super::source::TreeSource;
use crate::keys::TreeKey;
use crate::policy::RebuildRequest;
use crate::scheduler::TreeFeatures;
use crate::tree::Attributes;

/// What a refit on the GPU found out about a tree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SourceMeasure {
    pub attributes: Attributes,
    /// The squared diagonal of the box by the variance of position.
    pub spread: f32,
    pub axis_length: f32,
    /// Writes that were refused since the record of the source was written.
    pub refused: u32,
}

impl LightWorld {
    /// The present version of a tree.
    pub(crate) fn version(&self, tree: TreeKey) -> Option<TreeVersion> {
        self.scene.version(tree)
    }

    /// Takes what a refit on the GPU found out about a version of a tree. Returns whether the tree's policies
    /// request a rebuild, for which the present lights are needed. O(1).
    pub(crate) fn measure(&mut self, version: TreeVersion, measure: &SourceMeasure) -> bool {
        let tree = version.tree;
        let present = self.version(tree);
        let Some(entry) = self.scene.trees.get_mut(tree) else { return false };
        let Some(source) = &mut entry.source else { return false };
        let (last, total) = source.refused;
        let more = measure.refused.checked_sub(last).unwrap_or(measure.refused);
        source.refused = (measure.refused, total + u64::from(more));
        if source.by != TreeSource::GpuMesh || present != Some(version) || !entry.requests.policies.may_rebuild() {
            return false;
        }
        entry.requests.history.observe(&measure.attributes);
        let SourceMeasure { attributes, spread, axis_length, .. } = *measure;
        let features = TreeFeatures::new(&attributes, spread, axis_length, entry.tree.light_count());
        let scheduler = &mut self.rebuilds.scheduler;
        scheduler.has_changed(tree, &features);
        // A tree that waits was read already.
        !scheduler.waits(tree) && entry.rebuild_request(&attributes, scheduler.excess(tree)) > RebuildRequest::Doubtful
    }

    /// The number of numbers of sources, in use or not.
    pub(crate) fn source_numbers(&self) -> u32 {
        self.scene.sources.len() as u32
    }

    /// The tree whose source has a number.
    pub(crate) fn source_tree(&self, number: u32) -> Option<TreeKey> {
        *self.scene.sources.get(number as usize)?
    }

    /// The same, with who writes its lights.
    pub(crate) fn source_at(&self, number: u32) -> Option<(TreeKey, TreeSource)> {
        let tree = self.source_tree(number)?;
        self.light_source(tree).map(|(source, _)| (tree, source))
    }
}
