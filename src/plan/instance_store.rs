//! The records of instances on the GPU, and of their parts.

use super::layout::InstanceRecord;
use super::parts::PartTable;
use super::pool::Pool;

/// Records that the first buffer has room for.
const FIRST_RECORDS: u32 = 64;

/// What the GPU holds of instances.
#[derive(Clone)]
pub(super) struct InstanceStore {
    /// A table by slot.
    pub pool: Pool<InstanceRecord>,
    /// The slots of the table that are in use.
    pub count: u32,
    pub parts: PartTable,
}

impl InstanceStore {
    /// Nothing yet. No buffer will be larger than `limit` bytes.
    pub fn new(limit: u64) -> Self {
        Self { pool: Pool::new("instances", FIRST_RECORDS, limit), count: 0, parts: PartTable::new(limit) }
    }
}
