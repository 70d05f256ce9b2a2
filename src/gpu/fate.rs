//! What becomes of commands that were recorded into an encoder of the engine.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

/// What became of commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Fate {
    /// They may still be submitted, or are under way.
    Waits,
    /// They have done their work.
    Done,
    /// They were dropped before they were submitted, or the device was lost.
    Lost,
}

/// Tells what became of commands.
#[derive(Debug, Default)]
pub(super) struct Watch(Arc<AtomicU8>);

/// Travels with commands, in a callback. wgpu drops it with commands that are never submitted.
pub(super) struct Traveller(Arc<AtomicU8>);

impl Watch {
    /// A watch over commands that are being recorded.
    pub fn new() -> (Self, Traveller) {
        let state = Arc::new(AtomicU8::new(Fate::Waits as u8));
        (Self(Arc::clone(&state)), Traveller(state))
    }

    /// What became of the commands so far.
    pub fn fate(&self) -> Fate {
        [Fate::Waits, Fate::Done, Fate::Lost][usize::from(self.0.load(Ordering::Acquire))]
    }
}

impl Traveller {
    /// Tells what became of the commands.
    pub fn arrive(self, is_done: bool) {
        self.0.store(if is_done { Fate::Done } else { Fate::Lost } as u8, Ordering::Release);
    }
}

impl Drop for Traveller {
    fn drop(&mut self) {
        let _ = self.0.compare_exchange(Fate::Waits as u8, Fate::Lost as u8, Ordering::AcqRel, Ordering::Relaxed);
    }
}
