//! Our own kernel over a buffer of shading points, for those who want no shader.

use bytemuck::{Pod, Zeroable};

use super::kernel::{Kernel, records};
use super::usage::Chosen;
use super::{GpuLights, storage_entry};

/// A shading point and its four random numbers in [0, 1). 48 bytes; `Request` in `shaders/batch.wgsl`.
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
    /// Unit vector from the shading point to the light.
    pub direction: [f32; 3],
    /// Metres; at least 1e18 for a directional light.
    pub dist: f32,
    /// Nits for surfaces, lux for lights without size.
    pub radiance: [f32; 3],
    /// Per steradian for surfaces, 1 for lights without size.
    pub pdf: f32,
    /// The light's chance; 0 for no light.
    pub pmf: f32,
    /// The instance's slot, see [`LightWorld::instance_at`](crate::LightWorld::instance_at); `u32::MAX` for a directional light.
    pub instance: u32,
    /// Its index in the tree, or among the directional lights.
    pub light: u32,
    /// 1 for a light without size.
    pub is_delta: u32,
}

/// Compiles nothing.
pub(super) fn kernel(device: &wgpu::Device, lights: &wgpu::BindGroupLayout) -> Kernel {
    let entries = [storage_entry(0, true), storage_entry(1, false)];
    Kernel::new(device, lights, "batch", include_str!("../../shaders/batch.wgsl"), &entries)
}

impl GpuLights {
    /// Samples one light for each of `requests` (an array of [`SampleRequest`]) into `samples` (of [`SampleRecord`]),
    /// both storage buffers of the engine with room for `count` records. Records into the engine's encoder.
    ///
    /// The top level must have been built after the last upload. The first call makes a pipeline for all effects. One
    /// for just those of the world is made on another thread, whenever they are others; until it is ready a more
    /// general one serves. Each call makes a bind group.
    pub fn sample(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        requests: &wgpu::Buffer,
        samples: &wgpu::Buffer,
        count: u32,
    ) {
        if count > 0 {
            self.sample_by(&self.batch.pipeline(self.effects), encoder, requests, samples, count);
            self.count_chosen(encoder, (requests, samples), Chosen::Samples, count);
        }
    }

    /// The same by a pipeline of one's own choice.
    pub(super) fn sample_by(
        &self,
        pipeline: &wgpu::ComputePipeline,
        encoder: &mut wgpu::CommandEncoder,
        requests: &wgpu::Buffer,
        samples: &wgpu::Buffer,
        count: u32,
    ) {
        let own = [records::<SampleRequest>(requests, count), records::<SampleRecord>(samples, count)];
        self.batch.record(encoder, pipeline, &self.bind_group, &own, count);
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use glam::Vec3;
    use wgpu::util::DeviceExt;

    use super::*;
    use crate::effects::Effects;
    use crate::gpu::testing::{gpu, read};
    use crate::gpu::text;
    use crate::light::Light;
    use crate::placement::Placement;
    use crate::policy::Policy;
    use crate::world::LightWorld;

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
        let mut world = LightWorld::new();
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
        while !lights.batch.variants().has(Effects::MOVING) {
            assert!(start.elapsed() < Duration::from_secs(120), "no pipeline for a world of points");
            assert!(are_alike(&frame(&mut lights), &general));
        }
        assert!(are_alike(&frame(&mut lights), &general));
        assert!(lights.batch.variants().ready().eq([Effects::all(), Effects::MOVING]));
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
