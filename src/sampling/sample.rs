//! Sampling and probabilities on the CPU: the top level, then the tree of one instance, and
//! directional lights beside them.
//!
//! Twin of `shaders/sample.wgsl`.

use std::fmt;

use crate::keys::{InstanceKey, LightId, slot_of};
use crate::math::dice::{choice_pmf, hashed_unit};
use crate::sampling::cut::{CutWork, DEFAULT_SPLITS, OwnCut, work_on_cut};
use crate::sampling::cuts::table::CutsInUse;
use crate::sampling::distribution::Distribution;
use crate::sampling::emit::{Incident, MIN_INVERSE_PDF, MIN_PDF, sample_light};
use crate::sampling::roots::FromRoots;
use crate::sampling::view::{WorldView, illuminance};
use crate::sampling::walk::{Draw, LeafPath, Outcome, PmfOf, TopPath, TreeLight};
use crate::shading::segment::LocalSegment;
use crate::shading::shading_point::ShadingPoint;
use crate::top::TopLevel;
use crate::tree::{ChildRef, LightTree, NO_LEAF, Node};
use crate::visibility::{CellGrid, LearntCell, VisibilityTable};
use crate::world::{Instance, LightWorld};

/// A light that [`LightSampler::pick`] chose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightPick {
    /// The light.
    pub light: LightId,
    /// The probability of this choice, in (0, 1].
    pub pmf: f32,
}

/// A light and a point on it that [`LightSampler::sample`] chose.
///
/// `brdf * cosine * incident.radiance / (pmf * incident.pdf)` estimates the light that arrives from
/// all lights, if the point is not in shadow. For a segment,
/// `phase * incident.radiance / (pmf * incident.pdf)` estimates the integral of what arrives over
/// the segment, where the phase function and any factor of the medium are those at
/// [`Incident::along`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// The light.
    pub light: LightId,
    /// The probability of the light, in (0, 1]; of a [`Reservoir`](crate::Reservoir) `1 / weight` in its place.
    pub pmf: f32,
    /// The light that arrives from the point, and the density of the point's direction.
    pub incident: Incident,
    /// The user data of the light's instance ([`Appearance::user_data`](crate::Appearance::user_data)); 0 for a directional
    /// light.
    pub user_data: u32,
}

/// Chooses lights of a [`LightWorld`] on the CPU, in proportion to the light that each of them
/// probably sends to a shading point.
///
/// [`LightWorld::sampler`] makes one. It borrows the world as it is, is `Copy`, and any number of
/// threads may share it.
///
/// | method | returns |
/// |---|---|
/// | [`sample`](Self::sample) | a light, a point on it, and what arrives from there |
/// | [`pick`](Self::pick) | a light and its probability |
/// | [`pmf`](Self::pmf) | the probability of a given light |
/// | [`hit`](Self::hit) | the first light that a ray hits, for multiple importance sampling |
/// | [`pdf`](Self::pdf) | the density of a point on a given light, for the same |
/// | [`resample`](Self::resample) | the best of several candidates, as a [`Reservoir`](crate::Reservoir) |
/// | [`reservoir_sample`](Self::reservoir_sample) | the light of a reservoir at any shading point |
/// | [`distribution`](Self::distribution) | the probabilities of all lights |
///
/// A light that sends anything to the shading point, unshadowed, has a probability above 0. The
/// probabilities of all lights and the probability of "no light" add up to 1, to rounding.
///
/// ```
/// use girandole::glam::{DVec3, Vec3};
/// use girandole::{Light, LightTree, LightWorld, Placement, Policy, ShadingPoint};
///
/// let mut world = LightWorld::new();
/// let lamp = world.add_tree(LightTree::new(vec![Light::point(Vec3::new(0.0, 6.0, 0.0), Vec3::splat(800.0))])?);
/// for x in [0.0, 10.0, 20.0] {
///     world.add_instance(lamp, Placement::at(DVec3::new(x, 0.0, 0.0)), Policy::Budgeted)?;
/// }
/// let sampler = world.sampler();
/// let ground = ShadingPoint::surface(Vec3::new(1.0, 0.0, 1.0), Vec3::Y);
///
/// // The mean of many samples is the illuminance by all lamps.
/// let mut lux = 0.0;
/// for i in 0..1000 {
///     let u = [(i as f32 + 0.5) / 1000.0, 0.5, 0.5, 0.5];
///     if let Some(sample) = sampler.sample(&ground, u) {
///         let cosine = sample.incident.direction.dot(ground.normal);
///         lux += sample.incident.radiance.x * cosine / (sample.pmf * sample.incident.pdf) / 1000.0;
///     }
/// }
/// let exact: f32 = sampler.all_lights().filter_map(|light| sampler.sample_light(&ground, light, [0.5, 0.5]))
///     .map(|incident| incident.radiance.x * incident.direction.dot(ground.normal))
///     .sum();
/// assert!((lux / exact - 1.0).abs() < 0.01);
/// # Ok::<(), girandole::WorldError>(())
/// ```
#[derive(Clone, Copy)]
pub struct LightSampler<'a> {
    pub(crate) world: &'a LightWorld,
    pub(crate) top: &'a TopLevel,
    pub(crate) splits: usize,
    /// What is learnt, and its cells relative to the world's origin.
    pub(crate) visibility: Option<(&'a VisibilityTable, CellGrid)>,
    /// Cuts that neighbours share.
    pub(crate) cuts: Option<CutsInUse<'a>>,
    /// Points without a cell choose from the roots.
    pub(crate) is_from_roots: bool,
}

impl fmt::Debug for LightSampler<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (instances, splits) = (self.world.instances().count(), self.splits);
        f.debug_struct("LightSampler").field("instances", &instances).field("splits", &splits).finish_non_exhaustive()
    }
}

impl LightWorld {
    /// Returns a sampler of the world as it is now, with lights as of the last
    /// [`LightWorld::update`].
    ///
    /// The first call after a change builds the top level, which takes O(n log n) in parts;
    /// later calls cost nothing. Engines that sample on the GPU only never pay for it.
    ///
    /// Any thread may call this, also inside a rayon job. Threads that make the first call at once
    /// may each build the top level; to build it once, call this before the parallel loop.
    pub fn sampler(&self) -> LightSampler<'_> {
        LightSampler::new(self, self.top_level())
    }
}

impl<'a> LightSampler<'a> {
    /// A sampler over a top level of a world.
    pub(crate) fn new(world: &'a LightWorld, top: &'a TopLevel) -> Self {
        Self { world, top, splits: DEFAULT_SPLITS, visibility: None, cuts: None, is_from_roots: false }
    }

    /// Chooses a light and a point on it. Call it once per sample and trace one shadow ray to the
    /// result.
    ///
    /// The four numbers of `u` are uniform in [0, 1), random or of a low-discrepancy sequence: two
    /// choose the light, two the point. They are independent of each other: if two are equal or one is
    /// fixed, lights are chosen with other frequencies than their probabilities. Numbers outside are
    /// clamped, and NaN counts as 0.
    ///
    /// `None` if no light can reach the shading point, or if the chosen point sends nothing to it.
    /// Both are ordinary: count the sample as black. The cost is that of [`LightSampler::pick`].
    pub fn sample(&self, shading_point: &ShadingPoint, u: [f32; 4]) -> Option<LightSample> {
        self.sample_picked(shading_point, self.pick(shading_point, [u[0], u[1]])?, [u[2], u[3]])
    }

    /// Chooses a point on a light that was picked.
    pub(crate) fn sample_picked(
        &self,
        shading_point: &ShadingPoint,
        pick: LightPick,
        u: [f32; 2],
    ) -> Option<LightSample> {
        let LightPick { light, pmf } = pick;
        let incident = self.sample_light(shading_point, light, u)?;
        let user_data = match light {
            LightId::Local { instance, .. } => self.world.instance(instance).map_or(0, |i| i.appearance.user_data),
            LightId::Directional(_) => 0,
        };
        Some(LightSample { light, pmf, incident, user_data })
    }

    /// Returns the same sampler with another number of splits, from 0 to [`MAX_SPLITS`](crate::MAX_SPLITS), as which
    /// larger numbers count. [`LightWorld::sampler`] has six.
    ///
    /// A split replaces a cluster of lights near the shading point by its children before a light
    /// is chosen. More splits lower the noise near lights, and each of them takes the time of one
    /// node; `docs/benchmarks.md` has the curve. Fewer clusters are split where no split would lower the noise. Between
    /// the extremes, one more is split where the root has only one child that is worth it. The probabilities of lights
    /// depend on the number: call all methods with the same one for one estimate.
    pub fn with_splits(self, splits: usize) -> Self {
        Self { splits, ..self }
    }

    /// Returns the same sampler without a cut for each point: points choose by walks from the roots of the
    /// trees, as shaders do where no cell has a cut. A choice is cheaper and has about twice the noise. Cuts that
    /// cells share are still used; learnt visibility is not.
    pub fn from_roots(self) -> Self {
        Self { is_from_roots: true, ..self }
    }

    /// Returns the same sampler with learnt visibility: lights that shadow rays did not reach from
    /// the neighbourhood of a shading point are chosen less often, down to a fortieth as often.
    ///
    /// All methods use it, with exact probabilities: call them with the same table for one
    /// estimate. Where the table knows nothing, they return the same bits as without it. A sample
    /// takes about 1.6 to 1.9 times as long (docs/benchmarks.md). [`VisibilityTable`] says when to use it.
    pub fn with_visibility(self, table: &'a VisibilityTable) -> Self {
        Self { visibility: Some((table, table.grid(self.world.origin()))), ..self }
    }

    /// The same sampler over another top level of the same world.
    #[cfg(test)]
    pub(crate) fn with_top(self, top: &'a TopLevel) -> Self {
        Self { top, ..self }
    }

    /// Chooses a light, without a point on it. `u` is as the first two numbers of
    /// [`LightSampler::sample`].
    ///
    /// `None` if no light can reach the shading point. The cost is one node for each split and for
    /// each level below the clusters, whatever the number of lights: about a microsecond. Source:
    /// CK18 5; `cut.rs` names the differences.
    pub fn pick(&self, shading_point: &ShadingPoint, u: [f32; 2]) -> Option<LightPick> {
        self.picked(shading_point, self.on_cut(&self.view(shading_point), Draw(u)))
    }

    /// The pick that the result of a draw stands for.
    pub(crate) fn picked(&self, shading_point: &ShadingPoint, outcome: Outcome) -> Option<LightPick> {
        match outcome {
            Outcome::Light(TreeLight { instance, light, pmf }) => {
                Some(LightPick { light: LightId::Local { instance: self.world.instance_at(instance)?, light }, pmf })
            }
            Outcome::Directional { offset, total } => self.pick_directional(shading_point, offset, total),
            Outcome::Nothing => None,
        }
    }

    /// Returns the probability with which [`LightSampler::pick`] and [`LightSampler::sample`]
    /// choose a light.
    ///
    /// It is in [0, 1], and agrees with the `pmf` that they return up to rounding. 0 for a light
    /// that is dark, that cannot reach the shading point, or that does not exist. The cost is that
    /// of [`LightSampler::pick`].
    pub fn pmf(&self, shading_point: &ShadingPoint, light: LightId) -> f32 {
        let view = self.view(shading_point);
        let of = match light {
            LightId::Directional(key) => match self.world.directional(key) {
                Some(light) => PmfOf::Directional(illuminance(light, shading_point)),
                None => return 0.0,
            },
            LightId::Local { instance, light } => match self.leaf_path(&view, instance, light) {
                Some(path) => PmfOf::Light(path),
                None => return 0.0,
            },
        };
        self.on_cut(&view, of)
    }

    /// Chooses a point on a given light. `u` is as the last two numbers of
    /// [`LightSampler::sample`].
    ///
    /// `None` if the point sends nothing to the shading point, or if the light does not exist.
    ///
    /// For a segment this is a point of the light as seen from a point of the segment: see
    /// [`Incident::along`]. The first number chooses the point of the segment as
    /// [`LightSampler::sample_along`] does; the second, and a hash of both, the point on the light.
    pub fn sample_light(&self, shading_point: &ShadingPoint, light: LightId, u: [f32; 2]) -> Option<Incident> {
        if LocalSegment::of(shading_point).is_none() {
            return self.sample_light_from(shading_point, light, u);
        }
        let at = self.sample_along(shading_point, light, u[0])?;
        let incident = self.sample_light_from(&at.shading_point, light, [u[1], hashed_unit(u)])?;
        let pdf = (incident.pdf * at.pdf).clamp(MIN_PDF, 1.0 / MIN_INVERSE_PDF);
        Some(Incident { along: at.along, pdf, ..incident })
    }

    /// [`LightSampler::sample_light`] for a point.
    fn sample_light_from(&self, shading_point: &ShadingPoint, light: LightId, u: [f32; 2]) -> Option<Incident> {
        match light {
            LightId::Directional(key) => {
                let light = self.world.directional(key)?;
                (illuminance(light, shading_point) > 0.0).then(|| Incident {
                    direction: -light.direction.normalize(),
                    dist: f32::INFINITY,
                    radiance: light.illuminance,
                    pdf: 1.0,
                    is_delta: true,
                    along: 0.0,
                })
            }
            LightId::Local { instance, light } => {
                let placed = self.world.instance(instance)?;
                (placed.appearance.mask & shading_point.mask != 0).then_some(())?;
                if placed.is_sky {
                    let incident = self.sample_sky(placed.shown()?, shading_point, light, u)?;
                    return Some(Incident { radiance: placed.appearance.arriving(incident.radiance)?, ..incident });
                }
                let light = self.world.tree(placed.tree)?.lights().get(light as usize)?;
                let by_solid_angle = self.world.solid_angle_sampling();
                let frame = &placed.shown()?.frame(self.world.home());
                // Two calls, so that what is returned without a factor is not copied.
                if !placed.appearance.has_factor() {
                    return sample_light(light, frame, shading_point, by_solid_angle, u);
                }
                let incident = sample_light(light, frame, shading_point, by_solid_angle, u)?;
                Some(Incident { radiance: placed.appearance.arriving(incident.radiance)?, ..incident })
            }
        }
    }

    /// Iterates over every light that can be sampled: those of all instances, then the directional
    /// lights. The indices of removed lights are among them, until they are used again.
    pub fn all_lights(&self) -> impl Iterator<Item = LightId> + use<'a> {
        let world = self.world;
        let local = world.instances().flat_map(move |instance| {
            let lights = world.instance(instance).and_then(|i| world.tree(i.tree)).map_or(0, |t| t.lights().len());
            (0..lights as u32).map(move |light| LightId::Local { instance, light })
        });
        local.chain(world.directional_lights().map(|(key, _)| LightId::Directional(key)))
    }

    /// The nodes of the top level, the tree over all instances, for tools that draw or measure trees.
    /// The root is the first one; without instances it has no children. Boxes are in world space,
    /// relative to [`LightWorld::origin`]. [`LightSampler::top_leaf`] tells what a leaf stands for.
    ///
    /// On a GPU the top level is built there, by the same steps; its nodes may differ by rounding.
    pub fn top_nodes(&self) -> &'a [Node] {
        &self.world.top_level().nodes
    }

    /// What a leaf of the top level stands for: an instance, and the node or the light of the
    /// instance's tree at which the choice goes on. That node is the root unless the tree is divided
    /// among several leaves. `leaf` is that of [`ChildRef::Leaf`] in [`LightSampler::top_nodes`]. `None`
    /// for any other number.
    pub fn top_leaf(&self, leaf: u32) -> Option<(InstanceKey, ChildRef)> {
        let part = self.world.top_level().part(leaf)?;
        Some((self.world.instance_at(part.slot)?, part.entry))
    }

    /// Computes the probability of every light, in the order of [`LightSampler::all_lights`]: what
    /// [`LightSampler::pmf`] returns for each, up to rounding.
    ///
    /// Replaces the content of `pmfs`. Their sum is 1 less the probability of "no light"; all are 0
    /// where no light can be chosen. O(lights of all instances), though clusters that are proved
    /// dark cost only their zeros. Allocates eight bytes per slot besides `pmfs`.
    pub fn distribution(&self, shading_point: &ShadingPoint, pmfs: &mut Vec<f32>) {
        let world = self.world;
        let mut starts = vec![0; world.slot_count()];
        let mut lights = 0;
        for key in world.instances() {
            starts[slot_of(key) as usize] = lights;
            lights += world.instance(key).and_then(|i| world.tree(i.tree)).map_or(0, |tree| tree.lights().len());
        }
        pmfs.clear();
        pmfs.resize(lights, 0.0);
        let total = self.on_cut(&self.view(shading_point), Distribution { starts: &starts, pmfs });
        pmfs.extend(world.directional_lights().map(|(_, light)| {
            let lux = illuminance(light, shading_point);
            if total > 0.0 { choice_pmf(lux, total) } else { 0.0 }
        }));
    }

    /// The world as a shading point sees it.
    pub(crate) fn view<'s>(&self, shading_point: &'s ShadingPoint) -> WorldView<'a, 's> {
        WorldView::new(self.world, self.top, shading_point)
    }

    /// Does some work on the candidates of a shading point.
    pub(crate) fn on_cut<W: CutWork<'a>>(&self, view: &WorldView<'a, '_>, work: W) -> W::Output {
        match self.shared_cut(view.shading_point) {
            Some(source) => work_on_cut(source, view, work),
            None if self.is_from_roots => work_on_cut(FromRoots, view, work),
            None => {
                // Where cells share cuts, those alone know what is learnt: looking it up for the few points without
                // a cell took longer than it gained.
                let learnt = if self.cuts.is_none() { self.learnt(view.shading_point) } else { None };
                work_on_cut(OwnCut { splits: self.splits }, &WorldView { learnt, ..*view }, work)
            }
        }
    }

    /// What is learnt about the cell of a shading point.
    pub(crate) fn learnt(&self, shading_point: &ShadingPoint) -> Option<LearntCell<'a>> {
        let (table, grid) = self.visibility.as_ref()?;
        table.cell(&grid.cell(shading_point))
    }

    /// The way up from a light of an instance; `None` if there is no such light.
    pub(crate) fn leaf_path(
        &self,
        view: &WorldView<'a, '_>,
        instance: InstanceKey,
        light: u32,
    ) -> Option<LeafPath<'a>> {
        let (lights, tree) = view.instance_tree(instance)?;
        let place = *lights.leaves().get(light as usize).filter(|place| **place != NO_LEAF)?;
        let Instance { tree: key, is_sky, .. } = *self.world.instance(instance)?;
        let top = || TopPath {
            tree: view.root,
            places: self.top.places(slot_of(instance)),
            openings: self.world.openings(key),
        };
        Some(LeafPath { tree, place, top: (!is_sky).then(top) })
    }

    /// The directional light at a point of the line from 0 to the illuminance by all of them.
    /// `total` includes the trees.
    fn pick_directional(&self, shading_point: &ShadingPoint, point: f32, total: f32) -> Option<LightPick> {
        let mut chosen = None;
        let mut before = 0.0;
        for (key, light) in self.world.directional_lights() {
            let lux = illuminance(light, shading_point);
            if lux > 0.0 && point >= before {
                chosen = Some(LightPick { light: LightId::Directional(key), pmf: choice_pmf(lux, total) });
            }
            before += lux;
        }
        chosen
    }
}

impl LightTree {
    /// Chooses a light of this tree alone: returns its index and its probability.
    ///
    /// The shading point is in the tree's space. `u` and the result are as for
    /// [`LightSampler::pick`], `splits` as for [`LightSampler::with_splits`].
    pub fn pick(&self, shading_point: &ShadingPoint, u: [f32; 2], splits: usize) -> Option<(u32, f32)> {
        let view = WorldView::of_tree(self.nodes(), shading_point);
        match work_on_cut(OwnCut { splits }, &view, Draw(u)) {
            Outcome::Light(TreeLight { light, pmf, .. }) => Some((light, pmf)),
            Outcome::Directional { .. } | Outcome::Nothing => None,
        }
    }

    /// Returns the probability with which [`LightTree::pick`] chooses a light; 0 for an index that
    /// the tree does not have and for that of a removed light.
    pub fn pmf(&self, shading_point: &ShadingPoint, light: u32, splits: usize) -> f32 {
        let Some(place) = self.leaves().get(light as usize).filter(|place| **place != NO_LEAF) else { return 0.0 };
        let view = WorldView::of_tree(self.nodes(), shading_point);
        let path = LeafPath { tree: view.root, place: *place, top: None };
        work_on_cut(OwnCut { splits }, &view, PmfOf::Light(path))
    }
}
