//! The GPU samples as the CPU does: the same random numbers give the same lights, to float
//! rounding.

use std::collections::HashMap;
use std::sync::{Arc, LazyLock, Mutex, OnceLock};

use bytemuck::Pod;
use girandole::glam::{DVec3, Mat3, Vec3};
use girandole::gpu::{GpuError, GpuLights};
use girandole::{DirectionalLight, Effects, FrameBudget, Light, LightId, LightWorld, Placement, Policy, ShadingPoint};
use testbed::common::batch::{self, SampleRecord, SampleRequest};

use girandole::LightTree;

use testbed::common::gpu as device;
use testbed::testing::support::{Rng, place_tree};

/// The share of samples that may name another light. Where a random number falls within rounding of
/// the border between two lights, the GPU may choose the other one: WGSL allows division an error
/// of 2.5 ulp, and `pow` far more. A sample takes about ten choices, each with a rounding of 1e-5.
pub(crate) const OTHER_PICKS: f64 = 2.0e-3;

/// Relative difference of probabilities and radiances, which are products of some twenty terms.
/// `pow` is good to 1e-3 only for the narrowest lobes.
const TOLERANCE: f32 = 2.0e-3;

/// Difference at a spot's rim, relative to the light on its axis. An error d in the argument t of
/// the falloff changes its square by 2 t d, which is at most TOLERANCE t^2 + d^2 / TOLERANCE. d is
/// 2e-7 times the slope of the falloff, which is below 70 for the spots of these tests.
const RIM: f32 = 1.0e-7;

pub(crate) type Gpu = (wgpu::Device, wgpu::Queue);

/// The device that the tests share. A GPU test fails without an adapter: it never passes without
/// running.
pub fn gpu() -> Gpu {
    static GPU: OnceLock<Gpu> = OnceLock::new();
    GPU.get_or_init(|| limited_gpu(wgpu::Limits::default().max_storage_buffer_binding_size)).clone()
}

/// A new device that binds storage buffers of at most so many bytes.
pub(crate) fn limited_gpu(bytes: u64) -> Gpu {
    let limits = wgpu::Limits { max_storage_buffer_binding_size: bytes, ..wgpu::Limits::default() };
    let opened =
        device::find_adapter(None).and_then(|adapter| device::open_device(&adapter, wgpu::Features::empty(), limits));
    opened.unwrap_or_else(|e| panic!("no GPU adapter ({e}); run scripts/test.sh, which installs a software one"))
}

pub(crate) fn buffer(device: &wgpu::Device, queue: &wgpu::Queue, content: &[u8]) -> wgpu::Buffer {
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: content.len() as u64,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    });
    queue.write_buffer(&buffer, 0, content);
    buffer
}

pub(crate) fn requests(rng: &mut Rng, count: usize, size: f32) -> Vec<SampleRequest> {
    let request = |_| {
        let shading_point = rng.shading_point(size);
        let u = [rng.unit(), rng.unit(), rng.unit(), rng.unit()];
        SampleRequest {
            position: shading_point.position.to_array(),
            normal: shading_point.normal.to_array(),
            u,
            ..SampleRequest::default()
        }
    };
    (0..count).map(request).collect()
}

/// A position and random numbers, as `struct Question { position: vec3<f32>, padding: f32, u: vec4<f32> }`
/// in WGSL.
pub(crate) fn question_at(position: Vec3, rng: &mut Rng) -> [[f32; 4]; 2] {
    [position.extend(0.0).to_array(), [rng.unit(), rng.unit(), rng.unit(), rng.unit()]]
}

pub(crate) fn shading_point(request: &SampleRequest) -> ShadingPoint {
    ShadingPoint::surface(request.position.into(), request.normal.into())
}

/// Uploads, builds the top level, and samples on the GPU.
pub(crate) fn sample(lights: &mut GpuLights, world: &mut LightWorld, requests: &[SampleRequest]) -> Vec<SampleRecord> {
    lights.upload(world).expect("room enough");
    sample_again(&gpu(), lights, requests)
}

/// A view of no world, on the shared device.
pub(crate) fn gpu_lights() -> GpuLights {
    let (device, queue) = gpu();
    GpuLights::new(&device, &queue).expect("default limits are enough")
}

/// A view of a world.
pub(crate) fn uploaded(world: &LightWorld) -> GpuLights {
    let mut lights = gpu_lights();
    lights.upload(world).expect("room enough");
    lights
}

/// Samples the lights of the last upload.
fn sample_again(gpu: &Gpu, lights: &mut GpuLights, requests: &[SampleRequest]) -> Vec<SampleRecord> {
    let shader = lights.shader(0, lights.effects());
    let pipeline = batch::pipeline(&gpu.0, &shader.join(batch::STAGE), &shader.layout);
    answers(gpu, &pipeline, lights, requests)
}

/// The answers of a pipeline of [`batch`] to questions, after a build of the top level if that is due.
pub(crate) fn answers<Q: Pod, A: Pod>(
    gpu: &Gpu,
    pipeline: &wgpu::ComputePipeline,
    lights: &mut GpuLights,
    questions: &[Q],
) -> Vec<A> {
    let mut encoder = gpu.0.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    lights.build_top(&mut encoder);
    answers_after(encoder, gpu, pipeline, lights, questions)
}

pub(crate) fn answers_after<Q: Pod, A: Pod>(
    mut encoder: wgpu::CommandEncoder,
    (device, queue): &Gpu,
    pipeline: &wgpu::ComputePipeline,
    lights: &GpuLights,
    questions: &[Q],
) -> Vec<A> {
    let input = buffer(device, queue, bytemuck::cast_slice(questions));
    let output = buffer(device, queue, &vec![0; questions.len() * size_of::<A>()]);
    let count = questions.len() as u32;
    batch::record(device, &mut encoder, pipeline, lights.bind_group(), [&input, &output], count);
    queue.submit([encoder.finish()]);
    device::read(device, queue, &output).expect("the device works and the buffer maps")
}

/// The answers of a text with a function `answer`: see [`asker`].
pub(crate) fn ask<Q: Pod, A: Pod>(lights: &mut GpuLights, effects: Effects, text: &str, questions: &[Q]) -> Vec<A> {
    let pipeline = asker(&gpu(), lights, effects, text);
    answers(&gpu(), &pipeline, lights, questions)
}

/// A pipeline that calls `fn answer(q: Question) -> Answer` of an engine's text for each question.
pub(crate) fn asker(gpu: &Gpu, lights: &GpuLights, effects: Effects, text: &str) -> wgpu::ComputePipeline {
    let signature = text.split_once("fn answer(q: ").and_then(|(_, rest)| rest.split_once(" {")).expect("`answer`").0;
    let (question, answer) = signature.split_once(") -> ").expect("a question and an answer");
    let stage = format!(
        "@group(1) @binding(0) var<storage, read> questions: array<{question}>;
        @group(1) @binding(1) var<storage, read_write> answers: array<{answer}>;
        @compute @workgroup_size(64) fn batch(@builtin(global_invocation_id) id: vec3<u32>) {{
            if id.x >= arrayLength(&questions) {{ return; }}
            answers[id.x] = answer(questions[id.x]);
        }}"
    );
    let shader = lights.shader(0, effects);
    batch::pipeline(&gpu.0, &shader.join(&(text.to_owned() + &stage)), &shader.layout)
}

/// Samples the lights of the last upload with a pipeline for these effects, which is compiled once for all
/// tests.
pub(crate) fn sample_by(effects: Effects, lights: &mut GpuLights, requests: &[SampleRequest]) -> Vec<SampleRecord> {
    sample_with(batch::STAGE, effects, lights, requests)
}

/// [`sample_by`] with another text of the stage.
fn sample_with(
    stage: &'static str,
    effects: Effects,
    lights: &mut GpuLights,
    requests: &[SampleRequest],
) -> Vec<SampleRecord> {
    type Pipelines = HashMap<(&'static str, Effects), Arc<OnceLock<wgpu::ComputePipeline>>>;
    static PIPELINES: LazyLock<Mutex<Pipelines>> = LazyLock::new(Mutex::default);
    let (device, _) = gpu();
    let place = PIPELINES.lock().expect("no panic before").entry((stage, effects)).or_default().clone();
    let shader = lights.shader(0, effects);
    let pipeline = place.get_or_init(|| batch::pipeline(&device, &shader.join(stage), &shader.layout));
    answers(&gpu(), pipeline, lights, requests)
}

pub(crate) fn close(a: f32, b: f32) -> bool {
    (a - b).abs() <= TOLERANCE * a.abs().max(b.abs()).max(1.0e-20)
}

/// The numbers by which shaders name a light: the slot of its instance and its index, `u32::MAX` and its place for a
/// directional light.
pub(crate) fn name_of(world: &LightWorld, light: LightId) -> [u32; 2] {
    match light {
        LightId::Local { instance, light } => [world.slot(instance).expect("it lives"), light],
        LightId::Directional(key) => {
            [u32::MAX, world.directionals().position(|other| other == key).expect("it lives") as u32]
        }
        _ => unreachable!("this version has no others"),
    }
}

/// The light that a shader names.
pub(crate) fn named(world: &LightWorld, instance: u32, light: u32) -> LightId {
    match instance {
        u32::MAX => LightId::Directional(world.directionals().nth(light as usize).expect("a live light")),
        slot => LightId::Local { instance: world.instance_at(slot).expect("a live slot"), light },
    }
}

/// The length of a light's emission.
fn emission(world: &LightWorld, light: LightId) -> f32 {
    match light {
        LightId::Directional(key) => world.directional(key).map_or(0.0, |light| light.illuminance.length()),
        LightId::Local { instance, light } => {
            let tree = world.instance(instance).and_then(|i| world.tree(i.tree));
            let factor = world.instance(instance).map_or(Vec3::ONE, |i| i.appearance.factor);
            tree.map_or(0.0, |tree| (tree.lights()[light as usize].emission * factor).length())
        }
        _ => unreachable!("this version has no others"),
    }
}

/// How many of the GPU's samples name another light than the CPU's. Samples that name the same
/// light must agree in every field.
pub(crate) fn compare(world: &LightWorld, requests: &[SampleRequest], records: &[SampleRecord]) -> usize {
    // No cell is built in these tests.
    let sampler = world.sampler().from_roots();
    let mut mismatches = 0;
    for (request, record) in requests.iter().zip(records) {
        let shading_point = shading_point(request);
        let twin = sampler.sample(&shading_point, request.u);
        let named = (record.pmf > 0.0).then(|| named(world, record.instance, record.light));
        match (named, twin) {
            (None, None) => {}
            (Some(light), Some(twin)) if light == twin.light => {
                assert!(close(record.pmf, twin.pmf), "{record:?} {twin:?}");
                assert!(close(record.pdf, twin.incident.pdf), "{record:?} {twin:?} {request:?}");
                let radiance = Vec3::from(record.radiance);
                let difference = (radiance - twin.incident.radiance).length();
                // At a spot's rim the falloff is the small difference of two cosines, so the error
                // is relative to the light on its axis.
                let peak = if twin.incident.is_delta { emission(world, light) / record.dist.powi(2) } else { 0.0 };
                assert!(difference <= TOLERANCE * radiance.length() + RIM * peak, "{record:?} {twin:?}");
                let turn = (Vec3::from(record.direction) - twin.incident.direction).length();
                assert!(turn < TOLERANCE, "{record:?} {twin:?}");
                assert_eq!(record.is_delta == 1, twin.incident.is_delta);
            }
            _ => mismatches += 1,
        }
    }
    mismatches
}

#[test]
fn the_gpu_chooses_the_same_lights_with_the_same_probabilities() {
    for (seed, trees, count, instances) in [(40, 6, 60, 5), (41, 1, 1, 1), (42, 1, 300, 9), (43, 90, 3, 2)] {
        let mut rng = Rng(seed);
        let mut world = rng.varied_world(trees, count, instances, 30.0);
        let mut lights = gpu_lights();
        let requests = requests(&mut rng, 4096, 40.0);
        for has_directionals in [true, false] {
            if !has_directionals {
                let keys: Vec<_> = world.directionals().collect();
                keys.into_iter().for_each(|key| world.remove_directional(key).expect("a live key"));
            }
            let records = sample(&mut lights, &mut world, &requests);
            let mismatches = compare(&world, &requests, &records);
            assert!(mismatches as f64 <= OTHER_PICKS * 4096.0, "seed {seed}: {mismatches} of 4096 name another light");
            let count = records.iter().filter(|r| r.pmf > 0.0).count();
            assert!(count > 200, "seed {seed}: only {count} samples have a light");
        }
    }
}

#[test]
fn numbers_outside_the_unit_interval_choose_alike_on_both_sides() {
    let mut rng = Rng(48);
    let mut world = rng.varied_world(6, 60, 5, 30.0);
    let mut lights = gpu_lights();
    let mut requests = requests(&mut rng, 2048, 40.0);
    for (i, request) in requests.iter_mut().enumerate() {
        let outside = [-0.0, -1.0, 1.0, 7.5, f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
        request.u[i % 4] = outside[i / 4 % 8];
    }
    for by_solid_angle in [false, true] {
        world.set_solid_angle_sampling(by_solid_angle);
        let records = sample(&mut lights, &mut world, &requests);
        let mismatches = compare(&world, &requests, &records);
        // A number that is clamped to an end lies at the border of the first or the last child, whose share may be
        // within rounding: so many more than of random numbers name another light.
        assert!(mismatches <= 2048 / 100, "{mismatches} of 2048");
    }
}

/// Llvmpipe of Mesa 26.1.6 runs short branches that no invocation of a vector takes, and then reads the
/// descriptors that the first one loaded: none, if that one has returned before. It crashed wherever the
/// library's loop over a cut was the first to load descriptors of the bind group.
#[test]
fn a_shader_may_choose_lights_where_some_invocations_have_returned() {
    const EARLY: &str = concat!(
        include_str!("../../examples/testbed/src/common/request.wgsl"),
        "
        @group(1) @binding(0) var<storage, read> requests: array<Request>;
        @group(1) @binding(1) var<storage, read_write> samples: array<LightSample>;
        @compute @workgroup_size(64) fn batch(@builtin(global_invocation_id) id: vec3<u32>) {
            if id.x >= arrayLength(&requests) || id.x % 8u < 3u {
                return;
            }
            let request = requests[id.x];
            samples[id.x] = light_sample(light_surface_point(request.position, request.normal), request.u);
        }"
    );
    let mut rng = Rng(47);
    let world = rng.varied_world(20, 60, 5, 30.0);
    let mut lights = uploaded(&world);
    let requests = requests(&mut rng, 512, 40.0);
    let effects = lights.effects();
    let all = sample_by(effects, &mut lights, &requests);
    let some = sample_with(EARLY, effects, &mut lights, &requests);
    for (index, (all, some)) in all.iter().zip(&some).enumerate() {
        assert!(if index % 8 < 3 { some.pmf == 0.0 } else { some == all }, "{index}: {some:?} {all:?}");
    }
    assert!(some.iter().filter(|sample| sample.pmf > 0.0).count() > 100);
}

#[test]
fn an_empty_world_gives_no_light_and_no_error() {
    let mut rng = Rng(44);
    let mut world = LightWorld::new();
    let mut lights = gpu_lights();
    let requests = requests(&mut rng, 64, 10.0);
    assert!(sample(&mut lights, &mut world, &requests).iter().all(|r| r.pmf == 0.0));
    // A tree without lights, a dark tree, and an instance that is removed.
    let empty = world.add_tree(LightTree::new(vec![]).expect("fine"));
    let dark = world.add_tree(LightTree::new(vec![Light::point(Vec3::ZERO, Vec3::ZERO)]).expect("fine"));
    for tree in [empty, dark] {
        world.add_instance(tree, Placement::IDENTITY, Policy::Static).expect("valid");
    }
    let (_, removed) = place_tree(&mut world, rng.lights(5, 5.0), Placement::IDENTITY, Policy::Static);
    assert!(sample(&mut lights, &mut world, &requests).iter().any(|r| r.pmf > 0.0));
    world.remove_instance(removed).expect("it lives");
    assert!(sample(&mut lights, &mut world, &requests).iter().all(|r| r.pmf == 0.0));
    // Nothing but a sun.
    let sun = DirectionalLight { direction: Vec3::NEG_Y, illuminance: Vec3::ONE };
    world.add_directional(sun).expect("valid");
    let records = sample(&mut lights, &mut world, &requests);
    assert!(compare(&world, &requests, &records) == 0 && records.iter().any(|r| r.pmf > 0.0));
}

#[test]
fn a_world_that_changes_and_grows_is_sampled_alike_on_both_sides() {
    let mut rng = Rng(45);
    let mut world = rng.varied_world(3, 30, 4, 20.0);
    let mut lights = gpu_lights();
    let requests = requests(&mut rng, 2048, 25.0);
    for round in 0..6 {
        let records = sample(&mut lights, &mut world, &requests);
        let mismatches = compare(&world, &requests, &records);
        assert!(
            mismatches as f64 <= OTHER_PICKS * 2048.0 + 1.0,
            "round {round}: {mismatches} of 2048 name another light"
        );
        // Grows past the first buffers, and edits, moves and removes.
        let tree = world.add_tree(LightTree::new(rng.lights(200, 3.0)).expect("valid"));
        for _ in 0..20 {
            world.add_instance(tree, rng.affine(20.0), Policy::AlwaysRebuild).expect("valid");
        }
        let instances: Vec<_> = world.instances().collect();
        world.move_instance(instances[round], rng.affine(20.0)).expect("valid");
        let hidden = Placement { linear: Mat3::ZERO, ..Placement::IDENTITY };
        world.move_instance(instances[round + 3], hidden).expect("zero hides");
        world.remove_instance(instances[instances.len() / 2]).expect("it lives");
        world.set_lights(tree, &[(7, rng.light(3.0)), (99, rng.light(3.0))]).expect("valid");
        world
            .replace_lights(world.instance(instances[1]).expect("it lives").tree, rng.lights(10 + round, 5.0))
            .expect("valid");
        world.set_origin_near(DVec3::splat(1000.0 * round as f64)).expect("near");
        world.update(FrameBudget::UNLIMITED);
    }
}

#[test]
fn an_upload_that_does_not_fit_leaves_the_last_one_in_place() {
    let limited = limited_gpu(1 << 20);
    let mut rng = Rng(52);
    let mut world = LightWorld::new();
    for _ in 0..750 {
        // Trees of 16 lights have no stand-ins.
        let points = (0..16).map(|_| Light::point(rng.position(5.0), Vec3::ONE)).collect();
        place_tree(&mut world, points, Placement::IDENTITY, Policy::Static);
    }
    let mut lights = GpuLights::new(&limited.0, &limited.1).expect("such limits are enough");
    lights.upload(&world).expect("room enough");
    let requests = requests(&mut rng, 512, 10.0);
    let before = sample_again(&limited, &mut lights, &requests);
    // At 64 bytes each, 12,000 lights fit into a mebibyte, and 18,000 do not.
    let mut spot = |_| Light::spot(rng.position(5.0), Vec3::NEG_Y, 0.1, 0.4, Vec3::ONE);
    let mut add = |_| world.add_tree(LightTree::new((0..16).map(&mut spot).collect()).expect("valid"));
    let spots: Vec<_> = (0..375).map(&mut add).collect();
    let instance = world.add_instance(spots[0], Placement::IDENTITY, Policy::Static).expect("valid");
    let refused = lights.upload(&world).err();
    assert!(matches!(refused, Some(GpuError::Full { what: "lights", .. })), "{refused:?}");
    assert_eq!(sample_again(&limited, &mut lights, &requests), before);
    world.remove_instance(instance).expect("it lives");
    spots.into_iter().for_each(|tree| world.remove_tree(tree).expect("unused"));
    lights.upload(&world).expect("room enough again");
    assert_eq!(sample_again(&limited, &mut lights, &requests), before);
}
