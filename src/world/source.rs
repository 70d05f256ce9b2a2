//! Who writes the lights of a tree.

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

/// The source of one tree.
pub(super) struct Source {
    pub by: TreeSource,
    pub number: u32,
    /// The count of the last measure, and all refusals so far.
    pub refused: (u32, u64),
}
