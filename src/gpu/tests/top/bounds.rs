//! The bounds of every node hold everything below it.

use glam::{Affine3A, Quat, Vec3};

use super::twin::check;
use super::{Built, TopRig, build, placement, world_of};
use crate::cluster::cone::angle;
use crate::cluster::{Aabb, Cluster};
use crate::gpu::testing::random_vec;
use crate::light::UNLIMITED_RANGE;
use crate::tree::{CAP_STEPS, ChildRef, NO_PARENT, WIDTH};
use crate::{Light, LightTree, LightWorld, Policy};

/// The first property of `inner` that `outer` does not hold; `outer` is decoded as sampling decodes
/// it. Of coordinates, drivers may flush what is below the least normal number.
fn violated_bound(outer: &Cluster, inner: &Cluster) -> Option<&'static str> {
    let between = f64::from(angle(outer.axis.normalize_or_zero(), inner.axis.normalize_or_zero()));
    let half_angle = |c: &Cluster| f64::from(c.cos_half_angle).acos();
    let is_all = outer.cos_half_angle <= -1.0;
    let Aabb { min, max } = outer.aabb;
    let bounds = Aabb { min: min - f32::MIN_POSITIVE, max: max + f32::MIN_POSITIVE };
    [
        (!bounds.contains(&inner.aabb), "box"),
        (outer.range < inner.range.min(UNLIMITED_RANGE), "range"),
        (!is_all && (inner.cos_half_angle <= -1.0 || between + half_angle(inner) > half_angle(outer)), "cap"),
    ]
    .into_iter()
    .find_map(|(is_broken, what)| is_broken.then_some(what))
}

/// Checks that parents and children refer to each other. Also checks that each packed child, and
/// each packed child on the way up from it, holds the cluster that the child was packed from.
pub(super) fn assert_bounds_hold(built: &Built) {
    for node in built.reached() {
        for place in (node * WIDTH..(node + 1) * WIDTH).filter(|place| built.child(*place).flux > 0.0) {
            let inner = built.child(place);
            let mut place = place;
            loop {
                let node = &built.nodes[place / WIDTH];
                let outer = node.cluster(place % WIDTH);
                assert_eq!(violated_bound(&outer, &inner), None, "place {place}: {outer:?} {inner:?}");
                if node.parent == NO_PARENT {
                    break;
                }
                let above = node.parent as usize;
                assert_eq!(built.nodes[above / WIDTH].children[above % WIDTH] as usize, place / WIDTH);
                place = above;
            }
        }
    }
}

/// The lights of a tree at or below a child.
fn lights_below(tree: &LightTree, child: ChildRef) -> Vec<Light> {
    match child {
        ChildRef::Leaf(light) => vec![tree.lights()[light as usize]],
        ChildRef::Node(node) => {
            let node = &tree.nodes()[node as usize];
            (0..WIDTH).filter_map(|slot| node.child(slot)).flat_map(|child| lights_below(tree, child)).collect()
        }
    }
}

#[test]
fn every_packed_child_on_the_way_up_holds_every_light_of_an_instance() {
    let mut top = TopRig::new();
    let world = world_of(400, placement);
    let built = build(&mut top, &world);
    let (mut caps, mut sheared_caps) = (0, 0);
    for (index, part) in built.parts.iter().enumerate() {
        let instance = world.instance(world.instance_at(part.slot).unwrap()).unwrap();
        let placed = instance.shown().expect("no test hides an instance");
        let (frame, linear) = (placed.frame(world.home()), placed.linear);
        let tree = world.tree(instance.tree).unwrap();
        for light in lights_below(tree, part.entry).into_iter().filter(|light| light.flux() > 0.0) {
            let inner = light.cluster();
            let mut place = built.records[index].place as usize;
            assert_eq!(built.nodes[place / WIDTH].children[place % WIDTH], part.leaf(index as u32));
            while place != NO_PARENT as usize {
                let node = &built.nodes[place / WIDTH];
                let outer = node.cluster(place % WIDTH);
                for corner in [inner.aabb.min, inner.aabb.max, inner.aabb.center()] {
                    let exact = frame.to_world.as_dmat3() * corner.as_dvec3() + frame.translation.as_dvec3();
                    assert!(
                        exact.cmpge(outer.aabb.min.as_dvec3()).all() && exact.cmple(outer.aabb.max.as_dvec3()).all()
                    );
                }
                assert!(outer.range >= inner.range.min(UNLIMITED_RANGE));
                if outer.cos_half_angle > -1.0 {
                    // Surfaces turn as normals do.
                    let map = if inner.area_flux > 0.0 { linear.cofactor } else { frame.to_world };
                    let axis = (map * inner.axis).normalize();
                    let reach = f64::from(angle(outer.axis.normalize(), axis)) + f64::from(inner.cos_half_angle).acos();
                    assert!(reach <= f64::from(outer.cos_half_angle).acos(), "{outer:?} {inner:?}");
                    caps += 1;
                    sheared_caps += usize::from(!linear.is_similarity);
                }
                place = node.parent as usize;
            }
        }
    }
    assert!(caps > 100 && sheared_caps > 20, "only {caps} caps were checked, {sheared_caps} of them sheared");
}

/// A box of many instances rounds inward without its padding, most of all far from the origin.
#[test]
fn boxes_far_from_the_origin_hold_the_exact_images_of_their_corners() {
    let mut top = TopRig::new();
    for distance in [1.0e6, 0.5e9] {
        let mut world = LightWorld::new();
        // Trees of one light, whose boxes are those of their lights.
        let trees: Vec<_> = (0..16)
            .map(|i| {
                let (at, u, v) = (20.0 * random_vec(i, 40), 30.0 * random_vec(i, 43), 30.0 * random_vec(i, 46));
                world.add_tree(LightTree::new(vec![Light::triangle([at, at + u, at + v], Vec3::ONE)]).unwrap())
            })
            .collect();
        for i in 0..200 {
            let mut placed = placement(i);
            placed.translation = distance * placed.translation.normalize();
            world.add_instance(trees[i as usize % trees.len()], placed, Policy::Static).unwrap();
        }
        let built = build(&mut top, &world);
        for (part, leaf) in built.parts.iter().zip(&built.leaves) {
            let instance = world.instance(world.instance_at(part.slot).unwrap()).unwrap();
            let frame = instance.shown().expect("no instance is hidden").frame(world.home());
            let inner = world.tree(instance.tree).unwrap().lights()[0].cluster().aabb;
            for corner in 0..8 {
                let pick = |axis: usize| if corner >> axis & 1 == 0 { inner.min[axis] } else { inner.max[axis] };
                let corner = Vec3::new(pick(0), pick(1), pick(2)).as_dvec3();
                let exact = frame.to_world.as_dmat3() * corner + frame.translation.as_dvec3();
                let is_inside =
                    exact.cmpge(leaf.aabb.min.as_dvec3()).all() && exact.cmple(leaf.aabb.max.as_dvec3()).all();
                assert!(is_inside, "{distance} m: {exact} {:?}", leaf.aabb);
            }
        }
    }
}

/// Steps of grids whose exponents are at the end of f32, where a device may flush denormals.
#[test]
fn nodes_of_tiny_extents_hold_what_is_below_them() {
    let mut top = TopRig::new();
    for extent in [1.0e-30_f32, 1.0e-36, 1.0e-38, 1.0e-40, 1.0e-44] {
        for axes in [Vec3::ONE, Vec3::X, Vec3::new(0.0, 1.0, 1.0)] {
            let mut world = LightWorld::new();
            let tree = world.add_tree(LightTree::new(vec![Light::point(Vec3::ZERO, Vec3::ONE)]).unwrap());
            for i in 0..100 {
                let at = (random_vec(i, 50) * axes).as_dvec3() * f64::from(extent);
                world.add_instance(tree, Affine3A::from_translation(at.as_vec3()), Policy::Static).unwrap();
            }
            assert_bounds_hold(&build(&mut top, &world));
        }
    }
}

#[test]
fn caps_of_beams_with_similar_directions_stay_narrow_up_to_the_root() {
    let mut top = TopRig::new();
    for widest in [0.0, 1.0e-4, 0.05, 0.9, 1.4] {
        let mut world = LightWorld::new();
        let beam = Light::spot(Vec3::ZERO, Vec3::NEG_Y, 0.0, 0.5 * widest + 1.0e-3, Vec3::ONE);
        let tree = world.add_tree(LightTree::new(vec![beam]).unwrap());
        for i in 0..520 {
            let rotation = Quat::from_scaled_axis(2.0 * widest * random_vec(i, 30));
            let at = Affine3A::from_rotation_translation(rotation, 100.0 * random_vec(i, 33));
            world.add_instance(tree, at, Policy::default()).unwrap();
        }
        let built = check(&mut top, &world);
        for slot in (0..WIDTH).filter(|slot| built.nodes[0].flux[*slot] > 0) {
            // The half angle is the sum of the rotations, at most sqrt(3) * 0.05 either way, of the
            // beam's own half angle and of the padding of four levels.
            let half_angle = built.child(slot).cos_half_angle.acos();
            assert!(widest > 0.05 || half_angle < 0.2, "{widest}: {half_angle}");
            // Packing moves the axis by half a step along each coordinate, and the cosine loses at
            // most one step of 1/127.
            let packed = built.nodes[0].cluster(slot).cos_half_angle.acos();
            let cos = (half_angle + 7.0e-3).cos() - 1.0 / CAP_STEPS - 1.0e-3;
            assert!(widest > 0.05 || packed <= cos.acos(), "{widest}: {packed} of {half_angle}");
        }
    }
}
