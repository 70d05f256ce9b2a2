//! Divides the space of a node's items by planes, so that other items can be sorted into the same
//! children later.

use std::array;

use glam::Vec4;

use super::children::ChildChooser;
use super::counts::middle;
use super::group::{BuildItem, Group};
use super::split::{longest_axis, split};
use crate::tree::WIDTH;

/// [`Planes::axes`] of a plane between the identities of items that lie at one point. All planes of a node are such
/// planes, or none.
pub(crate) const BY_IDENTITY: u8 = 3;

/// Added to the number of a child in [`Planes::ways`].
pub(crate) const EXIT: u8 = WIDTH as u8;

/// Up to seven planes, which divide space among up to eight children. The first plane divides all of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Planes {
    /// The number of planes.
    pub count: usize,
    /// The axis of each plane, or [`BY_IDENTITY`].
    pub axes: [u8; WIDTH - 1],
    /// Where each plane is: the bits of a coordinate, or an identity. What is less is below the plane.
    pub at: [u32; WIDTH - 1],
    /// What lies below and above each plane: the number of another plane, or [`EXIT`] and a child.
    pub ways: [[u8; 2]; WIDTH - 1],
}

impl Planes {
    /// The child of what lies below these planes.
    #[inline(always)]
    pub fn child(&self, is_below: impl Fn(usize) -> bool) -> usize {
        let mut way = if self.count > 0 { 0 } else { EXIT };
        while way < EXIT {
            let side = usize::from(!is_below(usize::from(way)));
            way = self.ways[usize::from(way)][side];
        }
        usize::from(way - EXIT)
    }
}

/// One plane.
struct Plane {
    axis: u8,
    at: u32,
}

/// Divides more than [`WIDTH`] items among the children of a node and sorts the items by child. `identity` returns a
/// number for an item's index, different for most items. `halve` is as in [`split()`]. Returns the planes and the
/// number of items of each child. There is a single child if all identities of items at one point are equal.
pub(crate) fn divide(items: &mut [BuildItem], halve: bool, identity: impl Fn(u32) -> u32) -> (Planes, [usize; WIDTH]) {
    let whole = Group { is_cut_along_longest: true, ..Group::around(items) };
    let mut chooser = ChildChooser::default();
    chooser.start(&whole);
    let mut planes = Planes::default();
    // Which way leads to each group.
    let mut leads = vec![[0; 2]];
    while let Some(place) = chooser.next_split() {
        let group = Group { is_cut_along_longest: true, ..*chooser.group(place) };
        let first = chooser.first_light(place);
        let Some((plane, parts)) = cut(&mut items[first..][..group.count], &group, halve, &identity) else { break };
        let number = planes.count;
        (planes.axes[number], planes.at[number]) = (plane.axis, plane.at);
        if number > 0 {
            let [above, side] = leads[place];
            planes.ways[above][side] = number as u8;
        }
        leads[place] = [number, 0];
        leads.insert(place + 1, [number, 1]);
        planes.count += 1;
        // What lies at one point is divided by a node of its own.
        let is_one_point = |part: &Group| part.count > WIDTH && longest_axis(&part.means).is_none();
        chooser.replace(place, &parts, &whole, |part| plane.axis != BY_IDENTITY && is_one_point(part));
    }
    if planes.count > 0 {
        for (child, [plane, side]) in leads.iter().enumerate() {
            planes.ways[*plane][*side] = EXIT + child as u8;
        }
    }
    let mut counts = chooser.groups().map(|group| group.count);
    (planes, array::from_fn(|_| counts.next().unwrap_or(0)))
}

/// Cuts a group by a plane and sorts its items, those below the plane first. `None` if the items are at one point and
/// have one identity.
fn cut(
    items: &mut [BuildItem],
    group: &Group,
    halve: bool,
    identity: impl Fn(u32) -> u32,
) -> Option<(Plane, [Group; 2])> {
    let Some(longest) = longest_axis(&group.means) else { return cut_by_identity(items, identity) };
    let parts = split(items, group, halve);
    let (below, above) = items.split_at(parts[0].count);
    let last = below.iter().fold(Vec4::NEG_INFINITY, |last, item| last.max(item.mean));
    let first = above.iter().fold(Vec4::INFINITY, |first, item| first.min(item.mean));
    if let Some(axis) = (0..3).find(|axis| last[*axis] < first[*axis]) {
        let at = between(last[axis], first[axis]).to_bits();
        return Some((Plane { axis: axis as u8, at }, parts));
    }
    // Many items have the same coordinate, so the plane is before or after all of them.
    let same = last[longest];
    let before = items.iter().filter(|item| item.mean[longest] < same).count();
    let beyond = items.iter().filter(|item| item.mean[longest] > same);
    let (after, next) =
        beyond.fold((items.len(), f32::INFINITY), |(after, next), item| (after - 1, next.min(item.mean[longest])));
    let is_before = before > 0 && (after == items.len() || before >= items.len() - after);
    let at = if is_before { same } else { between(same, next) };
    items.sort_by_key(|item| item.mean[longest] >= at);
    let parts = items.split_at(if is_before { before } else { after });
    Some((Plane { axis: longest as u8, at: at.to_bits() }, [Group::around(parts.0), Group::around(parts.1)]))
}

/// A coordinate above `below` and at most `above`.
fn between(below: f32, above: f32) -> f32 {
    let middle = below + 0.5 * (above - below);
    if middle > below && middle <= above { middle } else { above }
}

/// Cuts items at one point near their middle.
fn cut_by_identity(items: &mut [BuildItem], identity: impl Fn(u32) -> u32) -> Option<(Plane, [Group; 2])> {
    let of = |item: &BuildItem| identity(item.index());
    items.sort_unstable_by_key(|item| (of(item), item.index()));
    let (half, last) = (middle(items.len()), items.len() - 1);
    let place = (half..=last).chain((1..half).rev()).find(|place| of(&items[place - 1]) < of(&items[*place]))?;
    let (below, above) = items.split_at(place);
    Some((Plane { axis: BY_IDENTITY, at: of(&above[0]) }, [Group::around(below), Group::around(above)]))
}

#[cfg(test)]
mod tests {
    use glam::{Vec3, vec3};

    use super::*;
    use crate::cluster::Cluster;
    use crate::light::Light;
    use crate::tree::testing::Rng;

    fn items(at: &[Vec3]) -> Vec<BuildItem> {
        let cluster = |at: &Vec3| Cluster { axis: Vec3::ZERO, ..Light::point(*at, Vec3::ONE).cluster() };
        at.iter().zip(0..).map(|(at, index)| BuildItem::new(&cluster(at), index)).collect()
    }

    /// Divides items at some places, and checks that the planes lead each of them to its child.
    fn checked(at: &[Vec3], halve: bool) -> (Planes, [usize; WIDTH]) {
        let identity = |index: u32| index.wrapping_mul(0x9e37_79b9);
        let mut items = items(at);
        let (planes, counts) = divide(&mut items, halve, identity);
        assert_eq!(counts.iter().sum::<usize>(), at.len());
        let children = counts.iter().enumerate().flat_map(|(child, count)| std::iter::repeat_n(child, *count));
        for (item, child) in items.iter().zip(children) {
            let (index, position) = (item.index(), at[item.index() as usize].to_array());
            let is_below = |plane: usize| match position.get(planes.axes[plane] as usize) {
                Some(coordinate) => *coordinate < f32::from_bits(planes.at[plane]),
                None => identity(index) < planes.at[plane],
            };
            assert_eq!(planes.child(is_below), child, "{planes:?}");
        }
        (planes, counts)
    }

    #[test]
    fn planes_lead_all_items_to_their_children() {
        let mut rng = Rng(1);
        for halve in [false, true] {
            for count in [9, 10, 16, 17, 100, 1000, 20_000] {
                let at: Vec<Vec3> = (0..count).map(|_| rng.position(100.0)).collect();
                let (planes, counts) = checked(&at, halve);
                let groups = counts.iter().filter(|count| **count > 0).count();
                assert_eq!(planes.count + 1, groups, "{counts:?}");
                assert!(count < 64 || groups == WIDTH, "{counts:?}");
                // In a plane, on a line, on a grid, and over many decades.
                checked(&at.iter().map(|at| at.with_y(3.0)).collect::<Vec<_>>(), halve);
                checked(&at.iter().map(|at| vec3(at.x, 0.0, 0.0)).collect::<Vec<_>>(), halve);
                checked(&at.iter().map(|at| at.round()).collect::<Vec<_>>(), halve);
                checked(&at.iter().map(|at| (0.3 * at).exp()).collect::<Vec<_>>(), halve);
            }
        }
    }

    #[test]
    fn items_with_equal_coordinates_lie_on_one_side_of_a_plane() {
        for beside in [1, 8, 40] {
            let mut at = vec![Vec3::X; 40];
            at.extend((0..beside).map(|i| vec3(2.0 + i as f32, 0.0, 0.0)));
            let (_, counts) = checked(&at, true);
            assert!(counts.iter().all(|count| *count < 40 + beside), "{counts:?}");
        }
        // Neighbouring floats.
        let next = f32::from_bits(1.0_f32.to_bits() + 1);
        let at: Vec<Vec3> = (0..20).map(|i| Vec3::X * if i % 2 == 0 { 1.0 } else { next }).collect();
        assert_eq!(checked(&at, false).0.at[0], next.to_bits());
    }

    #[test]
    fn items_at_one_point_are_divided_by_identity_unless_that_is_the_same() {
        let (planes, counts) = checked(&[Vec3::ONE; 100], false);
        assert!(planes.axes.iter().all(|axis| *axis == BY_IDENTITY), "{planes:?}");
        assert!(counts.iter().all(|count| *count > 0), "{counts:?}");
        let (planes, counts) = divide(&mut items(&[Vec3::ONE; 100]), false, |_| 7);
        assert_eq!((planes.count, counts[0]), (0, 100));
    }
}
