//! Ray queries on the CPU. `trace` in `render.wgsl` is the twin of [`Geometry::trace`].

use super::geometry::{COLORS, Geometry, NORMALS, PackedTriangle, SEE_THROUGH, TEX_COORDS, TRANSLUCENT};
use super::nodes::{COUNT_SHIFT, FIRST_MASK, LEAF, LEAVE, NOTHING};
use super::scene::{Material, Scene};
use super::textures::{OpacitySeed, textured};
use girandole::glam::{Vec2, Vec3, Vec3A, Vec4};

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
    /// Weights of the second and of the third corner of the triangle; that of the first is the rest to
    /// 1.
    pub weights: Vec2,
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

    /// The distance at which the ray meets a triangle, or infinity, and the weights of the second and
    /// the third corner.
    #[inline(always)]
    fn intersect(&self, triangle: &PackedTriangle) -> (f32, Vec2) {
        let [corner, edge1, edge2] = bytemuck::cast_ref::<_, [Vec4; 3]>(triangle).map(Vec3A::from_vec4);
        let p = self.direction.cross(edge2);
        let determinant = edge1.dot(p);
        if determinant == 0.0 {
            return (f32::INFINITY, Vec2::ZERO);
        }
        let inverse = 1.0 / determinant;
        let s = self.origin - corner;
        let u = s.dot(p) * inverse;
        let q = s.cross(edge1);
        let v = self.direction.dot(q) * inverse;
        let t = edge2.dot(q) * inverse;
        let is_hit = u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0;
        (if is_hit { t } else { f32::INFINITY }, Vec2::new(u, v))
    }
}

/// Which hit a query looks for.
enum Query {
    /// The nearest. Translucent surfaces are met at random, by a seed, or if they cover more than half.
    Nearest(Option<OpacitySeed>),
    /// Any that stops the light that is left.
    Shadow {
        /// The share of the light that the surfaces met so far let through.
        transmittance: f32,
    },
}

impl Geometry {
    /// The nearest hit in front of `origin` of a surface that covers more than half of what lies behind
    /// it.
    pub fn nearest(&self, origin: Vec3, direction: Vec3) -> Option<Hit> {
        self.trace(origin, direction, f32::INFINITY, &mut Query::Nearest(None))
    }

    /// The nearest hit in front of `origin`, where surfaces that cover a share are met in that share of
    /// all seeds.
    pub fn nearest_at_random(&self, origin: Vec3, direction: Vec3, seed: OpacitySeed) -> Option<Hit> {
        self.trace(origin, direction, f32::INFINITY, &mut Query::Nearest(Some(seed)))
    }

    /// Whether no light comes from within the distance `limit`.
    #[allow(dead_code, reason = "only measuring programs and tests use it")]
    pub fn occluded(&self, origin: Vec3, direction: Vec3, limit: f32) -> bool {
        self.transmittance(origin, direction, limit) == 0.0
    }

    /// The share of the light that arrives from the distance `limit`.
    pub fn transmittance(&self, origin: Vec3, direction: Vec3, limit: f32) -> f32 {
        if limit <= 0.0 {
            return 1.0;
        }
        let mut query = Query::Shadow { transmittance: 1.0 };
        match (self.trace(origin, direction, limit, &mut query), query) {
            (None, Query::Shadow { transmittance }) => transmittance,
            _ => 0.0,
        }
    }

    /// The material at a hit, with its textures and the colours of vertices. The base colour of an unlit
    /// one is part of its emission.
    pub fn material(&self, scene: &Scene, hit: &Hit) -> Material {
        let triangle = &self.triangles[hit.triangle as usize];
        let material = &scene.materials[triangle.material as usize];
        let mut found = self
            .attribute_at(triangle, TEX_COORDS, hit.weights)
            .map_or(*material, |coordinates| textured(material, &scene.textures, coordinates));
        if let Some(color) = self.attribute_at(triangle, COLORS, hit.weights) {
            found.base_color *= color.truncate();
            found.opacity *= color.w;
        }
        if found.is_unlit {
            // White shows as white, however bright the lights are.
            found.emission += found.base_color / scene.exposure;
            found.base_color = Vec3::ZERO;
        }
        found
    }

    /// An attribute at a point of a triangle, if it has one of this kind.
    fn attribute_at(&self, triangle: &PackedTriangle, kind: u32, weights: Vec2) -> Option<Vec4> {
        let [a, b, c] = self.attributes[triangle.attribute(kind)?];
        Some(a + (b - a) * weights.x + (c - a) * weights.y)
    }

    /// Whether a query ends, or goes on from, a triangle that its ray meets.
    #[inline(always)]
    fn is_met(&self, query: &mut Query, triangle: &PackedTriangle, hit: &Hit) -> bool {
        if triangle.flags & (SEE_THROUGH | TRANSLUCENT) == 0 {
            return true;
        }
        let coverage = || {
            let [coordinates, color] = [TEX_COORDS, COLORS].map(|kind| self.attribute_at(triangle, kind, hit.weights));
            self.opacity.coverage(triangle.material, coordinates, color.map_or(1.0, |color| color.w))
        };
        let is_translucent = triangle.flags & TRANSLUCENT != 0;
        match query {
            Query::Shadow { .. } if triangle.flags & SEE_THROUGH != 0 => false,
            _ if !is_translucent => true,
            Query::Shadow { transmittance } => {
                *transmittance *= 1.0 - coverage();
                *transmittance <= 0.0
            }
            Query::Nearest(seed) => seed.map_or(0.5, |seed| seed.draw(hit.object, hit.triangle)) < coverage(),
        }
    }

    /// The unit normal of the front of a triangle that was hit, in world space.
    pub fn normal(&self, hit: &Hit) -> Vec3 {
        let triangle = &self.triangles[hit.triangle as usize];
        // Normals are transformed by the transpose of the inverse.
        let to_world = self.objects[hit.object as usize].inverse.matrix3.transpose();
        (to_world * triangle.edge1.cross(triangle.edge2)).normalize_or_zero()
    }

    /// The unit normal of the front of the smooth surface that a hit triangle stands for, in world space:
    /// the normals of its corners, interpolated, or its own normal.
    pub fn shading_normal(&self, hit: &Hit) -> Vec3 {
        let triangle = &self.triangles[hit.triangle as usize];
        let front = self.normal(hit);
        let Some(normal) = self.attribute_at(triangle, NORMALS, hit.weights) else { return front };
        let to_world = self.objects[hit.object as usize].inverse.matrix3.transpose();
        (to_world * normal.truncate()).normalize_or(front)
    }

    /// The vector from a hit to the smooth surface that its triangle stands for, in world space; zero
    /// where that is behind the triangle. Shadow rays that start there do not meet the neighbours of their
    /// triangle where the smooth surface is lit.
    ///
    /// Based on Hanika, "Hacking the shadow terminator", Ray Tracing Gems II, 2021: the hit is projected
    /// onto the tangent plane of each corner, and the projections are interpolated.
    pub fn to_smooth_surface(&self, hit: &Hit, is_front: bool) -> Vec3 {
        let triangle = &self.triangles[hit.triangle as usize];
        let Some(index) = triangle.attribute(NORMALS) else { return Vec3::ZERO };
        let side = if is_front { 1.0 } else { -1.0 };
        let place = triangle.edge1 * hit.weights.x + triangle.edge2 * hit.weights.y;
        let weights = [1.0 - hit.weights.x - hit.weights.y, hit.weights.x, hit.weights.y];
        let mut moved = Vec3::ZERO;
        for (i, corner) in [Vec3::ZERO, triangle.edge1, triangle.edge2].into_iter().enumerate() {
            let normal = self.attributes[index][i].truncate();
            let above = (place - corner).dot(normal) * side;
            moved -= normal * (weights[i] * above.min(0.0) * side);
        }
        let moved = self.objects[hit.object as usize].inverse.matrix3.inverse() * moved;
        if moved.is_finite() { moved } else { Vec3::ZERO }
    }

    /// The most references that the stack of a traversal holds.
    pub fn stack_size(&self) -> usize {
        // Two more for the marks NOTHING and LEAVE.
        (self.top.depth + self.mesh_depth) as usize + 2
    }

    #[inline(always)]
    fn trace(&self, origin: Vec3, direction: Vec3, limit: f32, query: &mut Query) -> Option<Hit> {
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
    fn trace_with(
        &self,
        stack: &mut [u32],
        origin: Vec3,
        direction: Vec3,
        limit: f32,
        query: &mut Query,
    ) -> Option<Hit> {
        let world_ray = Ray::new(origin.into(), direction.into());
        let mut ray = world_ray;
        let mut hit = Hit { distance: limit, object: NOTHING, triangle: 0, weights: Vec2::ZERO };
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
                    let (distance, weights) = ray.intersect(triangle);
                    if distance >= hit.distance {
                        continue;
                    }
                    let found = Hit { distance, object, triangle: index, weights };
                    if self.is_met(query, triangle, &found) {
                        hit = found;
                        if matches!(query, Query::Shadow { .. }) {
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
