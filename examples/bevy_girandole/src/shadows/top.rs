//! The trees over all entities that cast shadows in software.
//!
//! They lie one after the other, and a walk that has ended with one goes on with the next. An entity that comes gets
//! into a new tree, which takes in the trees before it that are not much larger. So each entity is in few builds, and
//! one that comes does not build a tree over all of them.

use std::collections::BTreeMap;

use bevy::math::Affine3A;
use obvhs::BvhBuildParams;

use super::flat::{Bounds, Flat, FlatNode};
use super::mesh::{Word, placed};

/// The share by which the cost of a walk may grow before a tree is built again.
const WORN: f32 = 1.3;

/// A new tree takes in one before it that has up to so many times its entities.
const TAKEN_IN: usize = 4;

/// What the shader knows of an entity: three rows of a matrix, and where its mesh lies.
type Record = [Word; 4];

/// Where a mesh lies in the buffer of meshes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshPlace {
    pub first: u32,
    pub nodes: u32,
    pub bounds: Bounds,
}

/// An entity in a tree.
#[derive(Clone, Copy, Debug)]
struct Item {
    number: u32,
    record: Record,
    bounds: Bounds,
}

/// One tree.
#[derive(Debug, Default)]
struct Part {
    flat: Flat,
    /// In the order of the tree. Those that are gone have no bounds and no nodes.
    items: Vec<Item>,
    gone: usize,
    /// The cost after the build.
    built_cost: f32,
    has_moved: bool,
}

/// All trees.
#[derive(Debug, Default)]
pub struct Top {
    parts: Vec<Part>,
    /// The tree of each entity, and its place there.
    places: Vec<Option<(usize, usize)>>,
    /// Entities that have come since the last update.
    fresh: BTreeMap<u32, Item>,
    /// A header, the nodes and the records, as the shader reads them.
    words: Vec<Word>,
}

/// The record of an entity, and its box; `None` for one that no ray can hit.
fn record(transform: &Affine3A, place: &MeshPlace) -> Option<(Record, Bounds)> {
    let (inverse, bounds) = placed(place.bounds, transform).filter(|_| place.nodes > 0)?;
    let columns = [inverse.matrix3.x_axis, inverse.matrix3.y_axis, inverse.matrix3.z_axis, inverse.translation];
    let row = |axis: usize| columns.map(|column| column[axis].to_bits());
    Some(([row(0), row(1), row(2), [place.first, place.nodes, 0, 0]], bounds))
}

impl Part {
    fn build(items: Vec<Item>) -> Self {
        let boxes: Vec<_> = items.iter().map(|item| item.bounds).collect();
        let flat = Flat::build(&boxes, 1, BvhBuildParams::fast_build());
        let items = flat.order.iter().map(|index| items[*index as usize]).collect();
        let mut part = Self { flat, items, ..Self::default() };
        part.built_cost = part.cost();
        part
    }

    /// The entities that are not gone.
    fn live(self) -> impl Iterator<Item = Item> {
        self.items.into_iter().filter(|item| item.bounds != Bounds::NONE)
    }

    fn live_count(&self) -> usize {
        self.items.len() - self.gone
    }

    /// Fits all boxes to what was moved. O(n).
    fn refit(&mut self) {
        for index in (0..self.flat.nodes.len()).rev() {
            let node = &self.flat.nodes[index];
            let bounds = if node.items > 0 {
                node.range().map(|item| self.items[item].bounds).fold(Bounds::NONE, Bounds::with)
            } else {
                let first = &self.flat.nodes[index + 1];
                first.bounds().with(self.flat.nodes[first.next as usize].bounds())
            };
            self.flat.nodes[index].set_bounds(bounds);
        }
        self.has_moved = false;
    }

    /// What a ray through the box of the tree costs: the areas of all boxes, over that of the first.
    fn cost(&self) -> f32 {
        let area = |node: &FlatNode| node.bounds().half_area();
        let sum: f32 = self.flat.nodes.iter().map(area).sum();
        sum / self.flat.nodes.first().map_or(1.0, |root| area(root).max(f32::MIN_POSITIVE))
    }

    fn is_worn(&self) -> bool {
        2 * self.gone > self.items.len() || self.cost() > WORN * self.built_cost
    }
}

impl Top {
    /// What the shader reads. A header: the number of nodes. Then nodes, two words each, and records, four each.
    pub fn words(&self) -> &[Word] {
        &self.words
    }

    /// The number of entities that rays can hit.
    pub fn count(&self) -> usize {
        self.parts.iter().map(Part::live_count).sum::<usize>() + self.fresh.len()
    }

    /// Puts an entity somewhere, or replaces it. One that no ray can hit is left out. O(1).
    pub fn put(&mut self, number: u32, transform: &Affine3A, place: &MeshPlace) {
        let Some((record, bounds)) = record(transform, place) else { return self.remove(number) };
        let item = Item { number, record, bounds };
        match self.places.get(number as usize).copied().flatten() {
            Some((part, index)) => {
                let part = &mut self.parts[part];
                part.items[index] = item;
                part.has_moved = true;
            }
            None => drop(self.fresh.insert(number, item)),
        }
    }

    /// Removes an entity, if it is there. O(1).
    pub fn remove(&mut self, number: u32) {
        self.fresh.remove(&number);
        let Some((part, index)) = self.places.get_mut(number as usize).and_then(Option::take) else { return };
        let part = &mut self.parts[part];
        // A ray that comes here finds nothing.
        part.items[index] = Item { number, record: [[0; 4]; 4], bounds: Bounds::NONE };
        part.gone += 1;
        part.has_moved = true;
    }

    /// Brings the trees up to date. Returns whether anything has changed. O(n), and O(log n) builds for each entity that
    /// comes.
    pub fn update(&mut self) -> bool {
        if self.fresh.is_empty() && self.parts.iter().all(|part| !part.has_moved) && !self.words.is_empty() {
            return false;
        }
        if !self.fresh.is_empty() {
            let mut items: Vec<_> = std::mem::take(&mut self.fresh).into_values().collect();
            while let Some(part) = self.parts.pop_if(|part| part.live_count() <= TAKEN_IN * items.len()) {
                items.extend(part.live());
            }
            self.parts.push(Part::default());
            self.build(self.parts.len() - 1, items);
        }
        for index in 0..self.parts.len() {
            if self.parts[index].has_moved {
                self.parts[index].refit();
                if self.parts[index].is_worn() {
                    let items = std::mem::take(&mut self.parts[index]).live().collect();
                    self.build(index, items);
                }
            }
        }
        self.write();
        true
    }

    fn build(&mut self, index: usize, items: Vec<Item>) {
        self.parts[index] = Part::build(items);
        for (place, item) in self.parts[index].items.iter().enumerate() {
            let number = item.number as usize;
            if self.places.len() <= number {
                self.places.resize(number + 1, None);
            }
            self.places[number] = Some((index, place));
        }
    }

    fn write(&mut self) {
        let nodes = self.parts.iter().map(|part| part.flat.nodes.len() as u32).sum();
        self.words.clear();
        self.words.push([nodes, 0, 0, 0]);
        let [mut first_node, mut first_item] = [0, 0];
        for part in &self.parts {
            for node in &part.flat.nodes {
                let items = if node.items > 0 { node.items + (first_item << 3) } else { 0 };
                let node = FlatNode { next: node.next + first_node, items, ..*node };
                self.words.extend(bytemuck::cast::<_, [Word; 2]>(node));
            }
            first_node += part.flat.nodes.len() as u32;
            first_item += part.items.len() as u32;
        }
        self.words.extend(self.parts.iter().flat_map(|part| &part.items).flat_map(|item| item.record));
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3;

    use super::*;

    fn place() -> MeshPlace {
        MeshPlace { first: 0, nodes: 1, bounds: Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE } }
    }

    fn at(i: u32) -> Affine3A {
        Affine3A::from_translation(Vec3::new((i % 10) as f32, (i / 10 % 10) as f32, (i / 100) as f32) * 5.0)
    }

    /// Walks as the shader does, along a ray to +X through points that are not between boxes. Returns the numbers of
    /// words at which it finds records, and the nodes that it visits.
    fn walk(words: &[Word], y: f32, z: f32) -> (Vec<usize>, usize) {
        let [nodes, ..] = words[0];
        let (mut node, mut found, mut visits) = (0, Vec::new(), 0);
        while node < nodes {
            visits += 1;
            let [lower, upper] = [words[1 + 2 * node as usize], words[2 + 2 * node as usize]];
            let within = |axis: usize, value: f32| {
                let [a, b] = [lower, upper].map(|corner| f32::from_bits(corner[axis]));
                a.min(b) <= value && value <= a.max(b)
            };
            if !(within(1, y) && within(2, z)) {
                node = lower[3];
                continue;
            }
            node += 1;
            let first = upper[3] >> 3;
            found.extend((first..first + (upper[3] & 7)).map(|item| (1 + 2 * nodes + 4 * item) as usize));
        }
        found.retain(|record| words[record + 3][1] > 0);
        found.sort_unstable();
        (found, visits)
    }

    /// Every row of boxes is found by the ray through it, whole and alone.
    fn check(top: &Top, transforms: &BTreeMap<u32, Affine3A>) -> usize {
        let mut most = 0;
        for row in 0..100 {
            let [y, z] = [row % 10, row / 10].map(|i| 5.0 * i as f32);
            let (found, visits) = walk(top.words(), y, z);
            let expected = transforms
                .values()
                .filter(|of| (of.translation.y - y).abs() <= 1.0 && (of.translation.z - z).abs() <= 1.0)
                .count();
            assert_eq!(found.len(), expected, "row {row}");
            most = most.max(visits);
        }
        assert_eq!(top.count(), transforms.len());
        most
    }

    #[test]
    fn entities_that_come_one_by_one_are_found_and_take_few_builds() {
        let mut transforms = BTreeMap::new();
        let mut top = Top::default();
        assert!(top.update(), "of nothing");
        let mut built = 0;
        for i in 0..1000 {
            transforms.insert(i, at(i * 387 % 1000));
            top.put(i, &transforms[&i], &place());
            let before: Vec<_> = top.parts.iter().map(|part| part.items.len()).collect();
            assert!(top.update() && !top.update());
            // The last tree is new.
            built += top.parts.last().map_or(0, |part| part.items.len());
            assert!(top.parts.len() <= before.len() + 1);
        }
        assert!(top.parts.len() <= 5, "{} trees", top.parts.len());
        assert!(built <= 1000 * 12, "{built} places in builds");
        let stepwise = check(&top, &transforms);
        let mut at_once = Top::default();
        transforms.iter().for_each(|(i, transform)| at_once.put(*i, transform, &place()));
        assert!(at_once.update());
        assert_eq!(at_once.parts.len(), 1);
        let whole = check(&at_once, &transforms);
        assert!(stepwise <= 2 * whole, "{stepwise} visits, and {whole} in one tree");
    }

    #[test]
    fn entities_move_and_go() {
        let mut transforms: BTreeMap<_, _> = (0..1000).map(|i| (i, at(i))).collect();
        let mut top = Top::default();
        transforms.iter().for_each(|(i, transform)| top.put(*i, transform, &place()));
        assert!(top.update());
        for i in (0..1000).step_by(7) {
            let transform = transforms.get_mut(&i).expect("it is there");
            transform.translation.x += 0.5 * (i % 3) as f32;
            top.put(i, transform, &place());
        }
        assert!(top.update());
        check(&top, &transforms);
        let fresh = top.parts[0].built_cost;
        // All change places, so that the tree is worn and built again.
        for i in 0..1000 {
            transforms.insert(i, at(i * 387 % 1000));
            top.put(i, &transforms[&i], &place());
        }
        assert!(top.update());
        let visits = check(&top, &transforms);
        assert!(top.parts[0].cost() < 1.1 * fresh && visits < 200, "{visits} visits");
        // Most of them go, and their places with them.
        for i in 0..1000 {
            if i % 5 > 0 {
                transforms.remove(&i);
                top.remove(i);
                top.remove(i);
            }
            assert!(top.update() == (i % 5 > 0));
        }
        check(&top, &transforms);
        assert!(top.parts[0].items.len() < 400);
    }

    #[test]
    fn what_no_ray_can_hit_is_left_out() {
        let flat = Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0));
        let lost = Affine3A::from_translation(Vec3::splat(f32::NAN));
        let empty = MeshPlace { nodes: 0, bounds: Bounds::NONE, ..place() };
        let sound = Affine3A::from_translation(Vec3::X);
        let mut top = Top::default();
        for (number, (transform, place)) in
            (0..).zip([(flat, place()), (lost, place()), (sound, place()), (sound, empty)])
        {
            top.put(number, &transform, &place);
        }
        assert!(top.update());
        assert_eq!((top.count(), top.words()[0]), (1, [1, 0, 0, 0]));
        top.put(2, &lost, &place());
        assert!(top.update());
        assert_eq!((top.count(), top.words()), (0, &[[0; 4]][..]));
    }
}
