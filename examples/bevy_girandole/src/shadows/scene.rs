//! What casts shadows, in the render world and on the GPU.

use std::collections::HashSet;
use std::sync::Arc;
use std::time::{Duration, Instant};

use bevy::math::Affine3A;
use bevy::prelude::*;
use bevy::render::MainWorld;
use bevy::render::render_resource::{Buffer, BufferDescriptor, BufferUsages};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use offset_allocator::{Allocation, Allocator};

use super::gather::{CasterEdit, Casters};
use super::mesh::{CasterMesh, Word};
use super::top::{MeshPlace, Top};

/// Words that the buffer of meshes has room for at first: a megabyte.
const FIRST_WORDS: u32 = 1 << 16;

/// The meshes and entities that cast shadows, in the render world. Passes of an application that trace rays bind
/// [`Self::buffers`] and import the module `girandole::shadows`.
#[derive(Resource)]
pub struct GirandoleShadows {
    edits: Vec<CasterEdit>,
    meshes: Vec<Option<PlacedMesh>>,
    casters: Vec<Option<(u32, Affine3A)>>,
    allocator: Allocator,
    room: u32,
    top: Top,
    /// Meshes that are new, lie elsewhere or are gone.
    changed: HashSet<u32>,
    buffers: Option<[Buffer; 2]>,
    /// Meshes that are being built in the main world.
    waiting: usize,
    /// Whether a shadow may have changed in this frame.
    pub(crate) has_changed: bool,
    /// What was written in this frame.
    pub(crate) bytes: u64,
    /// The time for this frame, in both worlds.
    pub(crate) took: Duration,
}

/// A mesh with its place in the buffer; `None` while there is no room.
struct PlacedMesh {
    built: Arc<CasterMesh>,
    allocation: Option<Allocation>,
    is_written: bool,
}

impl Default for GirandoleShadows {
    fn default() -> Self {
        Self {
            edits: Vec::new(),
            meshes: Vec::new(),
            casters: Vec::new(),
            allocator: Allocator::new(FIRST_WORDS),
            room: FIRST_WORDS,
            top: Top::default(),
            changed: HashSet::new(),
            buffers: None,
            waiting: 0,
            has_changed: false,
            bytes: 0,
            took: Duration::ZERO,
        }
    }
}

impl GirandoleShadows {
    /// The buffers of the module `girandole::shadows`: meshes, and entities. `None` before the first frame.
    pub fn buffers(&self) -> Option<&[Buffer; 2]> {
        self.buffers.as_ref()
    }

    /// The number of entities that cast shadows, and of meshes that are not built yet.
    pub(crate) fn counts(&self) -> [usize; 2] {
        [self.top.count(), self.waiting]
    }

    fn place(&self, mesh: u32) -> Option<MeshPlace> {
        let placed = self.meshes.get(mesh as usize)?.as_ref()?;
        let first = placed.allocation.as_ref()?.offset;
        Some(MeshPlace { first, nodes: placed.built.nodes, bounds: placed.built.bounds })
    }

    fn free(&mut self, mesh: u32) {
        let former = self.meshes.get_mut(mesh as usize).and_then(Option::take);
        if let Some(allocation) = former.and_then(|placed| placed.allocation) {
            self.allocator.free(allocation);
        }
    }

    /// Applies the edits of the main world. Returns whether meshes have changed.
    fn apply(&mut self) -> bool {
        for edit in std::mem::take(&mut self.edits) {
            match edit {
                CasterEdit::Mesh { mesh, built } => {
                    self.free(mesh);
                    *slot(&mut self.meshes, mesh) = Some(PlacedMesh { built, allocation: None, is_written: false });
                    self.changed.insert(mesh);
                }
                CasterEdit::RemoveMesh { mesh } => {
                    self.free(mesh);
                    self.changed.insert(mesh);
                }
                CasterEdit::Put { caster, mesh, transform } => {
                    *slot(&mut self.casters, caster) = Some((mesh, transform));
                    self.put(caster);
                }
                CasterEdit::Remove { caster } => {
                    *slot(&mut self.casters, caster) = None;
                    self.put(caster);
                }
                CasterEdit::Move { caster, transform } => {
                    let Some(Some((_, present))) = self.casters.get_mut(caster as usize) else { continue };
                    if std::mem::replace(present, transform) != transform {
                        self.put(caster);
                    }
                }
            }
        }
        !self.changed.is_empty()
    }

    /// Puts an entity into the trees as it is now.
    fn put(&mut self, caster: u32) {
        let present = self.casters.get(caster as usize).copied().flatten();
        match present.and_then(|(mesh, transform)| Some((transform, self.place(mesh)?))) {
            Some((transform, place)) => self.top.put(caster, &transform, &place),
            None => self.top.remove(caster),
        }
    }

    /// Puts the entities anew whose meshes have changed.
    fn put_changed(&mut self) {
        let changed = std::mem::take(&mut self.changed);
        for caster in 0..self.casters.len() as u32 {
            if self.casters[caster as usize].is_some_and(|(mesh, _)| changed.contains(&mesh)) {
                self.put(caster);
            }
        }
    }

    /// Places meshes that have no place yet. Returns whether all have one.
    fn place_meshes(&mut self) -> bool {
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
        let mut all_fit = self.place_meshes();
        while !all_fit && self.room < most {
            self.room = self.room.saturating_mul(2).min(most);
            self.allocator = Allocator::new(self.room);
            self.meshes.iter_mut().flatten().for_each(|placed| placed.allocation = None);
            self.buffers = None;
            all_fit = self.place_meshes();
        }
        all_fit
    }

    /// Brings the buffers up to date.
    fn update(&mut self, device: &RenderDevice, queue: &RenderQueue) {
        let has_new_meshes = self.apply();
        let word = size_of::<Word>() as u32;
        let limits = device.limits();
        let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size) / u64::from(word);
        if has_new_meshes {
            if !self.make_room(u32::try_from(most).unwrap_or(u32::MAX)) {
                warn_once!("girandole: meshes that do not fit into a buffer of the device cast no shadows");
            }
            self.put_changed();
        }
        self.has_changed = self.top.update();
        self.bytes = 0;
        let buffer = |label, words: u32| {
            let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST;
            let size = u64::from(words) * u64::from(word);
            device.create_buffer(&BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false })
        };
        let count = self.top.words().len() as u32;
        let tops = |count: u32| buffer("girandole casters", count.next_power_of_two().max(64));
        let is_new = self.buffers.is_none();
        let [meshes, casters] =
            self.buffers.get_or_insert_with(|| [buffer("girandole caster meshes", self.room), tops(count)]);
        let is_small = casters.size() < u64::from(count) * u64::from(word);
        if is_small {
            *casters = tops(count);
        }
        for placed in self.meshes.iter_mut().filter(|_| has_new_meshes || is_new).flatten() {
            let Some(allocation) = placed.allocation.as_ref().filter(|_| is_new || !placed.is_written) else {
                continue;
            };
            let bytes: &[u8] = bytemuck::cast_slice(&placed.built.words);
            queue.write_buffer(meshes, u64::from(allocation.offset) * u64::from(word), bytes);
            self.bytes += bytes.len() as u64;
            placed.is_written = true;
        }
        if self.has_changed || is_new || is_small {
            let bytes: &[u8] = bytemuck::cast_slice(self.top.words());
            queue.write_buffer(casters, 0, bytes);
            self.bytes += bytes.len() as u64;
        }
    }
}

/// The place of a number in a list, which grows as needed.
fn slot<T>(list: &mut Vec<Option<T>>, number: u32) -> &mut Option<T> {
    let number = number as usize;
    if list.len() <= number {
        list.resize_with(number + 1, || None);
    }
    &mut list[number]
}

/// Moves the edits to the render world, while both wait.
pub fn extract(mut main_world: ResMut<MainWorld>, mut shadows: ResMut<GirandoleShadows>) {
    let mut casters = main_world.resource_mut::<Casters>();
    let casters = casters.bypass_change_detection();
    shadows.edits.append(&mut casters.edits);
    shadows.waiting = casters.waiting();
    shadows.took = std::mem::take(&mut casters.took);
}

/// On a new device nothing is written yet.
pub fn start(mut shadows: ResMut<GirandoleShadows>) {
    shadows.buffers = None;
}

/// Uploads what has changed.
pub fn prepare(mut shadows: ResMut<GirandoleShadows>, device: Res<RenderDevice>, queue: Res<RenderQueue>) {
    let started = Instant::now();
    shadows.update(&device, &queue);
    shadows.took += started.elapsed();
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3;

    use super::*;

    /// A mesh of so many triangles.
    fn mesh(triangles: usize) -> Arc<CasterMesh> {
        let at = |i: usize| Vec3::new((i % 7) as f32, (i % 11) as f32, i as f32);
        Arc::new(CasterMesh::new((0..triangles).map(|i| [at(i), at(i) + Vec3::X, at(i) + Vec3::Y]).collect()))
    }

    /// The places of meshes that have one lie in the room, and apart.
    fn check(shadows: &GirandoleShadows) -> usize {
        let placed = shadows.meshes.iter().flatten();
        let mut ranges: Vec<_> = placed
            .filter_map(|placed| {
                let first = placed.allocation.as_ref()?.offset;
                Some(first..first + placed.built.words.len() as u32)
            })
            .collect();
        ranges.sort_by_key(|range| range.start);
        assert!(ranges.windows(2).all(|pair| pair[0].end <= pair[1].start));
        assert!(ranges.last().is_none_or(|range| range.end <= shadows.room));
        ranges.len()
    }

    fn put(shadows: &mut GirandoleShadows, number: u32, built: &Arc<CasterMesh>) {
        let transform = Affine3A::from_translation(Vec3::X * number as f32);
        shadows.edits.push(CasterEdit::Put { caster: number, mesh: number, transform });
        shadows.edits.push(CasterEdit::Mesh { mesh: number, built: Arc::clone(built) });
        shadows.apply();
    }

    #[test]
    fn the_room_for_meshes_grows_up_to_the_limit_and_those_beyond_wait_for_others_to_go() {
        let built = mesh(1000);
        let words = built.words.len() as u32;
        let first = FIRST_WORDS / words;
        let most = 2 * FIRST_WORDS;
        let mut shadows = GirandoleShadows::default();
        let mut count = 0;
        for (number, room) in [(first, FIRST_WORDS), (first + 1, most), (most / words, most)] {
            while count < number {
                put(&mut shadows, count, &built);
                count += 1;
            }
            assert!(shadows.make_room(most), "{number} meshes");
            shadows.put_changed();
            assert!(shadows.top.update());
            assert_eq!((check(&shadows), shadows.room, shadows.counts()[0]), (number as usize, room, number as usize));
        }
        // One more than fits, and ten times as many.
        let fit = count as usize;
        for number in [count + 1, 10 * count] {
            while count < number {
                put(&mut shadows, count, &built);
                count += 1;
            }
            assert!(!shadows.make_room(most));
            shadows.put_changed();
            shadows.top.update();
            assert_eq!((check(&shadows), shadows.counts()[0]), (fit, fit));
        }
        shadows.edits.extend((0..5).map(|mesh| CasterEdit::RemoveMesh { mesh }));
        shadows.edits.extend((0..5).map(|caster| CasterEdit::Remove { caster }));
        assert!(shadows.apply() && !shadows.make_room(most));
        shadows.put_changed();
        assert!(shadows.top.update());
        // The allocator rounds sizes up when it looks for a gap, so one gap may stay.
        let (placed, casting) = (check(&shadows), shadows.counts()[0]);
        assert!(placed == casting && (fit - 1..=fit).contains(&placed), "others have moved in: {placed} of {fit}");
    }

    #[test]
    fn a_move_to_the_same_place_changes_nothing() {
        let mut shadows = GirandoleShadows::default();
        put(&mut shadows, 0, &mesh(5));
        assert!(shadows.make_room(FIRST_WORDS));
        shadows.put_changed();
        assert!(shadows.top.update());
        let move_to = |x: f32| CasterEdit::Move { caster: 0, transform: Affine3A::from_translation(Vec3::X * x) };
        for (x, has_moved) in [(0.0, false), (1.0, true), (1.0, false)] {
            shadows.edits.push(move_to(x));
            assert_eq!((shadows.apply(), shadows.top.update()), (false, has_moved), "{x}");
        }
        shadows.edits.push(move_to(f32::INFINITY));
        assert!(!shadows.apply() && shadows.top.update());
        assert_eq!(shadows.counts()[0], 0, "no ray can hit it there");
        shadows.edits.push(move_to(2.0));
        assert!(!shadows.apply() && shadows.top.update());
        assert_eq!(shadows.counts()[0], 1);
    }
}
