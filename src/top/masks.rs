//! The masks of the lights below each node of the top level: which bits they have, and on how much of
//! the flux.
//!
//! Twin of `pack_masks` in shaders/top_pack.wgsl and of `light_seen_share` in shaders/records.wgsl. All
//! sums are of whole numbers, so that both get the same bits.

use bytemuck::{Pod, Zeroable};

use crate::tree::WIDTH;

/// A share of 1. Shares are whole numbers, and so are their sums.
pub(crate) const WHOLE: u32 = 1 << (MAX_CODE - 1);

/// A share is rounded to a code if it is at least this many 256ths of what the code stands for, which is
/// √½, and too small for the next code.
pub(crate) const ROUNDED: u32 = 181;

/// The code of a share of 1. Each code below it stands for half as much, and the code 0 for none.
const MAX_CODE: u32 = 7;

/// For each bit of a mask the share of the flux below a node whose instances have the bit, as a code of
/// three bits. Bit j of the code of bit i is bit i of word j. A code is 0 only if no instance that shines
/// has the bit, so what rounds to less than 1/64 counts as 1/64.
///
/// Codes of four bits would be more exact, but do not fit into the memory of a workgroup that packs
/// nodes.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct MaskShares([u32; 3]);

/// What the top level knows about the masks below a node.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct NodeMasks {
    /// Of the node itself. They weigh it in its parent.
    pub shares: MaskShares,
    padding: u32,
    /// For each child the union of the masks of all instances below it.
    pub children: [u32; WIDTH],
}

impl NodeMasks {
    /// Of a node whose children have these shares and, as nodes store it, this flux.
    pub fn new(children: &[MaskShares; WIDTH], flux: &[u16; WIDTH]) -> Self {
        let shares = MaskShares::merged(children, flux);
        Self { shares, padding: 0, children: children.map(MaskShares::union) }
    }
}

impl MaskShares {
    /// The shares of a part of an instance with this mask.
    pub fn of_part(mask: u32) -> Self {
        Self([mask; 3])
    }

    /// The bits that some instance has.
    fn union(self) -> u32 {
        self.0.iter().fold(0, |all, word| all | word)
    }

    /// The shares of a node whose children have these shares and, as nodes store it, this flux.
    fn merged(children: &[Self; WIDTH], flux: &[u16; WIDTH]) -> Self {
        let weights = weights(flux);
        let total = weights.iter().sum();
        let mut merged = Self::default();
        for bit in bits_of(children.iter().fold(0, |all, child| all | child.union())) {
            let sum = children.iter().zip(weights).map(|(child, weight)| weight * share(child.code(bit))).sum();
            let code = nearest_code(sum, total);
            for (j, word) in merged.0.iter_mut().enumerate() {
                *word |= (code >> j & 1) << bit;
            }
        }
        merged
    }

    fn code(self, bit: u32) -> u32 {
        self.0.iter().rev().fold(0, |code, word| code << 1 | word >> bit & 1)
    }

    /// The share of flux that a shading point with this mask sees, in [0, 1]: the sum of the shares of
    /// the bits of the mask, at most 1. Instances with several of them count several times. A mask of
    /// all bits sees all. Above 0 if the union has a bit of the mask.
    pub fn seen(self, mask: u32) -> f32 {
        if mask == u32::MAX {
            return 1.0;
        }
        let sum: u32 = bits_of(self.union() & mask).map(|bit| share(self.code(bit))).sum();
        sum.min(WHOLE) as f32 / WHOLE as f32
    }
}

/// The numbers of the bits that are set.
fn bits_of(mask: u32) -> impl Iterator<Item = u32> {
    (0..u32::BITS).filter(move |bit| mask >> bit & 1 != 0)
}

/// The share that a code stands for.
fn share(code: u32) -> u32 {
    (1 << code) >> 1
}

/// The code of the share `sum / total`, where `sum` has the unit of shares.
fn nearest_code(sum: u32, total: u32) -> u32 {
    let reaches = |code: &u32| 256 * sum >= ROUNDED * share(*code) * total;
    if sum == 0 { 0 } else { (2..=MAX_CODE).rev().find(reaches).unwrap_or(1) }
}

/// Whole numbers below 4096 in proportion to the fluxes, at least 1 for a child that is not dark.
fn weights(flux: &[u16; WIDTH]) -> [u32; WIDTH] {
    let exponent = |flux: u16| u32::from(flux >> 7);
    let greatest = flux.iter().fold(0, |greatest, flux| exponent(*flux).max(greatest));
    flux.map(|flux| {
        let mantissa = (128 | u32::from(flux & 127)) << 4;
        if flux == 0 { 0 } else { (mantissa >> (greatest - exponent(flux)).min(12)).max(1) }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The flux as nodes store it.
    fn packed(flux: f32) -> u16 {
        (flux.to_bits() >> 16) as u16
    }

    /// The shares of a node whose first children are parts with these masks and fluxes.
    fn node_of(parts: &[(u32, f32)]) -> MaskShares {
        let (mut children, mut flux) = ([MaskShares::default(); WIDTH], [0; WIDTH]);
        for (slot, (mask, lumens)) in parts.iter().enumerate() {
            (children[slot], flux[slot]) = (MaskShares::of_part(*mask), packed(*lumens));
        }
        MaskShares::merged(&children, &flux)
    }

    #[test]
    fn a_mask_sees_the_share_of_the_flux_that_has_its_bits() {
        let eight: [(u32, f32); WIDTH] = std::array::from_fn(|slot| (1 << slot, 300.0));
        let shares = node_of(&eight);
        assert_eq!(shares.union(), 0xff);
        for (mask, expected) in [
            (0b1, 0.125),
            (0b1000_0000, 0.125),
            (0b11, 0.25),
            (0b1011, 0.375),
            (0xff, 1.0),
            (0x101, 0.125),
            (0x100, 0.0),
            (0, 0.0),
            (u32::MAX, 1.0),
        ] {
            assert_eq!(shares.seen(mask), expected, "{mask:b}");
        }
        // Two bits of one instance count twice, and no more than all.
        let shared = node_of(&[(0b11, 1.0), (0b11, 1.0), (0b100, 2.0)]);
        assert_eq!([0b1, 0b10, 0b11, 0b111].map(|mask| shared.seen(mask)), [0.5, 0.5, 1.0, 1.0]);
        let part = MaskShares::of_part(0b101);
        assert_eq!([0b1, 0b10, 0b100, 0b111].map(|mask| part.seen(mask)), [1.0, 0.0, 1.0, 1.0]);
    }

    #[test]
    fn the_least_share_counts_as_one_of_64_and_never_as_none() {
        for dim in [1.0e-3, 1.0e-12, 1.0e-30] {
            let shares = node_of(&[(0b1, 1.0e6), (0b10, 1.0e6 * dim)]);
            assert_eq!([0b1, 0b10].map(|mask| shares.seen(mask)), [1.0, 1.0 / 64.0], "{dim}");
        }
        // One of 8 in each of many nested nodes.
        let mut shares = MaskShares::of_part(0b10);
        for depth in 1..20 {
            let mut children = [MaskShares::of_part(0b1); WIDTH];
            children[3] = shares;
            shares = MaskShares::merged(&children, &[packed(5.0); WIDTH]);
            let expected = f32::max(0.125_f32.powi(depth), 1.0 / 64.0);
            assert_eq!((shares.union(), shares.seen(0b10)), (0b11, expected), "{depth}");
        }
    }

    #[test]
    fn shares_are_the_nearest_powers_of_two() {
        let mut rng = crate::tree::testing::Rng(7);
        for _ in 0..2000 {
            let parts: [(u32, f32); WIDTH] = std::array::from_fn(|_| (rng.0 as u32, 10.0_f32.powf(4.0 * rng.unit())));
            let parts = parts.map(|(mask, flux)| (mask, f32::from_bits(u32::from(packed(flux)) << 16)));
            let shares = node_of(&parts);
            let total: f32 = parts.iter().map(|(_, flux)| flux).sum();
            for bit in 0..u32::BITS {
                let has_bit = parts.iter().filter(|(mask, _)| mask >> bit & 1 != 0);
                let exact = has_bit.map(|(_, flux)| flux).sum::<f32>() / total;
                let seen = shares.seen(1 << bit);
                assert_eq!(seen > 0.0, exact > 0.0);
                // Half a step, and weights that are cut to whole numbers, of which the least are about 32.
                let steps = (seen / exact.max(1.0 / 64.0)).log2().abs();
                assert!(exact == 0.0 || steps < 0.5 + 0.3, "{seen} for {exact}");
            }
        }
    }

    #[test]
    fn children_with_the_same_codes_make_a_node_with_these_codes() {
        for code in 0..=MAX_CODE {
            let words = std::array::from_fn(|j| if code >> j & 1 != 0 { 1 << 9 } else { 0 });
            let children = [MaskShares(words); WIDTH];
            assert_eq!(
                MaskShares::merged(&children, &std::array::from_fn(|slot| packed(1.5 + slot as f32))),
                children[0]
            );
            assert_eq!(children[0].code(9), code);
        }
    }
}
