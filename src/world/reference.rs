//! Trees of scaled instances are built for the world.
//!
//! The lights of a stretched object have other neighbours in the world than in its tree, and a scale
//! changes the flux of surfaces and not that of points. A tree whose only instance is stretched or
//! scaled is therefore built again, divided and weighted as its lights are in the world. It keeps
//! that when other instances come.

use glam::DVec3;

use super::LightWorld;
use crate::cluster::Linear;
use crate::effects::Effects;
use crate::error::WorldError;
use crate::instance::placement::{Placed, Placement};
use crate::keys::InstanceKey;
use crate::light::Light;
use crate::tree::{LightTree, WIDTH};

/// A tree is built again if directions turn against each other by more than the angle of this
/// cosine: if the greatest scale is 1.5 times the least.
const MAX_TURN_COSINE: f32 = 0.92;

/// A tree of surfaces and lights without size is built again if areas change by more than this
/// factor: if lengths change by a quarter.
const MAX_AREA_SCALE: f32 = 1.5;

/// The map for which a tree is built whose first instance is placed so; `None` for the tree's own
/// space.
pub(super) fn reference_for(placed: Option<&Placed>, lights: &[Light]) -> Option<Linear> {
    placed.map(|placed| placed.linear).filter(|map| changes_tree(map, lights))
}

/// Whether a map changes how some lights should be divided or weighted. Trees of one node are
/// neither.
fn changes_tree(map: &Linear, lights: &[Light]) -> bool {
    let is_stretched = !map.is_similarity && map.turn.x < MAX_TURN_COSINE;
    let area_scale = map.mean_area_scale();
    let is_scaled = area_scale.max(1.0 / area_scale) > MAX_AREA_SCALE;
    let is_divided = lights.iter().filter(|light| !light.is_removed()).nth(WIDTH).is_some();
    is_divided && (is_stretched || is_scaled && has_both_kinds(lights))
}

/// Whether there are surfaces and lights without size, of which only surfaces change their flux with
/// the scale.
fn has_both_kinds(lights: &[Light]) -> bool {
    let present = lights.iter().filter(|light| !light.is_removed());
    let mut kinds = present.map(|light| light.effects().contains(Effects::AREAS));
    let first = kinds.next();
    kinds.any(|kind| Some(kind) != first)
}

impl LightTree {
    /// Builds a tree for lights whose first instance will have this placement, on any thread.
    ///
    /// [`LightTree::new`], unless the placement is stretched, by a factor of 1.5 or more between two
    /// directions, or changes areas by 1.5 or more and there are both surfaces and lights without
    /// size. The tree is then divided as if its axes were stretched as the placement stretches them,
    /// and weighted as its lights shine in the world, as [`LightWorld::add_instance`] would build it
    /// again for its first instance. A tree that was made here is not built again when its instance
    /// is added with the same linear part. Only the linear part of the placement matters.
    ///
    /// # Errors
    /// [`WorldError::Value`] for the placement or too many lights, [`WorldError::Entry`] for a light.
    ///
    /// O(n log n).
    pub fn new_for(lights: Vec<Light>, placement: impl Into<Placement>) -> Result<Self, WorldError> {
        let placement = Placement { translation: DVec3::ZERO, ..placement.into() };
        let reference = reference_for(Placed::new(&placement)?.as_ref(), &lights);
        Self::with_reference(lights, reference)
    }
}

impl LightWorld {
    /// Builds the tree of an instance for the placement of that instance, if it is the only one and
    /// the placement changes how the lights should be divided or weighted.
    pub(super) fn build_for_first(&mut self, key: InstanceKey) {
        let instance = &self.scene.instances[key];
        let (tree, placed) = (instance.tree, instance.shown());
        let Some(map) = placed.map(|placed| placed.linear) else { return };
        let entry = &mut self.scene.trees[tree];
        // What is derived from the matrix may differ in the last bit where another machine baked it.
        let has_map = entry.tree.reference().is_some_and(|reference| reference.linear == map.linear);
        if entry.instances.len() == 1 && !has_map && changes_tree(&map, entry.tree.lights()) {
            entry.tree.set_reference(Some(map));
            self.rebuild_now(tree);
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
    fn a_stretched_tree_is_divided_the_same_way_wherever_its_instance_turns() {
        let stretch = Mat3::from_diagonal(Vec3::new(1.0, 1.0, 0.01));
        let expected = extents(&tree_of(stretch));
        for turn in [Mat3::from_rotation_y(0.8), Mat3::from_axis_angle(Vec3::ONE.normalize(), 2.0)] {
            let turned = extents(&tree_of(turn * stretch));
            assert!((0..2).all(|k| (turned[k] / expected[k] - 1.0).abs() < 0.01), "{turned:?} {expected:?}");
        }
    }

    /// Lamps beside panels of a hundredth of their flux, or of ten times their flux if the tree is
    /// scaled by 32.
    fn lamps_and_panels() -> Vec<Light> {
        let lamp = |i: usize| Light::point(Vec3::new(i as f32, 0.0, 0.0), Vec3::ONE);
        let panel = |i: usize| Light::rectangle(Vec3::new(i as f32, 5.0, 0.0), Vec3::X, Vec3::Z * 0.01, Vec3::ONE);
        (0..60).flat_map(|i| [lamp(i), panel(i)]).collect()
    }

    #[test]
    fn a_tree_of_both_kinds_is_weighted_as_its_lights_shine_where_its_first_instance_is_scaled() {
        let lights = lamps_and_panels();
        let placement =
            |scale: f32| Placement { linear: Mat3::from_diagonal(Vec3::splat(scale)), ..Placement::IDENTITY };
        let plain = LightTree::new(lights.clone()).expect("valid");
        for scale in [1.2, 32.0, 1.0e-3] {
            let tree = LightTree::new_for(lights.clone(), placement(scale)).expect("valid");
            tree.check().expect("the tree is sound");
            assert_eq!(tree.reference().is_some(), scale != 1.2);
            assert_eq!((tree.flux(), tree.cluster().aabb), (plain.flux(), plain.cluster().aabb));
            let area = f64::from(if scale == 1.2 { 1.0 } else { scale * scale });
            let (panels, lamps) = (f64::from(tree.flux().area) * area, f64::from(tree.flux().punctual));
            let expected = 5.0 * panels / (panels + lamps);
            assert!((f64::from(tree.cluster().mean.y) - expected).abs() < 1.0e-4, "{scale}: {expected}");
            // One kind of light keeps its ratios at any scale.
            let of_one_kind = |first: usize| lights.iter().skip(first).step_by(2).copied().collect();
            for first in [0, 1] {
                let tree = LightTree::new_for(of_one_kind(first), placement(scale)).expect("valid");
                assert!(tree.reference().is_none());
            }
        }
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
        assert_eq!(stepped.finish().nodes(), built);
    }
}
