//! The GPU backend: `render.wgsl` joined with the library's text, on the example's own device.
//!
//! Geometry goes up once; after that only objects that changed and, if any of them moved, the upper nodes. The picture
//! comes back in bands of rows, so that no picture is too large, and each dispatch is short enough for every watchdog.

use super::backend::{COUNTING_BUFFERS, Gpu};
use super::geometry::{Geometry, GeometryChange, Placed};
use super::image::Image;
use super::scene::{Scene, SceneError};
use super::settings::{Settings, ShadowRays};
use super::shading::View;
use bytemuck::{Pod, Zeroable};
use girandole::glam::{Vec3, Vec4};
use girandole::gpu::{DEFAULT_USAGE_INTERVAL, GpuLights, LightShader, UsageCounts};
use girandole::wgpu::{self, util::DeviceExt};
use girandole::{Effects, FrameDelta, LightWorld};
use std::time::Duration;

/// Where the library's text is joined.
const LIGHT_GROUP: u32 = 1;
const WORKGROUP: u32 = 8;
/// Pixels whose sums are held on the device at a time.
const BAND_PIXELS: u32 = 1 << 20;
/// Samples a dispatch takes: a fraction of a second on the slowest driver, which is a processor.
const DISPATCH_SAMPLES: u32 = 1 << 18;
/// Sums of radiance and shadow rays.
const PIXEL_BYTES: u64 = 32;
/// Two timestamps.
const QUERY_BYTES: u64 = 16;

/// `Frame` in `render.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct FrameUniform {
    eye: Vec3,
    width: u32,
    right: Vec3,
    height: u32,
    up: Vec3,
    seed: u32,
    forward: Vec3,
    lamp_clearance: f32,
    zenith: Vec3,
    top_root: u32,
    horizon: Vec3,
    first_object: u32,
    ambient: Vec3,
    padding: u32,
    occluder_min: Vec3,
    padding_a: u32,
    occluder_max: Vec3,
    padding_b: u32,
    sample_begin: u32,
    sample_end: u32,
    row_begin: u32,
    row_end: u32,
}

/// `Record` in `render.wgsl`: a material or an object.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Record {
    rows: [Vec4; 3],
    words: [u32; 4],
}

/// What it took to bring the device up to date.
#[derive(Clone, Copy, Debug, Default)]
pub struct GpuUpdate {
    /// Bytes of light data that the library uploaded.
    pub light_bytes: u64,
    /// Bytes of objects and upper nodes that this file uploaded.
    pub geometry_bytes: u64,
    /// The library's build of its top level, where the adapter can time it.
    pub top_build: Option<Duration>,
}

/// Everything on the device.
pub struct GpuRenderer {
    gpu: Box<Gpu>,
    lights: GpuLights,
    layout: wgpu::BindGroupLayout,
    bind_group: wgpu::BindGroup,
    pipeline: wgpu::ComputePipeline,
    /// What it was made with.
    shader: LightShader,
    stack_size: usize,
    uniform: wgpu::Buffer,
    nodes: wgpu::Buffer,
    records: wgpu::Buffer,
    first_object: usize,
    image: wgpu::Buffer,
    band_rows: u32,
    readback: wgpu::Buffer,
    timer: Option<Timer>,
}

struct Timer {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readback: wgpu::Buffer,
}

impl GpuRenderer {
    /// Uploads the geometry, and makes a shader for a light world with these effects, which counts picks if that is
    /// wanted and the device has room for it. Refuses a scene that the device's limits do not admit.
    pub fn new(
        gpu: Box<Gpu>,
        scene: &Scene,
        geometry: &Geometry,
        effects: Effects,
        wants_picks: bool,
        settings: &Settings,
    ) -> Result<Self, SceneError> {
        let device = &gpu.device;
        let band_rows = (BAND_PIXELS / settings.width).clamp(1, settings.height);
        let band_bytes = u64::from(settings.width) * u64::from(band_rows) * PIXEL_BYTES;
        let first_object = scene.materials.len();
        let records: Vec<Record> = material_records(scene).chain(geometry.objects.iter().map(object_record)).collect();
        let checked = |what: &str, bytes: usize| {
            let limits = device.limits();
            let allowed = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
            if bytes as u64 <= allowed {
                Ok(())
            } else {
                Err(SceneError(format!(
                    "the scene's {what} take {bytes} bytes and this adapter allows {allowed}; try --backend cpu"
                )))
            }
        };
        let nodes = bytemuck::cast_slice(&geometry.nodes);
        // A binding of no bytes is refused by WebGPU; one triangle that no node refers to is not.
        let spare = [super::geometry::PackedTriangle::zeroed()];
        let triangles = if geometry.triangles.is_empty() { &spare[..] } else { &geometry.triangles };
        let triangles = bytemuck::cast_slice(triangles);
        checked("nodes", nodes.len())?;
        checked("triangles", triangles.len())?;
        checked("objects", size_of_val(&records[..]))?;

        let memory = device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let filled = |label, contents, usage| {
            device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: Some(label), contents, usage })
        };
        let empty = |label, size, usage| {
            device.create_buffer(&wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false })
        };
        use wgpu::BufferUsages as Usage;
        let nodes = filled("city nodes", nodes, Usage::STORAGE | Usage::COPY_DST);
        let triangles = filled("city triangles", triangles, Usage::STORAGE);
        let records = filled("city records", bytemuck::cast_slice(&records), Usage::STORAGE | Usage::COPY_DST);
        let uniform = empty("city frame", size_of::<FrameUniform>() as u64, Usage::UNIFORM | Usage::COPY_DST);
        let image = empty("city image", band_bytes, Usage::STORAGE | Usage::COPY_SRC);
        let readback = empty("city readback", band_bytes, Usage::MAP_READ | Usage::COPY_DST);
        let timer = gpu.timestamps.then(|| Timer {
            queries: device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("city top build"),
                ty: wgpu::QueryType::Timestamp,
                count: 2,
            }),
            resolved: empty("city timestamps", QUERY_BYTES, Usage::QUERY_RESOLVE | Usage::COPY_SRC),
            readback: empty("city timestamps back", QUERY_BYTES, Usage::MAP_READ | Usage::COPY_DST),
        });
        if let Some(error) = pollster::block_on(memory.pop()) {
            return Err(SceneError(format!("the adapter has not enough memory: {error}")));
        }

        let mut lights = GpuLights::new(device, &gpu.queue).map_err(|e| SceneError(e.to_string()))?;
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("city"),
            entries: &[
                layout_entry(0, wgpu::BufferBindingType::Uniform),
                layout_entry(1, wgpu::BufferBindingType::Storage { read_only: true }),
                layout_entry(2, wgpu::BufferBindingType::Storage { read_only: true }),
                layout_entry(3, wgpu::BufferBindingType::Storage { read_only: true }),
                layout_entry(4, wgpu::BufferBindingType::Storage { read_only: false }),
            ],
        });
        let buffers = [&uniform, &nodes, &triangles, &records, &image];
        let entries: Vec<_> = buffers
            .iter()
            .enumerate()
            .map(|(i, buffer)| wgpu::BindGroupEntry { binding: i as u32, resource: buffer.as_entire_binding() })
            .collect();
        let bind_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("city"),
            layout: &layout,
            entries: &entries,
        });
        let stack_size = stack_size(geometry);
        let effects = effects - Effects::MOVING;
        let shader = if wants_picks && device.limits().max_storage_buffers_per_shader_stage >= COUNTING_BUFFERS {
            lights.count_usage(DEFAULT_USAGE_INTERVAL);
            lights.usage_shader(LIGHT_GROUP, effects)
        } else {
            lights.shader(LIGHT_GROUP, effects)
        };
        let pipeline = pipeline(device, &layout, &shader, stack_size);
        Ok(Self {
            lights,
            layout,
            bind_group,
            pipeline,
            shader,
            stack_size,
            uniform,
            nodes,
            records,
            first_object,
            image,
            band_rows,
            readback,
            timer,
            gpu,
        })
    }

    /// How often lights were picked in earlier frames, if news of that have come.
    pub fn take_usage(&mut self) -> Option<UsageCounts<'_>> {
        self.lights.take_usage()
    }

    /// Brings the device up to date with what moved.
    pub fn update(
        &mut self,
        geometry: &Geometry,
        change: &GeometryChange,
        world: &LightWorld,
        delta: &FrameDelta,
    ) -> Result<GpuUpdate, SceneError> {
        let geometry_bytes = self.upload_geometry(geometry, change);
        let light_bytes = self.lights.upload(world, delta).map_err(|e| SceneError(e.to_string()))?.bytes;
        // Whether lights move is nothing to the shader. A program that must not wait would use `girandole::PipelineVariants`;
        // this one would rather have the same picture from the same seed.
        let effects = world.effects() - Effects::MOVING;
        if stack_size(geometry) > self.stack_size || effects != self.shader.effects {
            self.stack_size = self.stack_size.max(stack_size(geometry));
            self.shader = self.shader.with_effects(effects);
            self.pipeline = pipeline(&self.gpu.device, &self.layout, &self.shader, self.stack_size);
        }
        Ok(GpuUpdate { light_bytes, geometry_bytes, top_build: self.build_top()? })
    }

    /// Renders one frame.
    pub fn render(
        &self,
        scene: &Scene,
        geometry: &Geometry,
        settings: &Settings,
        seed: u32,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<(Image, ShadowRays), SceneError> {
        let view = View::new(&scene.camera, settings.width, settings.height);
        let mut frame = FrameUniform {
            eye: view.eye,
            width: settings.width,
            right: view.right,
            height: settings.height,
            up: view.up,
            seed,
            forward: view.forward,
            lamp_clearance: scene.lamp_clearance,
            zenith: scene.sky.zenith,
            top_root: geometry.top.root,
            horizon: scene.sky.horizon,
            first_object: self.first_object as u32,
            ambient: scene.sky.ambient,
            padding: 0,
            occluder_min: geometry.occluders.min,
            padding_a: 0,
            occluder_max: geometry.occluders.max,
            padding_b: 0,
            sample_begin: 0,
            sample_end: 0,
            row_begin: 0,
            row_end: 0,
        };
        let mut rays = ShadowRays::default();
        let mut sums: Vec<Vec4> = Vec::with_capacity(settings.width as usize * settings.height as usize);
        while frame.row_end < settings.height {
            frame.row_begin = frame.row_end;
            frame.row_end = (frame.row_begin + self.band_rows).min(settings.height);
            let band = settings.width * (frame.row_end - frame.row_begin);
            let step = (DISPATCH_SAMPLES / band).max(1);
            frame.sample_end = 0;
            while frame.sample_end < settings.spp {
                frame.sample_begin = frame.sample_end;
                frame.sample_end = frame.sample_begin.saturating_add(step).min(settings.spp);
                self.dispatch(&frame)?;
                let band_share = f64::from(frame.sample_end) / f64::from(settings.spp);
                let rows = f64::from(frame.row_begin) + band_share * f64::from(frame.row_end - frame.row_begin);
                progress(rows / f64::from(settings.height));
            }
            let bytes = self.read(&self.image, &self.readback, u64::from(band) * PIXEL_BYTES)?;
            let (colors, counts) = bytemuck::cast_slice::<_, Vec4>(&bytes).split_at(band as usize);
            sums.extend_from_slice(colors);
            // Whole numbers of at most the samples of a pixel.
            let count = |pixel: &Vec4| ShadowRays { traced: pixel.x as u64, skipped: pixel.y as u64 };
            rays = counts.iter().map(count).fold(rays, |a, b| a + b);
        }
        Ok((Image::from_sums(settings.width, settings.height, settings.spp, sums.into_iter()), rays))
    }

    fn upload_geometry(&self, geometry: &Geometry, change: &GeometryChange) -> u64 {
        let mut uploaded = 0;
        let mut write = |buffer: &wgpu::Buffer, offset: usize, bytes: &[u8]| {
            self.gpu.queue.write_buffer(buffer, offset as u64, bytes);
            uploaded += bytes.len() as u64;
        };
        for range in &change.objects {
            let records: Vec<Record> = geometry.objects[range.clone()].iter().map(object_record).collect();
            write(
                &self.records,
                (self.first_object + range.start) * size_of::<Record>(),
                bytemuck::cast_slice(&records),
            );
        }
        if change.top {
            write(&self.nodes, 0, bytemuck::cast_slice(geometry.top_nodes()));
        }
        uploaded
    }

    fn build_top(&mut self) -> Result<Option<Duration>, SceneError> {
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        // What the last frame counted: here there is an encoder, and none in a frame in which nothing moves.
        self.lights.collect_usage(&mut encoder);
        if let Some(timer) = &self.timer {
            encoder.write_timestamp(&timer.queries, 0);
        }
        self.lights.build_top(&mut encoder);
        if let Some(timer) = &self.timer {
            encoder.write_timestamp(&timer.queries, 1);
            encoder.resolve_query_set(&timer.queries, 0..2, &timer.resolved, 0);
        }
        self.gpu.queue.submit([encoder.finish()]);
        let Some(timer) = &self.timer else { return Ok(None) };
        let bytes = self.read(&timer.resolved, &timer.readback, QUERY_BYTES)?;
        let ticks: &[u64] = bytemuck::cast_slice(&bytes);
        let nanoseconds = ticks[1].saturating_sub(ticks[0]) as f64 * f64::from(self.gpu.queue.get_timestamp_period());
        Ok(Some(Duration::from_secs_f64(nanoseconds * 1e-9)))
    }

    fn dispatch(&self, frame: &FrameUniform) -> Result<(), SceneError> {
        self.gpu.queue.write_buffer(&self.uniform, 0, bytemuck::bytes_of(frame));
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.bind_group, &[]);
        let counts = self.shader.records_usage;
        let lights = if counts { self.lights.usage_bind_group() } else { self.lights.bind_group() };
        pass.set_bind_group(self.shader.group, lights, &[]);
        let rows = frame.row_end - frame.row_begin;
        pass.dispatch_workgroups(frame.width.div_ceil(WORKGROUP), rows.div_ceil(WORKGROUP), 1);
        drop(pass);
        self.gpu.queue.submit([encoder.finish()]);
        // Waiting keeps the progress bar honest and the queue short; against a dispatch's length it costs nothing.
        self.wait()
    }

    /// Copies the first bytes of a buffer here.
    fn read(&self, from: &wgpu::Buffer, through: &wgpu::Buffer, size: u64) -> Result<Vec<u8>, SceneError> {
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(from, 0, through, 0, size);
        self.gpu.queue.submit([encoder.finish()]);
        through.map_async(wgpu::MapMode::Read, 0..size, |_| {});
        self.wait()?;
        // A mapping that failed shows here.
        let view =
            through.get_mapped_range(0..size).map_err(|e| SceneError(format!("cannot read the picture: {e}")))?;
        let bytes = view.to_vec();
        drop(view);
        through.unmap();
        Ok(bytes)
    }

    fn wait(&self) -> Result<(), SceneError> {
        self.gpu
            .device
            .poll(wgpu::PollType::wait_indefinitely())
            .map(|_| ())
            .map_err(|e| SceneError(format!("the adapter does not answer: {e}")))
    }
}

/// The shader as the device compiles it, from the library's text.
fn shader_source(light: &str, records_usage: bool, stack_size: usize) -> String {
    let count = if records_usage { "light_record_usage(instance, u);" } else { "" };
    format!(
        "{light}\nconst STACK_SIZE: u32 = {stack_size}u;\nfn count_pick(instance: u32, u: vec4<f32>) {{ {count} }}\n{}",
        include_str!("render.wgsl")
    )
}

/// Rounded up, so that an upper hierarchy that deepens a little does not call for another shader.
fn stack_size(geometry: &Geometry) -> usize {
    (geometry.stack_size() + 4).next_multiple_of(16)
}

fn pipeline(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    shader: &LightShader,
    stack_size: usize,
) -> wgpu::ComputePipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("city render"),
        source: wgpu::ShaderSource::Wgsl(shader_source(&shader.wgsl, shader.records_usage, stack_size).into()),
    });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("city render"),
        bind_group_layouts: &[Some(layout), Some(&shader.layout)],
        ..Default::default()
    });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("city render"),
        layout: Some(&layout),
        module: &module,
        entry_point: Some("render"),
        compilation_options: Default::default(),
        cache: None,
    })
}

fn layout_entry(binding: u32, ty: wgpu::BufferBindingType) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
        count: None,
    }
}

fn material_records(scene: &Scene) -> impl Iterator<Item = Record> {
    scene.materials.iter().map(|material| Record {
        rows: [material.base_color.extend(material.roughness), material.emission.extend(material.metallic), Vec4::ZERO],
        words: [u32::from(material.two_sided_emission), 0, 0, 0],
    })
}

fn object_record(placed: &Placed) -> Record {
    let matrix = placed.inverse.matrix3.transpose();
    let moved = placed.inverse.translation;
    let row = |axis: Vec3, w: f32| axis.extend(w);
    Record {
        rows: [
            row(matrix.x_axis.into(), moved.x),
            row(matrix.y_axis.into(), moved.y),
            row(matrix.z_axis.into(), moved.z),
        ],
        words: [placed.root, placed.emission_scale.to_bits(), 0, 0],
    }
}

#[cfg(test)]
mod tests {
    use super::super::geometry::PackedTriangle;
    use super::super::geometry_nodes::Node;
    use super::*;
    use std::mem::offset_of;

    /// Offsets of a struct's named members, and its size.
    fn layout(module: &naga::Module, name: &str) -> (Vec<(String, usize)>, usize) {
        let ty = module.types.iter().map(|(_, ty)| ty).find(|ty| ty.name.as_deref() == Some(name));
        let Some(naga::TypeInner::Struct { members, span }) = ty.map(|ty| &ty.inner) else {
            panic!("no struct {name}")
        };
        let named = members.iter().map(|m| (m.name.clone().unwrap_or_default(), m.offset as usize));
        (named.collect(), *span as usize)
    }

    #[test]
    fn records_lie_in_the_shader_as_they_do_here() {
        let source = shader_source(&girandole::gpu::wgsl(LIGHT_GROUP, Effects::all()), false, 32);
        let module = naga::front::wgsl::parse_str(&source).unwrap_or_else(|e| panic!("{e:?}"));
        macro_rules! same {
            ($name:literal, $ty:ty, $($field:ident),+) => {
                let expected = vec![$((stringify!($field).to_owned(), offset_of!($ty, $field))),+];
                assert_eq!(layout(&module, $name), (expected, size_of::<$ty>()), $name);
            };
        }
        same!(
            "Frame",
            FrameUniform,
            eye,
            width,
            right,
            height,
            up,
            seed,
            forward,
            lamp_clearance,
            zenith,
            top_root,
            horizon,
            first_object,
            ambient,
            padding,
            occluder_min,
            padding_a,
            occluder_max,
            padding_b,
            sample_begin,
            sample_end,
            row_begin,
            row_end
        );
        same!("Node", Node, min0, child0, max0, padding0, min1, child1, max1, padding1);
        same!("Triangle", PackedTriangle, corner, material, edge1, flags, edge2, padding);
        // A record's three rows are one array here.
        let (members, size) = layout(&module, "Record");
        assert_eq!((members[1].1, members[3].1, size), (16, offset_of!(Record, words), size_of::<Record>()));
    }
}
