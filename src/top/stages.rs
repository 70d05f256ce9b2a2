//! The order in which the GPU packs the divided nodes of a partition: children before parents.
//!
//! A workgroup packs a *block* at once: a node and those below it that are of the same stage. What is of an earlier
//! stage was packed by an earlier dispatch. A stage begins where a block would hold too many nodes, so even a million
//! parts have two or three stages.

use crate::tree::WIDTH;

/// The largest number of nodes of a block, so that a workgroup has memory for their clusters.
pub(crate) const BLOCK: usize = 112;

/// When a node is packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Stage {
    /// The number of the stage.
    pub number: u8,
    /// The nodes of its block that are below it, and itself.
    pub size: u8,
    /// A bit for each child that is of the same block.
    pub same: u8,
    /// A bit for each child that is divided.
    pub divided: u8,
}

impl Default for Stage {
    /// That of a node above cells alone.
    fn default() -> Self {
        Self { number: 0, size: 1, same: 0, divided: 0 }
    }
}

impl Stage {
    /// The stage of a node whose children have these stages; `None` for cells and unused slots.
    pub fn above(children: [Option<Self>; WIDTH]) -> Self {
        let number = children.iter().flatten().map(|child| child.number).max().unwrap_or(0);
        let is_same = |child: &Option<Self>| child.is_some_and(|child| child.number == number);
        let below: usize =
            children.iter().filter(|child| is_same(child)).flatten().map(|child| child.size as usize).sum();
        let bits = |is_set: &dyn Fn(&Option<Self>) -> bool| {
            (0..).zip(&children).map(|(slot, child)| u8::from(is_set(child)) << slot).sum()
        };
        let divided = bits(&Option::is_some);
        if below >= BLOCK {
            return Self { number: number + 1, divided, ..Self::default() };
        }
        Self { number, size: below as u8 + 1, same: bits(&is_same), divided }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stage(number: u8, size: u8) -> Option<Stage> {
        Some(Stage { number, size, ..Stage::default() })
    }

    #[test]
    fn a_block_is_full_before_the_next_stage_begins() {
        let above = |children: &[Option<Stage>]| {
            let mut all = [None; WIDTH];
            all[..children.len()].copy_from_slice(children);
            let Stage { number, size, same, divided } = Stage::above(all);
            assert_eq!(divided.count_ones() as usize, children.iter().flatten().count());
            (number, size, same)
        };
        assert_eq!(above(&[]), (0, 1, 0));
        assert_eq!(above(&[None, stage(0, 1), stage(0, 5)]), (0, 7, 0b110));
        assert_eq!(above(&[stage(0, 100), stage(0, 11)]), (0, 112, 0b11));
        assert_eq!(above(&[stage(0, 100), stage(0, 12)]), (1, 1, 0));
        // Children of earlier stages are no part of the block.
        assert_eq!(above(&[stage(0, 112), stage(1, 3), stage(0, 9), stage(1, 2)]), (1, 6, 0b1010));
        assert_eq!(above(&[stage(2, 112)]), (3, 1, 0));
    }
}
