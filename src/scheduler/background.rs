//! Builds trees on another thread while frames go on: those too large for a frame.
//!
//! The thread belongs to a pool of its own. On rayon's common one a refit, which waits for its parts, would wait behind
//! a build. One build at a time: what is built in the background is paid for too, and the next one can use what changed
//! meanwhile.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
#[cfg(feature = "parallel")]
use std::time::Instant;

use super::clock::Work;
use crate::keys::TreeKey;
use crate::light::Light;
use crate::tree::LightTree;

/// A tree whose lights are being copied.
#[derive(Debug)]
pub(crate) struct Snapshot {
    pub key: TreeKey,
    /// By which the tree knows that it is still asked for.
    pub ticket: u64,
    /// Those copied so far. They may come from several frames: where a light has changed since, it is set again when
    /// the build is done.
    pub lights: Vec<Light>,
}

/// A build on its way.
#[derive(Debug)]
pub(crate) struct Running {
    pub key: TreeKey,
    pub ticket: u64,
    pub work: Work,
    pub started: Duration,
    /// What the purse has paid for it, in nanoseconds.
    pub price: f64,
    result: Arc<Slot>,
}

#[derive(Debug, Default)]
struct Slot {
    /// With what it took.
    built: Mutex<Option<(LightTree, Duration)>>,
    is_done: Condvar,
}

fn lock(slot: &Slot) -> MutexGuard<'_, Option<(LightTree, Duration)>> {
    // A tree is there or not, whoever panicked.
    slot.built.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Running {
    /// What the build took, once the tree is there.
    pub fn done(&self) -> Option<Duration> {
        lock(&self.result).as_ref().map(|(_, took)| *took)
    }

    /// The tree; waits for it. `None` if it was taken before.
    pub fn wait(self) -> Option<LightTree> {
        let waiting = self.result.is_done.wait_while(lock(&self.result), |built| built.is_none());
        waiting.unwrap_or_else(PoisonError::into_inner).take().map(|(tree, _)| tree)
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
    pub fn start(&mut self, snapshot: Snapshot, work: Work, price: f64, now: Duration) -> Option<Running> {
        let Snapshot { key, ticket, lights } = snapshot;
        let result = Arc::new(Slot::default());
        self.spawn(lights, Arc::clone(&result))?;
        Some(Running { key, ticket, work, started: now, price, result })
    }

    #[cfg(feature = "parallel")]
    fn spawn(&mut self, lights: Vec<Light>, result: Arc<Slot>) -> Option<()> {
        if self.pool.is_none() && !self.is_off {
            let name = |_| "girandole build".to_owned();
            self.pool = rayon::ThreadPoolBuilder::new().num_threads(1).thread_name(name).build().ok();
            self.is_off = self.pool.is_none();
        }
        self.pool.as_ref()?.spawn(move || {
            // By the machine's clock, since the world's may not be asked by two threads at a time and still be
            // repeated; it hears of this, and has the last word.
            let start = Instant::now();
            let tree = LightTree::build(lights);
            *lock(&result) = Some((tree, start.elapsed()));
            result.is_done.notify_all();
        });
        Some(())
    }

    #[cfg(not(feature = "parallel"))]
    fn spawn(&mut self, _: Vec<Light>, _: Arc<Slot>) -> Option<()> {
        None
    }

    /// Whether builds can run.
    pub fn is_off(&self) -> bool {
        self.is_off || cfg!(not(feature = "parallel"))
    }
}
