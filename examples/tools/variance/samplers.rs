//! What is compared, behind one interface: the chance of each light at a shading point, and single draws to be timed.

use super::baselines::{BinaryTree, Cycles, Formula, Pbrt};
use girandole::{Light, LightSampler, LightTree, LightWorld, ShadingPoint, SplitCount, WorldError};

/// A way to choose one of many lights.
pub trait Chooser: Sync {
    /// As in the table.
    fn name(&self) -> &'static str;

    /// The chance of each light that contributes; of others it may be left 0.
    fn chances(&self, shading_point: &ShadingPoint, contributions: &[f32]) -> Vec<f32>;

    /// Chooses a light and returns its chance; 0 for none.
    fn draw(&self, shading_point: &ShadingPoint, u: [f32; 2]) -> f32;

    /// What is read to choose from all lights, without the lights themselves.
    fn bytes(&self) -> usize;
}

/// Each light as often as any other.
struct Uniform {
    count: usize,
}

impl Chooser for Uniform {
    fn name(&self) -> &'static str {
        "uniform"
    }

    fn chances(&self, _: &ShadingPoint, _: &[f32]) -> Vec<f32> {
        vec![1.0 / self.count as f32; self.count]
    }

    fn draw(&self, _: &ShadingPoint, u: [f32; 2]) -> f32 {
        std::hint::black_box((wide(u) * self.count as f64) as usize);
        1.0 / self.count as f32
    }

    fn bytes(&self) -> usize {
        0
    }
}

/// In proportion to flux: a running sum, searched by halves.
struct ByFlux {
    sums: Vec<f64>,
}

impl ByFlux {
    fn new(lights: &[Light]) -> Self {
        let running = |sum: &mut f64, light: &Light| {
            *sum += f64::from(light.flux());
            Some(*sum)
        };
        Self { sums: lights.iter().scan(0.0, running).collect() }
    }

    fn chance(&self, light: usize) -> f32 {
        let before = if light > 0 { self.sums[light - 1] } else { 0.0 };
        ((self.sums[light] - before) / self.sums[self.sums.len() - 1]) as f32
    }
}

impl Chooser for ByFlux {
    fn name(&self) -> &'static str {
        "flux"
    }

    fn chances(&self, _: &ShadingPoint, _: &[f32]) -> Vec<f32> {
        (0..self.sums.len()).map(|light| self.chance(light)).collect()
    }

    fn draw(&self, _: &ShadingPoint, u: [f32; 2]) -> f32 {
        let at = wide(u) * self.sums[self.sums.len() - 1];
        self.chance(self.sums.partition_point(|sum| *sum <= at).min(self.sums.len() - 1))
    }

    fn bytes(&self) -> usize {
        size_of_val(self.sums.as_slice())
    }
}

/// A published tree.
struct Published<F: Formula> {
    name: &'static str,
    tree: BinaryTree<F>,
}

impl<F: Formula> Chooser for Published<F> {
    fn name(&self) -> &'static str {
        self.name
    }

    fn chances(&self, shading_point: &ShadingPoint, _: &[f32]) -> Vec<f32> {
        self.tree.pmfs(shading_point)
    }

    fn draw(&self, shading_point: &ShadingPoint, u: [f32; 2]) -> f32 {
        let pick = self.tree.pick(shading_point, wide(u));
        std::hint::black_box(pick).map_or(0.0, |(_, pmf)| pmf)
    }

    fn bytes(&self) -> usize {
        self.tree.bytes()
    }
}

/// The library's two levels.
struct TwoLevel<'a> {
    world: &'a LightWorld,
    sampler: LightSampler<'a>,
}

impl Chooser for TwoLevel<'_> {
    fn name(&self) -> &'static str {
        "girandole"
    }

    fn chances(&self, shading_point: &ShadingPoint, _: &[f32]) -> Vec<f32> {
        let mut chances = Vec::new();
        self.sampler.distribution(shading_point, &mut chances);
        chances
    }

    fn draw(&self, shading_point: &ShadingPoint, u: [f32; 2]) -> f32 {
        std::hint::black_box(self.sampler.pick(shading_point, u)).map_or(0.0, |pick| pick.pmf)
    }

    /// The nodes of each tree once, however many instances show it, and a top level of one node for six instances, the least
    /// that its nodes are filled with, one for six of those, and so on.
    fn bytes(&self) -> usize {
        let trees = self.world.trees().filter_map(|tree| self.world.tree(tree));
        let below: usize = trees.map(|tree| tree.nodes().len()).sum();
        let mut level = self.world.instance_count();
        let mut above = 0;
        while level > 1 {
            level = level.div_ceil(6);
            above += level;
        }
        (below + above.max(1)) * size_of::<girandole::tree::Node>()
    }
}

/// The library's tree, one over all lights, without instances.
struct Flat {
    name: &'static str,
    tree: LightTree,
    splits: SplitCount,
}

impl Chooser for Flat {
    fn name(&self) -> &'static str {
        self.name
    }

    fn chances(&self, shading_point: &ShadingPoint, _: &[f32]) -> Vec<f32> {
        let mut chances = Vec::new();
        self.tree.distribution(shading_point, self.splits, &mut chances);
        chances
    }

    fn draw(&self, shading_point: &ShadingPoint, u: [f32; 2]) -> f32 {
        std::hint::black_box(self.tree.pick(shading_point, u, self.splits)).map_or(0.0, |(_, pmf)| pmf)
    }

    fn bytes(&self) -> usize {
        size_of_val(self.tree.nodes())
    }
}

/// Both numbers as one in [0, 1), of 48 bits.
fn wide(u: [f32; 2]) -> f64 {
    f64::from(u[0]) + f64::from(u[1]) / f64::from(1 << 24)
}

/// All samplers over the same lights; `lights` are the world's, one by one.
pub fn all<'a>(world: &'a LightWorld, lights: &[Light]) -> Result<Vec<Box<dyn Chooser + 'a>>, WorldError> {
    let opaque = BinaryTree::new(Pbrt { is_opaque: true }, lights.to_vec());
    let tree = LightTree::new(lights.to_vec())?;
    Ok(vec![
        Box::new(Uniform { count: lights.len() }),
        Box::new(ByFlux::new(lights)),
        Box::new(Published { name: "pbrt", tree: BinaryTree::new(Pbrt { is_opaque: false }, lights.to_vec()) }),
        Box::new(Published { name: "pbrt opaque", tree: opaque }),
        Box::new(Published { name: "cycles", tree: BinaryTree::new(Cycles, lights.to_vec()) }),
        Box::new(TwoLevel { world, sampler: world.sampler() }),
        Box::new(Flat { name: "girandole flat", tree: tree.clone(), splits: SplitCount::DEFAULT }),
        Box::new(Flat { name: "flat, 0 splits", tree: tree.clone(), splits: SplitCount::of::<0>() }),
        Box::new(Flat { name: "flat, 2 splits", tree: tree.clone(), splits: SplitCount::of::<2>() }),
        Box::new(Flat { name: "flat, 4 splits", tree: tree.clone(), splits: SplitCount::of::<4>() }),
        Box::new(Flat { name: "flat, 8 splits", tree, splits: SplitCount::of::<8>() }),
    ])
}
