//! The limits that an engine sets for the GPU side.

/// The largest buffer of the engine's device, the memory that trees may take there, and the bytes
/// of new trees that a frame may send.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct PlanLimits {
    /// Bytes of the largest storage buffer that the device can make and bind whole. At least
    /// 131,072. With more, the GPU holds more instances, and more trees whole.
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
    /// as 131,072.
    pub fn new(largest_buffer: u64) -> Self {
        let largest_buffer = largest_buffer.max(MIN_LARGEST_BUFFER);
        Self { largest_buffer, tree_memory: None, frame_bytes: None }
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
