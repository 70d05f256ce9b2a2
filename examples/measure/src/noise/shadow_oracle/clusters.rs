//! Clusters of lights, and the visible share of what they send.

use super::receivers::Illuminance;
use girandole::glam::Vec3;
use girandole::{Light, LightId, Shape};
use rayon::prelude::*;
use std::collections::HashMap;
use testbed::scene::rng::Rng;

/// Seeds the first middles of k-means.
const SEED: u64 = 31;
/// Rounds of k-means. Later rounds move few lights.
const ROUNDS: usize = 20;

/// A partition of all lights.
pub struct Clusters {
    /// What forms the clusters, for tables.
    pub kind: &'static str,
    /// The cluster of each light, in the order of `LightSampler::all_lights`.
    of_light: Vec<u32>,
    /// The number of clusters.
    pub count: usize,
}

/// Sums of illuminance by cluster, over any number of surfaces.
pub struct VisibleShares<'a> {
    clusters: &'a Clusters,
    /// Without shadows.
    all: Vec<f64>,
    /// With shadows.
    visible: Vec<f64>,
}

impl Clusters {
    /// One cluster for each instance.
    pub fn by_instance(ids: &[LightId]) -> Self {
        let mut numbers = HashMap::new();
        let of_light = ids
            .iter()
            .map(|id| {
                let next = numbers.len() as u32;
                match id {
                    LightId::Local { instance, .. } => *numbers.entry(*instance).or_insert(next),
                    // Scenes are measured without directional lights.
                    LightId::Directional(_) => 0,
                    &_ => unreachable!("this version has no others"),
                }
            })
            .collect();
        Self { kind: "instance", of_light, count: numbers.len().max(1) }
    }

    /// At most `count` clusters by position: weighted k-means (Lloyd 1982), which starts from
    /// k-means++ (Arthur and Vassilvitskii 2007).
    ///
    /// `weights` say how much each light matters. Lights of weight 0 join the nearest cluster.
    /// There are fewer clusters if fewer places have a weight. O(lights · `count`).
    pub fn by_position(lights: &[Light], weights: &[f64], count: usize) -> Self {
        let places: Vec<Vec3> = lights.iter().map(middle).collect();
        let mut middles = first_middles(&places, weights, count);
        let mut of_light = nearest(&places, &middles);
        for _ in 0..ROUNDS {
            let mut sums = vec![([0.0_f64; 3], 0.0); middles.len()];
            for ((place, weight), cluster) in places.iter().zip(weights).zip(&of_light) {
                let (sum, total) = &mut sums[*cluster as usize];
                (0..3).for_each(|axis| sum[axis] += f64::from(place[axis]) * weight);
                *total += weight;
            }
            for (middle, (sum, total)) in middles.iter_mut().zip(sums).filter(|(_, (_, total))| *total > 0.0) {
                *middle = Vec3::from_array(sum.map(|sum| (sum / total) as f32));
            }
            of_light = nearest(&places, &middles);
        }
        Self { kind: "position", of_light, count: middles.len() }
    }

    /// The cluster of a light.
    pub fn of(&self, light: usize) -> usize {
        self.of_light[light] as usize
    }

    /// The visible shares of what clusters send to some surfaces.
    pub fn visible_shares<'a>(&self, surfaces: impl IntoIterator<Item = &'a Illuminance>) -> VisibleShares<'_> {
        let mut shares = VisibleShares { clusters: self, all: vec![0.0; self.count], visible: vec![0.0; self.count] };
        for illuminance in surfaces {
            for (light, (all, visible)) in illuminance.all.iter().zip(&illuminance.visible).enumerate() {
                shares.all[self.of(light)] += f64::from(*all);
                shares.visible[self.of(light)] += f64::from(*visible);
            }
        }
        shares
    }
}

impl VisibleShares<'_> {
    /// The visible share of the illuminance by the cluster of a light; 1 if the cluster sends
    /// nothing to any of the surfaces, so that nothing is known.
    pub fn of_light(&self, light: usize) -> f64 {
        let cluster = self.clusters.of(light);
        if self.all[cluster] > 0.0 { self.visible[cluster] / self.all[cluster] } else { 1.0 }
    }
}

/// The middle of a light.
fn middle(light: &Light) -> Vec3 {
    match light.shape {
        Shape::Point { position } | Shape::Spot { position, .. } | Shape::Profile { position, .. } => position,
        Shape::Rectangle { center, .. } | Shape::Sphere { center, .. } => center,
        Shape::Triangle { vertices: [a, b, c], .. } => (a + b + c) / 3.0,
        _ => unreachable!("this version has no others"),
    }
}

/// Chooses places at random: the first by weight, the others by weight times the squared distance
/// to those chosen before.
fn first_middles(places: &[Vec3], weights: &[f64], count: usize) -> Vec<Vec3> {
    let mut rng = Rng::new(SEED, count as u64);
    let mut chances = weights.to_vec();
    let mut distances = vec![f64::INFINITY; places.len()];
    let mut middles = Vec::with_capacity(count);
    while middles.len() < count {
        let total: f64 = chances.iter().sum();
        let target = (f64::from(rng.unit()) + f64::from(rng.unit()) / f64::from(1 << 24)) * total;
        let mut sum = 0.0;
        let reaches = |chance: &f64| {
            sum += chance;
            *chance > 0.0 && sum > target
        };
        let Some(chosen) = chances.iter().position(reaches) else { break };
        let middle = places[chosen];
        middles.push(middle);
        for (((place, weight), distance), chance) in places.iter().zip(weights).zip(&mut distances).zip(&mut chances) {
            *distance = distance.min(f64::from(place.distance_squared(middle)));
            *chance = weight * *distance;
        }
    }
    if middles.is_empty() {
        middles.extend(places.first());
    }
    middles
}

/// The nearest of the middles for each place; the first of several.
fn nearest(places: &[Vec3], middles: &[Vec3]) -> Vec<u32> {
    let one = |place: &Vec3| {
        let distances = middles.iter().map(|middle| place.distance_squared(*middle));
        (0..).zip(distances).min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(index, _)| index)
    };
    places.par_iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lights_in_three_places_form_three_clusters_of_which_weights_choose_two() {
        let light = |i: usize| Light::point(Vec3::X * ((i % 3) as f32 * 10.0 + i as f32 * 1e-3), Vec3::ONE);
        let lights: Vec<Light> = (0..30).map(light).collect();
        let three = Clusters::by_position(&lights, &[1.0; 30], 3);
        assert_eq!(three.count, 3);
        assert!((0..30).all(|i| (0..30).all(|j| (three.of(i) == three.of(j)) == (i % 3 == j % 3))));
        // Without a weight, the third place joins the nearest of the others.
        let weights: Vec<f64> = (0..30).map(|i| if i % 3 == 2 { 0.0 } else { 1.0 }).collect();
        let two = Clusters::by_position(&lights, &weights, 2);
        assert!(two.count == 2 && two.of(0) != two.of(1) && two.of(1) == two.of(2));
    }

    #[test]
    fn a_visible_share_is_that_of_sums_and_one_where_nothing_arrives() {
        let clusters = Clusters { kind: "test", of_light: vec![0, 0, 1], count: 2 };
        let at = |all: [f32; 3], visible: [f32; 3]| Illuminance { all: all.into(), visible: visible.into() };
        let surfaces = [at([1.0, 3.0, 0.0], [1.0, 0.0, 0.0]), at([4.0, 0.0, 0.0], [4.0, 0.0, 0.0])];
        let shares = clusters.visible_shares(&surfaces);
        assert_eq!([0, 1, 2].map(|light| shares.of_light(light)), [0.625, 0.625, 1.0]);
    }
}
