//! A cache of pipelines for just the effects of a world. A more general pipeline serves while a
//! variant is made.

use std::fmt;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, TryRecvError};
use std::thread::JoinHandle;

use crate::effects::Effects;

/// The largest number of variants that [`PipelineVariants`] keeps besides the general one.
///
/// With fewer, less memory is used. With more, worlds that switch between more sets of effects find
/// their pipelines again.
pub const MAX_VARIANTS: usize = 8;

/// A cache of pipelines by the effects that they serve; `P` is the engine's own type of pipeline.
///
/// A pipeline for fewer effects runs faster, but no frame should wait until it is compiled. The
/// cache therefore starts with one pipeline for [`Effects::all`], which serves every world. When
/// [`PipelineVariants::get`] is called for a set that the cache lacks, it starts to make that
/// variant on a thread of its own, one at a time, and returns the best pipeline that is ready.
///
/// - At most [`MAX_VARIANTS`] variants are kept. The least recently used one is dropped first; the
///   general pipeline is never dropped.
/// - If the function panics for a set, that set is not tried again, and a more general pipeline
///   continues to serve it.
/// - Where no thread can be started, `get` makes the variant itself before it returns. This is
///   always so in browsers and other WebAssembly hosts, and on native platforms if the system
///   refuses a thread.
/// - [`Effects::MOVING`] changes no shader, so it is ignored: sets that differ only in it share one
///   pipeline.
///
/// Dropping the cache waits for the variant that is being made.
///
/// In browsers, `get` makes each variant before it returns, so the pipeline for all effects, whose
/// compilation takes longest, would never be used. [`PipelineVariants::on_demand`] makes none.
///
/// ```
/// use girandole::Effects;
/// use girandole::gpu::PipelineVariants;
/// // Stands for the compilation of `gpu::wgsl(1, effects)` and the engine's own text.
/// let make = |effects: Effects| format!("{effects:?}");
/// let mut variants = PipelineVariants::new(make(Effects::all()), make);
/// let effects = Effects::CONES | Effects::RANGES;
/// while *variants.get(effects) != make(effects) {
///     std::thread::yield_now(); // a frame that is drawn with the general pipeline
/// }
/// ```
pub struct PipelineVariants<P> {
    /// `None` in a cache that makes all pipelines on demand.
    general: Option<Variant<P>>,
    special: Vec<Variant<P>>,
    /// Sets whose making panicked.
    failed: Vec<Effects>,
    /// The number of calls of `get`.
    calls: u64,
    maker: VariantMaker<P>,
}

struct Variant<P> {
    /// Without [`Effects::MOVING`].
    effects: Effects,
    pipeline: P,
    /// The last call of `get` that returned it.
    last_used: u64,
}

impl<P> PipelineVariants<P> {
    /// Returns the best pipeline that is ready: the one that serves these effects and the fewest
    /// others.
    ///
    /// If none is made for just these effects, `get` starts to make one, unless another is being
    /// made. It waits for that only where no thread can be started, and in a cache that makes
    /// pipelines [on demand](PipelineVariants::on_demand).
    pub fn get(&mut self, effects: Effects) -> &P {
        let effects = key(effects);
        self.calls += 1;
        if let Some((effects, made)) = self.maker.take_finished() {
            self.keep(effects, made);
        }
        if !self.has(effects) && !self.failed.contains(&effects) && !self.maker.is_busy() {
            if self.general.is_none() {
                // Without a pipeline that could serve instead, a panic goes to the caller.
                let pipeline = (self.maker.make)(effects);
                self.keep(effects, Ok(pipeline));
            } else if let Some(made) = self.maker.start(effects) {
                self.keep(effects, made);
            }
        }
        let calls = self.calls;
        let fitting = self.general.iter_mut().chain(&mut self.special).filter(|one| one.effects.contains(effects));
        let best = fitting.min_by_key(|variant| variant.effects.bits().count_ones());
        let best = best.expect("there is a general pipeline, or the variant was made and no panic was caught");
        best.last_used = calls;
        &best.pipeline
    }

    /// Whether a pipeline for just these effects is ready.
    pub fn has(&self, effects: Effects) -> bool {
        self.ready().any(|ready| ready == key(effects))
    }

    /// The sets that pipelines are ready for, without [`Effects::MOVING`]; the set of all effects
    /// is first if there is a general pipeline.
    pub fn ready(&self) -> impl Iterator<Item = Effects> {
        self.general.iter().chain(&self.special).map(|variant| variant.effects)
    }

    /// Keeps a variant that was made, or remembers that its making panicked.
    fn keep(&mut self, effects: Effects, made: Made<P>) {
        let Ok(pipeline) = made else {
            self.failed.push(effects);
            return;
        };
        let oldest = self.special.iter().enumerate().min_by_key(|(_, variant)| variant.last_used);
        if let Some((oldest, _)) = oldest.filter(|_| self.special.len() >= MAX_VARIANTS) {
            self.special.swap_remove(oldest);
        }
        self.special.push(Variant { effects, pipeline, last_used: self.calls });
    }

    fn with_maker(general: Option<P>, maker: VariantMaker<P>) -> Self {
        let general = general.map(|pipeline| Variant { effects: key(Effects::all()), pipeline, last_used: 0 });
        Self { general, special: Vec::new(), failed: Vec::new(), calls: 0, maker }
    }
}

#[cfg(not(target_family = "wasm"))]
impl<P: Send + 'static> PipelineVariants<P> {
    /// Creates a cache with the pipeline for [`Effects::all`], and the function that makes the
    /// others.
    ///
    /// The function is given sets without [`Effects::MOVING`]. It is called on other threads; it
    /// must own what it needs, such as a [`LightShader`](super::LightShader).
    pub fn new(general: P, make: impl Fn(Effects) -> P + Send + Sync + 'static) -> Self {
        Self::with_maker(Some(general), VariantMaker::with_threads(make))
    }

    /// Creates a cache without a pipeline for all effects, which makes each pipeline inside of
    /// [`PipelineVariants::get`] when it is asked for first. It is for platforms where compilation
    /// on another thread gains nothing, such as browsers; elsewhere each new set of effects delays a
    /// frame.
    ///
    /// The function is given sets without [`Effects::MOVING`]. If it panics, so does `get`.
    pub fn on_demand(make: impl Fn(Effects) -> P + Send + Sync + 'static) -> Self {
        Self::with_maker(None, VariantMaker::without_threads(Box::new(make)))
    }
}

#[cfg(target_family = "wasm")]
impl<P> PipelineVariants<P> {
    /// Creates a cache with the pipeline for [`Effects::all`], and the function that makes the
    /// others, inside of [`PipelineVariants::get`].
    ///
    /// The function is given sets without [`Effects::MOVING`].
    pub fn new(general: P, make: impl Fn(Effects) -> P + 'static) -> Self {
        Self::with_maker(Some(general), VariantMaker::without_threads(Box::new(make)))
    }

    /// Creates a cache without a pipeline for all effects, which makes each pipeline inside of
    /// [`PipelineVariants::get`] when it is asked for first.
    ///
    /// The function is given sets without [`Effects::MOVING`]. If it panics, so does `get`.
    pub fn on_demand(make: impl Fn(Effects) -> P + 'static) -> Self {
        Self::with_maker(None, VariantMaker::without_threads(Box::new(make)))
    }
}

impl<P> fmt::Debug for PipelineVariants<P> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("PipelineVariants")
            .field("ready", &self.ready().collect::<Vec<_>>())
            .field("failed", &self.failed)
            .field("in_progress", &self.maker.job.as_ref().map(|job| job.effects))
            .finish_non_exhaustive()
    }
}

/// The key of a set: effects that change no shader are left out.
fn key(effects: Effects) -> Effects {
    effects - Effects::MOVING
}

/// A pipeline, or the payload of the panic that ended its making.
type Made<P> = std::thread::Result<P>;

#[cfg(not(target_family = "wasm"))]
type Make<P> = dyn Fn(Effects) -> P + Send + Sync;
#[cfg(target_family = "wasm")]
type Make<P> = dyn Fn(Effects) -> P;

/// Starts a thread that makes a variant.
type Start<P> = dyn Fn(Effects) -> io::Result<Job<P>> + Send + Sync;

/// Makes one variant at a time: on a thread of its own, or where there is none on the calling one.
struct VariantMaker<P> {
    make: Box<Make<P>>,
    /// `None` where there are no threads.
    start: Option<Box<Start<P>>>,
    job: Option<Job<P>>,
}

/// A thread that makes a variant.
#[cfg_attr(target_family = "wasm", allow(dead_code, reason = "there are no threads to make variants on"))]
struct Job<P> {
    effects: Effects,
    result: Receiver<P>,
    thread: JoinHandle<()>,
}

impl<P> VariantMaker<P> {
    fn without_threads(make: Box<Make<P>>) -> Self {
        Self { make, start: None, job: None }
    }

    #[cfg(not(target_family = "wasm"))]
    fn with_threads(make: impl Fn(Effects) -> P + Send + Sync + 'static) -> Self
    where
        P: Send + 'static,
    {
        let make = std::sync::Arc::new(make);
        let shared = make.clone();
        let start = move |effects| {
            let make = shared.clone();
            let (sender, result) = std::sync::mpsc::sync_channel(1);
            let thread = std::thread::Builder::new().name("girandole variant".into()).spawn(move || {
                // This fails once the cache is gone, which is no error.
                let _ = sender.send(make(effects));
            })?;
            Ok(Job { effects, result, thread })
        };
        Self { make: Box::new(move |effects| make(effects)), start: Some(Box::new(start)), job: None }
    }

    fn is_busy(&self) -> bool {
        self.job.is_some()
    }

    /// Starts to make a variant. Without a thread it is made here, and returned.
    fn start(&mut self, effects: Effects) -> Option<Made<P>> {
        self.job = self.start.as_ref().and_then(|start| start(effects).ok());
        if self.job.is_some() {
            return None;
        }
        Some(catch_unwind(AssertUnwindSafe(|| (self.make)(effects))))
    }

    /// The variant whose thread has finished.
    fn take_finished(&mut self) -> Option<(Effects, Made<P>)> {
        let result = match self.job.as_ref()?.result.try_recv() {
            Err(TryRecvError::Empty) => return None,
            result => result.ok(),
        };
        let job = self.job.take()?;
        let made = match result {
            Some(pipeline) => Ok(pipeline),
            // Without a pipeline, the thread has panicked.
            None => Err(job.thread.join().err().unwrap_or_else(|| Box::new("no pipeline"))),
        };
        Some((job.effects, made))
    }
}

impl<P> Drop for VariantMaker<P> {
    /// A thread in a driver's compiler must not outlive what tears the driver down.
    fn drop(&mut self) {
        if let Some(job) = self.job.take() {
            // If it panicked, the panic hook has reported that.
            let _ = job.thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::sync::mpsc::{Receiver, Sender, channel};
    use std::sync::{Arc, Mutex};
    use std::time::{Duration, Instant};

    use super::*;

    /// The set of the general pipeline.
    const GENERAL: Effects = Effects::all().difference(Effects::MOVING);

    /// A cache whose function reports each set that it starts on, and then waits for the test to
    /// send `true` to finish or `false` to panic.
    fn controlled() -> (PipelineVariants<Effects>, Sender<bool>, Receiver<Effects>) {
        let (allow, allowed) = channel();
        let (report, started) = channel();
        let channels = Arc::new(Mutex::new((allowed, report)));
        let make = move |effects| {
            let succeeds: bool = {
                let channels = channels.lock().expect("a panic comes after this block");
                channels.1.send(effects).expect("the test listens");
                channels.0.recv().expect("the test goes on")
            };
            assert!(succeeds, "a panic that the test asked for");
            effects
        };
        (PipelineVariants::new(GENERAL, make), allow, started)
    }

    /// A cache that never gets a thread, with the sets that its function was called for.
    fn without_threads(start: Option<Box<Start<Effects>>>) -> (PipelineVariants<Effects>, Receiver<Effects>) {
        let (report, started) = channel();
        let report = Mutex::new(report);
        let make = move |effects: Effects| {
            report.lock().expect("no panic before").send(effects).expect("the test listens");
            assert!(effects != Effects::AREAS, "a panic that the test asked for");
            effects
        };
        (PipelineVariants::with_maker(Some(GENERAL), VariantMaker { make: Box::new(make), start, job: None }), started)
    }

    /// Calls `get` until a variant is ready. The bound only ends a test that fails.
    fn await_ready(variants: &mut PipelineVariants<Effects>, effects: Effects) {
        let start = Instant::now();
        while *variants.get(effects) != effects {
            assert!(start.elapsed() < Duration::from_secs(60), "{effects:?} is never ready");
            std::thread::yield_now();
        }
    }

    #[test]
    fn the_general_pipeline_serves_until_the_variant_is_ready_and_one_is_made_at_a_time() {
        let (mut variants, allow, started) = controlled();
        let [one, two] = [Effects::CONES, Effects::CONES | Effects::RANGES];
        // The function waits for the test: if `get` waited for the function, this would never end.
        for _ in 0..100 {
            assert_eq!(*variants.get(two), GENERAL);
            assert_eq!(*variants.get(one), GENERAL);
        }
        assert_eq!(started.recv(), Ok(two));
        assert!(started.try_recv().is_err(), "two are made at a time");
        allow.send(true).expect("the function waits");
        await_ready(&mut variants, two);
        // The variant with the fewest other effects serves.
        assert_eq!(*variants.get(one), two);
        assert_eq!(started.recv(), Ok(one));
        allow.send(true).expect("the function waits");
        await_ready(&mut variants, one);
        assert_eq!(*variants.get(Effects::CONES), one);
        assert_eq!(*variants.get(two), two);
        assert_eq!(variants.ready().collect::<Vec<_>>(), [GENERAL, two, one]);
        assert_eq!(*variants.get(Effects::all()), GENERAL);
        assert!(started.try_recv().is_err(), "a variant that is ready is made again");
    }

    #[test]
    fn a_variant_whose_making_panics_is_not_tried_again_and_others_still_are_made() {
        let (mut variants, allow, started) = controlled();
        assert_eq!(*variants.get(Effects::CONES), GENERAL);
        allow.send(false).expect("the function waits");
        assert_eq!(started.recv(), Ok(Effects::CONES));
        // Asks until the failure is known and the next variant is started.
        allow.send(true).expect("the function will wait");
        await_ready(&mut variants, Effects::AREAS);
        assert_eq!(started.recv(), Ok(Effects::AREAS));
        for _ in 0..100 {
            assert_eq!(*variants.get(Effects::CONES), GENERAL);
        }
        // If the failed variant were being made again, it would be reported before this one.
        allow.send(true).expect("the function will wait");
        await_ready(&mut variants, Effects::RANGES);
        assert_eq!(started.try_iter().collect::<Vec<_>>(), [Effects::RANGES]);
    }

    #[test]
    fn the_least_recently_used_variant_is_dropped_and_the_general_pipeline_stays() {
        let (mut variants, allow, started) = controlled();
        let sets: Vec<_> = (0..=MAX_VARIANTS as u16).map(Effects::from_bits_truncate).collect();
        for (number, effects) in sets.iter().enumerate() {
            allow.send(true).expect("the function will wait");
            await_ready(&mut variants, *effects);
            // The first one stays in use.
            assert!(number == MAX_VARIANTS || variants.has(sets[0]));
            variants.get(sets[0]);
        }
        assert_eq!(started.try_iter().collect::<Vec<_>>(), sets);
        assert_eq!(variants.ready().count(), 1 + MAX_VARIANTS);
        assert!(variants.has(sets[0]) && !variants.has(sets[1]) && variants.has(sets[MAX_VARIANTS]));
        assert!(variants.has(Effects::all()));
    }

    #[test]
    fn sets_that_differ_only_in_moving_share_one_pipeline() {
        let (mut variants, allow, started) = controlled();
        allow.send(true).expect("the function will wait");
        await_ready(&mut variants, Effects::CONES);
        for effects in [Effects::CONES, Effects::CONES | Effects::MOVING] {
            assert_eq!(*variants.get(effects), Effects::CONES);
            assert!(variants.has(effects));
        }
        assert_eq!(*variants.get(GENERAL), GENERAL);
        assert!(variants.has(GENERAL) && variants.has(Effects::all()));
        // If another one were being made, this one would not be started.
        allow.send(true).expect("the function will wait");
        await_ready(&mut variants, Effects::RANGES);
        assert_eq!(started.try_iter().collect::<Vec<_>>(), [Effects::CONES, Effects::RANGES]);
    }

    #[test]
    fn without_threads_a_variant_is_made_at_once() {
        let (mut variants, started) = without_threads(None);
        assert_eq!(*variants.get(Effects::CONES), Effects::CONES);
        assert_eq!(*variants.get(Effects::CONES | Effects::MOVING), Effects::CONES);
        assert_eq!(*variants.get(Effects::all()), GENERAL);
        assert_eq!(*variants.get(Effects::RANGES), Effects::RANGES);
        assert_eq!(started.try_iter().collect::<Vec<_>>(), [Effects::CONES, Effects::RANGES]);
    }

    #[test]
    fn without_threads_a_variant_whose_making_panics_is_not_tried_again() {
        let (mut variants, started) = without_threads(None);
        for _ in 0..2 {
            assert_eq!(*variants.get(Effects::AREAS), GENERAL);
        }
        assert_eq!(*variants.get(Effects::CONES), Effects::CONES);
        assert_eq!(started.try_iter().collect::<Vec<_>>(), [Effects::AREAS, Effects::CONES]);
    }

    #[test]
    fn on_demand_only_what_is_asked_for_is_made_and_a_panic_reaches_the_caller() {
        let (report, started) = channel();
        let report = Mutex::new(report);
        let mut variants = PipelineVariants::on_demand(move |effects: Effects| {
            report.lock().expect("no panic before").send(effects).expect("the test listens");
            effects
        });
        assert_eq!(variants.ready().count(), 0);
        for _ in 0..2 {
            assert_eq!(*variants.get(Effects::all()), GENERAL);
            assert_eq!(*variants.get(Effects::CONES | Effects::MOVING), Effects::CONES);
        }
        assert_eq!(variants.ready().collect::<Vec<_>>(), [GENERAL, Effects::CONES]);
        assert_eq!(started.try_iter().collect::<Vec<_>>(), [GENERAL, Effects::CONES]);
        let mut broken = PipelineVariants::on_demand(|_| -> Effects { panic!("a panic that the test asked for") });
        let get = |broken: &mut PipelineVariants<Effects>| {
            catch_unwind(AssertUnwindSafe(|| *broken.get(Effects::CONES))).is_err()
        };
        assert!(get(&mut broken) && get(&mut broken));
    }

    #[test]
    fn a_thread_that_the_system_refuses_is_asked_for_again_with_the_next_variant() {
        let is_refused = Arc::new(AtomicBool::new(true));
        let refuses = is_refused.clone();
        let mut threads = VariantMaker::with_threads(|effects| effects);
        let spawn = threads.start.take().expect("there are threads on native platforms");
        let start = move |effects| match refuses.load(Ordering::Relaxed) {
            true => Err(io::Error::from(io::ErrorKind::WouldBlock)),
            false => spawn(effects),
        };
        let (mut variants, started) = without_threads(Some(Box::new(start)));
        assert_eq!(*variants.get(Effects::CONES), Effects::CONES, "made at once");
        is_refused.store(false, Ordering::Relaxed);
        await_ready(&mut variants, Effects::RANGES);
        assert_eq!(*variants.get(Effects::CONES), Effects::CONES);
        assert_eq!(started.try_iter().collect::<Vec<_>>(), [Effects::CONES], "the other one was made on a thread");
    }
}
