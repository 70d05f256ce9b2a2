//! Finds what has changed in the main world. Every search is by change detection or by events, so
//! a frame in which nothing changes finds nothing.

use std::collections::HashSet;
use std::time::Instant;

use bevy::camera::visibility::{ViewVisibility, VisibilitySystems};
use bevy::ecs::system::SystemParam;
use bevy::light::{DirectionalLight, PointLight, SpotLight};
use bevy::mesh::morph::MeshMorphWeights;
use bevy::mesh::skinning::SkinnedMesh;
use bevy::prelude::*;

use crate::components::{GirandoleLight, GirandoleSource, NoGirandole};
use crate::edits::Edit;
use crate::gathered::{Changes, Found, Gathered, Shape};
use crate::kinds::{KindKey, Sources};
use crate::rigs::Rig;
use crate::settings::GirandoleSettings;
use crate::units::Emitted;
use crate::{rigs, shadows, sky, surfaces, units};

type AnyLightComponent = Or<(With<PointLight>, With<SpotLight>, With<DirectionalLight>)>;
/// Entities with a light component and no mesh. Only these can be hidden from Bevy.
type AnyLight = (AnyLightComponent, Without<Mesh3d>);

/// Finds lights. Those of Bevy are taken away from it, unless a scene is ray traced.
pub fn add_systems(app: &mut App, ray_traced: bool) {
    let take_over = take_over.run_if(move || !ray_traced);
    app.init_resource::<Changes>().add_systems(
        PostUpdate,
        (
            (mark_all, take_over, give_back).chain().before(VisibilitySystems::CheckVisibility),
            (
                forget,
                gather_lights,
                gather_meshes,
                gather_sources,
                gather_visibility,
                gather_moves,
                rigs::gather,
                sky::gather,
                surfaces::gather,
            )
                .chain()
                .after(TransformSystems::Propagate)
                .after(VisibilitySystems::VisibilityPropagate)
                .after(give_back),
        ),
    );
}

/// Finds what casts shadows.
pub fn add_shadow_systems(app: &mut App) {
    app.add_systems(
        PostUpdate,
        (shadows::gather, shadows::gather_moves)
            .chain()
            .after(TransformSystems::Propagate)
            .after(VisibilitySystems::VisibilityPropagate),
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

/// Lights whose light component, mesh or material was removed, and those that are left to Bevy
/// because their entity got both.
fn forget(
    mut commands: Commands,
    mut removed: Removed,
    mut meshes: RemovedComponents<Mesh3d>,
    mut materials: RemovedComponents<MeshMaterial3d<StandardMaterial>>,
    both: Query<Entity, (With<Gathered>, With<Mesh3d>, AnyLightComponent)>,
    mut sources: RemovedComponents<GirandoleSource>,
    entities: Query<(&Gathered, Has<PointLight>, Has<SpotLight>, Has<DirectionalLight>, OtherParts)>,
) {
    for entity in removed.read().into_iter().chain(meshes.read()).chain(materials.read()).chain(sources.read()) {
        let Ok((gathered, point, spot, directional, (mesh, material, source))) = entities.get(entity) else { continue };
        let remains = match gathered.shape {
            Shape::Point => point,
            Shape::Spot => spot,
            Shape::Directional => directional,
            Shape::Mesh(_) => mesh && material,
            Shape::Source => source,
        };
        if !remains {
            commands.entity(entity).remove::<Gathered>();
        }
    }
    for entity in &both {
        commands.entity(entity).remove::<Gathered>();
    }
}

type OtherParts = (Has<Mesh3d>, Has<MeshMaterial3d<StandardMaterial>>, Has<GirandoleSource>);

/// Entities that have lost a light component since the last frame.
#[derive(SystemParam)]
struct Removed<'w, 's> {
    points: RemovedComponents<'w, 's, PointLight>,
    spots: RemovedComponents<'w, 's, SpotLight>,
    directionals: RemovedComponents<'w, 's, DirectionalLight>,
}

impl Removed<'_, '_> {
    fn read(&mut self) -> Vec<Entity> {
        self.points.read().chain(self.spots.read()).chain(self.directionals.read()).collect()
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

/// Lights that are new or whose component was changed. All lights have a [`Gathered`] after this, so
/// the last part of the filter matches nothing that is not new.
fn gather_lights(
    mut commands: Commands,
    mut changes: ResMut<Changes>,
    sources: Sources,
    mut lights: Query<LightQuery, (With<GirandoleLight>, AnyLight, ChangedLight)>,
) {
    let started = Instant::now();
    for (entity, point, spot, directional, transform, visibility, gathered) in &mut lights {
        let shown = visibility.get();
        let next = match (point, spot, directional) {
            (Some(point), ..) => {
                let found = Found { shape: Shape::Point, emitted: units::point(point), transform, shown };
                changes.put(gathered.as_deref(), &found, &sources)
            }
            (_, Some(spot), _) => {
                let found = Found { shape: Shape::Spot, emitted: units::spot(spot), transform, shown };
                changes.put(gathered.as_deref(), &found, &sources)
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

/// The assets that marked meshes used when they were last looked through, and the exposure then.
#[derive(Default)]
struct Seen {
    meshes: HashSet<AssetId<Mesh>>,
    materials: HashSet<AssetId<StandardMaterial>>,
    images: HashSet<AssetId<Image>>,
    ev100: Option<f32>,
}

/// The events of assets since the last frame, and the assets in use.
#[derive(SystemParam)]
struct AssetChanges<'w, 's> {
    events_of_meshes: MessageReader<'w, 's, AssetEvent<Mesh>>,
    events_of_materials: MessageReader<'w, 's, AssetEvent<StandardMaterial>>,
    events_of_images: MessageReader<'w, 's, AssetEvent<Image>>,
    sources: Sources<'w, 's>,
    materials: Res<'w, Assets<StandardMaterial>>,
    lost_skins: RemovedComponents<'w, 's, SkinnedMesh>,
    lost_weights: RemovedComponents<'w, 's, MeshMorphWeights>,
    seen: Local<'s, Seen>,
}

/// The asset that an event makes new.
pub fn changed<A: Asset>(event: &AssetEvent<A>) -> Option<AssetId<A>> {
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
    (Has<SkinnedMesh>, Has<MeshMorphWeights>),
    Option<&'static mut Gathered>,
);
type EmissiveMesh = (With<GirandoleLight>, Without<PointLight>, Without<SpotLight>, Without<DirectionalLight>);
type ChangedMesh = Or<(
    Changed<Mesh3d>,
    Changed<MeshMaterial3d<StandardMaterial>>,
    Added<GirandoleLight>,
    Added<SkinnedMesh>,
    Added<MeshMorphWeights>,
)>;

/// Emissive meshes that are new, or of which the mesh, the material or its textures were changed, and
/// those that have lost a light component. After an event of an asset that marked meshes use, it looks
/// through all of them.
fn gather_meshes(
    mut commands: Commands,
    mut changes: ResMut<Changes>,
    settings: Res<GirandoleSettings>,
    mut assets: AssetChanges,
    mut removed: Removed,
    new: Query<(), (EmissiveMesh, ChangedMesh)>,
    mut lights: Query<MeshQuery, EmissiveMesh>,
) {
    let started = Instant::now();
    let changed_meshes: HashSet<_> = assets.events_of_meshes.read().filter_map(changed).collect();
    let changed_materials: HashSet<_> = assets.events_of_materials.read().filter_map(changed).collect();
    let changed_images: HashSet<_> = assets.events_of_images.read().filter_map(changed).collect();
    let lost = removed.read().into_iter().chain(assets.lost_skins.read()).chain(assets.lost_weights.read());
    let without_light: HashSet<_> = lost.filter(|&entity| lights.contains(entity)).collect();
    let all = assets.seen.ev100 != Some(settings.exposure.ev100);
    let uses_none = changed_meshes.is_disjoint(&assets.seen.meshes)
        && changed_materials.is_disjoint(&assets.seen.materials)
        && changed_images.is_disjoint(&assets.seen.images);
    if !all && uses_none && new.is_empty() && without_light.is_empty() {
        return;
    }
    *assets.seen = Seen { ev100: Some(settings.exposure.ev100), ..default() };
    changes.replace(&changed_meshes, &changed_images, &assets.sources);
    for (entity, marker, mesh, material, transform, visibility, (has_skin, has_weights), gathered) in &mut lights {
        assets.seen.meshes.insert(mesh.id());
        assets.seen.materials.insert(material.id());
        let material_of_mesh = assets.materials.get(&material.0);
        let rig = Rig::of(entity, assets.sources.meshes.get(mesh.id()), has_skin, has_weights);
        let emitted = material_of_mesh
            .and_then(|of| units::emissive((mesh.id(), rig), of, settings.exposure, *assets.sources.ray_traced));
        let images = || emitted.into_iter().flat_map(|emitted| emitted.key.images());
        assets.seen.images.extend(images());
        let is_new = all || marker.is_added() || mesh.is_changed() || material.is_changed();
        let is_new = is_new || without_light.contains(&entity);
        let is_new = is_new || gathered.as_ref().is_some_and(|of| of.shape != Shape::Mesh(rig));
        let is_loaded = changed_meshes.contains(&mesh.id()) || images().any(|image| changed_images.contains(&image));
        let is_new = is_new || (gathered.is_none() && is_loaded);
        if !(is_new || changed_materials.contains(&material.id())) {
            continue;
        }
        let next = emitted.and_then(|emitted| {
            let found = Found { shape: Shape::Mesh(rig), emitted, transform, shown: visibility.get() };
            changes.put(gathered.as_deref(), &found, &assets.sources)
        });
        store(&mut commands, entity, gathered, next);
    }
    changes.took(started);
}

type SourceQuery = (Entity, &'static GlobalTransform, &'static InheritedVisibility, Option<&'static mut Gathered>);
type ChangedSource = (Changed<GirandoleSource>, Without<GirandoleLight>);

/// Lights that passes of the application write, if they are new or were changed.
fn gather_sources(
    mut commands: Commands,
    mut changes: ResMut<Changes>,
    sources: Sources,
    mut lights: Query<SourceQuery, ChangedSource>,
) {
    let started = Instant::now();
    for (entity, transform, visibility, gathered) in &mut lights {
        if let Some(gathered) = gathered.as_deref().filter(|gathered| gathered.shape == Shape::Source) {
            changes.replace_source(gathered, entity, &sources);
            continue;
        }
        let emitted = Emitted { key: KindKey::Source(entity), factor: Vec3::ONE };
        let found = Found { shape: Shape::Source, emitted, transform, shown: visibility.get() };
        let next = changes.put(gathered.as_deref(), &found, &sources);
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
            // Its pose moves it.
            (Shape::Mesh(Rig::Morph(_) | Rig::Skin(_)), _) => {}
            (shape, _) => edits.moves.push((light, shape.placement(transform))),
        }
    }
    changes.took(started);
}
