//! Writes records to scattered places: one write for all of them, and a pass on the GPU that puts
//! each in its place.
//!
//! A write takes an engine about a microsecond of CPU time, whatever its length, so thousands of
//! short writes take longer than all the rest of an upload.

use std::ops::Range;

use super::buffers::BufferId;
use super::commands::Commands;
use super::kernel::{Binding, Kernel, UNIFORM_ALIGNMENT};

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

fn text() -> String {
    format!("const SCATTER_LANES: u32 = {LANES}u;\n{}", include_str!("../../shaders/scatter.wgsl"))
}

/// The runs of records that a frame writes to one pool, counted before anything is written.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct RunCount {
    short_runs: usize,
    /// Records of the short runs.
    records: u32,
    long_runs: usize,
    /// Records of the others.
    long_records: u64,
}

impl RunCount {
    pub fn add(&mut self, run: &Range<u32>) {
        let length = run.end - run.start;
        if length <= MAX_RUN {
            self.short_runs += 1;
            self.records += length;
        } else {
            self.long_runs += 1;
            self.long_records += u64::from(length);
        }
    }

    /// The runs that are written one by one, and the bytes of their records.
    pub fn written(&self, stride: u64, is_scattered: bool) -> (usize, u64) {
        let (runs, records) = if is_scattered { (0, 0) } else { (self.short_runs, u64::from(self.records)) };
        (runs + self.long_runs, (records + self.long_records) * stride)
    }

    /// An empty list for the short runs, with room for all of them if they are to be scattered.
    pub fn list(&self, stride: u64, is_scattered: bool) -> Scattered {
        let records = if is_scattered { self.records as usize } else { 0 };
        Scattered {
            is_used: is_scattered,
            places: Vec::with_capacity(records.next_multiple_of(4)),
            records: Vec::with_capacity(records * stride as usize),
        }
    }

    /// Bytes of staged data for records of `stride` bytes; 0 if the runs are written one by one.
    pub fn staged_bytes(&self, stride: u64) -> u64 {
        if self.short_runs < MIN_RUNS {
            0
        } else {
            u64::from(self.records.div_ceil(4)) * 16 + u64::from(self.records) * stride
        }
    }
}

/// The short runs of one pool, collected for the pass.
#[derive(Debug, Default)]
pub(crate) struct Scattered {
    is_used: bool,
    places: Vec<u32>,
    records: Vec<u8>,
}

impl Scattered {
    /// Where the bytes of the records of a run go; `None` if the run is to be written by itself.
    pub fn add(&mut self, run: &Range<u32>) -> Option<&mut Vec<u8>> {
        if !self.is_used || run.end - run.start > MAX_RUN {
            return None;
        }
        self.places.extend(run.clone());
        Some(&mut self.records)
    }
}

/// Adds one write of everything that was collected, and a pass for each pool: its buffer, the bytes
/// of one of its records, and its runs. `staging` has room for all.
pub(crate) fn scatter(
    commands: &mut Commands,
    targets: [(BufferId, u64, Scattered); MAX_TARGETS],
    (staging, uniform): (BufferId, BufferId),
) {
    let mut passes = Vec::new();
    commands.write_with(staging, 0, |bytes| {
        let start = bytes.len();
        let quads = |bytes: &Vec<u8>| ((bytes.len() - start) / 16) as u32;
        for (buffer, stride, Scattered { mut places, records, .. }) in targets {
            if places.is_empty() {
                continue;
            }
            let (count, first_place) = (places.len() as u32, quads(bytes));
            places.resize(places.len().next_multiple_of(4), 0);
            bytes.extend_from_slice(bytemuck::cast_slice(&places));
            let pass =
                ScatterPass { records: count, quads: (stride / 16) as u32, places: first_place, first: quads(bytes) };
            bytes.extend_from_slice(&records);
            passes.push((buffer, pass));
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
            let mut count = RunCount::default();
            (0..runs).for_each(|i| count.add(&(i as u32 * 100..i as u32 * 100 + length)));
            count.staged_bytes(80)
        };
        assert_eq!(count(MIN_RUNS - 1, 1), 0);
        assert_eq!(count(MIN_RUNS, 1), MIN_RUNS as u64 * (4 + 80));
        assert_eq!(count(1000, MAX_RUN + 1), 0);
        assert_eq!(count(65, 1), 17 * 16 + 65 * 80, "places fill whole units of 16 bytes");
        let list = |is_scattered| RunCount::default().list(80, is_scattered);
        assert!(list(true).add(&(5..6)).is_some());
        assert!(list(true).add(&(0..MAX_RUN + 1)).is_none());
        assert!(list(false).add(&(5..6)).is_none());
    }
}
