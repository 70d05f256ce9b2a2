//! Chooses a light: opens the clusters that matter most near the shading point, chooses among all that are left, and walks
//! down wide nodes from there. Trees and the top level are walked alike, and opened across.
//!
//! Twin of `shaders/dice.wgsl` and `shaders/walk.wgsl`. Starts from CK18 5 (adaptive tree splitting). Differs: not
//! every part of what is split gets a sample, but all parts together are one larger choice of one light; and the number
//! of splits is bounded, so that the time is. No trail is recorded: the way up is read from the nodes, so depth has no
//! cap. A random number is stretched at every choice, as usual, but the bits lost by that are replaced from a hash of
//! all its bits: otherwise choices past the 24th bit would all be the same.

use crate::counts::{MAX_SPLITS, SplitCount};
use crate::dice::{Dice, joint, share};
use crate::importance::{Seen, View, running_sums, see};
use crate::shading_point::ShadingPoint;
use crate::simd::Job;
use crate::tree::{LEAF, Lanes, NO_PARENT, Node, Target, WIDTH};

/// Clusters are opened only while the doubt about one of them is more than this share of everything.
pub(crate) const MIN_DOUBT: f32 = 0.002;

/// [`Scene::instance`] of the top level, and of a tree that is walked by itself.
pub(crate) const NO_INSTANCE: u32 = u32::MAX;

/// A tree's nodes, and the shading point as it is seen in their space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scene<'a> {
    pub nodes: &'a [Node],
    pub view: View,
    /// The slot of the instance whose tree it is, or [`NO_INSTANCE`].
    pub instance: u32,
    /// Leaves are instances.
    pub is_top: bool,
}

impl<'a> Scene<'a> {
    /// A tree that is walked by itself, in its own space.
    pub fn alone(nodes: &'a [Node], shading_point: &ShadingPoint) -> Self {
        Self { nodes, view: View::of(shading_point), instance: NO_INSTANCE, is_top: false }
    }
}

/// Knows the trees behind the leaves of a top level.
pub(crate) trait Forest<'a> {
    /// The tree that the instance in a slot shows; `None` if there is none.
    fn enter(&self, slot: u32) -> Option<Scene<'a>>;
}

/// A forest of one tree.
pub(crate) struct NoForest;

impl<'a> Forest<'a> for NoForest {
    fn enter(&self, _: u32) -> Option<Scene<'a>> {
        None
    }
}

/// The candidates of a shading point: the children of the opened nodes. The same for every random number, so that the chance
/// of any light can be told. One array for each property: nothing but numbers is moved about.
pub(crate) struct Cut<'a> {
    /// Trees that were entered, the root's first.
    scenes: [Option<Scene<'a>>; MAX_NODES],
    scene_count: usize,
    /// Opened nodes.
    count: usize,
    /// Of each opened node its scene.
    scene_of: [usize; MAX_NODES],
    nodes: [u32; MAX_NODES],
    /// Importance of each child; 0 for one that was opened itself.
    values: [Lanes; MAX_NODES],
    /// Importance times spread: how much light the estimate may be wrong by. 0 for what cannot be opened.
    doubts: [Lanes; MAX_NODES],
    /// Sums of the values.
    totals: [f32; MAX_NODES],
    /// The greatest doubt of a node as an integer, which orders alike, with 7 less its slot in the last bits: a maximum
    /// of integers is found in three steps.
    keys: [u32; MAX_NODES],
    /// Estimated illuminance of all candidates, in lux.
    total: f32,
}

/// The root and what is opened after it.
const MAX_NODES: usize = MAX_SPLITS + 1;

/// The bits of a key that name a slot.
const SLOT_BITS: u32 = WIDTH as u32 - 1;

impl<'a> Cut<'a> {
    /// Opens the root and then, up to `splits` times, the candidate in most doubt.
    #[inline(always)]
    pub fn new(root: Scene<'a>, splits: SplitCount, forest: &impl Forest<'a>) -> Self {
        let mut cut = Cut {
            scenes: [const { None }; MAX_NODES],
            scene_count: 0,
            count: 0,
            scene_of: [0; MAX_NODES],
            nodes: [0; MAX_NODES],
            values: [[0.0; WIDTH]; MAX_NODES],
            doubts: [[0.0; WIDTH]; MAX_NODES],
            totals: [0.0; MAX_NODES],
            keys: [0; MAX_NODES],
            total: 0.0,
        };
        let mut next = (cut.enter(root), 0);
        loop {
            let (scene, node) = next;
            if cut.open(scene, node).is_none() || cut.count > splits.get() {
                return cut;
            }
            let Some((index, slot)) = cut.most_doubtful() else { return cut };
            let scene = cut.scene_of[index];
            let target = cut.scene(index).and_then(|tree| tree.nodes[cut.nodes[index] as usize].target(slot));
            next = match target {
                Some(Target::Node(node)) => (scene, node),
                Some(Target::Leaf(leaf)) => match forest.enter(leaf) {
                    Some(tree) if !tree.nodes.is_empty() => (cut.enter(tree), 0),
                    _ => return cut,
                },
                None => return cut,
            };
            cut.take_out(index, slot);
        }
    }

    /// Chooses a light, or what stands `beside` the trees with so many lux.
    #[inline(always)]
    pub fn draw(&self, beside: f32, u: [f32; 2], forest: &impl Forest<'a>) -> Drawn {
        let total = self.total + beside;
        if total <= 0.0 {
            return Drawn::Nothing;
        }
        let (mut dice, mut inner) = (Dice::new(u[0], u[1]), Dice::new(u[1], u[0]));
        let mut chance = 1.0;
        if beside > 0.0 {
            let point = dice.point(total);
            if point >= self.total {
                return Drawn::Beside { offset: point - self.total, total };
            }
            chance = share(self.total, total);
            dice.stretch(point / total, chance);
        }
        match self.pick(&mut dice, &mut inner, forest) {
            Some(picked) => Drawn::Light(Picked { pmf: joint(chance, picked.pmf), ..picked }),
            None => Drawn::Nothing,
        }
    }

    /// Chooses a light. `dice` decide in the root's tree, `inner` in an instance's. `None` if all candidates are proved
    /// dark.
    #[inline(always)]
    fn pick(&self, dice: &mut Dice, inner: &mut Dice, forest: &impl Forest<'a>) -> Option<Picked> {
        if self.total <= 0.0 {
            return None;
        }
        let point = dice.point(self.total);
        let mut before = 0.0;
        let mut chosen = (0, 0.0);
        for (index, total) in self.totals[..self.count].iter().enumerate() {
            // The last with a chance is taken if rounding let the point pass all of them.
            if *total > 0.0 && point >= before {
                chosen = (index, before);
            }
            before += total;
        }
        let (index, before) = chosen;
        let values = &self.values[index];
        let (slot, offset) = pick_lane(values, &running_sums(values), point - before);
        let mut pmf = share(values[slot], self.total);
        dice.stretch(offset / self.total, pmf);
        let mut scene = *self.scene(index)?;
        let mut target = scene.nodes[self.nodes[index] as usize].target(slot)?;
        loop {
            let node = match target {
                Target::Leaf(leaf) if scene.is_top => {
                    scene = forest.enter(leaf)?;
                    0
                }
                Target::Leaf(light) => return Some(Picked { instance: scene.instance, light, pmf }),
                Target::Node(node) => node,
            };
            let dice = if scene.instance == NO_INSTANCE { &mut *dice } else { &mut *inner };
            let record = scene.nodes.get(node as usize)?;
            let values = see(record, &scene.view).importance;
            let sums = running_sums(&values);
            let total = sums[WIDTH - 1];
            if total <= 0.0 {
                return None;
            }
            let (slot, offset) = pick_lane(&values, &sums, dice.point(total));
            let chance = share(values[slot], total);
            pmf = joint(pmf, chance);
            dice.stretch(offset / total, chance);
            target = record.target(slot)?;
        }
    }

    /// The chance that [`Cut::pick`] ends at a leaf.
    #[inline(always)]
    fn pmf(&self, leaf: &Leaf<'a>) -> f32 {
        let Leaf { mut scene, mut place, mut top } = *leaf;
        let mut pmf = 1.0;
        loop {
            let (node, slot) = (place / WIDTH as u32, place as usize % WIDTH);
            if let Some(index) = self.find(&scene, node) {
                return joint(pmf, share(self.values[index][slot], self.total));
            }
            let record = &scene.nodes[node as usize];
            let values = see(record, &scene.view).importance;
            pmf = joint(pmf, share(values[slot], running_sums(&values)[WIDTH - 1]));
            if pmf <= 0.0 {
                return 0.0;
            }
            place = record.parent;
            if place == NO_PARENT {
                let Some(above) = top.take() else { return 0.0 };
                (scene, place) = above;
            }
        }
    }

    /// Estimated illuminance of all candidates, in lux.
    pub fn total(&self) -> f32 {
        self.total
    }

    /// Every candidate that can be picked: its tree, where it hangs there, and the chance of it. Empty where all are
    /// proved dark.
    #[inline(always)]
    pub fn candidates(&self) -> impl Iterator<Item = (&Scene<'a>, Target, f32)> {
        (0..self.count).flat_map(move |index| {
            (0..WIDTH).filter_map(move |slot| {
                let chance = share(self.values[index][slot], self.total);
                let scene = self.scene(index).filter(|_| chance > 0.0)?;
                Some((scene, scene.nodes[self.nodes[index] as usize].target(slot)?, chance))
            })
        })
    }

    /// The place of a node among the opened ones.
    #[inline(always)]
    fn find(&self, scene: &Scene, node: u32) -> Option<usize> {
        (0..self.count).find(|i| self.nodes[*i] == node && self.scene(*i).is_some_and(|s| s.instance == scene.instance))
    }

    fn scene(&self, index: usize) -> Option<&Scene<'a>> {
        self.scenes[self.scene_of[index]].as_ref()
    }

    /// Adds a tree. It is not there yet: behind a leaf of the top level is a tree of its own, which is opened once.
    #[inline(always)]
    fn enter(&mut self, scene: Scene<'a>) -> usize {
        self.scenes[self.scene_count] = Some(scene);
        self.scene_count += 1;
        self.scene_count - 1
    }

    /// Makes a node's children candidates. `None` and no change if there is no such node.
    #[inline(always)]
    fn open(&mut self, scene: usize, node: u32) -> Option<()> {
        let tree = self.scenes[scene].as_ref()?;
        let record = tree.nodes.get(node as usize)?;
        let Seen { importance, spread } = see(record, &tree.view);
        let index = self.count;
        for i in 0..WIDTH {
            let can_open = tree.is_top | (record.targets[i] & LEAF == 0);
            self.doubts[index][i] = if can_open { importance[i] * spread[i] } else { 0.0 };
        }
        self.values[index] = importance;
        self.scene_of[index] = scene;
        self.nodes[index] = node;
        self.count += 1;
        self.count_up(index);
        Some(())
    }

    /// Takes out a child, whose own children are candidates from now on.
    #[inline(always)]
    fn take_out(&mut self, index: usize, slot: usize) {
        self.values[index][slot] = 0.0;
        self.doubts[index][slot] = 0.0;
        self.count_up(index);
    }

    #[inline(always)]
    fn count_up(&mut self, index: usize) {
        self.totals[index] = running_sums(&self.values[index])[WIDTH - 1];
        let mut most = 0;
        for slot in 0..WIDTH {
            let key = (self.doubts[index][slot].to_bits() & !SLOT_BITS) | (SLOT_BITS - slot as u32);
            most = if key > most { key } else { most };
        }
        self.keys[index] = most;
        self.total = 0.0;
        for total in &self.totals[..self.count] {
            self.total += total;
        }
    }

    /// The candidate in most doubt, the first of equals, as node and slot; `None` if nothing is worth splitting.
    #[inline(always)]
    fn most_doubtful(&self) -> Option<(usize, usize)> {
        let (mut index, mut most) = (0, self.keys[0]);
        for (other, key) in self.keys[..self.count].iter().enumerate() {
            // Without the slots, which say nothing across nodes.
            if *key & !SLOT_BITS > most & !SLOT_BITS {
                (index, most) = (other, *key);
            }
        }
        let is_worth = f32::from_bits(most & !SLOT_BITS) > MIN_DOUBT * self.total;
        is_worth.then_some((index, (SLOT_BITS - (most & SLOT_BITS)) as usize))
    }
}

/// The lane whose share of the line from 0 to the sum of all holds `point`, and how far into it that is.
#[inline(always)]
fn pick_lane(values: &Lanes, sums: &Lanes, point: f32) -> (usize, f32) {
    let mut slot = 0;
    for sum in &sums[..WIDTH - 1] {
        slot += usize::from(*sum <= point);
    }
    // Rounding of the sums may let the point fall between two lanes, on one without a chance.
    if values[slot] <= 0.0 {
        let lit = |slot: &usize| values[*slot] > 0.0;
        slot = (0..slot).rev().find(lit).or_else(|| (slot..WIDTH).find(lit)).unwrap_or(slot);
    }
    (slot, point - (sums[slot] - values[slot]))
}

/// A light of a tree and the chance of its choice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Picked {
    /// See [`Scene::instance`].
    pub instance: u32,
    pub light: u32,
    pub pmf: f32,
}

/// What a draw ended at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Drawn {
    Light(Picked),
    /// What stands beside the trees, so far into it, out of a sum of all.
    Beside {
        offset: f32,
        total: f32,
    },
    /// Bounds prove that there is nothing to choose.
    Nothing,
}

/// Draws a light of the root's tree and those behind it, or what stands `beside` it with so many lux.
pub(crate) struct Draw<'a, 'f, F> {
    pub root: Scene<'a>,
    pub splits: SplitCount,
    pub beside: f32,
    pub u: [f32; 2],
    pub forest: &'f F,
}

impl<'a, F: Forest<'a>> Job for Draw<'a, '_, F> {
    type Output = Drawn;

    #[inline(always)]
    fn run(self) -> Drawn {
        let Self { root, splits, beside, u, forest } = self;
        Cut::new(root, splits, forest).draw(beside, u, forest)
    }
}

/// Where a light hangs.
#[derive(Clone, Copy)]
pub(crate) struct Leaf<'a> {
    pub scene: Scene<'a>,
    /// `node * WIDTH + slot`.
    pub place: u32,
    /// The top level with the place of the tree's instance, if there is one.
    pub top: Option<(Scene<'a>, u32)>,
}

/// Whose chance is asked for.
pub(crate) enum Wanted<'a> {
    Light(Leaf<'a>),
    /// Something beside the trees, of so many lux.
    Beside(f32),
}

/// Asks for the chance that a [`Draw`] ends at a leaf, or at something of so many lux beside the trees.
pub(crate) struct Chance<'a, 'f, F> {
    pub root: Scene<'a>,
    pub splits: SplitCount,
    pub beside: f32,
    pub of: Wanted<'a>,
    pub forest: &'f F,
}

impl<'a, F: Forest<'a>> Job for Chance<'a, '_, F> {
    type Output = f32;

    #[inline(always)]
    fn run(self) -> f32 {
        let Self { root, splits, beside, of, forest } = self;
        let cut = Cut::new(root, splits, forest);
        let total = cut.total + beside;
        match of {
            _ if total <= 0.0 => 0.0,
            Wanted::Light(leaf) => {
                let chance = if beside > 0.0 { share(cut.total, total) } else { 1.0 };
                joint(chance, cut.pmf(&leaf))
            }
            Wanted::Beside(lux) => share(lux, total),
        }
    }
}
