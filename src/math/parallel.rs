//! Loops over lists, which rayon's threads share with the feature `parallel`. The results do not depend on the threads.

/// The results of a function for all items, in their order.
pub(crate) fn map_all<T: Sync, R: Send>(items: &[T], result: impl Fn(&T) -> R + Sync + Send) -> Vec<R> {
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        items.par_iter().map(result).collect()
    }
    #[cfg(not(feature = "parallel"))]
    items.iter().map(result).collect()
}

/// The results of a function for all chunks of `size` items, in their order.
pub(crate) fn map_chunks<T: Sync, R: Send>(
    items: &[T],
    size: usize,
    result: impl Fn(&[T]) -> R + Sync + Send,
) -> Vec<R> {
    map_all(&items.chunks(size).collect::<Vec<_>>(), |chunk| result(chunk))
}

/// Calls a function with each chunk of `size` items and its number.
pub(crate) fn for_each_chunk<T: Send>(items: &mut [T], size: usize, work: impl Fn(usize, &mut [T]) + Sync + Send) {
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        items.par_chunks_mut(size).enumerate().for_each(|(number, chunk)| work(number, chunk));
    }
    #[cfg(not(feature = "parallel"))]
    items.chunks_mut(size).enumerate().for_each(|(number, chunk)| work(number, chunk));
}
