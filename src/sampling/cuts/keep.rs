//! Whether the cut of a cell still suits the world.
//!
//! A cut names the children of nodes, so it covers all lights for as long as the nodes that it opened lead to each
//! other as they did. It is built again when one of them has other children, when the brightness of a child jumps, and
//! else in turn. Twin of shaders/cut_keep.wgsl.

use glam::Vec3;

use crate::math::dice::hash;
use crate::sampling::cuts::shared::{NodeId, SharedCut, SkyState};
use crate::sampling::view::{NO_INSTANCE, WorldView};
use crate::tree::{ChildRef, WIDTH};
use crate::world::LightWorld;

/// Cells are built again in turn, each in one of so many builds.
pub(crate) const TURNS: u32 = 12;

/// Up to so many builds after its first cut, a cell that learns is built again early.
pub(crate) const YOUNG: u32 = 4;

/// A cut is built again if the steps of a child's flux differ by at least [`FLUX_JUMP`], and the child then has one in
/// so many of all samples or more.
pub(crate) const JUMP_SHARE: f32 = 1.0 / 64.0;

/// Two half octaves: a factor between 1.5 and 2.8.
pub(crate) const FLUX_JUMP: u32 = 2;

/// The least cosine between the directions to the eye for which the cut of a glossy cell suits, and between those of a
/// turned sky.
pub(crate) const KEPT_VIEW_COSINE: f32 = 0.9986;

/// In place of the child that the root of the sky's tree would be.
pub(crate) const SKY_ROOT: u8 = u8::MAX;

/// What tells a flux from others, in half octaves modulo 2^8.
pub(crate) fn flux_step(flux: u16) -> u8 {
    (flux >> 6) as u8
}

impl SkyState {
    /// That of a world; the default without a sky.
    pub fn of(world: &LightWorld) -> Self {
        let sky = world.sky().and_then(|(key, _)| world.instance(key));
        sky.and_then(|sky| {
            let turn = (sky.shown()?.linear.linear * Vec3::new(1.0, 2.0, 3.0)).normalize_or_zero();
            Some(Self { turn, brightness: (sky.appearance.brightness().to_bits() >> 22) as u8 })
        })
        .unwrap_or_default()
    }

    fn suits(&self, other: &Self) -> bool {
        let steps = self.brightness.wrapping_sub(other.brightness) as i8;
        self.turn.dot(other.turn) >= KEPT_VIEW_COSINE && u32::from(steps.unsigned_abs()) < FLUX_JUMP
    }
}

/// Whether a cell that has learnt in this frame is built again: soon after it got its first cut.
fn is_young(age: u32) -> bool {
    age <= YOUNG && age.is_power_of_two()
}

/// What decides, beside the world, whether a cell keeps its cut.
pub(crate) struct CellNow {
    /// The direction from a glossy cell to the eye; 0 for a matte one.
    pub toward: Vec3,
    /// What tells the cell from others.
    pub tag: u32,
    /// Whether anything was learnt since the last build.
    pub taught: bool,
}

impl SharedCut {
    /// Follows nodes that were stored elsewhere. Returns whether the cut still suits the world and the view; if not, or
    /// if it is its turn, it is to be built again. `middle` is the world as the middle of the cell sees it.
    pub fn is_kept(&mut self, world: &LightWorld, middle: &WorldView<'_, '_>, now: &CellNow) -> bool {
        self.age += 1;
        let is_due = self.age.wrapping_add(now.tag).is_multiple_of(TURNS) || now.taught && is_young(self.age);
        let has_same_view = now.toward == Vec3::ZERO || self.toward.dot(now.toward) >= KEPT_VIEW_COSINE;
        !is_due && has_same_view && self.follow(world, middle).is_some()
    }

    fn follow(&mut self, world: &LightWorld, middle: &WorldView<'_, '_>) -> Option<()> {
        let sky = middle.sky().map(|tree| NodeId { instance: tree.instance, node: 0 });
        let has_sky = self.count > 1 && self.from[1] == SKY_ROOT;
        let has_sun = world.directional_lights().next().is_some();
        (has_sky == sky.is_some() && has_sun == (self.directional > 0.0)).then_some(())?;
        (!has_sky || self.sky.suits(&SkyState::of(world))).then_some(())?;
        for index in 1..self.count {
            self.nodes[index] = match self.from[index] {
                SKY_ROOT => sky?,
                child => below(middle, self.nodes[usize::from(child) / WIDTH], usize::from(child) % WIDTH)?,
            };
        }
        let name =
            self.nodes[..self.count].iter().try_fold(0, |sum: u32, id| Some(sum.wrapping_add(name(middle, *id)?)));
        (name? == self.name).then_some(())?;
        let least = JUMP_SHARE * self.total() as f32;
        for (index, id) in self.nodes[..self.count].iter().enumerate() {
            let record = middle.nodes(id.instance)?.get(id.node as usize)?;
            let met = middle.met_children(id.instance, id.node);
            for slot in 0..WIDTH {
                let child = index * WIDTH + slot;
                let [_, units] = self.units(child);
                let is_lit = record.flux[slot] > 0 && met[slot];
                let steps = i32::from(flux_step(record.flux[slot]).wrapping_sub(self.flux[index][slot]) as i8);
                let is_kept = match (units, is_lit) {
                    (0, false) => true,
                    (0, true) if self.is_contested(index, slot) => true,
                    (0, true) => steps.unsigned_abs() < FLUX_JUMP && self.from[1..self.count].contains(&(child as u8)),
                    (_, false) => units as f32 <= least,
                    (_, true) => {
                        steps.unsigned_abs() < FLUX_JUMP || units as f32 * (0.5 * steps.max(0) as f32).exp2() <= least
                    }
                };
                is_kept.then_some(())?;
            }
        }
        Some(())
    }
}

/// The node below a child; `None` for a light, and if there is none.
pub(crate) fn below(view: &WorldView<'_, '_>, id: NodeId, slot: usize) -> Option<NodeId> {
    match view.nodes(id.instance)?.get(id.node as usize)?.child(slot)? {
        ChildRef::Node(node) => Some(NodeId { node, ..id }),
        ChildRef::Leaf(leaf) if id.instance == NO_INSTANCE => {
            let part = view.part(leaf)?;
            match part.entry {
                ChildRef::Node(node) => Some(NodeId { instance: part.slot, node }),
                ChildRef::Leaf(_) => None,
            }
        }
        ChildRef::Leaf(_) => None,
    }
}

/// What changes with the children of a node.
pub(crate) fn name(view: &WorldView<'_, '_>, id: NodeId) -> Option<u32> {
    if id.instance == NO_INSTANCE {
        return view.top_name(id.node);
    }
    let children = view.nodes(id.instance)?.get(id.node as usize)?.children;
    Some((0..).zip(children).fold(0, |sum, (slot, child)| sum.wrapping_add(hash(child ^ hash(slot)))))
}
