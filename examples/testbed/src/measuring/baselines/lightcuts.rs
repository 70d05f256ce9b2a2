//! The light tree and the cuts of real-time stochastic lightcuts.
//!
//! Source: Lin and Yuksel, Real-Time Stochastic Lightcuts (I3D 2020), with Yuksel, Stochastic Lightcuts
//! (HPG 2019), for the choice below a cut, and Walter et al., Lightcuts (2005), for the bounds. A perfect
//! binary tree over the lights in Morton order; a cut opens the node with the largest bound until it has
//! enough nodes; below a node, the chance of a child is the mean of two estimates, by the nearest and by
//! the farthest point of its box. Differs: intensities are fluxes.

use crate::measuring::emitter::{Emitter, Form, RealAabb};
use girandole::glam::Vec3;
use girandole::{Light, ShadingPoint};
use std::f32::consts::PI;

/// The nodes of a cut, at most. Each sample takes one of them.
pub const CUT: usize = 16;
/// The root.
const ROOT: u32 = 1;
/// Distances below this share of the radius of all lights count as that share in the bound of an error.
const NEAREST: f32 = 1.0e-3;
/// The leaf of no light.
const NO_LIGHT: u32 = u32::MAX;
/// Bits of a Morton code along each axis.
const MORTON_BITS: u32 = 20;

/// A group of lights.
#[derive(Clone, Copy)]
struct Node {
    min: Vec3,
    max: Vec3,
    flux: f32,
    /// The axis of the cone of normals, and its half-angle in radians.
    axis: Vec3,
    half_angle: f32,
}

/// No lights.
const EMPTY: Node = Node { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY, flux: 0.0, axis: Vec3::Z, half_angle: 0.0 };

/// A perfect binary tree: node i has the children 2 i and 2 i + 1.
pub struct LightcutTree {
    nodes: Vec<Node>,
    /// The lights of the leaves, which are the last half of the nodes.
    leaves: Vec<u32>,
    /// The squared distance of [`NEAREST`].
    nearest_sq: f32,
}

impl LightcutTree {
    /// Builds a tree over lights in world space. O(n log n).
    pub fn new(lights: &[Light]) -> Self {
        let emitters: Vec<Emitter<f32>> = lights.iter().map(Emitter::from).collect();
        let lit: Vec<u32> = (0..).zip(lights).filter(|(_, light)| light.flux() > 0.0).map(|(index, _)| index).collect();
        let center = |index: u32| emitters[index as usize].aabb().center();
        let centers: Vec<Vec3> = lit.iter().map(|index| center(*index)).collect();
        let (min, max) = centers.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(a, b), c| (a.min(*c), b.max(*c)));
        let mut leaves: Vec<u32> = lit;
        leaves.sort_by_cached_key(|index| (morton(center(*index), min, max), *index));
        let count = leaves.len().next_power_of_two().max(1);
        leaves.resize(count, NO_LIGHT);
        let mut nodes = vec![EMPTY; 2 * count];
        for (node, index) in nodes[count..].iter_mut().zip(&leaves) {
            if *index != NO_LIGHT {
                *node = Node::new(&emitters[*index as usize]);
            }
        }
        for index in (1..count).rev() {
            nodes[index] = nodes[2 * index].union(&nodes[2 * index + 1]);
        }
        let root = nodes[ROOT as usize % nodes.len()];
        let radius = if root.flux > 0.0 { 0.5 * (root.max - root.min).length() } else { 0.0 };
        Self { nodes, leaves, nearest_sq: (NEAREST * radius).powi(2).max(f32::MIN_POSITIVE) }
    }

    /// The size of all nodes.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.leaves[..])
    }

    /// Fills in the cut of a shading point: nodes that together hold all lights.
    pub fn cut(&self, at: &ShadingPoint, cut: &mut Vec<u32>) {
        let mut errors = [0.0; CUT];
        cut.clear();
        if self.nodes[ROOT as usize].flux <= 0.0 {
            return;
        }
        cut.push(ROOT);
        errors[0] = f32::INFINITY;
        while cut.len() < CUT {
            let largest = errors[..cut.len()].iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
            let Some((place, error)) = largest else { return };
            // Leaves have no error.
            if *error <= 0.0 || self.is_leaf(cut[place]) {
                return;
            }
            let child = 2 * cut[place];
            (cut[place], errors[place]) = (child, self.error(child, at));
            if self.nodes[child as usize + 1].flux > 0.0 {
                errors[cut.len()] = self.error(child + 1, at);
                cut.push(child + 1);
            }
        }
    }

    /// Chooses a light below a node and returns its index and probability. `u` in [0, 1). `None` where
    /// the bounds say that no light arrives.
    pub fn pick(&self, node: u32, at: &ShadingPoint, mut u: f64) -> Option<(u32, f32)> {
        let (mut node, mut pmf) = (node, 1.0);
        while !self.is_leaf(node) {
            let first = f64::from(self.first_probability(node, at)?);
            if u < first {
                (node, u, pmf) = (2 * node, u / first, pmf * first);
            } else {
                (node, u, pmf) = (2 * node + 1, (u - first) / (1.0 - first), pmf * (1.0 - first));
            }
            u = u.min(1.0 - f64::EPSILON);
        }
        Some((self.leaves[node as usize - self.leaves.len()], pmf as f32))
    }

    /// Adds the probability of each light below a node that has a probability itself.
    pub fn add_pmfs(&self, node: u32, at: &ShadingPoint, pmf: f64, pmfs: &mut [f32]) {
        let mut open = vec![(node, pmf)];
        while let Some((node, pmf)) = open.pop() {
            if self.is_leaf(node) {
                pmfs[self.leaves[node as usize - self.leaves.len()] as usize] += pmf as f32;
            } else if let Some(first) = self.first_probability(node, at).map(f64::from) {
                let both = [(2 * node, pmf * first), (2 * node + 1, pmf * (1.0 - first))];
                open.extend(both.into_iter().filter(|(_, pmf)| *pmf > 0.0));
            }
        }
    }

    fn is_leaf(&self, node: u32) -> bool {
        node as usize >= self.leaves.len()
    }

    /// The bound of the light from a node that decides which one a cut opens. Zero for a leaf.
    fn error(&self, node: u32, at: &ShadingPoint) -> f32 {
        if self.is_leaf(node) {
            return 0.0;
        }
        let node = &self.nodes[node as usize];
        node.flux * node.geometry(at) / node.nearest_sq(at.position).max(self.nearest_sq)
    }

    /// The probability of the first child of a node. `None` where neither child sends light.
    fn first_probability(&self, node: u32, at: &ShadingPoint) -> Option<f32> {
        let [a, b] = [2 * node, 2 * node + 1].map(|child| &self.nodes[child as usize]);
        let [flux_a, flux_b] = [a, b].map(|node| if node.flux > 0.0 { node.flux * node.geometry(at) } else { 0.0 });
        if flux_a <= 0.0 || flux_b <= 0.0 {
            return (flux_a + flux_b > 0.0).then_some(if flux_a > 0.0 { 1.0 } else { 0.0 });
        }
        let share = |dist_sq_a: f32, dist_sq_b: f32| flux_a * dist_sq_b / (flux_a * dist_sq_b + flux_b * dist_sq_a);
        let [near_a, near_b] = [a, b].map(|node| node.nearest_sq(at.position));
        let near = if near_a.max(near_b) > 0.0 { share(near_a, near_b) } else { flux_a / (flux_a + flux_b) };
        let far = share(a.farthest_sq(at.position), b.farthest_sq(at.position));
        // Two lights in one place as the receiver.
        if far.is_nan() { Some(flux_a / (flux_a + flux_b)) } else { Some(0.5 * (near + far)) }
    }
}

impl Node {
    fn new(light: &Emitter<f32>) -> Self {
        let RealAabb { min, max } = light.aabb();
        let flat = |normal: Vec3, two_sided: bool| (normal, if two_sided { PI } else { 0.0 });
        let (axis, half_angle) = match light.form {
            Form::Point { .. } | Form::Profile { .. } | Form::Sphere { .. } => (Vec3::Z, PI),
            // The falloff with the cosine starts at the normals, so a wide spot has some.
            Form::Spot { direction, outer_angle, .. } => (direction, (outer_angle - 0.5 * PI + 0.01).max(0.0)),
            Form::Rectangle { half_u, half_v, two_sided, .. } => flat(half_u.cross(half_v), two_sided),
            Form::Triangle { vertices: [a, b, c], two_sided } => flat((b - a).cross(c - a), two_sided),
        };
        Self { min, max, flux: light.flux(), axis: axis.normalize_or(Vec3::Z), half_angle }
    }

    fn union(&self, other: &Self) -> Self {
        if self.flux <= 0.0 || other.flux <= 0.0 {
            return if self.flux > 0.0 { *self } else { *other };
        }
        let (wide, narrow) = if self.half_angle >= other.half_angle { (self, other) } else { (other, self) };
        let between = wide.axis.angle_between(narrow.axis);
        let (axis, half_angle) = if between + narrow.half_angle <= wide.half_angle {
            (wide.axis, wide.half_angle)
        } else {
            let half_angle = 0.5 * (between + wide.half_angle + narrow.half_angle);
            let turn = wide.axis.cross(narrow.axis).try_normalize();
            match turn.filter(|_| half_angle < PI) {
                Some(turn) => {
                    let axis = girandole::glam::Quat::from_axis_angle(turn, half_angle - wide.half_angle) * wide.axis;
                    (axis.normalize(), half_angle)
                }
                None if between < 1.0 => (wide.axis, wide.half_angle.max(half_angle)),
                None => (wide.axis, PI),
            }
        };
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
            flux: self.flux + other.flux,
            axis,
            half_angle,
        }
    }

    /// A bound of the cosines at the shading point and at the lights.
    fn geometry(&self, at: &ShadingPoint) -> f32 {
        // A point in a volume has no normal.
        let receiver = if at.normal == Vec3::ZERO { 1.0 } else { self.cosine(at.position, at.normal, 1.0) };
        if receiver <= 0.0 || self.half_angle >= 0.5 * PI {
            return receiver;
        }
        let cos = self.cosine(at.position, self.axis, -1.0).clamp(0.0, 1.0);
        receiver * (cos.acos() - self.half_angle).clamp(0.0, 0.5 * PI).cos().max(0.0)
    }

    /// A bound of the cosine between an axis and the directions from a position to the box, or from the
    /// box to the position for a `sign` of -1. At most 0 if all of these are beyond a right angle.
    fn cosine(&self, position: Vec3, axis: Vec3, sign: f32) -> f32 {
        let axis = axis * sign;
        let (low, high) = ((self.min - position) * axis, (self.max - position) * axis);
        let height = low.max(high).element_sum();
        if height <= 0.0 {
            return 0.0;
        }
        let nearest = position.clamp(self.min, self.max) - position;
        let across = nearest - axis * nearest.dot(axis);
        height / (across.length_squared() + height * height).sqrt()
    }

    fn nearest_sq(&self, position: Vec3) -> f32 {
        (position.clamp(self.min, self.max) - position).length_squared()
    }

    fn farthest_sq(&self, position: Vec3) -> f32 {
        (self.min - position).abs().max((self.max - position).abs()).length_squared()
    }
}

/// The Morton code of a position in a box.
fn morton(position: Vec3, min: Vec3, max: Vec3) -> u64 {
    let size = (max - min).max(Vec3::splat(f32::MIN_POSITIVE));
    let scaled = (position - min) / size * ((1 << MORTON_BITS) - 1) as f32;
    let bits = |value: f32| (0..MORTON_BITS).fold(0, |code, bit| code | (value as u64 >> bit & 1) << (3 * bit));
    bits(scaled.x) << 2 | bits(scaled.y) << 1 | bits(scaled.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common::split_mix::Rng;
    use crate::measuring::irradiance::irradiance;
    use girandole::glam::vec3;

    fn pmfs(tree: &LightcutTree, at: &ShadingPoint, lights: usize) -> (Vec<u32>, Vec<f32>) {
        let (mut cut, mut pmfs) = (Vec::new(), vec![0.0; lights]);
        tree.cut(at, &mut cut);
        cut.iter().for_each(|node| tree.add_pmfs(*node, at, 1.0 / cut.len() as f64, &mut pmfs));
        (cut, pmfs)
    }

    #[test]
    fn the_chance_of_a_child_has_the_values_of_the_published_formula() {
        // Two points straight above the receiver, 1 m and 3 m away: their boxes have no size.
        let lights = [1.0, 3.0].map(|y| Light::point(vec3(0.0, y, 0.0), Vec3::ONE));
        let at = ShadingPoint::surface(Vec3::ZERO, Vec3::Y);
        let tree = LightcutTree::new(&lights);
        assert!((tree.first_probability(ROOT, &at).expect("both shine") - 0.9).abs() < 1.0e-6);
        // At 60 degrees, the cosine is one half.
        let aslant = [vec3(0.0, 2.0, 0.0), vec3(3.0_f32.sqrt(), 1.0, 0.0)].map(|at| Light::point(at, Vec3::ONE));
        let tree = LightcutTree::new(&aslant);
        assert!((tree.first_probability(ROOT, &at).expect("both shine") - 2.0 / 3.0).abs() < 1.0e-6);
        // A node with two points: at y from 1 to 3 the nearest is 1 m and the farthest 3 m away. Its sibling
        // has the same two points beside it, 4 m aside, with the cosine bounds 3 / 5 and 1.
        let four = [0.0, 4.0].map(|x| [1.0, 3.0].map(|y| Light::point(vec3(x, y, 0.0), Vec3::ONE))).concat();
        let tree = LightcutTree::new(&four);
        let first = tree.first_probability(ROOT, &at).expect("all shine");
        // Nearest: 1 and 17 square metres; farthest: 9 and 25.
        let share = |a: f32, b: f32| b / (b + 0.6 * a);
        assert!((first - 0.5 * (share(1.0, 17.0) + share(9.0, 25.0))).abs() < 1.0e-5, "{first}");
    }

    #[test]
    fn cuts_hold_every_light_once_and_choices_have_their_probabilities() {
        let mut rng = Rng(21);
        let mut lit = 0;
        for count in [1, 2, 5, 40, 300] {
            let lights = rng.lights(count, 10.0);
            let tree = LightcutTree::new(&lights);
            for _ in 0..20 {
                let at = ShadingPoint::surface(rng.position(12.0), rng.direction());
                let (cut, pmfs) = pmfs(&tree, &at, count);
                assert!(cut.len() <= CUT);
                let below = |node: &u32| {
                    let level = tree.leaves.len().ilog2() - node.ilog2();
                    let first = ((*node as usize) << level) - tree.leaves.len();
                    tree.leaves[first..first + (1 << level)].iter().copied().filter(|leaf| *leaf != NO_LIGHT)
                };
                let mut held: Vec<u32> = cut.iter().flat_map(below).collect();
                held.sort_unstable();
                assert!(held.iter().copied().eq(0..count as u32), "{held:?}");
                assert!(f64::from(pmfs.iter().sum::<f32>()) <= 1.0 + 1.0e-5);
                let lux: Vec<f64> = lights.iter().map(|light| irradiance(light, &at)).collect();
                // A chance in f32 rounds to 0 beside one that is ten million times as large.
                let least = 1.0e-6 * lux.iter().sum::<f64>();
                for ((light, pmf), lux) in lights.iter().zip(&pmfs).zip(&lux) {
                    lit += usize::from(*lux > least);
                    assert!(*lux <= least || *pmf > 0.0, "{light:?} sends {lux} lx to {at:?}");
                }
                for step in 0..50 {
                    let node = cut[step % cut.len()];
                    if let Some((light, pmf)) = tree.pick(node, &at, f64::from(rng.unit())) {
                        let expected = pmfs[light as usize] * cut.len() as f32;
                        assert!((pmf - expected).abs() <= 1.0e-5 * expected, "{pmf}, not {expected}");
                    }
                }
            }
        }
        assert!(lit > 1_000, "{lit}");
    }
}
