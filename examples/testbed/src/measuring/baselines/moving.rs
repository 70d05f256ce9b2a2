//! A published tree over lights that move: it is updated from the leaves to the root, as in [SS],
//! and its attributes are computed on the way.
//!
//! [SS] is Sosnowski and Szajerman, BVH Trees of Many Dynamic Lights for Real-Time Ray Tracing.

use super::attributes::attributes;
use super::bounds::LightBounds;
use super::saoh::LEAF;
use super::tree::{BinaryTree, Formula};
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
            self.tree.lights[*index as usize] = light.into();
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
