//! Sampling and probabilities on the CPU: the top level, then one tree, directional lights beside them.
//!
//! Twin of `shaders/sample.wgsl`.

use crate::counts::SplitCount;
use crate::dice::share;
use crate::distribution::Spread;
use crate::emit::{Incident, sample_light};
use crate::importance::View;
use crate::keys::{DirectionalKey, InstanceKey, slot_of};
use crate::light::{DirectionalLight, luminance};
use crate::shading_point::ShadingPoint;
use crate::simd::with_vectors;
use crate::top::TopLevel;
use crate::tree::LightTree;
use crate::walk::{Chance, Draw, Drawn, Forest, Leaf, NO_INSTANCE, NoForest, Picked, Scene, Wanted};
use crate::world::LightWorld;

/// Names a light that can be sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum LightId {
    /// A light of an instance's tree.
    Local {
        /// The instance.
        instance: InstanceKey,
        /// The light's index in the tree.
        light: u32,
    },
    /// A light at infinity.
    Directional(DirectionalKey),
}

/// A chosen light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightPick {
    /// Which.
    pub light: LightId,
    /// The chance of this choice, in (0, 1].
    pub pmf: f32,
}

/// A chosen light and a point on it. Its share of the light that arrives is estimated by
/// `brdf * cosine * incident.radiance / (pmf * incident.pdf)`, if nothing stands between.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Which.
    pub light: LightId,
    /// The chance of the light, in (0, 1].
    pub pmf: f32,
    /// What arrives from the point.
    pub incident: Incident,
}

/// Samples a world as it is now. Cheap to make once the top level stands; any number of threads may share it.
#[derive(Clone, Copy)]
pub struct LightSampler<'a> {
    pub(crate) world: &'a LightWorld,
    pub(crate) top: &'a TopLevel,
    pub(crate) splits: SplitCount,
}

impl<'a> Forest<'a> for (&LightSampler<'a>, &ShadingPoint) {
    fn enter(&self, slot: u32) -> Option<Scene<'a>> {
        let (sampler, shading_point) = self;
        sampler.scene(sampler.world.instance_at(slot)?, shading_point).map(|(_, scene)| scene)
    }
}

impl LightWorld {
    /// A sampler of the world as it is now, its lights as of the last update. The first call after a change builds the
    /// top level, O(n log n) in instances; engines that sample on the GPU only never pay for it.
    ///
    /// Any thread may call this, inside a rayon job too. Threads that make the first call at once may each build the
    /// top level; to build it once, call this before the parallel loop.
    pub fn sampler(&self) -> LightSampler<'_> {
        LightSampler { world: self, top: self.top_level(), splits: SplitCount::DEFAULT }
    }
}

impl<'a> LightSampler<'a> {
    /// Chooses a light and a point on it. `u` in [0, 1): two numbers choose the light, two the point.
    ///
    /// `None` if no light can reach the shading point, or if the chosen point does not: both are ordinary, and count as black.
    pub fn sample(&self, shading_point: &ShadingPoint, u: [f32; 4]) -> Option<LightSample> {
        self.sample_picked(shading_point, self.pick(shading_point, [u[0], u[1]])?, [u[2], u[3]])
    }

    /// A point on a light that was picked.
    pub(crate) fn sample_picked(
        &self,
        shading_point: &ShadingPoint,
        pick: LightPick,
        u: [f32; 2],
    ) -> Option<LightSample> {
        let LightPick { light, pmf } = pick;
        let incident = self.sample_light(shading_point, light, u)?;
        Some(LightSample { light, pmf, incident })
    }

    /// Returns the same sampler with another number of splits; [`SplitCount::DEFAULT`] at first.
    ///
    /// A split replaces a cluster near the shading point by its children before a light is chosen.
    pub fn with_splits(self, splits: SplitCount) -> Self {
        Self { splits, ..self }
    }

    /// The same sampler over another top level of the same world.
    #[cfg(test)]
    pub(crate) fn with_top(self, top: &'a TopLevel) -> Self {
        Self { top, ..self }
    }

    /// Chooses a light; `None` where bounds prove that there is none to choose.
    ///
    /// One pass over eight children per opened cluster and per level below. Source: CK18 5, see `walk.rs`.
    pub fn pick(&self, shading_point: &ShadingPoint, u: [f32; 2]) -> Option<LightPick> {
        let draw = Draw {
            root: self.root(shading_point),
            splits: self.splits,
            beside: self.directional(shading_point),
            u,
            forest: &(self, shading_point),
        };
        self.named(shading_point, with_vectors(draw))
    }

    /// The keys of what was drawn.
    pub(crate) fn named(&self, shading_point: &ShadingPoint, drawn: Drawn) -> Option<LightPick> {
        match drawn {
            Drawn::Light(Picked { instance, light, pmf }) => {
                Some(LightPick { light: LightId::Local { instance: self.world.instance_at(instance)?, light }, pmf })
            }
            Drawn::Beside { offset, total } => self.pick_directional(shading_point, offset, total),
            Drawn::Nothing => None,
        }
    }

    /// The chance that [`LightSampler::pick`] chooses this light; 0 for a light that is dark, unreachable, or not there.
    pub fn pmf(&self, shading_point: &ShadingPoint, light: LightId) -> f32 {
        let root = self.root(shading_point);
        let of = match light {
            LightId::Directional(key) => match self.world.directional(key) {
                Some(light) => Wanted::Beside(illuminance(light, shading_point)),
                None => return 0.0,
            },
            LightId::Local { instance, light } => {
                let Some((tree, scene)) = self.scene(instance, shading_point) else { return 0.0 };
                let Some(leaf) = tree.leaves().get(light as usize) else { return 0.0 };
                let place = self.top.places[slot_of(instance) as usize];
                Wanted::Light(Leaf { scene, place: *leaf, top: Some((root, place)) })
            }
        };
        let beside = self.directional(shading_point);
        with_vectors(Chance { root, splits: self.splits, beside, of, forest: &(self, shading_point) })
    }

    /// A point on a given light; `None` if that point sends nothing to the shading point or the light is not there.
    pub fn sample_light(&self, shading_point: &ShadingPoint, light: LightId, u: [f32; 2]) -> Option<Incident> {
        match light {
            LightId::Directional(key) => {
                let light = self.world.directional(key)?;
                (illuminance(light, shading_point) > 0.0).then(|| Incident {
                    direction: -light.direction.normalize(),
                    dist: f32::INFINITY,
                    radiance: light.illuminance,
                    pdf: 1.0,
                    is_delta: true,
                })
            }
            LightId::Local { instance, light } => {
                let placed = self.world.instance(instance)?;
                let light = self.world.tree(placed.tree)?.lights().get(light as usize)?;
                sample_light(light, &placed.placed.as_ref()?.frame, shading_point, u)
            }
        }
    }

    /// Every light that can be sampled, for sums over all of them.
    pub fn all_lights(&self) -> impl Iterator<Item = LightId> + use<'a> {
        let world = self.world;
        let local = world.instances().flat_map(move |instance| {
            let lights = world.instance(instance).and_then(|i| world.tree(i.tree)).map_or(0, |t| t.lights().len());
            (0..lights as u32).map(move |light| LightId::Local { instance, light })
        });
        local.chain(world.directionals().map(|(key, _)| LightId::Directional(key)))
    }

    /// The chance of every light, in the order of [`LightSampler::all_lights`]: what [`LightSampler::pmf`] tells of each, up to
    /// rounding.
    ///
    /// Fills `chances`, whatever it held. Their sum is 1 less the chance of "no light"; all are 0 where nothing can be
    /// chosen. O(lights of all instances), but what is proved dark as a whole takes no time beyond its zeros; allocates
    /// eight bytes a slot besides `chances`.
    pub fn distribution(&self, shading_point: &ShadingPoint, chances: &mut Vec<f32>) {
        let world = self.world;
        let mut starts = vec![0; self.top.places.len()];
        let mut lights = 0;
        for key in world.instances() {
            starts[slot_of(key) as usize] = lights;
            lights += world.instance(key).and_then(|i| world.tree(i.tree)).map_or(0, |tree| tree.lights().len());
        }
        chances.clear();
        chances.resize(lights, 0.0);
        let (root, beside) = (self.root(shading_point), self.directional(shading_point));
        let forest = &(self, shading_point);
        let total = with_vectors(Spread { root, splits: self.splits, beside, forest, starts: &starts, chances });
        chances.extend(world.directionals().map(|(_, light)| {
            let lux = illuminance(light, shading_point);
            if total > 0.0 { share(lux, total) } else { 0.0 }
        }));
    }

    /// Illuminance by directional lights, in lux.
    pub(crate) fn directional(&self, shading_point: &ShadingPoint) -> f32 {
        self.world.directionals().map(|(_, light)| illuminance(light, shading_point)).sum()
    }

    /// The top level.
    pub(crate) fn root(&self, shading_point: &ShadingPoint) -> Scene<'a> {
        Scene { nodes: &self.top.nodes, view: View::of(shading_point), instance: NO_INSTANCE, is_top: true }
    }

    fn pick_directional(&self, shading_point: &ShadingPoint, point: f32, total: f32) -> Option<LightPick> {
        let mut chosen = None;
        let mut before = 0.0;
        for (key, light) in self.world.directionals() {
            let value = illuminance(light, shading_point);
            if value > 0.0 && point >= before {
                chosen = Some(LightPick { light: LightId::Directional(key), pmf: share(value, total) });
            }
            before += value;
        }
        chosen
    }

    fn scene(&self, key: InstanceKey, shading_point: &ShadingPoint) -> Option<(&'a LightTree, Scene<'a>)> {
        let instance = self.world.instance(key)?;
        let tree = self.world.tree(instance.tree)?;
        let view = instance.placed.as_ref()?.view(shading_point);
        Some((tree, Scene { nodes: tree.nodes(), view, instance: slot_of(key), is_top: false }))
    }
}

/// Luminance of what a directional light brings to a shading point, in lux.
pub(crate) fn illuminance(light: &DirectionalLight, shading_point: &ShadingPoint) -> f32 {
    let cosine = if shading_point.normal == glam::Vec3::ZERO {
        1.0
    } else {
        -shading_point.normal.dot(light.direction.normalize())
    };
    luminance(light.illuminance) * cosine.max(0.0)
}

impl LightTree {
    /// Chooses a light of one tree, in the tree's own space: its index and the chance of that. As [`LightSampler::pick`];
    /// `splits` as in [`LightSampler::with_splits`].
    pub fn pick(&self, shading_point: &ShadingPoint, u: [f32; 2], splits: SplitCount) -> Option<(u32, f32)> {
        let draw = Draw { root: Scene::alone(self.nodes(), shading_point), splits, beside: 0.0, u, forest: &NoForest };
        match with_vectors(draw) {
            Drawn::Light(Picked { light, pmf, .. }) => Some((light, pmf)),
            Drawn::Beside { .. } | Drawn::Nothing => None,
        }
    }

    /// The chance that [`LightTree::pick`] chooses this light; 0 for an index that the tree does not have.
    pub fn pmf(&self, shading_point: &ShadingPoint, light: u32, splits: SplitCount) -> f32 {
        let Some(place) = self.leaves().get(light as usize) else { return 0.0 };
        let root = Scene::alone(self.nodes(), shading_point);
        let of = Wanted::Light(Leaf { scene: root, place: *place, top: None });
        with_vectors(Chance { root, splits, beside: 0.0, of, forest: &NoForest })
    }
}
