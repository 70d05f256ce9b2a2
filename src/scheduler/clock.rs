//! Time comes in from outside: the machine's, a virtual one for tests and benchmarks, or a recorded run's.

use std::sync::Mutex;
use std::time::{Duration, Instant};

/// A piece of work that the world does on trees, for clocks that reckon time instead of measuring it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Work {
    /// What is done.
    pub kind: WorkKind,
    /// To so many lights.
    pub lights: usize,
}

/// See [`Work`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum WorkKind {
    /// Brings edited trees up to date; all trees of a frame at once, on several threads.
    Refit,
    /// Builds a tree anew within the frame.
    Rebuild,
    /// Builds a subtree anew within the frame.
    RebuildPart,
    /// Copies a tree's lights for a build in the background.
    Snapshot,
    /// Builds a tree in the background, on another thread.
    Background,
    /// Measures the noise of a tree, before and after a rebuild.
    Probe,
}

/// Tells the time since some fixed moment. The world has one, so that tests and replays need no real time.
///
/// A clock that jumps or stands still does no harm: a step back counts as no time, and no job counts as less than what
/// the fastest machine would need, so that frames stay bounded.
pub trait Clock: Send + Sync {
    /// Should not go back.
    fn now(&self) -> Duration;

    /// Told of each piece of work as it ends, before the time is asked for; a virtual clock moves on by what it takes.
    fn worked(&self, work: Work) {
        let _ = work;
    }

    /// How long a build took that was `started` in the background, if it may take the present tree's place now. `done`
    /// is what it took on its thread, once it is finished; for a build that is not, an answer makes the world wait for
    /// it. Anything but `done` is for clocks whose runs are to repeat exactly.
    fn background(&self, started: Duration, work: Work, done: Option<Duration>) -> Option<Duration> {
        let _ = (started, work);
        done
    }
}

/// The machine's monotonic clock.
#[derive(Debug)]
pub struct SystemClock(Instant);

impl Default for SystemClock {
    fn default() -> Self {
        Self(Instant::now())
    }
}

impl Clock for SystemClock {
    fn now(&self) -> Duration {
        self.0.elapsed()
    }
}

/// A clock that moves only when it is told to, and by what each piece of work is said to take: a run on it repeats
/// exactly, on any machine.
pub struct VirtualClock {
    now: Mutex<Duration>,
    cost: Box<dyn Fn(Work) -> Duration + Send + Sync>,
}

impl VirtualClock {
    /// Starts at zero. `cost` says what a piece of work takes. It may remember what it said, but is asked for
    /// [`WorkKind::Background`] again and again, and should then say the same for the same lights.
    pub fn new(cost: impl Fn(Work) -> Duration + Send + Sync + 'static) -> Self {
        Self { now: Mutex::new(Duration::ZERO), cost: Box::new(cost) }
    }

    /// Lets time pass, say until the next frame.
    pub fn advance(&self, time: Duration) {
        let mut now = self.lock();
        *now = now.saturating_add(time);
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Duration> {
        // A time is whole whoever panicked.
        self.now.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

impl std::fmt::Debug for VirtualClock {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("VirtualClock").field("now", &self.now()).finish_non_exhaustive()
    }
}

impl Clock for VirtualClock {
    fn now(&self) -> Duration {
        *self.lock()
    }

    fn worked(&self, work: Work) {
        self.advance((self.cost)(work));
    }

    fn background(&self, started: Duration, work: Work, _: Option<Duration>) -> Option<Duration> {
        let cost = (self.cost)(work);
        (self.now() >= started.saturating_add(cost)).then_some(cost)
    }
}
