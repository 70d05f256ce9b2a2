//! Makes what the settings name: ways to draw a light, their probabilities, and their memory.

use super::scene_view::SceneView;
use super::settings::Sampler;
use girandole::tree::Node;
use girandole::{FrameBudget, Light, LightId, LightSampler, LightTree, LightWorld, Placement, Policy, ShadingPoint};
use testbed::direct_light::cells::{CellSettings, SharedCells, TAUGHT};
use testbed::direct_light::draw::{Draw, Frame, Resampled, ResampledByBrdf, Single};
use testbed::direct_light::rivals;
use testbed::measuring::lights::carried;
use testbed::measuring::samplers::{self, Chooser};
use testbed::scene::SceneError;

/// The bytes of a light on a GPU.
const LIGHT_BYTES: usize = 64;
/// The bytes of an instance on a GPU.
const INSTANCE_BYTES: usize = 128;

/// The lights of a world in all forms that samplers need.
pub struct Prepared {
    /// The lights one by one, in the order of [`LightSampler::all_lights`].
    pub lights: Vec<Light>,
    pub ids: Vec<LightId>,
    /// One instance of one tree over all of them.
    one_level: LightWorld,
}

impl Prepared {
    /// Carries all lights to world space and builds one tree over them.
    pub fn new(world: &LightWorld) -> Result<Self, SceneError> {
        let lights = carried(world);
        let ids = world.sampler().all_lights().collect();
        let mut one_level = LightWorld::new();
        let tree = one_level.add_tree(LightTree::new(lights.clone())?);
        one_level.add_instance(tree, Placement::IDENTITY, Policy::Static)?;
        one_level.update(FrameBudget::UNLIMITED);
        Ok(Self { lights, ids, one_level })
    }

    /// A world with one tree over all lights.
    pub fn one_level(&self) -> &LightWorld {
        &self.one_level
    }
}

/// All samplers over the same lights.
pub struct Samplers<'a> {
    world: &'a LightWorld,
    prepared: &'a Prepared,
    published: Vec<Chooser<'a>>,
    view: &'a SceneView,
}

impl<'a> Samplers<'a> {
    /// Builds the trees of the samplers to compare with, for pictures of a view.
    pub fn new(world: &'a LightWorld, prepared: &'a Prepared, view: &'a SceneView) -> Result<Self, SceneError> {
        Ok(Self { world, prepared, published: samplers::published(&prepared.lights, &prepared.ids)?, view })
    }

    /// A way to draw; `None` for the sum over all lights, and for a sampler or a count that does
    /// not exist.
    pub fn draw(&self, sampler: Sampler) -> Option<Box<dyn Draw + '_>> {
        Some(match sampler {
            Sampler::TwoLevels { splits, candidates } => resampled(self.world, splits, candidates)?,
            Sampler::ByBrdf { splits, candidates } => {
                let lights = self.world.sampler().with_splits(splits);
                Box::new(ResampledByBrdf { lights, candidates })
            }
            Sampler::WithGloss { splits, candidates } => {
                let lights = self.world.sampler().with_splits(splits);
                Box::new(Resampled { lights, candidates, has_gloss: true })
            }
            Sampler::SharedCuts { candidates, has_gloss, learns } => {
                let settings = CellSettings { has_gloss, candidates, taught: learns.then_some(TAUGHT) };
                Box::new(SharedCells::new(self.world, (&self.view.view, &self.view.scene), settings).ok()?)
            }
            Sampler::OneLevel { splits, candidates } => resampled(&self.prepared.one_level, splits, candidates)?,
            Sampler::Published(name) => {
                Box::new(Single { chooser: self.published(name)?, lights: self.world.sampler(), has_gloss: false })
            }
            Sampler::Rival(name) => {
                let lights = (self.world.sampler(), &self.prepared.ids[..], &self.prepared.lights[..]);
                rivals::by_name(name, lights, (&self.view.view, &self.view.view))?
            }
            Sampler::AllLights => return None,
        })
    }

    /// The probabilities of all lights in one draw; `None` for samplers that choose among
    /// candidates.
    pub fn pmfs(&self, sampler: Sampler, shading_point: &ShadingPoint) -> Option<Vec<f32>> {
        let of_world = |world: &LightWorld, splits| {
            let mut pmfs = Vec::new();
            let sampler = world.sampler().with_splits(splits);
            sampler.distribution(shading_point, &mut pmfs);
            Some(pmfs)
        };
        match sampler {
            Sampler::TwoLevels { splits, candidates: 1 } => of_world(self.world, splits),
            Sampler::OneLevel { splits, candidates: 1 } => of_world(&self.prepared.one_level, splits),
            Sampler::Published(name) => Some(self.published(name)?.pmfs(shading_point)),
            _ => None,
        }
    }

    /// The bytes that samples may read: nodes, lights and instances, in the library's GPU format.
    pub fn memory_bytes(&self, sampler: Sampler) -> usize {
        let of_world = |world: &LightWorld| {
            let trees: Vec<_> = world.trees().filter_map(|key| world.tree(key)).collect();
            let nodes: usize = trees.iter().map(|tree| tree.nodes().len()).sum();
            let lights: usize = trees.iter().map(|tree| tree.lights().len()).sum();
            let top = samplers::top_level_nodes(world.instances().len());
            (nodes + top) * size_of::<Node>() + lights * LIGHT_BYTES + world.instances().len() * INSTANCE_BYTES
        };
        match sampler {
            Sampler::TwoLevels { .. } | Sampler::ByBrdf { .. } | Sampler::WithGloss { .. } => of_world(self.world),
            Sampler::SharedCuts { .. } => of_world(self.world) + self.prepared_bytes(sampler),
            Sampler::OneLevel { .. } => of_world(&self.prepared.one_level),
            Sampler::Published(name) => {
                self.published(name).map_or(0, Chooser::bytes) + self.prepared.lights.len() * LIGHT_BYTES
            }
            Sampler::Rival(_) => self.prepared_bytes(sampler) + self.prepared.lights.len() * LIGHT_BYTES,
            Sampler::AllLights => self.prepared.lights.len() * LIGHT_BYTES,
        }
    }

    /// The bytes of what a sampler prepares for a frame.
    fn prepared_bytes(&self, sampler: Sampler) -> usize {
        self.draw(sampler).map_or(0, |mut draw| {
            draw.prepare(&Frame { seed: 0, number: 0, found: &[] });
            draw.prepared_bytes()
        })
    }

    /// The world's own sampler, which knows every light's point and radiance.
    pub fn lights(&self) -> LightSampler<'_> {
        self.world.sampler()
    }

    /// The names of all lights.
    pub fn ids(&self) -> &[LightId] {
        &self.prepared.ids
    }

    /// A way to draw by a published sampler that is told how surfaces reflect; `None` for any other
    /// sampler.
    pub fn draw_with_gloss(&self, sampler: Sampler) -> Option<Box<dyn Draw + '_>> {
        let Sampler::Published(name) = sampler else { return None };
        Some(Box::new(Single { chooser: self.published(name)?, lights: self.world.sampler(), has_gloss: true }))
    }

    fn published(&self, name: &str) -> Option<&Chooser<'a>> {
        self.published.iter().find(|chooser| chooser.name() == name)
    }
}

/// A way to draw from a world; `None` for counts beyond their limits.
pub fn resampled(world: &LightWorld, splits: usize, candidates: u32) -> Option<Box<dyn Draw + '_>> {
    let lights = world.sampler().with_splits(splits);
    Some(Box::new(Resampled { lights, candidates, has_gloss: false }))
}
