//! Pipelines made for the effects a world calls for, without a frame that waits for one.

use crate::effects::Effects;
use workshop::Workshop;

/// How many special variants [`PipelineVariants`] keeps besides the general one. Fewer save memory; more bear more sets that
/// take turns.
pub const MAX_VARIANTS: usize = 8;

/// Pipelines (of the engine's own type `P`) by the effects that they serve.
///
/// One for [`Effects::all`] is there from the start. Another is made on a thread of its own, one at a time, while the
/// best that is ready serves. At most [`MAX_VARIANTS`] are kept; the one unused for longest goes first, the general
/// one never. If the making of one panics, it is not tried again, and what is there goes on serving. Where there are no
/// threads (WebAssembly) the general one serves always. Dropping waits for the one in the making.
///
/// ```
/// use girandole::Effects;
/// use girandole::gpu::PipelineVariants;
/// // Stands for: compile the text `gpu::wgsl(1, effects)` and what follows.
/// let make = |effects: Effects| format!("{effects:?}");
/// let mut variants = PipelineVariants::new(make(Effects::all()), make);
/// let wanted = Effects::CONES | Effects::MOVING;
/// while *variants.get(wanted) != make(wanted) {
///     std::thread::yield_now(); // a frame, drawn with the general pipeline
/// }
/// ```
pub struct PipelineVariants<P> {
    general: Variant<P>,
    special: Vec<Variant<P>>,
    /// Those whose making panicked.
    failed: Vec<Effects>,
    /// Counts calls.
    now: u64,
    workshop: Workshop<P>,
}

struct Variant<P> {
    effects: Effects,
    pipeline: P,
    /// The last call that it served.
    used: u64,
}

impl<P> PipelineVariants<P> {
    /// The pipeline that serves these effects with the fewest others, of those that are ready; never blocks. If none is
    /// made for just these, it is asked for, unless another is in the making.
    pub fn get(&mut self, effects: Effects) -> &P {
        self.now += 1;
        self.collect();
        let is_there = self.has(effects) || self.failed.contains(&effects);
        if !is_there && !self.workshop.is_busy() && !self.workshop.start(effects) {
            self.failed.push(effects);
        }
        let now = self.now;
        let fitting = self.special.iter_mut().filter(|variant| variant.effects.contains(effects));
        let best = fitting.min_by_key(|variant| variant.effects.bits().count_ones()).unwrap_or(&mut self.general);
        best.used = now;
        &best.pipeline
    }

    /// Whether a pipeline for just these effects is ready.
    pub fn has(&self, effects: Effects) -> bool {
        self.ready().any(|ready| ready == effects)
    }

    /// The sets that pipelines are ready for, that of all effects first.
    pub fn ready(&self) -> impl Iterator<Item = Effects> {
        std::iter::once(&self.general).chain(&self.special).map(|variant| variant.effects)
    }

    /// Takes in what was finished.
    fn collect(&mut self) {
        match self.workshop.finished() {
            None => {}
            Some((effects, None)) => self.failed.push(effects),
            Some((effects, Some(pipeline))) => {
                let oldest = self.special.iter().enumerate().min_by_key(|(_, variant)| variant.used);
                if let Some((oldest, _)) = oldest.filter(|_| self.special.len() >= MAX_VARIANTS) {
                    self.special.swap_remove(oldest);
                }
                self.special.push(Variant { effects, pipeline, used: self.now });
            }
        }
    }

    fn with(general: P, workshop: Workshop<P>) -> Self {
        let general = Variant { effects: Effects::all(), pipeline: general, used: 0 };
        Self { general, special: Vec::new(), failed: Vec::new(), now: 0, workshop }
    }
}

#[cfg(not(target_family = "wasm"))]
impl<P: Send + 'static> PipelineVariants<P> {
    /// With the pipeline for [`Effects::all`], and what makes others, on other threads.
    pub fn new(general: P, make: impl Fn(Effects) -> P + Send + Sync + 'static) -> Self {
        Self::with(general, Workshop::new(make))
    }
}

#[cfg(target_family = "wasm")]
impl<P> PipelineVariants<P> {
    /// With the pipeline for [`Effects::all`], which serves always: there are no threads to make others on.
    pub fn new(general: P, _make: impl Fn(Effects) -> P + 'static) -> Self {
        Self::with(general, Workshop(std::marker::PhantomData))
    }
}

#[cfg(not(target_family = "wasm"))]
mod workshop {
    use std::sync::Arc;
    use std::sync::mpsc::{Receiver, TryRecvError, sync_channel};
    use std::thread::{Builder, JoinHandle};

    use crate::effects::Effects;

    /// Starts a thread that makes a pipeline.
    type Start<P> = dyn Fn(Effects) -> std::io::Result<Job<P>> + Send + Sync;

    /// Makes one pipeline at a time.
    pub(super) struct Workshop<P> {
        start: Box<Start<P>>,
        job: Option<Job<P>>,
    }

    pub(super) struct Job<P> {
        effects: Effects,
        result: Receiver<P>,
        thread: JoinHandle<()>,
    }

    impl<P> Workshop<P> {
        pub(super) fn new(make: impl Fn(Effects) -> P + Send + Sync + 'static) -> Self
        where
            P: Send + 'static,
        {
            let make = Arc::new(make);
            let start = move |effects| {
                let make = make.clone();
                let (sender, result) = sync_channel(1);
                let thread = Builder::new().name("girandole variant".into()).spawn(move || {
                    // Nobody hears it once the cache is gone.
                    let _ = sender.send(make(effects));
                })?;
                Ok(Job { effects, result, thread })
            };
            Self { start: Box::new(start), job: None }
        }

        pub(super) fn is_busy(&self) -> bool {
            self.job.is_some()
        }

        /// False if the system grants no thread.
        pub(super) fn start(&mut self, effects: Effects) -> bool {
            self.job = (self.start)(effects).ok();
            self.job.is_some()
        }

        /// What was in the making and is not any more; `None` in place of a pipeline if the making panicked.
        pub(super) fn finished(&mut self) -> Option<(Effects, Option<P>)> {
            let result = match self.job.as_ref()?.result.try_recv() {
                Err(TryRecvError::Empty) => return None,
                result => result.ok(),
            };
            self.job.take().map(|job| (job.effects, result))
        }
    }

    impl<P> Drop for Workshop<P> {
        /// A thread in a driver's compiler must not outlive what tears the driver down.
        fn drop(&mut self) {
            if let Some(job) = self.job.take() {
                // A panic of its own is none of ours.
                let _ = job.thread.join();
            }
        }
    }
}

#[cfg(target_family = "wasm")]
mod workshop {
    use crate::effects::Effects;

    /// Makes nothing.
    pub(super) struct Workshop<P>(pub std::marker::PhantomData<P>);

    impl<P> Workshop<P> {
        pub(super) fn is_busy(&self) -> bool {
            false
        }

        pub(super) fn start(&mut self, _effects: Effects) -> bool {
            false
        }

        pub(super) fn finished(&mut self) -> Option<(Effects, Option<P>)> {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{Receiver, Sender, channel};
    use std::sync::{Arc, Mutex};
    use std::time::{Duration, Instant};

    use super::*;

    /// PipelineVariants whose making waits for a word from the test: true to go on, false to panic. Also says what was begun.
    fn controlled() -> (PipelineVariants<Effects>, Sender<bool>, Receiver<Effects>) {
        let (allow, allowed) = channel();
        let (begin, begun) = channel();
        let hands = Arc::new(Mutex::new((allowed, begin)));
        let make = move |effects| {
            let goes_well: bool = {
                let hands = hands.lock().expect("panics come after this");
                hands.1.send(effects).expect("the test listens");
                hands.0.recv().expect("the test goes on")
            };
            assert!(goes_well, "as the test wants");
            effects
        };
        (PipelineVariants::new(Effects::all(), make), allow, begun)
    }

    /// Calls `get` until a variant is ready. The bound is only to end a test that fails.
    fn await_ready(variants: &mut PipelineVariants<Effects>, effects: Effects) {
        let start = Instant::now();
        while *variants.get(effects) != effects {
            assert!(start.elapsed() < Duration::from_secs(60), "{effects:?} never comes");
            std::thread::yield_now();
        }
    }

    #[test]
    fn the_general_one_serves_until_the_special_one_is_ready_and_one_is_made_at_a_time() {
        let (mut variants, allow, begun) = controlled();
        let [one, two] = [Effects::CONES, Effects::CONES | Effects::RANGES];
        // The maker waits for us: were `get` to wait for it, this would never end.
        for _ in 0..100 {
            assert_eq!(*variants.get(two), Effects::all());
            assert_eq!(*variants.get(one), Effects::all());
        }
        assert_eq!(begun.recv(), Ok(two));
        assert!(begun.try_recv().is_err(), "two at a time");
        allow.send(true).expect("it waits");
        await_ready(&mut variants, two);
        // What contains the wanted effects serves before what contains all.
        assert_eq!(*variants.get(one), two);
        assert_eq!(begun.recv(), Ok(one));
        allow.send(true).expect("it waits");
        await_ready(&mut variants, one);
        assert_eq!(*variants.get(Effects::CONES), one);
        assert_eq!(*variants.get(two), two);
        assert_eq!(variants.ready().collect::<Vec<_>>(), [Effects::all(), two, one]);
        assert_eq!(*variants.get(Effects::all()), Effects::all());
        assert!(begun.try_recv().is_err(), "what is there was made again");
    }

    #[test]
    fn a_making_that_panics_is_not_repeated_and_harms_no_other() {
        let (mut variants, allow, begun) = controlled();
        assert_eq!(*variants.get(Effects::CONES), Effects::all());
        allow.send(false).expect("it waits");
        assert_eq!(begun.recv(), Ok(Effects::CONES));
        // Asked for until the failure is known and the next one is begun.
        allow.send(true).expect("somebody will listen");
        await_ready(&mut variants, Effects::AREAS);
        assert_eq!(begun.recv(), Ok(Effects::AREAS));
        for _ in 0..100 {
            assert_eq!(*variants.get(Effects::CONES), Effects::all());
        }
        // Were the failed one in the making again, it would come before this.
        allow.send(true).expect("somebody will listen");
        await_ready(&mut variants, Effects::RANGES);
        assert_eq!(begun.try_iter().collect::<Vec<_>>(), [Effects::RANGES]);
    }

    #[test]
    fn the_least_recently_used_goes_and_the_general_one_stays() {
        let (mut variants, allow, begun) = controlled();
        let sets: Vec<_> = (0..=MAX_VARIANTS as u8).map(Effects::from_bits_truncate).collect();
        for (number, effects) in sets.iter().enumerate() {
            allow.send(true).expect("it will wait");
            await_ready(&mut variants, *effects);
            // The first stays in use.
            assert!(number == MAX_VARIANTS || variants.has(sets[0]));
            variants.get(sets[0]);
        }
        assert_eq!(begun.try_iter().collect::<Vec<_>>(), sets);
        assert_eq!(variants.ready().count(), 1 + MAX_VARIANTS);
        assert!(variants.has(sets[0]) && !variants.has(sets[1]) && variants.has(sets[MAX_VARIANTS]));
        assert!(variants.has(Effects::all()));
    }
}
