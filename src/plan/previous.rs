//! The lights and instances of the last frame, in one buffer: what shaders need to evaluate a light as it was then.
//!
//! Each plan begins with copies of what the plan before it changed. So a world that rests costs nothing, and a plan
//! may change all buffers freely afterwards.

use super::buffers::BufferId;
use super::commands::Commands;
use super::draft::{Draft, Growth};
use super::layout::ParamsRecord;

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

#[derive(Clone, Debug)]
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

impl Previous {
    pub fn new() -> Self {
        Self { is_kept: false, buffer: None, written: None, is_stale: [true; 2], is_lost: false }
    }

    /// The buffer; `None` before the first plan that keeps it.
    pub fn buffer(&self) -> Option<BufferId> {
        self.buffer.map(|kept| kept.id)
    }

    /// Copies the present buffers, of instances and of lights, and the parameters; there are none yet before the first
    /// plan. A frame that takes more than `most` bytes is remembered as one without lights.
    pub fn copy(&mut self, present: Option<[Present; 2]>, params: ParamsRecord, most: u64, draft: &mut Draft) {
        if !self.is_kept {
            draft.plan.freed.extend(self.buffer());
            *self = Self::new();
            return;
        }
        let size = |bytes: [u64; 2]| 16 * u64::from(HEAD) + bytes[0] + bytes[1];
        let fitting = present.filter(|present| size(present.map(|(_, used, _)| used)) <= most);
        let [used, whole] = match fitting {
            Some(present) => [present.map(|(_, used, _)| used), present.map(|(.., whole)| whole)],
            None => [[EMPTY_BYTES; 2]; 2],
        };
        let kept = match self.buffer.filter(|kept| (0..2).all(|i| kept.bytes[i] >= used[i])) {
            Some(kept) => kept,
            None => {
                let bytes = if draft.growth == Growth::Double && size(whole) <= most { whole } else { used };
                let id = draft.storage("lights of the last frame", size(bytes));
                draft.plan.freed.extend(self.buffer());
                (self.written, self.is_stale) = (None, [true; 2]);
                Kept { id, bytes }
            }
        };
        self.buffer = Some(kept);
        let head = 16 * u64::from(HEAD);
        if self.written.is_none() {
            draft.plan.upload.zero(kept.id, 0..size(kept.bytes));
        }
        let is_empty = self.is_lost || present.is_some() && fitting.is_none();
        for (i, start) in [head, head + kept.bytes[0]].into_iter().enumerate() {
            if let Some(present) = fitting
                && self.is_stale[i]
                && !self.is_lost
            {
                draft.plan.upload.copy(present[i].0, (kept.id, start), present[i].1);
            }
        }
        self.is_lost = false;
        self.is_stale = [is_empty; 2];
        // Without slots, shaders find no light.
        let params = if is_empty { ParamsRecord::default() } else { params };
        self.write(params, &mut draft.plan.upload);
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
