//! The exact noise of choosing a light inside a tree, at points around it.

use glam::{Mat3, Vec3};

use crate::counts::SplitCount;
use crate::emit::sample_light;
use crate::light::luminance;
use crate::shading_point::ShadingPoint;
use crate::transform::InstanceTransform;
use crate::tree::LightTree;

/// Distances of the points from the middle of the box, as shares of its diagonal: near enough for
/// the shape of the tree to matter.
const DISTANCES: [f32; 2] = [0.4, 0.9];

/// The angle between successive points, in radians: about the golden angle, so that the points
/// cover all sides evenly.
const ANGLE_STEP: f32 = 2.4;

impl LightTree {
    /// Computes the relative variance of one choice inside this tree with the default number of
    /// splits. `None` if no light reaches the points. O(lights), some 150 ns each.
    ///
    /// The result is the mean over two points around the tree, whose directions follow from `turn`.
    /// A point is weighted by the square of its illuminance, relative to that of the same flux sent
    /// from the middle to all sides, because the noise of a tree counts by that square among other
    /// lights. `pmfs` is scratch memory.
    pub(crate) fn variance_around(&self, turn: u32, pmfs: &mut Vec<f32>) -> Option<f32> {
        let cluster = self.cluster();
        let middle = 0.5 * (cluster.aabb.min + cluster.aabb.max);
        let diagonal = cluster.aabb.extent().length();
        let identity = InstanceTransform {
            to_world: Mat3::IDENTITY,
            translation: Vec3::ZERO,
            to_local: Mat3::IDENTITY,
            determinant: 1.0,
        };
        let (mut sum, mut weights) = (0.0, 0.0);
        for (i, distance) in DISTANCES.into_iter().enumerate() {
            let angle = ANGLE_STEP * (2 * (turn % 1024) + i as u32) as f32;
            let height = (0.7 * angle).sin();
            let ring = (1.0 - height * height).sqrt();
            let direction = Vec3::new(ring * angle.cos(), height, ring * angle.sin());
            let shading_point = ShadingPoint::volume(middle + distance * diagonal * direction);
            self.distribution(&shading_point, SplitCount::DEFAULT, pmfs);
            let (mut lux, mut second_moment) = (0.0_f64, 0.0_f64);
            for (light, pmf) in self.lights().iter().zip(&*pmfs).filter(|(_, pmf)| **pmf > 0.0) {
                let Some(incident) = sample_light(light, &identity, &shading_point, [0.5, 0.5]) else { continue };
                let contribution = f64::from(luminance(incident.radiance)) / f64::from(incident.pdf);
                lux += contribution;
                second_moment += contribution * contribution / f64::from(*pmf);
            }
            if lux <= 0.0 {
                continue;
            }
            let dist_sq = f64::from(shading_point.position.distance_squared(cluster.mean));
            let relative_lux = lux * dist_sq * 4.0 * std::f64::consts::PI / f64::from(cluster.flux);
            let weight = (relative_lux * relative_lux).min(1.0);
            sum += weight * (second_moment / (lux * lux) - 1.0).max(0.0);
            weights += weight;
        }
        let variance = (sum / weights) as f32;
        variance.is_finite().then_some(variance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::Light;

    #[test]
    fn variance_is_unknown_for_one_point_and_falls_when_a_scrambled_tree_is_rebuilt() {
        let mut pmfs = Vec::new();
        let lamp = |place: Vec3| Light::point(place, Vec3::ONE);
        let one = LightTree::build(vec![lamp(Vec3::ZERO)]);
        assert_eq!(
            one.variance_around(0, &mut pmfs),
            None,
            "the box is a point, so the points around it lie on the lamp"
        );
        let place = |i: u32, k: u32| ((i * 3 + k).wrapping_mul(747_796_405).wrapping_mul(2_891_336_453) >> 8) as f32;
        let cloud = |shift: u32| {
            let lamps = (0..500).map(move |i| (i + shift) * 7);
            lamps.map(|i| lamp(Vec3::new(place(i, 0), place(i, 1), place(i, 2)) * (10.0 / 1.7e7))).collect::<Vec<_>>()
        };
        let mut tree = LightTree::build(cloud(0));
        let fresh = tree.variance_around(3, &mut pmfs).expect("lit");
        let changes: Vec<_> = (0..).zip(cloud(5000)).collect();
        tree.apply(&changes);
        tree.refit();
        let scrambled = tree.variance_around(3, &mut pmfs).expect("lit");
        tree.rebuild();
        let rebuilt = tree.variance_around(3, &mut pmfs).expect("lit");
        assert!(fresh > 0.0 && scrambled > 1.5 * fresh && rebuilt < 1.3 * fresh, "{fresh} {scrambled} {rebuilt}");
    }

    #[test]
    fn a_dark_tree_has_no_variance() {
        let tree = LightTree::build(vec![Light::point(Vec3::ONE, Vec3::ZERO); 20]);
        assert_eq!(tree.variance_around(0, &mut Vec::new()), None);
        assert_eq!(LightTree::build(Vec::new()).variance_around(0, &mut Vec::new()), None);
    }
}
