//! Trees for rays that are traced in software: the meshes in one buffer, and the entities in another.

use std::collections::HashSet;
use std::sync::Arc;

use bevy::log::warn_once;
use bevy::math::Affine3A;
use bevy::render::render_resource::{BindGroupEntry, BindGroupLayoutEntry, Buffer, BufferDescriptor, BufferUsages};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use offset_allocator::{Allocation, Allocator};

use super::mesh::{CasterMesh, Word};
use super::scene::{Tracer, Updated, slot};
use super::top::{MeshPlace, Top};
use crate::gpu::{READ, buffer_entry};

/// Words that the buffer of meshes has room for at first: a megabyte.
const FIRST_WORDS: u32 = 1 << 16;

/// The bytes of a word.
const WORD: u64 = size_of::<Word>() as u64;

/// Meshes below trees of boxes, and trees over entities.
pub struct Trees {
    meshes: Vec<Option<PlacedMesh>>,
    allocator: Allocator,
    room: u32,
    top: Top,
    /// Meshes that are new, lie elsewhere or are gone.
    changed: HashSet<u32>,
    has_new_meshes: bool,
    buffers: Option<[Buffer; 2]>,
}

/// A mesh with its place in the buffer; `None` while there is no room.
struct PlacedMesh {
    built: Arc<CasterMesh>,
    allocation: Option<Allocation>,
    is_written: bool,
}

impl Default for Trees {
    fn default() -> Self {
        Self {
            meshes: Vec::new(),
            allocator: Allocator::new(FIRST_WORDS),
            room: FIRST_WORDS,
            top: Top::default(),
            changed: HashSet::new(),
            has_new_meshes: false,
            buffers: None,
        }
    }
}

impl Trees {
    fn place(&self, mesh: u32) -> Option<MeshPlace> {
        let placed = self.meshes.get(mesh as usize)?.as_ref()?;
        let first = placed.allocation.as_ref()?.offset;
        Some(MeshPlace { first, nodes: placed.built.nodes, bounds: placed.built.bounds })
    }

    /// Places meshes that have no place yet. Returns whether all have one.
    fn place_new(&mut self) -> bool {
        let Self { allocator, meshes, changed, .. } = self;
        let new = (0..).zip(meshes).filter_map(|(mesh, placed)| Some((mesh, placed.as_mut()?)));
        new.filter(|(_, placed)| placed.allocation.is_none()).fold(true, |all, (mesh, placed)| {
            placed.allocation = allocator.allocate(placed.built.words.len().max(1) as u32);
            placed.is_written = false;
            changed.insert(mesh);
            all && placed.allocation.is_some()
        })
    }

    /// Places all meshes, in twice the room if they do not fit in, up to a number of words. Returns whether all fit.
    fn make_room(&mut self, most: u32) -> bool {
        let mut all_fit = self.place_new();
        while !all_fit && self.room < most {
            self.room = self.room.saturating_mul(2).min(most);
            self.allocator = Allocator::new(self.room);
            self.meshes.iter_mut().flatten().for_each(|placed| placed.allocation = None);
            self.buffers = None;
            all_fit = self.place_new();
        }
        all_fit
    }
}

impl Tracer for Trees {
    fn set_mesh(&mut self, mesh: u32, built: Option<Arc<CasterMesh>>) {
        let placed = slot(&mut self.meshes, mesh);
        let former =
            std::mem::replace(placed, built.map(|built| PlacedMesh { built, allocation: None, is_written: false }));
        if let Some(allocation) = former.and_then(|placed| placed.allocation) {
            self.allocator.free(allocation);
        }
        self.changed.insert(mesh);
    }

    fn place_meshes(&mut self, device: &RenderDevice) -> HashSet<u32> {
        if self.changed.is_empty() {
            return HashSet::new();
        }
        self.has_new_meshes = true;
        let limits = device.limits();
        let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size) / WORD;
        if !self.make_room(u32::try_from(most).unwrap_or(u32::MAX)) {
            warn_once!("girandole: meshes that do not fit into a buffer of the device cast no shadows");
        }
        std::mem::take(&mut self.changed)
    }

    fn put(&mut self, caster: u32, mesh: u32, transform: &Affine3A) {
        match self.place(mesh) {
            Some(place) => self.top.put(caster, transform, &place),
            None => self.top.remove(caster),
        }
    }

    fn remove(&mut self, caster: u32) {
        self.top.remove(caster);
    }

    fn update(&mut self, device: &RenderDevice, queue: &RenderQueue) -> Updated {
        let mut updated = Updated { has_changed: self.top.update(), ..Updated::default() };
        let buffer = |label, words: u32| {
            let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST;
            let size = u64::from(words) * WORD;
            device.create_buffer(&BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false })
        };
        let count = self.top.words().len() as u32;
        let tops = |count: u32| buffer("girandole casters", count.next_power_of_two().max(64));
        let is_new = self.buffers.is_none();
        let [meshes, casters] =
            self.buffers.get_or_insert_with(|| [buffer("girandole caster meshes", self.room), tops(count)]);
        let is_small = casters.size() < u64::from(count) * WORD;
        if is_small {
            *casters = tops(count);
        }
        let has_new_meshes = std::mem::take(&mut self.has_new_meshes);
        for placed in self.meshes.iter_mut().filter(|_| has_new_meshes || is_new).flatten() {
            let Some(allocation) = placed.allocation.as_ref().filter(|_| is_new || !placed.is_written) else {
                continue;
            };
            let bytes: &[u8] = bytemuck::cast_slice(&placed.built.words);
            queue.write_buffer(meshes, u64::from(allocation.offset) * WORD, bytes);
            updated.bytes += bytes.len() as u64;
            placed.is_written = true;
        }
        if updated.has_changed || is_new || is_small {
            let bytes: &[u8] = bytemuck::cast_slice(self.top.words());
            queue.write_buffer(casters, 0, bytes);
            updated.bytes += bytes.len() as u64;
        }
        updated
    }

    fn count(&self) -> usize {
        self.top.count()
    }

    fn layout_entries(&self) -> Vec<BindGroupLayoutEntry> {
        [4, 5].map(|binding| buffer_entry(binding, READ)).to_vec()
    }

    fn bindings(&self) -> Option<Vec<BindGroupEntry<'_>>> {
        let buffers = (4..).zip(self.buffers.as_ref()?);
        Some(buffers.map(|(binding, of)| BindGroupEntry { binding, resource: of.as_entire_binding() }).collect())
    }

    fn forget(&mut self) {
        self.buffers = None;
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3;

    use super::super::gather::CasterEdit;
    use super::super::mesh::ShadowRays;
    use super::super::scene::Entities;
    use super::*;

    /// A mesh of so many triangles.
    fn mesh(triangles: usize) -> Arc<CasterMesh> {
        let at = |i: usize| Vec3::new((i % 7) as f32, (i % 11) as f32, i as f32);
        let triangles = (0..triangles).map(|i| [at(i), at(i) + Vec3::X, at(i) + Vec3::Y]).collect();
        Arc::new(CasterMesh::new(ShadowRays::Software, triangles))
    }

    /// The places of meshes that have one lie in the room, and apart.
    fn check(trees: &Trees) -> usize {
        let placed = trees.meshes.iter().flatten();
        let mut ranges: Vec<_> = placed
            .filter_map(|placed| {
                let first = placed.allocation.as_ref()?.offset;
                Some(first..first + placed.built.words.len() as u32)
            })
            .collect();
        ranges.sort_by_key(|range| range.start);
        assert!(ranges.windows(2).all(|pair| pair[0].end <= pair[1].start));
        assert!(ranges.last().is_none_or(|range| range.end <= trees.room));
        ranges.len()
    }

    /// Trees, and the entities that are put into them.
    #[derive(Default)]
    struct Scene {
        entities: Entities,
        trees: Trees,
    }

    impl Scene {
        fn apply(&mut self, edits: impl IntoIterator<Item = CasterEdit>) {
            self.entities.apply(edits.into_iter().collect(), &mut self.trees);
        }

        fn put(&mut self, number: u32, built: &Arc<CasterMesh>) {
            let transform = Affine3A::from_translation(Vec3::X * number as f32);
            self.apply([
                CasterEdit::Put { caster: number, mesh: number, transform },
                CasterEdit::Mesh { mesh: number, built: Arc::clone(built) },
            ]);
        }

        /// Returns whether all meshes fit, and whether anything has changed.
        fn update(&mut self, most: u32) -> [bool; 2] {
            let all_fit = self.trees.make_room(most);
            let changed = std::mem::take(&mut self.trees.changed);
            self.entities.put_users(&changed, &mut self.trees);
            [all_fit, self.trees.top.update()]
        }
    }

    #[test]
    fn the_room_for_meshes_grows_up_to_the_limit_and_those_beyond_wait_for_others_to_go() {
        let built = mesh(1000);
        let words = built.words.len() as u32;
        let first = FIRST_WORDS / words;
        let most = 2 * FIRST_WORDS;
        let mut scene = Scene::default();
        let mut count = 0;
        for (number, room) in [(first, FIRST_WORDS), (first + 1, most), (most / words, most)] {
            while count < number {
                scene.put(count, &built);
                count += 1;
            }
            assert_eq!(scene.update(most), [true; 2], "{number} meshes");
            let casting = scene.trees.count();
            assert_eq!((check(&scene.trees), scene.trees.room, casting), (number as usize, room, number as usize));
        }
        // One more than fits, and ten times as many.
        let fit = count as usize;
        for number in [count + 1, 10 * count] {
            while count < number {
                scene.put(count, &built);
                count += 1;
            }
            assert!(!scene.update(most)[0]);
            assert_eq!((check(&scene.trees), scene.trees.count()), (fit, fit));
        }
        scene.apply((0..5).map(|mesh| CasterEdit::RemoveMesh { mesh }));
        scene.apply((0..5).map(|caster| CasterEdit::Remove { caster }));
        assert_eq!(scene.update(most), [false, true]);
        // The allocator rounds sizes up when it looks for a gap, so one gap may stay.
        let (placed, casting) = (check(&scene.trees), scene.trees.count());
        assert!(placed == casting && (fit - 1..=fit).contains(&placed), "others have moved in: {placed} of {fit}");
    }

    #[test]
    fn a_move_to_the_same_place_changes_nothing() {
        let mut scene = Scene::default();
        scene.put(0, &mesh(5));
        assert_eq!(scene.update(FIRST_WORDS), [true; 2]);
        let move_to = |x: f32| CasterEdit::Move { caster: 0, transform: Affine3A::from_translation(Vec3::X * x) };
        for (x, has_moved) in [(0.0, false), (1.0, true), (1.0, false)] {
            scene.apply([move_to(x)]);
            assert_eq!(scene.update(FIRST_WORDS), [true, has_moved], "{x}");
        }
        scene.apply([move_to(f32::INFINITY)]);
        assert!(scene.update(FIRST_WORDS)[1]);
        assert_eq!(scene.trees.count(), 0, "no ray can hit it there");
        scene.apply([move_to(2.0)]);
        assert!(scene.update(FIRST_WORDS)[1]);
        assert_eq!(scene.trees.count(), 1);
    }
}
