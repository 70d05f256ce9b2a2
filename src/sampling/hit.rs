//! The first light that a ray hits.
//!
//! Twin of `shaders/hit.wgsl`. The trees that choose lights bound them with boxes, so a ray finds the lights
//! that it hits in the same nodes, and an engine needs no list of lights of its own.

use glam::{Vec2, Vec3};

use crate::instance::transform::InstanceTransform;
use crate::keys::LightId;
use crate::light::{Light, Shape, range_window};
use crate::sampling::emit::{Incident, MIN_DIST_SQ, is_lit_side};
use crate::sampling::pdf::point_pdf;
use crate::sampling::sample::{LightSample, LightSampler};
use crate::shading::segment::LocalSegment;
use crate::shading::shading_point::ShadingPoint;
use crate::tree::{ChildRef, Node, WIDTH};

/// Components of directions count as at least this, so that no quotient is NaN.
pub(crate) const MIN_DIRECTION: f32 = 1.0e-30;

/// How much farther than its far side the near side of a box may seem, by rounding: four roundings of a
/// distance.
pub(crate) const BOX_ROUNDING: f32 = 1.0 + 4.0 * f32::EPSILON;

impl LightSampler<'_> {
    /// Returns the first light that a ray from a shading point hits, for multiple importance sampling of
    /// directions that the BSDF chose: the sample that [`LightSampler::sample`] would have returned for
    /// this direction, with its probability and density.
    ///
    /// `direction` is a unit vector. Lights from `max_dist` metres on are not hit: pass the distance at which
    /// the ray meets the scene, and a little more where the scene has the surfaces of lights too. A light is
    /// hit where it sends light to the shading point. So rays pass through the backs of one-sided lights,
    /// through lights out of range, hidden and masked ones, and out of spheres. Lights without size are never
    /// hit. A ray that hits nothing and has a `max_dist` of infinity finds the [sky](crate::LightWorld::set_sky).
    /// `None` if nothing is hit, or if the direction is below the shading point's horizon; and for a
    /// segment, of which a ray has only one point.
    ///
    /// The cost is that of the nodes whose boxes the ray meets, and of [`LightSampler::pmf`] for the light
    /// that it hits.
    pub fn hit(&self, shading_point: &ShadingPoint, direction: Vec3, max_dist: f32) -> Option<LightSample> {
        let is_above = shading_point.normal == Vec3::ZERO || shading_point.normal.dot(direction) > 0.0;
        (is_above && LocalSegment::of(shading_point).is_none()).then_some(())?;
        let Some((light, dist)) = self.first_hit(shading_point, direction, max_dist) else {
            return if max_dist == f32::INFINITY { self.hit_sky(shading_point, direction) } else { None };
        };
        let LightId::Local { instance, light: index } = light else { return None };
        let placed = self.world.instance(instance)?;
        let record = self.world.tree(placed.tree)?.lights().get(index as usize)?;
        let frame = placed.shown()?.frame(self.world.home());
        let pdf = point_pdf(record, &frame, shading_point, self.world.solid_angle_sampling(), direction * dist);
        let radiance = record.emission * range_window(dist * dist, record.range);
        let radiance = placed.appearance.arriving(radiance)?;
        let incident = Incident { direction, dist, radiance, pdf, is_delta: false, along: 0.0 };
        let pmf = self.pmf(shading_point, light);
        Some(LightSample { light, pmf, incident, user_data: placed.appearance.user_data })
    }

    /// Returns where on a triangle or parallelogram the point of a sample or of a hit is: how far it is along both edges
    /// from the first corner, each from 0 to 1. The first corner of a triangle is its first vertex, and the edges end
    /// at the second and the third; a parallelogram begins at the corner at `-half_u - half_v`, and its edges run along
    /// `half_u` and `half_v`.
    ///
    /// An engine whose lights have textures finds the texel there, as `TexturedSurface::tex_coord` of the package
    /// `girandole-assets` does. `None` for lights of other shapes, for a
    /// segment, and for samples of another world.
    pub fn place_on_light(&self, shading_point: &ShadingPoint, sample: &LightSample) -> Option<Vec2> {
        let LightId::Local { instance, light } = sample.light else { return None };
        LocalSegment::of(shading_point).is_none().then_some(())?;
        let placed = self.world.instance(instance)?;
        let record = self.world.tree(placed.tree)?.lights().get(light as usize)?;
        let frame = placed.shown()?.frame(self.world.home());
        let hit = flat_hit(record, &frame, shading_point, sample.incident.direction)?;
        // Rounding may lead a little beyond the edges.
        let place = hit.place.clamp(Vec2::ZERO, Vec2::ONE);
        let excess = if hit.is_parallelogram { 0.0 } else { (place.x + place.y - 1.0).max(0.0) };
        Some(place - 0.5 * excess)
    }

    /// The first light, and its distance.
    fn first_hit(&self, shading_point: &ShadingPoint, direction: Vec3, max_dist: f32) -> Option<(LightId, f32)> {
        let mut found = None;
        let mut dist = max_dist;
        let top = self.view(shading_point).root;
        Ray::new(top.local.position, direction, top.local.margin).leaves(top.nodes, 0, &mut dist, |leaf, dist| {
            let Some(part) = self.top.part(leaf) else { return };
            let Some(instance) = self.world.instance_at(part.slot) else { return };
            let Some(placed) = self.world.instance(instance) else { return };
            let Some(tree) = self.world.tree(placed.tree) else { return };
            if placed.appearance.mask & shading_point.mask == 0 {
                return;
            }
            let Some(shown) = placed.shown() else { return };
            let frame = shown.frame(self.world.home());
            let mut meet = |light: u32, dist: &mut f32| {
                // What a factor makes black hides nothing.
                let sends = |record: &&Light| placed.appearance.arriving(record.emission).is_some();
                let record = tree.lights().get(light as usize).filter(sends);
                if let Some(nearer) =
                    record.and_then(|record| hit_dist(record, &frame, shading_point, direction, *dist))
                {
                    *dist = nearer;
                    found = Some((LightId::Local { instance, light }, nearer));
                }
            };
            match part.entry {
                ChildRef::Leaf(light) => meet(light, dist),
                ChildRef::Node(entry) => {
                    let origin = frame.in_tree(shading_point);
                    Ray::new(origin, frame.to_local * direction, shown.tree_margin()).leaves(
                        tree.nodes(),
                        entry,
                        dist,
                        meet,
                    );
                }
            }
        });
        found
    }
}

/// A ray in the space of a tree. Its parameter is the distance in the world.
struct Ray {
    origin: Vec3,
    inverse: Vec3,
    margin: f32,
}

impl Ray {
    fn new(origin: Vec3, direction: Vec3, margin: f32) -> Self {
        let inverse = direction.to_array().map(|x| 1.0 / x.abs().max(MIN_DIRECTION).copysign(x));
        Self { origin, inverse: inverse.into(), margin }
    }

    /// Calls a function for each leaf below a node whose box the ray meets before a distance, which the
    /// function may lower.
    fn leaves(&self, nodes: &[Node], entry: u32, dist: &mut f32, mut meet: impl FnMut(u32, &mut f32)) {
        let (mut index, mut slot) = (entry, 0);
        while let Some(node) = nodes.get(index as usize) {
            if slot == WIDTH {
                if index == entry {
                    return;
                }
                (index, slot) = (node.parent / WIDTH as u32, node.parent as usize % WIDTH + 1);
                continue;
            }
            match node.child(slot).filter(|_| self.meets(node, slot, *dist)) {
                Some(ChildRef::Node(child)) => (index, slot) = (child, 0),
                leaf => {
                    if let Some(ChildRef::Leaf(leaf)) = leaf {
                        meet(leaf, dist);
                    }
                    slot += 1;
                }
            }
        }
    }

    /// Whether the ray meets the box of a child that emits anything, before a distance.
    fn meets(&self, node: &Node, slot: usize, dist: f32) -> bool {
        let grid = node.grid(self.origin);
        let child = node.unpack(slot, &grid);
        let margin = (node.reach(&grid) + self.origin.abs().element_sum()) * self.margin;
        let (center, half) = (Vec3::from(child.center), Vec3::from(child.half) + margin);
        let (one, other) = ((center - half) * self.inverse, (center + half) * self.inverse);
        let (near, far) = (one.min(other).max_element().max(0.0), one.max(other).min_element().min(dist));
        child.flux > 0.0 && near <= far * BOX_ROUNDING
    }
}

/// A ray in the plane of a triangle or parallelogram.
struct FlatHit {
    dist: f32,
    /// How far it is along both edges from the first corner, from 0 to 1 on the light.
    place: Vec2,
    is_parallelogram: bool,
    /// Whether the light shines toward the ray's origin.
    is_lit: bool,
}

/// Where a ray meets the plane of a light; `None` for lights that have none.
///
/// As by Möller and Trumbore (*Fast, Minimum Storage Ray-Triangle Intersection*, 1997), relative to the shading point.
fn flat_hit(
    light: &Light,
    frame: &InstanceTransform,
    shading_point: &ShadingPoint,
    direction: Vec3,
) -> Option<FlatHit> {
    let (corner, edges, is_parallelogram, two_sided) = match light.shape {
        Shape::Rectangle { center, half_u, half_v, two_sided } => {
            (center - half_u - half_v, [2.0 * half_u, 2.0 * half_v], true, two_sided)
        }
        Shape::Triangle { vertices: [p, q, r], two_sided } => (p, [q - p, r - p], false, two_sided),
        Shape::Point { .. } | Shape::Spot { .. } | Shape::Profile { .. } | Shape::Sphere { .. } => return None,
    };
    let normal_area = frame.normal_area(edges[0].cross(edges[1]));
    let (to_corner, [u, v]) = (frame.toward(corner, shading_point), edges.map(|edge| frame.to_world * edge));
    let across = direction.cross(v);
    let inverse = u.dot(across).recip();
    let around = u.cross(to_corner);
    Some(FlatHit {
        dist: v.dot(around) * inverse,
        place: Vec2::new(-to_corner.dot(across) * inverse, direction.dot(around) * inverse),
        is_parallelogram,
        is_lit: is_lit_side(to_corner, normal_area, two_sided),
    })
}

/// The distance at which a ray hits a light that shines toward the ray's origin, if it is less than `max_dist`.
fn hit_dist(
    light: &Light,
    frame: &InstanceTransform,
    shading_point: &ShadingPoint,
    direction: Vec3,
    max_dist: f32,
) -> Option<f32> {
    let on_sphere = |center: Vec3, radius: f32| {
        let to_center = frame.to_local * frame.toward(center, shading_point);
        let local = frame.to_local * direction;
        let length_sq = local.length_squared();
        let along = to_center.dot(local) / length_sq;
        // From the ray to the centre: a difference of squares would lose digits.
        let beside_sq = (to_center - local * along).length_squared();
        let outside = to_center.length_squared() - radius * radius;
        let half_chord = ((radius * radius - beside_sq).max(0.0) / length_sq).sqrt();
        let is_hit = outside > 0.0 && along > 0.0 && beside_sq <= radius * radius;
        is_hit.then(|| outside / (length_sq * (along + half_chord)))
    };
    let on_surface = |FlatHit { dist, place, is_parallelogram, is_lit }: FlatHit| {
        let farthest = if is_parallelogram { place.max_element() } else { place.x + place.y };
        (place.x >= 0.0 && place.y >= 0.0 && farthest <= 1.0 && is_lit).then_some(dist)
    };
    let dist = match light.shape {
        Shape::Sphere { center, radius } => on_sphere(center, radius),
        _ => flat_hit(light, frame, shading_point, direction).and_then(on_surface),
    };
    let reaches = |dist: &f32| {
        let dist_sq = dist * dist;
        *dist > 0.0 && *dist < max_dist && dist_sq >= MIN_DIST_SQ && range_window(dist_sq, light.range) > 0.0
    };
    dist.filter(reaches).filter(|_| light.flux() > 0.0)
}
