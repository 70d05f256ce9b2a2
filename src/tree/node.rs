//! The wide node that is sampled: eight children, each a packed cluster and where it leads.
//!
//! The same bytes are walked on the CPU and, uploaded as they are, by `shaders/node.wgsl`; only these two files know
//! how a cluster is packed. A test in `gpu/layout.rs` compares the records.

use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3};

use crate::bounds::Aabb;
use crate::cluster::Cluster;
use crate::cone::Cone;

/// Children of a node. Eight are picked from in one pass; design measurements in `docs/decisions.md`.
pub const WIDTH: usize = 8;

/// Set in [`Child::target`] when the child is one light (or, in a top level, one instance).
pub const LEAF: u32 = 1 << 31;

/// The most lights of a tree: what 31 bits can name beside the leaf bit.
pub const MAX_LIGHTS: usize = (LEAF - 1) as usize;

/// [`Child::target`] of an unused slot.
pub const EMPTY_SLOT: u32 = u32::MAX;

/// [`Node::parent`] of the root.
pub const NO_PARENT: u32 = u32::MAX;

/// Stands for no range, in metres: shaders may not rely on infinity. Its square fits into f32 and is farther than any
/// two places of a world.
pub(crate) const FARTHEST: f32 = 1.0e18;

/// Half-angle added to a packed cone, in radians. An axis of two 16-bit octahedral coordinates is off by up to 7e-5;
/// the rest covers rounding in the decoded axis.
pub(crate) const CONE_PADDING: f32 = 1.0e-4;

/// Taken off a cosine before it is rounded down, in steps of 1/32767: f32 rounds the cosine of a small angle up to 1,
/// by up to 0.002 steps.
pub(crate) const COSINE_ROUNDING: f32 = 0.01;

/// Steps of a signed 16-bit fraction.
pub(crate) const SNORM: f32 = 32767.0;
/// Steps of an unsigned 16-bit fraction.
pub(crate) const UNORM: f32 = 65535.0;

/// One child of a node: a cluster in 60 bytes and where it leads. 64 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Child {
    /// Flux-weighted mean position.
    pub mean: [f32; 3],
    /// Lumens; 0 means that nothing below shines.
    pub flux: f32,
    /// Least corner of the box.
    pub box_min: [f32; 3],
    /// Trace of the covariance of position.
    pub variance: f32,
    /// Greatest corner of the box.
    pub box_max: [f32; 3],
    /// Largest range in metres.
    pub range: f32,
    /// Mean direction of emission, octahedral, 2 x 16-bit signed.
    pub lobe_axis: u32,
    /// Axis of the cone of emission, octahedral, 2 x 16-bit signed.
    pub cone_axis: u32,
    /// Low half: length of the mean direction, 16-bit unsigned. High half: cosine of the cone's half-angle, 16-bit
    /// signed, rounded down so that the cone only grows.
    pub angles: u32,
    /// A node's index; or [`LEAF`] with a light's index; or [`EMPTY_SLOT`].
    pub target: u32,
}

/// A node: 8 children and the way up. 528 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Node {
    /// The first `count` are in use.
    pub children: [Child; WIDTH],
    /// `parent node * WIDTH + slot`, or [`NO_PARENT`].
    pub parent: u32,
    /// Children in use.
    pub count: u32,
    /// To a multiple of 16 bytes.
    pub padding: [u32; 2],
}

/// Where a child leads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// To a node.
    Node(u32),
    /// To a light, or to an instance in a top level.
    Leaf(u32),
}

impl Child {
    /// A slot that is never picked.
    pub const EMPTY: Self = Self {
        mean: [0.0; 3],
        flux: 0.0,
        box_min: [0.0; 3],
        variance: 0.0,
        box_max: [0.0; 3],
        range: 0.0,
        lobe_axis: 0,
        cone_axis: 0,
        angles: 0,
        target: EMPTY_SLOT,
    };

    /// Packs a cluster; boxes stay exact, the cone only grows.
    pub fn pack(cluster: &Cluster, target: u32) -> Self {
        if cluster.flux <= 0.0 {
            return Self { mean: cluster.mean.to_array(), target, ..Self::EMPTY };
        }
        let length = cluster.axis.length().min(1.0);
        let lobe = if length > 0.0 { cluster.axis / cluster.axis.length() } else { Vec3::Z };
        let half_angle = cluster.cone.half_angle + CONE_PADDING;
        let cos = if half_angle >= std::f32::consts::PI { -1.0 } else { half_angle.cos() };
        Self {
            mean: cluster.mean.to_array(),
            flux: cluster.flux,
            box_min: cluster.aabb.min.to_array(),
            variance: cluster.variance,
            box_max: cluster.aabb.max.to_array(),
            range: cluster.range.min(FARTHEST),
            lobe_axis: pack_direction(lobe),
            cone_axis: pack_direction(cluster.cone.axis),
            angles: ((length * UNORM + 0.5) as u32)
                | (((cos * SNORM - COSINE_ROUNDING).floor().max(-SNORM) as i32 as u32) << 16),
            target,
        }
    }

    /// The cluster that this child stands for; wider than the packed one by rounding only.
    pub fn cluster(&self) -> Cluster {
        let mean = Vec3::from(self.mean);
        if self.flux <= 0.0 {
            return Cluster { mean, ..Cluster::EMPTY };
        }
        let cos = self.cos_half_angle();
        Cluster {
            aabb: Aabb { min: self.box_min.into(), max: self.box_max.into() },
            cone: if cos <= -1.0 {
                Cone::FULL
            } else {
                Cone { axis: unpack_direction(self.cone_axis), half_angle: cos.acos() }
            },
            flux: self.flux,
            mean,
            variance: self.variance,
            axis: unpack_direction(self.lobe_axis) * self.lobe_length(),
            range: self.range,
        }
    }

    /// Cosine of the cone's half-angle; -1 proves nothing.
    pub fn cos_half_angle(&self) -> f32 {
        (((self.angles >> 16) as u16 as i16) as f32 / SNORM).max(-1.0)
    }

    /// Length of the mean direction, in [0, 1].
    pub fn lobe_length(&self) -> f32 {
        (self.angles & 0xffff) as f32 / UNORM
    }

    /// Where it leads, `None` for an unused slot.
    pub fn target(&self) -> Option<Target> {
        match self.target {
            EMPTY_SLOT => None,
            t if t & LEAF != 0 => Some(Target::Leaf(t & !LEAF)),
            t => Some(Target::Node(t)),
        }
    }
}

impl Node {
    /// No children, no parent.
    pub const EMPTY: Self = Self { children: [Child::EMPTY; WIDTH], parent: NO_PARENT, count: 0, padding: [0; 2] };

    /// The children in use.
    pub fn used(&self) -> &[Child] {
        &self.children[..self.count as usize]
    }

    /// All children merged.
    pub fn cluster(&self) -> Cluster {
        self.used().iter().fold(Cluster::EMPTY, |all, child| all.merge(&child.cluster()))
    }
}

/// A unit vector in 2 x 16 bits, off by at most 7e-5 rad.
///
/// Source: Cigolle et al., A Survey of Efficient Representations for Independent Unit Vectors (JCGT 2014).
pub(crate) fn pack_direction(d: Vec3) -> u32 {
    let flat = d / (d.x.abs() + d.y.abs() + d.z.abs());
    let mut oct = flat.truncate();
    if flat.z < 0.0 {
        oct = (Vec2::ONE - Vec2::new(flat.y, flat.x).abs()) * sign_not_zero(oct);
    }
    let q = (oct.clamp(Vec2::NEG_ONE, Vec2::ONE) * SNORM + 0.5).floor();
    (q.x as i32 as u32 & 0xffff) | ((q.y as i32 as u32) << 16)
}

/// The unit vector of [`pack_direction`].
pub(crate) fn unpack_direction(packed: u32) -> Vec3 {
    let oct = Vec2::new(packed as u16 as i16 as f32, (packed >> 16) as u16 as i16 as f32) / SNORM;
    let oct = oct.max(Vec2::NEG_ONE);
    let mut d = oct.extend(1.0 - oct.x.abs() - oct.y.abs());
    let fold = (-d.z).max(0.0);
    d.x -= fold * sign_not_zero(oct).x;
    d.y -= fold * sign_not_zero(oct).y;
    d.normalize()
}

fn sign_not_zero(v: Vec2) -> Vec2 {
    Vec2::select(v.cmpge(Vec2::ZERO), Vec2::ONE, Vec2::NEG_ONE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cone::angle;

    #[test]
    fn packed_directions_are_close_and_packed_cones_hold_the_true_ones() {
        for i in 0..20_000 {
            let z = 1.0 - 2.0 * (i as f32 + 0.5) / 20_000.0;
            let (s, c) = (i as f32 * 2.399_963_2).sin_cos();
            let d = (Vec3::new(c, s, 0.0) * (1.0 - z * z).sqrt() + Vec3::Z * z).normalize();
            // Half a step of 1/32767 in each coordinate, stretched by at most 3 where the octahedron is flattest.
            assert!(angle(d, unpack_direction(pack_direction(d))) < 7.0e-5, "{d}");
            let half_angle = i as f32 / 20_000.0 * 3.1;
            let cluster = Cluster {
                aabb: Aabb::point(Vec3::ONE),
                cone: Cone { axis: d, half_angle },
                flux: 1.0,
                axis: d * 0.5,
                ..Cluster::EMPTY
            };
            let back = Child::pack(&cluster, 0).cluster();
            let reach = angle(back.cone.axis, d) + half_angle;
            assert!(back.cone.is_full() || reach <= back.cone.half_angle, "{half_angle} {reach} {:?}", back.cone);
        }
    }

    #[test]
    fn a_dark_cluster_packs_to_a_slot_of_zero_flux() {
        let child = Child::pack(&Cluster { mean: Vec3::X, ..Cluster::EMPTY }, LEAF | 3);
        assert_eq!((child.flux, child.target()), (0.0, Some(Target::Leaf(3))));
        assert!(child.cluster().aabb.is_empty());
        assert_eq!(Child::EMPTY.target(), None);
    }
}
