//! Clocks that record a run and replay it, on any machine.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use super::clock::{Clock, Work, sealed::Sealed};

/// One answer of a recorded clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ClockEvent {
    /// [`Clock::now`] returned this time.
    Now(Duration),
    /// [`Clock::background`] returned this: `Some` installed the build, `None` did not.
    Background(Option<Duration>),
}

/// A clock that passes every call on to another clock and records its answers, for a
/// [`ReplayClock`].
///
/// The record grows by some 16 bytes per answer until [`RecordingClock::take_events`] is called.
#[derive(Debug)]
pub struct RecordingClock<C> {
    clock: C,
    events: Mutex<Vec<ClockEvent>>,
}

impl<C: Clock> RecordingClock<C> {
    /// Starts to record the answers of a clock.
    pub fn new(clock: C) -> Self {
        Self { clock, events: Mutex::default() }
    }

    /// Returns the answers since the last call, oldest first, and forgets them. A program that
    /// records for long should call this regularly, for example to write the events to a file.
    ///
    /// A replay needs all events since the world was created, in order.
    #[must_use]
    pub fn take_events(&self) -> Vec<ClockEvent> {
        std::mem::take(&mut *lock(&self.events))
    }

    fn record(&self, event: ClockEvent) {
        lock(&self.events).push(event);
    }
}

impl<C> Sealed for RecordingClock<C> {}

impl<C: Clock> Clock for RecordingClock<C> {
    fn now(&self) -> Duration {
        let now = self.clock.now();
        self.record(ClockEvent::Now(now));
        now
    }

    fn worked(&self, work: Work) {
        self.clock.worked(work);
    }

    fn background(&self, started: Duration, work: Work, done: Option<Duration>) -> Option<Duration> {
        let took = self.clock.background(started, work, done);
        self.record(ClockEvent::Background(took));
        took
    }
}

/// A clock that repeats the answers that a [`RecordingClock`] recorded.
///
/// A world with the same edits, budgets and viewpoints as in the recorded run makes the
/// same decisions and ends with the same trees. Both runs must use the same build of the program.
/// An update waits for a build in the background where the recorded run installed one.
///
/// If the calls differ from the recorded ones, the replay continues as well as it can: it skips to
/// the next answer of the right kind. After the last one the time no longer advances, and a build
/// in the background is installed once it is done.
#[derive(Debug)]
pub struct ReplayClock {
    state: Mutex<ReplayState>,
}

#[derive(Debug)]
struct ReplayState {
    events: VecDeque<ClockEvent>,
    /// The last time that was returned.
    last: Duration,
    has_diverged: bool,
}

impl ReplayClock {
    /// Creates a clock that returns these answers, in order.
    pub fn new(events: impl IntoIterator<Item = ClockEvent>) -> Self {
        let state = ReplayState { events: events.into_iter().collect(), last: Duration::ZERO, has_diverged: false };
        Self { state: Mutex::new(state) }
    }

    /// Returns whether the run differs from the recorded one: some call so far found an answer of
    /// another kind, or none. Answers that are left at the end do not count.
    pub fn has_diverged(&self) -> bool {
        lock(&self.state).has_diverged
    }
}

impl ReplayState {
    /// Removes the events up to the first one that `select` accepts, and returns what it selected.
    fn next<T>(&mut self, select: impl Fn(ClockEvent) -> Option<T>) -> Option<T> {
        while let Some(event) = self.events.pop_front() {
            if let Some(answer) = select(event) {
                return Some(answer);
            }
            self.has_diverged = true;
        }
        self.has_diverged = true;
        None
    }
}

impl Sealed for ReplayClock {}

impl Clock for ReplayClock {
    fn now(&self) -> Duration {
        let mut state = lock(&self.state);
        let time = |event| if let ClockEvent::Now(time) = event { Some(time) } else { None };
        if let Some(time) = state.next(time) {
            state.last = time;
        }
        state.last
    }

    fn background(&self, _: Duration, _: Work, done: Option<Duration>) -> Option<Duration> {
        let answer = |event| if let ClockEvent::Background(answer) = event { Some(answer) } else { None };
        lock(&self.state).next(answer).unwrap_or(done)
    }
}

/// Locks a mutex. A panic while the lock is held leaves a valid value in both clocks.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scheduler::{VirtualClock, WorkKind};

    #[test]
    fn a_recording_clock_passes_work_on_and_records_the_times() {
        let clock = RecordingClock::new(VirtualClock::new(|work| Duration::from_nanos(work.lights as u64)));
        let work = Work { kind: WorkKind::Rebuild, lights: 70 };
        clock.worked(work);
        assert_eq!(clock.now(), Duration::from_nanos(70));
        assert_eq!(clock.background(Duration::ZERO, work, None), Some(Duration::from_nanos(70)));
        let ends = Duration::from_nanos(70);
        assert_eq!(clock.take_events(), [ClockEvent::Now(ends), ClockEvent::Background(Some(ends))]);
        assert!(clock.take_events().is_empty());
    }
}
