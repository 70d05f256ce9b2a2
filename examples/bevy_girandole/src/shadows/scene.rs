//! What casts shadows, in the render world and on the GPU.

use std::sync::Arc;

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
    /// The items of the tree, by the number of the entity.
    items: Vec<Option<u32>>,
    /// The number of items.
    count: usize,
    /// Entities or their meshes have changed, so that the tree is to be built again.
    is_stale: bool,
    buffers: Option<[Buffer; 2]>,
    /// Meshes that are being built in the main world.
    waiting: usize,
    /// Whether a shadow may have changed in this frame.
    pub(crate) has_changed: bool,
    /// What was written in this frame.
    pub(crate) bytes: u64,
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
            items: Vec::new(),
            count: 0,
            is_stale: true,
            buffers: None,
            waiting: 0,
            has_changed: false,
            bytes: 0,
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
        [self.count, self.waiting]
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

    /// Applies the edits of the main world. Returns whether anything has moved.
    fn apply(&mut self) -> bool {
        let mut has_moved = false;
        for edit in std::mem::take(&mut self.edits) {
            match edit {
                CasterEdit::Mesh { mesh, built } => {
                    self.free(mesh);
                    let allocation = self.allocator.allocate(built.words.len().max(1) as u32);
                    *slot(&mut self.meshes, mesh) = Some(PlacedMesh { built, allocation, is_written: false });
                    self.is_stale = true;
                }
                CasterEdit::RemoveMesh { mesh } => self.free(mesh),
                CasterEdit::Put { caster, mesh, transform } => {
                    *slot(&mut self.casters, caster) = Some((mesh, transform));
                    self.is_stale = true;
                }
                CasterEdit::Remove { caster } => {
                    *slot(&mut self.casters, caster) = None;
                    self.is_stale = true;
                }
                CasterEdit::Move { caster, transform } => {
                    let Some(Some((mesh, present))) = self.casters.get_mut(caster as usize) else { continue };
                    let mesh = *mesh;
                    if std::mem::replace(present, transform) == transform || self.is_stale {
                        continue;
                    }
                    let item = self.items.get(caster as usize).copied().flatten();
                    let Some(place) = self.place(mesh) else { continue };
                    has_moved = true;
                    self.is_stale |= !item.is_some_and(|item| self.top.set(item, &transform, &place));
                }
            }
        }
        has_moved
    }

    /// Doubles the room for meshes until all fit in, and places all of them anew.
    fn make_room(&mut self, most: u32) {
        let lacks = |meshes: &[Option<PlacedMesh>]| meshes.iter().flatten().any(|placed| placed.allocation.is_none());
        while lacks(&self.meshes) && self.room < most {
            self.room = self.room.saturating_mul(2).min(most);
            self.allocator = Allocator::new(self.room);
            for placed in self.meshes.iter_mut().flatten() {
                placed.allocation = self.allocator.allocate(placed.built.words.len().max(1) as u32);
                placed.is_written = false;
            }
            self.buffers = None;
            self.is_stale = true;
        }
        if lacks(&self.meshes) {
            warn_once!("girandole: meshes that do not fit into a buffer of the device cast no shadows");
        }
    }

    /// The tree over entities, built anew.
    fn build_top(&mut self) {
        let present: Vec<_> =
            (0..).zip(&self.casters).filter_map(|(number, caster)| Some((number, (*caster)?))).collect();
        let placed =
            |(number, (mesh, transform)): (usize, (u32, Affine3A))| Some((number, (transform, self.place(mesh)?)));
        let (numbers, casters): (Vec<_>, Vec<_>) = present.into_iter().filter_map(placed).unzip();
        let items = self.top.build(&casters);
        self.items = vec![None; self.casters.len()];
        for (number, item) in numbers.into_iter().zip(items) {
            self.items[number] = item;
        }
        self.count = self.items.iter().flatten().count();
        self.is_stale = false;
    }

    /// Brings the buffers up to date.
    fn update(&mut self, device: &RenderDevice, queue: &RenderQueue) {
        let has_moved = self.apply();
        let word = size_of::<Word>() as u32;
        let limits = device.limits();
        let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size) / u64::from(word);
        self.make_room(u32::try_from(most).unwrap_or(u32::MAX));
        let is_worn = has_moved && !self.is_stale && self.top.refit();
        let has_changed = has_moved || self.is_stale;
        if self.is_stale || is_worn {
            self.build_top();
        }
        self.has_changed = has_changed;
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
        for placed in self.meshes.iter_mut().flatten() {
            let Some(allocation) = placed.allocation.as_ref().filter(|_| is_new || !placed.is_written) else {
                continue;
            };
            let bytes: &[u8] = bytemuck::cast_slice(&placed.built.words);
            queue.write_buffer(meshes, u64::from(allocation.offset) * u64::from(word), bytes);
            self.bytes += bytes.len() as u64;
            placed.is_written = true;
        }
        if has_changed || is_new || is_small {
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
}

/// On a new device nothing is written yet.
pub fn start(mut shadows: ResMut<GirandoleShadows>) {
    shadows.buffers = None;
}

/// Uploads what has changed.
pub fn prepare(mut shadows: ResMut<GirandoleShadows>, device: Res<RenderDevice>, queue: Res<RenderQueue>) {
    shadows.update(&device, &queue);
}
