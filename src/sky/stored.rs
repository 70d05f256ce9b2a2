//! A map as a GPU stores it. Twin of `shaders/sky.wgsl`.
//!
//! A quad of its size, the number of patches and its scale; for each of [`SKY_LEVELS`] levels 0, 2, 4 and so on a quad
//! with the place of its first quad and the number of blocks in a row; the solid angles of rows, four to a quad; the quads of all levels.

use super::Sky;

/// Levels of the largest map that are stored.
pub(crate) const SKY_LEVELS: u32 = super::MAX_SIZE.ilog2().div_ceil(2);

/// A patch as a GPU stores it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StoredPatch {
    /// See [`Patch::lux`](super::patches::Patch).
    pub lux: f32,
    pub at: [u32; 2],
    pub level: u32,
}

impl Sky {
    pub(crate) fn stored_patch(&self, patch: u32) -> Option<StoredPatch> {
        let patch = self.patches.get(patch as usize)?;
        Some(StoredPatch { lux: patch.lux, at: patch.place.at.map(|at| at as u32), level: patch.place.level as u32 })
    }

    /// The number of quads of a stored map.
    pub(crate) fn stored_quads(&self) -> u32 {
        self.first_stored() + self.levels.quad_count() as u32
    }

    /// What changed last; greater than 0, and greater than those of all changes before, of any map.
    pub(crate) fn revision(&self) -> u64 {
        self.levels.revision()
    }

    /// Calls a function with runs of quads that have changed since a revision, and with where they begin.
    pub(crate) fn for_each_change(&self, since: u64, mut write: impl FnMut(u32, &[[u32; 4]])) {
        if since == self.revision() {
            return;
        }
        let first = self.first_stored();
        match self.levels.changes_since(since) {
            None => {
                write(0, &self.head());
                write(first, &self.levels.quads(0..self.levels.quad_count()));
            }
            Some(runs) => {
                // The number of patches changes with any part.
                write(0, &[self.first_quad()]);
                runs.for_each(|run| write(first + run.start as u32, &self.levels.quads(run)));
            }
        }
    }

    /// Where the quads of the levels begin.
    fn first_stored(&self) -> u32 {
        1 + SKY_LEVELS + self.size()[1].div_ceil(4) as u32
    }

    fn first_quad(&self) -> [u32; 4] {
        let [width, height] = self.size().map(|side| side as u32);
        [width, height, self.patches.len() as u32, self.levels.scale().to_bits()]
    }

    fn head(&self) -> Vec<[u32; 4]> {
        let mut head = vec![self.first_quad()];
        let places = (0..SKY_LEVELS as usize).map(|level| self.levels.place(level));
        head.extend(places.map(|[quad, row]| [self.first_stored() + quad as u32, row as u32, 0, 0]));
        let angle = |row: usize| self.levels.solid_angle(row).to_bits();
        head.extend((0..self.size()[1]).step_by(4).map(|row| [row, row + 1, row + 2, row + 3].map(angle)));
        head
    }
}
