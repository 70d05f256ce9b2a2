//! Runs hot loops with the vector instructions that the machine has. The only file with unsafe code.
//!
//! Loops over the eight children of a node are written plainly and vectorised by the compiler, which may only use what
//! every x86-64 has (SSE2) unless it is told more. docs/decisions.md, 16, has what that buys.

/// Work to be compiled for several kinds of machines: `run` and all that it calls must be `#[inline(always)]`.
pub(crate) trait Job {
    type Output;

    fn run(self) -> Self::Output;
}

/// Runs a job, compiled with AVX2 where the machine has it. The results are the same bits: Rust never fuses or reorders
/// float operations by itself.
#[inline]
pub(crate) fn with_vectors<J: Job>(job: J) -> J::Output {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        fn with_avx2<J: Job>(job: J) -> J::Output {
            job.run()
        }
        if std::is_x86_feature_detected!("avx2") {
            // SAFETY: the machine has AVX2, as just asked; nothing else is required of the caller.
            #[allow(unsafe_code, reason = "the only way to call a function that needs a feature found at run time")]
            return unsafe { with_avx2(job) };
        }
    }
    job.run()
}
