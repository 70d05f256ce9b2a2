//! A world, or a tree by itself, as a shading point sees it.

use glam::{Mat3, Vec3};

use crate::instance::part::{Part, SINGLE};
use crate::instance::portal::PortalsInSight;
use crate::keys::{InstanceKey, slot_of};
use crate::light::{DirectionalLight, luminance};
use crate::shading::importance::{ChildImportances, LocalShadingPoint, child_importances};
use crate::shading::rough::rough_weights;
use crate::shading::segment::LocalSegment;
use crate::shading::shading_point::ShadingPoint;
use crate::sky::SKY_DIST;
use crate::top::TopLevel;
use crate::tree::{ChildRef, Lanes, LightTree, Node, WIDTH};
use crate::visibility::LearntCell;
use crate::world::LightWorld;

/// [`TreeView::instance`] of the top level, and of a tree that is sampled by itself.
pub(crate) const NO_INSTANCE: u32 = u32::MAX;

/// The nodes of a tree, and the shading point in their space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TreeView<'a> {
    pub nodes: &'a [Node],
    pub local: LocalShadingPoint<'a>,
    /// The slot of the instance whose tree this is, or [`NO_INSTANCE`].
    pub instance: u32,
}

impl TreeView<'_> {
    /// Whether this is a top level, whose leaves are parts of instances.
    #[inline(always)]
    pub fn is_top(&self) -> bool {
        self.local.light_bit == SINGLE
    }
}

/// A world as a shading point sees it; or one tree, whose leaves are lights.
#[derive(Clone, Copy)]
pub(crate) struct WorldView<'a, 's> {
    /// The top level, or the only tree.
    pub root: TreeView<'a>,
    /// `None` around an only tree.
    pub world: Option<(&'a LightWorld, &'a TopLevel)>,
    pub shading_point: &'s ShadingPoint,
    /// The illuminance by all directional lights, which are chosen beside the trees.
    pub directional_lux: f32,
    /// What is learnt about the cell of the shading point, if that weighs the cut.
    pub learnt: Option<LearntCell<'a>>,
    /// Whether masks may hide lights.
    pub has_masks: bool,
    /// The slot of the sky, and the portals through which it is seen, if the point is in a room.
    pub portals: Option<(u32, PortalsInSight<'a>)>,
}

impl<'a, 's> WorldView<'a, 's> {
    /// A world as seen from a point that has learnt nothing.
    pub fn new(world: &'a LightWorld, top: &'a TopLevel, shading_point: &'s ShadingPoint) -> Self {
        let local = LocalShadingPoint { light_bit: SINGLE, ..LocalShadingPoint::of(shading_point) };
        Self {
            root: TreeView { nodes: &top.nodes, local, instance: NO_INSTANCE },
            world: Some((world, top)),
            shading_point,
            directional_lux: world.directional_lights().map(|(_, light)| illuminance(light, shading_point)).sum(),
            learnt: None,
            has_masks: !top.masks.is_empty() || shading_point.mask == 0,
            portals: portals(world, shading_point),
        }
    }

    /// A tree that is sampled by itself, in its own space.
    pub fn of_tree(nodes: &'a [Node], shading_point: &'s ShadingPoint) -> Self {
        Self {
            root: TreeView { nodes, local: LocalShadingPoint::of(shading_point), instance: NO_INSTANCE },
            world: None,
            shading_point,
            directional_lux: 0.0,
            learnt: None,
            has_masks: false,
            portals: None,
        }
    }

    /// The nodes of an instance's tree by the slot of the instance, or of the root for [`NO_INSTANCE`].
    pub fn nodes(&self, instance: u32) -> Option<&'a [Node]> {
        if instance == NO_INSTANCE {
            return Some(self.root.nodes);
        }
        let (world, _) = self.world?;
        Some(world.tree(world.instance(world.instance_at(instance)?)?.tree)?.nodes())
    }

    /// The tree of an instance by its slot, or the root for [`NO_INSTANCE`].
    pub fn tree(&self, instance: u32) -> Option<TreeView<'a>> {
        if instance == NO_INSTANCE {
            return Some(self.root);
        }
        Some(self.instance_tree(self.world?.0.instance_at(instance)?)?.1)
    }

    /// The tree of an instance that is shown.
    pub fn instance_tree(&self, key: InstanceKey) -> Option<(&'a LightTree, TreeView<'a>)> {
        let ((world, _), shading_point) = (self.world?, self.shading_point);
        let instance = world.instance(key)?;
        let tree = world.tree(instance.tree)?;
        let (placed, home, brightness) = (instance.shown()?, world.home(), instance.appearance.brightness());
        let local = if instance.is_sky {
            // It is as far from every point.
            let here = ShadingPoint { position: placed.translation(home), segment: Vec3::ZERO, ..*shading_point };
            LocalShadingPoint { is_sky: true, ..placed.local_shading_point(&here, home, brightness) }
        } else {
            placed.local_shading_point(shading_point, home, brightness)
        };
        Some((tree, TreeView { nodes: tree.nodes(), local, instance: slot_of(key) }))
    }

    /// The part that a leaf of the top level is; `None` if there is no such leaf.
    pub fn part(&self, leaf: u32) -> Option<Part> {
        self.world?.1.part(leaf)
    }

    /// What changes with the children of a node of the top level.
    pub fn top_name(&self, node: u32) -> Option<u32> {
        self.world.map(|(_, top)| top.name(node))
    }

    /// The tree below a leaf of the top level, and where in it a walk goes on. `None` if there is no such leaf, or if
    /// the tree has no nodes.
    pub fn tree_below(&self, leaf: u32) -> Option<(TreeView<'a>, ChildRef)> {
        let Part { slot, entry } = self.part(leaf)?;
        let tree = self.tree(slot)?;
        (!tree.nodes.is_empty()).then_some((tree, entry))
    }

    /// The tree of the sky, which has nodes: a second root beside the top level. `None` if the shading point sees no
    /// sky.
    pub fn sky(&self) -> Option<TreeView<'a>> {
        let (world, _) = self.world?;
        let (key, _) = world.sky()?;
        let mask = world.instance(key)?.appearance.mask;
        let (_, tree) = (mask & self.shading_point.mask != 0).then(|| self.instance_tree(key))??;
        (!tree.nodes.is_empty()).then_some(tree)
    }

    /// The linear part of the map to the world from the space in which a tree is seen.
    pub fn to_world(self, tree: &TreeView<'_>) -> Mat3 {
        let instance = || {
            let (world, _) = self.world?;
            world.instance(world.instance_at(tree.instance)?)
        };
        let of_instance = || Some(instance()?.shown()?.linear.linear);
        let axes = tree.local.map.map(|map| map.axes).or_else(of_instance).unwrap_or(Mat3::IDENTITY);
        if instance().is_some_and(|instance| instance.is_sky) { axes * SKY_DIST } else { axes }
    }

    /// Whether the masks of instances below each child of a node and that of the shading point have a bit in common. All
    /// of them in the tree of an instance, whose lights have one mask.
    #[inline(always)]
    pub fn met_children(&self, instance: u32, node: u32) -> [bool; WIDTH] {
        let Some((_, top)) = self.world.filter(|_| instance == NO_INSTANCE) else { return [true; WIDTH] };
        let unions = top.masks.get(node as usize).map_or([u32::MAX; WIDTH], |masks| masks.children);
        unions.map(|union| union & self.shading_point.mask != 0)
    }

    /// The learnt visible share of each child of a node, in (0, 1]; `None` if nothing is learnt here. Shares multiply
    /// importances in the cut, and nowhere below it: so all that reads weights from the cut stays exact.
    #[inline(always)]
    pub fn visible_shares(&self, tree: &TreeView<'a>, node: &Node) -> Option<Lanes> {
        self.learnt.as_ref().map(|learnt| learnt.shares(node, &tree.local, &self.to_world(tree)))
    }

    /// The importances of the children of a node, which is in `tree`. 0 where masks hide all lights.
    #[inline(always)]
    pub fn importances(&self, tree: &TreeView<'a>, node: u32, record: &Node) -> ChildImportances {
        // A copy of its own: where lights may be hidden, the loop over the children takes twice the time.
        if !self.hides() {
            return child_importances(record, &tree.local);
        }
        let mut children = child_importances(record, &tree.local);
        self.weigh_hidden(tree, node, record, &mut children);
        children
    }

    /// The weights of a node's children by [rough estimates](rough_weights).
    #[inline(always)]
    pub fn rough_weights(&self, tree: &TreeView<'a>, node: u32, record: &Node) -> Lanes {
        if !self.hides() {
            return rough_weights(record, &tree.local);
        }
        let mut children = ChildImportances { importance: rough_weights(record, &tree.local), doubt: [0.0; WIDTH] };
        self.weigh_hidden(tree, node, record, &mut children);
        children.importance
    }

    /// Whether masks or portals may hide lights.
    #[inline(always)]
    fn hides(&self) -> bool {
        self.has_masks || self.portals.is_some()
    }

    /// Multiplies the importance of each child of a node by the share of the flux below it that reaches the shading
    /// point by its mask or through a portal; 0 only if nothing does. `record` is the node.
    #[inline(always)]
    fn weigh_hidden(&self, tree: &TreeView<'a>, node: u32, record: &Node, children: &mut ChildImportances) {
        // Below the top level all lights have the mask of one instance.
        let Some((_, top)) = self.world.filter(|_| tree.is_top()) else {
            if let Some((_, portals)) = self.portals.as_ref().filter(|(sky, _)| *sky == tree.instance) {
                portals.weigh(record, children);
            }
            return;
        };
        let (mask, masks) = (self.shading_point.mask, &top.masks);
        let met = self.met_children(tree.instance, node);
        for slot in 0..WIDTH {
            if !met[slot] {
                children.importance[slot] = 0.0;
            } else if let Some(ChildRef::Node(child)) = record.child(slot) {
                children.importance[slot] *= masks.get(child as usize).map_or(1.0, |masks| masks.shares.seen(mask));
            }
        }
    }
}

/// The slot of the sky, and the portals through which a shading point sees it; `None` if it is in no room.
fn portals<'a>(world: &'a LightWorld, shading_point: &ShadingPoint) -> Option<(u32, PortalsInSight<'a>)> {
    let portals = world.placed_portals();
    if portals.is_empty() || LocalSegment::of(shading_point).is_some() {
        return None;
    }
    let (key, _) = world.sky()?;
    let axes = world.instance(key)?.shown()?.linear.linear;
    Some((slot_of(key), PortalsInSight::new(portals, shading_point.position, axes)?))
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
