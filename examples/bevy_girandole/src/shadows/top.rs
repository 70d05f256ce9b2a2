//! The tree over all entities that cast shadows.

use bevy::math::{Affine3A, Vec3};
use obvhs::BvhBuildParams;

use super::flat::{Bounds, Flat, FlatNode};
use super::mesh::Word;

/// The share by which the cost of a walk may grow before the tree is built again.
const WORN: f32 = 1.3;

/// Words of an entity: three rows of a matrix, and where its mesh lies.
const RECORD_WORDS: usize = 4;

/// Where a mesh lies in the buffer of meshes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshPlace {
    pub first: u32,
    pub nodes: u32,
    pub bounds: Bounds,
}

/// The tree, which is refitted while entities move, and built again once it is worn or others cast shadows.
#[derive(Debug, Default)]
pub struct Top {
    flat: Flat,
    /// In the order of the items of the tree.
    boxes: Vec<Bounds>,
    /// The cost after the last build.
    built_cost: f32,
    /// A header, the nodes and the records, as the shader reads them.
    words: Vec<Word>,
}

/// The box around a moved box.
fn moved(bounds: Bounds, transform: &Affine3A) -> Bounds {
    let corner = |i: usize| {
        let pick = |axis: usize| if i >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] };
        transform.transform_point3(Vec3::new(pick(0), pick(1), pick(2)))
    };
    Bounds::around((0..8).map(corner))
}

/// The record of an entity, and its box; `None` for one that no ray can hit.
fn record(transform: &Affine3A, place: &MeshPlace) -> Option<([Word; RECORD_WORDS], Bounds)> {
    let (inverse, bounds) = (transform.inverse(), moved(place.bounds, transform));
    let is_sound = place.nodes > 0 && inverse.is_finite() && bounds.min.is_finite() && bounds.max.is_finite();
    let columns = [inverse.matrix3.x_axis, inverse.matrix3.y_axis, inverse.matrix3.z_axis, inverse.translation];
    let row = |axis: usize| columns.map(|column| column[axis].to_bits());
    is_sound.then_some(([row(0), row(1), row(2), [place.first, place.nodes, 0, 0]], bounds))
}

impl Top {
    /// What the shader reads. A header: the number of nodes. Then nodes, two words each, and records, four each.
    pub fn words(&self) -> &[Word] {
        &self.words
    }

    /// Builds the tree. Returns which item each entity is; `None` for those that no ray can hit. O(n log n).
    pub fn build(&mut self, casters: &[(Affine3A, MeshPlace)]) -> Vec<Option<u32>> {
        let records: Vec<_> = casters.iter().map(|(transform, place)| record(transform, place)).collect();
        let numbers: Vec<u32> = (0..).zip(&records).filter(|(_, record)| record.is_some()).map(|(i, _)| i).collect();
        let (words, boxes): (Vec<_>, Vec<_>) = records.iter().flatten().copied().unzip();
        let flat = Flat::build(&boxes, 1, BvhBuildParams::fast_build());
        let mut items = vec![None; casters.len()];
        self.words.clear();
        self.words.push([flat.nodes.len() as u32, 0, 0, 0]);
        self.words.extend_from_slice(bytemuck::cast_slice(&flat.nodes));
        for (item, index) in (0..).zip(&flat.order) {
            items[numbers[*index as usize] as usize] = Some(item);
            self.words.extend(words[*index as usize]);
        }
        self.boxes = flat.order.iter().map(|index| boxes[*index as usize]).collect();
        self.flat = flat;
        self.built_cost = self.cost();
        items
    }

    /// Moves an item; [`Self::refit`] has to follow. Returns false if no ray can hit it there.
    pub fn set(&mut self, item: u32, transform: &Affine3A, place: &MeshPlace) -> bool {
        let Some((record, bounds)) = record(transform, place) else { return false };
        let first = 1 + 2 * self.flat.nodes.len() + RECORD_WORDS * item as usize;
        self.words[first..first + RECORD_WORDS].copy_from_slice(&record);
        self.boxes[item as usize] = bounds;
        true
    }

    /// Fits all boxes to what was moved. Returns whether the tree is worn and has to be built again. O(n).
    pub fn refit(&mut self) -> bool {
        for index in (0..self.flat.nodes.len()).rev() {
            let node = &self.flat.nodes[index];
            let bounds = if node.items > 0 {
                node.range().map(|item| self.boxes[item]).fold(Bounds::NONE, Bounds::with)
            } else {
                let first = &self.flat.nodes[index + 1];
                first.bounds().with(self.flat.nodes[first.next as usize].bounds())
            };
            self.flat.nodes[index].set_bounds(bounds);
        }
        let nodes: &[Word] = bytemuck::cast_slice(&self.flat.nodes);
        self.words[1..=nodes.len()].copy_from_slice(nodes);
        self.cost() > WORN * self.built_cost
    }

    /// What a ray through the box of the tree costs: the areas of all boxes, over that of the first.
    fn cost(&self) -> f32 {
        let area = |node: &FlatNode| node.bounds().half_area();
        let sum: f32 = self.flat.nodes.iter().map(area).sum();
        sum / self.flat.nodes.first().map_or(1.0, |root| area(root).max(f32::MIN_POSITIVE))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place() -> MeshPlace {
        MeshPlace { first: 0, nodes: 1, bounds: Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE } }
    }

    fn grid(step: f32) -> Vec<(Affine3A, MeshPlace)> {
        let at = |i: usize| Vec3::new((i % 10) as f32, (i / 10 % 10) as f32, (i / 100) as f32) * step;
        (0..1000).map(|i| (Affine3A::from_translation(at(i)), place())).collect()
    }

    #[test]
    fn a_refitted_tree_has_the_boxes_of_what_was_moved() {
        let mut casters = grid(5.0);
        let mut top = Top::default();
        let items = top.build(&casters);
        for (i, (transform, place)) in casters.iter_mut().enumerate().step_by(7) {
            transform.translation.x += 0.5 * (i % 3) as f32;
            assert!(top.set(items[i].expect("all are sound"), transform, place));
        }
        assert!(!top.refit(), "small moves");
        for node in &top.flat.nodes {
            for item in node.range() {
                let caster = items.iter().position(|of| *of == Some(item as u32)).expect("each item is one");
                let bounds = moved(casters[caster].1.bounds, &casters[caster].0);
                assert_eq!(node.bounds().with(bounds), node.bounds());
            }
        }
        let root = top.flat.nodes[0].bounds();
        assert_eq!(root, casters.iter().map(|(of, place)| moved(place.bounds, of)).fold(Bounds::NONE, Bounds::with));
        // All change places.
        for (i, item) in items.iter().enumerate() {
            let other = casters[i * 387 % 1000];
            top.set(item.expect("all are sound"), &other.0, &other.1);
        }
        assert!(top.refit(), "it is worn");
    }

    #[test]
    fn what_no_ray_can_hit_is_left_out() {
        let flat = Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0));
        let lost = Affine3A::from_translation(Vec3::splat(f32::NAN));
        let empty = MeshPlace { nodes: 0, bounds: Bounds::NONE, ..place() };
        let sound = Affine3A::from_translation(Vec3::X);
        let mut top = Top::default();
        let items = top.build(&[(flat, place()), (lost, place()), (sound, place()), (sound, empty)]);
        assert_eq!(items, [None, None, Some(0), None]);
        assert_eq!(top.words()[0], [1, 0, 0, 0]);
        assert!(!top.set(0, &lost, &place()));
        assert_eq!(top.build(&[]), []);
        assert_eq!(top.words(), [[0; 4]]);
        assert!(!top.refit());
    }
}
