//! Ray queries on the CPU. `trace` in `render.wgsl` is the twin of [`Geometry::trace`].

use super::geometry::{Geometry, PackedTriangle, SEE_THROUGH};
use super::nodes::{COUNT_SHIFT, FIRST_MASK, LEAF, LEAVE, NOTHING};
use girandole::glam::{Vec3, Vec3A, Vec4};

/// Widens the far end of the slab test by its rounding (Ize, JCGT 2013), so that no hit on a side
/// of a box is lost.
const SLAB_ROUNDING: f32 = 1.0 + 4e-7;

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// Distance along the ray, in units of the length of its direction.
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
        // A large number where a component is zero: infinity would give 0 * infinity for an origin
        // on a side of a box.
        let safe = |x: f32| if x.abs() < 1e-20 { 1e20f32.copysign(x) } else { 1.0 / x };
        Self { origin, direction, inverse: Vec3A::new(safe(direction.x), safe(direction.y), safe(direction.z)) }
    }

    /// The distance at which the ray enters a box, or infinity.
    #[inline(always)]
    fn enter(&self, min: Vec4, max: Vec4, limit: f32) -> f32 {
        let t0 = (Vec3A::from_vec4(min) - self.origin) * self.inverse;
        let t1 = (Vec3A::from_vec4(max) - self.origin) * self.inverse;
        let near = t0.min(t1).max_element().max(0.0);
        let far = (t0.max(t1).min_element() * SLAB_ROUNDING).min(limit);
        if near <= far { near } else { f32::INFINITY }
    }

    /// The distance at which the ray meets a triangle, or infinity.
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

/// Which hit a query looks for.
#[derive(Clone, Copy, PartialEq)]
enum Query {
    Nearest,
    AnyOpaque,
}

impl Geometry {
    /// The nearest hit in front of `origin`.
    pub fn nearest(&self, origin: Vec3, direction: Vec3) -> Option<Hit> {
        self.trace(origin, direction, f32::INFINITY, Query::Nearest)
    }

    /// Whether something opaque lies within the distance `limit`.
    pub fn occluded(&self, origin: Vec3, direction: Vec3, limit: f32) -> bool {
        limit > 0.0 && self.trace(origin, direction, limit, Query::AnyOpaque).is_some()
    }

    /// The unit normal of the front of a triangle that was hit, in world space.
    pub fn normal(&self, hit: &Hit) -> Vec3 {
        let triangle = &self.triangles[hit.triangle as usize];
        // Normals are transformed by the transpose of the inverse.
        let to_world = self.objects[hit.object as usize].inverse.matrix3.transpose();
        (to_world * triangle.edge1.cross(triangle.edge2)).normalize_or_zero()
    }

    /// The most references that the stack of a traversal holds.
    pub fn stack_size(&self) -> usize {
        // Two more for the marks NOTHING and LEAVE.
        (self.top.depth + self.mesh_depth) as usize + 2
    }

    #[inline(always)]
    fn trace(&self, origin: Vec3, direction: Vec3, limit: f32, query: Query) -> Option<Hit> {
        // Only unusually deep hierarchies need the vector.
        const USUAL: usize = 96;
        let needed = self.stack_size();
        if needed <= USUAL {
            self.trace_with(&mut [0; USUAL], origin, direction, limit, query)
        } else {
            self.trace_with(&mut vec![0; needed], origin, direction, limit, query)
        }
    }

    #[inline(always)]
    fn trace_with(&self, stack: &mut [u32], origin: Vec3, direction: Vec3, limit: f32, query: Query) -> Option<Hit> {
        let world_ray = Ray::new(origin.into(), direction.into());
        let mut ray = world_ray;
        let mut hit = Hit { distance: limit, object: NOTHING, triangle: 0 };
        let mut object = NOTHING;
        // NOTHING ends the traversal, LEAVE the traversal of an object.
        stack[0] = NOTHING;
        let mut height = 1;
        let mut reference = self.top.root;
        loop {
            while reference & LEAF == 0 {
                // Loads of whole vectors, whose fourth components are references.
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
                    if distance < hit.distance && (query == Query::Nearest || triangle.flags & SEE_THROUGH == 0) {
                        hit = Hit { distance, object, triangle: index };
                        if query == Query::AnyOpaque {
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
