//! Runs a loop with the vector instructions of the machine, as the library does for its own
//! (src/math/simd.rs), so that times compare.

/// Runs a job with AVX2 if the machine has it. All that it calls must be `#[inline(always)]`.
#[inline]
pub fn with_vectors<T>(job: impl FnOnce() -> T) -> T {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        fn with_avx2<T>(job: impl FnOnce() -> T) -> T {
            job()
        }
        if std::is_x86_feature_detected!("avx2") {
            // SAFETY: the machine has AVX2, as just detected. The function requires nothing else.
            #[allow(
                unsafe_code,
                reason = "the only way to call a function that needs a CPU feature detected at run time"
            )]
            return unsafe { with_avx2(job) };
        }
    }
    job()
}
