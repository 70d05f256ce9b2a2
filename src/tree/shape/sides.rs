//! Divides the lights of an object by the sides to which they shine.
//!
//! A cluster has one cone and one mean direction. Of a house with windows on all sides the cone is
//! the whole sphere and the mean direction says nothing, so a wall across the street seems to
//! receive light from all of them. Where the lights of an object disagree, the children of its root
//! are therefore its sides, and each side becomes a leaf of the top level (docs/decisions.md, 49).

use super::group::{BuildItem, Group};
use crate::tree::WIDTH;

/// Objects of fewer lights, such as cars, are not divided: the top level gets more leaves and no
/// better (docs/decisions.md, 49).
const MIN_DIVIDED: usize = 16;

/// Objects of more lights are not divided. Their trees divide by direction too, further down.
const MAX_DIVIDED: usize = 256;

/// A light whose mean direction is shorter than this shines to all sides: a point, a sphere or a
/// dark light. That of a surface has a length of 2/3.
const MIN_LENGTH: f32 = 0.3;

/// A light whose mean direction is longer than this is a beam. Beams are apart from lights that
/// shine widely to the same side, unless the object would then have more sides than a node has
/// children.
const BEAM_LENGTH: f32 = 0.8;

/// The side of lights that shine to all sides.
const ALL_SIDES: usize = 6;

/// The sides of wide lights, that of lights that shine to all sides, and the sides of beams.
const MAX_SIDES: usize = 2 * ALL_SIDES + 1;

/// The side to which a light shines: the axis of the greatest coordinate of its mean direction,
/// and its sign.
fn side_of(item: &BuildItem, has_beams: bool) -> usize {
    let direction = item.direction().truncate();
    let length_sq = direction.length_squared();
    if length_sq < MIN_LENGTH * MIN_LENGTH {
        return ALL_SIDES;
    }
    let size = direction.abs();
    let axis = if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    let side = 2 * axis + usize::from(direction[axis] < 0.0);
    if has_beams && length_sq > BEAM_LENGTH * BEAM_LENGTH { side + ALL_SIDES + 1 } else { side }
}

/// The number of lights of each side.
fn counts(items: &[BuildItem], has_beams: bool) -> [usize; MAX_SIDES] {
    let mut counts = [0; MAX_SIDES];
    items.iter().for_each(|item| counts[side_of(item, has_beams)] += 1);
    counts
}

/// Sorts the lights of an object by side and returns the sides, which become the children of its
/// root. `None`, and no change, if the object is not to be divided. O(n log n) from
/// [`MIN_DIVIDED`] to [`MAX_DIVIDED`] lights, and O(1) otherwise.
pub(super) fn sides(items: &mut [BuildItem]) -> Option<Vec<Group>> {
    if !(MIN_DIVIDED..=MAX_DIVIDED).contains(&items.len()) {
        return None;
    }
    let count = |counts: &[usize; MAX_SIDES]| counts.iter().filter(|count| **count > 0).count();
    let mut has_beams = true;
    let mut lights = counts(items, has_beams);
    if count(&lights) > WIDTH {
        has_beams = false;
        lights = counts(items, has_beams);
    }
    if count(&lights) < 2 {
        return None;
    }
    // Stable: the shape does not depend on how the lights are sorted.
    items.sort_by_key(|item| side_of(item, has_beams));
    let mut rest = &*items;
    let groups = lights.into_iter().filter(|count| *count > 0).map(|count| {
        let (own, others) = rest.split_at(count);
        rest = others;
        Group::around(own)
    });
    Some(groups.collect())
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::light::Light;
    use crate::tree::{ChildRef, LightTree};

    fn beam(direction: Vec3) -> Light {
        Light::spot(direction, direction, 0.1, 0.3, Vec3::ONE)
    }

    fn panel(at: Vec3, normal: Vec3) -> Light {
        let u = 0.1 * normal.any_orthonormal_vector();
        Light::rectangle(at, u, normal.cross(u), Vec3::ONE)
    }

    /// Eight copies of each light, so that two lights are enough for a division.
    fn copied(lights: &[Light]) -> Vec<Light> {
        lights.iter().flat_map(|light| [*light; COPIES]).collect()
    }

    const COPIES: usize = 8;

    /// The lights of each side of a tree of eight copies of each light, in ascending order of
    /// indices. All copies of a light must be on the same side.
    fn sides_of(lights: Vec<Light>) -> Vec<Vec<u32>> {
        let mut sides = all_sides_of(copied(&lights));
        for side in &mut sides {
            let copies: Vec<u32> = std::mem::take(side);
            *side = copies.iter().step_by(COPIES).map(|light| light / COPIES as u32).collect();
            let whole = side.iter().flat_map(|light| (0..COPIES as u32).map(move |copy| light * COPIES as u32 + copy));
            assert!(whole.eq(copies));
        }
        sides
    }

    /// The lights of each side of a tree, in ascending order of indices.
    fn all_sides_of(lights: Vec<Light>) -> Vec<Vec<u32>> {
        fn below(tree: &LightTree, child: ChildRef) -> Vec<u32> {
            match child {
                ChildRef::Leaf(light) => vec![light],
                ChildRef::Node(node) => {
                    let node = &tree.nodes()[node as usize];
                    (0..WIDTH).filter_map(|slot| node.child(slot)).flat_map(|child| below(tree, child)).collect()
                }
            }
        }
        let tree = LightTree::new(lights).expect("valid lights");
        tree.check().expect("the tree is sound");
        let children = (0..tree.sides().len()).map(|side| tree.nodes()[0].child(side).expect("a side has a child"));
        let mut sides: Vec<_> = children.map(|child| below(&tree, child)).collect();
        sides.iter_mut().for_each(|side| side.sort_unstable());
        sides
    }

    #[test]
    fn the_lights_of_a_bus_are_divided_into_front_and_back() {
        let front = |x| {
            Light::spot(Vec3::new(x, 0.6, 2.0), Vec3::new(0.0, -0.1, 1.0).normalize(), 0.2, 0.5, Vec3::splat(900.0))
        };
        let back = |x| panel(Vec3::new(x, 0.8, -2.0), Vec3::NEG_Z);
        assert_eq!(sides_of(vec![front(-0.7), back(-0.7), front(0.7), back(0.7)]), [[1, 3], [0, 2]]);
        // A side of one light is a leaf.
        let mut one_ahead = vec![back(0.0); MIN_DIVIDED];
        one_ahead[3] = front(0.0);
        assert_eq!(all_sides_of(one_ahead)[1], [3]);
    }

    #[test]
    fn lights_that_agree_are_not_divided() {
        let lamp = |i: usize| Light::point(Vec3::X * i as f32, Vec3::ONE);
        for count in [0, 1, 2, 30] {
            assert!(sides_of((0..count).map(lamp).collect()).is_empty());
            assert!(sides_of((0..count).map(|i| panel(Vec3::X * i as f32, Vec3::Y)).collect()).is_empty());
        }
        // The directions of dark lights do not count.
        let dark = Light::spot(Vec3::ZERO, Vec3::NEG_Y, 0.1, 0.3, Vec3::ZERO);
        assert!(sides_of(vec![lamp(0), dark, lamp(1)]).is_empty());
    }

    #[test]
    fn beams_are_apart_from_wide_lights_while_the_root_has_room_for_their_sides() {
        let mut lights = vec![panel(Vec3::ZERO, Vec3::X), beam(Vec3::X), Light::point(Vec3::ZERO, Vec3::ONE)];
        assert_eq!(sides_of(lights.clone()), [[0], [2], [1]]);
        // Twelve sides are too many, so beams are with the wide lights of their side.
        for direction in [Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z] {
            lights.extend([panel(Vec3::ZERO, direction), beam(direction)]);
        }
        assert_eq!(
            sides_of(lights),
            [vec![0, 1], vec![3, 4], vec![5, 6], vec![7, 8], vec![9, 10], vec![11, 12], vec![2]]
        );
    }

    #[test]
    fn objects_of_16_to_256_lights_are_divided() {
        let counts = |count: usize| {
            let lights = (0..count).map(|i| beam([Vec3::X, Vec3::NEG_X][i % 2])).collect();
            all_sides_of(lights).iter().map(Vec::len).collect::<Vec<_>>()
        };
        assert_eq!([16, 256].map(counts), [[8, 8], [128, 128]]);
        assert_eq!([2, 15, 257].map(counts), [[0; 0]; 3]);
    }

    #[test]
    fn the_sides_follow_lights_that_turn_and_a_rebuild_divides_them_anew() {
        let ahead = |range: std::ops::Range<u32>| range.map(|light| (light, beam(Vec3::X))).collect::<Vec<_>>();
        let lights = copied(&[beam(Vec3::X), beam(Vec3::NEG_X), beam(Vec3::NEG_X)]);
        let mut tree = LightTree::new(lights).expect("valid lights");
        assert_eq!(tree.sides().len(), 2);
        tree.set_lights(&ahead(8..16)).expect("valid");
        tree.refit_without_attributes();
        tree.check().expect("the tree is sound");
        assert_eq!((tree.sides().len(), tree.sides()[1].cos_half_angle), (2, -1.0), "two opposite beams");
        tree.freeze();
        assert_eq!(tree.sides()[1].cos_half_angle, -1.0);
        tree.rebuild();
        assert_eq!(tree.sides().iter().filter(|side| side.cos_half_angle > 0.9).count(), 2);
        tree.set_lights(&ahead(16..24)).expect("valid");
        tree.rebuild();
        tree.check().expect("the tree is sound");
        assert!(tree.sides().is_empty());
    }
}
