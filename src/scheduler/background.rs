//! Builds trees on another thread, over several frames. This is for trees that are too large for a
//! frame.
//!
//! The thread belongs to a pool of its own. On rayon's common pool a refit, which waits for its
//! parts, would wait behind a build. One build runs at a time: background builds are charged to
//! the budget too, and the choice of the next build can use what has changed in the meantime.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

#[cfg(feature = "parallel")]
use web_time::Instant;

use super::clock::Work;
use crate::keys::TreeKey;
use crate::light::Light;
use crate::tree::LightTree;

/// The copy of a tree's lights that a background build starts from, while it is being made.
#[derive(Debug)]
pub(crate) struct LightSnapshot {
    pub key: TreeKey,
    /// The number of the build. If the tree's own number differs, the build is no longer needed.
    pub build_id: u64,
    /// The lights copied so far, in order. They may be copied in several frames: lights that have
    /// changed since are set again when the build is installed.
    pub lights: Vec<Light>,
}

/// A build that runs or waits to be installed.
#[derive(Debug)]
pub(crate) struct RunningBuild {
    pub key: TreeKey,
    pub build_id: u64,
    pub work: Work,
    /// The time of the world's clock at which the build started.
    pub started: Duration,
    /// The nanoseconds that the background credit was charged for the build.
    pub charged_nanos: f64,
    result: Arc<BuildResult>,
}

#[derive(Debug, Default)]
struct BuildResult {
    /// The tree, and the time that its build took.
    built: Mutex<Option<(LightTree, Duration)>>,
    is_done: Condvar,
}

impl BuildResult {
    fn lock(&self) -> MutexGuard<'_, Option<(LightTree, Duration)>> {
        // The tree is either complete or missing, even after a panic.
        self.built.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl RunningBuild {
    /// The time that the build took on its thread; `None` while it runs.
    pub fn done(&self) -> Option<Duration> {
        self.result.lock().as_ref().map(|(_, took)| *took)
    }

    /// Blocks until the build is done and returns its tree; `None` if the tree was taken before.
    pub fn wait(self) -> Option<LightTree> {
        let built = self.result.is_done.wait_while(self.result.lock(), |built| built.is_none());
        built.unwrap_or_else(PoisonError::into_inner).take().map(|(tree, _)| tree)
    }
}

/// The thread that background builds run on; it starts with the first build.
#[derive(Debug, Default)]
pub(crate) struct BackgroundBuilder {
    #[cfg(feature = "parallel")]
    pool: Option<rayon::ThreadPool>,
    /// Creating the thread has failed; it is not tried again.
    has_failed: bool,
}

impl BackgroundBuilder {
    /// Starts a build at time `now` of the world's clock. `None` where threads are unavailable.
    pub fn start(
        &mut self,
        snapshot: LightSnapshot,
        work: Work,
        charged_nanos: f64,
        now: Duration,
    ) -> Option<RunningBuild> {
        let LightSnapshot { key, build_id, lights } = snapshot;
        let result = Arc::new(BuildResult::default());
        self.spawn(lights, Arc::clone(&result))?;
        Some(RunningBuild { key, build_id, work, started: now, charged_nanos, result })
    }

    #[cfg(feature = "parallel")]
    fn spawn(&mut self, lights: Vec<Light>, result: Arc<BuildResult>) -> Option<()> {
        if self.pool.is_none() && !self.has_failed {
            let name = |_| "girandole build".to_owned();
            self.pool = rayon::ThreadPoolBuilder::new().num_threads(1).thread_name(name).build().ok();
            self.has_failed = self.pool.is_none();
        }
        self.pool.as_ref()?.spawn(move || {
            // The build is measured by the machine's clock: a run could not be repeated if two
            // threads read the world's clock. `Clock::background` receives this time and decides.
            let start = Instant::now();
            let tree = LightTree::build(lights);
            *result.lock() = Some((tree, start.elapsed()));
            result.is_done.notify_all();
        });
        Some(())
    }

    #[cfg(not(feature = "parallel"))]
    fn spawn(&mut self, _: Vec<Light>, _: Arc<BuildResult>) -> Option<()> {
        None
    }

    /// Whether builds cannot run in the background.
    pub fn is_unavailable(&self) -> bool {
        self.has_failed || cfg!(not(feature = "parallel"))
    }
}
