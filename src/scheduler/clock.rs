//! Clocks that a world reads the time from: the machine's, and a virtual one.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

// `std::time::Instant` panics on wasm32-unknown-unknown.
use web_time::Instant;

/// A piece of work on trees. A world describes its work to its [`Clock`], so that a clock can
/// compute the time that the work takes instead of measuring it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct Work {
    /// The kind of work.
    pub kind: WorkKind,
    /// The number of lights that the work processes.
    pub lights: usize,
}

/// The kind of a piece of [`Work`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum WorkKind {
    /// The refit of all trees that were edited since the last update, on several threads with the
    /// feature `parallel`. One piece of work per update; its lights are those of all these trees.
    Refit,
    /// The rebuild of a whole tree within the frame.
    Rebuild,
    /// A slice of the build of a tree that does not fit into one frame. `lights` of the [`Work`]
    /// is the share of the tree's lights that the slice stands for: over all slices of a build
    /// they add up to about the number of lights of the tree.
    Slice {
        /// The number of lights of the tree.
        tree_lights: usize,
    },
    /// The rest of the build of a tree in the background, on another thread, after its lights were
    /// copied in slices.
    Background,
}

/// A source of time for a [`LightWorld`](crate::LightWorld), which reads the time from nowhere
/// else.
///
/// [`SystemClock`] measures time, [`VirtualClock`] computes it, and
/// [`ReplayClock`](crate::scheduler::ReplayClock) repeats the times of an earlier run. A world
/// takes its clock in [`LightWorld::with_clock`](crate::LightWorld::with_clock).
///
/// This trait is sealed: only the clocks of this library implement it. A [`VirtualClock`] takes any
/// function for the cost of work.
///
/// A clock that jumps or stops does no harm. A step back counts as no time, and every job counts
/// as at least the time that the fastest machine would need, so the work in a frame stays bounded.
pub trait Clock: sealed::Sealed + Send + Sync {
    /// Returns the time since a fixed moment, which each clock chooses. It should never decrease.
    fn now(&self) -> Duration;

    /// Reports that `work` has just ended. The world calls this before it reads the time at the end
    /// of the work. A virtual clock advances by the duration of the work; the default does nothing.
    fn worked(&self, work: Work) {
        let _ = work;
    }

    /// Decides whether a build in the background is installed now, and how long it took. The world
    /// asks once per update while a build runs.
    ///
    /// - `started` is the time of this clock at which the build started.
    /// - `work` is the build: its kind is [`WorkKind::Background`].
    /// - `done` is the time that the build took, measured on its own thread; `None` while it runs.
    ///
    /// Returns
    /// - `Some(d)`: install now and block until it is done. The build counts as having taken `d`:
    ///   the cost model learns from it, and it is charged to the budgets of frames.
    /// - `None`: not yet.
    ///
    /// The default returns `done`, so that no frame waits for a build. Only clocks whose runs must
    /// repeat exactly should return anything else.
    fn background(&self, started: Duration, work: Work, done: Option<Duration>) -> Option<Duration> {
        let _ = (started, work);
        done
    }
}

pub(crate) mod sealed {
    /// Is implemented by the clocks of this library alone.
    pub trait Sealed {}
}

impl sealed::Sealed for SystemClock {}

impl sealed::Sealed for VirtualClock {}

/// The machine's monotonic clock. Its time starts at zero when it is created.
///
/// On `wasm32-unknown-unknown` it reads the browser's `performance.now()`.
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

/// A clock that advances only by [`VirtualClock::advance`] and by the stated cost of each piece of
/// work. A run on it repeats exactly, on any machine.
///
/// A build in the background counts as done once the time of this clock has advanced by the cost of
/// the build; if its thread is slower than that, the update waits for it.
///
/// ```
/// use std::sync::Arc;
/// use std::time::Duration;
///
/// use girandole::LightWorld;
/// use girandole::scheduler::{Clock, VirtualClock};
///
/// // Every piece of work takes 100 ns per light.
/// let clock = Arc::new(VirtualClock::new(|work| Duration::from_nanos(100 * work.lights as u64)));
/// let world = LightWorld::with_clock(clock.clone());
/// clock.advance(Duration::from_millis(16));
/// assert_eq!(clock.now(), Duration::from_millis(16));
/// # let _ = world;
/// ```
pub struct VirtualClock {
    state: Mutex<VirtualState>,
    cost: Box<dyn Fn(Work) -> Duration + Send + Sync>,
}

#[derive(Default)]
struct VirtualState {
    now: Duration,
    /// The last build in the background: when it started, its work, and the time that it takes.
    build: Option<(Duration, Work, Duration)>,
}

impl VirtualClock {
    /// Creates a clock at time zero. `cost` returns the time that a piece of work takes.
    ///
    /// `cost` may keep state. It is called once for each piece of work, and once for each build in
    /// the background.
    pub fn new(cost: impl Fn(Work) -> Duration + Send + Sync + 'static) -> Self {
        Self { state: Mutex::default(), cost: Box::new(cost) }
    }

    /// Advances the clock, for example to the next frame. The time saturates at [`Duration::MAX`].
    pub fn advance(&self, time: Duration) {
        let mut state = self.lock();
        state.now = state.now.saturating_add(time);
    }

    fn lock(&self) -> MutexGuard<'_, VirtualState> {
        // A panic while the lock is held leaves a valid time.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl std::fmt::Debug for VirtualClock {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("VirtualClock").field("now", &self.now()).finish_non_exhaustive()
    }
}

impl Clock for VirtualClock {
    fn now(&self) -> Duration {
        self.lock().now
    }

    fn worked(&self, work: Work) {
        self.advance((self.cost)(work));
    }

    fn background(&self, started: Duration, work: Work, _: Option<Duration>) -> Option<Duration> {
        let known = self.lock().build.filter(|(start, of, _)| (*start, *of) == (started, work));
        let cost = known.map_or_else(|| (self.cost)(work), |(.., cost)| cost);
        let mut state = self.lock();
        state.build = Some((started, work, cost));
        (state.now >= started.saturating_add(cost)).then_some(cost)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_system_clock_starts_at_zero_and_passes() {
        let clock = SystemClock::default();
        let first = clock.now();
        std::thread::sleep(Duration::from_millis(2));
        assert!(clock.now() - first >= Duration::from_millis(2));
    }

    #[test]
    fn a_virtual_clock_shows_its_time() {
        let clock = VirtualClock::new(|_| Duration::ZERO);
        clock.advance(Duration::from_millis(16));
        assert_eq!(format!("{clock:?}"), "VirtualClock { now: 16ms, .. }");
    }
}
