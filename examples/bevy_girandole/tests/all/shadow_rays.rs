//! Shadow rays are the same by ray queries and in software, in the pass of the plugin and in those of an application.

use std::sync::mpsc::channel;

use bevy::asset::RenderAssetUsages;
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::render::render_resource::{
    BindGroupEntry, BindGroupLayoutDescriptor, Buffer, BufferBindingType, BufferDescriptor, BufferUsages,
    CachedComputePipelineId, ComputePassDescriptor, ComputePipelineDescriptor, PipelineCache, PollType,
};
use bevy::render::renderer::{RenderContext, RenderDevice, RenderGraph, RenderQueue};
use bevy_girandole::{GirandoleLight, GirandoleShadows, GirandoleSystems, ShadowRays, buffer_entry};
use girandole::wgpu::util::DownloadBuffer;

use crate::harness::{PIXELS, Setup, frame, report, settle, start};
use crate::shadows::{LAMP, Solid, add, floor_of, picture, turned};

/// Pixels that may differ: a ray that passes an edge within rounding may end on either side of it.
const MAX_DIFFERENT: usize = 2;

/// A floor whose shadows are traced in software, and one with ray queries; `None` for that on devices without them. With
/// the environment variable `GIRANDOLE_RAY_QUERIES`, they must be there.
fn both() -> (App, Option<App>) {
    let software = floor_of(Setup { no_ray_queries: true, ..default() });
    let mut queried = floor_of(Setup::default());
    settle(&mut queried);
    let has_queries = report(&queried).shadow_rays == Some(ShadowRays::RayQuery);
    assert!(has_queries || std::env::var_os("GIRANDOLE_RAY_QUERIES").is_none(), "the device has no ray queries");
    if !has_queries {
        eprintln!("skipped in part: the device has no ray queries");
    }
    (software, has_queries.then_some(queried))
}

/// A wedge with another shape in its mirror image, as triangles without indices.
fn wedge() -> Mesh {
    let [a, b, c, d] = [[0.0, 0.0, 0.0], [1.2, 0.0, 0.2], [0.1, 0.0, 1.0], [0.3, 0.6, 0.1]];
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::all())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, vec![a, b, c, a, d, b, b, d, c, c, d, a])
}

/// A bent strip, of which one index is not there and one vertex is not finite.
fn strip() -> Mesh {
    let mut corners: Vec<_> = (0..8).map(|i| [0.3 * (i / 2) as f32, 0.1 * (i / 2) as f32, (i % 2) as f32]).collect();
    corners.push([f32::NAN; 3]);
    Mesh::new(PrimitiveTopology::TriangleStrip, RenderAssetUsages::all())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, corners)
        .with_inserted_indices(Indices::U16(vec![0, 1, 2, 3, 4, 5, 6, 7, 8, 99]))
}

/// What stands over the floor.
struct Scene {
    cube: Entity,
    wedge: Entity,
}

fn build(app: &mut App) -> Scene {
    for (place, color) in [(Vec3::new(3.0, 3.0, -2.0), Color::linear_rgb(0.2, 1.0, 0.1)), (Vec3::Y * 9.0, Color::WHITE)]
    {
        let lamp = PointLight { intensity: 80_000.0, range: 50.0, color, ..default() };
        app.world_mut().spawn((lamp, GirandoleLight, Transform::from_translation(place)));
    }
    let sun = DirectionalLight { illuminance: 200.0, ..default() };
    app.world_mut().spawn((sun, GirandoleLight, Transform::from_xyz(2.0, 5.0, -3.0).looking_at(Vec3::ZERO, Vec3::Y)));
    let cube = add(app, Cuboid::default(), turned());
    let mirrored = Transform::from_xyz(1.6, 0.8, 1.0).with_scale(Vec3::new(-1.3, 1.0, 0.8));
    let wedge = add(app, wedge(), mirrored.with_rotation(Quat::from_rotation_y(0.7)));
    add(app, Sphere::new(0.5), Transform::from_xyz(-2.0, 0.5, 1.5));
    add(app, strip(), Transform::from_xyz(-2.5, 1.2, -1.5).with_rotation(Quat::from_rotation_x(0.4)));
    // What no ray can hit.
    add(app, Cuboid::default(), Transform::from_xyz(0.0, 1.0, 2.0).with_scale(Vec3::new(1.0, 0.0, 1.0)));
    add(app, Cuboid::default(), Transform::from_xyz(0.0, 1.0, 2.0).with_scale(Vec3::NAN));
    Scene { cube, wedge }
}

fn set(app: &mut App, entity: Entity, change: impl FnOnce(&mut Transform)) {
    change(&mut app.world_mut().get_mut::<Transform>(entity).expect("it has one"));
}

/// What changes in a scene, one after the other.
const STEPS: [(&str, fn(&mut App, &Scene)); 6] = [
    ("as it was built", |_, _| {}),
    ("moved and turned", |app, scene| {
        set(app, scene.cube, |of| of.translation += Vec3::new(0.7, 0.2, 0.4));
        set(app, scene.wedge, |of| of.rotate_z(-0.9));
    }),
    ("one mirrored, one flat", |app, scene| {
        set(app, scene.cube, |of| of.scale.x = -0.5);
        set(app, scene.wedge, |of| of.scale.y = 0.0);
    }),
    ("one gone, many new", |app, scene| {
        app.world_mut().despawn(scene.wedge);
        let mesh = app.world().get::<Mesh3d>(scene.cube).expect("it has one").clone();
        for i in 0..100 {
            let place = Vec3::new(0.5 * (i % 10) as f32 - 2.0, 0.3 + 0.01 * i as f32, 0.3 * (i / 10) as f32 - 2.0);
            let placed = Transform::from_translation(place).with_scale(Vec3::splat(0.12));
            app.world_mut().spawn((mesh.clone(), placed));
        }
    }),
    ("a mesh replaced", |app, scene| {
        let mesh = app.world().get::<Mesh3d>(scene.cube).expect("it has one").id();
        app.world_mut().resource_mut::<Assets<Mesh>>().insert(mesh, wedge()).expect("it is there");
    }),
    ("lost and found", |app, scene| {
        set(app, scene.cube, |of| of.translation = Vec3::INFINITY);
        settle(app);
        set(app, scene.cube, |of| of.translation = Vec3::new(0.2, 1.5, 0.2));
    }),
];

#[test]
fn pictures_are_the_same_by_ray_queries_and_in_software() {
    let (mut software, Some(mut queried)) = both() else { return };
    let bare = picture(&mut software);
    let scenes = [&mut software, &mut queried].map(build);
    for (name, step) in STEPS {
        let apps = [&mut software, &mut queried].into_iter().zip(&scenes);
        let [ours, theirs] = apps
            .map(|(app, scene)| {
                step(app, scene);
                settle(app);
                (picture(app), report(app))
            })
            .collect::<Vec<_>>()
            .try_into()
            .expect("there are two");
        let rays = [&ours, &theirs].map(|(_, report)| report.shadow_rays);
        assert_eq!(rays, [ShadowRays::Software, ShadowRays::RayQuery].map(Some));
        assert_eq!(ours.1.casters, theirs.1.casters, "{name}");
        let pairs = || ours.0.iter().zip(&theirs.0);
        let different: Vec<_> = (0..PIXELS).zip(pairs()).filter(|(_, (a, b))| a != b).collect();
        assert!(different.len() <= MAX_DIFFERENT, "{name}: {} pixels, as {:?}", different.len(), different[0]);
        let shadowed = ours.0.iter().zip(&bare).filter(|(with, without)| with != without).count();
        assert!(shadowed > 50, "{name}: the scene tells");
        eprintln!("{name}: {} of {PIXELS} pixels differ, {} entities", different.len(), ours.1.casters);
    }
}

#[test]
fn a_still_frame_builds_no_structure_and_a_move_builds_one() {
    let (software, queried) = both();
    for (mut app, has_queries) in [Some((software, false)), queried.map(|app| (app, true))].into_iter().flatten() {
        let cube = add(&mut app, Cuboid::default(), turned());
        start(&mut app);
        settle(&mut app);
        let mut next = |change: &dyn Fn(&mut App)| {
            change(&mut app);
            // Meshes are prepared on other threads.
            let mut built = 0;
            for i in 0.. {
                frame(&mut app);
                built += report(&app).structures;
                if report(&app).waiting_meshes == 0 && i > 3 {
                    break;
                }
            }
            (built, report(&app).bytes)
        };
        let expected = |count| if has_queries { (count, 0) } else { (0, 0) };
        assert_eq!(next(&|_| {}), expected(0), "nothing has changed");
        assert_eq!(next(&|app| set(app, cube, |of| of.translation.x += 0.5)), expected(1), "one has moved");
        assert_eq!(next(&|app| set(app, cube, |of| of.translation.x += 0.0)), expected(0), "to the same place");
        assert_eq!(next(&|app| _ = add(app, Sphere::new(0.1), turned())), expected(2), "a mesh and an entity");
        assert_eq!(next(&|app| _ = app.world_mut().despawn(cube)), expected(1), "one is gone");
    }
}

/// Rays that the pass traces: from points of the floor to the lamp, in a square of this many.
const SIDE: u32 = 32;

#[cfg(not(feature = "wesl"))]
const IMPORTS: &str = "#import girandole::shadows::girandole_sees\n";
#[cfg(feature = "wesl")]
const IMPORTS: &str = "import girandole::shadows::girandole_sees;\n";

/// The kernel of an application. It says `SIDE` and `LAMP` once more.
const KERNEL: &str = "
@group(2) @binding(0) var<storage, read_write> answers: array<u32>;

@compute @workgroup_size(64)
fn trace(@builtin(global_invocation_id) id: vec3<u32>) {
    let place = vec2<f32>(vec2(id.x % 32u, id.x / 32u)) * 0.2 - 3.1;
    let floor = vec3(place.x, 0.0, place.y);
    let way = vec3(-1.0, 4.0, 0.5) - floor;
    answers[id.x] = 1u + u32(girandole_sees(floor, vec3(0.0, 1.0, 0.0), 5.0, normalize(way), length(way)));
}";

/// The pass of the application.
#[derive(Resource)]
struct Kernel(Handle<Shader>);

#[derive(Resource)]
struct Pass {
    pipeline: CachedComputePipelineId,
    layout: BindGroupLayoutDescriptor,
    answers: Buffer,
}

fn nothing() -> BindGroupLayoutDescriptor {
    BindGroupLayoutDescriptor::new("nothing", &[])
}

fn queue_pass(
    (mut commands, device, cache): (Commands, Res<RenderDevice>, Res<PipelineCache>),
    kernel: Res<Kernel>,
    shadows: Res<GirandoleShadows>,
) {
    let mut entries = vec![buffer_entry(0, BufferBindingType::Storage { read_only: false })];
    entries.extend(shadows.layout_entries());
    let layout = BindGroupLayoutDescriptor::new("answers", &entries);
    let pipeline = cache.queue_compute_pipeline(ComputePipelineDescriptor {
        layout: vec![nothing(), nothing(), layout.clone()],
        shader: kernel.0.clone(),
        entry_point: Some("trace".into()),
        ..default()
    });
    let answers = device.create_buffer(&BufferDescriptor {
        label: Some("answers"),
        size: u64::from(4 * SIDE * SIDE),
        usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    });
    commands.insert_resource(Pass { pipeline, layout, answers });
}

fn trace(pass: Res<Pass>, shadows: Res<GirandoleShadows>, cache: Res<PipelineCache>, mut context: RenderContext) {
    let (Some(casters), Some(pipeline)) = (shadows.bindings(), cache.get_compute_pipeline(pass.pipeline)) else {
        return;
    };
    let group = |label, layout: &BindGroupLayoutDescriptor, entries: &[BindGroupEntry]| {
        context.render_device().create_bind_group(label, &cache.get_bind_group_layout(layout), entries)
    };
    let nothing = group("nothing", &nothing(), &[]);
    let mut entries = vec![BindGroupEntry { binding: 0, resource: pass.answers.as_entire_binding() }];
    entries.extend(casters);
    let answers = group("answers", &pass.layout, &entries);
    let mut compute = context.command_encoder().begin_compute_pass(&ComputePassDescriptor::default());
    compute.set_pipeline(pipeline);
    for (group, number) in [&nothing, &nothing, &answers].into_iter().zip(0..) {
        compute.set_bind_group(number, &**group, &[]);
    }
    compute.dispatch_workgroups(SIDE * SIDE / 64, 1, 1);
}

/// What the pass has written: 0 for nothing, 1 for shadow, 2 for light.
fn answers(app: &App) -> Vec<u32> {
    let device = app.world().resource::<RenderDevice>();
    let queue = app.world().resource::<RenderQueue>();
    let written = &app.get_sub_app(RenderApp).expect("it draws").world().resource::<Pass>().answers;
    let (send, receive) = channel();
    let answer =
        move |read: Result<DownloadBuffer, _>| send.send(read.expect("it is read").to_vec()).expect("it waits");
    DownloadBuffer::read_buffer(device.wgpu_device(), queue, &written.slice(..), answer);
    device.poll(PollType::wait_indefinitely()).expect("the device must answer");
    let bytes = receive.recv().expect("it is sent");
    bytes.chunks_exact(4).map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]])).collect()
}

#[test]
fn a_pass_of_the_application_traces_rays() {
    let (software, queried) = both();
    for mut app in [Some(software), queried].into_iter().flatten() {
        add(&mut app, Cuboid::default(), turned());
        #[cfg(not(feature = "wesl"))]
        let shader = Shader::from_wgsl(format!("{IMPORTS}{KERNEL}"), "trace.wgsl");
        #[cfg(feature = "wesl")]
        let shader = Shader::from_wesl(format!("{IMPORTS}{KERNEL}"), "embedded://trace.wesl");
        let kernel = Kernel(app.world_mut().resource_mut::<Assets<Shader>>().add(shader));
        let render_app = app.get_sub_app_mut(RenderApp).expect("it draws");
        render_app
            .insert_resource(kernel)
            .add_systems(RenderGraph, trace.in_set(GirandoleSystems::WriteLights))
            .world_mut()
            .run_system_cached(queue_pass)
            .expect("it runs");
        start(&mut app);
        settle(&mut app);
        let mut counts = [0; 3];
        for (i, answer) in (0..).zip(answers(&app)) {
            let place = Vec2::new((i % SIDE) as f32, (i / SIDE) as f32) * 0.2 - 3.1;
            let floor = Vec3::new(place.x, 0.0, place.y);
            let [least, most] =
                [0.97, 1.03].map(|share| Solid::Cube.is_met(&turned().compute_affine(), floor, LAMP, share));
            counts[answer as usize] += 1;
            assert!(least != most || answer == if most { 1 } else { 2 }, "{floor}: {answer}, dark is {most}");
        }
        assert!(counts[0] == 0 && counts[1] > 20 && counts[2] > 500, "{counts:?}");
    }
}
