//! The heat map: what it shows of worlds whose noise is known.

use glam::{DVec3, Vec3};

use crate::effects::Effects;
use crate::gpu::HeatMap;
use crate::gpu::bindings::{bind, storage_entry};
use crate::gpu::testing::{compute_pipeline, gpu, gpu_lights, read};
use crate::instance::placement::Placement;
use crate::light::Light;
use crate::policy::Policy;
use crate::tree::LightTree;
use crate::world::LightWorld;

/// Shading points at the origin, of which the first looks up. What is shown is the third number.
const ENGINE: &str = "
    @group(0) @binding(0) var<storage, read_write> colors: array<vec4<f32>>;
    @compute @workgroup_size(64) fn heat(@builtin(global_invocation_id) id: vec3<u32>) {
        let normal = vec3(0.0, select(-1.0, 1.0, id.y == 0u), 0.0);
        let at = light_surface_point(vec3(0.0), normal);
        colors[64u * (4u * id.y + id.z) + id.x] = vec4(light_heat_map(at, id.z, id.x), 0.0);
    }";

/// The colours for 64 seeds, by what they show: of a point that looks up at lamps, and of one that looks down.
fn colors(lamps: Vec<Light>) -> [[Vec<Vec3>; 4]; 2] {
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(lamps).expect("sound lights"));
    world.add_instance(tree, Placement::at(DVec3::new(0.0, 4.0, 0.0)), Policy::default()).expect("a sound placement");
    let (device, queue) = gpu();
    let mut lights = gpu_lights();
    lights.upload(&world).expect("there is room");
    let own = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: None,
        entries: &[storage_entry(0, false)],
    });
    let shader = lights.shader(1, Effects::empty()).with_heat_map();
    let pipeline = compute_pipeline(shader.join(ENGINE), "heat", [&own, &shader.layout]);
    let output = device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: 16 * 64 * 8,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    });
    let group = bind(&device, "test", &own, &[&output]);
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    lights.build_top(&mut encoder);
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
    pass.set_pipeline(&pipeline);
    pass.set_bind_group(0, &group, &[]);
    pass.set_bind_group(1, lights.bind_group(), &[]);
    pass.dispatch_workgroups(1, 2, 4);
    drop(pass);
    queue.submit([encoder.finish()]);
    let colors: Vec<[f32; 4]> = read(&device, &queue, &output);
    let of = |side: usize, shown: HeatMap| {
        let first = 64 * (4 * side + shown.number() as usize);
        colors[first..first + 64].iter().map(|[x, y, z, _]| Vec3::new(*x, *y, *z)).collect()
    };
    let all = [HeatMap::Noise, HeatMap::Cuts, HeatMap::Misses, HeatMap::Lights];
    [0, 1].map(|side| all.map(|shown| of(side, shown)))
}

/// The colours of 0 and of 1.
const LEAST: Vec3 = Vec3::new(0.02, 0.02, 0.25);
const MOST: Vec3 = Vec3::new(1.0, 0.9, 0.2);

fn is_all(colors: &[Vec3], color: Vec3) -> bool {
    colors.iter().all(|of| of.distance(color) < 1e-5)
}

#[test]
fn a_single_light_has_no_noise_above_and_is_missed_below() {
    let [above, below] = colors(vec![Light::point(Vec3::ZERO, Vec3::ONE)]);
    let [noise, _, misses, lights] = &above;
    assert!(is_all(noise, LEAST), "{noise:?}");
    assert!(is_all(misses, LEAST), "{misses:?}");
    assert!(is_all(lights, lights[0]) && lights[0].min_element() >= 0.1, "{lights:?}");
    let [noise, _, misses, lights] = &below;
    assert!(is_all(noise, Vec3::ZERO) && is_all(lights, Vec3::ZERO), "nothing arrives");
    assert!(is_all(misses, MOST), "{misses:?}");
}

#[test]
fn many_lights_have_noise_and_many_colors() {
    let lamp = |i: u32| {
        let (x, z) = ((i % 40) as f32 - 20.0, (i / 40) as f32 - 20.0);
        Light::point(Vec3::new(4.0 * x, 0.1 * (i % 7) as f32, 4.0 * z), Vec3::splat(1.0 + (i % 5) as f32))
    };
    let [[noise, cuts, misses, lights], _] = colors((0..1600).map(lamp).collect());
    assert!(noise.iter().all(|color| color.y > LEAST.y + 0.01 && color.y < MOST.y), "{noise:?}");
    assert!(is_all(&cuts, Vec3::ZERO), "no cell has a cut");
    assert!(is_all(&misses, LEAST), "{misses:?}");
    let mut distinct: Vec<_> = lights.iter().map(|color| color.to_array().map(f32::to_bits)).collect();
    distinct.sort_unstable();
    distinct.dedup();
    assert!(distinct.len() > 16, "{}", distinct.len());
}
