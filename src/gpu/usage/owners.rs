//! Who had which slot when.

use crate::keys::InstanceKey;

/// The instance of a slot, and the first collection whose counts are its own.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Owner {
    key: Option<InstanceKey>,
    since: u64,
}

impl Owner {
    /// From this collection on.
    pub fn new(key: Option<InstanceKey>, since: u64) -> Self {
        Self { key, since }
    }

    pub fn key(&self) -> Option<InstanceKey> {
        self.key
    }

    /// Whether all that a collection counted is its own.
    pub fn is_there_since(&self, collection: u64) -> bool {
        self.key.is_some() && self.since <= collection
    }
}
