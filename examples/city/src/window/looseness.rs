//! How loose trees are: how much larger their boxes are than those of a fresh build.

use girandole::tree::Node;
use girandole::{Light, LightTree, LightWorld, Placement, TreeKey};
use rayon::prelude::*;
use std::collections::HashMap;

/// For each tree the size of its boxes, weighted by flux, over that of the same lights in a fresh build:
/// 1 for a tree as good as new. O(n log n) for all lights.
pub fn looseness(world: &LightWorld) -> HashMap<TreeKey, f32> {
    // Trees of stretched instances are built for them.
    let mut placements = HashMap::new();
    for instance in world.instances() {
        if let Some((tree, placement)) = world.instance(instance).map(|i| (i.tree, i.placement)) {
            placements.entry(tree).or_insert(placement);
        }
    }
    let keys: Vec<TreeKey> = world.trees().collect();
    let ratio = |key: &TreeKey| ratio(world.tree(*key)?, placements.get(key).copied().unwrap_or_default());
    keys.par_iter().filter_map(|key| Some((*key, ratio(key)?))).collect()
}

fn ratio(tree: &LightTree, placement: Placement) -> Option<f32> {
    let lights: Vec<Light> = tree.lights().iter().filter(|light| !light.is_removed()).copied().collect();
    let (present, fresh) = (size(tree.nodes()), size(LightTree::new_for(lights, placement).ok()?.nodes()));
    Some(if fresh > 0.0 { (present / fresh) as f32 } else { 1.0 })
}

/// The half perimeters of all boxes but those of lights, weighted by flux.
fn size(nodes: &[Node]) -> f64 {
    let boxes = nodes.iter().flat_map(|node| (0..node.count()).map(|slot| node.cluster(slot)));
    let lit = boxes.filter(|cluster| !cluster.aabb.is_empty());
    lit.map(|cluster| f64::from(cluster.flux) * f64::from(cluster.aabb.half_perimeter())).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use girandole::glam::Vec3;
    use girandole::{FrameBudget, Policy};

    #[test]
    fn a_tree_whose_lights_have_changed_places_is_loose_and_a_new_one_is_not() {
        let mut world = LightWorld::new();
        let at = |i: usize| Light::point(Vec3::new((i % 20) as f32, (i / 20) as f32, 0.0), Vec3::ONE);
        let trees = [0; 2].map(|_| world.add_tree(LightTree::new((0..400).map(at).collect()).expect("valid")));
        for tree in trees {
            world.add_instance(tree, Placement::IDENTITY, Policy::RefitOnly).expect("valid");
        }
        let mixed: Vec<(u32, Light)> = (0..400).map(|i| (i as u32, at(i * 133 % 400))).collect();
        world.set_lights(trees[1], &mixed).expect("valid");
        world.update(FrameBudget::NONE);
        let found = looseness(&world);
        assert!(found[&trees[0]] == 1.0 && found[&trees[1]] > 2.0, "{found:?}");
    }
}
