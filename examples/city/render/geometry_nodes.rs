//! The layout of hierarchy nodes that both backends walk, and the walk on the CPU (`trace` in `render.wgsl` is its twin).
//!
//! A node holds the boxes of both its children, as in Aila and Laine (HPG 2009): one 64-byte read decides about two boxes.

use super::geometry::{Geometry, PackedTriangle, SEE_THROUGH};
use bytemuck::{Pod, Zeroable};
use girandole::glam::{Vec3, Vec3A, Vec4};
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;

/// Marks a reference to a leaf: bits 28 to 30 hold its count less one, the rest its first triangle, or its object.
pub const LEAF: u32 = 1 << 31;
const COUNT_SHIFT: u32 = 28;
const FIRST_MASK: u32 = (1 << COUNT_SHIFT) - 1;
/// How many triangles, or objects, leaves can tell apart.
pub const MAX_REFERENCE: usize = 1 << COUNT_SHIFT;
/// A world without objects; the end of a walk.
pub const NOTHING: u32 = u32::MAX;
/// The end of an object's part of a walk.
const LEAVE: u32 = u32::MAX - 1;

const SLAB_ROUNDING: f32 = 1.0 + 4e-7;

/// Two children's boxes and references. `Node` in `render.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(16))]
pub struct Node {
    /// Lower corner of the first child's box.
    pub min0: Vec3,
    /// Another node's index, or a leaf.
    pub child0: u32,
    /// Upper corner.
    pub max0: Vec3,
    /// Zero.
    pub padding0: u32,
    /// Lower corner of the second child's box.
    pub min1: Vec3,
    /// Another node's index, or a leaf.
    pub child1: u32,
    /// Upper corner.
    pub max1: Vec3,
    /// Zero.
    pub padding1: u32,
}

/// Where a hierarchy begins and how deep a stack its walk needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Subtree {
    /// A node's index, a leaf, or [`NOTHING`].
    pub root: u32,
    /// Nodes on the longest way down.
    pub depth: u32,
}

impl Subtree {
    /// Nothing to hit.
    pub const EMPTY: Self = Self { root: NOTHING, depth: 0 };
}

/// A leaf of `count` (1 to 8) triangles or objects.
pub fn leaf_reference(first: u32, count: u32) -> u32 {
    debug_assert!((1..=8).contains(&count) && first <= FIRST_MASK);
    LEAF | (count - 1) << COUNT_SHIFT | first
}

/// Appends a hierarchy's inner nodes, parents before children.
pub fn collect_nodes(bvh: &Bvh2, nodes: &mut Vec<Node>, leaf: impl Fn(&Bvh2Node) -> u32) -> Subtree {
    let root = bvh.nodes[0];
    if root.is_leaf() {
        return Subtree { root: leaf(&root), depth: 1 };
    }
    let first = nodes.len();
    let mut depth = 0;
    // (child pair in the source, where our reference to it goes, depth)
    let mut stack = vec![(root.first_index as usize, usize::MAX, 1u32)];
    while let Some((pair, slot, level)) = stack.pop() {
        let index = nodes.len();
        if slot != usize::MAX {
            let parent = &mut nodes[slot / 2];
            *(if slot.is_multiple_of(2) { &mut parent.child0 } else { &mut parent.child1 }) = index as u32;
        }
        depth = depth.max(level);
        let [a, b] = [bvh.nodes[pair], bvh.nodes[pair + 1]];
        let mut references = [0; 2];
        for (side, child) in [&a, &b].into_iter().enumerate() {
            if child.is_leaf() {
                references[side] = leaf(child);
            } else {
                stack.push((child.first_index as usize, index * 2 + side, level + 1));
            }
        }
        nodes.push(Node {
            min0: a.aabb().min.into(),
            child0: references[0],
            max0: a.aabb().max.into(),
            padding0: 0,
            min1: b.aabb().min.into(),
            child1: references[1],
            max1: b.aabb().max.into(),
            padding1: 0,
        });
    }
    Subtree { root: first as u32, depth: depth + 1 }
}

/// The nearest thing a ray met.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// Along the ray, in units of its direction's length.
    pub distance: f32,
    /// Index into [`Geometry::objects`].
    pub object: u32,
    /// Index into [`Geometry::triangles`].
    pub triangle: u32,
}

#[derive(Clone, Copy)]
struct Ray {
    origin: Vec3A,
    direction: Vec3A,
    inverse: Vec3A,
}

impl Ray {
    fn new(origin: Vec3A, direction: Vec3A) -> Self {
        // A huge number where a component is zero: infinity would make 0 * infinity of an origin on a box's side.
        let safe = |x: f32| if x.abs() < 1e-20 { 1e20f32.copysign(x) } else { 1.0 / x };
        Self { origin, direction, inverse: Vec3A::new(safe(direction.x), safe(direction.y), safe(direction.z)) }
    }

    /// Where it enters a box, or infinity.
    #[inline(always)]
    fn enter(&self, min: Vec4, max: Vec4, limit: f32) -> f32 {
        let t0 = (Vec3A::from_vec4(min) - self.origin) * self.inverse;
        let t1 = (Vec3A::from_vec4(max) - self.origin) * self.inverse;
        let near = t0.min(t1).max_element().max(0.0);
        // Widened by the rounding of the slab test (Ize, JCGT 2013), so that no hit on a box's side is lost.
        let far = (t0.max(t1).min_element() * SLAB_ROUNDING).min(limit);
        if near <= far { near } else { f32::INFINITY }
    }

    #[inline(always)]
    fn intersect(&self, triangle: &PackedTriangle) -> f32 {
        let [corner, edge1, edge2] = bytemuck::cast_ref::<_, [Vec4; 3]>(triangle).map(Vec3A::from_vec4);
        let p = self.direction.cross(edge2);
        let determinant = edge1.dot(p);
        if determinant == 0.0 {
            return f32::INFINITY;
        }
        let inverse = 1.0 / determinant;
        let s = self.origin - corner;
        let u = s.dot(p) * inverse;
        let q = s.cross(edge1);
        let v = self.direction.dot(q) * inverse;
        let t = edge2.dot(q) * inverse;
        if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 { t } else { f32::INFINITY }
    }
}

/// Whether any hit will do.
#[derive(Clone, Copy, PartialEq)]
enum Want {
    Nearest,
    AnyOpaque,
}

impl Geometry {
    /// The nearest hit in front of `origin`.
    pub fn nearest(&self, origin: Vec3, direction: Vec3) -> Option<Hit> {
        self.trace(origin, direction, f32::INFINITY, Want::Nearest)
    }

    /// Whether something opaque lies within `limit`.
    pub fn occluded(&self, origin: Vec3, direction: Vec3, limit: f32) -> bool {
        limit > 0.0 && self.trace(origin, direction, limit, Want::AnyOpaque).is_some()
    }

    /// Unit normal in world space, out of the front of what was hit.
    pub fn normal(&self, hit: &Hit) -> Vec3 {
        let triangle = &self.triangles[hit.triangle as usize];
        // Normals go to world space by the transpose of world to mesh.
        let to_world = self.objects[hit.object as usize].inverse.matrix3.transpose();
        (to_world * triangle.edge1.cross(triangle.edge2)).normalize_or_zero()
    }

    /// How many references a walk's stack may hold.
    pub fn stack_size(&self) -> usize {
        // Two more for the marks.
        (self.top.depth + self.mesh_depth) as usize + 2
    }

    #[inline(always)]
    fn trace(&self, origin: Vec3, direction: Vec3, limit: f32, want: Want) -> Option<Hit> {
        // Ordinary trees fit the array; the vector is for freak ones.
        const USUAL: usize = 96;
        let needed = self.stack_size();
        if needed <= USUAL {
            self.trace_with(&mut [0; USUAL], origin, direction, limit, want)
        } else {
            self.trace_with(&mut vec![0; needed], origin, direction, limit, want)
        }
    }

    #[inline(always)]
    fn trace_with(&self, stack: &mut [u32], origin: Vec3, direction: Vec3, limit: f32, want: Want) -> Option<Hit> {
        let world_ray = Ray::new(origin.into(), direction.into());
        let mut ray = world_ray;
        let mut hit = Hit { distance: limit, object: NOTHING, triangle: 0 };
        let mut object = NOTHING;
        // Entered from the bottom: NOTHING ends the walk, LEAVE ends the part within an object.
        stack[0] = NOTHING;
        let mut height = 1;
        let mut reference = self.top.root;
        loop {
            while reference & LEAF == 0 {
                // Whole vectors, which load at once; the references beside the corners ride along.
                let node = &self.nodes[reference as usize];
                let [min0, max0, min1, max1] = *bytemuck::cast_ref::<_, [Vec4; 4]>(node);
                let enter0 = ray.enter(min0, max0, hit.distance);
                let enter1 = ray.enter(min1, max1, hit.distance);
                let (near, far) =
                    if enter0 <= enter1 { (node.child0, node.child1) } else { (node.child1, node.child0) };
                if enter0.max(enter1) < f32::INFINITY {
                    stack[height] = far;
                    height += 1;
                }
                if enter0.min(enter1) < f32::INFINITY {
                    reference = near;
                } else {
                    height -= 1;
                    reference = stack[height];
                }
            }
            if reference == NOTHING {
                return (hit.object != NOTHING).then_some(hit);
            }
            let first = reference & FIRST_MASK;
            if reference == LEAVE {
                object = NOTHING;
                ray = world_ray;
            } else if object == NOTHING {
                object = first;
                let placed = &self.objects[object as usize];
                ray = Ray::new(
                    placed.inverse.transform_point3a(world_ray.origin),
                    placed.inverse.transform_vector3a(world_ray.direction),
                );
                stack[height] = LEAVE;
                height += 1;
                reference = placed.root;
                continue;
            } else {
                let count = (reference >> COUNT_SHIFT & 7) + 1;
                for index in first..first + count {
                    let triangle = &self.triangles[index as usize];
                    let distance = ray.intersect(triangle);
                    if distance < hit.distance && (want == Want::Nearest || triangle.flags & SEE_THROUGH == 0) {
                        hit = Hit { distance, object, triangle: index };
                        if want == Want::AnyOpaque {
                            return Some(hit);
                        }
                    }
                }
            }
            height -= 1;
            reference = stack[height];
        }
    }
}
