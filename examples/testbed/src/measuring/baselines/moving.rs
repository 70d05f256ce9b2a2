//! A published tree over lights that move: it is updated from the leaves to the root, as in [SS],
//! and its attributes are computed on the way.
//!
//! [SS] is Sosnowski and Szajerman, BVH Trees of Many Dynamic Lights for Real-Time Ray Tracing. Its four attributes are
//! the formulas of docs/math.md with two children a node, and the splitting cost is that of the build of these trees
//! (`tree`). Differs from docs/math.md: a light counts as a point at the centre of its box, so a leaf has no variance.

use super::tree::{BinaryTree, Formula, LEAF, LightBounds};
use girandole::glam::DVec3;
use girandole::{Attributes, Light, ShadingPoint};

/// A binary tree with one light per leaf that keeps its shape while lights move. Lights without
/// power are in the tree, too, since they may be switched on.
pub struct MovingTree<F: Formula> {
    tree: BinaryTree<F>,
    /// The bounds of each node in the form that can be merged.
    bounds: Vec<LightBounds>,
    attributes: Attributes,
}

impl<F: Formula> MovingTree<F> {
    /// Builds a tree over lights in world space. O(n log n).
    pub fn new(formula: F, lights: Vec<Light>) -> Self {
        let tree = BinaryTree::with_dark_lights(formula, lights);
        let bounds = tree.lights.first().map_or(Vec::new(), |light| vec![F::bounds(light); tree.nodes.len()]);
        let mut moving = Self { tree, bounds, attributes: Attributes::default() };
        // New and updated trees merge bounds in the same order, so that they differ in shape only.
        moving.update_nodes();
        moving
    }

    /// Replaces lights and updates all nodes and the attributes. `changes` are pairs of a light's
    /// index and its new value. O(n), however few lights change.
    pub fn refit(&mut self, changes: &[(u32, Light)]) {
        for (index, light) in changes {
            self.tree.lights[*index as usize] = *light;
        }
        self.update_nodes();
    }

    /// The four attributes of [SS] as of the last build or refit.
    pub fn attributes(&self) -> Attributes {
        self.attributes
    }

    /// Chooses a light, as [`BinaryTree::pick`].
    pub fn pick(&self, shading_point: &ShadingPoint, u: f64) -> Option<(u32, f32)> {
        self.tree.pick(shading_point, u)
    }

    fn update_nodes(&mut self) {
        let Self { tree, bounds, .. } = self;
        // Children come after their parents.
        for (index, node) in tree.nodes.iter_mut().enumerate().rev() {
            bounds[index] = match node.target & LEAF {
                0 => bounds[index + 1].union(&bounds[node.target as usize]),
                _ => F::bounds(&tree.lights[(node.target & !LEAF) as usize]),
            };
            node.bounds = F::pack(&bounds[index]);
        }
        self.attributes = attributes(tree.nodes.iter().map(|node| node.target), bounds);
    }
}

/// The power of a group of lights, and where it is.
#[derive(Clone, Copy)]
struct Moments {
    power: f64,
    mean: DVec3,
    /// The variance of position, weighted by power, in square metres.
    variance: f64,
}

/// The sums over all inner nodes, in the units of the power and in metres.
#[derive(Clone, Copy, Default)]
struct Sums {
    distance: f64,
    overlap: f64,
    variance: f64,
    cost: f64,
}

/// The attributes of a tree, from the target and the bounds of each node, parents before children.
/// All are 0 for a tree of one light and for a dark tree.
fn attributes(targets: impl DoubleEndedIterator<Item = u32> + ExactSizeIterator, bounds: &[LightBounds]) -> Attributes {
    let mut moments = vec![Moments { power: 0.0, mean: DVec3::ZERO, variance: 0.0 }; bounds.len()];
    let mut sums = Sums::default();
    for (node, target) in targets.enumerate().rev() {
        let own = &bounds[node];
        if target & LEAF != 0 {
            let mean = own.aabb.center().as_dvec3();
            moments[node] = Moments { power: f64::from(own.power), mean, variance: 0.0 };
            continue;
        }
        let [a, b] = [node + 1, target as usize];
        let between;
        (moments[node], between) = merge(moments[a], moments[b]);
        let power = moments[node].power;
        let length = own.aabb.half_perimeter();
        sums.distance += power * between.sqrt();
        sums.variance += power * moments[node].variance;
        sums.cost += f64::from(bounds[a].measure()) + f64::from(bounds[b].measure());
        if length > 0.0 {
            let shared = bounds[a].aabb.intersection(&bounds[b].aabb);
            let shared = if shared.is_empty() { 0.0 } else { shared.half_perimeter() };
            sums.overlap += power * f64::from(shared / length);
        }
    }
    let Some((root, power)) = bounds.first().zip(moments.first().map(|moments| moments.power)) else {
        return Attributes::default();
    };
    let diagonal = root.aabb.extent().as_dvec3().length();
    let ratio = |sum: f64, unit: f64| if unit > 0.0 { (sum / unit) as f32 } else { 0.0 };
    Attributes {
        distance: ratio(sums.distance, power * diagonal),
        overlap: ratio(sums.overlap, power),
        variance: ratio(sums.variance, power * diagonal * diagonal),
        splitting_cost: ratio(sums.cost, f64::from(root.measure())),
    }
}

/// The moments of both groups together, and the mean squared distance of the groups' means from the
/// common mean.
fn merge(a: Moments, b: Moments) -> (Moments, f64) {
    let power = a.power + b.power;
    if power <= 0.0 {
        return (Moments { power: 0.0, mean: 0.5 * (a.mean + b.mean), variance: 0.0 }, 0.0);
    }
    let [share_a, share_b] = [a.power / power, b.power / power];
    let mean = a.mean * share_a + b.mean * share_b;
    let between = share_a * a.mean.distance_squared(mean) + share_b * b.mean.distance_squared(mean);
    let variance = share_a * a.variance + share_b * b.variance + between;
    (Moments { power, mean, variance }, between)
}

#[cfg(test)]
mod tests {
    use super::super::Pbrt;
    use super::*;
    use girandole::glam::{Vec3, vec3};

    /// Squares of 2 m x 2 m in the plane y = 0 that shine upward, by their x, all scaled.
    fn scaled_squares(places: &[f32], scale: f32) -> Vec<Light> {
        let square = |x: &f32| Light::rectangle(vec3(scale * x, 0.0, 0.0), Vec3::Z * scale, Vec3::X * scale, Vec3::ONE);
        places.iter().map(square).collect()
    }

    fn squares(places: &[f32]) -> Vec<Light> {
        scaled_squares(places, 1.0)
    }

    fn tree(places: &[f32]) -> MovingTree<Pbrt> {
        MovingTree::new(Pbrt { is_opaque: true }, squares(places))
    }

    fn assert_attributes(tree: &MovingTree<Pbrt>, expected: [f32; 4]) {
        let Attributes { distance, overlap, variance, splitting_cost } = tree.attributes();
        let all = [distance, overlap, variance, splitting_cost];
        let near = all.iter().zip(&expected).all(|(a, b)| (a - b).abs() <= 1.0e-5 * b.abs().max(1.0e-3));
        assert!(near, "{all:?}, not {expected:?}");
    }

    #[test]
    fn attributes_have_values_computed_by_hand() {
        // The box of both squares is 6 m x 2 m: its squared diagonal is 40 m², its area 24 m². The
        // squares are 2 m from the mean, and have an area of 8 m² each, back and front.
        assert_attributes(&tree(&[0.0, 4.0]), [2.0 / 40.0_f32.sqrt(), 0.0, 0.1, (0.5 * 8.0 + 0.5 * 8.0) / 24.0]);
        // The squares share 1 m x 2 m of a box of 3 m x 2 m. They are 0.5 m from the mean.
        assert_attributes(&tree(&[0.0, 1.0]), [0.5 / 13.0_f32.sqrt(), 0.6, 0.25 / 13.0, 8.0 / 12.0]);
        // Two nodes: the first two squares, and all three. The mean squared distance of the
        // children of the root is 2/9 of 98², that of the others 2².
        let (diagonal_sq, between) = (102.0_f32 * 102.0 + 4.0, 2.0 / 9.0 * 98.0_f32 * 98.0);
        let variance = between + 2.0 / 3.0 * 4.0;
        let costs = (2.0 * 24.0 + 8.0) + (8.0 + 8.0);
        let expected = [
            (3.0 * between.sqrt() + 2.0 * 2.0) / (3.0 * diagonal_sq.sqrt()),
            0.0,
            (3.0 * variance + 2.0 * 4.0) / (3.0 * diagonal_sq),
            costs / (3.0 * 2.0 * 102.0 * 2.0),
        ];
        assert_attributes(&tree(&[0.0, 4.0, 100.0]), expected);
        assert_attributes(&tree(&[0.0]), [0.0; 4]);
        assert_attributes(&tree(&[]), [0.0; 4]);
    }

    #[test]
    fn a_refit_tree_equals_a_new_one_of_the_same_shape() {
        let places: Vec<f32> = (0..40).map(|i| (i * i) as f32).collect();
        // Scaling by a power of two keeps the shape of the tree.
        let doubled = scaled_squares(&places, 2.0);
        let mut refitted = tree(&places);
        refitted.refit(&(0..).zip(doubled.iter().copied()).collect::<Vec<_>>());
        let new = MovingTree::new(Pbrt { is_opaque: true }, doubled);
        let shape = |tree: &MovingTree<Pbrt>| tree.tree.nodes.iter().map(|node| node.target).collect::<Vec<_>>();
        assert_eq!(shape(&refitted), shape(&new));
        assert_eq!(refitted.attributes(), new.attributes());
        let at = ShadingPoint::surface(vec3(30.0, 5.0, 1.0), Vec3::NEG_Y);
        let pmfs = refitted.tree.pmfs(&at);
        assert_eq!(pmfs, new.tree.pmfs(&at));
        assert_ne!(pmfs, tree(&places).tree.pmfs(&at));
        assert!((pmfs.iter().sum::<f32>() - 1.0).abs() < 1.0e-5, "{pmfs:?}");
    }

    #[test]
    fn lights_that_are_switched_on_are_chosen() {
        let mut lights = squares(&[0.0, 4.0, 9.0]);
        let lit = lights[2];
        lights[2].emission = Vec3::ZERO;
        let mut tree = MovingTree::new(Pbrt { is_opaque: true }, lights);
        let at = ShadingPoint::surface(vec3(9.0, 2.0, 0.0), Vec3::NEG_Y);
        assert_eq!(tree.tree.pmfs(&at)[2], 0.0);
        tree.refit(&[(2, lit)]);
        assert!(tree.tree.pmfs(&at)[2] > 0.3);
    }
}
