//! Portals: the openings of a room, through which alone the sky shines in.
//!
//! A point in the room sees no direction of the sky that misses them. So what a node of the sky's tree brings is
//! multiplied by the share of it that lies behind a portal, which is 0 only if none of it does. Twin of the
//! functions for portals in `shaders/sky.wgsl`.

use glam::{DMat3, DVec3, Mat3, Vec3, Vec4};

use crate::instance::placement::Placement;
use crate::shading::importance::ChildImportances;
use crate::tree::{ChildRef, Node, WIDTH};

/// The most portals of a world.
pub(crate) const MAX_PORTALS: usize = 32;

/// How much larger a portal counts than it is, so that rounding hides nothing.
pub(crate) const PORTAL_MARGIN: f32 = 1.01;

/// How much wider a node counts than it is, in radians or so.
pub(crate) const PORTAL_SLACK: f32 = 1.0e-4;

/// Up to this sine of the angle to the plane of a portal, a point sees all of the sky.
pub(crate) const IN_PLANE: f32 = 1.0e-4;

/// How much of the width of a node's box holds light: boxes are about spheres, and those about patches.
pub(crate) const FILLED_WIDTH: f32 = 0.85;

/// The least share of a node along one axis of a portal, if the portal shows any of it.
pub(crate) const LEAST_SHARE: f32 = 0.01;

/// A window or another opening of a room: see [`LightWorld::set_portals`](crate::LightWorld::set_portals).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Portal {
    /// The middle of a parallelogram, in metres.
    pub center: DVec3,
    /// From the middle to that of one edge.
    pub half_u: Vec3,
    /// From the middle to that of the next edge.
    pub half_v: Vec3,
    /// The room: what the placement makes of the cube from -1 to 1 along each axis. Let it reach into the walls, so that
    /// points on them lie inside, but not to their outer faces. The portal belongs where the room ends, or beyond: a
    /// point between both sees the sky through it only backward.
    pub room: Placement,
}

impl Portal {
    /// Whether all numbers are finite, the opening has an area and the room a volume.
    pub(crate) fn is_sound(&self) -> bool {
        let edges = [self.half_u, self.half_v];
        let is_finite = self.center.is_finite() && edges.iter().all(|edge| edge.is_finite());
        let Placement { linear, translation } = self.room;
        let inverse = linear.as_dmat3().inverse();
        let area = self.half_u.cross(self.half_v).length();
        is_finite
            && area > 0.0
            && area.is_finite()
            && linear.is_finite()
            && translation.is_finite()
            && linear.determinant() != 0.0
            && inverse.is_finite()
    }

    /// The same relative to an origin.
    pub(crate) fn placed(&self, origin: DVec3) -> PlacedPortal {
        let inverse: DMat3 = self.room.linear.as_dmat3().inverse();
        let start = inverse * (origin - self.room.translation);
        let row = |k: usize| inverse.row(k).extend(start[k]).as_vec4();
        let center = (self.center - origin).as_vec3();
        let [half_u, half_v] = [self.half_u, self.half_v].map(|half| half * PORTAL_MARGIN);
        PlacedPortal { to_room: [row(0), row(1), row(2)], center, half_u, half_v }
    }
}

/// A portal as samplers see it: relative to the world's origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PlacedPortal {
    /// The rows of the map into the space in which the room is a cube.
    pub to_room: [Vec4; 3],
    pub center: Vec3,
    pub half_u: Vec3,
    pub half_v: Vec3,
}

impl PlacedPortal {
    /// Whether a point is in the room.
    fn has_in_room(&self, position: Vec3) -> bool {
        let place = position.extend(1.0);
        self.to_room.iter().all(|row| row.dot(place).abs() <= 1.0)
    }

    /// Whether a point is so near to the plane of the portal that its side cannot be told.
    fn is_in_plane(&self, from: Vec3) -> bool {
        let (normal, to) = (self.half_u.cross(self.half_v), self.center - from);
        normal.dot(to).abs() <= IN_PLANE * normal.length() * to.length()
    }

    /// The planes through a point and the edges, with the portal at their front. Those of opposite edges follow each
    /// other. Vectors of any length.
    fn planes(&self, from: Vec3) -> [Vec3; 4] {
        let (to, u, v) = (self.center - from, self.half_u, self.half_v);
        let sign = 1.0_f32.copysign(u.cross(v).dot(to));
        [(to + u).cross(v), (u - to).cross(v), (-to - v).cross(u), (to - v).cross(u)].map(|normal| normal * sign)
    }

    /// The distance of the unit vector to the middle from each plane, times the length of the plane's normal.
    fn depth(&self, from: Vec3) -> f32 {
        let to = self.center - from;
        self.half_u.cross(self.half_v).dot(to).abs() / to.length()
    }
}

/// The quads of a stored portal.
#[cfg(feature = "gpu-plan")]
const QUADS: usize = 6;

/// The quads of all portals that there may be, and of their number.
#[cfg(feature = "gpu-plan")]
pub(crate) const PORTAL_QUADS: u32 = (MAX_PORTALS * QUADS + 1) as u32;

/// Portals as a GPU stores them: the last one first, and then their number. Of each the rows of the map to the room, and
/// the middle and both half edges of the opening.
#[cfg(feature = "gpu-plan")]
pub(crate) fn portal_quads(portals: &[PlacedPortal]) -> Vec<[f32; 4]> {
    let quads = |portal: &PlacedPortal| -> [[f32; 4]; QUADS] {
        let [a, b, c] = portal.to_room.map(|row| row.to_array());
        let [center, u, v] = [portal.center, portal.half_u, portal.half_v].map(|v| v.extend(0.0).to_array());
        [a, b, c, center, u, v]
    };
    let number = [f32::from_bits(portals.len() as u32), 0.0, 0.0, 0.0];
    portals.iter().rev().flat_map(quads).chain([number]).collect()
}

/// The portals of a room as a point in it sees them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PortalsInSight<'a> {
    portals: &'a [PlacedPortal],
    /// A bit for each.
    seen: u32,
    position: Vec3,
    /// The linear part of the map from the space of the sky to the world.
    axes: Mat3,
}

impl<'a> PortalsInSight<'a> {
    /// `None` for a point that is in no room.
    pub fn new(portals: &'a [PlacedPortal], position: Vec3, axes: Mat3) -> Option<Self> {
        let bits = portals.iter().enumerate().filter(|(_, portal)| portal.has_in_room(position));
        let seen = bits.fold(0, |seen, (number, _)| seen | 1 << number);
        (seen != 0).then_some(Self { portals, seen, position, axes })
    }

    /// Multiplies the importance of each child of a node of the sky by the share of it that is behind portals. What is
    /// seen in part is split early: its light may be all in the other part.
    pub fn weigh(&self, node: &Node, children: &mut ChildImportances) {
        let grid = node.grid(Vec3::ZERO);
        let boxes = std::array::from_fn::<_, WIDTH, _>(|slot| {
            let child = node.unpack(slot, &grid);
            (Vec3::from(child.center), Vec3::from(child.half) + PORTAL_SLACK)
        });
        let mut shares = [0.0; WIDTH];
        for (_, portal) in self.portals.iter().enumerate().filter(|(number, _)| self.seen >> number & 1 != 0) {
            if portal.is_in_plane(self.position) {
                return;
            }
            let in_sky = self.axes.transpose();
            let depth = portal.depth(self.position);
            let planes = portal.planes(self.position).map(|normal| {
                let normal = in_sky * normal;
                let inverse = 1.0 / normal.length();
                if inverse < f32::INFINITY { (normal * inverse, depth * inverse) } else { (Vec3::ZERO, 1.0) }
            });
            for (share, (center, half)) in shares.iter_mut().zip(boxes) {
                let side = |(normal, depth): (Vec3, f32)| Vec3::new(normal.dot(center), normal.abs().dot(half), depth);
                let [a, b, c, d] = planes.map(side);
                *share += share_between(a, b) * share_between(c, d);
            }
        }
        for slot in 0..WIDTH {
            let share = shares[slot].min(1.0);
            children.importance[slot] *= share;
            if let Some(ChildRef::Node(_)) = node.child(slot) {
                children.doubt[slot] += 1.0 - share;
            }
        }
    }
}

/// The share of a box that is in front of two planes, along the line between them. Of each plane the distance to the
/// centre, positive in front, how far the box reaches along its normal, and the distance to the middle of the portal.
fn share_between(a: Vec3, b: Vec3) -> f32 {
    let filled = (a.x + FILLED_WIDTH * a.y).min(b.x + FILLED_WIDTH * b.y);
    let share = filled.min(a.z + b.z) / (FILLED_WIDTH * (a.y + b.y));
    // A comparison that NaN passes.
    if (a.x + a.y).min(b.x + b.y) <= 0.0 { 0.0 } else { share.clamp(LEAST_SHARE, 1.0) }
}
