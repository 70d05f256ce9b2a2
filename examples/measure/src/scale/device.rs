//! A mock of the GPU: it keeps the sizes of buffers, and checks the commands of plans.

use girandole::plan::{BufferId, Command, FramePlan, PlanCursor};
use std::collections::HashMap;

/// The buffers that exist.
#[derive(Debug, Default)]
pub struct Device {
    bytes: HashMap<BufferId, u64>,
    cursor: PlanCursor,
}

impl Device {
    /// Checks a plan.
    pub fn play(&mut self, plan: &FramePlan) {
        self.cursor.advance(plan).expect("plans are made in order");
        self.bytes.extend(plan.new_buffers.iter().map(|buffer| (buffer.id, buffer.bytes)));
        for command in plan.upload.iter().chain(plan.top.iter()) {
            match command {
                Command::Write { buffer, offset, bytes } => {
                    assert!(offset + bytes.len() as u64 <= self.bytes[&buffer], "a write ends in its buffer");
                }
                Command::Copy { from, to, offset, bytes } => {
                    assert!(bytes <= self.bytes[&from] && offset + bytes <= self.bytes[&to]);
                }
                Command::Clear { buffer, offset, bytes } => assert!(offset + bytes <= self.bytes[&buffer]),
                Command::Dispatch { buffers, .. } => {
                    assert!(buffers.iter().all(|buffer| self.bytes.contains_key(buffer)), "buffers exist");
                }
                _ => unreachable!("this version has no other commands"),
            }
        }
        plan.freed.iter().for_each(|id| _ = self.bytes.remove(id).expect("a buffer is freed once"));
    }

    /// Bytes of all buffers.
    pub fn bytes_of_all(&self) -> u64 {
        self.bytes.values().sum()
    }
}
