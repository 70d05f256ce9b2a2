//! A run that was recorded goes the same way again, on any machine.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use super::clock::{Clock, Work};

/// An answer that a clock gave.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ClockEvent {
    /// The time.
    Now(Duration),
    /// What a build in the background took, if it may be taken.
    Background(Option<Duration>),
}

/// A clock that writes down what another one says, for a [`ReplayClock`].
#[derive(Debug)]
pub struct RecordingClock<C> {
    clock: C,
    events: Mutex<Vec<ClockEvent>>,
}

impl<C: Clock> RecordingClock<C> {
    /// Records a clock from now on.
    pub fn new(clock: C) -> Self {
        Self { clock, events: Mutex::default() }
    }

    /// What was said since the last call; to be called every now and then, since it grows by some 16 bytes a question.
    pub fn take_events(&self) -> Vec<ClockEvent> {
        std::mem::take(&mut *lock(&self.events))
    }

    fn note(&self, event: ClockEvent) {
        lock(&self.events).push(event);
    }
}

impl<C: Clock> Clock for RecordingClock<C> {
    fn now(&self) -> Duration {
        let now = self.clock.now();
        self.note(ClockEvent::Now(now));
        now
    }

    fn worked(&self, work: Work) {
        self.clock.worked(work);
    }

    fn background(&self, started: Duration, work: Work, done: Option<Duration>) -> Option<Duration> {
        let took = self.clock.background(started, work, done);
        self.note(ClockEvent::Background(took));
        took
    }
}

/// A clock that says what a [`RecordingClock`] wrote down: a world that gets the same edits, budgets, views and
/// picks then makes the same decisions and ends with the same trees, by the same build of the program. Where the
/// questions are others than those of the record, it goes on as best it can: it skips to the next answer of the
/// right kind, and after the last one the time stands still.
#[derive(Debug)]
pub struct ReplayClock {
    state: Mutex<ReplayState>,
}

#[derive(Debug)]
struct ReplayState {
    events: VecDeque<ClockEvent>,
    last: Duration,
    is_off: bool,
}

impl ReplayClock {
    /// Says these, one after the other.
    pub fn new(events: impl IntoIterator<Item = ClockEvent>) -> Self {
        let state = ReplayState { events: events.into_iter().collect(), last: Duration::ZERO, is_off: false };
        Self { state: Mutex::new(state) }
    }

    /// Whether a question had no answer in the record, so that the run is another than the recorded one.
    pub fn has_diverged(&self) -> bool {
        lock(&self.state).is_off
    }
}

impl ReplayState {
    fn next<T>(&mut self, wanted: impl Fn(ClockEvent) -> Option<T>) -> Option<T> {
        while let Some(event) = self.events.pop_front() {
            if let Some(answer) = wanted(event) {
                return Some(answer);
            }
            self.is_off = true;
        }
        self.is_off = true;
        None
    }
}

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

/// What is locked here is whole whoever panicked.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
