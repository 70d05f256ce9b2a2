//! Sampling and probabilities on the CPU: the top level, then the tree of one instance, and
//! directional lights beside them.
//!
//! Twin of `shaders/sample.wgsl`.

use std::fmt;

use glam::{Mat3, Vec3};

use crate::instance::part::{Part, SINGLE};
use crate::instance::portal::PortalsInSight;
use crate::keys::{InstanceKey, LightId, slot_of};
use crate::light::{DirectionalLight, luminance};
use crate::math::dice::{choice_pmf, clamp_unit, hashed_unit};
use crate::math::simd::with_vectors;
use crate::sampling::cut::{DEFAULT_SPLITS, InstanceTrees, NO_INSTANCE, NoInstances, OwnCut, TreeView};
use crate::sampling::cuts::table::CutsInUse;
use crate::sampling::distribution::DistributionJob;
use crate::sampling::emit::{Incident, MIN_INVERSE_PDF, MIN_PDF, sample_light};
use crate::sampling::equiangular::Stretch;
use crate::sampling::roots::FromRoots;
use crate::sampling::walk::{DrawJob, LeafPath, Outcome, PmfJob, PmfQuery, TopPath, TreeLight};
use crate::shading::importance::{ChildImportances, LocalShadingPoint};
use crate::shading::segment::LocalSegment;
use crate::shading::shading_point::ShadingPoint;
use crate::sky::SKY_DIST;
use crate::top::TopLevel;
use crate::tree::{ChildRef, Lanes, LightTree, NO_LEAF, Node, WIDTH};
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

/// The trees of a sampler's instances as seen from a shading point.
#[derive(Clone, Copy)]
pub(crate) struct WorldTrees<'a, 's> {
    sampler: &'s LightSampler<'a>,
    shading_point: &'s ShadingPoint,
    /// What is learnt about the cell of the shading point.
    learnt: Option<LearntCell<'a>>,
    /// Whether masks may hide lights.
    has_masks: bool,
    /// The slot of the sky, and the portals through which it is seen.
    pub portals: Option<(u32, PortalsInSight<'a>)>,
}

impl<'a> InstanceTrees<'a> for WorldTrees<'a, '_> {
    fn tree_view(&self, leaf: u32) -> Option<(TreeView<'a>, ChildRef)> {
        let sampler = self.sampler;
        let Part { slot, entry } = sampler.top.part(leaf)?;
        let (_, tree) = sampler.tree_view(sampler.world.instance_at(slot)?, self.shading_point)?;
        (!tree.nodes.is_empty()).then_some((tree, entry))
    }

    fn sky(&self) -> Option<TreeView<'a>> {
        self.sampler.sky_view(self.shading_point)
    }

    #[inline(always)]
    fn visible_shares(&self, tree: &TreeView<'a>, node: &Node) -> Option<Lanes> {
        let learnt = self.learnt.as_ref()?;
        Some(learnt.shares(node, &tree.local, &self.sampler.world_of(tree)))
    }

    #[inline(always)]
    fn hides(&self) -> bool {
        self.has_masks || self.portals.is_some()
    }

    #[inline(always)]
    fn weigh_masks(&self, tree: &TreeView<'a>, node: u32, record: &Node, children: &mut ChildImportances) {
        // Below the top level all lights have the mask of one instance.
        if !tree.is_top() {
            if let Some((_, portals)) = self.portals.as_ref().filter(|(sky, _)| *sky == tree.instance) {
                portals.weigh(record, children);
            }
            return;
        }
        let (mask, masks) = (self.shading_point.mask, &self.sampler.top.masks);
        let met = self.sampler.met_children(tree, node, mask);
        for slot in 0..WIDTH {
            if !met[slot] {
                children.importance[slot] = 0.0;
            } else if let Some(ChildRef::Node(child)) = record.child(slot) {
                children.importance[slot] *= masks.get(child as usize).map_or(1.0, |masks| masks.shares.seen(mask));
            }
        }
    }
}

impl<'a> WorldTrees<'a, '_> {
    /// The same with what is learnt about the cell of the shading point.
    pub fn with(self, learnt: Option<LearntCell<'a>>) -> Self {
        Self { learnt, ..self }
    }
}

/// Evaluates an expression for a shading point with the source of its candidates, the illuminance by
/// directional lights in lux, and a reference to the trees around it. There is a copy of the expression
/// for each kind of source.
macro_rules! with_cut {
    ($sampler:expr, $shading_point:expr, |$source:ident, $directional_lux:ident, $trees:ident| $run:expr) => {{
        let $trees = &$sampler.world_trees($shading_point);
        let $directional_lux = $sampler.directional_lux($shading_point);
        match $sampler.shared_cut($shading_point, $directional_lux) {
            Some($source) => $run,
            None if $sampler.is_from_roots => {
                let $source = $sampler.root_cut($shading_point, $directional_lux);
                $run
            }
            None => {
                let $source = $sampler.own_cut($shading_point, $directional_lux);
                // Where cells share cuts, those alone know what is learnt: looking it up for the few points without
                // a cell took longer than it gained.
                let learnt = if $sampler.cuts.is_none() { $sampler.learnt($shading_point) } else { None };
                let $trees = &$trees.with(learnt);
                $run
            }
        }
    }};
}
pub(crate) use with_cut;

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
        LightSampler {
            world: self,
            top: self.top_level(),
            splits: DEFAULT_SPLITS,
            visibility: None,
            cuts: None,
            is_from_roots: false,
        }
    }
}

impl<'a> LightSampler<'a> {
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
        let outcome = with_cut!(self, shading_point, |source, directional_lux, instance_trees| {
            with_vectors(DrawJob { source, directional_lux, u, instance_trees })
        });
        self.picked(shading_point, outcome)
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
        let query = match light {
            LightId::Directional(key) => match self.world.directional(key) {
                Some(light) => PmfQuery::Directional(illuminance(light, shading_point)),
                None => return 0.0,
            },
            LightId::Local { instance, light } => match self.leaf_path(instance, light, shading_point) {
                Some(path) => PmfQuery::Light(path),
                None => return 0.0,
            },
        };
        with_cut!(self, shading_point, |source, directional_lux, instance_trees| {
            with_vectors(PmfJob { source, directional_lux, query, instance_trees })
        })
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
        match LocalSegment::of(shading_point) {
            None => self.sample_light_from(shading_point, light, u),
            Some(segment) => self.sample_light_along(shading_point, &segment, light, u),
        }
    }

    fn sample_light_along(
        &self,
        shading_point: &ShadingPoint,
        segment: &LocalSegment,
        light: LightId,
        u: [f32; 2],
    ) -> Option<Incident> {
        let (along, pdf) = self.stretch(shading_point, segment, light)?.sample(clamp_unit(u[0]));
        let from = ShadingPoint::volume(shading_point.position + segment.unit * (along - segment.half));
        let from = from.with_mask(shading_point.mask);
        let incident = self.sample_light_from(&from, light, [u[1], hashed_unit(u)])?;
        let pdf = (incident.pdf * pdf).clamp(MIN_PDF, 1.0 / MIN_INVERSE_PDF);
        Some(Incident { along, pdf, ..incident })
    }

    /// The part of a segment that a light may reach; `None` if there is none.
    pub(crate) fn stretch(
        &self,
        shading_point: &ShadingPoint,
        segment: &LocalSegment,
        light: LightId,
    ) -> Option<Stretch> {
        match light {
            LightId::Directional(key) => self.world.directional(key).map(|_| Stretch::uniform(segment)),
            LightId::Local { instance, light } => {
                let placed = self.world.instance(instance)?;
                if placed.is_sky {
                    return Some(Stretch::uniform(segment));
                }
                let light = self.world.tree(placed.tree)?.lights().get(light as usize)?;
                Stretch::of(light, &placed.shown()?.frame(self.world.home()), shading_point, segment)
            }
        }
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
        let starts = &starts;
        let total = with_cut!(self, shading_point, |source, directional_lux, instance_trees| {
            with_vectors(DistributionJob { source, directional_lux, instance_trees, starts, pmfs })
        });
        pmfs.extend(world.directional_lights().map(|(_, light)| {
            let lux = illuminance(light, shading_point);
            if total > 0.0 { choice_pmf(lux, total) } else { 0.0 }
        }));
    }

    /// The illuminance by all directional lights, in lux.
    pub(crate) fn directional_lux(&self, shading_point: &ShadingPoint) -> f32 {
        self.world.directional_lights().map(|(_, light)| illuminance(light, shading_point)).sum()
    }

    /// What splits the trees for one shading point.
    pub(crate) fn own_cut(&self, shading_point: &ShadingPoint, directional_lux: f32) -> OwnCut<'a> {
        OwnCut { root: self.root(shading_point), splits: self.splits, directional_lux }
    }

    /// What chooses from the roots for one shading point.
    pub(crate) fn root_cut(&self, shading_point: &ShadingPoint, directional_lux: f32) -> FromRoots<'a> {
        FromRoots { top: self.root(shading_point), directional_lux }
    }

    /// The trees of all instances as seen from a shading point that has learnt nothing.
    pub(crate) fn world_trees<'s>(&'s self, shading_point: &'s ShadingPoint) -> WorldTrees<'a, 's> {
        let has_masks = !self.top.masks.is_empty() || shading_point.mask == 0;
        WorldTrees { sampler: self, shading_point, learnt: None, has_masks, portals: self.portals(shading_point) }
    }

    /// Whether the masks of instances below each child of a node and a mask have a bit in common. All of them in a
    /// tree, whose lights have the mask of one instance.
    #[inline(always)]
    pub(crate) fn met_children(&self, tree: &TreeView<'_>, node: u32, mask: u32) -> [bool; WIDTH] {
        if !tree.is_top() {
            return [true; WIDTH];
        }
        let unions = self.top.masks.get(node as usize).map_or([u32::MAX; WIDTH], |masks| masks.children);
        unions.map(|union| union & mask != 0)
    }

    /// What is learnt about the cell of a shading point.
    pub(crate) fn learnt(&self, shading_point: &ShadingPoint) -> Option<LearntCell<'a>> {
        let (table, grid) = self.visibility.as_ref()?;
        table.cell(&grid.cell(shading_point))
    }

    /// The linear part of the map to the world from the space in which a tree is seen.
    pub(crate) fn world_of(&self, tree: &TreeView<'_>) -> Mat3 {
        let instance = || self.world.instance(self.world.instance_at(tree.instance)?);
        let of_instance = || Some(instance()?.shown()?.linear.linear);
        let axes = tree.local.map.map(|map| map.axes).or_else(of_instance).unwrap_or(Mat3::IDENTITY);
        if instance().is_some_and(|instance| instance.is_sky) { axes * SKY_DIST } else { axes }
    }

    /// The top level.
    pub(crate) fn root(&self, shading_point: &ShadingPoint) -> TreeView<'a> {
        let local = LocalShadingPoint { light_bit: SINGLE, ..LocalShadingPoint::of(shading_point) };
        TreeView { nodes: &self.top.nodes, local, instance: NO_INSTANCE }
    }

    /// The way up from a light of an instance; `None` if there is no such light.
    pub(crate) fn leaf_path(
        &self,
        instance: InstanceKey,
        light: u32,
        shading_point: &ShadingPoint,
    ) -> Option<LeafPath<'a>> {
        let (lights, tree) = self.tree_view(instance, shading_point)?;
        let place = *lights.leaves().get(light as usize).filter(|place| **place != NO_LEAF)?;
        let Instance { tree: key, is_sky, .. } = *self.world.instance(instance)?;
        let top = || TopPath {
            tree: self.root(shading_point),
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

    /// The tree of an instance by its slot, or the top level for [`NO_INSTANCE`].
    pub(crate) fn view_at(&self, instance: u32, shading_point: &ShadingPoint) -> Option<TreeView<'a>> {
        if instance == NO_INSTANCE {
            return Some(self.root(shading_point));
        }
        Some(self.tree_view(self.world.instance_at(instance)?, shading_point)?.1)
    }

    pub(crate) fn tree_view(
        &self,
        key: InstanceKey,
        shading_point: &ShadingPoint,
    ) -> Option<(&'a LightTree, TreeView<'a>)> {
        let instance = self.world.instance(key)?;
        let tree = self.world.tree(instance.tree)?;
        let (placed, home, brightness) = (instance.shown()?, self.world.home(), instance.appearance.brightness());
        let local = if instance.is_sky {
            // It is as far from every point.
            let here = ShadingPoint { position: placed.translation(home), segment: Vec3::ZERO, ..*shading_point };
            LocalShadingPoint { is_sky: true, ..placed.local_shading_point(&here, home, brightness) }
        } else {
            placed.local_shading_point(shading_point, home, brightness)
        };
        Some((tree, TreeView { nodes: tree.nodes(), local, instance: slot_of(key) }))
    }
}

/// What a directional light is chosen by: its illuminance at a shading point, as luminance in lux,
/// times the reflectance of a glossy surface.
#[allow(clippy::manual_clamp, reason = "not the same for NaN")]
pub(crate) fn illuminance(light: &DirectionalLight, shading_point: &ShadingPoint) -> f32 {
    let toward = -light.direction.normalize();
    let cosine = if shading_point.normal == Vec3::ZERO { 1.0 } else { shading_point.normal.dot(toward) };
    // At most 1, whatever the length of the normal is, and 0 for NaN.
    let lux = luminance(light.illuminance) * cosine.max(0.0).min(1.0);
    match LocalShadingPoint::gloss_of(shading_point) {
        Some(gloss) if lux > 0.0 => lux * gloss.toward(toward, cosine),
        _ => lux,
    }
}

impl LightTree {
    /// Chooses a light of this tree alone: returns its index and its probability.
    ///
    /// The shading point is in the tree's space. `u` and the result are as for
    /// [`LightSampler::pick`], `splits` as for [`LightSampler::with_splits`].
    pub fn pick(&self, shading_point: &ShadingPoint, u: [f32; 2], splits: usize) -> Option<(u32, f32)> {
        let source = OwnCut { root: TreeView::of_tree(self.nodes(), shading_point), splits, directional_lux: 0.0 };
        match with_vectors(DrawJob { source, directional_lux: 0.0, u, instance_trees: &NoInstances }) {
            Outcome::Light(TreeLight { light, pmf, .. }) => Some((light, pmf)),
            Outcome::Directional { .. } | Outcome::Nothing => None,
        }
    }

    /// Returns the probability with which [`LightTree::pick`] chooses a light; 0 for an index that
    /// the tree does not have and for that of a removed light.
    pub fn pmf(&self, shading_point: &ShadingPoint, light: u32, splits: usize) -> f32 {
        let Some(place) = self.leaves().get(light as usize).filter(|place| **place != NO_LEAF) else { return 0.0 };
        let root = TreeView::of_tree(self.nodes(), shading_point);
        let query = PmfQuery::Light(LeafPath { tree: root, place: *place, top: None });
        let source = OwnCut { root, splits, directional_lux: 0.0 };
        with_vectors(PmfJob { source, directional_lux: 0.0, query, instance_trees: &NoInstances })
    }
}
