//! Writes records to scattered places: one write for all of them, and a pass on the GPU that puts
//! each in its place.
//!
//! A write takes an engine about a microsecond of CPU time, whatever its length, so thousands of
//! short writes take longer than all the rest of an upload.

use std::ops::Range;

use super::buffers::BufferId;
use super::commands::Commands;
use super::kernel::{Binding, Kernel, UNIFORM_ALIGNMENT};
use super::text::wgsl_of_kernel;
use crate::effects::Effects;

/// Invocations in a workgroup. Each writes 16 bytes.
const LANES: u32 = 64;

/// The pools that one frame can scatter to.
pub(crate) const MAX_TARGETS: usize = 4;

/// Runs of up to this many records are scattered. Longer ones are written as they are: a write of
/// their own costs little for each record.
const MAX_RUN: u32 = 32;

/// With fewer short runs than this, each is written by itself: to start a pass is not worth it.
const MIN_RUNS: usize = 64;

/// Bytes from one pass of the uniform to the next.
const STRIDE: u32 = UNIFORM_ALIGNMENT;

/// The size of the uniform.
pub(crate) const UNIFORM_BYTES: u64 = MAX_TARGETS as u64 * STRIDE as u64;

/// Twin of `ScatterPass` in `shaders/scatter.wgsl`, which explains the fields.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct ScatterPass {
    pub records: u32,
    pub quads: u32,
    pub places: u32,
    pub first: u32,
}

/// Reads staged records and writes a pool.
pub(crate) const SCATTER: Kernel = Kernel::new(
    "scatter",
    "scatter",
    &[Binding::Uniform { bytes: size_of::<ScatterPass>() as u32 }, Binding::Read, Binding::ReadWrite],
    text,
);

fn text(_: Effects) -> String {
    wgsl_of_kernel(&[("SCATTER_LANES", LANES)], &[], &[shader!("scatter")])
}

/// The short runs of records of one pool, which are written last: together, if there are many.
#[derive(Debug, Default)]
pub(crate) struct Scattered {
    runs: Vec<Range<u32>>,
    records: Vec<u8>,
}

impl Scattered {
    /// With room for the short ones of some runs, of records of `stride` bytes.
    pub fn with_room_for<'a>(runs: impl Iterator<Item = &'a Range<u32>>, stride: u64) -> Self {
        let short = runs.map(Range::len).filter(|length| *length <= MAX_RUN as usize);
        let (runs, records) = short.fold((0, 0), |(runs, records), length| (runs + 1, records + length));
        Self { runs: Vec::with_capacity(runs), records: Vec::with_capacity(records * stride as usize) }
    }

    /// Where the bytes of the records of a run go; `None` if the run is to be written by itself.
    pub fn add(&mut self, run: &Range<u32>) -> Option<&mut Vec<u8>> {
        if run.end - run.start > MAX_RUN {
            return None;
        }
        self.runs.push(run.clone());
        Some(&mut self.records)
    }

    /// Bytes of staged data for records of `stride` bytes; 0 if the runs are written one by one.
    fn staged_bytes(&self, stride: u64) -> u64 {
        if self.runs.len() < MIN_RUNS {
            0
        } else {
            (self.records.len() as u64 / stride).div_ceil(4) * 16 + self.records.len() as u64
        }
    }
}

/// A buffer, the bytes of one of its records, and its short runs.
pub(crate) type Target = (BufferId, u64, Scattered);

/// The bytes that are staged for the pools of many short runs, if they are at most `most`.
pub(crate) fn staged_bytes(targets: &[Target], most: u64) -> u64 {
    let bytes: u64 = targets.iter().map(|(_, stride, scattered)| scattered.staged_bytes(*stride)).sum();
    if bytes > most { 0 } else { bytes }
}

/// Adds the writes of all runs. Those of pools with many of them are one write to the first buffer of `staging`, if
/// that is there, and a pass for each pool. The other buffer is the uniform of the passes.
pub(crate) fn scatter(commands: &mut Commands, targets: &[Target], staging: Option<[BufferId; 2]>) {
    let is_staged = |(_, stride, scattered): &&Target| staging.is_some() && scattered.staged_bytes(*stride) > 0;
    for (buffer, stride, Scattered { runs, records }) in targets.iter().filter(|target| !is_staged(target)) {
        let mut records = &records[..];
        for run in runs {
            let (own, rest) = records.split_at(run.len() * *stride as usize);
            commands.write(*buffer, u64::from(run.start) * stride, own);
            records = rest;
        }
    }
    let Some([staging, uniform]) = staging else { return };
    let mut passes = Vec::new();
    commands.write_with(staging, 0, |bytes| {
        let start = bytes.len();
        let quads = |bytes: &Vec<u8>| ((bytes.len() - start) / 16) as u32;
        for (buffer, stride, Scattered { runs, records }) in targets.iter().filter(is_staged) {
            let places = quads(bytes);
            bytes.extend(runs.iter().cloned().flatten().flat_map(u32::to_ne_bytes));
            bytes.resize(start + (bytes.len() - start).next_multiple_of(16), 0);
            let (count, record) = ((records.len() as u64 / stride) as u32, (stride / 16) as u32);
            passes.push((*buffer, ScatterPass { records: count, quads: record, places, first: quads(bytes) }));
            bytes.extend_from_slice(records);
        }
    });
    for ((buffer, pass), index) in passes.iter().zip(0..) {
        let offset = index * STRIDE;
        commands.write(uniform, u64::from(offset), bytemuck::bytes_of(pass));
        commands.dispatch(SCATTER, &[uniform, staging, *buffer], offset, (pass.records * pass.quads).div_ceil(LANES));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_many_short_runs_are_scattered() {
        let count = |runs: usize, length: u32| {
            let mut scattered = Scattered::default();
            for i in 0..runs as u32 {
                let records = scattered.add(&(i * 100..i * 100 + length));
                records.into_iter().for_each(|records| records.resize(records.len() + 80 * length as usize, 0));
            }
            scattered.staged_bytes(80)
        };
        assert_eq!(count(MIN_RUNS - 1, 1), 0);
        assert_eq!(count(MIN_RUNS, 1), MIN_RUNS as u64 * (4 + 80));
        assert_eq!(count(1000, MAX_RUN + 1), 0);
        assert_eq!(count(65, 1), 17 * 16 + 65 * 80, "places fill whole units of 16 bytes");
    }
}
