//! The buffers of the top level whose sizes follow the number of parts.

use super::super::buffers::{BufferId, Ids, NewBuffer};
use super::super::error::PlanError;
use super::super::layout::{ClusterRecord, LeafRecord, Strides};
use super::super::node_record::NodeRecord;
use super::super::sort::SortBuffers;
use super::passes::{Passes, Places};
use crate::effects::Effects;
use crate::top::masks::NodeMasks;
use crate::tree::space_order::{LEVEL_SAMPLES, LEVELS, PLANE_BITS};

/// The bytes of the masks of one node.
const MASK_BYTES: u64 = size_of::<NodeMasks>() as u64;

/// What each build clears: the extremes of all means, the number of parts that are not dark, one unused
/// word, and the numbers of parts of each level.
pub(super) const BOUNDS_BYTES: u64 = 4 * (8 + LEVELS as u64);

/// The word after them, where the corners of a box begin.
pub(super) const BOX_AT: u32 = BOUNDS_BYTES as u32 / 4;

/// The word after the box, where the lens begins.
pub(super) const LENS_AT: u32 = BOX_AT + 6;

/// The word after the lens, where an axis and a place for each plane begin.
pub(super) const PLANES_AT: u32 = LENS_AT + 4;

/// The word after the planes, where the lists of parts of each level begin.
pub(super) const LISTS_AT: u32 = PLANES_AT + (2 << PLANE_BITS);

/// All words about the order in space.
pub(super) const SPACE_WORDS: u32 = LISTS_AT + LEVELS * LEVEL_SAMPLES as u32;

/// How many quads of maps there are beside the top level in its buffer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct MapQuads {
    /// Of the portals.
    pub portals: u32,
    /// Of the tables of profiles.
    pub profiles: u32,
    /// Of the map of the sky.
    pub sky: u32,
}

impl MapQuads {
    /// Whether there is room in these for others.
    pub(super) fn hold(self, other: Self) -> bool {
        self.portals >= other.portals && self.profiles >= other.profiles && self.sky >= other.sky
    }
}

#[derive(Clone, Debug)]
pub(super) struct TopBuffers {
    /// The number of parts that there is room for.
    pub capacity: u32,
    pub places: Places,
    pub bounds: BufferId,
    /// The nodes, portals, the parts, the masks of the nodes if they are stored, profiles, and the map of the sky.
    pub nodes: BufferId,
    pub nodes_bytes: u64,
    /// How many quads of portals, of profiles and of the sky's map there is room for.
    pub map_quads: MapQuads,
    /// The clusters of all parts, then of all nodes.
    pub clusters: BufferId,
    /// The lists of units that the passes leave.
    pub units: BufferId,
    pub sort: SortBuffers,
}

impl TopBuffers {
    /// Room for `capacity` parts, for masks if `has_masks`, and for portals, profiles and the sky's map. Adds the
    /// buffers to `new`. Fails with [`PlanError::Full`] if a buffer would be larger than `limit`.
    pub(super) fn new(
        ids: &mut Ids,
        new: &mut Vec<NewBuffer>,
        capacity: u32,
        (has_masks, map_quads): (bool, MapQuads),
        limit: u64,
    ) -> Result<Self, PlanError> {
        let sizes = Sizes::of(capacity, (has_masks, map_quads));
        sizes.check(limit)?;
        let sort = SortBuffers::new(ids, new, capacity, limit)?;
        let mut add = |what, bytes| {
            let buffer = ids.storage(what, bytes);
            new.push(buffer);
            buffer.id
        };
        Ok(Self {
            capacity,
            // Within the limit of the buffer.
            places: Places {
                parts: (sizes.parts / 16) as u32,
                masks: if has_masks { (sizes.masks / 16) as u32 } else { 0 },
                sky_map: (sizes.sky_map / 16) as u32,
            },
            map_quads,
            sort,
            bounds: add("top level bounds", u64::from(SPACE_WORDS) * 4),
            nodes: add("top level nodes", sizes.nodes),
            nodes_bytes: sizes.nodes,
            clusters: add("top level clusters", sizes.clusters),
            units: add("top level units", sizes.units),
        })
    }

    /// All buffers.
    pub(super) fn ids(&self) -> impl Iterator<Item = BufferId> {
        [self.bounds, self.nodes, self.clusters, self.units].into_iter().chain(self.sort.ids())
    }
}

/// The bytes of the buffers for a number of parts, and where the ranges of the buffer of the nodes begin.
struct Sizes {
    parts: u64,
    masks: u64,
    sky_map: u64,
    nodes: u64,
    clusters: u64,
    units: u64,
}

impl Sizes {
    fn of(capacity: u32, (has_masks, map_quads): (bool, MapQuads)) -> Self {
        let passes = Passes::new(capacity, capacity, Places::default(), Strides::of(Effects::all()));
        let nodes = u64::from(passes.nodes) * size_of::<NodeRecord>() as u64;
        let parts = nodes + 16 * u64::from(map_quads.portals);
        let masks = parts + u64::from(capacity) * size_of::<LeafRecord>() as u64;
        let profiles = masks + if has_masks { u64::from(passes.nodes) * MASK_BYTES } else { 0 };
        let sky_map = profiles + 16 * u64::from(map_quads.profiles);
        Self {
            parts,
            masks,
            sky_map,
            nodes: sky_map + 16 * u64::from(map_quads.sky),
            clusters: (u64::from(capacity) + u64::from(passes.nodes)) * size_of::<ClusterRecord>() as u64,
            units: u64::from(passes.words) * 4,
        }
    }

    /// Fails if a buffer would be larger than `limit`. The others are smaller than these two.
    fn check(&self, limit: u64) -> Result<(), PlanError> {
        for (what, needed) in [("top-level clusters", self.clusters), ("top-level nodes", self.nodes)] {
            if needed > limit {
                return Err(PlanError::Full { what, needed, limit });
            }
        }
        Ok(())
    }
}

/// The greatest number of parts for which all buffers stay within `limit`; 0 if none do.
pub(super) fn most_parts(maps: (bool, MapQuads), limit: u64) -> u32 {
    let fits = |parts| Sizes::of(parts, maps).check(limit).is_ok() && SortBuffers::fit(parts, limit).is_ok();
    let (mut most, mut too_many) = (0, u32::MAX);
    while too_many - most > 1 {
        let middle = most.midpoint(too_many);
        if fits(middle) { most = middle } else { too_many = middle }
    }
    most
}
