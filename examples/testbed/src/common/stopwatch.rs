//! The CPU time of a thread, which other programs on the machine disturb little.

use std::time::Duration;

/// The CPU time that this thread has taken so far. On systems other than Linux, the wall-clock time
/// since the first call.
#[cfg(target_os = "linux")]
#[allow(unsafe_code, reason = "the standard library has no CPU time of threads")]
pub fn thread_time() -> Duration {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: the call writes one `timespec`, which is ours.
    let outcome = unsafe { libc::clock_gettime(libc::CLOCK_THREAD_CPUTIME_ID, &raw mut time) };
    assert_eq!(outcome, 0, "Linux has this clock");
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}

/// The wall-clock time since the first call.
#[cfg(not(target_os = "linux"))]
pub fn thread_time() -> Duration {
    use std::sync::OnceLock;
    use std::time::Instant;
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed()
}
