//! What a draw of a light by Girandole reads.

use std::sync::mpsc::channel;

use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy_girandole::GirandoleLights;
use girandole::gpu::measure::{NODE_BYTES, NodeCounter};
use girandole::gpu::{GpuLights, SampleRequest};
use girandole::wgpu::util::{BufferInitDescriptor, DeviceExt, DownloadBuffer};
use girandole::{CandidateCount, wgpu};

use crate::scene::Random;

/// Points for which lights are drawn.
const POINTS: usize = 1 << 14;

/// Prints the nodes that a draw reads, in the mean over points of a floor.
pub fn print(app: &App, [lower, upper]: [Vec3; 2]) -> Result<(), String> {
    let lights = app.sub_app(RenderApp).world().get_resource::<GirandoleLights>();
    let world = lights.ok_or("Solari draws lights itself: leave out --uniform")?.world();
    let (device, queue) = (app.world().resource::<RenderDevice>().wgpu_device(), app.world().resource::<RenderQueue>());
    let mut random = Random::new(11);
    let requests: Vec<SampleRequest> = (0..POINTS)
        .map(|_| {
            let share = Vec3::new(random.next(), 0.0, random.next());
            let position = (lower + share * (upper - lower)).into();
            SampleRequest { position, normal: [0.0, 1.0, 0.0], u: std::array::from_fn(|_| random.next()), ..default() }
        })
        .collect();
    let mut gpu = GpuLights::new(device, queue).map_err(|error| error.to_string())?;
    gpu.upload(world).map_err(|error| error.to_string())?;
    let input = device.create_buffer_init(&BufferInitDescriptor {
        label: Some("requests"),
        contents: bytemuck::cast_slice(&requests),
        usage: wgpu::BufferUsages::STORAGE,
    });
    let counts = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("counts"),
        size: 4 * POINTS as u64,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("count") });
    gpu.build_top(&mut encoder);
    let counter = NodeCounter::new(&gpu);
    counter.record(&gpu, &mut encoder, (&input, &counts), POINTS as u32, CandidateCount::ONE);
    queue.submit([encoder.finish()]);
    let (send, receive) = channel();
    DownloadBuffer::read_buffer(device, queue, &counts.slice(..), move |read| {
        // Nobody waits if the device is gone.
        let _ = send.send(read.map(|bytes| bytes.to_vec()));
    });
    device.poll(wgpu::PollType::wait_indefinitely()).map_err(|error| error.to_string())?;
    let bytes = receive.recv().map_err(|error| error.to_string())?.map_err(|error| error.to_string())?;
    let nodes: u64 = bytes.chunks_exact(4).map(|of| u64::from(u32::from_le_bytes([of[0], of[1], of[2], of[3]]))).sum();
    let lights = world.light_count();
    println!("{lights} lights, {:.1} nodes a draw of {} bytes", nodes as f64 / POINTS as f64, NODE_BYTES);
    Ok(())
}
