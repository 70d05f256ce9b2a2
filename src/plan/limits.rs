//! The limits that an engine sets for the GPU side.

/// The largest buffer of the engine's device, the memory that trees may take there, and the bytes
/// of new trees that a frame may send.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct PlanLimits {
    /// Bytes of the largest storage buffer that the device can make and bind whole. At least
    /// 131,072, and at most 16 GiB, whose words shaders can count. With more, the GPU holds more
    /// instances, and more trees whole.
    pub largest_buffer: u64,
    /// Bytes of the buffers that hold the nodes and lights of trees; `None` if only
    /// [`PlanLimits::largest_buffer`] bounds them. See [`LightPlanner::set_tree_memory`].
    ///
    /// [`LightPlanner::set_tree_memory`]: super::LightPlanner::set_tree_memory
    pub tree_memory: Option<u64>,
    /// Bytes of new trees that one frame sends; `None` for any number. See
    /// [`LightPlanner::set_frame_bytes`].
    ///
    /// [`LightPlanner::set_frame_bytes`]: super::LightPlanner::set_frame_bytes
    pub frame_bytes: Option<u64>,
}

impl PlanLimits {
    /// A largest storage buffer of this many bytes, and no other limits. Less than 131,072 counts
    /// as 131,072, and more than 16 GiB as 16 GiB.
    pub fn new(largest_buffer: u64) -> Self {
        Self { largest_buffer, tree_memory: None, frame_bytes: None }.bounded()
    }

    /// The same limits, with a largest buffer within the bounds of the field.
    pub(crate) fn bounded(self) -> Self {
        Self { largest_buffer: self.largest_buffer.clamp(MIN_LARGEST_BUFFER, MAX_LARGEST_BUFFER), ..self }
    }

    /// The same limits, and at most this many bytes for the nodes and lights of trees.
    #[must_use]
    pub fn with_tree_memory(self, bytes: u64) -> Self {
        Self { tree_memory: Some(bytes), ..self }
    }

    /// The same limits, and at most this many bytes of new trees in a frame.
    #[must_use]
    pub fn with_frame_bytes(self, bytes: u64) -> Self {
        Self { frame_bytes: Some(bytes), ..self }
    }
}

impl Default for PlanLimits {
    /// WebGPU's default: 128 MiB.
    fn default() -> Self {
        Self::new(128 << 20)
    }
}

/// The size of the largest buffer of an empty world, in bytes.
pub(crate) const MIN_LARGEST_BUFFER: u64 = 128 * 1024;

/// The largest buffer whose 32-bit words a `u32` can count.
pub(crate) const MAX_LARGEST_BUFFER: u64 = 1 << 34;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_buffer_stays_within_what_kernels_need_and_can_address() {
        let largest = |bytes| PlanLimits::new(bytes).largest_buffer;
        assert_eq!([0, 131_071, 131_073].map(largest), [131_072, 131_072, 131_073]);
        assert_eq!([(1 << 34) - 1, 1 << 34, u64::MAX].map(largest), [(1 << 34) - 1, 1 << 34, 1 << 34]);
    }
}
