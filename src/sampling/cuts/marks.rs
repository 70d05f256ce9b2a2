//! The cells that shading points need, and a few points of each.

use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use super::cell::{CutCell, POINTS, Place};

/// The places of a table in which a cell may be.
pub(crate) const PROBES: usize = 16;

/// Cells by hash, with open addressing. Any threads may add to it.
pub(crate) struct Marks {
    slots: Vec<MarkSlot>,
}

/// The words of a cell; 0 while there is none.
#[derive(Default)]
struct MarkSlot {
    tag: AtomicU32,
    /// How often the cell was marked.
    count: AtomicU32,
    /// [`CutCell`], written by the thread that wrote the tag.
    corner: [AtomicU32; 3],
    kind: AtomicU32,
    mask: AtomicU32,
    points: [AtomicU32; POINTS],
}

/// A cell that was marked.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Marked {
    pub tag: u32,
    pub count: u32,
    pub cell: CutCell,
    /// The words of points; 0 for none.
    pub points: [u32; POINTS],
}

impl Marks {
    /// Room for a power of two of cells.
    pub fn new(slots: usize) -> Self {
        Self { slots: (0..slots).map(|_| MarkSlot::default()).collect() }
    }

    /// Marks the cell of a point. Returns false if there is no room.
    ///
    /// Which cells find room does not depend on the order of marks unless a run of [`PROBES`] slots is
    /// full.
    pub fn add(&self, cell: &CutCell, place: Place) -> bool {
        let [hash, tag] = cell.keys();
        for step in 0..PROBES {
            let slot = &self.slots[(hash as usize).wrapping_add(step) & (self.slots.len() - 1)];
            let mut found = slot.tag.load(Relaxed);
            if found == 0 {
                found = match slot.tag.compare_exchange(0, tag, Relaxed, Relaxed) {
                    Ok(_) => {
                        for (word, value) in slot.corner.iter().zip(cell.corner) {
                            word.store(value, Relaxed);
                        }
                        slot.kind.store(cell.kind, Relaxed);
                        slot.mask.store(cell.mask, Relaxed);
                        tag
                    }
                    Err(other) => other,
                };
            }
            if found == tag {
                slot.count.fetch_add(1, Relaxed);
                slot.points[place.which].fetch_max(place.word, Relaxed);
                return true;
            }
        }
        false
    }

    /// The cells and their slots.
    pub fn cells(&mut self) -> impl Iterator<Item = (usize, Marked)> {
        self.slots.iter_mut().enumerate().filter_map(|(index, slot)| {
            let tag = *slot.tag.get_mut();
            (tag != 0).then(|| {
                let corner = slot.corner.each_mut().map(|word| *word.get_mut());
                let cell = CutCell { corner, kind: *slot.kind.get_mut(), mask: *slot.mask.get_mut() };
                let points = slot.points.each_mut().map(|word| *word.get_mut());
                (index, Marked { tag, count: *slot.count.get_mut(), cell, points })
            })
        })
    }

    pub fn memory_bytes(&self) -> usize {
        size_of::<MarkSlot>() * self.slots.capacity()
    }

    /// Removes all cells.
    pub fn clear(&mut self) {
        self.slots.iter_mut().for_each(|slot| *slot = MarkSlot::default());
    }
}
