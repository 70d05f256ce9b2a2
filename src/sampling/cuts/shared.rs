//! A cut that belongs to a cell.

use glam::Vec3;

use crate::tree::WIDTH;

/// The nodes whose children are the candidates of a shared cut, at most: the root and one node for each
/// split.
pub(crate) const SHARED_NODES: usize = 32;

/// Probabilities of candidates are integers in units of at least 2^-24, so they add up exactly.
pub(crate) const UNITS: u32 = 1 << 24;

/// The least part of a cell's samples that goes to the trees, and to directional lights if there are any.
/// Neither then depends on what the cell's points see.
pub(crate) const MIN_SIDE: f32 = 0.01;

/// The contested nodes of a cut, at most.
pub(crate) const CONTESTED: usize = 4;

/// A node about whose children the points of a cell disagree. Each point weighs them itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Contested {
    /// Counted in the order in which nodes were split.
    pub node: u8,
    /// Bits of the children that are candidates; 0 where there is no contested node.
    pub children: u8,
}

/// A node of a world: the slot of an instance, or [`NO_INSTANCE`](crate::sampling::view::NO_INSTANCE) for the top
/// level, and the index of the
/// node in its tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct NodeId {
    pub instance: u32,
    pub node: u32,
}

/// How the sky is turned and how bright its instance is: where a vector along no axis is, and half octaves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct SkyState {
    pub turn: Vec3,
    pub brightness: u8,
}

/// The candidates of a cell.
#[derive(Clone, Debug, Default)]
pub(crate) struct SharedCut {
    /// The number of nodes; 0 if the cell has no cut.
    pub count: usize,
    /// The number of points that it was made for.
    pub points: usize,
    /// In the order in which they were split.
    pub nodes: [NodeId; SHARED_NODES],
    /// For each node the child, counted through all nodes, that it was, or [`SKY_ROOT`](super::keep::SKY_ROOT). 0 for
    /// the root.
    pub from: [u8; SHARED_NODES],
    /// The sum of the names of all nodes.
    pub name: u32,
    /// The fluxes of all children of all nodes, as [`flux_step`](super::keep::flux_step).
    pub flux: [[u8; WIDTH]; SHARED_NODES],
    /// How many builds the cell has had a cut for.
    pub age: u32,
    /// The sky that it was made for.
    pub sky: SkyState,
    /// The direction from a glossy cell to the eye; 0 for a matte one.
    pub toward: Vec3,
    pub contested: [Contested; CONTESTED],
    /// What all other candidates bring to a point, in lux; 1 if no node is contested.
    pub rest: f32,
    /// The running sums of the units of all children of all nodes. A child without flux has none, nor has
    /// one that was split or is contested.
    pub sums: [[u32; WIDTH]; SHARED_NODES],
    /// The illuminance by directional lights over that by the trees, by which a sample chooses between
    /// the two. 0 if there are no directional lights.
    pub directional: f32,
}

impl SharedCut {
    /// The contested nodes.
    pub fn contested(&self) -> impl Iterator<Item = &Contested> {
        self.contested.iter().take_while(|contested| contested.children != 0)
    }

    /// Whether each point weighs a child itself.
    pub fn is_contested(&self, node: usize, slot: usize) -> bool {
        self.contested.iter().any(|other| other.has(node, slot))
    }

    /// The running sums in one piece.
    pub fn sums(&self) -> &[u32] {
        self.sums[..self.count].as_flattened()
    }

    /// The sum of all units.
    pub fn total(&self) -> u32 {
        self.sums().last().copied().unwrap_or(0)
    }

    /// Where the units of a child begin, and how many there are.
    pub fn units(&self, child: usize) -> [u32; 2] {
        let sums = self.sums();
        let before = if child > 0 { sums[child - 1] } else { 0 };
        [before, sums[child] - before]
    }
}
