//! Finds what has changed in the main world. Every search is by change detection or by events, so
//! a frame in which nothing changes finds nothing.

use std::collections::HashSet;
use std::time::Instant;

use bevy::asset::UntypedAssetId;
use bevy::camera::visibility::{ViewVisibility, VisibilitySystems};
use bevy::ecs::system::SystemParam;
use bevy::light::{DirectionalLight, PointLight, SpotLight};
use bevy::prelude::*;

use crate::components::{GirandoleLight, NoGirandole};
use crate::edits::Edit;
use crate::gathered::{Changes, Found, Gathered, Shape};
use crate::settings::GirandoleSettings;
use crate::units;

type AnyLightComponent = Or<(With<PointLight>, With<SpotLight>, With<DirectionalLight>)>;
/// Entities with a light component and no mesh. Only these can be hidden from Bevy.
type AnyLight = (AnyLightComponent, Without<Mesh3d>);

pub fn add_systems(app: &mut App) {
    app.init_resource::<Changes>().add_systems(
        PostUpdate,
        (
            (mark_all, take_over, give_back).chain().before(VisibilitySystems::CheckVisibility),
            (forget, gather_lights, gather_meshes, gather_visibility, gather_moves)
                .chain()
                .after(TransformSystems::Propagate)
                .after(VisibilitySystems::VisibilityPropagate)
                .after(give_back),
        ),
    );
}

/// Marks lights if the settings say so.
fn mark_all(
    mut commands: Commands,
    settings: Res<GirandoleSettings>,
    lights: Query<Entity, (AnyLight, Without<GirandoleLight>, Without<NoGirandole>)>,
) {
    if settings.all_lights {
        for entity in &lights {
            commands.entity(entity).insert(GirandoleLight);
        }
    }
}

/// Takes lights away from Bevy. The query matches by component types alone, and is empty unless a
/// light is new.
fn take_over(
    mut commands: Commands,
    mut changes: ResMut<Changes>,
    lights: Query<Entity, (AnyLight, With<GirandoleLight>, With<ViewVisibility>)>,
) {
    for entity in &lights {
        commands.entity(entity).remove::<ViewVisibility>();
        changes.bypass_change_detection().taken.push(entity);
    }
}

/// Gives lights that are no longer marked back to Bevy.
fn give_back(
    mut commands: Commands,
    mut unmarked: RemovedComponents<GirandoleLight>,
    entities: Query<Has<ViewVisibility>, Without<GirandoleLight>>,
) {
    for entity in unmarked.read() {
        let Ok(is_seen) = entities.get(entity) else { continue };
        let mut commands = commands.entity(entity);
        commands.remove::<Gathered>();
        if !is_seen {
            commands.insert(ViewVisibility::default());
        }
    }
}

/// Lights whose light component, mesh or material was removed, and those that are left to Bevy because their
/// entity got both.
fn forget(
    mut commands: Commands,
    mut removed: Removed,
    both: Query<Entity, (With<Gathered>, With<Mesh3d>, AnyLightComponent)>,
    entities: Query<(
        &Gathered,
        Has<PointLight>,
        Has<SpotLight>,
        Has<DirectionalLight>,
        (Has<Mesh3d>, Has<MeshMaterial3d<StandardMaterial>>),
    )>,
) {
    for entity in removed.read() {
        let Ok((gathered, point, spot, directional, (mesh, material))) = entities.get(entity) else { continue };
        let remains = match gathered.shape {
            Shape::Point => point,
            Shape::Spot => spot,
            Shape::Directional => directional,
            Shape::Mesh => mesh && material,
        };
        if !remains {
            commands.entity(entity).remove::<Gathered>();
        }
    }
    for entity in &both {
        commands.entity(entity).remove::<Gathered>();
    }
}

#[derive(SystemParam)]
struct Removed<'w, 's> {
    points: RemovedComponents<'w, 's, PointLight>,
    spots: RemovedComponents<'w, 's, SpotLight>,
    directionals: RemovedComponents<'w, 's, DirectionalLight>,
    meshes: RemovedComponents<'w, 's, Mesh3d>,
    materials: RemovedComponents<'w, 's, MeshMaterial3d<StandardMaterial>>,
}

impl Removed<'_, '_> {
    fn read(&mut self) -> Vec<Entity> {
        let lights = self.points.read().chain(self.spots.read()).chain(self.directionals.read());
        lights.chain(self.meshes.read()).chain(self.materials.read()).collect()
    }
}

type LightQuery = (
    Entity,
    Option<&'static PointLight>,
    Option<&'static SpotLight>,
    Option<&'static DirectionalLight>,
    &'static GlobalTransform,
    &'static InheritedVisibility,
    Option<&'static mut Gathered>,
);

type ChangedLight = Or<(Changed<PointLight>, Changed<SpotLight>, Changed<DirectionalLight>, Without<Gathered>)>;

/// Lights that are new or whose component was changed. `Without<Gathered>` matches by component types
/// alone, and nothing once all lights are known.
fn gather_lights(
    mut commands: Commands,
    mut changes: ResMut<Changes>,
    meshes: Res<Assets<Mesh>>,
    mut lights: Query<LightQuery, (With<GirandoleLight>, AnyLight, ChangedLight)>,
) {
    let started = Instant::now();
    for (entity, point, spot, directional, transform, visibility, gathered) in &mut lights {
        let shown = visibility.get();
        let next = match (point, spot, directional) {
            (Some(point), ..) => {
                let found = Found { shape: Shape::Point, emitted: units::point(point), transform, shown };
                changes.put(gathered.as_deref(), &found, &meshes)
            }
            (_, Some(spot), _) => {
                let found = Found { shape: Shape::Spot, emitted: units::spot(spot), transform, shown };
                changes.put(gathered.as_deref(), &found, &meshes)
            }
            (.., Some(light)) => {
                Some(changes.put_directional(gathered.as_deref(), units::directional(light, transform), shown))
            }
            _ => None,
        };
        store(&mut commands, entity, gathered, next);
    }
    changes.took(started);
}

/// Stores what is known of an entity.
fn store(commands: &mut Commands, entity: Entity, present: Option<Mut<Gathered>>, next: Option<Gathered>) {
    match (present, next) {
        (Some(mut gathered), Some(next)) => *gathered = next,
        (None, Some(next)) => {
            commands.entity(entity).insert(next);
        }
        (Some(_), None) => {
            commands.entity(entity).remove::<Gathered>();
        }
        (None, None) => {}
    }
}

/// The events of assets since the last frame.
#[derive(SystemParam)]
struct AssetChanges<'w, 's> {
    events_of_meshes: MessageReader<'w, 's, AssetEvent<Mesh>>,
    events_of_materials: MessageReader<'w, 's, AssetEvent<StandardMaterial>>,
    meshes: Res<'w, Assets<Mesh>>,
    materials: Res<'w, Assets<StandardMaterial>>,
}

fn changed<A: Asset>(event: &AssetEvent<A>) -> Option<AssetId<A>> {
    match event {
        AssetEvent::Added { id } | AssetEvent::Modified { id } | AssetEvent::Removed { id } => Some(*id),
        _ => None,
    }
}

type MeshQuery = (
    Entity,
    Ref<'static, GirandoleLight>,
    Ref<'static, Mesh3d>,
    Ref<'static, MeshMaterial3d<StandardMaterial>>,
    &'static GlobalTransform,
    &'static InheritedVisibility,
    Option<&'static mut Gathered>,
);
type EmissiveMesh = (With<GirandoleLight>, Without<PointLight>, Without<SpotLight>, Without<DirectionalLight>);
type ChangedMesh = Or<(Changed<Mesh3d>, Changed<MeshMaterial3d<StandardMaterial>>, Added<GirandoleLight>)>;

/// Emissive meshes that are new, or of which the mesh or the material was changed. After an event
/// of a mesh or a material that a marked mesh uses, it looks through the marked meshes for its users.
fn gather_meshes(
    mut commands: Commands,
    mut changes: ResMut<Changes>,
    settings: Res<GirandoleSettings>,
    mut assets: AssetChanges,
    mut removed: Removed,
    mut last_exposure: Local<Option<u32>>,
    // The meshes and materials of all marked entities, as of the last look through them.
    mut in_use: Local<HashSet<UntypedAssetId>>,
    new: Query<(), (EmissiveMesh, ChangedMesh)>,
    mut lights: Query<MeshQuery, EmissiveMesh>,
) {
    let started = Instant::now();
    let changed_meshes: Vec<_> = assets.events_of_meshes.read().filter_map(changed).collect();
    let changed_materials: Vec<_> = assets.events_of_materials.read().filter_map(changed).collect();
    // Meshes that had a light component, which counted alone.
    let bared = removed.read();
    let exposure = settings.exposure.ev100.to_bits();
    let all = last_exposure.replace(exposure) != Some(exposure);
    let is_used = changed_meshes.iter().any(|id| in_use.contains(&id.untyped()))
        || changed_materials.iter().any(|id| in_use.contains(&id.untyped()));
    if !all && bared.is_empty() && !is_used && new.is_empty() {
        return;
    }
    in_use.clear();
    for &id in &changed_meshes {
        changes.replace_mesh(id, &assets.meshes);
    }
    for (entity, marker, mesh, material, transform, visibility, gathered) in &mut lights {
        in_use.extend([mesh.id().untyped(), material.id().untyped()]);
        let is_new = all || bared.contains(&entity) || marker.is_added() || mesh.is_changed() || material.is_changed();
        let has_new_mesh = gathered.is_none() && changed_meshes.contains(&mesh.id());
        if !(is_new || has_new_mesh || changed_materials.contains(&material.id())) {
            continue;
        }
        let emitted = assets
            .materials
            .get(&material.0)
            .and_then(|material| units::emissive(mesh.id(), material, settings.exposure));
        let next = emitted.and_then(|emitted| {
            let found = Found { shape: Shape::Mesh, emitted, transform, shown: visibility.get() };
            changes.put(gathered.as_deref(), &found, &assets.meshes)
        });
        store(&mut commands, entity, gathered, next);
    }
    changes.took(started);
}

type PlacedLight =
    (&'static Gathered, &'static GlobalTransform, &'static InheritedVisibility, Option<&'static DirectionalLight>);

/// Lights that were hidden or shown.
fn gather_visibility(mut changes: ResMut<Changes>, lights: Query<PlacedLight, Changed<InheritedVisibility>>) {
    let started = Instant::now();
    for (gathered, transform, visibility, directional) in &lights {
        let (light, shown) = (gathered.light, visibility.get());
        changes.edits.edits.push(match (gathered.shape, directional) {
            (Shape::Directional, Some(of)) => {
                Edit::Directional { light, shown, value: units::directional(of, transform) }
            }
            _ => Edit::Show { light, shown },
        });
    }
    changes.took(started);
}

/// Lights that were moved, by the application or with their parents.
fn gather_moves(mut changes: ResMut<Changes>, lights: Query<PlacedLight, Changed<GlobalTransform>>) {
    let started = Instant::now();
    let edits = &mut changes.bypass_change_detection().edits;
    for (gathered, transform, visibility, directional) in &lights {
        let light = gathered.light;
        match (gathered.shape, directional) {
            (Shape::Directional, Some(of)) => {
                let (shown, value) = (visibility.get(), units::directional(of, transform));
                edits.edits.push(Edit::Directional { light, shown, value });
            }
            (shape, _) => edits.moves.push((light, shape.placement(transform))),
        }
    }
    changes.took(started);
}
