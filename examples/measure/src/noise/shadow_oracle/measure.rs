//! The noise of the library and of all oracles on one scene.

use super::cells::neighbours;
use super::clusters::Clusters;
use super::oracles::{FLOOR, guided};
use super::places::Place;
use super::receivers::{Illuminance, Receiver, receivers};
use girandole::LightId;
use rayon::prelude::*;
use testbed::direct_light::shadows::Shadows;
use testbed::measuring::lights::carried;
use testbed::measuring::sigma::{Noise, Summary};
use testbed::scene::SceneError;
use testbed::scene::rng::Rng;

/// The numbers of clusters by position.
const CLUSTERS: [usize; 3] = [32, 100, 300];
/// The edges of cells, in metres.
const EDGES: [f32; 3] = [0.5, 1.0, 2.0];
/// Seeds the surfaces of cells.
const SEED: u64 = 77;

/// What decides the probabilities.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Knowledge {
    /// The library as it is.
    Library,
    /// The library's probabilities, normalised: what an oracle gains in addition to visibility,
    /// because none of its draws ends without a light.
    Normalised,
    /// Whether each light is visible.
    Lights,
    /// The visible share of each cluster at the shading point.
    Clusters { kind: &'static str, count: usize },
    /// The visible share of each cluster at other surfaces in the cell of the shading point.
    Cells { kind: &'static str, count: usize, edge: f32 },
}

/// The noise with shadows at all shading points.
pub struct Row {
    pub knowledge: Knowledge,
    pub sigma: Summary,
}

/// The rows of a scene, the library first, and the scene in numbers.
pub struct Measured {
    pub scene: String,
    pub rows: Vec<Row>,
    pub shading_points: usize,
    /// The share of the illuminance that is shadowed, as a mean over the shading points.
    pub shadowed: f64,
    /// The surfaces that were found in a cell besides the shading point, as means for each edge.
    pub neighbours: Vec<(f32, f64)>,
}

/// Measures a scene at `count` surfaces that some light reaches.
///
/// Traces a shadow ray for each contributing light at 49 surfaces per shading point, and keeps
/// eight bytes for each pair of a light and a shading point.
pub fn measure(place: &Place, count: usize) -> Result<Measured, SceneError> {
    let sampler = place.world.sampler();
    let ids: Vec<LightId> = sampler.all_lights().collect();
    let receivers = receivers(place, &sampler, &ids, count)?;
    let (lights, weights) = (carried(&place.world), weights(&receivers));
    let mut partitions: Vec<Clusters> =
        CLUSTERS.iter().map(|count| Clusters::by_position(&lights, &weights, *count)).collect();
    partitions.push(Clusters::by_instance(&ids));
    let shadows = Shadows::new(&place.scene, &place.geometry);

    let at = |(index, receiver): (usize, &Receiver)| {
        let mut pmfs = Vec::new();
        sampler.distribution(&receiver.shading_point, &mut pmfs);
        let Illuminance { all, visible } = &receiver.illuminance;
        let noise = |pmfs: &[f32]| Noise::of(visible, pmfs);
        let guided = |visibility: &dyn Fn(usize) -> f64| noise(&guided(&pmfs, FLOOR, visibility));
        // A light that sends nothing even without shadows is not known to be shadowed.
        let is_visible = |light: usize| f64::from(u8::from(all[light] <= 0.0 || visible[light] > 0.0));
        let mut noises = vec![
            (Knowledge::Library, noise(&pmfs)),
            (Knowledge::Normalised, guided(&|_| 1.0)),
            (Knowledge::Lights, guided(&is_visible)),
        ];
        for clusters in &partitions {
            let Clusters { kind, count, .. } = *clusters;
            let shares = clusters.visible_shares([&receiver.illuminance]);
            noises.push((Knowledge::Clusters { kind, count }, guided(&|light| shares.of_light(light))));
        }
        let mut found = [0; EDGES.len()];
        for (edge, found) in EDGES.into_iter().zip(&mut found) {
            let mut rng = Rng::new(SEED, index as u64);
            let surfaces = neighbours(&place.geometry, receiver, edge, &mut rng);
            let surfaces: Vec<Illuminance> =
                surfaces.iter().map(|surface| Illuminance::new(&shadows, &sampler, &ids, surface)).collect();
            *found = surfaces.len();
            for clusters in &partitions {
                let Clusters { kind, count, .. } = *clusters;
                let shares = clusters.visible_shares(&surfaces);
                noises.push((Knowledge::Cells { kind, count, edge }, guided(&|light| shares.of_light(light))));
            }
        }
        (noises, found)
    };
    let (noises, found): (Vec<_>, Vec<_>) = receivers.par_iter().enumerate().map(at).unzip();
    let of_oracle = |oracle: usize| {
        let sigmas: Vec<Noise> = noises.iter().filter_map(|noises| noises[oracle].1).collect();
        Row { knowledge: noises[0][oracle].0, sigma: Summary::of(&sigmas) }
    };
    let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / receivers.len() as f64;
    let neighbours = |(index, edge): (usize, &f32)| (*edge, mean(&mut found.iter().map(|found| found[index] as f64)));
    Ok(Measured {
        scene: place.name.clone(),
        rows: (0..noises[0].len()).map(of_oracle).collect(),
        shading_points: receivers.len(),
        shadowed: mean(&mut receivers.iter().map(|receiver| receiver.illuminance.shadowed())),
        neighbours: EDGES.iter().enumerate().map(neighbours).collect(),
    })
}

/// How much each light matters: its share of the illuminance without shadows, summed over all
/// receivers. So most clusters lie where the light comes from, as in the cut of a light tree.
fn weights(receivers: &[Receiver]) -> Vec<f64> {
    let mut weights = vec![0.0; receivers.first().map_or(0, |receiver| receiver.illuminance.all.len())];
    for Receiver { illuminance: Illuminance { all, .. }, .. } in receivers {
        let sum: f64 = all.iter().map(|lux| f64::from(*lux)).sum();
        weights.iter_mut().zip(all).for_each(|(weight, lux)| *weight += f64::from(*lux) / sum);
    }
    weights
}
