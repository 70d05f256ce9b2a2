//! The lights of entities by the names that shaders know them by, for renderers that have names of their own.

use std::collections::HashMap;

use bevy::prelude::*;
use bevy::render::Extract;

use crate::gathered::Gathered;
use crate::world::GirandoleLights;

/// The lights of entities, by the names that shaders know them by. In the render world, with
/// [`GirandolePlugin::ray_traced`](crate::GirandolePlugin::ray_traced).
#[derive(Resource, Debug, Default)]
pub struct GirandoleNames {
    /// Entities of the main world, by the numbers of their lights.
    entities: HashMap<u32, Entity>,
    lights: Vec<GirandoleName>,
    changes: u64,
}

/// The name of the light of an entity, or of the triangles of its mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct GirandoleName {
    /// The slot of an instance, or `LIGHT_DIRECTIONAL`.
    pub instance: u32,
    /// The number of a directional light. The lights of an instance are numbered from 0 on: the triangles of its mesh,
    /// in their order.
    pub light: u32,
    /// The entity in the main world.
    pub entity: Entity,
}

impl GirandoleNames {
    /// All names, in ascending order.
    pub fn lights(&self) -> &[GirandoleName] {
        &self.lights
    }

    /// A number that grows when the names change.
    pub fn changes(&self) -> u64 {
        self.changes
    }
}

/// Copies the numbers of lights that are new.
pub fn extract(mut names: ResMut<GirandoleNames>, lights: Extract<Query<(Entity, &Gathered), Changed<Gathered>>>) {
    for (entity, gathered) in &lights {
        names.entities.insert(gathered.light, entity);
    }
}

/// Finds the names, if any light has been added, removed or changed. O(lights).
pub fn prepare(mut names: ResMut<GirandoleNames>, mut lights: ResMut<GirandoleLights>) {
    if !lights.take_new_names() {
        return;
    }
    let names = &mut *names;
    names.entities.retain(|light, _| lights.name(*light).is_some());
    let name = |(light, entity): (&u32, &Entity)| {
        lights.name(*light).map(|(instance, light)| GirandoleName { instance, light, entity: *entity })
    };
    let mut next: Vec<GirandoleName> = names.entities.iter().filter_map(name).collect();
    next.sort_unstable();
    if next != names.lights {
        names.lights = next;
        names.changes += 1;
    }
}
