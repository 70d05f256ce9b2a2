//! The buffers of the last frame, for lights as they were then.
//!
//! Each plan begins with copies of the buffers that the plan before it changed. So a pool that rests
//! costs nothing, and a plan may change all buffers freely afterwards.

use super::buffers::{BufferId, Ids, NewBuffer, ShaderBuffers};
use super::commands::Commands;
use super::layout::ParamsRecord;

/// Storage buffers that shaders bind: top level, nodes, instances, lights.
pub(super) const BUFFERS: usize = 4;

/// Bytes of a buffer for a frame in which there was nothing: as much as shaders read of it.
const EMPTY_BYTES: u64 = 256;

#[derive(Debug)]
pub(super) struct Previous {
    /// Whether the engine wants them.
    pub is_kept: bool,
    buffers: Option<[Copied; BUFFERS]>,
    params: Option<BufferId>,
    /// What the uniform holds.
    written: Option<ParamsRecord>,
    /// Which buffers the last plan has changed.
    is_stale: [bool; BUFFERS],
    /// The device may lack what the present buffers should hold, so they are not worth a copy.
    is_lost: bool,
}

/// A buffer and its size.
#[derive(Clone, Copy, Debug)]
struct Copied {
    id: BufferId,
    bytes: u64,
}

/// What a plan does first.
#[derive(Debug, Default)]
pub(super) struct Copies {
    buffers: Option<[Copied; BUFFERS]>,
    params: Option<BufferId>,
    /// Source, and its bytes; `None` for a buffer that is not copied.
    sources: [Option<(BufferId, u64)>; BUFFERS],
}

impl Previous {
    pub fn new() -> Self {
        Self { is_kept: false, buffers: None, params: None, written: None, is_stale: [true; BUFFERS], is_lost: false }
    }

    /// The buffers in the order of the bindings; `None` before the first plan that keeps them.
    pub fn bindings(&self) -> Option<ShaderBuffers> {
        let ([top, nodes, instances, lights], params) = (self.buffers?.map(|copied| copied.id), self.params?);
        Some(ShaderBuffers([params, top, nodes, instances, lights]))
    }

    /// Reserves room for copies of the present buffers: what of each is in use, and its whole size.
    /// `None` if there are none yet.
    pub fn reserve(
        &self,
        present: Option<[(BufferId, u64, u64); BUFFERS]>,
        (ids, new): (&mut Ids, &mut Vec<NewBuffer>),
    ) -> Copies {
        if !self.is_kept {
            return Copies::default();
        }
        let mut copies = Copies::default();
        let mut add = |buffer: NewBuffer| {
            new.push(buffer);
            buffer.id
        };
        let mut buffer = |index: usize| {
            let (used, whole) =
                present.map_or((EMPTY_BYTES, EMPTY_BYTES), |buffers| (buffers[index].1, buffers[index].2));
            match self.buffers.map(|buffers| buffers[index]).filter(|copied| copied.bytes >= used) {
                Some(copied) => copied,
                None => Copied { id: add(ids.storage("lights of the last frame", whole)), bytes: whole },
            }
        };
        copies.buffers = Some([0, 1, 2, 3].map(&mut buffer));
        if let Some(present) = present.filter(|_| !self.is_lost) {
            let is_new = |index: usize| {
                let [before, after] = [self.buffers, copies.buffers].map(|buffers| buffers.map(|b| b[index].id));
                before != after
            };
            copies.sources = std::array::from_fn(|index| {
                let (id, used, _) = present[index];
                (self.is_stale[index] || is_new(index)).then_some((id, used))
            });
        }
        let bytes = size_of::<ParamsRecord>() as u64;
        copies.params = Some(self.params.unwrap_or_else(|| add(ids.uniform("parameters of the last frame", bytes))));
        copies
    }

    /// Adds the copies, and the parameters of the last frame. Adds buffers that are no longer used
    /// to `freed`.
    pub fn adopt(
        &mut self,
        copies: Copies,
        params: ParamsRecord,
        (commands, freed): (&mut Commands, &mut Vec<BufferId>),
    ) {
        let Some(buffers) = copies.buffers else {
            if !self.is_kept {
                freed.extend(self.bindings().iter().flat_map(|buffers| buffers.iter()));
                *self = Self::new();
            }
            return;
        };
        let former = self.buffers.replace(buffers);
        for (index, to) in buffers.iter().enumerate() {
            let former = former.map(|former| former[index].id).filter(|former| *former != to.id);
            freed.extend(former);
            match copies.sources[index] {
                Some((from, bytes)) => commands.copy(from, to.id, bytes),
                None if self.written.is_none() => commands.zero(to.id, 0..to.bytes),
                None => {}
            }
        }
        let is_lost = std::mem::take(&mut self.is_lost);
        self.is_stale = [is_lost; BUFFERS];
        self.params = copies.params;
        // After a loss all buffers are zero, and shaders find no light.
        let params = if is_lost { ParamsRecord { strides: params.strides, ..ParamsRecord::default() } } else { params };
        if let Some(buffer) = self.params.filter(|_| self.written != Some(params)) {
            commands.write(buffer, 0, bytemuck::bytes_of(&params));
            self.written = Some(params);
        }
    }

    /// The device may lack what was planned, copies among it. So the next plan leaves no light in the
    /// last frame, and the one after it copies everything.
    pub fn lose(&mut self) {
        self.is_lost = true;
        self.written = None;
    }

    /// Notes which buffers a plan has changed.
    pub fn changed(&mut self, is_changed: [bool; BUFFERS]) {
        for (is_stale, is_changed) in self.is_stale.iter_mut().zip(is_changed) {
            *is_stale |= is_changed;
        }
    }
}
