//! Published light trees: binary, with one light per leaf. The build that they share, and the walk that chooses one
//! light or computes the probabilities of all.
//!
//! The build is the surface area orientation heuristic with 12 buckets. Source: Pharr, Jakob and Humphreys, Physically
//! Based Rendering (4th edition), 12.6.3, after Conty Estevez and Kulla, Importance Sampling of Many Lights with Adaptive
//! Tree Splitting (2018), 4.1 and 4.4. Differs: where no split has a cost above 0 (a street of lamps in one line has
//! boxes without area), the lights are halved along their longest axis instead of in their order, which can only help
//! the baseline.

use girandole::cluster::Aabb;
use girandole::glam::{Quat, Vec3};
use girandole::{Light, ShadingPoint, Shape};
use std::f32::consts::{FRAC_PI_2, PI};

const BUCKETS: usize = 12;
/// Set in the target of a leaf, together with the index of its light.
pub(super) const LEAF: u32 = 1 << 31;
/// Added to the emission angle of a spot, in radians, so that a falloff without width does not
/// round to no emission at all.
const SPOT_RIM: f32 = 1.0e-3;

/// Bounds of lights: a box, a cone of normals, an emission angle and a power.
#[derive(Clone, Copy, Debug)]
pub struct LightBounds {
    pub aabb: Aabb,
    /// The axis of the cone of normals, a unit vector.
    pub axis: Vec3,
    /// The half-angle of the cone of normals, in radians.
    pub theta_o: f32,
    /// The angle up to which each light emits, measured from its normal, in radians.
    pub theta_e: f32,
    /// Lumens or candela, depending on the formula.
    pub power: f32,
    /// Lights emit to both sides of their normals.
    pub is_two_sided: bool,
}

impl LightBounds {
    /// Bounds of a light with normals in all directions: a point or a sphere.
    pub fn all_round(light: &Light, power: f32) -> Self {
        Self { theta_o: PI, theta_e: FRAC_PI_2, ..Self::about(light, Vec3::Z, power) }
    }

    /// Bounds of a spot with full emission within `inner` and none beyond `outer` radians. Both
    /// formulas weight emission by a cosine, so the part beyond a right angle counts as normals.
    pub fn spot(light: &Light, direction: Vec3, [inner, outer]: [f32; 2], power: f32) -> Self {
        let theta_e = (outer - inner + SPOT_RIM).min(FRAC_PI_2);
        let theta_o = (outer + SPOT_RIM - theta_e).min(PI);
        Self { theta_o, theta_e, ..Self::about(light, direction.normalize_or(Vec3::Z), power) }
    }

    /// Bounds of a flat Lambertian emitter; one-sided, unless the caller changes that.
    pub fn flat(light: &Light, power: f32) -> Self {
        let normal = match light.shape {
            Shape::Rectangle { half_u, half_v, .. } => half_u.cross(half_v),
            Shape::Triangle { vertices: [a, b, c], .. } => (b - a).cross(c - a),
            _ => Vec3::Z,
        };
        Self { theta_e: FRAC_PI_2, ..Self::about(light, normal.normalize_or(Vec3::Z), power) }
    }

    fn about(light: &Light, axis: Vec3, power: f32) -> Self {
        Self { aabb: light.aabb(), axis, theta_o: 0.0, theta_e: 0.0, power, is_two_sided: false }
    }

    /// Bounds of both groups.
    pub fn union(&self, other: &Self) -> Self {
        let (axis, theta_o) = union_cone((self.axis, self.theta_o), (other.axis, other.theta_o));
        Self {
            aabb: self.aabb.union(&other.aabb),
            axis,
            theta_o,
            theta_e: self.theta_e.max(other.theta_e),
            power: self.power + other.power,
            is_two_sided: self.is_two_sided || other.is_two_sided,
        }
    }

    /// The power times the orientation measure times the surface area.
    pub(super) fn measure(&self) -> f32 {
        let Self { theta_o, theta_e, .. } = *self;
        let theta_w = (theta_o + theta_e).min(PI);
        let (sin_o, cos_o) = theta_o.sin_cos();
        let ring = 2.0 * theta_w * sin_o - (theta_o - 2.0 * theta_w).cos() - 2.0 * theta_o * sin_o + cos_o;
        let orientation = 2.0 * PI * (1.0 - cos_o) + 0.5 * PI * ring;
        let Vec3 { x, y, z } = self.aabb.extent();
        self.power * orientation * 2.0 * (x * y + y * z + z * x)
    }
}

/// The smallest cone around two cones. Opposite axes give all directions.
fn union_cone(a: (Vec3, f32), b: (Vec3, f32)) -> (Vec3, f32) {
    let (a, b) = if a.1 >= b.1 { (a, b) } else { (b, a) };
    let between = 2.0 * (a.0 - b.0).length().atan2((a.0 + b.0).length());
    if (between + b.1).min(PI) <= a.1 {
        return a;
    }
    let theta = 0.5 * (a.1 + between + b.1);
    match a.0.cross(b.0).try_normalize() {
        Some(turn) if theta < PI => ((Quat::from_axis_angle(turn, theta - a.1) * a.0).normalize(), theta),
        // Except for rounding, equal axes mean that one cone contains the other. Opposite axes have
        // no plane to turn in.
        None if between < 1.0 => (a.0, theta),
        _ => (a.0, PI),
    }
}

/// The importance that a published sampler gives to groups of lights.
pub trait Formula: Sync {
    /// The bounds in the form that a node stores.
    type Bounds: Copy + Send + Sync;

    /// The bounds of one light.
    fn bounds(light: &Light) -> LightBounds;

    /// Converts bounds to the stored form.
    fn pack(bounds: &LightBounds) -> Self::Bounds;

    /// The probability of the first of two children; each comes with its light if it is a leaf.
    /// `None` if neither sends light.
    fn first_probability(&self, children: [(&Self::Bounds, Option<&Light>); 2], at: &ShadingPoint) -> Option<f32>;
}

/// A node. The first child of an inner node is the next node.
#[derive(Clone, Copy)]
pub(super) struct Node<B> {
    pub bounds: B,
    /// The index of the second child, or [`LEAF`] and the index of a light.
    pub target: u32,
}

/// A binary tree with one light per leaf.
pub struct BinaryTree<F: Formula> {
    formula: F,
    pub(super) lights: Vec<Light>,
    pub(super) nodes: Vec<Node<F::Bounds>>,
}

impl<F: Formula> BinaryTree<F> {
    /// Builds a tree over lights in world space. Lights without power are left out.
    pub fn new(formula: F, lights: Vec<Light>) -> Self {
        Self::over(formula, lights, |light| light.power > 0.0)
    }

    /// Builds a tree over all lights, of which some may get their power later.
    pub fn with_dark_lights(formula: F, lights: Vec<Light>) -> Self {
        Self::over(formula, lights, |_| true)
    }

    fn over(formula: F, lights: Vec<Light>, is_kept: impl Fn(&LightBounds) -> bool) -> Self {
        let nodes = build::<F>(&lights, is_kept);
        let packed = nodes.iter().map(|node| Node { bounds: F::pack(&node.bounds), target: node.target });
        Self { formula, nodes: packed.collect(), lights }
    }

    /// The size of all nodes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
    }

    /// Chooses a light and returns its index and probability. `u` in [0, 1) is an f64, so that
    /// choices deep in the tree are still random.
    pub fn pick(&self, at: &ShadingPoint, mut u: f64) -> Option<(u32, f32)> {
        let (mut index, mut pmf) = (0, 1.0);
        loop {
            let node = self.nodes.get(index)?;
            if node.target & LEAF != 0 {
                return Some((node.target & !LEAF, pmf));
            }
            let first = self.first_probability(index, at)?;
            let share = f64::from(first);
            if u < share {
                (index, u) = (index + 1, u / share);
                pmf *= first;
            } else {
                (index, u) = (node.target as usize, (u - share) / (1.0 - share));
                pmf *= 1.0 - first;
            }
            u = u.min(1.0 - f64::EPSILON);
        }
    }

    /// The probability of each light. NaN below a node whose importances are infinite or NaN.
    pub fn pmfs(&self, at: &ShadingPoint) -> Vec<f32> {
        let mut pmfs = vec![0.0; self.lights.len()];
        let mut open = if self.nodes.is_empty() { Vec::new() } else { vec![(0, 1.0)] };
        while let Some((index, pmf)) = open.pop() {
            let target = self.nodes[index].target;
            if target & LEAF != 0 {
                pmfs[(target & !LEAF) as usize] = pmf;
            } else if let Some(first) = self.first_probability(index, at) {
                let both = [(index + 1, pmf * first), (target as usize, pmf * (1.0 - first))];
                open.extend(both.into_iter().filter(|(_, pmf): &(usize, f32)| *pmf > 0.0 || pmf.is_nan()));
            }
        }
        pmfs
    }

    fn first_probability(&self, parent: usize, at: &ShadingPoint) -> Option<f32> {
        let children = [parent + 1, self.nodes[parent].target as usize].map(|index| {
            let node = &self.nodes[index];
            let light = (node.target & LEAF != 0).then(|| &self.lights[(node.target & !LEAF) as usize]);
            (&node.bounds, light)
        });
        self.formula.first_probability(children, at)
    }
}

/// Builds a tree over those lights whose bounds are kept.
pub(super) fn build<F: Formula>(lights: &[Light], is_kept: impl Fn(&LightBounds) -> bool) -> Vec<Node<LightBounds>> {
    let bounds = (0..).zip(lights).map(|(index, light)| (index, F::bounds(light)));
    let mut kept: Vec<(u32, LightBounds)> = bounds.filter(|(_, light)| is_kept(light)).collect();
    let mut nodes = Vec::with_capacity(2 * kept.len());
    if !kept.is_empty() {
        build_below(&mut kept, &mut nodes);
    }
    nodes
}

fn build_below(lights: &mut [(u32, LightBounds)], nodes: &mut Vec<Node<LightBounds>>) {
    let own = nodes.len();
    if let [(light, bounds)] = lights {
        nodes.push(Node { bounds: *bounds, target: LEAF | *light });
        return;
    }
    let bounds = lights[1..].iter().fold(lights[0].1, |all, (_, light)| all.union(light));
    let middle = split(lights, &bounds.aabb);
    nodes.push(Node { bounds, target: 0 });
    let (first, second) = lights.split_at_mut(middle);
    build_below(first, nodes);
    nodes[own].target = nodes.len() as u32;
    build_below(second, nodes);
}

/// Sorts the lights into two groups and returns the start of the second.
fn split(lights: &mut [(u32, LightBounds)], aabb: &Aabb) -> usize {
    let centers = Aabb::around(lights.iter().map(|(_, light)| light.aabb.center()));
    let bucket = |light: &LightBounds, axis: usize| {
        let along = (light.aabb.center()[axis] - centers.min[axis]) / centers.extent()[axis];
        ((along * BUCKETS as f32) as usize).min(BUCKETS - 1)
    };
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in (0..3).filter(|axis| centers.extent()[*axis] > 0.0) {
        let mut buckets = [None; BUCKETS];
        for (_, light) in lights.iter() {
            let bucket = &mut buckets[bucket(light, axis)];
            *bucket = join(*bucket, Some(*light));
        }
        let stretch = aabb.extent().max_element() / aabb.extent()[axis];
        for last in 0..BUCKETS - 1 {
            let [below, above] = [&buckets[..=last], &buckets[last + 1..]]
                .map(|side| side.iter().copied().fold(None, join).map_or(0.0, |side| side.measure()));
            let cost = stretch * (below + above);
            if cost > 0.0 && best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, axis, last));
            }
        }
    }
    if let Some((_, axis, last)) = best {
        lights.sort_by_key(|(_, light)| bucket(light, axis) > last);
        let middle = lights.partition_point(|(_, light)| bucket(light, axis) <= last);
        if middle > 0 && middle < lights.len() {
            return middle;
        }
    }
    let extent = centers.extent();
    let axis = (0..3).max_by(|a, b| extent[*a].total_cmp(&extent[*b])).unwrap_or(0);
    let middle = lights.len() / 2;
    lights.select_nth_unstable_by(middle, |(i, a), (j, b)| {
        a.aabb.center()[axis].total_cmp(&b.aabb.center()[axis]).then(i.cmp(j))
    });
    middle
}

fn join(a: Option<LightBounds>, b: Option<LightBounds>) -> Option<LightBounds> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.union(&b)),
        (a, b) => a.or(b),
    }
}
