//! The numbers of lights and kinds, and the edits that have been found since the last extraction.

use std::collections::HashSet;
use std::time::Instant;

use bevy::ecs::lifecycle::HookContext;
use bevy::ecs::world::DeferredWorld;
use bevy::prelude::*;
use girandole::{Placement, Sky};

use crate::edits::{Edit, Edits, State};
use crate::kinds::{KindKey, Kinds, Sources};
use crate::numbers::Numbers;
use crate::rigs::{PosedMeshes, Rig};
use crate::units::{self, Emitted};

/// What the plugin knows of an entity. When this component is removed, for whatever reason, the
/// light is removed.
#[derive(Component, Clone, Copy, Debug)]
#[component(on_remove = forget)]
pub struct Gathered {
    /// The number of the light.
    pub light: u32,
    pub shape: Shape,
    /// The number of the kind; 0 for directional lights.
    pub kind: u32,
    /// What the light was last sent with: the factor, or the illuminance of a directional light.
    pub factor: Vec3,
}

/// The shape of a light, which decides what part of the transform it uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    Point,
    Spot,
    Directional,
    /// A mesh. If joints or morph targets move it, its lights are in the world.
    Mesh(Rig),
    /// Lights that a pass of the application writes.
    Source,
}

impl Shape {
    pub fn placement(self, transform: &GlobalTransform) -> Placement {
        match self {
            Self::Point | Self::Directional => units::point_placement(transform),
            Self::Spot => units::spot_placement(transform),
            Self::Mesh(Rig::Rigid) | Self::Source => units::mesh_placement(transform),
            Self::Mesh(Rig::Morph(_) | Rig::Skin(_)) => Placement::IDENTITY,
        }
    }
}

fn forget(mut world: DeferredWorld, context: HookContext) {
    let Some(&gathered) = world.get::<Gathered>(context.entity) else { return };
    if let Some(mut changes) = world.get_resource_mut::<Changes>() {
        changes.remove(gathered);
    }
}

/// A light as it was found.
pub struct Found<'a> {
    pub shape: Shape,
    pub emitted: Emitted,
    pub transform: &'a GlobalTransform,
    pub shown: bool,
}

/// The changes since the last extraction.
#[derive(Resource, Debug, Default)]
pub struct Changes {
    pub edits: Edits,
    pub kinds: Kinds,
    posed: PosedMeshes,
    /// Entities whose lights the plugin has taken over from Bevy since the last extraction.
    pub taken: Vec<Entity>,
    /// The number of the sky's kind; `None` while there is no sky.
    sky: Option<u32>,
    numbers: Numbers,
    /// Numbers that are free from the next extraction on, so that a move that was found before a
    /// removal does not reach the next light of the same number.
    freed: Vec<u32>,
}

impl Changes {
    /// Removes one user of a kind.
    fn release(&mut self, kind: u32) {
        if kind != 0 && self.kinds.release(kind) {
            self.edits.edits.push(Edit::RemoveKind { kind });
        }
    }

    /// The number of a kind, with one more user; `None` if the kind has no lights.
    fn acquire(&mut self, key: KindKey, sources: &Sources) -> Option<u32> {
        let tree = if self.kinds.contains(key) { None } else { Some(key.tree(sources, &mut self.posed)?) };
        let (kind, _) = self.kinds.acquire(key);
        if let Some(tree) = tree {
            self.edits.edits.push(Edit::AddKind { kind, tree });
        }
        Some(kind)
    }

    /// Adds a light, or changes the one that an entity has. Returns what to store with the entity;
    /// `None` if the kind has no lights.
    pub fn put(&mut self, present: Option<&Gathered>, found: &Found, sources: &Sources) -> Option<Gathered> {
        let kind = self.acquire(found.emitted.key, sources)?;
        let Found { shape, shown, .. } = *found;
        let factor = found.emitted.factor;
        let state = State { kind, placement: shape.placement(found.transform), factor, shown };
        let light = match present {
            Some(gathered) if (gathered.shape, gathered.kind, gathered.factor) == (shape, kind, factor) => {
                // Moves and visibility are sent by themselves.
                self.release(kind);
                gathered.light
            }
            Some(gathered) => {
                self.edits.edits.push(Edit::Set { light: gathered.light, state });
                self.release(gathered.kind);
                gathered.light
            }
            None => {
                let light = self.numbers.take();
                self.edits.edits.push(Edit::Add { light, state });
                light
            }
        };
        Some(Gathered { light, shape, kind, factor })
    }

    /// As [`Self::put`], for a directional light.
    pub fn put_directional(
        &mut self,
        present: Option<&Gathered>,
        value: girandole::DirectionalLight,
        shown: bool,
    ) -> Gathered {
        let (shape, factor) = (Shape::Directional, value.illuminance);
        let light = present.map_or_else(|| self.numbers.take(), |gathered| gathered.light);
        let next = Gathered { light, shape, kind: 0, factor };
        if present.is_some_and(|gathered| (gathered.shape, gathered.factor) == (shape, factor)) {
            return next;
        }
        self.edits.edits.push(Edit::Directional { light, shown, value });
        if let Some(gathered) = present {
            self.release(gathered.kind);
        }
        next
    }

    /// Sends the triangles of meshes and of textured meshes again, or none if there no longer are any.
    pub fn replace(&mut self, meshes: &HashSet<AssetId<Mesh>>, images: &HashSet<AssetId<Image>>, sources: &Sources) {
        self.posed.forget(meshes, images);
        for (kind, key) in self.kinds.made_of(meshes, images) {
            let tree = key.tree(sources, &mut self.posed).unwrap_or_default();
            self.edits.edits.push(Edit::ReplaceKind { kind, tree });
        }
    }

    /// Sends the lights of an entity again, which a pass of the application writes.
    pub fn replace_source(&mut self, gathered: &Gathered, entity: Entity, sources: &Sources) {
        let tree = KindKey::Source(entity).tree(sources, &mut self.posed).unwrap_or_default();
        self.edits.edits.push(Edit::ReplaceKind { kind: gathered.kind, tree });
    }

    /// Makes a map the sky, or removes the sky.
    pub fn set_sky(&mut self, map: Option<Sky>) {
        match map {
            Some(map) => {
                let kind = *self.sky.get_or_insert_with(|| self.kinds.acquire(KindKey::Sky).0);
                self.edits.edits.push(Edit::SetSky { kind, map: Box::new(map) });
            }
            None => {
                if let Some(kind) = self.sky.take() {
                    self.kinds.release(kind);
                    self.edits.edits.push(Edit::RemoveSky);
                }
            }
        }
    }

    /// Turns the sky, and sets what its map is multiplied by.
    pub fn adjust_sky(&mut self, rotation: Quat, factor: f32) {
        if self.sky.is_some() {
            self.edits.edits.push(Edit::AdjustSky { rotation, factor });
        }
    }

    fn remove(&mut self, gathered: Gathered) {
        self.edits.edits.push(Edit::Remove { light: gathered.light });
        self.release(gathered.kind);
        self.freed.push(gathered.light);
    }

    /// Adds to the time that the search for changes took.
    pub fn took(&mut self, started: Instant) {
        self.edits.gather += started.elapsed();
    }

    /// Takes all changes.
    pub fn take(&mut self) -> Edits {
        self.numbers.free(self.freed.drain(..));
        std::mem::take(&mut self.edits)
    }
}
