//! Trees of stretched instances are built for the world.
//!
//! The lights of a stretched object have other neighbours in the world than in its tree. A tree
//! whose only instance is stretched is therefore built again, divided as its lights lie in the
//! world. It keeps that division when other instances come.

use glam::DVec3;

use super::LightWorld;
use crate::cluster::Linear;
use crate::error::WorldError;
use crate::instance::placement::{Anchor, Placed, Placement};
use crate::keys::InstanceKey;
use crate::light::Light;
use crate::tree::{LightTree, WIDTH};

/// A tree is built again if directions turn against each other by more than the angle of this
/// cosine: if the greatest scale is 1.5 times the least.
const MAX_TURN_COSINE: f32 = 0.92;

/// The map for which builds divide lights whose first instance is placed so; `None` for the tree's
/// own space.
pub(super) fn reference_for(placed: Option<&Placed>, lights: usize) -> Option<Linear> {
    placed.map(|placed| placed.linear).filter(|map| changes_tree(map, lights))
}

/// Whether a map changes how some lights should be divided. Trees of one node are not divided.
fn changes_tree(map: &Linear, lights: usize) -> bool {
    !map.is_similarity && map.turn.x < MAX_TURN_COSINE && lights > WIDTH
}

impl LightTree {
    /// Builds a tree for lights whose first instance will have this placement, on any thread.
    ///
    /// [`LightTree::new`], unless the placement is stretched, by a factor of 1.5 or more between two
    /// directions. The tree is then divided as its lights lie in the world, as
    /// [`LightWorld::add_instance`] would build it again for its first instance. A tree that was
    /// made here is not built again when its instance is added with the same linear part. Only the
    /// linear part of the placement matters.
    ///
    /// # Errors
    /// [`WorldError::Placement`], [`WorldError::Light`], [`WorldError::TooManyLights`].
    ///
    /// O(n log n).
    pub fn new_for(lights: Vec<Light>, placement: impl Into<Placement>) -> Result<Self, WorldError> {
        let placement = Placement { translation: DVec3::ZERO, ..placement.into() };
        let reference = reference_for(Placed::new(&placement, Anchor::Point(DVec3::ZERO))?.as_ref(), lights.len());
        Self::with_reference(lights, reference)
    }
}

impl LightWorld {
    /// Builds the tree of an instance for the placement of that instance, if it is the only one and
    /// the placement changes how the lights should be divided. A placeholder is built later, and so is
    /// any tree if `is_later`.
    pub(super) fn build_for_first(&mut self, key: InstanceKey, is_later: bool) {
        let instance = &self.scene.instances[key];
        let (tree, placed) = (instance.tree, instance.shown());
        let Some(map) = placed.map(|placed| placed.linear) else { return };
        let entry = &mut self.scene.trees[tree];
        // What is derived from the matrix may differ in the last bit where another machine baked it.
        let has_map = entry.tree.reference().is_some_and(|reference| reference.linear == map.linear);
        if entry.instances.len() == 1 && !has_map && changes_tree(&map, entry.tree.light_count()) {
            entry.tree.set_reference(Some(map));
            if is_later {
                entry.tree.mark_placeholder();
            }
            if !entry.tree.is_placeholder() {
                self.rebuild_now(tree);
                return;
            }
            // A build that is under way does not know the map.
            self.cancel_build(tree);
            let entry = &mut self.scene.trees[tree];
            self.rebuilds.await_first_build(tree, &entry.tree);
            entry.recount(&mut self.sums);
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Mat3, Vec3};

    use super::*;
    use crate::instance::placement::Placement;
    use crate::light::Light;
    use crate::policy::Policy;

    /// A row of pairs: neighbours along x are nearer than the two of a pair.
    fn lights() -> Vec<Light> {
        let light = |i: usize| Light::point(Vec3::new((i / 2) as f32, 0.0, 40.0 * (i % 2) as f32), Vec3::ONE);
        (0..80).map(light).collect()
    }

    fn tree_of(linear: Mat3) -> LightTree {
        let mut world = LightWorld::new();
        let tree = world.add_tree(LightTree::new(lights()).expect("valid"));
        world.add_instance(tree, Placement { linear, translation: DVec3::ZERO }, Policy::Static).expect("valid");
        world.tree(tree).expect("it lives").clone()
    }

    /// The mean extent of the nodes below the root along x and z, in the space of the tree.
    fn extents(tree: &LightTree) -> [f32; 2] {
        let root = &tree.nodes()[0];
        let boxes: Vec<Vec3> = (0..root.count()).map(|slot| root.cluster(slot).aabb.extent()).collect();
        [0, 2].map(|axis| boxes.iter().map(|extent| extent[axis]).sum::<f32>() / boxes.len() as f32)
    }

    #[test]
    fn a_tree_is_divided_as_its_lights_lie_in_the_world_if_its_first_instance_is_stretched() {
        let plain = LightTree::new(lights()).expect("valid");
        for linear in [Mat3::IDENTITY, Mat3::from_rotation_y(1.0) * 7.0, Mat3::from_diagonal(Vec3::new(1.1, 1.0, 1.0))]
        {
            assert_eq!(tree_of(linear).nodes(), plain.nodes(), "{linear}");
        }
        let squashed = tree_of(Mat3::from_diagonal(Vec3::new(1.0, 1.0, 0.01)));
        squashed.check().expect("the tree is sound");
        assert!(extents(&plain)[1] < 1.0 && extents(&squashed)[1] > 30.0, "{:?}", extents(&squashed));
        assert!(extents(&squashed)[0] < 0.7 * extents(&plain)[0], "{:?} {:?}", extents(&squashed), extents(&plain));
    }

    #[test]
    fn later_builds_keep_the_reference_and_later_instances_do_not_change_it() {
        let mut world = LightWorld::new();
        let tree = world.add_tree(LightTree::new(lights()).expect("valid"));
        let squashed = Placement { linear: Mat3::from_diagonal(Vec3::new(1.0, 1.0, 0.01)), ..Placement::IDENTITY };
        world.add_instance(tree, squashed, Policy::Budgeted).expect("valid");
        let nodes = |world: &LightWorld| world.tree(tree).expect("it lives").nodes().to_vec();
        let built = nodes(&world);
        world.add_instance(tree, Placement::IDENTITY, Policy::Budgeted).expect("valid");
        assert_eq!(nodes(&world), built);
        world.rebuild_tree(tree).expect("it lives");
        assert_eq!(nodes(&world), built);
        world.replace_lights(tree, lights()).expect("valid");
        assert_eq!(nodes(&world), built);
        let reference = world.tree(tree).and_then(LightTree::reference).copied();
        let mut stepped = crate::tree::TreeBuild::new(80, reference.as_ref());
        while !stepped.is_done() {
            stepped.step(&lights(), 1);
        }
        assert_eq!(stepped.into_tree().nodes(), built);
    }
}
