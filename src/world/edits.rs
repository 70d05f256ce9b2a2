//! The trees whose lights are edited.

use super::key_set::KeySet;
use crate::keys::TreeKey;

/// What edits of lights have asked for, and what the last update did of it.
#[derive(Debug, Default)]
pub(super) struct Edits {
    /// Trees that the next update refits, or whose rebuild request it updates.
    pub pending: KeySet<TreeKey>,
    /// The lights that the last update added to trees.
    pub added: Vec<(TreeKey, u32)>,
    /// The lights that the last update removed from trees.
    pub removed: Vec<(TreeKey, u32)>,
}
