//! Random numbers and comparisons for the unit tests of trees.

use super::LightTree;
use super::state::TreeState;
use crate::cluster::Cluster;

pub(crate) use testbed::common::split_mix::Rng;

/// The complete state of a tree but for its lights. Floats are equal if their bits are.
#[derive(PartialEq)]
pub(crate) struct State {
    words: Vec<Vec<u32>>,
    text: String,
}

/// The complete state of a tree but for its lights.
pub(crate) fn state_of(tree: &LightTree) -> State {
    let LightTree { nodes, leaves, state, light_counts, quality, root, sides, effects, .. } = tree;
    let (wide, sums_and_marks) = match state {
        TreeState::Live(data) => (&data.wide[..], format!("{:?} {:?}", data.attribute_sums, data.dirty)),
        _ => (&[][..], format!("{} {}", tree.is_frozen(), tree.is_dirty())),
    };
    let bits = |floats: &[f32]| floats.iter().map(|v| v.to_bits()).collect::<Vec<u32>>();
    let wide = wide.iter().flat_map(|lanes| {
        let vectors = [lanes.min, lanes.max, lanes.mean, lanes.axis];
        let scalars =
            [lanes.flux, lanes.area_flux, lanes.punctual_flux, lanes.variance, lanes.cos_half_angle, lanes.range];
        [bits(vectors.as_flattened().as_flattened()), bits(scalars.as_flattened())].concat()
    });
    let words = vec![
        bytemuck::cast_slice(nodes).to_vec(),
        leaves.clone(),
        wide.collect(),
        light_counts.clone(),
        vec![quality.built_cost.to_bits(), quality.cost.to_bits()],
        cluster_bits(root),
        sides.iter().flat_map(cluster_bits).collect(),
    ];
    let text = format!("{sums_and_marks} {} {:?} {effects:?}", quality.is_stale, quality.attributes);
    State { words, text }
}

fn cluster_bits(cluster: &Cluster) -> Vec<u32> {
    let Cluster { aabb, flux, area_flux, punctual_flux, mean, variance, axis, cos_half_angle, range } = cluster;
    let vectors = [aabb.min, aabb.max, *mean, *axis].into_iter().flat_map(|v| v.to_array());
    vectors.chain([*flux, *area_flux, *punctual_flux, *variance, *cos_half_angle, *range]).map(f32::to_bits).collect()
}
