//! CPU time, which other programs on the machine disturb little.

use std::time::Duration;

/// The CPU time that this thread has taken so far. On systems other than Linux, the wall-clock time
/// since the first call.
pub fn thread_time() -> Duration {
    clock::thread()
}

/// The same of all threads of the process.
pub fn process_time() -> Duration {
    clock::process()
}

#[cfg(target_os = "linux")]
#[allow(unsafe_code, reason = "the standard library has no CPU time")]
mod clock {
    use std::time::Duration;

    pub fn thread() -> Duration {
        read(libc::CLOCK_THREAD_CPUTIME_ID)
    }

    pub fn process() -> Duration {
        read(libc::CLOCK_PROCESS_CPUTIME_ID)
    }

    fn read(clock: libc::clockid_t) -> Duration {
        let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
        // SAFETY: the call writes one `timespec`, which is ours.
        let outcome = unsafe { libc::clock_gettime(clock, &raw mut time) };
        assert_eq!(outcome, 0, "Linux has these clocks");
        Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
    }
}

#[cfg(not(target_os = "linux"))]
mod clock {
    use std::sync::OnceLock;
    use std::time::{Duration, Instant};

    pub fn thread() -> Duration {
        static START: OnceLock<Instant> = OnceLock::new();
        START.get_or_init(Instant::now).elapsed()
    }

    pub use thread as process;
}
