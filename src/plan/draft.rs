//! A plan that is being made.

use super::buffers::{BufferId, BufferKind, Ids, NewBuffer};
use super::error::PlanError;
use super::frame::FramePlan;

/// How much room a buffer gets that has to grow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Growth {
    /// At least twice as much as before, so that growth takes amortised constant time; by larger
    /// steps if the memory is limited.
    #[default]
    Double,
    /// No more than needed. Short of memory, that may still fit.
    Exact,
}

/// A plan that is being made, and how its buffers grow. Every buffer that the plan makes comes from here.
pub(crate) struct Draft {
    pub ids: Ids,
    pub growth: Growth,
    pub plan: FramePlan,
}

impl Draft {
    pub fn new(ids: Ids, growth: Growth) -> Self {
        Self { ids, growth, plan: FramePlan::default() }
    }

    /// A new storage buffer.
    pub fn storage(&mut self, what: &'static str, bytes: u64) -> BufferId {
        self.add(what, bytes, BufferKind::Storage)
    }

    /// A new uniform buffer.
    pub fn uniform(&mut self, what: &'static str, bytes: u64) -> BufferId {
        self.add(what, bytes, BufferKind::Uniform)
    }

    /// A new storage buffer for indirect dispatches.
    pub fn indirect(&mut self, what: &'static str, bytes: u64) -> BufferId {
        self.add(what, bytes, BufferKind::Indirect)
    }

    fn add(&mut self, what: &'static str, bytes: u64, kind: BufferKind) -> BufferId {
        let id = self.ids.next();
        self.plan.new_buffers.push(NewBuffer { id, what, bytes, kind });
        id
    }
}

/// Which buffers have too little room for a frame.
#[derive(Clone, Copy, Debug)]
pub(super) enum Shortage {
    /// Those of nodes, of lights and of the records of trees.
    Trees(PlanError),
    /// Those whose sizes follow the number of parts.
    Parts(PlanError),
    /// Those that no other order makes room in.
    Others(PlanError),
}
