//! The lights and instances of the last frame, in one buffer: what shaders need to evaluate a light as it was then.
//!
//! Each plan begins with copies of what the plan before it changed. So a world that rests costs nothing, and a plan
//! may change all buffers freely afterwards.

use super::buffers::{BufferId, Ids, NewBuffer};
use super::commands::Commands;
use super::layout::ParamsRecord;
use super::pool::Growth;

/// Quads before the instances: the parameters, and where the lights begin. Twin of `LIGHT_PREVIOUS_HEAD`.
pub(crate) const HEAD: u32 = size_of::<Head>() as u32 / 16;

/// Bytes of instances and of lights for a frame in which there was nothing: as much as shaders read of them.
const EMPTY_BYTES: u64 = 256;

/// What shaders read first. Twin of the first quads of `light_previous`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
struct Head {
    params: ParamsRecord,
    /// Where the lights begin, in quads.
    lights: u32,
    padding: [u32; 3],
}

#[derive(Debug)]
pub(super) struct Previous {
    /// Whether the engine wants it.
    pub is_kept: bool,
    buffer: Option<Kept>,
    /// What the buffer begins with; `None` if that is not known.
    written: Option<Head>,
    /// Whether the last plan has changed instances and lights.
    is_stale: [bool; 2],
    /// The device may lack what the present buffers should hold, so they are not worth a copy.
    is_lost: bool,
}

/// The buffer, with the bytes for instances and for lights.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Kept {
    id: BufferId,
    bytes: [u64; 2],
}

/// A buffer that shaders bind, with the bytes that are in use and its size.
pub(super) type Present = (BufferId, u64, u64);

/// What a plan does first.
#[derive(Debug, Default)]
pub(super) struct Copies {
    buffer: Option<Kept>,
    /// Source, and its bytes: of instances and of lights; `None` for what is not copied.
    sources: [Option<(BufferId, u64)>; 2],
    /// The last frame has no lights: it is too large for a buffer.
    is_empty: bool,
}

impl Previous {
    pub fn new() -> Self {
        Self { is_kept: false, buffer: None, written: None, is_stale: [true; 2], is_lost: false }
    }

    /// The buffer; `None` before the first plan that keeps it.
    pub fn buffer(&self) -> Option<BufferId> {
        self.buffer.map(|kept| kept.id)
    }

    /// Reserves room for copies of the present buffers, of instances and of lights, of at most `most` bytes; there are
    /// none yet before the first plan. A frame that takes more is remembered as one without lights.
    pub fn reserve(
        &self,
        present: Option<[Present; 2]>,
        (most, growth): (u64, Growth),
        (ids, new): (&mut Ids, &mut Vec<NewBuffer>),
    ) -> Copies {
        if !self.is_kept {
            return Copies::default();
        }
        let size = |bytes: [u64; 2]| 16 * u64::from(HEAD) + bytes[0] + bytes[1];
        let fitting = present.filter(|present| size(present.map(|(_, used, _)| used)) <= most);
        let [used, whole] = match fitting {
            Some(present) => [present.map(|(_, used, _)| used), present.map(|(.., whole)| whole)],
            None => [[EMPTY_BYTES; 2]; 2],
        };
        let fits = |kept: &Kept| (0..2).all(|i| kept.bytes[i] >= used[i]);
        let kept = match self.buffer.filter(fits) {
            Some(kept) => kept,
            None => {
                let bytes = if growth == Growth::Double && size(whole) <= most { whole } else { used };
                let buffer = ids.storage("lights of the last frame", size(bytes));
                new.push(buffer);
                Kept { id: buffer.id, bytes }
            }
        };
        let is_new = self.buffer != Some(kept);
        let mut sources = [None; 2];
        if let Some(present) = fitting.filter(|_| !self.is_lost) {
            sources = std::array::from_fn(|i| (self.is_stale[i] || is_new).then_some((present[i].0, present[i].1)));
        }
        Copies { buffer: Some(kept), sources, is_empty: present.is_some() && fitting.is_none() }
    }

    /// Adds the copies, and the parameters of the last frame. Adds a buffer that is no longer used to `freed`.
    pub fn adopt(
        &mut self,
        copies: Copies,
        params: ParamsRecord,
        (commands, freed): (&mut Commands, &mut Vec<BufferId>),
    ) {
        let Some(kept) = copies.buffer else {
            if !self.is_kept {
                freed.extend(self.buffer());
                *self = Self::new();
            }
            return;
        };
        let former = self.buffer.replace(kept).filter(|former| former.id != kept.id);
        freed.extend(former.map(|former| former.id));
        let head = 16 * u64::from(HEAD);
        let starts = [head, head + kept.bytes[0]];
        if former.is_some() || self.written.is_none() {
            self.written = None;
            commands.zero(kept.id, 0..head + kept.bytes[0] + kept.bytes[1]);
        }
        for (source, start) in copies.sources.into_iter().zip(starts) {
            source.into_iter().for_each(|(from, bytes)| commands.copy_to(from, (kept.id, start), bytes));
        }
        let is_empty = std::mem::take(&mut self.is_lost) || copies.is_empty;
        self.is_stale = [is_empty; 2];
        // Without slots, shaders find no light.
        let params = if is_empty { ParamsRecord::default() } else { params };
        self.write(params, commands);
    }

    /// Lets the last frame read the maps of this one: the sky and the profiles are not copied.
    pub fn follow_maps(&mut self, present: ParamsRecord, commands: &mut Commands) {
        if let Some(Head { params, .. }) = self.written {
            self.write(ParamsRecord { parts: present.parts, sky_map: present.sky_map, ..params }, commands);
        }
    }

    fn write(&mut self, params: ParamsRecord, commands: &mut Commands) {
        let Some(kept) = self.buffer else { return };
        let head = Head { params, lights: HEAD + (kept.bytes[0] / 16) as u32, padding: [0; 3] };
        if self.written != Some(head) {
            commands.write(kept.id, 0, bytemuck::bytes_of(&head));
            self.written = Some(head);
        }
    }

    /// The device may lack what was planned, copies among it. So the next plan leaves no light in the
    /// last frame, and the one after it copies everything.
    pub fn lose(&mut self) {
        self.is_lost = true;
        self.written = None;
    }

    /// Notes whether a plan has changed instances and lights.
    pub fn changed(&mut self, is_changed: [bool; 2]) {
        for (is_stale, is_changed) in self.is_stale.iter_mut().zip(is_changed) {
            *is_stale |= is_changed;
        }
    }
}
