//! Records the kernel that chooses one light for each shading point of a buffer.

use super::GpuLights;
use super::bindings::records;
use super::records::{SampleRecord, SampleRequest};

impl GpuLights {
    /// Records a pass that samples one light for each of the first `count` requests, as
    /// [`LightSampler::sample`](crate::LightSampler::sample) does.
    ///
    /// `requests` holds [`SampleRequest`]s; the pass writes [`SampleRecord`]s to `samples`. Both
    /// are storage buffers of the engine with room for `count` records.
    ///
    /// The top level must have been built since the last upload: see [`GpuLights::build_top`].
    ///
    /// The first call compiles a pipeline for the [effects](GpuLights::effects) of the world and waits
    /// for it, and so does the first call after these have changed to a set that is new. Pipelines are
    /// kept. Each call makes a bind group.
    pub fn sample(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        requests: &wgpu::Buffer,
        samples: &wgpu::Buffer,
        count: u32,
    ) {
        if count > 0 {
            self.sample_with(&self.sampling.pipeline(self.effects()), encoder, requests, samples, count);
        }
    }

    /// Samples with a pipeline of the caller's choice.
    pub(super) fn sample_with(
        &self,
        pipeline: &wgpu::ComputePipeline,
        encoder: &mut wgpu::CommandEncoder,
        requests: &wgpu::Buffer,
        samples: &wgpu::Buffer,
        count: u32,
    ) {
        let own =
            [records(requests, count, size_of::<SampleRequest>()), records(samples, count, size_of::<SampleRecord>())];
        self.sampling.record(encoder, pipeline, &self.kernel_group(), &own, count);
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use wgpu::util::DeviceExt;

    use super::*;
    use crate::effects::Effects;
    use crate::gpu::testing::{gpu, gpu_lights, read};
    use crate::instance::placement::Placement;
    use crate::light::Light;
    use crate::policy::Policy;
    use crate::tree::LightTree;
    use crate::world::LightWorld;

    /// Whether all but two samples agree. Two texts may round differently, and a random number that
    /// falls on the border between two lights may then choose the other one.
    fn are_alike(some: &[SampleRecord], others: &[SampleRecord]) -> bool {
        let is_alike = |(a, b): &(&SampleRecord, &SampleRecord)| {
            (a.instance, a.light) == (b.instance, b.light) && (a.pmf / b.pmf - 1.0).abs() < 1.0e-4
        };
        some.len() == others.len() && some.iter().zip(others).filter(is_alike).count() + 2 >= others.len()
    }

    #[test]
    fn the_pipeline_for_just_the_effects_of_the_world_gives_the_records_of_the_one_for_all_effects() {
        let (device, queue) = gpu();
        let mut world = LightWorld::new();
        let lamp = |i: u32| Light::point(Vec3::new(i as f32, 3.0, (i * i % 17) as f32), Vec3::splat(1.0 + i as f32));
        let tree = world.add_tree(LightTree::new((0..100).map(lamp).collect()).expect("valid"));
        world.add_instance(tree, Placement::IDENTITY, Policy::Static).expect("valid");
        let mut lights = gpu_lights();
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
        lights.upload(&world).expect("it fits");
        assert_eq!(lights.effects(), Effects::empty());
        let general = lights.sampling.compile(Effects::all());
        let mut sampled = |pipeline: Option<&wgpu::ComputePipeline>| {
            let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            lights.build_top(&mut encoder);
            match pipeline {
                Some(pipeline) => lights.sample_with(pipeline, &mut encoder, &requests, &samples, 200),
                None => lights.sample(&mut encoder, &requests, &samples, 200),
            }
            queue.submit([encoder.finish()]);
            read::<SampleRecord>(&device, &queue, &samples)
        };
        let own = sampled(None);
        assert!(own.iter().all(|record| record.pmf > 0.0));
        assert_eq!(sampled(None), own);
        assert!(are_alike(&sampled(Some(&general)), &own));
    }
}
