//! The kernels of a [`Festival`]: they write its lights, and draw its sparks.

use super::records::FrameUniform;
use super::scene::festival::dancer::BONES;
use super::scene::festival::{Festival, fire};
use bytemuck::{Pod, Zeroable};
use girandole::LightWorld;
use girandole::glam::{Vec3, Vec4};
use girandole::gpu::GpuLights;
use girandole::wgpu::{self, util::DeviceExt};

/// Steps of the sparks before the first frame, after which all that were born at first have died.
const WARM_UP: u32 = 144;
/// Invocations in a workgroup.
const LANES: u32 = 64;

/// `Step` in `sparks.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Step {
    sparks: u32,
    suit: u32,
    count: u32,
    before: u32,
}

/// `Spark` in `sparks.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Spark {
    position: Vec3,
    age: f32,
    intensity: Vec3,
    life: f32,
    births: u32,
    padding: [u32; 3],
}

/// `Lamp` in `suit.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct LampRecord {
    a: Vec3,
    bone: u32,
    b: Vec4,
    c: Vec4,
    radiance: Vec4,
}

/// `Bone` in `suit.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct BoneRecord {
    rows: [Vec4; 3],
    glow: [f32; 4],
}

/// `View` in `splats.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct View {
    eye: Vec3,
    width: u32,
    right: Vec3,
    height: u32,
    up: Vec3,
    row_begin: u32,
    forward: Vec3,
    row_end: u32,
    samples: f32,
    first_half: f32,
    white: f32,
    padding: u32,
}

/// The kernels of a festival, and what they work on.
pub struct FestivalKernels {
    step: wgpu::Buffer,
    bones: wgpu::Buffer,
    sparks: wgpu::Buffer,
    view: wgpu::Buffer,
    work: wgpu::BindGroup,
    move_sparks: wgpu::ComputePipeline,
    move_lamps: wgpu::ComputePipeline,
    lamp_count: u32,
    drawing: wgpu::BindGroupLayout,
    splat: wgpu::ComputePipeline,
    add_splats: wgpu::ComputePipeline,
    /// The steps that the sparks have taken; `None` before the first frame.
    steps: Option<u32>,
}

/// The constants that shaders share with the scene.
fn constants() -> String {
    let [shortest, longest] = fire::LIFE;
    let [height, radius] = fire::BIRTH;
    [
        ("STEP", fire::STEP),
        ("SHORTEST_LIFE", shortest),
        ("LONGEST_LIFE", longest),
        ("FIRE_HEIGHT", height),
        ("FIRE_RADIUS", radius),
        ("SPARK_BRIGHTNESS", fire::BRIGHTNESS),
        ("SHOWN", fire::SHOWN),
    ]
    .map(|(name, value)| format!("const {name}: f32 = {value:e};\n"))
    .concat()
}

/// A layout of buffers for compute stages.
fn layout(device: &wgpu::Device, types: &[wgpu::BufferBindingType]) -> wgpu::BindGroupLayout {
    let entry = |(binding, ty): (u32, &wgpu::BufferBindingType)| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer { ty: *ty, has_dynamic_offset: false, min_binding_size: None },
        count: None,
    };
    let entries: Vec<_> = (0..).zip(types).map(entry).collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("festival"), entries: &entries })
}

fn bind(device: &wgpu::Device, layout: &wgpu::BindGroupLayout, buffers: &[&wgpu::Buffer]) -> wgpu::BindGroup {
    let entries: Vec<_> = (0..)
        .zip(buffers)
        .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
        .collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some("festival"), layout, entries: &entries })
}

/// Compiles the entry points of a text.
fn pipelines<const N: usize>(
    device: &wgpu::Device,
    text: String,
    groups: &[Option<&wgpu::BindGroupLayout>],
    entries: [&str; N],
) -> [wgpu::ComputePipeline; N] {
    let source = wgpu::ShaderSource::Wgsl(text.into());
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some("festival"), source });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("festival"),
        bind_group_layouts: groups,
        ..Default::default()
    });
    entries.map(|entry| {
        device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(entry),
            layout: Some(&layout),
            module: &module,
            entry_point: Some(entry),
            compilation_options: Default::default(),
            cache: None,
        })
    })
}

impl FestivalKernels {
    /// Compiles the kernels, and uploads the lamps of the suit.
    pub fn new(device: &wgpu::Device, lights: &GpuLights, festival: &Festival) -> Self {
        use wgpu::BufferBindingType::{Storage, Uniform};
        use wgpu::BufferUsages as Usage;
        let empty = |size: usize, usage| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("festival"),
                size: size as u64,
                usage: usage | Usage::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let record = |lamp: &super::scene::festival::dancer::Lamp| {
            let [a, b, c] = lamp.vertices;
            let [b, c, radiance] = [b, c, lamp.radiance].map(|v| v.extend(0.0));
            LampRecord { a, bone: lamp.bone, b, c, radiance }
        };
        let records: Vec<LampRecord> = festival.lamps.iter().map(record).collect();
        let lamps = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("festival"),
            contents: bytemuck::cast_slice(&records),
            usage: Usage::STORAGE,
        });
        let step = empty(size_of::<Step>(), Usage::UNIFORM);
        let bones = empty(BONES * size_of::<BoneRecord>(), Usage::STORAGE);
        // Zeros: no spark was born yet.
        let sparks = empty(fire::SPARKS as usize * size_of::<Spark>(), Usage::STORAGE | Usage::COPY_SRC);
        let [read, write] = [true, false].map(|read_only| Storage { read_only });
        let own = layout(device, &[Uniform, write, read, read]);
        let work = bind(device, &own, &[&step, &sparks, &lamps, &bones]);
        let text = lights.source_shader(1) + &constants() + include_str!("sparks.wgsl") + include_str!("suit.wgsl");
        let groups = [Some(&own), Some(lights.source_layout())];
        let [move_sparks, move_lamps] = pipelines(device, text, &groups, ["move_sparks", "move_lamps"]);
        let drawing = layout(device, &[Uniform, read, write, write]);
        let text = constants() + include_str!("splats.wgsl");
        let [splat, add_splats] = pipelines(device, text, &[Some(&drawing)], ["splat", "add_splats"]);
        Self {
            step,
            bones,
            sparks,
            view: empty(size_of::<View>(), Usage::UNIFORM),
            work,
            move_sparks,
            move_lamps,
            lamp_count: records.len() as u32,
            drawing,
            splat,
            add_splats,
            steps: None,
        }
    }

    /// Records the kernels that move the lights to where they are now: after an upload, and before the top
    /// level is built.
    pub fn record(
        &mut self,
        queue: &wgpu::Queue,
        encoder: &mut wgpu::CommandEncoder,
        lights: &mut GpuLights,
        world: &LightWorld,
        festival: &Festival,
    ) {
        let number = |tree| world.light_source(tree).map(|(_, number)| number);
        let (Some(sparks), Some(suit)) = (number(festival.sparks), number(festival.suit)) else { return };
        let Some(group) = lights.source_group() else { return };
        // The first frame shows a fire that has burnt for a while.
        let now = festival.steps.saturating_add(WARM_UP);
        let count = now.saturating_sub(self.steps.unwrap_or_default()).min(WARM_UP);
        self.steps = Some(now);
        let step = Step { sparks, suit, count, before: now - count };
        queue.write_buffer(&self.step, 0, bytemuck::bytes_of(&step));
        let records: [BoneRecord; BONES] = std::array::from_fn(|bone| {
            let transform = festival.pose.bones[bone];
            let matrix = transform.matrix3.transpose();
            let rows = [
                Vec3::from(matrix.x_axis).extend(transform.translation.x),
                Vec3::from(matrix.y_axis).extend(transform.translation.y),
                Vec3::from(matrix.z_axis).extend(transform.translation.z),
            ];
            BoneRecord { rows, glow: [festival.pose.glow[bone]; 4] }
        });
        queue.write_buffer(&self.bones, 0, bytemuck::bytes_of(&records));
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_bind_group(0, &self.work, &[]);
        pass.set_bind_group(1, group, &[]);
        pass.set_pipeline(&self.move_sparks);
        pass.dispatch_workgroups(fire::SPARKS.div_ceil(LANES), 1, 1);
        pass.set_pipeline(&self.move_lamps);
        pass.dispatch_workgroups(self.lamp_count.div_ceil(LANES), 1, 1);
    }

    /// Draws the sparks over a band whose samples are summed up in `image`. `frame` is that of its last
    /// dispatch.
    pub fn draw(
        &self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        image: &wgpu::Buffer,
        frame: &FrameUniform,
        festival: &Festival,
    ) {
        let view = View {
            eye: frame.eye - festival.base,
            width: frame.width,
            right: frame.right,
            height: frame.height,
            up: frame.up,
            row_begin: frame.row_begin,
            forward: frame.forward,
            row_end: frame.row_end,
            samples: frame.sample_end as f32,
            first_half: frame.first_half as f32,
            white: frame.white,
            padding: 0,
        };
        queue.write_buffer(&self.view, 0, bytemuck::bytes_of(&view));
        let pixels = frame.width * (frame.row_end - frame.row_begin);
        let splats = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("festival splats"),
            size: 12 * u64::from(pixels),
            usage: wgpu::BufferUsages::STORAGE,
            mapped_at_creation: false,
        });
        let group = bind(device, &self.drawing, &[&self.view, &self.sparks, &splats, image]);
        let mut encoder = device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_bind_group(0, &group, &[]);
            pass.set_pipeline(&self.splat);
            pass.dispatch_workgroups(fire::SPARKS.div_ceil(LANES), 1, 1);
            pass.set_pipeline(&self.add_splats);
            pass.dispatch_workgroups(pixels.div_ceil(LANES), 1, 1);
        }
        queue.submit([encoder.finish()]);
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::backend::{self, Backend, BackendChoice, Gpu};
    use super::super::geometry::Geometry;
    use super::super::records::PictureOptions;
    use super::super::scene::assembly::Assembly;
    use super::super::scene::{Camera, Stage, Still, festival};
    use super::*;
    use crate::common::gpu::{read, wait};
    use girandole::FrameBudget;

    /// A festival without a city, on a device.
    struct Fixture {
        gpu: Box<Gpu>,
        stage: Stage,
        lights: GpuLights,
        kernels: FestivalKernels,
    }

    impl Fixture {
        fn new() -> Self {
            let Ok(Backend::Gpu(gpu)) = backend::choose(BackendChoice::Gpu).map(|chosen| chosen.backend) else {
                panic!("tests have an adapter");
            };
            let Assembly { scene, mut world } = Assembly::new();
            world.set_glossy_sampling(true);
            let stage = Stage { scene, world, animation: Box::new(Still) };
            let stage = festival::celebrate(stage).expect("a valid scene");
            let lights = GpuLights::new(&gpu.device, &gpu.queue).expect("a device for lights");
            let kernels = FestivalKernels::new(&gpu.device, &lights, stage.scene.festival.as_ref().expect("one"));
            Self { gpu, stage, lights, kernels }
        }

        /// The frame at a step, and the sparks in it.
        fn frame(&mut self, step: u32) -> Vec<Spark> {
            let Self { gpu, stage: Stage { scene, world, animation }, lights, kernels } = self;
            animation.advance(f64::from(step) * f64::from(fire::STEP), scene, world).expect("a frame");
            lights.follow_sources(world);
            world.update(FrameBudget::UNLIMITED);
            lights.upload(world).expect("room");
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            let festival = scene.festival.as_ref().expect("one");
            assert_eq!(festival.steps, step);
            kernels.record(&gpu.queue, &mut encoder, lights, world, festival);
            lights.build_top(&mut encoder);
            gpu.queue.submit([encoder.finish()]);
            wait(&gpu.device).expect("a device that answers");
            read(&gpu.device, &gpu.queue, &kernels.sparks).expect("sparks")
        }
    }

    #[test]
    fn sparks_stay_within_reach_while_two_in_a_hundred_die_and_are_born_in_a_step() {
        let mut fixture = Fixture::new();
        let mut last = fixture.frame(0);
        for step in 1..=12 {
            let sparks = fixture.frame(step);
            let share = |count: usize| count as f32 / fire::SPARKS as f32;
            let born = share(sparks.iter().zip(&last).filter(|(now, then)| now.births != then.births).count());
            let dead = share(sparks.iter().filter(|spark| spark.intensity == Vec3::ZERO).count());
            assert!((0.017..0.023).contains(&born) && (0.017..0.023).contains(&dead), "{step}: {born} {dead}");
            for spark in sparks.iter().filter(|spark| spark.age < spark.life) {
                let (out, up) = (spark.position.with_y(0.0).length(), spark.position.y);
                assert!(out < fire::REACH[0] && up > 0.0 && up < fire::REACH[1], "{spark:?}");
                let Vec3 { x: red, y: green, z: blue } = spark.intensity;
                assert!(red >= green && green >= blue && blue >= 0.0 && red < 10.0 * fire::BRIGHTNESS, "{spark:?}");
            }
            last = sparks;
        }
        let Stage { scene, world, .. } = &fixture.stage;
        let festival = scene.festival.as_ref().expect("one");
        assert_eq!([festival.sparks, festival.suit].map(|tree| world.refused_writes(tree)), [0, 0]);
    }

    #[test]
    fn the_lamps_that_the_gpu_writes_are_those_that_are_drawn() {
        let mut fixture = Fixture::new();
        let steps = || (0..12).map(|frame| 4 * frame);
        steps().for_each(|step| drop(fixture.frame(step)));
        // The measures of the GPU have made the world ask for the lights of some frame, and rebuild the tree.
        let Stage { scene, world, .. } = &fixture.stage;
        let festival = scene.festival.as_ref().expect("one");
        let known = world.tree(festival.suit).expect("live").lights();
        let differs = |step: u32| {
            let pose = festival::dancer::pose(f64::from(step) * f64::from(fire::STEP));
            let lights = festival::dancer::lights(&festival.lamps, &pose);
            let distance = |(a, b): (&girandole::Light, &girandole::Light)| {
                (a.aabb().min - b.aabb().min).length() + (a.emission - b.emission).length() * 1.0e-3
            };
            known.iter().zip(&lights).map(distance).fold(0.0, f32::max)
        };
        let nearest = steps().min_by(|a, b| differs(*a).total_cmp(&differs(*b))).expect("frames");
        assert!(nearest > 0 && differs(nearest) < 1.0e-3, "{nearest}: {}", differs(nearest));
    }

    #[test]
    fn the_picture_of_all_sparks_has_their_light_and_nothing_of_hidden_ones() {
        let mut fixture = Fixture::new();
        let sparks = fixture.frame(0);
        let Fixture { gpu, stage: Stage { scene, .. }, kernels, .. } = &mut fixture;
        let festival = scene.festival.clone().expect("one");
        let middle = festival.base + Vec3::Y * 4.0;
        scene.camera = Camera { eye: middle + Vec3::Z * 300.0, target: middle, vertical_fov: 0.06, up: Vec3::Y };
        scene.exposure = 10.0;
        let options = PictureOptions { size: [90, 70], spp: 4, candidates: 1, seed: 1 };
        let geometry = Geometry::new(scene).expect("a valid scene");
        // The picture is a band and the rest.
        let frame = FrameUniform {
            row_begin: 10,
            row_end: 70,
            sample_end: 4,
            ..FrameUniform::new(scene, &geometry, 0, &options)
        };
        let band = 90 * 60;
        let sums = [3.0e38, 1.0].map(|dist| {
            let pixels = [vec![Vec4::ZERO; band], vec![Vec4::Z * dist; band]].concat();
            let image = gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: None,
                contents: bytemuck::cast_slice(&pixels),
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
            });
            kernels.draw(&gpu.device, &gpu.queue, &image, &frame, &festival);
            let pixels: Vec<Vec4> = read(&gpu.device, &gpu.queue, &image).expect("a picture");
            pixels[..band].iter().sum::<Vec4>()
        });
        let area = 4.0 * frame.right.length() * frame.up.length() / (90.0 * 70.0);
        let expected =
            sparks.iter().map(|spark| spark.intensity).sum::<Vec3>() * (fire::SHOWN / (area * 300.0 * 300.0));
        let [seen, hidden] = sums;
        assert!((seen.x / (4.0 * expected.x) - 1.0).abs() < 0.05, "{seen} {expected}");
        let luminance = girandole::light::luminance(seen.truncate());
        assert!((seen.w / luminance - 0.5).abs() < 1.0e-3, "half of the samples are the first half");
        assert_eq!(hidden, Vec4::ZERO);
    }

    #[test]
    fn records_have_the_sizes_of_the_structs_of_the_shaders() {
        let lights = girandole::plan::wgsl_of_sources(1);
        let moving = lights + &constants() + include_str!("sparks.wgsl") + include_str!("suit.wgsl");
        let drawing = constants() + include_str!("splats.wgsl");
        for (text, name, size) in [
            (&moving, "Step", size_of::<Step>()),
            (&moving, "Spark", size_of::<Spark>()),
            (&moving, "Lamp", size_of::<LampRecord>()),
            (&moving, "Bone", size_of::<BoneRecord>()),
            (&drawing, "Spark", size_of::<Spark>()),
            (&drawing, "View", size_of::<View>()),
        ] {
            let module = naga::front::wgsl::parse_str(text).unwrap_or_else(|e| panic!("{e:?}"));
            let ty = module.types.iter().map(|(_, ty)| ty).find(|ty| ty.name.as_deref() == Some(name));
            let Some(naga::TypeInner::Struct { span, .. }) = ty.map(|ty| &ty.inner) else { panic!("no {name}") };
            assert_eq!(*span as usize, size, "{name}");
        }
    }
}
