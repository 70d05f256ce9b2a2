//! Builds the cut of a cell for a few of its points.
//!
//! A candidate's weight is the root of its mean squared share of the light at the points. A candidate is
//! split that is most in doubt, or whose share differs most between points. docs/math.md has the
//! reasons, and docs/decisions.md, 80, the numbers.

use crate::math::simd::{VectorJob, with_vectors};
use crate::sampling::cut::MIN_DOUBT;
use crate::sampling::cuts::cell::POINTS;
use crate::sampling::cuts::keep::{SKY_ROOT, below, flux_step, name};
use crate::sampling::cuts::shared::{CONTESTED, Contested, MIN_SIDE, NodeId, SHARED_NODES, SharedCut, SkyState, UNITS};
use crate::sampling::sample::LightSampler;
use crate::sampling::view::{NO_INSTANCE, WorldView};
use crate::shading::importance::{
    ChildImportances, UNRESOLVED_DOUBT, resolved_sum, scale_unresolved, unresolved_scale, unresolved_sum,
};
use crate::shading::shading_point::ShadingPoint;
use crate::tree::{Lanes, WIDTH};
use crate::visibility::LearntCell;

/// A candidate is split only while its doubt and the deviation of its share are more than this share of
/// all light. A cell splits further than a point does, since many samples pay for it.
pub(crate) const MIN_SHARED_DOUBT: f32 = 0.25 * MIN_DOUBT;

/// What the deviation of a candidate's shares counts, relative to the doubt about it.
pub(crate) const DEVIATION: f32 = 2.0;

/// Nodes are contested while what all others disagree by, the sum of the roots of mean squared shares beyond their
/// means, is at least this.
pub(crate) const DISAGREEMENT: f32 = 0.01;

/// The part of the samples that is spread evenly over all candidates, so that none is ever starved.
pub(crate) const EVEN: f32 = 0.01;

/// The part of the samples that is spread by the light at the middle of the cell, from all sides.
pub(crate) const CENTER: f32 = 0.01;

/// The low bits of a key, which do not belong to the priority: the number of a child.
pub(crate) const CHILD_BITS: u32 = (SHARED_NODES * WIDTH) as u32 - 1;

/// The points of a cell and its middle, which comes last.
const VIEWS: usize = POINTS + 1;

/// What is known of a node whose children are candidates.
#[derive(Clone, Copy, Default)]
struct Opened {
    id: NodeId,
    /// The child that it was: see [`SharedCut::from`].
    from: u8,
    /// The importances of the children for each point; 0 for a child that was split.
    importance: [Lanes; VIEWS],
    /// The sums of the resolved importances.
    sums: [f32; VIEWS],
    /// What is split next.
    priority: Lanes,
    /// Bits of the children that may send light to some point of the cell, by its mask.
    lit: u8,
}

/// A cut that is being made.
struct Sketch<'s, 'a> {
    sampler: &'s LightSampler<'a>,
    /// The world as seen from the points of the cell, and from its middle, which is the last one.
    views: [WorldView<'a, 's>; VIEWS],
    /// The number of points.
    points: usize,
    opened: [Opened; SHARED_NODES],
    count: usize,
}

/// Builds the cut of a cell for a few of its points, at most [`POINTS`] and at least one, and for its middle. It has no
/// nodes if no light reaches any of the points.
pub(crate) fn build(sampler: &LightSampler<'_>, points: &[ShadingPoint], center: &ShadingPoint, cut: &mut SharedCut) {
    with_vectors(BuildJob { sampler, points, center, cut });
}

struct BuildJob<'s, 'a> {
    sampler: &'s LightSampler<'a>,
    points: &'s [ShadingPoint],
    center: &'s ShadingPoint,
    cut: &'s mut SharedCut,
}

impl VectorJob for BuildJob<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { sampler, points, center, cut } = self;
        let mut sketch = Sketch::new(sampler, points, center);
        sketch.split();
        sketch.finish(cut);
    }
}

impl<'s, 'a> Sketch<'s, 'a> {
    #[inline(always)]
    fn new(sampler: &'s LightSampler<'a>, points: &'s [ShadingPoint], center: &'s ShadingPoint) -> Self {
        let view = |k: usize| match points.get(k) {
            Some(point) => WorldView { learnt: sampler.learnt(point), ..sampler.view(point) },
            // The middle is of no surface, and stands for all points of the cell, which may see other parts of the sky.
            None => WorldView { portals: None, ..sampler.view(center) },
        };
        let views = std::array::from_fn(view);
        Self { sampler, views, points: points.len(), opened: [Opened::default(); SHARED_NODES], count: 0 }
    }

    /// The world as the middle sees it.
    fn middle(&self) -> &WorldView<'a, 's> {
        &self.views[POINTS]
    }

    /// The numbers of the points and of the middle.
    fn views(&self) -> impl Iterator<Item = usize> + use<> {
        (0..self.points).chain([POINTS])
    }

    /// Splits until no split is worth its time, or as often as there is room.
    #[inline(always)]
    fn split(&mut self) {
        let mut next = (NodeId { instance: NO_INSTANCE, node: 0 }, 0);
        let mut sky = self.middle().sky().map(|tree| NodeId { instance: tree.instance, node: 0 });
        while self.add(next).is_some() && self.count < SHARED_NODES {
            if let Some(root) = sky.take() {
                next = (root, SKY_ROOT);
                continue;
            }
            let Some((index, slot, child)) = self.next() else { break };
            self.remove(index, slot);
            next = (child, (index * WIDTH + slot) as u8);
        }
    }

    /// Makes a node's children candidates. `None` if there is no such node.
    #[inline(always)]
    fn add(&mut self, (id, from): (NodeId, u8)) -> Option<()> {
        let mut opened = Opened { id, from, ..self.opened[self.count] };
        let mut doubts = [[0.0; WIDTH]; POINTS];
        // Points in the same row see each child in the same group.
        let mut last: Option<(LearntCell<'a>, Lanes)> = None;
        for k in self.views() {
            let view = &self.views[k];
            let tree = view.tree(id.instance)?;
            let record = tree.nodes.get(id.node as usize)?;
            let ChildImportances { mut importance, doubt } = view.importances(&tree, id.node, record);
            if let Some(learnt) = &view.learnt {
                let (_, shares) = match last {
                    Some(known) if std::ptr::eq(known.0.shares, learnt.shares) => known,
                    _ => (*learnt, learnt.shares(record, &tree.local, &view.to_world(&tree))),
                };
                last = Some((*learnt, shares));
                for slot in 0..WIDTH {
                    importance[slot] *= shares[slot];
                }
            }
            opened.sums[k] = resolved_sum(&importance);
            opened.importance[k] = importance;
            if k < POINTS {
                doubts[k] = doubt;
            } else {
                let met = view.met_children(id.instance, id.node);
                for slot in 0..WIDTH {
                    opened.lit |= u8::from(record.flux[slot] > 0 && met[slot]) << slot;
                }
            }
        }
        self.opened[self.count] = opened;
        self.count += 1;
        self.opened[self.count - 1].priority = self.priorities(&opened, &doubts);
        Some(())
    }

    /// All light at a point that is known to be resolved.
    fn total(&self, view: usize) -> f32 {
        self.opened[..self.count].iter().map(|opened| opened.sums[view]).sum::<f32>() + self.views[view].directional_lux
    }

    /// What is split next: the mean doubt, and the deviation of the shares.
    #[inline(always)]
    fn priorities(&self, opened: &Opened, doubts: &[Lanes; POINTS]) -> Lanes {
        let count = self.points;
        let (mut priority, mut sums, mut squares) = ([0.0; WIDTH], [0.0; WIDTH], [0.0; WIDTH]);
        for view in 0..count {
            let total = self.total(view);
            let scale = if total > 0.0 { 1.0 / total } else { 0.0 };
            for slot in 0..WIDTH {
                let importance = opened.importance[view][slot];
                let share = importance.max(0.0) * scale;
                // Unresolved children come first.
                let doubt = if importance < 0.0 { UNRESOLVED_DOUBT } else { share * doubts[view][slot] };
                priority[slot] += doubt;
                sums[slot] += share;
                squares[slot] += share * share;
            }
        }
        let inverse = 1.0 / count as f32;
        for slot in 0..WIDTH {
            let mean = sums[slot] * inverse;
            let variance = (squares[slot] * inverse - mean * mean).max(0.0);
            priority[slot] = priority[slot] * inverse + DEVIATION * variance.sqrt();
        }
        priority
    }

    /// The candidate to split next, as an opened node, a slot and the node that replaces it. `None` if no
    /// split is worth its time.
    #[inline(always)]
    fn next(&mut self) -> Option<(usize, usize, NodeId)> {
        loop {
            // The last bits of a key name the child, so the first of equal priorities is the greatest.
            let mut greatest = 0;
            let priorities = self.opened[..self.count].iter().flat_map(|opened| opened.priority);
            for (child, priority) in (0..).zip(priorities) {
                greatest = greatest.max((priority.to_bits() & !CHILD_BITS) | (CHILD_BITS - child));
            }
            if f32::from_bits(greatest & !CHILD_BITS) <= MIN_SHARED_DOUBT {
                return None;
            }
            let child = (CHILD_BITS - (greatest & CHILD_BITS)) as usize;
            let (index, slot) = (child / WIDTH, child % WIDTH);
            if let Some(node) = below(self.middle(), self.opened[index].id, slot) {
                return Some((index, slot, node));
            }
            // A single light cannot be split.
            self.opened[index].priority[slot] = 0.0;
        }
    }

    /// Removes a candidate, whose own children replace it.
    fn remove(&mut self, index: usize, slot: usize) {
        let views = self.views();
        let opened = &mut self.opened[index];
        opened.priority[slot] = 0.0;
        opened.lit &= !(1 << slot);
        for view in views {
            opened.importance[view][slot] = 0.0;
            opened.sums[view] = resolved_sum(&opened.importance[view]);
        }
    }

    /// Turns importances into shares of all light at each point, in which unresolved candidates have at
    /// most as much as all others. Returns all light at each point, and the shares of directional lights.
    fn shares(&mut self) -> [[f32; VIEWS]; 2] {
        let (mut all, mut directional) = ([0.0; VIEWS], [0.0; VIEWS]);
        for view in self.views() {
            let others = self.total(view);
            let opened = &mut self.opened[..self.count];
            let unresolved: f32 = opened.iter().map(|opened| unresolved_sum(&opened.importance[view])).sum();
            let scale = unresolved_scale(others, unresolved);
            let total = others + unresolved * scale;
            let inverse = if total > 0.0 { 1.0 / total } else { 0.0 };
            for opened in opened {
                let weights = scale_unresolved(&opened.importance[view], scale);
                opened.importance[view] = weights.map(|weight| weight * inverse);
            }
            (all[view], directional[view]) = (total, self.views[view].directional_lux * inverse);
        }
        [all, directional]
    }

    /// The root of the mean square of what each point of the cell has.
    fn root_mean_square(&self, of: impl Fn(usize) -> f32) -> f32 {
        let count = self.points;
        ((0..count).map(|view| of(view) * of(view)).sum::<f32>() / count as f32).sqrt()
    }

    /// The nodes about whose children the points disagree most, from shares and the roots of their mean squares.
    fn contested(&self, weights: &[Lanes; SHARED_NODES]) -> [Contested; CONTESTED] {
        let scale = 1.0 / self.points as f32;
        let mut keys = [0; SHARED_NODES];
        let mut disagreements = [0.0; SHARED_NODES];
        for (index, opened) in self.opened[..self.count].iter().enumerate() {
            for slot in 0..WIDTH {
                let sum: f32 = (0..self.points).map(|view| opened.importance[view][slot]).sum();
                disagreements[index] += (weights[index][slot] - sum * scale).max(0.0);
            }
            // The last bits name the node, so that no two are equal.
            let bits = SHARED_NODES as u32 - 1;
            keys[index] = (disagreements[index].to_bits() & !bits) | (bits - index as u32);
        }
        let mut contested = [Contested::default(); CONTESTED];
        for index in 0..self.count {
            let is_less = |other: &usize| keys[*other] <= keys[index];
            let rank = self.count - (0..self.count).filter(is_less).count();
            let others: f32 = (0..self.count).filter(is_less).map(|other| disagreements[other]).sum();
            if rank < CONTESTED && others >= DISAGREEMENT {
                contested[rank] = Contested { node: index as u8, children: self.opened[index].lit };
            }
        }
        contested
    }

    /// Writes the cut.
    #[inline(always)]
    fn finish(mut self, cut: &mut SharedCut) {
        cut.count = 0;
        let [all, directional] = self.shares();
        let mut weights = [[0.0; WIDTH]; SHARED_NODES];
        for (weights, opened) in weights.iter_mut().zip(&self.opened[..self.count]) {
            for (slot, weight) in weights.iter_mut().enumerate() {
                *weight = self.root_mean_square(|view| opened.importance[view][slot]);
            }
        }
        let sum: f32 = weights.as_flattened().iter().sum();
        let sun = self.root_mean_square(|view| directional[view]);
        if self.opened[..self.count].iter().all(|opened| opened.lit == 0) || sum + sun <= 0.0 {
            return;
        }
        cut.directional = match self.sampler.world.directional_lights().next() {
            Some(_) => {
                let part = (sun / (sun + sum)).clamp(MIN_SIDE, 1.0 - MIN_SIDE);
                part / (1.0 - part)
            }
            None => 0.0,
        };
        cut.contested = self.contested(&weights);
        for Contested { node, children } in cut.contested {
            let opened = &mut self.opened[usize::from(node)];
            for slot in (0..WIDTH).filter(|slot| children >> slot & 1 == 1) {
                weights[usize::from(node)][slot] = 0.0;
                opened.importance.iter_mut().for_each(|lanes| lanes[slot] = 0.0);
            }
            opened.lit &= !children;
        }
        let opened = &self.opened[..self.count];
        let lit: u32 = opened.iter().map(|opened| opened.lit.count_ones()).sum();
        let share = |view: usize| opened.iter().map(|opened| opened.importance[view].iter().sum::<f32>()).sum::<f32>();
        cut.rest = match lit {
            _ if cut.contested[0].children == 0 => 1.0,
            0 => 0.0,
            _ => {
                // Not root mean squares, since squares of lux may leave f32.
                let count = self.points;
                let mean = |lux: &dyn Fn(usize) -> f32| (0..count).map(|view| lux(view) / count as f32).sum::<f32>();
                mean(&|view| share(view) * all[view]).max(MIN_SIDE * mean(&|view| all[view]))
            }
        };
        self.hand_out(cut, &weights, share(POINTS), lit);
        cut.count = self.count;
        (cut.name, cut.sky) = (0, SkyState::of(self.sampler.world));
        for (index, Opened { id, from, .. }) in self.opened[..self.count].iter().enumerate() {
            let record = self.middle().nodes(id.instance).and_then(|nodes| nodes.get(id.node as usize));
            cut.from[index] = *from;
            cut.flux[index] = record.map_or([0; WIDTH], |record| record.flux.map(flux_step));
            cut.name = cut.name.wrapping_add(name(self.middle(), *id).unwrap_or(0));
        }
    }

    /// Hands out the units of a cut to the `lit` children of its nodes, by the importance at all points, by that at the
    /// middle, whose sum is `center`, and evenly.
    #[inline(always)]
    fn hand_out(&self, cut: &mut SharedCut, weights: &[[f32; WIDTH]; SHARED_NODES], center: f32, lit: u32) {
        let sum: f32 = weights.as_flattened().iter().sum();
        let inverse = |part: f32, sum: f32| if sum > 0.0 { part / sum } else { 0.0 };
        let by_points = inverse(1.0 - EVEN - CENTER, sum);
        let (by_center, even) = (inverse(CENTER, center), EVEN / lit.max(1) as f32);
        let mut total = 0;
        for (index, opened) in self.opened[..self.count].iter().enumerate() {
            cut.nodes[index] = opened.id;
            for slot in 0..WIDTH {
                if opened.lit >> slot & 1 == 1 {
                    let part = weights[index][slot] * by_points + opened.importance[POINTS][slot] * by_center + even;
                    // Each has a unit, and no more than all units are handed out.
                    total += (part.min(1.0) * (UNITS - 512) as f32) as u32 + 1;
                }
                cut.sums[index][slot] = total;
            }
        }
    }
}
