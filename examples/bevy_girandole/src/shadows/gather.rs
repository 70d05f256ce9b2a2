//! Finds the entities that cast shadows in the main world, by change detection.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

use bevy::ecs::lifecycle::HookContext;
use bevy::ecs::system::SystemParam;
use bevy::ecs::world::DeferredWorld;
use bevy::light::NotShadowCaster;
use bevy::math::Affine3A;
use bevy::mesh::skinning::SkinnedMesh;
use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, futures::check_ready};

use super::mesh::{CasterMesh, ShadowRays};
use crate::gather::changed;
use crate::numbers::Numbers;
use crate::triangles;

/// The number and the mesh of an entity that casts shadows. When this component is removed, for whatever reason, the entity
/// casts none.
#[derive(Component, Clone, Copy, Debug)]
#[component(on_remove = forget)]
pub struct Caster {
    number: u32,
    mesh: AssetId<Mesh>,
}

fn forget(mut world: DeferredWorld, context: HookContext) {
    let Some(&caster) = world.get::<Caster>(context.entity) else { return };
    if let Some(mut casters) = world.get_resource_mut::<Casters>() {
        casters.remove(caster);
    }
}

/// One change. Numbers name entities and meshes; the main world gives them out.
#[derive(Clone, Debug)]
pub enum CasterEdit {
    /// A mesh was prepared, or prepared again.
    Mesh { mesh: u32, built: Arc<CasterMesh> },
    /// No entity has the mesh any more.
    RemoveMesh { mesh: u32 },
    /// An entity casts shadows, with this mesh.
    Put { caster: u32, mesh: u32, transform: Affine3A },
    /// The entity has moved.
    Move { caster: u32, transform: Affine3A },
    /// The entity casts no shadows any more.
    Remove { caster: u32 },
}

/// A mesh that entities cast shadows with.
#[derive(Debug)]
struct MeshUse {
    number: u32,
    users: u32,
    /// The build that is under way.
    build: Option<Task<CasterMesh>>,
    /// The mesh has changed since then.
    has_changed: bool,
}

/// The changes since the last extraction, and what is known of meshes and materials.
#[derive(Resource, Debug, Default)]
pub struct Casters {
    /// What meshes are prepared for.
    rays: ShadowRays,
    pub edits: Vec<CasterEdit>,
    /// The time that the search took.
    pub took: Duration,
    entities: Numbers,
    mesh_numbers: Numbers,
    meshes: HashMap<AssetId<Mesh>, MeshUse>,
    /// Meshes whose build is under way.
    building: HashSet<AssetId<Mesh>>,
    /// Whether surfaces with a material stop light.
    materials: HashMap<AssetId<StandardMaterial>, bool>,
}

impl Casters {
    /// Nothing yet, whose meshes will be prepared for this kind of rays.
    pub fn new(rays: ShadowRays) -> Self {
        Self { rays, ..Self::default() }
    }

    /// The number of meshes that are being built, and cast no shadows yet.
    pub fn waiting(&self) -> usize {
        self.building.len()
    }

    fn put(
        &mut self,
        present: Option<&Caster>,
        id: AssetId<Mesh>,
        transform: Affine3A,
        meshes: &Assets<Mesh>,
    ) -> Caster {
        let number = present.map_or_else(|| self.entities.take(), |caster| caster.number);
        let mesh_numbers = &mut self.mesh_numbers;
        let used = self.meshes.entry(id).or_insert_with(|| MeshUse {
            number: mesh_numbers.take(),
            users: 0,
            build: None,
            has_changed: false,
        });
        used.users += 1;
        let (mesh, is_new) = (used.number, used.users == 1);
        self.edits.push(CasterEdit::Put { caster: number, mesh, transform });
        if is_new {
            self.build(id, meshes);
        }
        if let Some(present) = present {
            self.release(present.mesh);
        }
        Caster { number, mesh: id }
    }

    fn remove(&mut self, caster: Caster) {
        self.edits.push(CasterEdit::Remove { caster: caster.number });
        self.entities.free([caster.number]);
        self.release(caster.mesh);
    }

    fn release(&mut self, id: AssetId<Mesh>) {
        let Some(used) = self.meshes.get_mut(&id) else { return };
        used.users -= 1;
        if used.users == 0 {
            self.edits.push(CasterEdit::RemoveMesh { mesh: used.number });
            self.mesh_numbers.free([used.number]);
            self.meshes.remove(&id);
            self.building.remove(&id);
        }
    }

    /// Starts the build of a mesh, if it is used and the main world can read it. One that is under way ends first, so
    /// that a mesh that changes in each frame casts the shadow of a former frame, and not that of the first one.
    fn build(&mut self, id: AssetId<Mesh>, meshes: &Assets<Mesh>) {
        let Some(used) = self.meshes.get_mut(&id) else { return };
        used.has_changed = used.build.is_some();
        if used.has_changed {
            return;
        }
        let Some(triangles) = meshes.get(id).and_then(triangles::corners) else { return };
        let rays = self.rays;
        used.build = Some(AsyncComputeTaskPool::get().spawn(async move { CasterMesh::new(rays, triangles) }));
        self.building.insert(id);
    }

    /// Takes the builds that have ended.
    fn take_built(&mut self, assets: &Assets<Mesh>) {
        let Self { edits, meshes, building, .. } = self;
        let mut changed = Vec::new();
        building.retain(|id| {
            let Some(used) = meshes.get_mut(id) else { return false };
            let Some(built) = used.build.as_mut().and_then(check_ready) else { return used.build.is_some() };
            used.build = None;
            edits.push(CasterEdit::Mesh { mesh: used.number, built: Arc::new(built) });
            if used.has_changed {
                changed.push(*id);
            }
            false
        });
        changed.into_iter().for_each(|id| self.build(id, assets));
    }
}

/// Assets, and what has happened to them since the last frame.
#[derive(SystemParam)]
pub struct CasterAssets<'w, 's> {
    meshes: Res<'w, Assets<Mesh>>,
    materials: Res<'w, Assets<StandardMaterial>>,
    events_of_meshes: MessageReader<'w, 's, AssetEvent<Mesh>>,
    events_of_materials: MessageReader<'w, 's, AssetEvent<StandardMaterial>>,
}

/// Entities that have lost a component since the last frame.
#[derive(SystemParam)]
pub struct Lost<'w, 's> {
    markers: RemovedComponents<'w, 's, NotShadowCaster>,
    meshes: RemovedComponents<'w, 's, Mesh3d>,
    materials: RemovedComponents<'w, 's, MeshMaterial3d<StandardMaterial>>,
    skins: RemovedComponents<'w, 's, SkinnedMesh>,
}

/// Whether surfaces with a material stop light.
fn is_solid(material: &StandardMaterial) -> bool {
    matches!(material.alpha_mode, AlphaMode::Opaque | AlphaMode::Mask(_) | AlphaMode::AlphaToCoverage)
}

type CasterQuery = (
    Entity,
    Option<&'static Mesh3d>,
    Option<&'static MeshMaterial3d<StandardMaterial>>,
    &'static GlobalTransform,
    &'static InheritedVisibility,
    Option<&'static Caster>,
    (Has<NotShadowCaster>, Has<SkinnedMesh>),
);

type ChangedCaster = Or<(
    Changed<Mesh3d>,
    Changed<MeshMaterial3d<StandardMaterial>>,
    (With<Mesh3d>, Changed<InheritedVisibility>),
    Added<NotShadowCaster>,
    Added<SkinnedMesh>,
)>;

/// Finds entities that begin or cease to cast shadows, or have another mesh.
pub fn gather(
    mut commands: Commands,
    mut casters: ResMut<Casters>,
    mut assets: CasterAssets,
    mut lost: Lost,
    new: Query<Entity, ChangedCaster>,
    with_material: Query<(Entity, &MeshMaterial3d<StandardMaterial>), With<Mesh3d>>,
    entities: Query<CasterQuery>,
) {
    let started = Instant::now();
    let casters = casters.bypass_change_detection();
    for id in assets.events_of_meshes.read().filter_map(changed).collect::<HashSet<_>>() {
        casters.build(id, &assets.meshes);
    }
    let mut due: HashSet<Entity> = new.iter().collect();
    due.extend(lost.markers.read().chain(lost.meshes.read()).chain(lost.materials.read()).chain(lost.skins.read()));
    let mut turned = HashSet::new();
    for id in assets.events_of_materials.read().filter_map(changed) {
        // Animated materials change in each frame, and few of them turn solid or clear.
        match assets.materials.get(id).map(is_solid) {
            Some(is_solid) if casters.materials.insert(id, is_solid) == Some(is_solid) => {}
            Some(_) => drop(turned.insert(id)),
            None => drop(casters.materials.remove(&id)),
        }
    }
    if !turned.is_empty() {
        due.extend(
            with_material.iter().filter(|(_, material)| turned.contains(&material.id())).map(|(entity, _)| entity),
        );
    }
    for entity in due {
        let Ok((_, mesh, material, transform, visibility, present, (is_exempt, is_skinned))) = entities.get(entity)
        else {
            continue;
        };
        let is_solid = material.is_none_or(|of| assets.materials.get(&of.0).is_none_or(is_solid));
        let wanted = mesh.filter(|_| visibility.get() && is_solid && !is_exempt && !is_skinned);
        match (wanted, present) {
            (Some(mesh), Some(present)) if present.mesh == mesh.id() => {}
            (Some(mesh), _) => {
                let caster = casters.put(present, mesh.id(), transform.affine(), &assets.meshes);
                commands.entity(entity).insert(caster);
            }
            (None, Some(_)) => drop(commands.entity(entity).remove::<Caster>()),
            (None, None) => {}
        }
    }
    casters.take_built(&assets.meshes);
    casters.took += started.elapsed();
}

/// Finds entities that have moved.
pub fn gather_moves(mut casters: ResMut<Casters>, moved: Query<(&Caster, &GlobalTransform), Changed<GlobalTransform>>) {
    let started = Instant::now();
    let casters = casters.bypass_change_detection();
    casters.edits.extend(
        moved
            .iter()
            .map(|(caster, transform)| CasterEdit::Move { caster: caster.number, transform: transform.affine() }),
    );
    casters.took += started.elapsed();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mesh_that_changes_while_it_is_built_is_built_once_more() {
        AsyncComputeTaskPool::get_or_init(Default::default);
        let mut meshes = Assets::<Mesh>::default();
        let mesh = meshes.add(Cuboid::new(1.0, 1.0, 1.0));
        let mut casters = Casters::default();
        let caster = casters.put(None, mesh.id(), Affine3A::IDENTITY, &meshes);
        for size in [2.0, 4.0] {
            let mesh = meshes.get_mut(&mesh).map(|mut mesh| *mesh = Cuboid::new(size, size, size).into());
            assert!(mesh.is_some());
            casters.build(caster.mesh, &meshes);
        }
        while casters.waiting() > 0 {
            casters.take_built(&meshes);
            std::thread::yield_now();
        }
        let widths = casters.edits.iter().filter_map(|edit| match edit {
            CasterEdit::Mesh { built, .. } => Some(built.bounds.max.x),
            _ => None,
        });
        assert_eq!(widths.collect::<Vec<_>>(), [0.5, 2.0]);
        casters.remove(caster);
        assert!(casters.meshes.is_empty() && matches!(casters.edits.last(), Some(CasterEdit::RemoveMesh { mesh: 0 })));
    }
}
