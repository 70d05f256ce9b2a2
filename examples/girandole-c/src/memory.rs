//! Reads and writes the caller's memory: the only module that follows pointers to values.

use std::marker::PhantomData;
use std::slice;

use crate::status::{
    Failure, GIRANDOLE_ERROR_BAD_LENGTH, GIRANDOLE_ERROR_MISALIGNED, GIRANDOLE_ERROR_NO_SPACE, GIRANDOLE_ERROR_NULL,
    call,
};

fn check<T>(pointer: *const T, what: &str) -> Result<(), Failure> {
    if pointer.is_null() {
        return Err(Failure::new(GIRANDOLE_ERROR_NULL, format!("{what} is NULL")));
    }
    if !pointer.is_aligned() {
        let message = format!("{what} is not aligned to {} bytes", align_of::<T>());
        return Err(Failure::new(GIRANDOLE_ERROR_MISALIGNED, message));
    }
    Ok(())
}

/// Checks the pointer and length of an array. An empty array may be NULL.
fn check_array<T>(pointer: *const T, count: usize, what: &str) -> Result<(), Failure> {
    if count == 0 {
        return Ok(());
    }
    if count.checked_mul(size_of::<T>()).is_none_or(|bytes| bytes > isize::MAX as usize) {
        let message = format!("{what} has {count} elements of {} bytes: more than memory can hold", size_of::<T>());
        return Err(Failure::new(GIRANDOLE_ERROR_BAD_LENGTH, message));
    }
    check(pointer, what)
}

/// An object of the caller, or one that this interface has made.
///
/// # Safety
/// `pointer` is NULL or points to a value that lives, and that nothing changes, for as long as `'a`.
pub(crate) unsafe fn object<'a, T>(pointer: *const T, what: &str) -> Result<&'a T, Failure> {
    check(pointer, what)?;
    // SAFETY: not null, aligned, and the rest is the caller's promise.
    Ok(unsafe { &*pointer })
}

/// An object that the call may change.
///
/// # Safety
/// As [`object`], and nothing else uses the value meanwhile.
pub(crate) unsafe fn object_mut<'a, T>(pointer: *mut T, what: &str) -> Result<&'a mut T, Failure> {
    check(pointer, what)?;
    // SAFETY: not null, aligned, and the rest is the caller's promise.
    Ok(unsafe { &mut *pointer })
}

/// An array that is only read.
///
/// # Safety
/// `pointer` is NULL or points to `count` values that live, and that nothing changes, for as long as `'a`.
pub(crate) unsafe fn array<'a, T>(pointer: *const T, count: usize, what: &str) -> Result<&'a [T], Failure> {
    check_array(pointer, count, what)?;
    if count == 0 {
        return Ok(&[]);
    }
    // SAFETY: not null, aligned, its size fits into `isize`, and the rest is the caller's promise.
    Ok(unsafe { slice::from_raw_parts(pointer, count) })
}

/// Frees an object that this interface has made. NULL is allowed. A panic is a bug that leaks memory.
///
/// # Safety
/// `pointer` is NULL or comes from `Box::into_raw`, and nothing uses the object any more.
pub(crate) unsafe fn destroy<T>(pointer: *mut T) {
    if !pointer.is_null() {
        // The caller has no use for the status.
        let _ = call(|| {
            // SAFETY: the caller's promise.
            drop(unsafe { Box::from_raw(pointer) });
            Ok(())
        });
    }
}

/// An array of the caller that a call fills. Its content may be undefined. It is no reference, since a caller
/// may pass one place for two results; the last result that is stored remains.
pub(crate) struct Output<'a, T> {
    places: *mut T,
    count: usize,
    lives: PhantomData<&'a T>,
}

/// # Safety
/// `pointer` is NULL or points to room for `count` values, which no reference and no other thread uses for as
/// long as `'a`.
pub(crate) unsafe fn output<'a, T>(pointer: *mut T, count: usize, what: &str) -> Result<Output<'a, T>, Failure> {
    check_array(pointer, count, what)?;
    Ok(Output { places: pointer, count, lives: PhantomData })
}

impl<T> Output<'_, T> {
    /// Fills the places in order, up to the shorter of both lengths.
    pub fn fill(self, values: impl IntoIterator<Item = T>) {
        for (index, value) in (0..self.count).zip(values) {
            // SAFETY: `output` has checked the pointer, and its caller promises room for `count` values. Nothing
            // is dropped or read.
            unsafe { self.places.add(index).write(value) };
        }
    }
}

/// A single value of the caller that a call stores.
///
/// # Safety
/// As [`output`] with one value.
pub(crate) unsafe fn result<'a, T>(pointer: *mut T, what: &str) -> Result<Output<'a, T>, Failure> {
    // SAFETY: the caller's promise.
    unsafe { output(pointer, 1, what) }
}

impl<T> Output<'_, T> {
    /// Stores the value of [`result`].
    pub fn set(self, value: T) {
        self.fill([value]);
    }
}

/// A single value that the caller may not want.
///
/// # Safety
/// As [`output`] with one value.
pub(crate) unsafe fn wanted<'a, T>(pointer: *mut T, what: &str) -> Result<Output<'a, T>, Failure> {
    // SAFETY: the caller's promise.
    unsafe { output(pointer, usize::from(!pointer.is_null()), what) }
}

/// Stores a list in an array of the caller and its length in `count`. If the array is too short, only the
/// length is stored.
///
/// # Safety
/// As [`output`] for both pointers.
pub(crate) unsafe fn list<T>(
    values: impl ExactSizeIterator<Item = T>,
    pointer: *mut T,
    capacity: usize,
    count: *mut usize,
) -> Result<(), Failure> {
    // SAFETY: the caller's promise.
    let (places, stored) = unsafe { (output(pointer, capacity, "the array")?, result(count, "count")?) };
    let needed = values.len();
    stored.set(needed);
    if needed > capacity {
        let message = format!("the list has {needed} elements; the array has room for {capacity}");
        return Err(Failure::new(GIRANDOLE_ERROR_NO_SPACE, message));
    }
    places.fill(values);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pointers_that_cannot_be_arrays_are_refused() {
        let words = [1_u32, 2];
        // SAFETY: refused pointers are not followed, and `words` lives.
        unsafe {
            let code = |pointer, count| array::<u32>(pointer, count, "x").map_err(|failure| failure.code);
            assert_eq!(code(words.as_ptr(), 2), Ok(&words[..]));
            assert_eq!(code(std::ptr::null(), 0), Ok(&[][..]));
            assert_eq!(code(std::ptr::null(), 1), Err(GIRANDOLE_ERROR_NULL));
            assert_eq!(code(words.as_ptr().cast::<u8>().wrapping_add(1).cast(), 1), Err(GIRANDOLE_ERROR_MISALIGNED));
            for count in [usize::MAX, isize::MAX as usize / 4 + 1, usize::MAX / 4 + 1] {
                assert_eq!(code(words.as_ptr(), count), Err(GIRANDOLE_ERROR_BAD_LENGTH), "{count}");
            }
        }
    }

    #[test]
    fn one_place_for_two_results_gets_the_last_one() {
        let mut place = 7_u32;
        let pointer = &raw mut place;
        // SAFETY: `place` lives, and only these results use it.
        let (first, second) = unsafe { (result(pointer, "first"), result(pointer, "second")) };
        first.expect("a pointer to a value").set(1);
        second.expect("a pointer to a value").set(2);
        assert_eq!(place, 2);
    }

    #[test]
    fn a_list_that_does_not_fit_leaves_the_array_and_tells_its_length() {
        let (mut places, mut count) = ([7_u32; 2], 0);
        // SAFETY: both live and are used by nothing else.
        let result = unsafe { list(1..4_u32, places.as_mut_ptr(), 2, &raw mut count) };
        assert_eq!(result.map_err(|failure| failure.code), Err(GIRANDOLE_ERROR_NO_SPACE));
        assert_eq!((places, count), ([7; 2], 3));
        // SAFETY: as above.
        unsafe { list(1..3_u32, places.as_mut_ptr(), 2, &raw mut count) }.expect("it fits");
        assert_eq!((places, count), ([1, 2], 2));
    }
}
