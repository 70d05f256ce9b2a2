//! The samplers that are compared, behind one interface: the probability of every light at a
//! shading point, and single choices, which can be timed.

use super::baselines::{BinaryTree, Cycles, Formula, GaussianTree, Pbrt};
use super::sigma::{Noise, Summary};
use girandole::{CutTable, Light, LightId, LightPick, LightSampler, LightTree, LightWorld, ShadingPoint, WorldError};
use rayon::prelude::*;
use std::sync::Arc;

/// The probability of each light at a shading point.
type Probabilities<'a> = Box<dyn Fn(&ShadingPoint) -> Vec<f32> + Send + Sync + 'a>;
/// One choice by two numbers in [0, 1).
type Choice<'a> = Box<dyn Fn(&ShadingPoint, [f32; 2]) -> Option<LightPick> + Send + Sync + 'a>;

/// A way to choose one of many lights.
pub struct Chooser<'a> {
    name: &'static str,
    bytes: usize,
    pmfs: Probabilities<'a>,
    choose: Choice<'a>,
}

impl<'a> Chooser<'a> {
    fn new(
        name: &'static str,
        bytes: usize,
        pmfs: impl Fn(&ShadingPoint) -> Vec<f32> + Send + Sync + 'a,
        choose: impl Fn(&ShadingPoint, [f32; 2]) -> Option<LightPick> + Send + Sync + 'a,
    ) -> Self {
        Self { name, bytes, pmfs: Box::new(pmfs), choose: Box::new(choose) }
    }

    /// The sampler's name in tables.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// The probability of each light, in the order of [`LightSampler::all_lights`]. It may be left
    /// 0 for lights that do not contribute.
    pub fn pmfs(&self, shading_point: &ShadingPoint) -> Vec<f32> {
        (self.pmfs)(shading_point)
    }

    /// Chooses a light; `None` where the sampler ends without one. `u` in [0, 1)^2.
    pub fn choose(&self, shading_point: &ShadingPoint, u: [f32; 2]) -> Option<LightPick> {
        (self.choose)(shading_point, u)
    }

    /// The bytes that a choice may read, without the lights themselves.
    pub fn bytes(&self) -> usize {
        self.bytes
    }
}

/// Chooses every light with the same probability. `ids` as for [`published`].
fn uniform<'a>(ids: Arc<[LightId]>) -> Chooser<'a> {
    let (count, pmf) = (ids.len(), 1.0 / ids.len() as f32);
    let choose = move |_: &ShadingPoint, u| {
        let light = *ids.get((wide(u) * count as f64) as usize)?;
        Some(LightPick { light, pmf })
    };
    Chooser::new("uniform", 0, move |_| vec![pmf; count], choose)
}

/// Chooses lights in proportion to their flux, by a binary search in running sums. `lights` and `ids` as for
/// [`published`].
fn flux<'a>(lights: &[Light], ids: Arc<[LightId]>) -> Chooser<'a> {
    let add = |sum: &mut f64, light: &Light| {
        *sum += f64::from(light.flux());
        Some(*sum)
    };
    let sums: Arc<[f64]> = lights.iter().scan(0.0, add).collect();
    let pmf = |sums: &[f64], light: usize| {
        let before = if light > 0 { sums[light - 1] } else { 0.0 };
        ((sums[light] - before) / sums[sums.len() - 1]) as f32
    };
    let all = sums.clone();
    let choose = move |_: &ShadingPoint, u| {
        let target = wide(u) * sums.last()?;
        let light = sums.partition_point(|sum| *sum <= target).min(sums.len() - 1);
        Some(LightPick { light: ids[light], pmf: pmf(&sums, light) })
    };
    Chooser::new("flux", size_of_val(&*all), move |_| (0..all.len()).map(|light| pmf(&all, light)).collect(), choose)
}

/// A published light tree.
fn binary<'a, F: Formula + Send + 'a>(
    name: &'static str,
    ids: Arc<[LightId]>,
    formula: F,
    lights: &[Light],
) -> Chooser<'a> {
    let tree = Arc::new(BinaryTree::new(formula, lights.to_vec()));
    let same = tree.clone();
    let choose = move |at: &ShadingPoint, u| {
        let (light, pmf) = tree.pick(at, wide(u))?;
        Some(LightPick { light: ids[light as usize], pmf })
    };
    Chooser::new(name, same.bytes(), move |at| same.pmfs(at), choose)
}

/// The light tree of spherical Gaussians.
fn gaussian<'a, const N: usize, const LANES: usize>(
    name: &'static str,
    ids: Arc<[LightId]>,
    tree: GaussianTree<N, LANES>,
) -> Chooser<'a> {
    let tree = Arc::new(tree);
    let same = tree.clone();
    let choose = move |at: &ShadingPoint, u| {
        let (light, pmf) = tree.pick(at, wide(u))?;
        Some(LightPick { light: ids[light as usize], pmf })
    };
    Chooser::new(name, same.bytes(), move |at| same.pmfs(at), choose)
}

/// This library with its two levels of trees. Counts the nodes of each tree once, however many instances show it.
fn two_levels<'a>(name: &'static str, world: &'a LightWorld, sampler: LightSampler<'a>) -> Chooser<'a> {
    let trees = world.trees().filter_map(|tree| world.tree(tree));
    let bottom: usize = trees.map(|tree| tree.nodes().len()).sum();
    let bytes = (bottom + top_level_nodes(world.instances().len())) * size_of::<girandole::tree::Node>();
    let pmfs = move |at: &ShadingPoint| {
        let mut pmfs = Vec::new();
        sampler.distribution(at, &mut pmfs);
        pmfs
    };
    Chooser::new(name, bytes, pmfs, move |at, u| sampler.pick(at, u))
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
fn one_tree<'a>(name: &'static str, ids: &'a [LightId], tree: LightTree, splits: usize) -> Chooser<'a> {
    let tree = Arc::new(tree);
    let same = tree.clone();
    let pmfs = move |at: &ShadingPoint| {
        let mut pmfs = Vec::new();
        same.distribution(at, splits, &mut pmfs);
        pmfs
    };
    let bytes = size_of_val(tree.nodes());
    Chooser::new(name, bytes, pmfs, move |at, u| {
        let (light, pmf) = tree.pick(at, u, splits)?;
        Some(LightPick { light: ids[light as usize], pmf })
    })
}

/// Joins two numbers of 24 bits into one in [0, 1) with 48 bits.
pub fn wide(u: [f32; 2]) -> f64 {
    f64::from(u[0]) + f64::from(u[1]) / 16_777_216.0
}

/// The samplers that this library is compared with: uniform, flux, pbrt, pbrt opaque, cycles, and
/// the tree of spherical Gaussians as published and on the nodes of this library.
///
/// `lights` are the world's lights one by one, and `ids` their names, both in the order of
/// [`LightSampler::all_lights`].
pub fn published<'a>(lights: &[Light], ids: &[LightId]) -> Result<Vec<Chooser<'a>>, WorldError> {
    let ids: Arc<[LightId]> = ids.into();
    let wide_gaussian = GaussianTree::wide(&LightTree::new(lights.to_vec())?);
    Ok(vec![
        uniform(ids.clone()),
        flux(lights, ids.clone()),
        binary("pbrt", ids.clone(), Pbrt { is_opaque: false }, lights),
        binary("pbrt opaque", ids.clone(), Pbrt { is_opaque: true }, lights),
        binary("cycles", ids.clone(), Cycles, lights),
        gaussian("sg tree", ids.clone(), GaussianTree::binary(lights)),
        gaussian("sg tree, wide", ids, wide_gaussian),
    ])
}

/// This library with its two levels and the default number of splits.
pub fn two_level(world: &LightWorld) -> Chooser<'_> {
    two_levels("girandole", world, world.sampler())
}

/// This library with its two levels and cuts that neighbours share.
pub fn shared<'a>(name: &'static str, world: &'a LightWorld, cuts: &'a CutTable) -> Chooser<'a> {
    two_levels(name, world, world.sampler().with_cuts(cuts))
}

/// One tree of this library over all lights, with the default number of splits.
pub fn flat<'a>(lights: &[Light], ids: &'a [LightId]) -> Result<Chooser<'a>, WorldError> {
    Ok(one_tree("girandole flat", ids, LightTree::new(lights.to_vec())?, 6))
}

/// All samplers. `lights` and `ids` as for [`published`].
pub fn all<'a>(world: &'a LightWorld, lights: &[Light], ids: &'a [LightId]) -> Result<Vec<Chooser<'a>>, WorldError> {
    let mut all = published(lights, ids)?;
    all.push(two_level(world));
    let tree = LightTree::new(lights.to_vec())?;
    let splits = [
        ("girandole flat", 6),
        ("flat, 0 splits", 0),
        ("flat, 2 splits", 2),
        ("flat, 4 splits", 4),
        ("flat, 7 splits", 7),
    ];
    all.extend(splits.map(|(name, splits)| one_tree(name, ids, tree.clone(), splits)));
    Ok(all)
}

/// The noise of a sampler over the shading points that some light reaches, and the share of its
/// draws that end without a light, as a mean over them. `lux` has the illuminance by each light at
/// each shading point. At least one shading point must be lit.
pub fn noise(chooser: &Chooser<'_>, shading_points: &[ShadingPoint], lux: &[Vec<f32>]) -> (Summary, f64) {
    let one = |(at, lux): (&ShadingPoint, &Vec<f32>)| {
        let pmfs = chooser.pmfs(at);
        let sum: f64 = pmfs.iter().map(|pmf| f64::from(*pmf)).sum();
        Some((Noise::of(lux, &pmfs)?, (1.0 - sum).max(0.0)))
    };
    let (noises, dead): (Vec<Noise>, Vec<f64>) = shading_points.par_iter().zip(lux).filter_map(one).unzip();
    (Summary::of(&noises), dead.iter().sum::<f64>() / dead.len() as f64)
}
