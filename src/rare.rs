//! Values that most of their owners do not have.

use std::collections::VecDeque;
use std::ops::{Deref, DerefMut};

/// A value on the heap, or its empty state without any memory but that of a pointer.
///
/// It reads as `T::EMPTY` until it is first written to, which allocates it.
#[derive(Clone, Debug)]
pub(crate) struct Rare<T>(Option<Box<T>>);

/// Types whose empty state can be shared by all owners that have no more than that.
pub(crate) trait HasEmpty: Default + 'static {
    /// The default.
    const EMPTY: &'static Self;

    /// The bytes on the heap that the value owns.
    fn owned_bytes(&self) -> usize;
}

impl<T: HasEmpty> Rare<T> {
    /// Takes the value out, and leaves the empty state without memory.
    pub fn take(&mut self) -> Self {
        std::mem::take(self)
    }

    /// The bytes of the value on the heap, with those of what it owns.
    pub fn memory_bytes(&self) -> usize {
        self.0.as_ref().map_or(0, |value| size_of::<T>() + value.owned_bytes())
    }
}

impl<T> Default for Rare<T> {
    fn default() -> Self {
        Self(None)
    }
}

impl<T: HasEmpty> From<T> for Rare<T> {
    fn from(value: T) -> Self {
        Self(Some(Box::new(value)))
    }
}

impl<T: HasEmpty> Deref for Rare<T> {
    type Target = T;

    #[inline(always)]
    fn deref(&self) -> &T {
        self.0.as_deref().unwrap_or(T::EMPTY)
    }
}

impl<T: HasEmpty> DerefMut for Rare<T> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut T {
        self.0.get_or_insert_default()
    }
}

impl<T: 'static> HasEmpty for VecDeque<T> {
    const EMPTY: &'static Self = &Self::new();

    fn owned_bytes(&self) -> usize {
        size_of::<T>() * self.capacity()
    }
}

impl<T: 'static> HasEmpty for Vec<T> {
    const EMPTY: &'static Self = &Self::new();

    fn owned_bytes(&self) -> usize {
        size_of::<T>() * self.capacity()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_takes_memory_from_the_first_write_until_it_is_taken() {
        let mut list = Rare::<Vec<u32>>::default();
        assert_eq!((list.len(), list.memory_bytes(), size_of_val(&list)), (0, 0, 8));
        list.reserve_exact(3);
        list.push(7);
        assert_eq!((list.first(), list.memory_bytes()), (Some(&7), 24 + 12));
        assert_eq!((list.take().first(), list.memory_bytes()), (Some(&7), 0));
    }
}
