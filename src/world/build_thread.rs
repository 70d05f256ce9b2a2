//! Finishes builds on a thread of its own.
//!
//! The thread belongs to a pool of its own. On rayon's common pool a refit, which waits for its
//! parts, would wait behind a build.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

#[cfg(feature = "parallel")]
use web_time::Instant;

use crate::scheduler::Work;
use crate::span::span;
use crate::tree::{LightTree, TreeBuild};

/// The nodes of the smallest tree whose data are freed on the thread. Those of smaller ones take some 50 us.
#[cfg(feature = "parallel")]
const FREED_ON_THREAD: usize = 1024;

/// A build that runs or waits to be installed.
#[derive(Debug)]
pub(super) struct RunningBuild {
    pub work: Work,
    /// The time of the world's clock at which the build started.
    pub started: Duration,
    result: Arc<BuildResult>,
}

#[derive(Debug, Default)]
struct BuildResult {
    built: Mutex<Option<Built>>,
    is_done: Condvar,
}

#[derive(Debug)]
struct Built {
    /// `None` after a panic, which only a defect of this library can cause.
    tree: Option<LightTree>,
    took: Duration,
}

impl BuildResult {
    fn lock(&self) -> MutexGuard<'_, Option<Built>> {
        // The result is either complete or missing, even after a panic.
        self.built.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl RunningBuild {
    /// The time that the build took on its thread; `None` while it runs.
    pub fn done(&self) -> Option<Duration> {
        self.result.lock().as_ref().map(|built| built.took)
    }

    /// Blocks until the build is done and returns its tree; `None` if the build has failed.
    pub fn wait(self) -> Option<LightTree> {
        let built = self.result.is_done.wait_while(self.result.lock(), |built| built.is_none());
        built.unwrap_or_else(PoisonError::into_inner).take()?.tree
    }
}

/// The thread that builds run on, and that frees large trees between them. It starts when it is needed.
#[derive(Debug, Default)]
pub(super) struct BuildThread {
    #[cfg(feature = "parallel")]
    pool: Option<rayon::ThreadPool>,
    /// Creating the thread has failed; it is not tried again.
    #[cfg(feature = "parallel")]
    has_failed: bool,
}

impl BuildThread {
    /// Whether builds can run on the thread.
    #[cfg(feature = "parallel")]
    pub fn is_available(&mut self) -> bool {
        if self.pool.is_none() && !self.has_failed {
            let name = |_| "girandole build".to_owned();
            self.pool = rayon::ThreadPoolBuilder::new().num_threads(1).thread_name(name).build().ok();
            self.has_failed = self.pool.is_none();
        }
        self.pool.is_some()
    }

    #[cfg(not(feature = "parallel"))]
    pub fn is_available(&mut self) -> bool {
        false
    }

    /// Finishes a build that has all its lights, from time `now` of the world's clock on. The
    /// thread must be [available](Self::is_available).
    #[cfg(feature = "parallel")]
    pub fn start(&self, build: TreeBuild, work: Work, now: Duration) -> RunningBuild {
        let result = Arc::new(BuildResult::default());
        let running = RunningBuild { work, started: now, result: Arc::clone(&result) };
        let pool = self.pool.as_ref().expect("the thread is available");
        pool.spawn(move || {
            // The build is measured by the machine's clock: a run could not be repeated if two
            // threads read the world's clock. `Clock::background` receives this time and decides.
            let start = Instant::now();
            // Rayon would abort the process.
            let tree = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| finished(build))).ok();
            *result.lock() = Some(Built { tree, took: start.elapsed() });
            result.is_done.notify_all();
        });
        running
    }

    /// Frees the data of a tree of so many nodes. Those of a million lights take ten milliseconds, so those
    /// of large trees are freed on the thread.
    #[cfg_attr(not(feature = "parallel"), expect(unused_variables, reason = "there is no thread"))]
    pub fn free<T: Send + 'static>(&mut self, data: T, nodes: usize) {
        #[cfg(feature = "parallel")]
        if nodes >= FREED_ON_THREAD
            && self.is_available()
            && let Some(pool) = &self.pool
        {
            return pool.spawn(move || drop(data));
        }
        drop(data);
    }

    #[cfg(not(feature = "parallel"))]
    pub fn start(&self, build: TreeBuild, work: Work, now: Duration) -> RunningBuild {
        // Never called, since no thread is available; a build on this thread gives the same tree.
        let built = Built { tree: Some(finished(build)), took: Duration::ZERO };
        let result = BuildResult { built: Mutex::new(Some(built)), is_done: Condvar::new() };
        RunningBuild { work, started: now, result: Arc::new(result) }
    }
}

fn finished(build: TreeBuild) -> LightTree {
    span!("rebuild");
    build.finish()
}
