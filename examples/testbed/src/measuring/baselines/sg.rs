//! The light tree of spherical Gaussians.
//!
//! Source: Tokuyoshi, Ikeda, Kulkarni and Harada, Hierarchical Light Sampling with Accurate
//! Spherical Gaussian Lighting (SIGGRAPH Asia 2024), with its supplement. A group of lights is one
//! Gaussian of position and one spherical Gaussian of direction; what it sends to a surface is
//! approximated in closed form, for a Lambertian and for a GGX part.
//!
//! SG means spherical Gaussian: exp(sharpness (cos - 1)), where cos is that of the angle to an axis.
//!
//! The authors' tree is binary, with one light per leaf here. The same importance also chooses on
//! the eight-wide topology of this library, with a cut as that of its own sampler: up to a number
//! of splits, the group that may be wrong by most is replaced by its children.
//!
//! Differs, each time for the better:
//! - groups whose box is below the horizon have no importance (mean sigma of the binary tree on
//!   Bistro 0.72 instead of 1.39, on city S 2.24 instead of 2.39);
//! - the specular reflectance rises toward grazing angles by Schlick's formula;
//! - the lobe's axis for the visibility is the reflection about the dominant visible normal
//!   instead of the normal, as in the authors' later code.

mod gaussian;

use super::pbrt::Pbrt;
use super::tree::{LEAF, build};
use gaussian::{cosine_integral, exp, integral, max, peak, share_above, sharpness_of};
use girandole::cluster::Aabb;
use girandole::glam::{DVec3, Vec3};
use girandole::tree::{ChildRef, WIDTH};
use girandole::{Gloss, Light, LightTree, ShadingPoint};
use std::f32::consts::PI;

/// The greatest number of splits of a cut.
const MAX_SPLITS: usize = 6;
/// The nodes whose children may be chosen.
const MAX_NODES: usize = MAX_SPLITS + 1;
/// The mark of a lane without a child.
const NO_CHILD: u32 = u32::MAX;

/// Up to `N` children.
#[derive(Clone, Copy)]
struct Node<const N: usize> {
    lights: GaussianLights<N>,
    /// For each child the index of its node, or [`LEAF`] and the index of a light, or [`NO_CHILD`].
    children: [u32; N],
}

/// A tree of nodes with up to `N` children, which are computed in `LANES`. The root is the first
/// node.
pub struct GaussianTree<const N: usize, const LANES: usize> {
    nodes: Vec<Node<N>>,
    light_count: usize,
    splits: usize,
}

impl GaussianTree<2, 4> {
    /// The binary tree of pbrt-v4's build, without splits. Lights without power are left out.
    pub fn binary(lights: &[Light]) -> Self {
        let built = build::<Pbrt>(lights, |bounds| bounds.power > 0.0);
        let inner: Vec<usize> = (0..built.len()).filter(|node| built[*node].target & LEAF == 0).collect();
        let child = |node: usize| match built[node].target {
            leaf if leaf & LEAF != 0 => leaf,
            _ => inner.partition_point(|other| *other < node) as u32,
        };
        let mut children: Vec<[u32; 2]> =
            inner.iter().map(|node| [child(node + 1), child(built[*node].target as usize)]).collect();
        if let [only] = built.as_slice() {
            children.push([only.target, NO_CHILD]);
        }
        Self::over(lights, &children, 0)
    }
}

impl GaussianTree<WIDTH, WIDTH> {
    /// The shape of a tree over the same lights, with six splits.
    pub fn wide(tree: &LightTree) -> Self {
        let child = |child| match child {
            Some(ChildRef::Node(node)) => node,
            Some(ChildRef::Leaf(light)) => LEAF | light,
            _ => NO_CHILD,
        };
        let children: Vec<[u32; WIDTH]> =
            tree.nodes().iter().map(|node| std::array::from_fn(|slot| child(node.child(slot)))).collect();
        Self::over(tree.lights(), &children, MAX_SPLITS)
    }
}

impl<const N: usize, const LANES: usize> GaussianTree<N, LANES> {
    fn over(lights: &[Light], children: &[[u32; N]], splits: usize) -> Self {
        let dark = Node { lights: GaussianLights::DARK, children: [NO_CHILD; N] };
        let mut nodes = vec![dark; children.len()];
        if !nodes.is_empty() {
            sum_up(lights, children, &mut nodes, 0);
        }
        Self { nodes, light_count: lights.len(), splits }
    }

    /// The size of all nodes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
    }

    /// Chooses a light and returns its index and probability; `None` if no group has importance.
    /// `u` in [0, 1) is an f64, so that choices deep in the tree are still random.
    pub fn pick(&self, at: &ShadingPoint, u: f64) -> Option<(u32, f32)> {
        with_vectors(
            #[inline(always)]
            || self.walk(at, u),
        )
    }

    #[inline(always)]
    fn walk(&self, at: &ShadingPoint, u: f64) -> Option<(u32, f32)> {
        let surface = Surface::of(at);
        let cut = self.cut(&surface)?;
        let weights = cut.weights[..cut.count].as_flattened();
        let (place, mut pmf, mut u) = choose(weights, u)?;
        let mut child = self.nodes[cut.nodes[place / N] as usize].children[place % N];
        while child & LEAF == 0 {
            let node = &self.nodes[child as usize];
            let (lane, share, rest) = choose(&self.groups(&surface, node).importances, u)?;
            (child, pmf, u) = (node.children[lane], pmf * share, rest);
        }
        Some((child & !LEAF, pmf))
    }

    /// The probability of each light.
    pub fn pmfs(&self, at: &ShadingPoint) -> Vec<f32> {
        let mut pmfs = vec![0.0; self.light_count];
        let surface = Surface::of(at);
        let Some(cut) = self.cut(&surface) else { return pmfs };
        let mut open = Vec::new();
        let mut visit = |open: &mut Vec<(u32, f32)>, children: &[u32], weights: &[f32], (pmf, total): (f32, f32)| {
            for (child, weight) in children.iter().zip(weights).filter(|(_, weight)| **weight > 0.0) {
                let pmf = pmf * (weight / total);
                match child & LEAF {
                    0 => open.push((*child, pmf)),
                    _ => pmfs[(child & !LEAF) as usize] = pmf,
                }
            }
        };
        let total = cut.weights[..cut.count].as_flattened().iter().sum();
        for (node, weights) in cut.nodes.iter().zip(&cut.weights[..cut.count]) {
            visit(&mut open, &self.nodes[*node as usize].children, weights, (1.0, total));
        }
        while let Some((node, pmf)) = open.pop() {
            let node = &self.nodes[node as usize];
            let weights = self.groups(&surface, node).importances;
            visit(&mut open, &node.children, &weights, (pmf, weights.iter().sum()));
        }
        pmfs
    }

    #[inline(always)]
    fn groups(&self, surface: &Surface, node: &Node<N>) -> Groups<N> {
        let Groups { importances, doubts } = surface.groups::<N, LANES>(&node.lights);
        Groups { importances: std::array::from_fn(|i| importances[i]), doubts: std::array::from_fn(|i| doubts[i]) }
    }

    /// Splits the root and then the groups that may be wrong by most. `None` without lights.
    #[inline(always)]
    fn cut(&self, surface: &Surface) -> Option<Cut<N>> {
        let mut cut = Cut { nodes: [0; MAX_NODES], weights: [[0.0; N]; MAX_NODES], count: 0 };
        let mut doubts = [[0.0; N]; MAX_NODES];
        let mut next = (!self.nodes.is_empty()).then_some(0)?;
        loop {
            let node = &self.nodes[next as usize];
            let Groups { importances, doubts: own } = self.groups(surface, node);
            for lane in 0..N {
                doubts[cut.count][lane] = if node.children[lane] & LEAF == 0 { own[lane] } else { 0.0 };
            }
            (cut.nodes[cut.count], cut.weights[cut.count]) = (next, importances);
            cut.count += 1;
            if cut.count > self.splits {
                return Some(cut);
            }
            let (mut most, mut place) = (0.0, 0);
            for (other, doubt) in doubts[..cut.count].as_flattened().iter().enumerate() {
                (most, place) = if *doubt > most { (*doubt, other) } else { (most, place) };
            }
            if most <= 0.0 {
                return Some(cut);
            }
            next = self.nodes[cut.nodes[place / N] as usize].children[place % N];
            (cut.weights[place / N][place % N], doubts[place / N][place % N]) = (0.0, 0.0);
        }
    }
}

/// Sets a node and all below it. `None` if no light there has power.
fn sum_up<const N: usize>(
    lights: &[Light],
    children: &[[u32; N]],
    nodes: &mut [Node<N>],
    index: usize,
) -> Option<Moments> {
    let mut all: Option<Moments> = None;
    for (lane, child) in children[index].into_iter().enumerate().filter(|(_, child)| *child != NO_CHILD) {
        let group = match child & LEAF {
            0 => sum_up(lights, children, nodes, child as usize),
            _ => Moments::of(&lights[(child & !LEAF) as usize]),
        };
        nodes[index].children[lane] = child;
        let Some(group) = group else { continue };
        nodes[index].lights.set(lane, &group);
        all = Some(all.map_or(group, |all| all.union(&group)));
    }
    all
}

/// The nodes whose children one light is chosen among.
struct Cut<const N: usize> {
    nodes: [u32; MAX_NODES],
    /// The importance of each child; 0 where its own children take its place.
    weights: [[f32; N]; MAX_NODES],
    count: usize,
}

/// Chooses one of some weights by a number in [0, 1). Returns its place, its probability, and a new
/// number in [0, 1); `None` if all weights are 0.
#[inline(always)]
fn choose(weights: &[f32], u: f64) -> Option<(usize, f32, f64)> {
    let total: f32 = weights.iter().sum();
    let point = u * f64::from(total);
    let (mut before, mut chosen) = (0.0, None);
    for (place, weight) in weights.iter().enumerate() {
        // If rounding lets the point pass all of them, the last with a weight is chosen.
        if *weight > 0.0 && point >= before {
            chosen = Some((place, *weight, before));
        }
        before += f64::from(*weight);
    }
    let (place, weight, before) = chosen?;
    let rest = (point - before) / f64::from(weight);
    Some((place, weight / total, rest.clamp(0.0, 1.0 - f64::EPSILON)))
}

/// The mean direction of emission of one light is at most as long as that of a Lambertian emitter,
/// the mean of a cosine. Narrower lobes, which are true to spots, hide a lamp beside the middle of
/// its group: mean sigma on city S is then 5e15, and on Bistro 32 instead of 0.68. The authors'
/// code has 1/2 for Lambertian emitters: 2.6 instead of 2.2 on city S.
const MAX_LENGTH: f64 = 2.0 / 3.0;

/// A group of lights with some power.
#[derive(Clone, Copy, Debug)]
struct Moments {
    /// In lumens.
    power: f64,
    mean: DVec3,
    /// The trace of the covariance of position, in square metres.
    variance: f64,
    /// The mean direction of emission.
    axis: DVec3,
    aabb: Aabb,
    /// The radius of a sphere about the mean around all lights, in metres.
    radius: f64,
}

impl Moments {
    /// The moments of one light; `None` without power.
    fn of(light: &Light) -> Option<Self> {
        let cluster = light.cluster();
        let mean = cluster.mean.as_dvec3();
        let axis = cluster.axis.as_dvec3().clamp_length_max(MAX_LENGTH);
        let power = f64::from(cluster.flux);
        let own = Self { power, mean, variance: f64::from(cluster.variance), axis, aabb: cluster.aabb, radius: 0.0 };
        (cluster.flux > 0.0).then(|| Self { radius: own.farthest(), ..own })
    }

    /// The moments of both groups.
    fn union(&self, other: &Self) -> Self {
        let power = self.power + other.power;
        let [a, b] = [self.power / power, other.power / power];
        let mean = self.mean * a + other.mean * b;
        let between = a * self.mean.distance_squared(mean) + b * other.mean.distance_squared(mean);
        let both = Self {
            power,
            mean,
            variance: a * self.variance + b * other.variance + between,
            axis: self.axis * a + other.axis * b,
            aabb: self.aabb.union(&other.aabb),
            radius: 0.0,
        };
        let reach = |group: &Self| group.mean.distance(mean) + group.radius;
        Self { radius: both.farthest().min(reach(self).max(reach(other))), ..both }
    }

    /// The distance of the farthest corner of the box.
    fn farthest(&self) -> f64 {
        let [min, max] = [self.aabb.min.as_dvec3() - self.mean, self.aabb.max.as_dvec3() - self.mean];
        min.abs().max(max.abs()).length()
    }
}

// The rows of [`GaussianLights`]. A vector has three.

/// The mean position, in metres.
const MEAN: usize = 0;
/// The unit vector against the mean direction of emission.
const AXIS: usize = 3;
/// The middle of the box.
const CENTER: usize = 6;
/// Half of the edges of the box.
const HALF: usize = 9;
/// The variance of position across the view, in square metres: half of the trace of the
/// covariance, because the authors take lights to lie in a plane.
const VARIANCE: usize = 12;
/// The greatest variance that the bounding sphere allows.
const MOST_VARIANCE: usize = 13;
/// The sharpness of the emission.
const SHARPNESS: usize = 14;
/// The intensity along the mean direction over 2 pi, in candela.
const INTENSITY: usize = 15;

/// [`INTENSITY`] is the last row, and one without values follows: see [`GaussianLights::row`].
const ROWS: usize = 17;

/// Groups of lights side by side, one per lane. Lanes without lights have no intensity.
#[derive(Clone, Copy, Debug)]
struct GaussianLights<const N: usize> {
    rows: [[f32; N]; ROWS],
}

impl<const N: usize> GaussianLights<N> {
    const DARK: Self = Self { rows: [[0.0; N]; ROWS] };

    /// A value of a lane. Lanes from `N` up to twice `N` have values of the next row: what is computed from them
    /// is not used, but the loop over them is as wide as a vector.
    #[inline(always)]
    fn row(&self, row: usize, lane: usize) -> f32 {
        self.rows.as_flattened()[row * N + lane]
    }

    fn set(&mut self, lane: usize, group: &Moments) {
        let sharpness = sharpness_of(group.axis.length() as f32);
        let axis = -group.axis.normalize_or(DVec3::NEG_Z).as_vec3();
        let Aabb { min, max } = group.aabb;
        let vectors =
            [(MEAN, group.mean.as_vec3()), (AXIS, axis), (CENTER, 0.5 * (min + max)), (HALF, 0.5 * (max - min))];
        for (row, vector) in vectors {
            (0..3).for_each(|k| self.rows[row + k][lane] = vector[k]);
        }
        self.rows[VARIANCE][lane] = (0.5 * group.variance) as f32;
        self.rows[MOST_VARIANCE][lane] = (0.5 * group.radius * group.radius) as f32;
        self.rows[SHARPNESS][lane] = sharpness;
        self.rows[INTENSITY][lane] = (group.power / (2.0 * std::f64::consts::PI)) as f32 * peak(sharpness);
    }
}

/// The greatest sharpness of the lobe in which a group is seen: a milliradian. The authors have
/// 2^31; the products of the tails of such lobes are denormal numbers.
const MAX_SHARPNESS: f32 = 1_048_576.0;
/// The least variance in square metres and squared distance; quotients stay finite.
const LEAST_SQ: f32 = 1.0e-20;
/// The share of the variance that limits the doubt about a group around the shading point.
const NEAR_SHARE: f32 = 0.02;
/// The least cosine between view and normal, and the least alpha of GGX.
const LEAST_COSINE: f32 = 1.0e-2;
const LEAST_ALPHA: f32 = 1.0e-3;

/// A shading point with what all nodes need of it.
#[derive(Clone, Copy, Debug)]
struct Surface {
    position: Vec3,
    /// A unit vector; zero in a volume.
    normal: Vec3,
    gloss: Option<Glossy>,
}

/// What groups of lights send to a viewer.
struct Groups<const N: usize> {
    importances: [f32; N],
    /// How much each importance may be wrong by.
    doubts: [f32; N],
}

/// A specular part.
#[derive(Clone, Copy, Debug)]
struct Glossy {
    diffuse: f32,
    /// The reflectance at normal incidence.
    specular: f32,
    /// The tangent in the plane of the view and the normal, and the one across it.
    tangents: [Vec3; 2],
    /// The view along the tangent and along the normal.
    view: [f32; 2],
    /// The squared roughness of the projected distribution of half vectors.
    roughness_sq: f32,
    /// How much the variance of directions widens it across the plane of the view; in the plane it
    /// is 1/2.
    widening: f32,
    /// The axis of the reflected lobe times its sharpness.
    lobe: Vec3,
}

impl Surface {
    fn of(at: &ShadingPoint) -> Self {
        let normal = at.normal.normalize_or_zero();
        Self { position: at.position, normal, gloss: at.gloss.as_ref().and_then(|gloss| Glossy::of(gloss, normal)) }
    }

    /// What groups of lights send to the viewer by this surface. `LANES` groups are computed
    /// together, of which the first `N` are wanted: two alone fill no vector.
    #[inline(always)]
    fn groups<const N: usize, const LANES: usize>(&self, lights: &GaussianLights<N>) -> Groups<LANES> {
        match &self.gloss {
            None => self.each(lights, None),
            Some(gloss) => self.each(lights, Some(gloss)),
        }
    }

    #[inline(always)]
    fn each<const N: usize, const LANES: usize>(
        &self,
        lights: &GaussianLights<N>,
        gloss: Option<&Glossy>,
    ) -> Groups<LANES> {
        let (position, normal) = (self.position.to_array(), self.normal.to_array());
        let is_surface = self.normal != Vec3::ZERO;
        let mut groups = Groups { importances: [0.0; LANES], doubts: [0.0; LANES] };
        for i in 0..LANES {
            let (mut toward, mut axis) = ([0.0; 3], [0.0; 3]);
            let (mut dist_sq, mut along, mut highest, mut gap_sq) = (0.0, 0.0, 0.0, 0.0);
            for k in 0..3 {
                toward[k] = lights.row(MEAN + k, i) - position[k];
                axis[k] = lights.row(AXIS + k, i);
                dist_sq += toward[k] * toward[k];
                along += normal[k] * toward[k];
                let (center, half) = (lights.row(CENTER + k, i) - position[k], lights.row(HALF + k, i));
                highest += normal[k] * center + normal[k].abs() * half;
                let gap = max(center.abs() - half, 0.0);
                gap_sq += gap * gap;
            }
            let dist_sq = max(dist_sq, LEAST_SQ);
            let inverse = 1.0 / dist_sq.sqrt();
            // A mean below the horizon hides what is above it: there, as wide as the sphere allows.
            let depth = max(-along * inverse, 0.0);
            let variance = lights.row(VARIANCE, i) + (lights.row(MOST_VARIANCE, i) - lights.row(VARIANCE, i)) * depth;
            let variance = max(max(variance, dist_sq * (1.0 / MAX_SHARPNESS)), LEAST_SQ);
            let inverse_variance = 1.0 / variance;

            // The product of the lobe in which the group is seen and of its emission.
            let own = lights.row(SHARPNESS, i);
            let seen = dist_sq * inverse_variance;
            let facing = (axis[0] * toward[0] + axis[1] * toward[1] + axis[2] * toward[2]) * inverse;
            let mut sharpness_sq = 0.0;
            for k in 0..3 {
                axis[k] = axis[k] * own + toward[k] * (seen * inverse);
                sharpness_sq += axis[k] * axis[k];
            }
            let sharpness = max(sharpness_sq, LEAST_SQ).sqrt();
            let inverse_sharpness = 1.0 / sharpness;
            let amplitude = exp(-2.0 * own * seen * max(1.0 - facing, 0.0) / (sharpness + own + seen));
            for k in 0..3 {
                axis[k] *= inverse_sharpness;
            }
            let cosine = normal[0] * axis[0] + normal[1] * axis[1] + normal[2] * axis[2];

            let diffuse = if is_surface { cosine_integral(cosine, sharpness) } else { integral(sharpness) };
            let reflected = match gloss {
                None => diffuse,
                Some(gloss) => gloss.diffuse * diffuse + gloss.reflected(axis, sharpness, cosine, normal),
            };
            let importance = lights.row(INTENSITY, i) * inverse_variance * amplitude * reflected;
            let importance = if is_surface & (highest <= 0.0) { 0.0 } else { importance };
            groups.importances[i] = importance;
            // The doubt of this library's cut: greater where the box is nearer than the mean. The
            // angular size alone has a mean sigma of 1.24 instead of 1.17 on city S.
            let total = 2.0 * lights.row(VARIANCE, i);
            let nearer = (dist_sq + 0.5 * total) / max(gap_sq + NEAR_SHARE * total, LEAST_SQ);
            groups.doubts[i] = importance * nearer * (total / (dist_sq + total));
        }
        groups
    }
}

impl Glossy {
    /// `None` if the surface is matte.
    fn of(gloss: &Gloss, normal: Vec3) -> Option<Self> {
        let view = gloss.view.try_normalize()?;
        if normal == Vec3::ZERO || gloss.specular <= 0.0 {
            return None;
        }
        let cosine = view.dot(normal).max(LEAST_COSINE);
        let across = view - normal * view.dot(normal);
        let tangent = across.try_normalize().unwrap_or_else(|| normal.any_orthonormal_vector());
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        let alpha = (gloss.roughness * gloss.roughness).clamp(LEAST_ALPHA, 0.999);
        let alpha_sq = alpha * alpha;
        // The dominant visible normal: the middle of the cap of visible normals.
        let height = cosine + (alpha_sq * sine * sine + cosine * cosine).sqrt();
        let facet = (tangent * (alpha_sq * sine) + normal * height).normalize();
        let view = tangent * sine + normal * cosine;
        let mirrored = facet * (2.0 * view.dot(facet)) - view;
        Some(Self {
            diffuse: gloss.diffuse,
            specular: gloss.specular.min(1.0),
            tangents: [tangent, normal.cross(tangent)],
            view: [sine, cosine],
            roughness_sq: alpha_sq / (1.0 - alpha_sq),
            widening: 0.5 / (cosine * cosine),
            lobe: mirrored * ((1.0 - alpha_sq) / (2.0 * alpha_sq)),
        })
    }

    /// The integral of an SG with a peak of 1 times BRDF and cosine. `cosine` is that of its axis
    /// and the normal.
    #[inline(always)]
    fn reflected(&self, axis: [f32; 3], sharpness: f32, cosine: f32, normal: [f32; 3]) -> f32 {
        let dot = |v: Vec3| v.x * axis[0] + v.y * axis[1] + v.z * axis[2];
        let [view_x, view_z] = self.view;
        // The distribution of half vectors, widened by the light's variance of direction. The
        // matrix of the paper is diagonal in the plane of the view.
        let variance = 1.0 / sharpness;
        let wide_x = self.roughness_sq + 0.5 * variance;
        let wide_y = self.roughness_sq + self.widening * variance;
        let (alpha_x_sq, alpha_y_sq) = (wide_x / (1.0 + wide_x), wide_y / (1.0 + wide_y));
        let (x, y, z) = (dot(self.tangents[0]) + view_x, dot(self.tangents[1]), cosine + view_z);
        let length_sq = max(x * x + y * y + z * z, LEAST_SQ);
        let stretched = (x * x / alpha_x_sq + y * y / alpha_y_sq + z * z) / length_sq;
        let projected = (alpha_x_sq * (view_x * view_x) + view_z * view_z).sqrt();
        let density = 1.0 / (4.0 * PI * (alpha_x_sq * alpha_y_sq).sqrt() * (stretched * stretched) * projected);
        let grazing = max(1.0 - 0.5 * length_sq.sqrt(), 0.0);
        let grazing_sq = grazing * grazing;
        let fresnel = self.specular + (1.0 - self.specular) * (grazing_sq * grazing_sq * grazing);

        // The part of the product of both lobes above the horizon.
        let (mut product_sq, mut product_along) = (0.0, 0.0);
        for k in 0..3 {
            let product = self.lobe[k] + axis[k] * sharpness;
            product_sq += product * product;
            product_along += product * normal[k];
        }
        let product = max(product_sq, LEAST_SQ).sqrt();
        fresnel * density * share_above(product_along / product, product) * integral(sharpness)
    }
}

/// Runs a job with the vector instructions of the machine, as the library does for its own (src/math/simd.rs), so that
/// times compare: with AVX2 if the machine has it. All that it calls must be `#[inline(always)]`.
#[inline]
fn with_vectors<T>(job: impl FnOnce() -> T) -> T {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        fn with_avx2<T>(job: impl FnOnce() -> T) -> T {
            job()
        }
        if std::is_x86_feature_detected!("avx2") {
            // SAFETY: the machine has AVX2, as just detected. The function requires nothing else.
            #[allow(
                unsafe_code,
                reason = "the only way to call a function that needs a CPU feature detected at run time"
            )]
            return unsafe { with_avx2(job) };
        }
    }
    job()
}

#[cfg(test)]
mod tests;
