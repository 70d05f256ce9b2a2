//! Spans of the crate `tracing` around what a frame does, with the feature `tracing`.

/// Begins a span that ends with the block around it.
macro_rules! span {
    ($name:literal) => {
        #[cfg(feature = "tracing")]
        let _span = tracing::info_span!(concat!("girandole ", $name)).entered();
    };
}
pub(crate) use span;
