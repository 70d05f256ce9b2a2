//! The buffers that an engine has to make.

use std::ffi::c_char;

use girandole::plan::{BufferKind, NewBuffer};

use crate::names::c_name;
use crate::status::Failure;

/// What a buffer is bound as: one of GIRANDOLE_BUFFER_*.
pub type GirandoleBufferUsage = u32;
/// A uniform buffer that plans also write. Vulkan: UNIFORM_BUFFER, TRANSFER_DST.
pub const GIRANDOLE_BUFFER_UNIFORM: GirandoleBufferUsage = 0;
/// A storage buffer that plans also write, copy from, copy to and clear. Vulkan: STORAGE_BUFFER,
/// TRANSFER_SRC, TRANSFER_DST.
pub const GIRANDOLE_BUFFER_STORAGE: GirandoleBufferUsage = 1;
/// A storage buffer that also holds the workgroups of dispatches. Vulkan: INDIRECT_BUFFER too.
pub const GIRANDOLE_BUFFER_INDIRECT: GirandoleBufferUsage = 2;

/// A buffer that the engine must create.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct GirandoleNewBuffer {
    /// Its number in all later plans. A planner never reuses a number.
    pub id: u32,
    /// One of GIRANDOLE_BUFFER_*.
    pub usage: GirandoleBufferUsage,
    /// Bytes, a multiple of 4. The content may be undefined at first.
    pub size: u64,
    /// A name for graphics debuggers, which says what the buffer holds. Valid until the process ends.
    pub what: *const c_char,
}

pub(crate) fn new_buffers<'a>(
    buffers: impl Iterator<Item = &'a NewBuffer>,
) -> Result<Vec<GirandoleNewBuffer>, Failure> {
    let buffer = |buffer: &NewBuffer| {
        let usage = match buffer.kind {
            BufferKind::Uniform => GIRANDOLE_BUFFER_UNIFORM,
            BufferKind::Storage => GIRANDOLE_BUFFER_STORAGE,
            BufferKind::Indirect => GIRANDOLE_BUFFER_INDIRECT,
            _ => return Err(Failure::bad_value("usage of a buffer", format!("{:?}", buffer.kind))),
        };
        Ok(GirandoleNewBuffer { id: buffer.id.get(), usage, size: buffer.bytes, what: c_name(buffer.what) })
    };
    buffers.map(buffer).collect()
}
