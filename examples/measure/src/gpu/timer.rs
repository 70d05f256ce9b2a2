//! Times GPU work, several times over.

use super::spread::Spread;
use girandole::gpu::measure::MAX_TOP_STAGES;
use girandole::wgpu;
use std::time::{Duration, Instant};
use testbed::common::gpu;
use testbed::scene::SceneError;

/// Two timestamps per pass.
const MAX_QUERIES: u32 = 2 * MAX_TOP_STAGES;
/// The size of a timestamp.
const QUERY_BYTES: u64 = wgpu::QUERY_SIZE as u64;

/// How often work is repeated.
#[derive(Clone, Copy)]
pub struct Effort {
    /// Work is done for so long before it is measured: a GPU that was idle raises its clock slowly.
    pub warm_up: Duration,
    pub least: usize,
    pub most: usize,
    /// After this time no repetition begins, once `least` are done.
    pub time: Duration,
}

/// Submits work, waits for it and measures its time.
pub struct Timer {
    device: wgpu::Device,
    queue: wgpu::Queue,
    effort: Effort,
    queries: Option<Queries>,
}

struct Queries {
    set: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readback: wgpu::Buffer,
    /// The period of timestamps, in seconds.
    tick: f64,
}

/// The times of one kind of work.
pub struct Times {
    /// From the beginning of the first pass to the end of the last.
    pub total: Spread,
    /// Seconds of each pass in each repetition; empty where passes cannot be timed.
    pub passes: Vec<Vec<f64>>,
}

impl Timer {
    /// A timer on this device.
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue, effort: Effort) -> Self {
        let buffer = |usage| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("timestamps"),
                size: u64::from(MAX_QUERIES) * QUERY_BYTES,
                usage: usage | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        };
        let has_timestamps = device.features().contains(wgpu::Features::TIMESTAMP_QUERY);
        let queries = has_timestamps.then(|| Queries {
            set: device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("timestamps"),
                ty: wgpu::QueryType::Timestamp,
                count: MAX_QUERIES,
            }),
            resolved: buffer(wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC),
            readback: buffer(wgpu::BufferUsages::MAP_READ),
            tick: f64::from(queue.get_timestamp_period()) * 1e-9,
        });
        Self { device: device.clone(), queue: queue.clone(), effort, queries }
    }

    /// Calls `work` at least once to warm up, then as often as the effort says. Returns the results
    /// of the latter.
    pub fn repeat<T>(&self, mut work: impl FnMut() -> Result<T, SceneError>) -> Result<Vec<T>, SceneError> {
        let start = Instant::now();
        work()?;
        while start.elapsed() < self.effort.warm_up {
            work()?;
        }
        let start = Instant::now();
        let mut all = Vec::new();
        while all.len() < self.effort.least || (all.len() < self.effort.most && start.elapsed() < self.effort.time) {
            all.push(work()?);
        }
        Ok(all)
    }

    /// Times the compute passes that `record` records. Pass i must write the timestamps 2 i and 2 i
    /// + 1 of the query set that `record` is given, and `record` returns the number of passes.
    pub fn time(
        &self,
        mut record: impl FnMut(&mut wgpu::CommandEncoder, Option<&wgpu::QuerySet>) -> usize,
    ) -> Result<Times, SceneError> {
        let runs = self.repeat(|| {
            let mut encoder = self.device.create_command_encoder(&Default::default());
            let passes = record(&mut encoder, self.queries.as_ref().map(|queries| &queries.set));
            let Some(queries) = &self.queries else {
                self.wait()?;
                let start = Instant::now();
                self.queue.submit([encoder.finish()]);
                self.wait()?;
                return Ok((start.elapsed().as_secs_f64(), Vec::new()));
            };
            let count = 2 * passes as u32;
            encoder.resolve_query_set(&queries.set, 0..count, &queries.resolved, 0);
            let bytes = u64::from(count) * QUERY_BYTES;
            encoder.copy_buffer_to_buffer(&queries.resolved, 0, &queries.readback, 0, bytes);
            self.queue.submit([encoder.finish()]);
            let ticks: Vec<u64> = gpu::map(&self.device, &queries.readback, bytes).map_err(SceneError)?;
            let span = |from: u64, to: u64| to.saturating_sub(from) as f64 * queries.tick;
            let total = span(ticks[0], ticks[ticks.len() - 1]);
            Ok((total, ticks.chunks_exact(2).map(|pass| span(pass[0], pass[1])).collect()))
        })?;
        let (totals, passes): (Vec<f64>, Vec<Vec<f64>>) = runs.into_iter().unzip();
        let total = Spread::of(totals).ok_or_else(|| SceneError("nothing was measured".into()))?;
        Ok(Times { total, passes })
    }

    /// Waits until all submitted work is done.
    pub fn wait(&self) -> Result<(), SceneError> {
        gpu::wait(&self.device).map_err(SceneError)
    }

    /// Reads a whole buffer.
    pub fn read<T: bytemuck::Pod>(&self, buffer: &wgpu::Buffer) -> Result<Vec<T>, SceneError> {
        gpu::read(&self.device, &self.queue, buffer).map_err(SceneError)
    }
}
