//! The records that the host uploads. `shaders/types.wgsl` has their twins; a test compares them.
//!
//! Nodes have a file of their own: `plan/node_record.rs`.

use std::mem::offset_of;

use bytemuck::{Pod, Zeroable};
use glam::{Mat3, Quat, Vec3};

use super::node_record::NodeRecord;
use crate::cluster::Cluster;
use crate::instance::appearance::Appearance;
use crate::instance::placement::Placed;
use crate::instance::sector;
use crate::light::{DirectionalLight, Light, Shape, UNLIMITED_RANGE, spot_falloff, spot_lobe};
use crate::sampling::view::NO_INSTANCE;
use crate::sky::StoredPatch;
use crate::top::masks::NodeMasks;
use crate::tree::{LightTree, Opening};
use crate::world::BIRTH_BITS;

/// The quads, of 16 bytes each, of a node, a light and an instance, and the quad of a record at which a part of it
/// begins. Shaders read quads.
pub(crate) const NODE_QUADS: u32 = quads(size_of::<NodeRecord>());
pub(crate) const NODE_CHILDREN: u32 = quads(offset_of!(NodeRecord, children));
pub(crate) const NODE_TAIL: u32 = quads(offset_of!(NodeRecord, parent));
pub(crate) const NODE_LOBES: u32 = quads(offset_of!(NodeRecord, lobes));
pub(crate) const RECORD_QUADS: u32 = quads(size_of::<LightRecord>());
pub(crate) const INSTANCE_QUADS: u32 = quads(size_of::<InstanceRecord>());
pub(crate) const INSTANCE_TREE: u32 = quads(offset_of!(InstanceRecord, flags));
pub(crate) const INSTANCE_PART: u32 = quads(offset_of!(InstanceRecord, first_part));
pub(crate) const INSTANCE_LOCAL: u32 = quads(offset_of!(InstanceRecord, to_local));
pub(crate) const INSTANCE_FACTOR: u32 = quads(offset_of!(InstanceRecord, factor));
pub(crate) const INSTANCE_SECTOR: u32 = quads(offset_of!(InstanceRecord, sector));
/// The quads of the masks of a node of the top level: the shares of the node, then two for the children.
pub(crate) const MASK_QUADS: u32 = quads(size_of::<NodeMasks>());

const fn quads(bytes: usize) -> u32 {
    assert!(bytes.is_multiple_of(16), "parts of records start at multiples of 16 bytes");
    (bytes / 16) as u32
}

/// The bits of [`LightRecord::kind`] that hold the kind.
pub(crate) const KIND_MASK: u32 = 0xff;
/// A point light. `a` is its position.
pub(crate) const KIND_POINT: u32 = 0;
/// A spot light. `a` is its position, `b` its direction, `c.x` and `c.y` are scale and offset of
/// its falloff, and `c.z` is its flux for one candela.
pub(crate) const KIND_SPOT: u32 = 1;
/// A parallelogram. `a` is its centre, `b` and `c` are its half edges.
pub(crate) const KIND_RECTANGLE: u32 = 2;
/// A triangle. `a`, `b` and `c` are its vertices.
pub(crate) const KIND_TRIANGLE: u32 = 3;
/// A sphere. `a` is its centre, `c.x` its radius.
pub(crate) const KIND_SPHERE: u32 = 4;
/// A directional light. `b` is the direction in which its light travels.
pub(crate) const KIND_DIRECTIONAL: u32 = 5;
/// A patch of the sky. `a.x` is its light in lux; `emission` holds the place of its square of texels and one more
/// than its level.
pub(crate) const KIND_SKY: u32 = 6;
/// `a` is the position, `b` the pole of the grid and `c` where angle 0 around it is.
pub(crate) const KIND_PROFILE: u32 = 7;
/// The bit of [`LightRecord::kind`] for a surface that also emits from its back.
pub(crate) const TWO_SIDED: u32 = 0x100;

/// The bit of [`InstanceRecord::flags`] for a slot with an instance.
pub(crate) const LIVE: u32 = 1;
/// The bit of [`InstanceRecord::flags`] for a placement that is scaled, sheared or mirrored.
pub(crate) const NON_RIGID: u32 = 2;
/// The bit of [`InstanceRecord::flags`] for an instance of whose tree the GPU holds stand-ins.
pub(crate) const STANDS_IN: u32 = 16;

/// The index of the first stand-in of a tree. Lights of trees that are whole have smaller indices.
pub(crate) const STAND_IN: u32 = 1 << 30;

/// This bit is set in the place above an opening of a tree, where the other bits are the number of the
/// opening. Places have smaller bits: a buffer of 4 GiB has room for 2^29 places.
pub(crate) const OPENING: u32 = 1 << 31;

/// Where the birth numbers begin in [`InstanceRecord::flags`] and [`LightRecord::kind`].
pub(crate) const BIRTH_SHIFT: u32 = u32::BITS - BIRTH_BITS;

/// The instance slot that samples of directional lights report.
pub(crate) const DIRECTIONAL: u32 = u32::MAX;

/// One light; `LightRecord` in WGSL. 64 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct LightRecord {
    pub a: [f32; 3],
    pub kind: u32,
    pub emission: [f32; 3],
    pub place: u32,
    pub b: [f32; 3],
    pub range: f32,
    pub c: [f32; 3],
    /// Where the table of its profile ends, in quads before the map of the sky; the mean cosine of a spot.
    pub profile: u32,
}

/// One instance slot; `LightInstance` in WGSL. 160 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct InstanceRecord {
    /// The rows of the matrix; the fourth column is the translation, relative to the centre of the
    /// sector.
    pub to_world: [[f32; 4]; 3],
    /// Bits, and from [`BIRTH_SHIFT`] on the birth number of the instance.
    pub flags: u32,
    /// The tree's first record in the tree pool.
    pub tree: u32,
    /// The tree's first node in the node pool.
    pub node_base: u32,
    /// The tree's first light in the light pool.
    pub light_base: u32,
    /// The first of the instance's parts.
    pub first_part: u32,
    /// Cosine and sine of [`Linear::turn`](crate::cluster::Linear::turn).
    pub cos_turn: f32,
    pub sin_turn: f32,
    /// The engine's own 32 bits.
    pub user_data: u32,
    /// The rows of the inverse; the fourth column is the determinant, the greatest inverse
    /// scale and the mean squared scale of `to_world`.
    pub to_local: [[f32; 4]; 3],
    /// What the emission of the lights is multiplied by.
    pub factor: [f32; 3],
    /// Which shading points the lights reach.
    pub mask: u32,
    /// The sector that the instance lies in; 0 in a world without sectors.
    pub sector: [i32; 3],
    pub padding: u32,
}

/// A cluster at full precision; `LightCluster` in WGSL. 64 bytes. Of a cluster without flux all
/// fields but the mean are 0.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct ClusterRecord {
    pub mean: [f32; 3],
    pub flux: f32,
    pub box_min: [f32; 3],
    pub variance: f32,
    pub box_max: [f32; 3],
    pub range: f32,
    pub axis: [f32; 3],
    pub cos_half_angle: f32,
}

/// What the top-level build reads of one part of a tree: the whole tree, or one opening of it. `LightTree`
/// in WGSL; 80 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct TreeRecord {
    /// Its flux is 0 if all lights are dark.
    pub cluster: ClusterRecord,
    pub punctual_flux: f32,
    pub area_flux: f32,
    /// Where a walk goes on: 0 for the root, or as in [`Node::children`](crate::tree::Node).
    pub child_bits: u32,
    /// The place of an opening in the tree.
    pub place: u32,
}

/// A part of an instance, as the top-level build reads it; 8 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct PartRecord {
    /// The slot of the instance; [`NO_INSTANCE`] for a part that is not in use.
    pub slot: u32,
    /// The index among the parts of the instance.
    pub index: u32,
}

/// A part of an instance, as the top-level build writes it; `LightPart` in WGSL. 16 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct LeafRecord {
    /// The slot of the instance.
    pub slot: u32,
    /// As in [`TreeRecord`].
    pub child_bits: u32,
    /// The place of the part's leaf in the top level; [`NO_PARENT`](crate::tree::NO_PARENT) for a
    /// dark part.
    pub place: u32,
    /// The mask of the instance; not set unless masks are stored.
    pub mask: u32,
}

impl PartRecord {
    /// A part that is not in use.
    pub const NONE: Self = Self { slot: NO_INSTANCE, index: 0 };
}

/// The uniform that sampling reads; `LightParams` in WGSL. 48 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct ParamsRecord {
    pub slots: u32,
    pub directional_base: u32,
    pub directional_count: u32,
    /// The slot of the sky's instance; [`NO_INSTANCE`] if there is none to be seen.
    pub sky: u32,
    /// 1 if large and near surfaces are sampled by solid angle.
    pub solid_angles: u32,
    /// The offset of the parts in the buffer of the top level, in units of 16 bytes.
    pub parts: u32,
    /// The offset of the sky's map in the same buffer.
    pub sky_map: u32,
    /// The offset of the masks in the same buffer; 0 if they are not stored.
    pub masks: u32,
    /// The sector whose centre the origin is.
    pub home: [i32; 3],
    pub padding: u32,
}

impl LightRecord {
    /// A point light without emission, with the values of every point light without a range.
    pub const DARK: Self = Self {
        a: [0.0; 3],
        kind: KIND_POINT,
        emission: [0.0; 3],
        place: 0,
        b: [0.0; 3],
        range: UNLIMITED_RANGE,
        c: [0.0; 3],
        profile: 0,
    };

    /// The record of a light in a tree; `place` is the place of its leaf.
    pub fn of(light: &Light, place: u32) -> Self {
        let (kind, a, b, c) = match light.shape {
            Shape::Point { position } => (KIND_POINT, position, Vec3::ZERO, Vec3::ZERO),
            Shape::Spot { position, direction, inner_angle, outer_angle } => {
                let (scale, offset) = spot_falloff(inner_angle, outer_angle);
                (
                    KIND_SPOT,
                    position,
                    direction,
                    Vec3::new(scale, offset, spot_lobe(inner_angle, outer_angle).solid_angle),
                )
            }
            Shape::Profile { position, rotation, profile } => {
                let axes = profile.axes(Quat::from_array(rotation));
                (KIND_PROFILE, position, axes.z_axis, axes.x_axis)
            }
            Shape::Rectangle { center, half_u, half_v, two_sided } => {
                (KIND_RECTANGLE | two_sided_bit(two_sided), center, half_u, half_v)
            }
            Shape::Triangle { vertices: [a, b, c], two_sided } => (KIND_TRIANGLE | two_sided_bit(two_sided), a, b, c),
            Shape::Sphere { center, radius } => (KIND_SPHERE, center, Vec3::ZERO, Vec3::new(radius, 0.0, 0.0)),
        };
        let profile = match light.shape {
            Shape::Profile { profile, .. } => profile.stored_end(),
            Shape::Spot { inner_angle, outer_angle, .. } => spot_lobe(inner_angle, outer_angle).mean_cosine.to_bits(),
            _ => 0,
        };
        Self {
            a: a.to_array(),
            kind,
            b: b.to_array(),
            // A removed light is a dark point like others.
            range: if light.is_removed() { UNLIMITED_RANGE } else { light.range.min(UNLIMITED_RANGE) },
            c: c.to_array(),
            place,
            // Shaders do not see the light's flux, so a light without flux must have no emission.
            emission: if light.flux() > 0.0 { light.emission.to_array() } else { [0.0; 3] },
            profile,
        }
    }

    /// The same record with a birth number.
    pub fn with_birth(self, birth: u32) -> Self {
        Self { kind: self.kind | birth << BIRTH_SHIFT, ..self }
    }

    /// The record of a patch of the sky, whose leaf is at `place`.
    pub fn patch(patch: StoredPatch, place: u32) -> Self {
        let StoredPatch { lux, at: [x, y], level } = patch;
        Self {
            a: [lux, 0.0, 0.0],
            kind: KIND_SKY,
            // Exact in f32.
            emission: [x, y, level + 1].map(|number| number as f32),
            place,
            ..Self::DARK
        }
    }

    /// The record of a directional light.
    pub fn directional(light: &DirectionalLight) -> Self {
        Self {
            kind: KIND_DIRECTIONAL,
            b: light.direction.normalize().to_array(),
            emission: light.illuminance.to_array(),
            ..Self::DARK
        }
    }
}

fn two_sided_bit(two_sided: bool) -> u32 {
    if two_sided { TWO_SIDED } else { 0 }
}

/// Where the records of an instance and its tree start in their pools.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Bases {
    pub tree: u32,
    pub node: u32,
    pub light: u32,
    pub part: u32,
    /// The nodes and lights are stand-ins.
    pub stands_in: bool,
}

impl InstanceRecord {
    /// A slot without an instance.
    pub const NONE: Self = Self {
        to_world: [[0.0; 4]; 3],
        flags: 0,
        tree: 0,
        node_base: 0,
        light_base: 0,
        first_part: 0,
        cos_turn: 0.0,
        sin_turn: 0.0,
        user_data: 0,
        to_local: [[0.0, 0.0, 0.0, 1.0]; 3],
        factor: [1.0; 3],
        mask: u32::MAX,
        sector: [0; 3],
        padding: 0,
    };

    /// The same record with a birth number.
    pub fn with_birth(self, birth: u32) -> Self {
        Self { flags: self.flags | birth << BIRTH_SHIFT, ..self }
    }

    /// The record of an instance with this placement and appearance, whose tree and parts start at
    /// `bases` in the pools. The inverse of a rigid placement is the exact transpose without scale.
    pub fn of(placed: &Placed, appearance: &Appearance, bases: Bases) -> Self {
        let to_world = &placed.linear.linear;
        let scales = Vec3::new(placed.determinant, placed.inverse_scale(), placed.linear.mean_square_scale);
        Self {
            to_world: rows(to_world, placed.place.rest),
            flags: LIVE | if placed.is_rigid { 0 } else { NON_RIGID } | if bases.stands_in { STANDS_IN } else { 0 },
            tree: bases.tree,
            node_base: bases.node,
            light_base: bases.light,
            first_part: bases.part,
            cos_turn: placed.linear.turn.x,
            sin_turn: placed.linear.turn.y,
            to_local: if placed.is_rigid {
                rows(&to_world.transpose(), Vec3::ONE)
            } else {
                rows(&placed.to_local, scales)
            },
            user_data: appearance.user_data,
            factor: appearance.factor.to_array(),
            mask: appearance.mask,
            sector: sector::number(placed.place.center),
            padding: 0,
        }
    }
}

/// The place of a child of a tree's node, as shaders climb from it: the number of an opening with the
/// bit [`OPENING`], or the place itself.
pub(crate) fn stored_place(place: u32, openings: &[Opening]) -> u32 {
    openings.binary_search_by_key(&place, |opening| opening.place).map_or(place, |index| OPENING | index as u32)
}

fn rows(m: &Mat3, last: Vec3) -> [[f32; 4]; 3] {
    std::array::from_fn(|i| m.row(i).extend(last[i]).to_array())
}

impl ClusterRecord {
    /// The record of a cluster. Infinite ranges become [`UNLIMITED_RANGE`] and empty boxes become
    /// zeros: WGSL implementations may assume that infinities do not occur.
    pub fn of(cluster: &Cluster) -> Self {
        if cluster.flux <= 0.0 {
            return Self { mean: cluster.mean.to_array(), ..Self::default() };
        }
        Self {
            mean: cluster.mean.to_array(),
            flux: cluster.flux,
            box_min: cluster.aabb.min.to_array(),
            variance: cluster.variance,
            box_max: cluster.aabb.max.to_array(),
            range: cluster.range.min(UNLIMITED_RANGE),
            axis: cluster.axis.to_array(),
            cos_half_angle: cluster.cos_half_angle,
        }
    }
}

impl TreeRecord {
    /// The number of records of a tree with so many openings: one for each part.
    pub fn count(openings: usize) -> u32 {
        openings.max(1) as u32
    }

    /// The record of a part of a tree with these openings.
    pub fn of(tree: &LightTree, openings: &[Opening], index: u32) -> Self {
        match openings.get(index as usize) {
            None => Self::of_cluster(&tree.cluster(), 0),
            Some(opening) => {
                Self { place: opening.place, ..Self::of_cluster(&tree.opening_cluster(opening), opening.child_bits) }
            }
        }
    }

    fn of_cluster(cluster: &Cluster, child_bits: u32) -> Self {
        Self {
            cluster: ClusterRecord::of(cluster),
            punctual_flux: cluster.punctual_flux,
            area_flux: cluster.area_flux,
            child_bits,
            place: 0,
        }
    }
}

#[cfg(all(test, feature = "gpu"))]
mod tests {
    use std::collections::HashMap;
    use std::mem::offset_of;

    use naga::TypeInner;
    use testbed::common::batch::{STAGE, SampleRecord, SampleRequest};

    use super::*;
    use crate::plan::node_record::NodeRecord;
    use crate::plan::text;

    /// The size of each struct of a WGSL text, and the offset of each of its members.
    fn structs(text: &str) -> HashMap<String, (u32, Vec<(String, u32)>)> {
        let module = naga::front::wgsl::parse_str(text).expect("the text is WGSL");
        let of = |(_, t): (_, &naga::Type)| match &t.inner {
            TypeInner::Struct { members, span } => {
                let members = members.iter().map(|m| (m.name.clone().unwrap_or_default(), m.offset)).collect();
                Some((t.name.clone()?, (*span, members)))
            }
            _ => None,
        };
        module.types.iter().filter_map(of).collect()
    }

    macro_rules! record {
        ($structs:ident, $rust:ty, $wgsl:literal, [$($field:ident $(. $inner:ident)? $(as $other:literal)?),*]) => {{
            let (size, members) = &$structs[$wgsl];
            assert_eq!(*size as usize, size_of::<$rust>(), "size of {}", $wgsl);
            let ours = [$((record!(@name $field $($other)?), offset_of!($rust, $field $(.$inner)?))),*];
            // Only padding may follow the last member that is named here.
            assert!(members[ours.len()..].iter().all(|(name, _)| name.starts_with("padding")), "{}", $wgsl);
            let theirs: Vec<_> = members[..ours.len()].iter().map(|(n, o)| (n.as_str(), *o as usize)).collect();
            assert_eq!(theirs, ours, "{}", $wgsl);
        }};
        (@name $field:ident $other:literal) => { $other };
        (@name $field:ident) => { stringify!($field) };
    }

    #[test]
    fn records_have_the_same_layout_in_rust_and_wgsl() {
        let samples = text::wgsl(0, crate::effects::Effects::all());
        let text = samples + STAGE;
        let structs = structs(&text);
        record!(
            structs,
            NodeRecord,
            "LightNode",
            [origin as "head", children, parent as "tail", lobes]
        );
        record!(
            structs,
            ClusterRecord,
            "LightCluster",
            [mean, flux, box_min, variance, box_max, range, axis, cos_half_angle]
        );
        record!(structs, LightRecord, "LightRecord", [a, kind, emission, place, b, range, c, profile]);
        record!(
            structs,
            InstanceRecord,
            "LightInstance",
            [
                to_world, flags, tree, node_base, light_base, first_part, cos_turn, sin_turn, user_data, to_local,
                factor, mask, sector
            ]
        );
        record!(structs, TreeRecord, "LightTree", [cluster, punctual_flux, area_flux, child_bits, place]);
        record!(structs, LeafRecord, "LightPart", [slot, child_bits, place, mask]);
        record!(structs, SampleRequest, "Request", [position, padding, normal, padding_after_normal, u]);
        record!(structs, SampleRecord, "LightSample", [direction, dist, radiance, pdf, pmf, instance, light, is_delta]);
        assert_eq!(structs["LightReservoir"].0, 28);
        record!(
            structs,
            ParamsRecord,
            "LightParams",
            [slots, directional_base, directional_count, sky, solid_angles, parts, sky_map, masks, home]
        );
    }
}
