//! Lights that are written on the GPU: by the plugin for skinned and morphed meshes, and by a pass of the application.

use std::f32::consts::{FRAC_PI_2, PI};

use bevy::asset::RenderAssetUsages;
use bevy::mesh::morph::{MeshMorphWeights, MorphAttributes, MorphWeights};
use bevy::mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes};
use bevy::mesh::{PrimitiveTopology, VertexAttributeValues};
use bevy::prelude::*;
use bevy::render::render_resource::{
    BindGroupLayoutDescriptor, CachedComputePipelineId, ComputePassDescriptor, ComputePipelineDescriptor, PipelineCache,
};
use bevy::render::renderer::{RenderContext, RenderGraph};
use bevy::render::{RenderApp, RenderStartup};
use bevy_girandole::{
    Estimate, GirandoleCamera, GirandoleGpu, GirandoleLight, GirandolePlugin, GirandoleSource, GirandoleSystems,
    sources_layout,
};
use girandole::{Light, TreeSource};

use crate::harness::{Setup, add_scene, app, brightness, pictures, report, set_camera, settle, single_frames};
use crate::unbiased::{FRAMES, check, means};

/// A strip of two quads along X, from -2 to 2, which shines down.
const COLUMNS: [f32; 3] = [-2.0, 0.0, 2.0];
/// Two triangles for each quad: columns, and sides along Z.
const CORNERS: [[(usize, f32); 3]; 4] = [
    [(0, -0.5), (1, -0.5), (0, 0.5)],
    [(1, -0.5), (1, 0.5), (0, 0.5)],
    [(1, -0.5), (2, -0.5), (1, 0.5)],
    [(2, -0.5), (2, 0.5), (1, 0.5)],
];

/// The corners of the strip. Its last column hangs down once its joint, at the middle, has turned.
fn corners(is_turned: bool) -> Vec<[f32; 3]> {
    let place = |(column, z): (usize, f32)| match (column, is_turned) {
        (2, true) => [0.0, -2.0, z],
        _ => [COLUMNS[column], 0.0, z],
    };
    CORNERS.iter().flatten().copied().map(place).collect()
}

fn strip(is_turned: bool) -> Mesh {
    let normals = vec![[0.0, -1.0, 0.0]; 12];
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::all())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, corners(is_turned))
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, normals)
}

/// The strip with two joints: one for the first two columns, and one for the last.
fn skinned() -> Mesh {
    let joints = CORNERS.iter().flatten().map(|(column, _)| [u16::from(*column == 2), 0, 0, 0]).collect();
    strip(false)
        .with_inserted_attribute(Mesh::ATTRIBUTE_JOINT_INDEX, VertexAttributeValues::Uint16x4(joints))
        .with_inserted_attribute(Mesh::ATTRIBUTE_JOINT_WEIGHT, vec![[1.0, 0.0, 0.0, 0.0]; 12])
}

/// The strip with two morph targets: one that moves nothing, and one that lets its last column hang down.
fn morphed() -> Mesh {
    let offset = |position| MorphAttributes { position, ..default() };
    let places = [false, true].map(|is_turned| corners(is_turned).into_iter().map(Vec3::from));
    let [from, to] = places;
    let turned = from.zip(to).map(|(from, to)| offset(to - from));
    strip(false).with_morph_targets([offset(Vec3::ZERO); 12].into_iter().chain(turned).collect())
}

/// Above what the camera sees.
fn place() -> Transform {
    Transform::from_xyz(0.5, 5.0, 0.2)
}

fn scene() -> App {
    // Skinned meshes cast no shadows, and those that they are compared with would.
    let plugin = GirandolePlugin { shadows: false, ..default() };
    let mut app = app(Setup { plugin, camera: GirandoleCamera { samples: 4, ..single_frames() }, ..default() });
    add_scene(&mut app);
    app
}

/// An emissive mesh that is marked.
fn add_strip(app: &mut App, mesh: Mesh) -> Entity {
    let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(mesh);
    let glowing = StandardMaterial { emissive: LinearRgba::rgb(20.0, 60.0, 30.0), ..default() };
    let material = app.world_mut().resource_mut::<Assets<StandardMaterial>>().add(glowing);
    app.world_mut().spawn((Mesh3d(mesh), MeshMaterial3d(material), GirandoleLight, place())).id()
}

/// Gives a strip a skeleton. Returns the joint of its last column. The place of the entity does not count.
fn add_skeleton(app: &mut App, entity: Entity) -> Entity {
    let bind_poses = SkinnedMeshInverseBindposes::from(vec![Mat4::IDENTITY; 2]);
    let inverse_bindposes = app.world_mut().resource_mut::<Assets<SkinnedMeshInverseBindposes>>().add(bind_poses);
    let joints = [(); 2].map(|()| app.world_mut().spawn(place()).id()).to_vec();
    let moved = joints[1];
    let mut entity = app.world_mut().entity_mut(entity);
    entity.insert((SkinnedMesh { inverse_bindposes, joints }, Transform::from_xyz(50.0, 0.0, 0.0)));
    moved
}

/// Turns a joint. The last column of the strip hangs down after a right angle.
fn turn(app: &mut App, joint: Entity, angle: f32) {
    app.world_mut().get_mut::<Transform>(joint).expect("it is there").rotation = Quat::from_rotation_z(angle);
}

/// Gives a strip the weights of its morph targets, in another entity. Returns that entity.
fn add_weights(app: &mut App, entity: Entity) -> Entity {
    let weights = MorphWeights::new(vec![1.0, 0.0], None).expect("two are not too many");
    let controller = app.world_mut().spawn(weights).id();
    app.world_mut().entity_mut(entity).insert(MeshMorphWeights::Reference(controller));
    controller
}

/// What poses a strip.
struct Control {
    /// Gives an entity what poses it. Returns the entity that the next one is called with.
    add: fn(&mut App, Entity) -> Entity,
    /// Lets the last column of the strip hang down, or lifts it.
    set: fn(&mut App, Entity, bool),
    /// Takes it away again.
    remove: fn(&mut App, Entity),
}

#[test]
fn the_lights_of_a_skinned_mesh_follow_its_joints() {
    let set = |app: &mut App, joint, is_turned| turn(app, joint, if is_turned { -FRAC_PI_2 } else { 0.0 });
    let remove = |app: &mut App, entity: Entity| {
        app.world_mut().entity_mut(entity).remove::<SkinnedMesh>();
    };
    check_posed(skinned(), &Control { add: add_skeleton, set, remove });
}

#[test]
fn the_lights_of_a_mesh_follow_its_morph_targets() {
    let set = |app: &mut App, controller, is_turned| {
        let mut weights = app.world_mut().get_mut::<MorphWeights>(controller).expect("it is there");
        weights.weights_mut()[1] = if is_turned { 1.0 } else { 0.0 };
    };
    let remove = |app: &mut App, entity: Entity| {
        app.world_mut().entity_mut(entity).remove::<MeshMorphWeights>();
    };
    check_posed(morphed(), &Control { add: add_weights, set, remove });
}

/// Compares a strip with meshes at rest that have the shapes of its poses.
fn check_posed(mesh: Mesh, control: &Control) {
    let mut app = scene();
    let entity = add_strip(&mut app, mesh);
    settle(&mut app);
    assert_eq!((report(&app).lights, report(&app).written), (1, 0), "nothing poses it");
    let controller = (control.add)(&mut app, entity);
    let flat = means(&pictures(&mut app, FRAMES));
    assert_eq!((report(&app).lights, report(&app).trees, report(&app).written), (1, 1, 1));
    (control.set)(&mut app, controller, true);
    let turned = means(&pictures(&mut app, FRAMES));
    settle(&mut app);
    assert!(report(&app).moved == 0 && report(&app).changed == 0, "the pose is sent once");
    assert_eq!(report(&app).refused, 0);

    for (is_turned, sampled) in [(false, &flat), (true, &turned)] {
        let mut app = scene();
        add_strip(&mut app, strip(is_turned));
        set_camera(&mut app, |camera| camera.estimate = Estimate::Exhaustive);
        check(&format!("turned: {is_turned}"), sampled, &means(&pictures(&mut app, FRAMES)));
        assert_eq!(report(&app).written, 0, "nothing is written of a mesh at rest");
    }

    // Hidden and shown again, with a pose that it got meanwhile.
    app.world_mut().entity_mut(entity).insert(Visibility::Hidden);
    (control.set)(&mut app, controller, false);
    assert_eq!(brightness(&mut app), 0.0);
    app.world_mut().entity_mut(entity).insert(Visibility::Inherited);
    set_camera(&mut app, |camera| camera.estimate = Estimate::Exhaustive);
    check("shown again", &flat, &means(&pictures(&mut app, FRAMES)));
    (control.remove)(&mut app, entity);
    settle(&mut app);
    assert_eq!((report(&app).lights, report(&app).written), (1, 0), "nothing poses it again");
    app.world_mut().despawn(entity);
    settle(&mut app);
    assert_eq!((report(&app).lights, report(&app).trees), (0, 0));
}

/// Lamps that the pass writes.
const LAMPS: u32 = 16;

fn lamp(i: u32) -> (Vec3, f32) {
    (Vec3::new((i % 4) as f32 - 1.5, 1.0 + 0.25 * (i / 4) as f32, 0.5 * (i % 3) as f32), 10.0 + i as f32)
}

#[cfg(not(feature = "wesl"))]
const IMPORTS: &str = "#import girandole::sources::{light_source_count, light_put_point}\n";
#[cfg(feature = "wesl")]
const IMPORTS: &str = "import girandole::sources::{light_source_count, light_put_point};\n";

const KERNEL: &str = "
@compute @workgroup_size(64)
fn put_lamps(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < light_source_count(0u) {
        let place = vec3(f32(id.x % 4u) - 1.5, 1.0 + 0.25 * f32(id.x / 4u), 0.5 * f32(id.x % 3u));
        light_put_point(0u, id.x, place, vec3(10.0 + f32(id.x)));
    }
}";

/// The pass of the application.
#[derive(Resource)]
struct Kernel(Handle<Shader>);

#[derive(Resource)]
struct Pass(CachedComputePipelineId);

#[derive(Resource, Clone, Copy)]
struct Written(Entity);

fn start(mut commands: Commands, cache: Res<PipelineCache>, kernel: Res<Kernel>) {
    let nothing = BindGroupLayoutDescriptor::new("nothing", &[]);
    commands.insert_resource(Pass(cache.queue_compute_pipeline(ComputePipelineDescriptor {
        layout: vec![nothing, sources_layout()],
        shader: kernel.0.clone(),
        entry_point: Some("put_lamps".into()),
        ..default()
    })));
}

fn write(
    pass: Res<Pass>,
    written: Option<Res<Written>>,
    gpu: Res<GirandoleGpu>,
    cache: Res<PipelineCache>,
    mut context: RenderContext,
) {
    let (Some(written), Some(pipeline)) = (written, cache.get_compute_pipeline(pass.0)) else { return };
    let Some(sources) = gpu.source_group() else { return };
    let Some(number) = gpu.source_number(written.0) else { return };
    assert_eq!(number, 0, "the kernel is made for the first source");
    let nothing = context.render_device().create_bind_group(
        "nothing",
        &cache.get_bind_group_layout(&BindGroupLayoutDescriptor::new("nothing", &[])),
        &[],
    );
    let mut pass = context.command_encoder().begin_compute_pass(&ComputePassDescriptor::default());
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, &*nothing, &[]);
    pass.set_bind_group(1, &**sources, &[]);
    pass.dispatch_workgroups(1, 1, 1);
}

#[test]
fn a_pass_of_the_application_writes_lights() {
    let mut app = scene();
    #[cfg(not(feature = "wesl"))]
    let shader = Shader::from_wgsl(format!("{IMPORTS}{KERNEL}"), "put_lamps.wgsl");
    #[cfg(feature = "wesl")]
    let shader = Shader::from_wesl(format!("{IMPORTS}{KERNEL}"), "embedded://put_lamps.wesl");
    let kernel = Kernel(app.world_mut().resource_mut::<Assets<Shader>>().add(shader));
    let offset = Vec3::new(0.3, 0.5, 0.0);
    let lights = vec![Light::point(Vec3::ZERO, Vec3::ZERO); LAMPS as usize];
    let source = GirandoleSource { lights, source: TreeSource::GpuParticles };
    let entity = app.world_mut().spawn((source.clone(), Transform::from_translation(offset))).id();
    let render_app = app.get_sub_app_mut(RenderApp).expect("it draws");
    render_app
        .insert_resource(kernel)
        .insert_resource(Written(entity))
        .add_systems(RenderStartup, start)
        .add_systems(RenderGraph, write.in_set(GirandoleSystems::WriteLights));
    set_camera(&mut app, |camera| camera.estimate = Estimate::Exhaustive);
    let ours = pictures(&mut app, 1).remove(0);
    assert_eq!((report(&app).lights, report(&app).trees, report(&app).written), (1, 1, 1));
    set_camera(&mut app, |camera| camera.estimate = Estimate::Sampled);
    let sampled = means(&pictures(&mut app, FRAMES));

    // The same lamps as Bevy's components.
    let mut twin = scene();
    for (place, candela) in (0..LAMPS).map(lamp) {
        let lamp = PointLight { intensity: 4.0 * PI * candela, range: 1.0e6, ..default() };
        twin.world_mut().spawn((lamp, GirandoleLight, Transform::from_translation(place + offset)));
    }
    set_camera(&mut twin, |camera| camera.estimate = Estimate::Exhaustive);
    let expected = pictures(&mut twin, 2);
    let brightest = expected[0].iter().fold(0.0, |most: f32, pixel| most.max(pixel.max_element()));
    for (ours, expected) in ours.iter().zip(&expected[0]) {
        let allowed = Vec3::splat(1.0e-3 * brightest) + *expected * 2.0e-3;
        assert!((*ours - *expected).abs().cmple(allowed).all(), "{ours} is not {expected}");
    }
    check("written", &sampled, &means(&expected));

    app.world_mut().entity_mut(entity).remove::<GirandoleSource>();
    settle(&mut app);
    assert_eq!((report(&app).lights, report(&app).trees, report(&app).written), (0, 0, 0));
    app.world_mut().entity_mut(entity).insert(source);
    settle(&mut app);
    assert_eq!((report(&app).lights, report(&app).written, report(&app).refused), (1, 1, 0));
}
