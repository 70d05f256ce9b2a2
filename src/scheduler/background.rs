//! Builds trees on another thread while frames go on: those too large for a frame.
//!
//! The thread belongs to a pool of its own. On rayon's common one a refit, which waits for its parts, would wait behind
//! a build. One build at a time: what is built in the background is paid for too, and the next one can use what changed
//! meanwhile.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use super::clock::{Work, WorkKind};
use crate::keys::TreeKey;
use crate::light::Light;
use crate::tree::LightTree;

/// A tree whose lights are being copied.
#[derive(Debug)]
pub(crate) struct Snapshot {
    pub key: TreeKey,
    /// By which the tree knows that it is still asked for.
    pub ticket: u64,
    /// Those copied so far. They may come from several frames: where a light has changed since, it is set again when the
    /// build is done.
    pub lights: Vec<Light>,
}

/// A build on its way.
#[derive(Debug)]
pub(crate) struct Running {
    pub key: TreeKey,
    pub ticket: u64,
    pub work: Work,
    pub started: Duration,
    result: Arc<Slot>,
}

#[derive(Debug, Default)]
struct Slot {
    tree: Mutex<Option<LightTree>>,
    is_done: Condvar,
}

fn lock(slot: &Slot) -> MutexGuard<'_, Option<LightTree>> {
    // A tree is there or not, whoever panicked.
    slot.tree.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Running {
    /// Whether the tree is there.
    pub fn is_done(&self) -> bool {
        lock(&self.result).is_some()
    }

    /// The tree; waits for it. `None` if it was taken before.
    pub fn wait(self) -> Option<LightTree> {
        let waiting = self.result.is_done.wait_while(lock(&self.result), |tree| tree.is_none());
        waiting.unwrap_or_else(PoisonError::into_inner).take()
    }
}

/// Where builds run.
#[derive(Default)]
pub(crate) struct Builder {
    #[cfg(feature = "parallel")]
    pool: Option<rayon::ThreadPool>,
    /// There are no threads here; not asked again.
    is_off: bool,
}

impl Builder {
    /// Starts a build. `None` where there are no threads.
    pub fn start(&mut self, snapshot: Snapshot, now: Duration) -> Option<Running> {
        let Snapshot { key, ticket, lights } = snapshot;
        let work = Work { kind: WorkKind::Background, lights: lights.len() };
        let result = Arc::new(Slot::default());
        self.spawn(lights, Arc::clone(&result))?;
        Some(Running { key, ticket, work, started: now, result })
    }

    #[cfg(feature = "parallel")]
    fn spawn(&mut self, lights: Vec<Light>, result: Arc<Slot>) -> Option<()> {
        if self.pool.is_none() && !self.is_off {
            let name = |_| "girandole build".to_owned();
            self.pool = rayon::ThreadPoolBuilder::new().num_threads(1).thread_name(name).build().ok();
            self.is_off = self.pool.is_none();
        }
        self.pool.as_ref()?.spawn(move || {
            let tree = LightTree::build(lights);
            *lock(&result) = Some(tree);
            result.is_done.notify_all();
        });
        Some(())
    }

    #[cfg(not(feature = "parallel"))]
    fn spawn(&mut self, _: Vec<Light>, _: Arc<Slot>) -> Option<()> {
        self.is_off = true;
        None
    }

    /// Whether builds can run.
    pub fn is_off(&self) -> bool {
        self.is_off
    }
}
