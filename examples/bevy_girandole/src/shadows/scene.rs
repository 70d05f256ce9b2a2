//! What casts shadows, in the render world and on the GPU.

use std::collections::HashSet;
use std::sync::Arc;
use std::time::{Duration, Instant};

use bevy::math::Affine3A;
use bevy::prelude::*;
use bevy::render::MainWorld;
use bevy::render::render_resource::{BindGroupEntry, BindGroupLayoutEntry};
use bevy::render::renderer::{RenderDevice, RenderQueue};

use super::gather::{CasterEdit, Casters};
use super::mesh::{CasterMesh, ShadowRays};
use super::structures::Structures;
use super::trees::Trees;

/// What shaders read to trace rays, kept in step with the scene.
pub trait Tracer: Send + Sync {
    /// Replaces a mesh, or removes it.
    fn set_mesh(&mut self, mesh: u32, built: Option<Arc<CasterMesh>>);
    /// Prepares the meshes that were set. Returns meshes whose entities must be put anew.
    fn place_meshes(&mut self, device: &RenderDevice) -> HashSet<u32>;
    /// Puts an entity somewhere. One that no ray can hit is left out. O(1).
    fn put(&mut self, caster: u32, mesh: u32, transform: &Affine3A);
    /// Removes an entity, if it is there. O(1).
    fn remove(&mut self, caster: u32);
    /// Brings what is on the device up to date.
    fn update(&mut self, device: &RenderDevice, queue: &RenderQueue) -> Updated;
    /// The number of entities that rays can hit.
    fn count(&self) -> usize;
    /// The layout of the bindings.
    fn layout_entries(&self) -> Vec<BindGroupLayoutEntry>;
    /// What shaders bind; `None` before the first update.
    fn bindings(&self) -> Option<Vec<BindGroupEntry<'_>>>;
    /// Forgets what is on a device that is gone.
    fn forget(&mut self);
}

/// What an update did.
#[derive(Clone, Copy, Debug, Default)]
pub struct Updated {
    /// Whether a shadow may have changed.
    pub has_changed: bool,
    /// Meshes that wait for the next frame.
    pub waiting: usize,
    /// Bytes that were written.
    pub bytes: u64,
    /// Acceleration structures that the device was told to build.
    pub structures: usize,
}

/// The entities that cast shadows, with their meshes.
#[derive(Default)]
pub struct Entities(Vec<Option<(u32, Affine3A)>>);

impl Entities {
    /// Applies edits of the main world.
    pub fn apply(&mut self, edits: Vec<CasterEdit>, tracer: &mut dyn Tracer) {
        for edit in edits {
            match edit {
                CasterEdit::Mesh { mesh, built } => tracer.set_mesh(mesh, Some(built)),
                CasterEdit::RemoveMesh { mesh } => tracer.set_mesh(mesh, None),
                CasterEdit::Put { caster, mesh, transform } => {
                    *slot(&mut self.0, caster) = Some((mesh, transform));
                    tracer.put(caster, mesh, &transform);
                }
                CasterEdit::Remove { caster } => {
                    *slot(&mut self.0, caster) = None;
                    tracer.remove(caster);
                }
                CasterEdit::Move { caster, transform } => {
                    let Some(Some((mesh, present))) = self.0.get_mut(caster as usize) else { continue };
                    if std::mem::replace(present, transform) != transform {
                        tracer.put(caster, *mesh, &transform);
                    }
                }
            }
        }
    }

    /// Puts the entities anew that have one of these meshes.
    pub fn put_users(&self, meshes: &HashSet<u32>, tracer: &mut dyn Tracer) {
        for (caster, present) in (0..).zip(&self.0) {
            if let Some((mesh, transform)) = present.as_ref().filter(|(mesh, _)| meshes.contains(mesh)) {
                tracer.put(caster, *mesh, transform);
            }
        }
    }
}

/// The place of a number in a list, which grows as needed.
pub fn slot<T>(list: &mut Vec<Option<T>>, number: u32) -> &mut Option<T> {
    let number = number as usize;
    if list.len() <= number {
        list.resize_with(number + 1, || None);
    }
    &mut list[number]
}

/// The meshes and entities that cast shadows, in the render world. Passes of an application that trace rays import the
/// module `girandole::shadows`, and bind [`Self::bindings`] at group 2.
#[derive(Resource)]
pub struct GirandoleShadows {
    rays: ShadowRays,
    edits: Vec<CasterEdit>,
    entities: Entities,
    tracer: Box<dyn Tracer>,
    /// Meshes that are being built in the main world.
    waiting: usize,
    /// What was done in this frame.
    pub(crate) updated: Updated,
    /// The time for this frame, in both worlds.
    pub(crate) took: Duration,
}

impl GirandoleShadows {
    pub(crate) fn new(rays: ShadowRays) -> Self {
        Self {
            rays,
            edits: Vec::new(),
            entities: Entities::default(),
            tracer: match rays {
                ShadowRays::Software => Box::new(Trees::default()),
                ShadowRays::RayQuery => Box::new(Structures::default()),
            },
            waiting: 0,
            updated: Updated::default(),
            took: Duration::ZERO,
        }
    }

    /// How rays are traced. It depends on the device, and is known once plugins have been finished.
    pub fn rays(&self) -> ShadowRays {
        self.rays
    }

    /// What the module `girandole::shadows` adds to the layout of group 2, for compute and fragment shaders. It depends on
    /// [`Self::rays`], and has the bindings 4 and 5 at most.
    pub fn layout_entries(&self) -> Vec<BindGroupLayoutEntry> {
        self.tracer.layout_entries()
    }

    /// What to bind there. It may be new in each frame. `None` before the first one.
    pub fn bindings(&self) -> Option<Vec<BindGroupEntry<'_>>> {
        self.tracer.bindings()
    }

    /// The number of entities that cast shadows, and of meshes that are not built yet.
    pub(crate) fn counts(&self) -> [usize; 2] {
        [self.tracer.count(), self.waiting + self.updated.waiting]
    }
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
    shadows.tracer.forget();
}

/// Uploads what has changed.
pub fn prepare(mut shadows: ResMut<GirandoleShadows>, device: Res<RenderDevice>, queue: Res<RenderQueue>) {
    let started = Instant::now();
    let GirandoleShadows { edits, entities, tracer, updated, took, .. } = &mut *shadows;
    entities.apply(std::mem::take(edits), &mut **tracer);
    let placed = tracer.place_meshes(&device);
    if !placed.is_empty() {
        entities.put_users(&placed, &mut **tracer);
    }
    *updated = tracer.update(&device, &queue);
    *took += started.elapsed();
}
