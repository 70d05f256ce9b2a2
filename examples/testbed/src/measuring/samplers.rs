//! The samplers that are compared, behind one interface: the probability of every light at a
//! shading point, and single choices, which can be timed.

use super::baselines::lightcuts::LightcutTree;
use super::baselines::{BinaryTree, Cycles, Formula, GaussianTree, Pbrt};
use super::sigma::{Noise, Summary};
use girandole::{CutTable, Light, LightId, LightPick, LightSampler, LightTree, LightWorld, ShadingPoint, WorldError};
use rayon::prelude::*;
use std::sync::Arc;

/// A way to choose one of many lights.
pub trait Chooser: Sync {
    /// The sampler's name in tables.
    fn name(&self) -> &'static str;

    /// The probability of each light, in the order of [`LightSampler::all_lights`]. It may be left
    /// 0 for lights that do not contribute.
    fn pmfs(&self, shading_point: &ShadingPoint) -> Vec<f32>;

    /// Chooses a light; `None` where the sampler ends without one. `u` in [0, 1)^2.
    fn choose(&self, shading_point: &ShadingPoint, u: [f32; 2]) -> Option<LightPick>;

    /// The bytes that a choice may read, without the lights themselves.
    fn bytes(&self) -> usize;
}

/// Every light has the same probability.
struct Uniform {
    ids: Arc<[LightId]>,
}

impl Chooser for Uniform {
    fn name(&self) -> &'static str {
        "uniform"
    }

    fn pmfs(&self, _: &ShadingPoint) -> Vec<f32> {
        vec![1.0 / self.ids.len() as f32; self.ids.len()]
    }

    fn choose(&self, _: &ShadingPoint, u: [f32; 2]) -> Option<LightPick> {
        let light = *self.ids.get((wide(u) * self.ids.len() as f64) as usize)?;
        Some(LightPick { light, pmf: 1.0 / self.ids.len() as f32 })
    }

    fn bytes(&self) -> usize {
        0
    }
}

/// Probabilities in proportion to flux: a binary search in running sums.
struct Flux {
    ids: Arc<[LightId]>,
    sums: Vec<f64>,
}

impl Flux {
    fn new(lights: &[Light], ids: Arc<[LightId]>) -> Self {
        let add = |sum: &mut f64, light: &Light| {
            *sum += f64::from(light.flux());
            Some(*sum)
        };
        Self { ids, sums: lights.iter().scan(0.0, add).collect() }
    }

    fn pmf(&self, light: usize) -> f32 {
        let before = if light > 0 { self.sums[light - 1] } else { 0.0 };
        ((self.sums[light] - before) / self.sums[self.sums.len() - 1]) as f32
    }
}

impl Chooser for Flux {
    fn name(&self) -> &'static str {
        "flux"
    }

    fn pmfs(&self, _: &ShadingPoint) -> Vec<f32> {
        (0..self.sums.len()).map(|light| self.pmf(light)).collect()
    }

    fn choose(&self, _: &ShadingPoint, u: [f32; 2]) -> Option<LightPick> {
        let target = wide(u) * self.sums.last()?;
        let light = self.sums.partition_point(|sum| *sum <= target).min(self.sums.len() - 1);
        Some(LightPick { light: self.ids[light], pmf: self.pmf(light) })
    }

    fn bytes(&self) -> usize {
        size_of_val(self.sums.as_slice())
    }
}

/// A published light tree.
struct Published<F: Formula> {
    name: &'static str,
    ids: Arc<[LightId]>,
    tree: BinaryTree<F>,
}

impl<F: Formula> Chooser for Published<F> {
    fn name(&self) -> &'static str {
        self.name
    }

    fn pmfs(&self, shading_point: &ShadingPoint) -> Vec<f32> {
        self.tree.pmfs(shading_point)
    }

    fn choose(&self, shading_point: &ShadingPoint, u: [f32; 2]) -> Option<LightPick> {
        let (light, pmf) = self.tree.pick(shading_point, wide(u))?;
        Some(LightPick { light: self.ids[light as usize], pmf })
    }

    fn bytes(&self) -> usize {
        self.tree.bytes()
    }
}

/// The light tree of spherical Gaussians.
struct Gaussian<const N: usize, const LANES: usize> {
    name: &'static str,
    ids: Arc<[LightId]>,
    tree: GaussianTree<N, LANES>,
}

impl<const N: usize, const LANES: usize> Chooser for Gaussian<N, LANES> {
    fn name(&self) -> &'static str {
        self.name
    }

    fn pmfs(&self, shading_point: &ShadingPoint) -> Vec<f32> {
        self.tree.pmfs(shading_point)
    }

    fn choose(&self, shading_point: &ShadingPoint, u: [f32; 2]) -> Option<LightPick> {
        let (light, pmf) = self.tree.pick(shading_point, wide(u))?;
        Some(LightPick { light: self.ids[light as usize], pmf })
    }

    fn bytes(&self) -> usize {
        self.tree.bytes()
    }
}

/// Stochastic lightcuts. A choice takes one node of the cut of its own shading point, each with the
/// same probability, where the published algorithm takes all of them.
struct Lightcuts {
    ids: Arc<[LightId]>,
    tree: LightcutTree,
}

impl Lightcuts {
    fn cut(&self, shading_point: &ShadingPoint) -> Vec<u32> {
        let mut cut = Vec::new();
        self.tree.cut(shading_point, &mut cut);
        cut
    }
}

impl Chooser for Lightcuts {
    fn name(&self) -> &'static str {
        "stochastic lightcuts"
    }

    fn pmfs(&self, shading_point: &ShadingPoint) -> Vec<f32> {
        let (cut, mut pmfs) = (self.cut(shading_point), vec![0.0; self.ids.len()]);
        for node in &cut {
            self.tree.add_pmfs(*node, shading_point, 1.0 / cut.len() as f64, &mut pmfs);
        }
        pmfs
    }

    fn choose(&self, shading_point: &ShadingPoint, u: [f32; 2]) -> Option<LightPick> {
        let cut = self.cut(shading_point);
        let place = wide(u) * cut.len() as f64;
        let (light, pmf) = self.tree.pick(*cut.get(place as usize)?, shading_point, place.fract())?;
        Some(LightPick { light: self.ids[light as usize], pmf: pmf / cut.len() as f32 })
    }

    fn bytes(&self) -> usize {
        self.tree.bytes()
    }
}

/// This library with its two levels of trees.
struct TwoLevel<'a> {
    name: &'static str,
    world: &'a LightWorld,
    sampler: LightSampler<'a>,
}

impl Chooser for TwoLevel<'_> {
    fn name(&self) -> &'static str {
        self.name
    }

    fn pmfs(&self, shading_point: &ShadingPoint) -> Vec<f32> {
        let mut pmfs = Vec::new();
        self.sampler.distribution(shading_point, &mut pmfs);
        pmfs
    }

    fn choose(&self, shading_point: &ShadingPoint, u: [f32; 2]) -> Option<LightPick> {
        self.sampler.pick(shading_point, u)
    }

    /// Counts the nodes of each tree once, however many instances show it.
    fn bytes(&self) -> usize {
        let trees = self.world.trees().filter_map(|tree| self.world.tree(tree));
        let bottom: usize = trees.map(|tree| tree.nodes().len()).sum();
        (bottom + top_level_nodes(self.world.instances().len())) * size_of::<girandole::tree::Node>()
    }
}

/// The nodes of a top level, at most: one for six instances, the fewest children that its nodes are
/// filled with, one for six of those nodes, and so on.
pub fn top_level_nodes(instances: usize) -> usize {
    let (mut level, mut nodes) = (instances, 0);
    while level > 1 {
        level = level.div_ceil(6);
        nodes += level;
    }
    nodes.max(1)
}

/// One tree of this library over all lights, without instances.
struct Flat<'a> {
    name: &'static str,
    ids: &'a [LightId],
    tree: LightTree,
    splits: usize,
}

impl Chooser for Flat<'_> {
    fn name(&self) -> &'static str {
        self.name
    }

    fn pmfs(&self, shading_point: &ShadingPoint) -> Vec<f32> {
        let mut pmfs = Vec::new();
        self.tree.distribution(shading_point, self.splits, &mut pmfs);
        pmfs
    }

    fn choose(&self, shading_point: &ShadingPoint, u: [f32; 2]) -> Option<LightPick> {
        let (light, pmf) = self.tree.pick(shading_point, u, self.splits)?;
        Some(LightPick { light: self.ids[light as usize], pmf })
    }

    fn bytes(&self) -> usize {
        size_of_val(self.tree.nodes())
    }
}

/// One divided by the number of values of 24 bits.
const STEP_OF_24_BITS: f64 = 1.0 / 16_777_216.0;

/// Joins two numbers of 24 bits into one in [0, 1) with 48 bits.
pub fn wide(u: [f32; 2]) -> f64 {
    f64::from(u[0]) + f64::from(u[1]) * STEP_OF_24_BITS
}

/// Splits a number in [0, 1) into two of 24 bits, both below 1, that [`wide`] joins again.
pub fn narrow(u: f64) -> [f32; 2] {
    let first = (u / STEP_OF_24_BITS).floor() * STEP_OF_24_BITS;
    let second = ((u - first) / STEP_OF_24_BITS / STEP_OF_24_BITS).floor() * STEP_OF_24_BITS;
    [first as f32, second as f32]
}

/// Chooses every light with the same probability. `ids` as for [`published`].
pub fn uniform(ids: Arc<[LightId]>) -> Box<dyn Chooser> {
    Box::new(Uniform { ids })
}

/// Chooses lights in proportion to their flux. `lights` and `ids` as for [`published`].
pub fn flux(lights: &[Light], ids: Arc<[LightId]>) -> Box<dyn Chooser> {
    Box::new(Flux::new(lights, ids))
}

/// Chooses lights by the formula of pbrt-v4. `lights` and `ids` as for [`published`].
pub fn pbrt(lights: &[Light], ids: Arc<[LightId]>) -> Box<dyn Chooser> {
    let tree = BinaryTree::new(Pbrt { is_opaque: false }, lights.to_vec());
    Box::new(Published { name: "pbrt", ids, tree })
}

/// Chooses lights by the tree of spherical Gaussians, as published. `lights` and `ids` as for
/// [`published`].
pub fn sg_tree(lights: &[Light], ids: Arc<[LightId]>) -> Box<dyn Chooser> {
    Box::new(Gaussian { name: "sg tree", ids, tree: GaussianTree::binary(lights) })
}

/// The samplers that this library is compared with: uniform, flux, pbrt, pbrt opaque, cycles, and
/// the tree of spherical Gaussians as published and on the nodes of this library.
///
/// `lights` are the world's lights one by one, and `ids` their names, both in the order of
/// [`LightSampler::all_lights`].
pub fn published(lights: &[Light], ids: &[LightId]) -> Result<Vec<Box<dyn Chooser>>, WorldError> {
    let ids: Arc<[LightId]> = ids.into();
    let opaque = BinaryTree::new(Pbrt { is_opaque: true }, lights.to_vec());
    let cycles = BinaryTree::new(Cycles, lights.to_vec());
    let wide_gaussian = GaussianTree::wide(&LightTree::new(lights.to_vec())?);
    Ok(vec![
        uniform(ids.clone()),
        flux(lights, ids.clone()),
        pbrt(lights, ids.clone()),
        Box::new(Published { name: "pbrt opaque", ids: ids.clone(), tree: opaque }),
        Box::new(Published { name: "cycles", ids: ids.clone(), tree: cycles }),
        sg_tree(lights, ids.clone()),
        Box::new(Gaussian { name: "sg tree, wide", ids, tree: wide_gaussian }),
    ])
}

/// This library with its two levels and the default number of splits.
pub fn two_level(world: &LightWorld) -> Box<dyn Chooser + '_> {
    Box::new(TwoLevel { name: "girandole", world, sampler: world.sampler() })
}

/// This library with its two levels and cuts that neighbours share.
pub fn shared<'a>(name: &'static str, world: &'a LightWorld, cuts: &'a CutTable) -> Box<dyn Chooser + 'a> {
    Box::new(TwoLevel { name, world, sampler: world.sampler().with_cuts(cuts) })
}

/// One tree of this library over all lights, with the default number of splits.
pub fn flat<'a>(lights: &[Light], ids: &'a [LightId]) -> Result<Box<dyn Chooser + 'a>, WorldError> {
    let tree = LightTree::new(lights.to_vec())?;
    Ok(Box::new(Flat { name: "girandole flat", ids, tree, splits: 6 }))
}

/// All samplers. `lights` and `ids` as for [`published`].
pub fn all<'a>(
    world: &'a LightWorld,
    lights: &[Light],
    ids: &'a [LightId],
) -> Result<Vec<Box<dyn Chooser + 'a>>, WorldError> {
    let mut all: Vec<Box<dyn Chooser + 'a>> = published(lights, ids)?;
    all.push(Box::new(Lightcuts { ids: ids.into(), tree: LightcutTree::new(lights) }));
    all.push(two_level(world));
    let tree = LightTree::new(lights.to_vec())?;
    let flat = |name, splits| -> Box<dyn Chooser + 'a> { Box::new(Flat { name, ids, tree: tree.clone(), splits }) };
    all.extend([
        flat("girandole flat", 6),
        flat("flat, 0 splits", 0),
        flat("flat, 2 splits", 2),
        flat("flat, 4 splits", 4),
        flat("flat, 7 splits", 7),
    ]);
    Ok(all)
}

/// The noise of a sampler over the shading points that some light reaches, and the share of its
/// draws that end without a light, as a mean over them. `lux` has the illuminance by each light at
/// each shading point. At least one shading point must be lit.
pub fn noise(chooser: &dyn Chooser, shading_points: &[ShadingPoint], lux: &[Vec<f32>]) -> (Summary, f64) {
    let one = |(at, lux): (&ShadingPoint, &Vec<f32>)| {
        let pmfs = chooser.pmfs(at);
        let sum: f64 = pmfs.iter().map(|pmf| f64::from(*pmf)).sum();
        Some((Noise::of(lux, &pmfs)?, (1.0 - sum).max(0.0)))
    };
    let (noises, dead): (Vec<Noise>, Vec<f64>) = shading_points.par_iter().zip(lux).filter_map(one).unzip();
    (Summary::of(&noises), dead.iter().sum::<f64>() / dead.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::{narrow, wide};

    #[test]
    fn numbers_of_48_bits_are_split_and_joined_without_loss() {
        let smallest = 0.5_f64.powi(48);
        for u in [0.0, smallest, 0.25, 1.0 / 3.0, 0.999, 1.0 - smallest] {
            let rounded = (u / smallest).floor() * smallest;
            let parts = narrow(u);
            assert!(parts.iter().all(|part| (0.0..1.0).contains(part)), "{parts:?}");
            assert_eq!(wide(parts), rounded);
        }
    }
}
