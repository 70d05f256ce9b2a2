//! The commands of a frame, as data.

use std::ops::Range;

use super::buffers::BufferId;
use super::kernel::{Kernel, workgroups};

/// One command. Each sees what all commands before it have done.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Command<'a> {
    /// Overwrites bytes of a buffer. Offset and length are multiples of 4.
    Write {
        /// The buffer.
        buffer: BufferId,
        /// The first byte that is overwritten.
        offset: u64,
        /// The new content, at least four bytes.
        bytes: &'a [u8],
    },
    /// Copies the first bytes of a buffer to another.
    Copy {
        /// The source.
        from: BufferId,
        /// The destination, another buffer.
        to: BufferId,
        /// The first byte of the destination, a multiple of 4.
        offset: u64,
        /// How many, a multiple of 4.
        bytes: u64,
    },
    /// Sets bytes of a buffer to zero.
    Clear {
        /// The buffer.
        buffer: BufferId,
        /// The first byte, a multiple of 4.
        offset: u64,
        /// How many, a multiple of 4.
        bytes: u64,
    },
    /// Runs a kernel.
    Dispatch {
        /// Its text and bindings.
        kernel: Kernel,
        /// The buffers of its bindings, in their order.
        buffers: &'a [BufferId],
        /// Where the range of its uniform buffer starts, in bytes: a multiple of
        /// [`UNIFORM_ALIGNMENT`](super::UNIFORM_ALIGNMENT).
        uniform_offset: u32,
        /// The number of workgroups in each dimension, at least one.
        workgroups: [u32; 3],
    },
    /// Runs a kernel with as many workgroups as a buffer says.
    DispatchIndirect {
        /// Its text and bindings.
        kernel: Kernel,
        /// The buffers of its bindings, in their order.
        buffers: &'a [BufferId],
        /// As for [`Command::Dispatch`].
        uniform_offset: u32,
        /// The buffer that begins with the number of workgroups in each dimension, as three 32-bit words. It is not
        /// among `buffers`.
        workgroups: BufferId,
    },
}

/// A list of commands, in the order in which they have to run.
#[derive(Clone, Debug, Default)]
pub struct Commands {
    entries: Vec<StoredCommand>,
    /// What all writes write.
    bytes: Vec<u8>,
    /// The buffers of all dispatches.
    buffers: Vec<BufferId>,
}

/// A command whose slices are ranges of the lists.
#[derive(Clone, Debug)]
enum StoredCommand {
    Write { buffer: BufferId, offset: u64, bytes: Range<usize> },
    Copy { from: BufferId, to: BufferId, offset: u64, bytes: u64 },
    Clear { buffer: BufferId, offset: u64, bytes: u64 },
    Dispatch { kernel: Kernel, buffers: Range<usize>, uniform_offset: u32, workgroups: [u32; 3] },
    DispatchIndirect { kernel: Kernel, buffers: Range<usize>, uniform_offset: u32, workgroups: BufferId },
}

impl Commands {
    /// The commands in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = Command<'_>> {
        self.entries.iter().map(|entry| match entry {
            StoredCommand::Write { buffer, offset, bytes } => {
                Command::Write { buffer: *buffer, offset: *offset, bytes: &self.bytes[bytes.clone()] }
            }
            StoredCommand::Copy { from, to, offset, bytes } => {
                Command::Copy { from: *from, to: *to, offset: *offset, bytes: *bytes }
            }
            StoredCommand::Clear { buffer, offset, bytes } => {
                Command::Clear { buffer: *buffer, offset: *offset, bytes: *bytes }
            }
            StoredCommand::Dispatch { kernel, buffers, uniform_offset, workgroups } => Command::Dispatch {
                kernel: *kernel,
                buffers: &self.buffers[buffers.clone()],
                uniform_offset: *uniform_offset,
                workgroups: *workgroups,
            },
            StoredCommand::DispatchIndirect { kernel, buffers, uniform_offset, workgroups } => {
                Command::DispatchIndirect {
                    kernel: *kernel,
                    buffers: &self.buffers[buffers.clone()],
                    uniform_offset: *uniform_offset,
                    workgroups: *workgroups,
                }
            }
        })
    }

    /// How many commands there are.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// The bytes of all writes.
    pub fn bytes_written(&self) -> u64 {
        self.bytes.len() as u64
    }

    /// Makes room for more commands, and for the bytes of their writes.
    pub(crate) fn reserve(&mut self, commands: usize, bytes: u64) {
        self.entries.reserve(commands);
        self.bytes.reserve(bytes as usize);
    }

    /// Adds a write of what `fill` appends; nothing if that is empty.
    pub(crate) fn write_with(&mut self, buffer: BufferId, offset: u64, fill: impl FnOnce(&mut Vec<u8>)) {
        let start = self.bytes.len();
        fill(&mut self.bytes);
        let bytes = start..self.bytes.len();
        if !bytes.is_empty() {
            self.entries.push(StoredCommand::Write { buffer, offset, bytes });
        }
    }

    /// Adds a write.
    pub(crate) fn write(&mut self, buffer: BufferId, offset: u64, bytes: &[u8]) {
        self.write_with(buffer, offset, |all| all.extend_from_slice(bytes));
    }

    /// Adds a copy of the first bytes of a buffer to a place in another; nothing if there are none.
    pub(crate) fn copy(&mut self, from: BufferId, (to, offset): (BufferId, u64), bytes: u64) {
        if bytes > 0 {
            self.entries.push(StoredCommand::Copy { from, to, offset, bytes });
        }
    }

    /// Adds a clear; nothing if it has no bytes.
    pub(crate) fn zero(&mut self, buffer: BufferId, range: Range<u64>) {
        if !range.is_empty() {
            self.entries.push(StoredCommand::Clear { buffer, offset: range.start, bytes: range.end - range.start });
        }
    }

    /// Adds a dispatch of at least `groups` workgroups.
    pub(crate) fn dispatch(&mut self, kernel: Kernel, buffers: &[BufferId], uniform_offset: u32, groups: u32) {
        let buffers = self.bind(kernel, buffers);
        self.entries.push(StoredCommand::Dispatch { kernel, buffers, uniform_offset, workgroups: workgroups(groups) });
    }

    /// Adds a dispatch of as many workgroups as a buffer says.
    pub(crate) fn dispatch_indirect(
        &mut self,
        kernel: Kernel,
        buffers: &[BufferId],
        uniform_offset: u32,
        workgroups: BufferId,
    ) {
        let buffers = self.bind(kernel, buffers);
        self.entries.push(StoredCommand::DispatchIndirect { kernel, buffers, uniform_offset, workgroups });
    }

    /// Keeps the buffers of a dispatch.
    fn bind(&mut self, kernel: Kernel, buffers: &[BufferId]) -> Range<usize> {
        debug_assert_eq!(buffers.len(), kernel.bindings().len(), "{kernel:?}");
        let start = self.buffers.len();
        self.buffers.extend_from_slice(buffers);
        start..self.buffers.len()
    }
}
