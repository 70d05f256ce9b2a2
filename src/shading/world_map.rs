//! A tree whose instance is scaled, sheared or mirrored, as the world sees it.
//!
//! The linear part A of such a placement is a product F U. U maps the tree to the *axes of the
//! instance*, in which lengths and angles are those of the world, and F is a rotation. The shading
//! point is only rotated and translated into these axes; the children of the tree's nodes are
//! mapped by U. So no position is divided by the thickness of a squashed instance
//! (docs/math.md, The shading point in tree space).
//!
//! F has the first axis along the image of the tree's x axis and the third one perpendicular to the
//! images of x and y. So boxes stay tight where the images of the tree's axes are perpendicular to
//! each other. Twin of `shaders/scaled.wgsl`.

use glam::{Mat3, Vec3};

use crate::cluster::Linear;
use crate::tree::{FluxShares, Unpacked};

/// The map from a tree's space to the axes of its instance, but for the translation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WorldMap<'a> {
    /// The linear part of the placement.
    placement: &'a Linear,
    /// The axes of the instance in the world: a rotation.
    pub axes: Mat3,
}

impl<'a> WorldMap<'a> {
    /// `to_local` is the inverse of the placement's linear part, whose rows are perpendicular to the
    /// images of two axes even where all images are nearly parallel.
    pub fn new(placement: &'a Linear, to_local: &Mat3) -> Self {
        let (x, z) = (placement.linear.x_axis.normalize(), to_local.row(2).normalize());
        Self { placement, axes: Mat3::from_cols(x, z.cross(x), z) }
    }

    /// What lengths are multiplied by: the root of the mean squared scale. The sum of a vector's
    /// coordinates grows by up to three times this factor, for which margins have room.
    pub fn scale(&self) -> f32 {
        self.placement.mean_square_scale.sqrt()
    }

    /// A child that was unpacked relative to the tree's origin, in the axes of the instance and
    /// relative to a position there. Its box holds the image of the box, and its cap all directions
    /// into which the instance turns those of the cap.
    #[inline(always)]
    pub fn child(&self, child: &Unpacked, shares: FluxShares, position: Vec3) -> Unpacked {
        let to_axes = self.axes.transpose();
        let linear = to_axes * self.placement.linear;
        let columns = [linear.x_axis, linear.y_axis, linear.z_axis];
        let (half, axis) = (Vec3::from(child.half), Vec3::from(child.axis));
        let [x, y, z] = columns.map(Vec3::abs);
        let box_half = Mat3::from_cols(x, y, z) * half;
        let (image, cos_half_angle) = self.placement.cap(shares.emitters(), axis, child.cos_half_angle);
        Unpacked {
            toward: (linear * Vec3::from(child.toward) - position).into(),
            center: (linear * Vec3::from(child.center) - position).into(),
            half: box_half.into(),
            radius_sq: box_half.length_squared(),
            variance: child.deviation_sq * (half * half).dot(columns.map(Vec3::length_squared).into()),
            axis: (to_axes * image).into(),
            cos_half_angle,
            flux: self.placement.flux(child.flux * shares.punctual, child.flux * shares.area, axis * child.length),
            ..*child
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec3};

    use super::*;
    use crate::cluster::Emitters;
    use crate::light::Light;
    use crate::tree::testing::Rng;
    use crate::tree::{LightTree, WIDTH};

    fn direction(rng: &mut Rng) -> Vec3 {
        rng.position(1.0).normalize()
    }

    /// The largest error of a child's mean position, of its axis and of its flux, each in units of
    /// what one rounding of each entry of the matrices changes: a matrix that maps an axis to
    /// something much shorter than its entries loses as many digits of it.
    fn errors(tree: &LightTree, matrix: Mat3, at: Vec3) -> [f64; 3] {
        let exact = matrix.as_dmat3();
        let placement = Linear::new(matrix);
        let map = WorldMap::new(&placement, &exact.inverse().as_mat3());
        let position = map.axes.transpose() * at;
        let to_world = |v: [f32; 3]| map.axes.as_dmat3() * Vec3::from(v).as_dvec3();
        let [x, y, z] = [exact.x_axis, exact.y_axis, exact.z_axis];
        let cofactor = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y)) * exact.determinant().signum();
        let norm = |matrix: DMat3| matrix.to_cols_array().iter().map(|e| e * e).sum::<f64>().sqrt();
        let mut errors = [0.0_f64; 3];
        for node in tree.nodes() {
            let grid = node.grid(Vec3::ZERO);
            for slot in (0..WIDTH).filter(|slot| node.flux[*slot] > 0) {
                let (child, shares) = (node.unpack(slot, &grid), node.flux_shares(slot));
                let seen = map.child(&child, shares, position);
                let mean = Vec3::from(child.toward).as_dvec3();
                let toward = exact * mean - at.as_dvec3();
                let size = norm(exact) * mean.length() + f64::from(at.length());
                errors[0] = errors[0].max((to_world(seen.toward) - toward).length() / size);
                let axis = Vec3::from(child.axis).as_dvec3();
                let turned = if shares.emitters() == Emitters::Beams { exact } else { cofactor };
                let loss = norm(turned) / (turned * axis).length();
                let image: DVec3 = (turned * axis).normalize();
                errors[1] = errors[1].max((to_world(seen.axis) - image).length() / loss);
                let agreement = (1.5 * axis.length() * f64::from(child.length)).min(1.0);
                let all_sides = norm(cofactor) / 3.0_f64.sqrt();
                let along = (cofactor * axis.normalize()).length();
                let area = f64::from(shares.area) * (agreement * along + (1.0 - agreement) * all_sides);
                let flux = f64::from(child.flux) * (f64::from(shares.punctual) + area);
                let unit = f64::from(child.flux) * (1.0 + norm(cofactor));
                errors[2] = errors[2].max((f64::from(seen.flux) - flux).abs() / unit);
            }
        }
        errors
    }

    #[test]
    fn children_of_squashed_instances_are_where_they_are_in_f64() {
        let mut rng = Rng(77);
        let panel_or_beam = |i: usize| {
            let (at, direction) = (rng.position(30.0), direction(&mut rng));
            match i % 2 {
                0 => Light::rectangle(at, direction, direction.any_orthonormal_vector(), Vec3::ONE),
                _ => Light::spot(at, direction, 0.01, 0.02 + 0.001 * i as f32, Vec3::ONE),
            }
        };
        let tree = LightTree::new((0..60).map(panel_or_beam).collect()).expect("valid lights");
        let mut rng = Rng(78);
        for power in 1..=9 {
            let squash = 10.0_f32.powi(-power);
            for scale in [Vec3::new(1.0, 1.0, squash), Vec3::new(1.0, squash, squash)] {
                for i in 0..40 {
                    let mut turn = || Mat3::from_axis_angle(direction(&mut rng), i as f32);
                    let inner = if i % 2 == 0 { turn() } else { Mat3::IDENTITY };
                    let matrix = turn() * Mat3::from_diagonal(scale) * inner;
                    let errors = errors(&tree, matrix, rng.position(60.0));
                    // Sixteen roundings: of three products with a matrix, a normalisation and a difference.
                    let bound = 16.0 * 2.0_f64.powi(-24);
                    assert!(errors.into_iter().all(|error| error <= bound), "{scale} {i}: {errors:?}");
                }
            }
        }
    }

    #[test]
    fn boxes_stay_tight_where_the_images_of_the_axes_are_perpendicular() {
        let mut rng = Rng(79);
        let child =
            LightTree::new(vec![Light::rectangle(Vec3::ONE, Vec3::X, Vec3::Y * 2.0, Vec3::ONE)]).expect("valid");
        let (node, scale) = (child.nodes()[0], Vec3::new(0.01, 3.0, 0.5));
        let (child, shares) = (node.unpack(0, &node.grid(Vec3::ZERO)), node.flux_shares(0));
        for mirror in [1.0, -1.0] {
            let matrix = Mat3::from_axis_angle(direction(&mut rng), 2.0) * Mat3::from_diagonal(scale * mirror);
            let placement = Linear::new(matrix);
            let map = WorldMap::new(&placement, &matrix.inverse());
            assert!((map.axes.determinant() - 1.0).abs() < 1.0e-6);
            let seen = map.child(&child, shares, Vec3::ZERO);
            let expected = scale * Vec3::from(child.half);
            assert!((Vec3::from(seen.half) - expected).abs().max_element() < 1.0e-5, "{:?} {expected}", seen.half);
        }
    }
}
