//! Our own kernel over a buffer of receivers, for those who want no shader.

use std::sync::{Mutex, MutexGuard, PoisonError};

use bytemuck::{Pod, Zeroable};

use super::{GpuLights, text};
use crate::effects::{Effects, Variants};

/// Invocations of a workgroup.
pub(super) const LANES: u32 = 64;
/// Workgroups along one dimension, as WebGPU allows.
pub(super) const ROW: u32 = 65535;

/// A receiver and its four random numbers in [0, 1). 48 bytes; `Request` in `shaders/batch.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct SampleRequest {
    /// Metres, relative to the world's origin.
    pub position: [f32; 3],
    /// Not read.
    pub padding_a: u32,
    /// Unit normal, or zero for a point in a volume.
    pub normal: [f32; 3],
    /// Not read.
    pub padding_b: u32,
    /// Two numbers choose the light, two the point on it.
    pub u: [f32; 4],
}

/// A chosen light and a point on it. 48 bytes; `LightSample` in `shaders/sample.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct SampleRecord {
    /// Unit vector from the receiver to the light.
    pub direction: [f32; 3],
    /// Metres; at least 1e18 for a directional light.
    pub distance: f32,
    /// Nits for surfaces, lux for lights without size.
    pub radiance: [f32; 3],
    /// Per steradian for surfaces, 1 for lights without size.
    pub pdf: f32,
    /// The light's chance; 0 for no light.
    pub pmf: f32,
    /// The instance's slot, see [`World::instance_at`](crate::World::instance_at); `u32::MAX` for a directional light.
    pub instance: u32,
    /// Its index in the tree, or among the directional lights.
    pub light: u32,
    /// 1 for a light without size.
    pub is_delta: u32,
}

pub(super) struct BatchKernel {
    /// Sampling locks them for as long as it takes to find one; nobody makes one meanwhile.
    variants: Mutex<Variants<wgpu::ComputePipeline>>,
    layout: wgpu::BindGroupLayout,
}

impl BatchKernel {
    pub fn new(device: &wgpu::Device, lights: &wgpu::BindGroupLayout) -> Self {
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("girandole batch"),
            entries: &[super::storage_entry(0, true), super::storage_entry(1, false)],
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("girandole batch"),
            bind_group_layouts: &[Some(lights), Some(&layout)],
            ..Default::default()
        });
        let device = device.clone();
        let make = move |effects| pipeline(&device, &pipeline_layout, effects);
        let general = make(Effects::all());
        Self { variants: Mutex::new(Variants::new(general, make)), layout }
    }

    /// The best that is ready.
    fn pipeline(&self, effects: Effects) -> wgpu::ComputePipeline {
        // Whether lights move is nothing to the text.
        self.variants().get(effects - Effects::MOVING).clone()
    }

    fn variants(&self) -> MutexGuard<'_, Variants<wgpu::ComputePipeline>> {
        self.variants.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn pipeline(device: &wgpu::Device, layout: &wgpu::PipelineLayout, effects: Effects) -> wgpu::ComputePipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("girandole batch"),
        source: wgpu::ShaderSource::Wgsl((text::wgsl(0, effects) + include_str!("../../shaders/batch.wgsl")).into()),
    });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("girandole batch"),
        layout: Some(layout),
        module: &module,
        entry_point: Some("batch"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    })
}

impl GpuLights {
    /// Samples one light for each of `requests` (an array of [`SampleRequest`]) into `samples` (of [`SampleRecord`]),
    /// both storage buffers of the engine with room for `count` records. Records into the engine's encoder.
    ///
    /// The top level must have been built after the last upload. The first call for other effects of the world has a
    /// pipeline made for them, on another thread; until it is ready a more general one serves.
    pub fn sample(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        requests: &wgpu::Buffer,
        samples: &wgpu::Buffer,
        count: u32,
    ) {
        if count == 0 {
            return;
        }
        let binding = |buffer, stride: usize| {
            wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                buffer,
                offset: 0,
                size: std::num::NonZeroU64::new(u64::from(count) * stride as u64),
            })
        };
        let group = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("girandole batch"),
            layout: &self.batch.layout,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: binding(requests, size_of::<SampleRequest>()) },
                wgpu::BindGroupEntry { binding: 1, resource: binding(samples, size_of::<SampleRecord>()) },
            ],
        });
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("girandole sample"),
            timestamp_writes: None,
        });
        pass.set_pipeline(&self.batch.pipeline(self.effects));
        pass.set_bind_group(0, &self.bind_group, &[]);
        pass.set_bind_group(1, &group, &[]);
        let groups = count.div_ceil(LANES);
        pass.dispatch_workgroups(groups.min(ROW), groups.div_ceil(ROW), 1);
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use glam::Vec3;
    use wgpu::util::DeviceExt;

    use super::*;
    use crate::gpu::testing::{gpu, read};
    use crate::light::Light;
    use crate::placement::Placement;
    use crate::policy::Policy;
    use crate::world::World;

    /// Other texts may round otherwise: then a number that falls where two lights meet may choose the other.
    fn are_alike(some: &[SampleRecord], others: &[SampleRecord]) -> bool {
        let is_alike = |(a, b): &(&SampleRecord, &SampleRecord)| {
            (a.instance, a.light) == (b.instance, b.light) && (a.pmf / b.pmf - 1.0).abs() < 1.0e-4
        };
        some.len() == others.len() && some.iter().zip(others).filter(is_alike).count() + 2 >= others.len()
    }

    #[test]
    fn the_pipeline_for_just_the_worlds_effects_serves_in_the_end_and_gives_the_same_records() {
        let (device, queue) = gpu();
        let mut world = World::new();
        let lamp = |i: u32| Light::point(Vec3::new(i as f32, 3.0, (i * i % 17) as f32), Vec3::splat(1.0 + i as f32));
        let tree = world.add_tree((0..100).map(lamp).collect()).expect("valid");
        world.add_instance(tree, Placement::IDENTITY, Policy::Static).expect("valid");
        let mut lights = GpuLights::new(&device, &queue).expect("default limits are enough");
        let request = |i: u32| SampleRequest {
            position: [(i % 10) as f32, 0.0, (i / 10) as f32],
            normal: [0.0, 1.0, 0.0],
            u: [0.0, 0.25, 0.5, 0.75].map(|u| (u + i as f32 * 0.618) % 1.0),
            ..SampleRequest::default()
        };
        let requests: Vec<_> = (0..200).map(request).collect();
        let requests = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some("test requests"),
            contents: bytemuck::cast_slice(&requests),
            usage: wgpu::BufferUsages::STORAGE,
        });
        let samples = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("test samples"),
            size: 200 * size_of::<SampleRecord>() as u64,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let mut frame = |lights: &mut GpuLights| {
            let delta = world.take_delta();
            lights.upload(&world, &delta).expect("it fits");
            let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            lights.build_top(&mut encoder);
            lights.sample(&mut encoder, &requests, &samples, 200);
            queue.submit([encoder.finish()]);
            read::<SampleRecord>(&device, &queue, &samples)
        };
        assert!(lights.batch.variants().ready().eq([Effects::all()]));
        let general = frame(&mut lights);
        assert!(general.iter().all(|record| record.pmf > 0.0));
        let start = Instant::now();
        while !lights.batch.variants().has(Effects::empty()) {
            assert!(start.elapsed() < Duration::from_secs(120), "no pipeline for a world of points");
            assert!(are_alike(&frame(&mut lights), &general));
        }
        assert!(are_alike(&frame(&mut lights), &general));
        assert!(lights.batch.variants().ready().eq([Effects::all(), Effects::empty()]));
    }

    #[test]
    fn threads_may_share_the_lights() {
        fn shared<T: Send + Sync>() -> usize {
            size_of::<T>()
        }
        assert!(shared::<GpuLights>() > 0);
    }

    #[test]
    fn the_text_is_the_same_for_lights_that_move() {
        assert_eq!(text::wgsl(0, Effects::MOVING), text::wgsl(0, Effects::empty()));
        assert_eq!(text::wgsl(0, Effects::all()), text::wgsl(0, Effects::all() - Effects::MOVING));
    }
}
