//! The names of buffers, which the engine makes and the plans use.

use std::ops::Deref;

use rpds::RedBlackTreeMapSync;

/// The number of a buffer. A planner gives each buffer a number of its own and never uses it again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BufferId(u32);

impl BufferId {
    /// The number itself, from 0 on.
    pub fn get(self) -> u32 {
        self.0
    }
}

/// What a buffer is bound as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum BufferKind {
    /// A uniform buffer that plans also write.
    Uniform,
    /// A storage buffer that plans also write, copy from, copy to and clear.
    Storage,
    /// A storage buffer from which [`Command::DispatchIndirect`](super::Command::DispatchIndirect) takes its
    /// workgroups. Kernels write it; no other command names it. Engines may copy from it.
    Indirect,
}

/// A buffer that the engine has to make.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct NewBuffer {
    /// Its number in all later plans.
    pub id: BufferId,
    /// What it holds, for graphics debuggers and messages.
    pub what: &'static str,
    /// Its size: a multiple of 4. Its content is undefined at first; plans clear what they rely on.
    pub bytes: u64,
    /// What it is bound as.
    pub kind: BufferKind,
}

/// The buffers that shaders bind, in the order of their bindings: a slice, which later versions may
/// lengthen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ShaderBuffers(pub(crate) [BufferId; 5]);

impl Deref for ShaderBuffers {
    type Target = [BufferId];

    fn deref(&self) -> &[BufferId] {
        &self.0
    }
}

/// Gives out numbers for buffers.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Ids(u32);

impl Ids {
    pub fn next(&mut self) -> BufferId {
        let id = BufferId(self.0);
        self.0 += 1;
        id
    }
}

/// The sizes of the buffers of a planner.
#[derive(Clone, Debug, Default)]
pub(super) struct Buffers {
    bytes: RedBlackTreeMapSync<BufferId, u64>,
    total: u64,
}

impl Buffers {
    /// Records buffers that were made and freed.
    pub fn change(&mut self, new: &[NewBuffer], freed: &[BufferId]) {
        for buffer in new {
            self.total += buffer.bytes;
            self.bytes.insert_mut(buffer.id, buffer.bytes);
        }
        for id in freed {
            self.total -= self.bytes.get(id).copied().unwrap_or(0);
            self.bytes.remove_mut(id);
        }
    }

    /// The bytes of all buffers.
    pub fn total(&self) -> u64 {
        self.total
    }
}
